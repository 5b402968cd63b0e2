"""Flips given by hand: which end of a segment is nearer to the camera (Taylor 2000, section 3.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.linkages import Linkage
from posekit.tree import Leaves, Pruned

LEVEL_DEPTH = 1e-6
"""Metres (or units of length) below which neither end is nearer."""


@dataclass(frozen=True, kw_only=True, eq=False)
class NearerEnds:
    """Which end of which segment is nearer, frame by frame.

    Parameters
    ----------
    segments : tuple of str (S,)
        Names, ``a-b``.
    ends : tuple of (str, str)
        Names of their two ends.
    first : array (F, S)
        1 where the first end is the nearer, -1 where the second is, 0 where it is not said.
    """

    segments: tuple[str, ...]
    ends: tuple[tuple[str, str], ...]
    first: Array

    @staticmethod
    def of(given: Sequence[Mapping[str, str]], linkage: Linkage, frames: int) -> NearerEnds:
        """Read what was given: one mapping of segment to nearer end for all frames, or one a frame.

        Raises
        ------
        InputError
            Where a segment or an end is unknown, or the number of mappings is neither one nor that of the frames.
        """
        if len(given) not in (1, frames):
            raise InputError(
                f"--nearer: {len(given)} frames; expected {frames}, as the view has, or one for all of them"
            )
        first = np.zeros((len(given), len(linkage.segments)))
        for k, choices in enumerate(given):
            for name, end in choices.items():
                segment = linkage.segment(name)
                names = [linkage.nodes[node] for node in linkage.segments[segment]]
                if end not in names:
                    raise InputError(
                        f"--nearer: {name}: {end!r} is not one of its ends; expected {' or '.join(names)}"
                    )
                first[k, segment] = 1.0 if end == names[0] else -1.0
        return NearerEnds(
            segments=linkage.segment_names,
            ends=tuple((linkage.nodes[a], linkage.nodes[b]) for a, b in linkage.segments),
            first=np.broadcast_to(first, (frames, first.shape[1])),
        )

    def prune(self, leaves: Leaves, frames: NDArray[np.intp]) -> Leaves:
        """Drop leaves that are flipped otherwise; where the ends are level, nothing was flipped.

        Parameters
        ----------
        leaves : Leaves
            Survivors of the tree.
        frames : int array (H,)
            The view's frame of each hypothesis of the leaves.
        """
        for number, (name, ends) in enumerate(zip(self.segments, self.ends, strict=True)):
            wanted = self.first[frames, number][leaves.frame]
            if not wanted.any():
                continue
            joints = [leaves.joints.index(end) for end in ends]
            depths = leaves.positions(joints, np.arange(len(leaves.code)))[..., 2]
            ahead = (depths[:, 1] - depths[:, 0]) * wanted
            dead = ahead < -LEVEL_DEPTH
            if not dead.any():
                continue
            n = int(dead.sum())
            pruned = Pruned(
                level=leaves.level,
                frame=leaves.frame[dead],
                code=leaves.code[dead],
                check="nearer",
                where=(name,),
                unit="m",
                place=np.zeros(n, dtype=np.int8),
                value=ahead[dead],
                lower=np.zeros(n),
                upper=np.full(n, np.inf),
            )
            leaves = leaves.keep(~dead, leaves.frame, leaves.code, leaves.level, (*leaves.pruned, pruned))
        return leaves
