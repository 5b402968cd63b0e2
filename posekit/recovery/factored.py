"""Leaves as what they are made of: trunks, the limbs on each, and which of these each leaf is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.posture_set import PostureSet
from posekit.geometry import Array
from posekit.refinement.refine import BegunRefinement
from posekit.tree.factors import whole_bodies


@dataclass(frozen=True, kw_only=True, eq=False)
class FactoredLeaves:
    """N leaves of T trunks, with L limbs of each kind.

    Parameters
    ----------
    frame : int array (N,)
        The frame of each leaf, ascending.
    trunk_of : int array (N,)
        Its trunk.
    limb_of : int array (4, N)
        Its limbs, by kind.
    trunks, trunk_chi2 : array (T, 6, 3), (T,)
        The trunks, camera frame, metres, refined by themselves, and how badly they fit.
    limbs, limb_chi2 : tuple of 4 arrays (L, 2, 3), (L,)
        The limbs likewise, on their trunks, and what each adds to the chi2 of its trunk.
    """

    frame: NDArray[np.intp]
    trunk_of: NDArray[np.int32]
    limb_of: NDArray[np.int32]
    trunks: Array
    trunk_chi2: Array
    limbs: tuple[Array, ...]
    limb_chi2: tuple[Array, ...]

    @staticmethod
    def of(begun: BegunRefinement, frame: NDArray[np.intp], chosen: NDArray[np.bool_]) -> FactoredLeaves:
        """Take those leaves (N,) of a refinement that are chosen."""
        factors = begun.factors
        return FactoredLeaves(
            frame=frame[chosen],
            trunk_of=factors.trunk_of[chosen].astype(np.int32),
            limb_of=factors.limb_of[:, chosen].astype(np.int32),
            trunks=begun.trunks,
            trunk_chi2=begun.search.bases.found.chi2,
            limbs=begun.limbs,
            limb_chi2=begun.limb_chi2,
        )

    def posture_set(self, frame: int) -> PostureSet:
        """Return the set of one frame."""
        own = slice(*np.searchsorted(self.frame, [frame, frame + 1]))
        trunk_of, limb_of = self.trunk_of[own], self.limb_of[:, own]
        joints = whole_bodies(self.trunks, self.limbs, trunk_of, limb_of)
        chi2 = np.stack([values[which] for values, which in zip(self.limb_chi2, limb_of, strict=True)])
        return PostureSet.of(joints, self.trunk_chi2[trunk_of], chi2)
