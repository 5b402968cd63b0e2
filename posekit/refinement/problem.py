"""What is minimised: image points, root, lengths and limits, each divided by its standard deviation."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.refinement.anatomy import Anatomy
from posekit.refinement.optics import Optics


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """The data of N postures; the batch is the last axis.

    Parameters
    ----------
    anatomy : Anatomy
    optics : Optics
    image, weight : array (14, 2, N), (14, N)
        Pixels, and one over their standard deviation; zero where a joint was not seen.
    head_image, head_weight : array (5, 2, N), (5, N), optional
        Likewise the head's points.
    root, root_weight : array (3, N), (3, 3, N)
        Where the neck is known to be, and the whitening of its uncertainty: zero where nothing is known.
    limit_deviation : float
        Radians; infinite for no limits.
    shape_weight, limb_weight : array (9,), (4, 2), optional
        One over the relative standard deviations of the trunk's nine distances, and of the limbs' lengths, where
        lengths are varied.
    trunk_only : bool
        Leave the limbs as they are, and unseen.
    """

    anatomy: Anatomy
    optics: Optics
    image: Array
    weight: Array
    root: Array
    root_weight: Array
    limit_deviation: float
    head_image: Array | None = None
    head_weight: Array | None = None
    shape_weight: Array | None = None
    limb_weight: Array | None = None
    trunk_only: bool = False

    def take(self, rows: NDArray[np.intp] | slice) -> Problem:
        """Return the data of some postures."""
        changed: dict[str, object] = {"optics": self.optics.take(rows)}
        for item in fields(self):
            value = getattr(self, item.name)
            if item.name in PER_POSTURE and value is not None:
                changed[item.name] = value[..., rows]
        return replace(self, **changed)  # type: ignore[arg-type]

    def trunk_alone(self) -> Problem:
        """Return the same problem with the limbs left out."""
        return replace(self, trunk_only=True)

    @property
    def trunk_width(self) -> int:
        """How many numbers of the trunk are varied."""
        return 9 if self.shape_weight is None else 18

    @property
    def limb_width(self) -> int:
        """How many numbers of a limb are varied."""
        return 4 if self.limb_weight is None else 6


PER_POSTURE = ("image", "weight", "head_image", "head_weight", "root", "root_weight")
