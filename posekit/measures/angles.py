"""The angles between adjacent segments, and how far two postures' are apart (Taylor 2000, §3.2)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import InputError
from posekit.geometry import Array, cross
from posekit.measures.pairs import paired

Triple = tuple[int, int, int]

POSTURE_ANGLES: Final[tuple[Triple, ...]] = (
    (0, 1, 6),
    (0, 2, 7),
    (0, 3, 4),
    (0, 3, 5),
    (1, 6, 8),
    (2, 7, 9),
    (3, 4, 10),
    (3, 5, 11),
    (4, 10, 12),
    (5, 11, 13),
)
"""The ten angles of the 14 joints that a body can change: shoulders (from the neck), waist, elbows, hips, knees.

By index in `posekit.skeleton.JOINTS`. The angles inside the rigid torso and hips are not among them.
"""


class AngleDisparity(NamedTuple):
    """How far the angles of N postures are from their targets'.

    Attributes
    ----------
    degrees : array (..., T)
        The absolute difference of each angle, 0 to 180; NaN where one of its points is not known, or a segment has no
        length.
    left_out : int array (...)
        How many angles of each posture that were.
    """

    degrees: Array
    left_out: NDArray[np.int64]


def adjacent_segments(segments: Sequence[tuple[int, int]]) -> tuple[Triple, ...]:
    """Return every pair of segments that share an end, as the triple (a, b, c) of the angle at b.

    Parameters
    ----------
    segments : sequence of (int, int)
        Pairs of points.

    Returns
    -------
    tuple of (int, int, int)
        In the order of the segments.

    Raises
    ------
    InputError
        Where a segment starts and ends at one point.
    """
    for segment in segments:
        if len(segment) != 2 or segment[0] == segment[1]:
            raise InputError(f"segment {tuple(segment)} does not join two points; give each as (start, end)")
    triples = []
    for first, second in combinations(dict.fromkeys((min(s), max(s)) for s in segments), 2):
        for shared in set(first) & set(second):
            (a,), (c,) = ([end for end in segment if end != shared] for segment in (first, second))
            triples.append((a, shared, c))
    return tuple(triples)


def joint_angles(points: ArrayLike, triples: Sequence[Triple] = POSTURE_ANGLES) -> Array:
    """Return the angle at b between the segments to a and c, for each triple (a, b, c).

    By the arc tangent of cross and dot product, which keeps its digits where the segments are parallel.

    Parameters
    ----------
    points : array (..., P, 3)
        NaN where a point is not known.
    triples : sequence of (int, int, int)
        Indices into the points.

    Returns
    -------
    array (..., T)
        Degrees, 0 to 180; NaN where a point is not known or a segment has no length.

    Raises
    ------
    InputError
        Where a triple names a point that there is not, or one point twice.
    """
    given, _, _ = paired(points, points)
    index = np.array(_checked(triples, given.shape[-2]), dtype=np.intp).reshape(-1, 3)
    a, b, c = (given[..., index[:, k], :] for k in range(3))
    u, v = a - b, c - b
    angle = np.arctan2(np.linalg.norm(cross(u, v), axis=-1), (u * v).sum(axis=-1))
    short = (np.abs(u).max(axis=-1, initial=0.0) == 0) | (np.abs(v).max(axis=-1, initial=0.0) == 0)
    return np.where(short, np.nan, np.degrees(angle))


def angle_disparity(
    points: ArrayLike, target: ArrayLike, triples: Sequence[Triple] = POSTURE_ANGLES
) -> AngleDisparity:
    """Return the absolute differences of the angles of two postures: symmetric, and no alignment is needed.

    Parameters
    ----------
    points, target : array (..., P, 3)
        Corresponding points; NaN where a point is not known.
    triples : sequence of (int, int, int)
        The angles: those of the 14 joints unless told otherwise; `adjacent_segments` makes them of any segments.

    Raises
    ------
    InputError
        Where the shapes do not go together, a coordinate is infinite, or a triple is impossible.
    """
    x, y, _ = paired(points, target)
    degrees = np.abs(joint_angles(x, triples) - joint_angles(y, triples))
    return AngleDisparity(degrees, np.isnan(degrees).sum(axis=-1))


def _checked(triples: Sequence[Triple], count: int) -> list[Triple]:
    for triple in triples:
        if len(set(triple)) != 3 or not all(0 <= point < count for point in triple):
            raise InputError(f"angle {tuple(triple)}: expected three different points among 0 to {count - 1}")
    return list(triples)
