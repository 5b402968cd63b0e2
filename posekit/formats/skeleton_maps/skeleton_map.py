"""One map: the points of a format by name, in its order, and what each landmark of the body is made of."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from posekit.geometry import Array
from posekit.skeleton import FEET_POINTS, POINTS, other_side

LANDMARK_ORDER: Final = (*POINTS, "mid_shoulders", "mid_hips")
"""What a map can name: the 14 joints, the head's five points, and the girdles' middles.

Detectors and marker sets often have the middle of the shoulders or of the hips, which are neither the figure's neck
nor its pelvis (the pelvis joint is some 10 cm above the line of the hips).
"""
LANDMARK_INDEX: Final = {name: index for index, name in enumerate(LANDMARK_ORDER)}


@dataclass(frozen=True, kw_only=True)
class SkeletonMap:
    """Which points of a format stand for which landmarks.

    Parameters
    ----------
    name : str
        As ``body_25``; a file's path where it came from one.
    points : tuple of str
        The format's points by name, in its order; empty where its files name their points themselves, in any order.
    landmarks : mapping
        Landmark of `LANDMARK_ORDER` to the names of the points whose mean it is, mostly one.
    source : str
        Who says so: a citation.
    feet : mapping
        Toes and heels, by `posekit.skeleton.FEET_POINTS`, to the points whose mean they are.
    """

    name: str
    points: tuple[str, ...]
    landmarks: Mapping[str, tuple[str, ...]]
    source: str = ""
    feet: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def needed(self) -> tuple[str, ...]:
        """The names of all points that landmarks are made of."""
        return tuple(dict.fromkeys(name for names in self.landmarks.values() for name in names))

    def gather(self, values: Array, names: Sequence[str] = ()) -> Array:
        """Pick the landmarks out of a format's points.

        Parameters
        ----------
        values : array (..., K, n)
            Points in two or three coordinates, or n = 1 for a number a point; NaN where missing.
        names : sequence of str (K,), optional
            The names of the points in their order; the map's own where not given. Compared without case and
            punctuation.

        Returns
        -------
        array (..., 21, n)
            In the order of `LANDMARK_ORDER`; NaN where the format has none, or one of the points of a mean is missing.
        """
        return _gathered(self.landmarks, LANDMARK_ORDER, values, names or self.points)

    def gather_feet(self, values: Array, names: Sequence[str] = ()) -> Array:
        """Pick toes and heels (..., 4, n) out of a format's points, as `gather` does; NaN where the format has none."""
        return _gathered(self.feet, FEET_POINTS, values, names or self.points)

    def over(self, names: Sequence[str]) -> SkeletonMap:
        """Lay the map over the points of a file that names them itself, in the file's order.

        Parameters
        ----------
        names : sequence of str (K,)
            The file's names; compared without case and punctuation.

        Returns
        -------
        SkeletonMap
            Its `points` are the file's names; landmarks whose points are not all there are left out.
        """
        there = {plain(name): name for name in reversed(names)}
        landmarks, feet = (
            {
                landmark: tuple(there[plain(part)] for part in parts)
                for landmark, parts in placed.items()
                if all(plain(part) in there for part in parts)
            }
            for placed in (self.landmarks, self.feet)
        )
        return SkeletonMap(
            name=self.name, points=tuple(names), landmarks=landmarks, source=self.source, feet=feet
        )

    def swapped(self) -> SkeletonMap:
        """Exchange left and right, for files that have them the wrong way round."""
        return SkeletonMap(
            name=f"{self.name}, left and right exchanged",
            points=self.points,
            landmarks={other_side(landmark): parts for landmark, parts in self.landmarks.items()},
            source=self.source,
            feet={other_side(point): parts for point, parts in self.feet.items()},
        )


def _gathered(
    placed: Mapping[str, tuple[str, ...]], order: Sequence[str], values: Array, names: Sequence[str]
) -> Array:
    column = {plain(name): k for k, name in reversed(list(enumerate(names)))}
    found = np.full((*values.shape[:-2], len(order), values.shape[-1]), np.nan)
    for landmark, parts in placed.items():
        columns = [column[plain(part)] for part in parts if plain(part) in column]
        if len(columns) == len(parts):
            found[..., order.index(landmark), :] = values[..., columns, :].mean(axis=-2)
    return found


def plain(name: str) -> str:
    """Reduce a name to what is compared: letters and digits, lower case; a prefix before a colon goes."""
    return re.sub(r"[\W_]+", "", name.rpartition(":")[2].casefold())
