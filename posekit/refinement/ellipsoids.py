"""Survivors all of whose joints lie in a likelier one's ellipsoids."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from posekit.compiled import ellipsoid_kernels
from posekit.compiled.compiling import compiled, is_installed
from posekit.geometry import Array
from posekit.refinement.refined import Refined

ROUNDING_SQUARE_METRES = 1e-8
"""Square metres that are added to every variance: a neck that is known exactly has none."""

LOOKED_AHEAD = 4
"""Survivors of a frame whose covariances are found at once: those that are taken in by then need none."""


def held_by(refined: Refined, rows: NDArray[np.intp], square: float) -> NDArray[np.intp]:
    """Find for each survivor at `rows`, the best of a frame first, the first whose ellipsoids hold it, or itself.

    The squared Mahalanobis distance of each joint is less than `square`, by the covariance of the likelier one.
    """
    frame, joints = refined.frame[rows], np.ascontiguousarray(refined.joints[rows])
    taken_by, known = np.arange(len(rows)), np.zeros(len(rows), dtype=np.bool_)
    information = np.zeros((len(rows), 14, 3, 3))
    take = compiled(ellipsoid_kernels).take_in if is_installed() else take_in
    ends = [*np.flatnonzero(np.diff(frame, prepend=-1)).tolist(), len(rows)]
    waiting = [np.arange(begin, end) for begin, end in pairwise(ends) if end > begin + 1]
    while waiting:
        asked = np.concatenate([some[:LOOKED_AHEAD] for some in waiting])
        asked = asked[~known[asked]]
        covariance = refined.covariance_of(rows[asked]) + ROUNDING_SQUARE_METRES * np.eye(3)
        information[asked], known[asked] = np.linalg.inv(covariance), True
        left = [some[: take(joints, information, known, some, taken_by, square)] for some in waiting]
        waiting = [some for some in left if len(some) > 1]
    return taken_by


def take_in(
    joints: Array,
    information: Array,
    known: NDArray[np.bool_],
    waiting: NDArray[np.intp],
    taken_by: NDArray[np.intp],
    square: float,
) -> int:
    """Let those that wait take in others: `posekit.compiled.ellipsoid_kernels.take_in`."""
    rest = waiting
    while len(rest) > 1 and known[rest[0]]:
        first, rest = rest[0], rest[1:]
        apart = (joints[rest] - joints[first]).transpose(1, 0, 2)
        off = ((apart @ information[first]) * apart).sum(axis=2).max(axis=0)
        taken_by[rest[off < square]] = first
        rest = rest[~(off < square)]
    waiting[: len(rest)] = rest
    return len(rest)
