r"""Distances of joints, and of the body, from where neighbouring frames predict them.

How far a body is displaced for good, at once or over a sixth of a second, by what nothing can push it.

A body that goes a way D beyond what its velocities before and after explain, in a time T, is sped up and
slowed down again: by :math:`4 D / T^2` at least, half of the time each way. Where people are faster than that, in
rolls, kicks and flips, their joints do not all go the same way; a body that is displaced does.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from posekit.geometry import Array, norm
from posekit.validators.motion.timeline import centred, filtered

#: Jump from which a frame is not judged as motion, metres.
LEAST_JUMP: Final = 0.06

#: Least jump of one frame, as a share of a lasting displacement near it.
DISPLACED_SHARE: Final = 0.5

#: Frames on either side by which a jump is measured.
SIDE_FRAMES: Final = 3

#: Multiples of the neighbours' own misfit that are subtracted from a jump: of one that comes back, and at an end of the
#: clip. Fast motion at few frames per second fits no smooth curve, and is not a jump.
JOINT_MISFITS, END_MISFITS = 3.0, 5.0


def _filter(at: int) -> tuple[Array, Array]:
    """Fit a cubic, and a jump of one of them, to seven frames by least squares: two degrees of freedom are left.

    Return the weights of the jump (7,), and of the misfit of the others from a smooth curve (2, 7), of unit length.
    """
    times = np.arange(7.0) - at
    design = np.column_stack([np.vander(times, 4, increasing=True), times == 0])
    return np.linalg.pinv(design)[-1], np.linalg.svd(design)[0][:, design.shape[1] :].T / np.sqrt(2.0)


#: Filters by the place of the jump among seven frames: in the middle, or next to an end of the clip.
_FILTERS: Final = {at: _filter(at) for at in (1, 2, SIDE_FRAMES)}
_THIRD_DIFFERENCE: Final = np.array([1.0, -3.0, 3.0, -1.0])


def jumps_of(joints: Array, step: float) -> Array:
    """Measure the jumps of joints (S, 14, 3) in slots of `step` seconds (NaN where not known).

    Returns
    -------
    array (S, 15)
        Metres above the neighbours' own misfit, of each joint beside the body's, and of the body (the median joint);
        NaN where not known.

    Notes
    -----
    A jump of one frame is how far it is from the cubic through three frames on either side; at an end it is the third
    difference. All less some times the misfit of the neighbours themselves. A body that stays moved is for
    `displaced_by`.
    """
    count = len(joints)
    offset, misfit = (centred(one, count, SIDE_FRAMES) for one in _measured(joints, SIDE_FRAMES))
    body = middle(offset)
    alone = norm(body) - JOINT_MISFITS * middle(misfit)
    moved = alone > 0
    displaced = displaced_by(joints, step)
    if (alone > LEAST_JUMP).any():
        # Beside a displaced body a misfit is measured from where the body went.
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
                # If the last frame jumps, its neighbours do not.
                joint[frame] = np.where((joint[end] > 0) & (joint[end] > jump), np.nan, jump)
    return np.column_stack([joint, np.fmax(alone, displaced)])


def _measured(joints: Array, at: int) -> tuple[Array, Array]:
    """Return the jump of the frame `at` of each seven (N, 14, 3), and the misfit of the others (N, 14).

    The farther the frame is from their middle, the less sure is its jump: the misfit counts more.
    """
    jump, misfit = _FILTERS[at]
    unsure = np.linalg.norm(jump) / np.linalg.norm(_FILTERS[SIDE_FRAMES][0])
    squares = sum(norm(filtered(joints, weights)) ** 2 for weights in misfit)
    return filtered(joints, jump), unsure * np.sqrt(squares)


#: Longest time over which a body is displaced, seconds: slower displacements are motion.
LONGEST_SECONDS: Final = 1.0 / 6.0

#: Step between the times over which displacements are looked for, seconds.
BETWEEN_SECONDS: Final = 1.0 / 30.0

#: Time before and after over which the velocity of joints is measured, seconds.
VELOCITY_SECONDS: Final = 1.0 / 15.0

#: Largest acceleration of a whole body, metres a second squared: three times its weight, less its own; runners and
#: jumpers reach it (Cavanagh & Lafortune 1980, J. Biomech. 13).
PUSHED_ACCELERATION: Final = 20.0

#: Least speed of another displacement beside one, as a share of its speed: half of it follows from misled velocities.
BESIDE_SHARE: Final = 0.75

#: Multiple of the median difference of joints from the body's displacement that is subtracted from it.
APART_TIMES: Final = 2.0


def displaced_by(joints: Array, step: float) -> Array:
    """Return lasting displacements of the body, in the frames in which it moves (S,); NaN in others.

    Parameters
    ----------
    joints : array (S, 14, 3)
        Metres, in slots of even time; NaN where unknown.
    step : float
        Seconds a slot; if it is NaN, only displacements within one frame are found.

    Returns
    -------
    array (S,)
        Metres beyond what forces and the joints' own motion explain.
    """
    timed = step > 0
    side, apart = (
        max(round(seconds / step), 1) if timed else 2 for seconds in (VELOCITY_SECONDS, BETWEEN_SECONDS)
    )
    most = int(LONGEST_SECONDS / step + 1e-6) if timed else 1
    known = np.isfinite(joints[..., 0])
    # The mean is a fast screen: it is displaced with the body.
    centre = np.nan_to_num(joints).sum(axis=1) / np.maximum(known.sum(axis=1), 1)[:, None]
    gaps = np.concatenate([[0], np.cumsum(~known.any(axis=1))])
    best, over = np.full(len(joints), -np.inf), np.ones(len(joints), dtype=np.intp)
    for count in sorted({1, *range(max(apart, 2), most + 1, apart)}):
        pushed = PUSHED_ACCELERATION * (count * step) ** 2 / 4 if timed else 0.0
        beyond = _beyond(joints, centre, gaps, count, side, pushed) / count
        better = beyond > best
        best[better], over[better] = beyond[better], count
    # The fastest window is the displacement: a window that ends amid it is misled by a velocity of half of it.
    found = np.full(len(joints), np.nan)
    while best.max(initial=0.0) > 0:
        first = int(best.argmax()) + 1
        last = first + int(over[first - 1]) - 1
        found[first : last + 1] = best[first - 1] * over[first - 1]
        # Windows with these frames repeat it; slower windows beside them follow from it.
        starts, fastest = np.arange(len(best)), best[first - 1]
        again = (starts < last) & (starts + over >= first)
        beside = (starts - side < last + apart) & (starts + over + side >= first - apart)
        best[again | (beside & (best < BESIDE_SHARE * fastest))] = 0.0
    return found


def _beyond(
    joints: Array, centre: Array, gaps: NDArray[np.intp], count: int, side: int, pushed: float
) -> Array:
    """Return the unexplained displacement (S,) in the `count` slots after each slot; 0 if all is explained.

    It needs the joints, their mean (S, 3), and the number of empty slots before each (S + 1,).
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
    ordered = np.sort(values, axis=1)  # what is not known comes last
    number = np.isfinite(values).sum(axis=1, keepdims=True)
    low, high = (
        np.take_along_axis(ordered, np.maximum(k, 0), axis=1) for k in ((number - 1) // 2, number // 2)
    )
    return np.asarray(((low + np.where(number % 2, low, high)) / 2.0)[:, 0])
