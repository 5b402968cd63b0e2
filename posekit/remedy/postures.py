"""Postures, each by itself: the least change of their joints that every check passes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.remedy.constraints import MarginConstraints, margins_of
from posekit.remedy.nearest import nearest
from posekit.remedy.pieces import TORSO_AND_HIPS
from posekit.remedy.starts import SIDEWAYS_ANGLES, TOWARD_REST, sideways, toward_rest
from posekit.skeleton import HEAD, JOINTS, LIMB_JOINTS, POINTS
from posekit.tree import Check

HEAD_POINT_WEIGHT: Final = 0.2
"""Of a head point: all five together weigh as much as a joint."""

AT_ONCE: Final = 256
"""Postures of a batch."""


BETTER_COST: Final = 0.999
"""Of the cost of what is found: another start must lead to less to be taken."""


def joint_weights(joints: Array | None = None) -> Array:
    """Return the weights of points (19,): those of the 14 joints, one each unless told otherwise, and of the head's."""
    weights = np.full(len(POINTS), HEAD_POINT_WEIGHT)
    weights[: len(JOINTS)] = 1.0 if joints is None else joints
    return weights


def nearest_valid(target: Array, suite: Sequence[Check], weight: Array, start: Array | None = None) -> Array:
    """Find the nearest postures that a suite of checks passes, as far as they can be found.

    Distances that are off are first brought within their bounds by the least change of the joints. Then all lengths
    stay, and the pieces of the body turn.

    Parameters
    ----------
    target : array (N, 19, 3)
        What postures are sought near to, metres; NaN where unknown.
    suite : sequence of Check
        What they must pass.
    weight : array (N, 19)
        Of squared distances.
    start : array (N, 19, 3), optional
        Legal postures from which alone the search starts, and whose lengths count.

    Returns
    -------
    array (N, 19, 3)
        Postures without torso or hips stay as they are.
    """
    out = (target if start is None else start).copy()
    placed = np.flatnonzero(np.isfinite(out[:, list(TORSO_AND_HIPS)]).all(axis=(1, 2)))
    for first in range(0, len(placed), AT_ONCE):
        rows = placed[first : first + AT_ONCE]
        if start is None:
            out[rows] = _of_batch(target[rows], suite, weight[rows])
        else:
            turning = MarginConstraints(checks=[check for check in suite if not check.rigid])
            out[rows], _ = nearest(target[rows], out[rows], weight[rows], turning)
    return out


def _of_batch(target: Array, suite: Sequence[Check], weight: Array) -> Array:
    out = target.copy()
    rigid = MarginConstraints(checks=[check for check in suite if check.rigid], free=True)
    turning = MarginConstraints(checks=[check for check in suite if not check.rigid])
    off = _violated(rigid, out)
    if off.size:
        found, _ = nearest(target[off], out[off], weight[off], rigid)
        head = found[:, :1] - out[off][:, :1]
        found[:, list(HEAD)] = out[off][:, list(HEAD)] + head
        out[off] = found
    bad = _violated(turning, out)
    if not bad.size:
        return out
    lengths, aim, weighed = out[bad], target[bad], weight[bad]
    limbs = _limbs_violated(turning, lengths)
    begins = [lengths, *(sideways(lengths, limbs, angle) for angle in SIDEWAYS_ANGLES)]
    best, cost = _best_of(begins, aim, weighed, turning)
    left = _violated(turning, best)
    if left.size:
        begins = [toward_rest(lengths[left], limbs[left], share) for share in TOWARD_REST]
        found, other = _best_of(begins, aim[left], weighed[left], turning)
        better = other < cost[left]
        best[left[better]] = found[better]
    out[bad] = best
    return out


def _best_of(
    begins: Sequence[Array], target: Array, weight: Array, constraints: MarginConstraints
) -> tuple[Array, Array]:
    """Search from several postures each, and return the first of those that cost hardly more than the least."""
    ways, count = len(begins), len(target)
    every = np.tile(np.arange(count), ways)
    found, cost = nearest(target[every], np.concatenate(begins), weight[every], constraints)
    found, cost = found.reshape(ways, *target.shape), cost.reshape(ways, count)
    first = np.argmax(cost * BETTER_COST <= cost.min(axis=0), axis=0)
    return found[first, np.arange(count)], cost[first, np.arange(count)]


def _limbs_violated(constraints: MarginConstraints, points: Array) -> NDArray[np.bool_]:
    """Return which limbs some violated check is of (N, 4)."""
    limbs = np.zeros((len(points), len(LIMB_JOINTS)), dtype=np.bool_)
    for check in constraints.checks:
        bad = (margins_of(check, points[:, list(check.points)]) < 0).any(axis=1)
        for limb, joints in enumerate(LIMB_JOINTS):
            limbs[:, limb] |= bad & bool(set(joints[1:]) & set(check.points))
    return limbs


def _violated(constraints: MarginConstraints, points: Array) -> NDArray[np.intp]:
    return np.flatnonzero((constraints.margins(points) < 0).any(axis=1))
