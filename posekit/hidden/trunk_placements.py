"""Placements of the trunk (torso and hips), and the turn that is free in them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from posekit.geometry import Array, rotation_about, unit
from posekit.hidden.posture_rows import Index, Mask

N_SUBSAMPLES = 8
"""Parts into which the neighbourhood of a sample is split: eight arcs, or a cube's eight corners."""

EXACT_WITHIN_METRES = 1e-6
"""Metres of tolerance, and of misfit, up to which points are exact: what a rigid part then forbids is proven."""

CUBE_CORNERS = np.stack(np.meshgrid(*[[-0.25, 0.25]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)


@dataclass(frozen=True, kw_only=True, eq=False)
class Turn:
    """The freedom of a rigid part: about two known points an angle, about one all rotations.

    Parameters
    ----------
    pivot : int
        The known joint that it turns about.
    about : int or None
        The second one.
    free : tuple of int
        The joints that turn.
    body : array (len(free), 3)
        Where those are from the pivot, in the part's own frame, metres.
    """

    pivot: int
    about: int | None
    free: tuple[int, ...]
    body: Array

    @property
    def finer(self) -> float:
        """How much nearer the children of neighbouring samples are to each other than the samples."""
        return 1.0 / N_SUBSAMPLES if self.about is not None else 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class TrunkPlacements:
    """H placements of the trunk, for C cores: sets of known joints.

    Parameters
    ----------
    core : int array (H,)
        In order.
    points : array (H, P, 3)
        The core's points, those of the trunk filled in.
    even : bool array (H,)
        Whether it belongs to an even sample of the turn; else it was found by a closer look.
    R : array (H, 3, 3)
        How the rigid part that turned last was laid on; NaN where none was.
    tried : array (C,)
        How many places were judged, as evenly spread as those that are left.
    spacing : array (C,)
        Radians between neighbours, or 0 where there is a finite number of places.
    sure : bool array (C,)
        Whether what is not here is proven impossible.
    miss : array (C,)
        How far the best place looked at is from being feasible, radians; 0 where one is.
    turn : Turn or None
        What the places differ by, where it is one turn.
    """

    core: Index
    points: Array
    R: Array
    even: Mask
    tried: Array
    spacing: Array
    sure: Mask
    miss: Array
    turn: Turn | None = None

    @staticmethod
    def of(points: Array) -> TrunkPlacements:
        """Take the cores (C, P, 3) as they are."""
        n = len(points)
        return TrunkPlacements(
            core=np.arange(n),
            points=points,
            R=np.full((n, 3, 3), np.nan),
            even=np.ones(n, dtype=bool),
            tried=np.ones(n),
            spacing=np.zeros(n),
            sure=np.ones(n, dtype=bool),
            miss=np.zeros(n),
        )

    def __len__(self) -> int:
        """Count the places."""
        return len(self.core)

    def take(self, rows: Index | Mask) -> TrunkPlacements:
        """Take some places."""
        return replace(
            self, core=self.core[rows], points=self.points[rows], R=self.R[rows], even=self.even[rows]
        )

    def and_(self, other: TrunkPlacements) -> TrunkPlacements:
        """Add places of the same cores."""
        both = replace(
            self,
            core=np.concatenate([self.core, other.core]),
            points=np.concatenate([self.points, other.points]),
            R=np.concatenate([self.R, other.R]),
            even=np.concatenate([self.even, other.even]),
        )
        return both.take(np.argsort(both.core, kind="stable"))

    def uneven(self) -> TrunkPlacements:
        """Say of all places that they were found by a closer look."""
        return replace(self, even=np.zeros(len(self), dtype=bool))

    def filled(self, R: Array, turn: Turn) -> TrunkPlacements:
        """Lay a rigid part onto all places by rotations (H, 3, 3)."""
        points = self.points.copy()
        for joint, offset in zip(turn.free, turn.body, strict=True):
            points[:, joint] = points[:, turn.pivot] + np.einsum("nij,j->ni", R, offset)
        return replace(self, points=points, R=R)

    def split(self, rows: Index, width: Array) -> tuple[TrunkPlacements, Index]:
        """Split the neighbourhoods of some places into eight, `width` (len(rows),) radians across.

        Returns
        -------
        TrunkPlacements, parent
            The children, and which of `rows` each is from.
        """
        if self.turn is None:
            return self.take(rows[:0]), rows[:0]
        parent = np.repeat(np.arange(len(rows)), N_SUBSAMPLES)
        each = self.take(rows[parent])
        if self.turn.about is not None:
            axis = unit(each.points[:, self.turn.about] - each.points[:, self.turn.pivot])
            part = (np.arange(N_SUBSAMPLES) + 0.5) / N_SUBSAMPLES - 0.5
            angle = np.tile(part, len(rows)) * width[parent]
        else:
            vector = np.tile(CUBE_CORNERS, (len(rows), 1)) * width[parent, None]
            axis, angle = unit(vector), np.linalg.norm(vector, axis=1)
        return each.filled(rotation_about(axis, angle) @ each.R, self.turn), parent


def thinning(group: Index, most: int) -> Index:
    """Choose at most so many rows of each group, evenly; `group` is in order."""
    count = np.bincount(group, minlength=1)
    first = np.cumsum(count) - count
    rank: Index = np.arange(len(group)) - first[group]
    many = np.maximum(count, 1)[group]
    return np.flatnonzero((many <= most) | ((rank + 1) * most // many > rank * most // many))
