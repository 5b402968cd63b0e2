"""Whether the model can take a posture at all: how far its joints stay from the posture's."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.robots.kinematics import Kinematics
from posekit.validators.suite import Judgement

RIGID_METRES = 1e-9
"""Metres by which the distance of two points of one body may change over configurations."""


def rigid_pairs(kinematics: Kinematics) -> NDArray[np.intp]:
    """List the pairs of points (R, 2) whose distance is the same in every configuration."""
    points = kinematics.positions(kinematics.generic)
    pairs = np.array(list(combinations(range(points.shape[1]), 2)), dtype=np.intp).reshape(-1, 2)
    distance = np.linalg.norm(points[:, pairs[:, 0]] - points[:, pairs[:, 1]], axis=2)
    rigid: NDArray[np.intp] = pairs[np.ptp(distance, axis=0) < RIGID_METRES]
    return rigid


def judge_reach(kinematics: Kinematics, targets: Array, residual: Array, *, tolerance: float) -> Judgement:
    r"""Judge how far a fit stays from its posture.

    A point that is off by more than the tolerance is no proof: the search may have missed a better fit. It is one
    where two points of a rigid part are seen at a distance that differs from the model's by more than twice the
    tolerance: :math:`|d - \hat d| \le r_a + r_b` holds for any fit, so one of the two is always farther off than the
    tolerance. Such a posture is rejected; without that proof it is undecided.

    Parameters
    ----------
    kinematics : Kinematics
        The model and its points.
    targets : array (N, P, 3)
        The posture's points, metres; NaN is unknown.
    residual : array (N, P)
        Distances of the fit's points from them.
    tolerance : float
        Metres.
    """
    pairs = rigid_pairs(kinematics)
    own = kinematics.positions(kinematics.neutral[None])[0]
    off = np.abs(_distances(targets, pairs) - _distances(own[None], pairs))
    proven = off > 2 * tolerance
    violated = np.zeros(residual.shape, dtype=np.bool_)
    for k, pair in enumerate(pairs):
        rows = np.flatnonzero(proven[:, k])
        violated[rows, pair[np.argmax(residual[rows][:, pair], axis=1)]] = True
    margin = tolerance - residual
    beyond = (margin < 0).any(axis=1)
    margin[beyond & ~violated.any(axis=1)] = np.nan
    return Judgement(
        check="reach",
        where=kinematics.names,
        unit=("m",) * len(kinematics.names),
        value=residual,
        lower=np.broadcast_to(-np.inf, residual.shape),
        upper=np.broadcast_to(tolerance, residual.shape),
        margin=margin,
        violated=violated,
    )


def _distances(points: Array, pairs: NDArray[np.intp]) -> Array:
    return np.asarray(np.linalg.norm(points[:, pairs[:, 0]] - points[:, pairs[:, 1]], axis=2))
