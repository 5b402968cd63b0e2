r"""Jumps: distances of joints, and of the body, from the positions that neighbouring frames predict.

A jump lasts one frame, or displaces the body for good, at once or over up to a sixth of a second. Forces bound
displacements: a body that moves by D in a time T, beyond its velocities before and after, has an acceleration of at
least :math:`4 D / T^2`, forward in the first half of the time and backward in the second. In rolls, kicks and flips
people exceed the bound, but their joints then move in different directions; those of a displaced body do not.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from posekit.geometry import Array, norm
from posekit.validators.motion.timeline import centred, filtered

#: Jump above which other checks do not judge a frame, metres.
LEAST_JUMP: Final = 0.06

#: Least jump of one frame near a lasting displacement, as a share of it.
DISPLACED_SHARE: Final = 0.5

#: Number of frames on either side that predict a position.
SIDE_FRAMES: Final = 3

#: Multiples of the neighbours' own misfit to subtract from a jump: inside the clip, and at its ends. Fast motion at few
#: frames per second fits no smooth curve, and is no jump.
JOINT_MISFITS, END_MISFITS = 3.0, 5.0


def _filter(at: int) -> tuple[Array, Array]:
    """Return filters over seven frames: of a jump of one frame (7,), and of the other frames' misfit (2, 7).

    The filters are the least-squares fit of a cubic and a jump of frame `at`. The two remaining degrees of freedom
    measure the misfit; their filters have unit length.
    """
    times = np.arange(7.0) - at
    design = np.column_stack([np.vander(times, 4, increasing=True), times == 0])
    return np.linalg.pinv(design)[-1], np.linalg.svd(design)[0][:, design.shape[1] :].T / np.sqrt(2.0)


#: Filters by the index of the jumping frame among seven frames: 3 inside a clip, 1 and 2 near its ends.
_FILTERS: Final = {at: _filter(at) for at in (1, 2, SIDE_FRAMES)}
_THIRD_DIFFERENCE: Final = np.array([1.0, -3.0, 3.0, -1.0])


def jumps_of(joints: Array, step: float) -> Array:
    """Return the jumps of joints (S, 14, 3) and of the body, in slots of `step` seconds (NaN if unknown).

    Returns
    -------
    array (S, 15)
        Jumps above the neighbours' own misfit, metres: of each joint, relative to a jump of the body, and of the body
        (the median joint); NaN if unknown.

    Notes
    -----
    The jump of one frame is its distance from the cubic through three frames on either side; at an end of the clip it
    is the third difference. A multiple of the neighbours' misfit is subtracted. `displaced_by` measures lasting
    displacements of the body.
    """
    count = len(joints)
    offset, misfit = (centred(one, count, SIDE_FRAMES) for one in _measured(joints, SIDE_FRAMES))
    body = middle(offset)
    alone = norm(body) - JOINT_MISFITS * middle(misfit)
    moved = alone > 0
    displaced = displaced_by(joints, step)
    if (alone > LEAST_JUMP).any():
        # Near a lasting displacement, smaller jumps of one frame follow from it.
        beside = sliding_window_view(np.pad(np.nan_to_num(displaced), SIDE_FRAMES), 2 * SIDE_FRAMES + 1)
        alone[alone < DISPLACED_SHARE * beside.max(axis=1)] = np.nan
        displaced = displaced_by(np.where((alone > LEAST_JUMP)[:, None, None], np.nan, joints), step)
    joint = norm(offset) - JOINT_MISFITS * misfit
    beside = norm(offset - body[:, None]) - JOINT_MISFITS * misfit
    joint = np.where(moved[:, None], np.minimum(beside, joint), joint)
    if count > 2 * SIDE_FRAMES:
        third = norm(filtered(joints, _THIRD_DIFFERENCE))
        joint[0] = third[0] - END_MISFITS * third[1:3].max(axis=0)
        joint[-1] = third[-1] - END_MISFITS * third[-3:-1].max(axis=0)
        for at in (1, 2):
            for end, frame, window in ((0, at, joints[:7]), (-1, -1 - at, joints[:-8:-1])):
                off, misfits = _measured(window, at)
                jump = norm(off[0]) - JOINT_MISFITS * misfits[0]
                # If the outermost frame jumps more, the frame beside it does not jump.
                joint[frame] = np.where((joint[end] > 0) & (joint[end] > jump), np.nan, jump)
    return np.column_stack([joint, np.fmax(alone, displaced)])


def _measured(joints: Array, at: int) -> tuple[Array, Array]:
    """Return the jump of frame `at` of each seven frames (N, 14, 3), and the misfit of the other frames (N, 14).

    The misfit is scaled by the uncertainty of the jump, which grows with the distance of `at` from the middle.
    """
    jump, misfit = _FILTERS[at]
    unsure = np.linalg.norm(jump) / np.linalg.norm(_FILTERS[SIDE_FRAMES][0])
    squares = sum(norm(filtered(joints, weights)) ** 2 for weights in misfit)
    return filtered(joints, jump), unsure * np.sqrt(squares)


#: Longest time of a displacement, seconds; slower displacements are motion.
LONGEST_SECONDS: Final = 1.0 / 6.0

#: Difference between the times over which displacements are measured, seconds.
BETWEEN_SECONDS: Final = 1.0 / 30.0

#: Time before and after a displacement that gives the velocities of joints, seconds.
VELOCITY_SECONDS: Final = 1.0 / 15.0

#: Largest acceleration of a whole body, metres a second squared: three times its weight, less its own; runners and
#: jumpers reach it (Cavanagh & Lafortune 1980, J. Biomech. 13).
PUSHED_ACCELERATION: Final = 20.0

#: Least speed of a second displacement beside one, as a share of its speed: wrong velocities alone give half.
BESIDE_SHARE: Final = 0.75

#: Multiple of the median distance of joints from the body's displacement to subtract from the displacement.
APART_TIMES: Final = 2.0


def displaced_by(joints: Array, step: float) -> Array:
    """Return the lasting displacement of the body (S,) in each slot of even time, metres; NaN in slots without one.

    Parameters
    ----------
    joints : array (S, 14, 3)
        Metres, in slots of even time; NaN where unknown.
    step : float
        Seconds a slot. If it is NaN, displacements take one slot only.

    Returns
    -------
    array (S,)
        Displacement, metres, minus the parts due to forces and to the motion of joints.
    """
    timed = step > 0
    side, apart = (
        max(round(seconds / step), 1) if timed else 2 for seconds in (VELOCITY_SECONDS, BETWEEN_SECONDS)
    )
    most = int(LONGEST_SECONDS / step + 1e-6) if timed else 1
    known = np.isfinite(joints[..., 0])
    # The mean joint moves with a displaced body: a fast first test.
    centre = np.nan_to_num(joints).sum(axis=1) / np.maximum(known.sum(axis=1), 1)[:, None]
    gaps = np.concatenate([[0], np.cumsum(~known.any(axis=1))])
    best, over = np.full(len(joints), -np.inf), np.ones(len(joints), dtype=np.intp)
    for count in sorted({1, *range(max(apart, 2), most + 1, apart)}):
        pushed = PUSHED_ACCELERATION * (count * step) ** 2 / 4 if timed else 0.0
        beyond = _beyond(joints, centre, gaps, count, side, pushed) / count
        better = beyond > best
        best[better], over[better] = beyond[better], count
    # The fastest window covers the displacement exactly; windows that end inside it have wrong velocities.
    found = np.full(len(joints), np.nan)
    while best.max(initial=0.0) > 0:
        first = int(best.argmax()) + 1
        last = first + int(over[first - 1]) - 1
        found[first : last + 1] = best[first - 1] * over[first - 1]
        # Windows that overlap the displacement repeat it; slower windows beside it follow from it.
        starts, fastest = np.arange(len(best)), best[first - 1]
        again = (starts < last) & (starts + over >= first)
        beside = (starts - side < last + apart) & (starts + over + side >= first - apart)
        best[again | (beside & (best < BESIDE_SHARE * fastest))] = 0.0
    return found


def _beyond(
    joints: Array, centre: Array, gaps: NDArray[np.intp], count: int, side: int, pushed: float
) -> Array:
    """Return the unexplained displacement in the `count` slots after each slot (S,), metres, 0 or more.

    `centre` (S, 3) is the mean of the joints, `gaps` (S + 1,) the number of empty slots before each slot, and `pushed`
    the displacement that forces explain.
    """
    weights = np.zeros(count + 2 * side + 1)
    share = count / (2.0 * side)
    weights[[0, side, side + count, -1]] = share, -1.0 - share, 1.0 + share, -share
    beyond = np.zeros(len(joints))
    at = np.flatnonzero(norm(filtered(centre, weights)) > pushed / 2.0)
    at = at[gaps[at + len(weights)] == gaps[at]]
    if len(at):
        ways = sum(weights[k] * joints[at + k] for k in np.flatnonzero(weights))
        body = middle(ways)
        apart = middle(norm(ways - body[:, None]))
        beyond[at + side] = np.nan_to_num(norm(body) - APART_TIMES * apart - pushed)
    return beyond


def middle(values: Array) -> Array:
    """Return the median over the known joints of (S, 14, ...)."""
    ordered = np.sort(values, axis=1)  # unknown joints come last
    number = np.isfinite(values).sum(axis=1, keepdims=True)
    low, high = (
        np.take_along_axis(ordered, np.maximum(k, 0), axis=1) for k in ((number - 1) // 2, number // 2)
    )
    return np.asarray(((low + np.where(number % 2, low, high)) / 2.0)[:, 0])
