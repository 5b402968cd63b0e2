"""Angles of shoulders and hips through the frames of a recording, without jumps between two ways to say the same."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array, other_branch, turned_near
from posekit.skeleton import DOFS

BALL_JOINTS: Final = tuple(
    [DOFS.index(f"{side}_{joint}.{name}") for name in ("flexion", "abduction", "rotation")]
    for joint in ("shoulder", "hip")
    for side in ("right", "left")
)

OUTSIDE_WEIGHT: Final = 0.1
"""A radian outside the limits in one frame, in radians of a jump: within limits for long, but not at any price."""

CROSSED_COST: Final = 0.01
"""Radians of a jump that a frame costs whose second angle is beyond a right angle: where both will do, it is not."""


def steady_angles(angles: Array, lower: Array, upper: Array) -> Array:
    r"""Say the angles of shoulders and hips so that they jump as little as they can.

    A rotation has two decompositions (`posekit.geometry.other_branch`). Frame by frame the one inside the limits is
    taken, and where both are hardly inside it changes from frame to frame, by up to half a turn in each angle. Here
    that sequence of the two is taken of which the largest changes of an angle, the radians outside the limits times
    `OUTSIDE_WEIGHT`, and `CROSSED_COST` are least together (Viterbi). The posture stays as it is.

    Parameters
    ----------
    angles : array (T, 22)
        Radians, one row a frame, in the order of `posekit.skeleton.DOFS`; NaN where they are not known.
    lower, upper : array (22,)
        Limits, radians.

    Returns
    -------
    array (T, 22)
    """
    found = angles.copy()
    for joint in BALL_JOINTS:
        known = np.flatnonzero(np.isfinite(angles[:, joint]).all(axis=1))
        if len(known) > 1:
            found[known[:, None], joint] = _steady(angles[known][:, joint], lower[joint], upper[joint])
    return found


def angles_near(angles: Array, reference: Array) -> Array:
    """Say the angles of shoulders and hips in that of both ways that is nearer to a reference.

    Parameters
    ----------
    angles : array (N, 22)
        Radians; NaN where they are not known.
    reference : array (22,)
        Radians; where it is NaN, angles stay as they are.

    Returns
    -------
    array (N, 22)
    """
    found = angles.copy()
    for joint in BALL_JOINTS:
        if np.isfinite(reference[joint]).all():
            given = angles[:, joint]
            both = turned_near(np.stack([given, other_branch(given)], axis=1), reference[joint])
            off = np.abs(both - reference[joint]).max(axis=-1)
            found[:, joint] = both[np.arange(len(given)), (off[:, 1] < off[:, 0]).astype(np.intp)]
    return found


def _steady(given: Array, lower: Array, upper: Array) -> Array:
    """Choose among both decompositions (T, 3) of one joint."""
    both = turned_near(np.stack([given, other_branch(given)], axis=1), (lower + upper) / 2)
    own = np.maximum(np.maximum(lower - both, both - upper), 0.0).max(axis=-1) * OUTSIDE_WEIGHT
    own += np.where(np.abs(both[..., 1]) > np.pi / 2, CROSSED_COST, 0.0)
    jump = np.abs(both[1:, None, :] - both[:-1, :, None]).max(axis=-1)  # (T - 1, before, after)
    cost, came = own[0], np.empty(jump.shape[::2], dtype=np.intp)
    for k, (step, each) in enumerate(zip(jump, own[1:], strict=True)):
        through = cost[:, None] + step
        came[k] = through.argmin(axis=0)
        cost = through.min(axis=0) + each
    choice = np.empty(len(given), dtype=np.intp)
    choice[-1] = cost.argmin()
    for k in range(len(came) - 1, -1, -1):
        choice[k] = came[k, choice[k + 1]]
    return np.asarray(both[np.arange(len(given)), choice])
