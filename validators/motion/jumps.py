r"""Jumps: distances of joints, and of the body, from the positions that neighbouring frames predict.

A jump either lasts one frame, or displaces the body permanently within up to a sixth of a second. Forces limit real
displacements. Let D be the displacement in a time T, in addition to motion at constant velocity. It requires an
acceleration of at least :math:`4 D / T^2`: forward in the first half of T, backward in the second half. In rolls, kicks
and flips people exceed `PUSHED_ACCELERATION`, but then their joints move in different directions. The joints of a
displaced body move in the same direction.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from posekit.geometry import Array, norm
from posekit.validators.motion.timeline import centred, filtered

#: Minimum jump, metres, at which other checks of motion skip the frame or the joint.
LEAST_JUMP: Final = 0.06

#: Minimum jump of one frame near a permanent displacement, as a share of the displacement.
DISPLACED_SHARE: Final = 0.5

#: Number of frames on each side from which a position is predicted.
SIDE_FRAMES: Final = 3

#: Multiple of the neighbours' misfit that is subtracted from a jump: inside the clip, and near its start and end. Fast
#: motion at a low frame rate fits no smooth curve either, but is no jump.
JOINT_MISFITS, END_MISFITS = 3.0, 5.0


def _filter(at: int) -> tuple[Array, Array]:
    """Return linear filters over seven frames: for the jump of one frame (7,), and the other frames' misfit (2, 7).

    A least-squares fit determines a cubic polynomial in time, and the jump of frame `at` from this polynomial. The fit
    leaves two degrees of freedom, which measure the misfit.
    """
    times = np.arange(7.0) - at
    design = np.column_stack([np.vander(times, 4, increasing=True), times == 0])
    return np.linalg.pinv(design)[-1], np.linalg.svd(design)[0][:, design.shape[1] :].T / np.sqrt(2.0)


#: Filters by the index of the jumping frame among seven frames: 3 inside a clip, 1 and 2 near its start and end.
_FILTERS: Final = {at: _filter(at) for at in (1, 2, SIDE_FRAMES)}
_THIRD_DIFFERENCE: Final = np.array([1.0, -3.0, 3.0, -1.0])


def jumps_of(joints: Array, step: float) -> Array:
    """Measure the jumps of joints (S, 14, 3) and of the body in time slots of `step` seconds (NaN if unknown).

    Returns
    -------
    array (S, 15)
        Jumps minus a multiple of the neighbouring frames' misfit, metres; NaN if unknown. The first 14 columns are
        jumps of the joints relative to the body. The last column is the jump of the body: the median over the joints.

    Notes
    -----
    The jump of one frame is its distance from the cubic polynomial fitted to three frames on each side. In the first
    and last frame it is the third difference. The misfit is the deviation of the neighbouring frames from the
    polynomial. `displaced_by` measures permanent displacements of the body.
    """
    count = len(joints)
    offset, misfit = (centred(one, count, SIDE_FRAMES) for one in _measured(joints, SIDE_FRAMES))
    body = middle(offset)
    alone = norm(body) - JOINT_MISFITS * middle(misfit)
    moved = alone > 0
    displaced = displaced_by(joints, step)
    if (alone > LEAST_JUMP).any():
        # A permanent displacement also causes smaller jumps of single frames near it.
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
                # If the first or last frame jumps more, its neighbour does not jump.
                joint[frame] = np.where((joint[end] > 0) & (joint[end] > jump), np.nan, jump)
    return np.column_stack([joint, np.fmax(alone, displaced)])


def _measured(joints: Array, at: int) -> tuple[Array, Array]:
    """Measure the jump (N, 14, 3) of frame `at` in each window of seven frames, and the misfit (N, 14) of the others.

    The misfit is multiplied by the relative uncertainty of the jump, which is 1 if `at` is the middle of the window.
    """
    jump, misfit = _FILTERS[at]
    unsure = np.linalg.norm(jump) / np.linalg.norm(_FILTERS[SIDE_FRAMES][0])
    squares = sum(norm(filtered(joints, weights)) ** 2 for weights in misfit)
    return filtered(joints, jump), unsure * np.sqrt(squares)


#: Longest time of a displacement, seconds; slower displacements are motion.
LONGEST_SECONDS: Final = 1.0 / 6.0

#: Increment between the durations over which displacements are measured, seconds.
BETWEEN_SECONDS: Final = 1.0 / 30.0

#: Time before, and after, a displacement in which the velocities of joints are measured, seconds.
VELOCITY_SECONDS: Final = 1.0 / 15.0

#: Largest acceleration of a whole body, metres per second squared: a ground force of three times the weight, minus the
#: weight, as of runners (Cavanagh & Lafortune 1980, J. Biomech. 13).
PUSHED_ACCELERATION: Final = 20.0

#: Minimum speed of a displacement next to a faster one, as a share of the faster one's speed. Wrong velocities alone
#: cause a share of a half.
BESIDE_SHARE: Final = 0.75

#: Multiple of the joints' median deviation from the body's displacement that is subtracted from the displacement.
APART_TIMES: Final = 2.0


def displaced_by(joints: Array, step: float) -> Array:
    """Measure permanent displacements of the whole body that forces do not explain.

    Parameters
    ----------
    joints : array (S, 14, 3)
        Joint positions in time slots of equal duration, metres; NaN where unknown.
    step : float
        Duration of a slot, seconds. If it is NaN, only displacements within one slot are measured.

    Returns
    -------
    array (S,)
        Displacement in each slot, metres, minus the parts explained by forces and by joints that move differently; NaN
        in slots without a displacement.
    """
    timed = step > 0
    side, apart = (
        max(round(seconds / step), 1) if timed else 2 for seconds in (VELOCITY_SECONDS, BETWEEN_SECONDS)
    )
    most = int(LONGEST_SECONDS / step + 1e-6) if timed else 1
    known = np.isfinite(joints[..., 0])
    # A fast first test: a displacement of the body also displaces the mean of the joints.
    centre = np.nan_to_num(joints).sum(axis=1) / np.maximum(known.sum(axis=1), 1)[:, None]
    gaps = np.concatenate([[0], np.cumsum(~known.any(axis=1))])
    best, over = np.full(len(joints), -np.inf), np.ones(len(joints), dtype=np.intp)
    for count in sorted({1, *range(max(apart, 2), most + 1, apart)}):
        pushed = PUSHED_ACCELERATION * (count * step) ** 2 / 4 if timed else 0.0
        beyond = _beyond(joints, centre, gaps, count, side, pushed) / count
        better = beyond > best
        best[better], over[better] = beyond[better], count
    # The window with the fastest displacement covers it exactly. Windows that end inside it have wrong velocities.
    found = np.full(len(joints), np.nan)
    while best.max(initial=0.0) > 0:
        first = int(best.argmax()) + 1
        last = first + int(over[first - 1]) - 1
        found[first : last + 1] = best[first - 1] * over[first - 1]
        # Windows that overlap this displacement measure it again, and it causes slower displacements next to it.
        starts, fastest = np.arange(len(best)), best[first - 1]
        again = (starts < last) & (starts + over >= first)
        beside = (starts - side < last + apart) & (starts + over + side >= first - apart)
        best[again | (beside & (best < BESIDE_SHARE * fastest))] = 0.0
    return found


def _beyond(
    joints: Array, centre: Array, gaps: NDArray[np.intp], count: int, side: int, pushed: float
) -> Array:
    """Return the body's displacement beyond `pushed` over `count` slots after each slot (S,), metres, at least 0.

    `centre` (S, 3) is the mean of the joints. `gaps` (S + 1,) is the cumulative number of empty slots. `pushed` is the
    largest displacement that forces cause, metres. `side` is the number of slots, on each side, that determine the
    velocity.
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
    """Return the median of values (S, 14, ...) over the known joints."""
    ordered = np.sort(values, axis=1)  # unknown joints come last
    number = np.isfinite(values).sum(axis=1, keepdims=True)
    low, high = (
        np.take_along_axis(ordered, np.maximum(k, 0), axis=1) for k in ((number - 1) // 2, number // 2)
    )
    return np.asarray(((low + np.where(number % 2, low, high)) / 2.0)[:, 0])
