"""How far bodies may overlap where noise has put joints some centimetres off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.tree import Check
from posekit.validators import judge

CONTACT: Final = 0.03
"""Metres by which bodies may come nearer than they should, before refinement and after it: depths are off by as much,
and refinement knows nothing of bodies."""


def contact_under_noise(asked: float) -> float:
    """Return the margin (m) that bodies must keep under noise; negative allows penetration, as in `asked`."""
    return asked - CONTACT


@dataclass(frozen=True, kw_only=True, eq=False)
class Overlaps:
    """Which of N postures have bodies that overlap too far.

    Parameters
    ----------
    where : tuple of str
        The pairs of bodies.
    place : int8 array (N,)
        The pair that overlaps most, where one does too far; otherwise -1.
    distance : array (N,)
        Of its bodies, metres, negative as they overlap; NaN where none do too far.
    """

    where: tuple[str, ...] = ()
    place: NDArray[np.int8]
    distance: Array

    @staticmethod
    def none(count: int) -> Overlaps:
        """Return what `count` postures have that are not judged."""
        return Overlaps(place=np.full(count, -1, dtype=np.int8), distance=np.full(count, np.nan))

    @staticmethod
    def of(checks: Sequence[Check], points: Array) -> Overlaps:
        """Judge postures (N, 19, 3), metres; what is not known collides with nothing."""
        found = Overlaps.none(len(points))
        if not (checks and len(points)):
            return found
        (judgement,) = judge(checks, points)
        bad = judgement.violated.any(axis=1)
        worst = np.where(judgement.violated, judgement.value, np.inf).argmin(axis=1)
        rows = np.arange(len(points))
        return Overlaps(
            where=judgement.where,
            place=np.where(bad, worst, -1).astype(np.int8),
            distance=np.where(bad, judgement.value[rows, worst], np.nan),
        )

    def at(self, rows: NDArray[np.intp], count: int) -> Overlaps:
        """Say of `count` postures what is said here of some `rows` of them; the others were not judged."""
        among = Overlaps.none(count)
        place, distance = among.place, among.distance
        place[rows], distance[rows] = self.place, self.distance
        return Overlaps(where=self.where, place=place, distance=distance)

    @staticmethod
    def joined(parts: list[Overlaps]) -> Overlaps:
        """Put the postures of one part behind those of the last."""
        where = max((part.where for part in parts), key=len)
        place, distance = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("place", "distance")
        )
        return Overlaps(where=where, place=place, distance=distance)
