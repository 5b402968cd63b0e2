"""How far limbs are beyond anatomical ranges as a plain loop: what their judge finds, without its arrays.

Screens (`posekit.compiled.anatomical_kernels`) tell only what is clear; refinement pulls with the numbers themselves.
So this loop says for each angle how far it is above its upper and below its lower limit, in the writing that the judge
reports: of all ways to write the limb the one that is least outside, of several the first, where the closed form's own
comes first (`posekit.body.angles`). Limbs at singular places are left to the judge.

Limits and couplings are those of the screen, and its numbers.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.compiled.anatomical_kernels import (
    AT_ARM,
    AT_BRANCHES,
    AT_CUT,
    AT_ENDS,
    AT_JUDGED,
    AT_SIGNS,
    AT_TOLERANCE,
    AT_TURN_LEAST,
    AT_TURN_MOST,
    AT_UNSEEN,
    AT_WHOLE,
    BEYOND_ALL,
    CLEAR_DEGREES,
    CLEAR_SHARE,
    HIGH_AT,
    LOW_AT,
    OF_ELEVATION,
    OF_HINGE,
    OF_PLANE,
    OF_ROTATION,
    PER_RADIAN,
    READ_AT,
    SINGULAR_SINE,
    WORST_AT,
    bounds,
    coupled,  # noqa: F401 - to be compiled
    near,
    off_plane,  # noqa: F401 - to be compiled
)
from posekit.compiled.angle_kernels import worst
from posekit.compiled.frame_kernels import NUMBERS_AT
from posekit.geometry import Array
from posekit.geometry.rotations import TIED_ANGLES_RADIANS

JUDGED_AT = WORST_AT + 8
"""Where is written down how far each angle is beyond its limits, above and below, in the best writing so far."""

HALF_TURN = 180.0
"""Degrees."""


def angles_of(u: Array, v: Array, w: Array) -> Any:
    """Find a limb's angles in its first writing, degrees; and the sine of its bend, NaN at singular places.

    Parameters
    ----------
    u, v : array (3,)
        Unit directions of its segments.
    """
    ux, uy, uz = u[0], u[1], u[2]
    level = math.sqrt(ux * ux + uz * uz)
    if not level > SINGULAR_SINE:
        return math.nan, math.nan, math.nan, math.nan, math.nan
    cosine, sine = -uz / level, -ux / level
    forward = sine * v[0] + cosine * v[2]
    x, y, z = cosine * v[0] - sine * v[2], level * v[1] + uy * forward, -uy * v[1] + level * forward
    bend = math.sqrt(x * x + y * y)
    if not bend > SINGULAR_SINE:
        return math.nan, math.nan, math.nan, math.nan, math.nan
    at = NUMBERS_AT + AT_SIGNS
    return (
        math.atan2(-ux, -uz) * w[at] * PER_RADIAN,
        math.atan2(uy, level) * w[at + 1] * PER_RADIAN,
        math.atan2(-y, -x) * w[at + OF_ROTATION] * PER_RADIAN,
        math.atan2(bend, -z) * w[at + OF_HINGE] * PER_RADIAN,
        bend,
    )


def outside_by(angle: Any, ends: Array, k: int) -> Any:
    """Return how far an angle is outside the figure's own limits, zero inside, degrees; NaN where that is unclear."""
    away = near(angle, (ends[k, 0] + ends[k, 1]) / 2)
    return math.nan if math.isnan(away) else max(ends[k, 0] - away, away - ends[k, 1], 0.0)


def first_writing(
    flexion: Any, abduction: Any, rotation: Any, hinge: Any, bend: Any, ends: Array, w: Array
) -> Any:
    """Choose the writing that the closed form takes: 0 or 1 by the hinge's side, 2 more for the other branch.

    `posekit.body.angles.limb_angles`: that which violates the figure's limits least, of those that tie the first; -1
    where that is not clear.
    """
    rotated, turned = (
        bend * outside_by(rotation, ends, OF_ROTATION),
        bend * outside_by(rotation + HALF_TURN, ends, OF_ROTATION),
    )
    bent, back = outside_by(hinge, ends, OF_HINGE), outside_by(-hinge, ends, OF_HINGE)
    ball = worst(outside_by(flexion, ends, 0), outside_by(abduction, ends, 1))
    w[WORST_AT], w[WORST_AT + 1] = worst(worst(ball, rotated), bent), worst(worst(ball, turned), back)
    ball = worst(outside_by(flexion + HALF_TURN, ends, 0), outside_by(HALF_TURN - abduction, ends, 1))
    w[WORST_AT + 2], w[WORST_AT + 3] = worst(worst(ball, turned), bent), worst(worst(ball, rotated), back)
    least = math.inf
    for k in range(4):
        if math.isnan(w[WORST_AT + k]):
            return -1
        least = min(least, w[WORST_AT + k])
    tied = least + (TIED_ANGLES_RADIANS * PER_RADIAN if least > 0 else 0.0)
    for k in range(4):
        if w[WORST_AT + k] <= tied:
            return k
    return -1


def raise_arm(u: Array, flexion: Any, abduction: Any, w: Array) -> Any:
    """Write down an arm's elevation and its plane; return its turn without rotation, degrees, NaN where unclear."""
    at = NUMBERS_AT
    ahead, aside, down = -u[0] * w[at + AT_SIGNS], u[1] * w[at + AT_SIGNS + 1], -u[2]
    raised = math.sqrt(ahead * ahead + aside * aside)
    if not raised > SINGULAR_SINE:
        return math.nan
    plane = math.atan2(aside, ahead) * PER_RADIAN
    w[READ_AT + OF_ELEVATION], w[READ_AT + OF_PLANE] = math.atan2(raised, down) * PER_RADIAN, plane
    alpha, beta = flexion / PER_RADIAN, abduction / PER_RADIAN
    twist = -2.0 * math.atan2(
        math.sin(alpha / 2) * math.sin(beta / 2), math.cos(alpha / 2) * math.cos(beta / 2)
    )
    from_side = 90.0 - (plane + 360.0 if plane < w[at + AT_CUT] else plane)
    return twist * PER_RADIAN - (1.0 - down) * from_side


def read(flexion: Any, abduction: Any, rotation: Any, hinge: Any, writing: int, w: Array) -> Any:
    """Write down the four angles of one writing; return how far they are outside their own limits at least, degrees.

    Couplings and what is rounded off only narrow those limits; not so the rotation's, which is left out. NaN where a
    turn is unclear.
    """
    at = NUMBERS_AT
    other, back = writing >= 2, writing % 2 == 1
    w[READ_AT] = near(flexion + HALF_TURN if other else flexion, w[at + AT_ENDS])
    w[READ_AT + 1] = near(HALF_TURN - abduction if other else abduction, w[at + AT_ENDS + 5])
    w[READ_AT] -= min(max(w[READ_AT] - w[at + AT_ENDS], w[at + AT_TURN_LEAST]), w[at + AT_TURN_MOST])
    w[READ_AT + OF_ROTATION] = near(
        rotation + HALF_TURN if other != back else rotation, w[at + AT_ENDS + 5 * OF_ROTATION]
    )
    w[READ_AT + OF_HINGE] = near(-hinge if back else hinge, w[at + AT_ENDS + 5 * OF_HINGE])
    most = -math.inf
    for i in range(4):
        if math.isnan(w[READ_AT + i]):
            return math.nan
        if i != OF_ROTATION:
            value = w[READ_AT + i]
            most = max(most, w[at + AT_ENDS + 5 * i + 2] - value, value - w[at + AT_ENDS + 5 * i + 4])
    return most - w[at + AT_TOLERANCE]


def judge_writing(offset: Any, bend: Any, writing: int, w: Array, above: Array, below: Array) -> Any:
    """Say how far the writing that was read is beyond its limits, radians; return its worst, degrees, or NaN."""
    at = NUMBERS_AT
    if not bounds(w, at, offset + HALF_TURN if writing >= 2 else offset, False):
        return math.nan
    tolerance, most = w[at + AT_TOLERANCE], -math.inf
    loose = tolerance / bend
    for place in range(int(w[at + AT_JUDGED])):
        i = int(w[at + AT_JUDGED + 1 + place])
        low, value, high = w[LOW_AT + i], w[READ_AT + i], w[HIGH_AT + i]
        if math.isnan(low + high):
            return math.nan
        unseen = i == OF_ROTATION and loose > w[at + AT_UNSEEN]
        over = -math.inf if unseen or high >= BEYOND_ALL else value - high
        under = -math.inf if unseen or low <= -BEYOND_ALL else low - value
        most = max(most, max(over, under) - (loose if i == OF_ROTATION else tolerance))
        # A rotation of an almost straight limb has its tolerance over the sine of the bend: its weight is that.
        weight = (bend if i == OF_ROTATION else 1.0) / PER_RADIAN
        above[place], below[place] = over * weight, under * weight
    return most


def beyond_limits(u: Array, v: Array, ends: Array, w: Array, fixed: int, above: Array, below: Array) -> Any:
    """Say how far one limb is beyond its limits, radians; return in which writing, -1 where the judge must say it.

    Parameters
    ----------
    u, v : array (3,)
        Unit directions of its segments in the frame of the part on which it hangs.
    ends : array (4, 2)
        The figure's limits of the four angles, degrees, which choose among ways to write them.
    w : array
        Room, and from `NUMBERS_AT` on the numbers of the check.
    fixed : int
        The writing that is judged; -1 for the one that the judge would report.
    above, below : array (4,)
        To be written: for each place of the check; minus infinity where nothing is judged.
    """
    at = NUMBERS_AT
    flexion, abduction, rotation, hinge, bend = angles_of(u, v, w)
    if math.isnan(bend) or not w[at + AT_WHOLE] > 0:
        return -1
    tolerance, unseen, offset = w[at + AT_TOLERANCE], w[at + AT_UNSEEN], 0.0
    if not abs(tolerance - unseen * bend) > CLEAR_SHARE * tolerance:
        return -1
    w[READ_AT + OF_ELEVATION], w[READ_AT + OF_PLANE] = math.nan, math.nan
    if w[at + AT_ARM] > 0:
        offset = raise_arm(u, flexion, abduction, w)
        if math.isnan(offset):
            return -1
    if fixed >= 0:
        read(flexion, abduction, rotation, hinge, fixed, w)
        return -1 if math.isnan(judge_writing(offset, bend, fixed, w, above, below)) else fixed
    first = first_writing(flexion, abduction, rotation, hinge, bend, ends, w)
    if first < 0:
        return -1
    least, best, trial = math.inf, -1, w[JUDGED_AT : JUDGED_AT + 8].reshape(2, 4)
    # Where elevation and turn say all, both branches of the ball joint are the same.
    for k in range(4 if w[at + AT_BRANCHES] == 2 else 2):
        writing = first ^ k
        outside = read(flexion, abduction, rotation, hinge, writing, w)
        if math.isnan(outside):
            return -1
        if outside > least + CLEAR_DEGREES:
            continue
        most = judge_writing(offset, bend, writing, w, trial[0], trial[1])
        if math.isnan(most):
            return -1
        if most < least:
            least, best = most, writing
            for place in range(int(w[at + AT_JUDGED])):
                above[place], below[place] = trial[0, place], trial[1, place]
    return best


def limbs_beyond(
    upper: Array,
    lower: Array,
    ends: Array,
    numbers: Array,
    above: Array,
    below: Array,
    writing: NDArray[np.int64],
) -> None:
    """Say how far limbs (N, 3), (N, 3) are beyond their limits: `above` and `below` (N, 4).

    In the `writing` (N,) that is said, or where that is -1 in the judge's, which is written down; there it stays -1
    where the judge must be asked.
    """
    w = np.empty(NUMBERS_AT + len(numbers))
    w[NUMBERS_AT:] = numbers
    for n in range(len(upper)):
        writing[n] = beyond_limits(upper[n], lower[n], ends, w, writing[n], above[n], below[n])


def limbs_read(
    upper: Array,
    lower: Array,
    ends: Array,
    numbers: Array,
    value: Array,
    low: Array,
    high: Array,
    loose: Array,
    writing: NDArray[np.int64],
) -> None:
    """Read limbs (N, 3), (N, 3) in the writing that the judge reports: the angles that are judged, and their limits.

    Parameters
    ----------
    upper, lower, ends, numbers
        As `limbs_beyond` takes them.
    value, low, high : array (N, K)
        Filled, degrees: K places of the check.
    loose : array (N,)
        Filled: the tolerance of the rotation, degrees.
    writing : int array (N,)
        Filled: -1 where the judge must be asked.
    """
    w = np.empty(NUMBERS_AT + len(numbers))
    w[NUMBERS_AT:] = numbers
    above, below = np.empty(4), np.empty(4)
    for n in range(len(upper)):
        best = beyond_limits(upper[n], lower[n], ends, w, -1, above, below)
        if best >= 0:
            best = beyond_limits(upper[n], lower[n], ends, w, best, above, below)
        writing[n] = best
        if best < 0:
            continue
        loose[n] = w[NUMBERS_AT + AT_TOLERANCE] / abs(math.sin(w[READ_AT + OF_HINGE] / PER_RADIAN))
        for place in range(value.shape[1]):
            i = int(w[NUMBERS_AT + AT_JUDGED + 1 + place])
            unseen = i == OF_ROTATION and loose[n] > w[NUMBERS_AT + AT_UNSEEN]
            value[n, place] = math.nan if unseen else w[READ_AT + i]
            low[n, place] = w[LOW_AT + i] if w[LOW_AT + i] > -BEYOND_ALL else -math.inf
            high[n, place] = w[HIGH_AT + i] if w[HIGH_AT + i] < BEYOND_ALL else math.inf


COMPILED_TYPES = {
    "near": "",
    "worst": "",
    "coupled": "",
    "off_plane": "(f8[::1], i8)",
    "bounds": "(f8[::1], i8, f8, b1)",
    "angles_of": "",
    "outside_by": "",
    "first_writing": "",
    "raise_arm": "",
    "read": "",
    "judge_writing": "",
    "beyond_limits": "",
    "limbs_beyond": "(f8[:,::1], f8[:,::1], f8[:,::1], f8[::1], f8[:,::1], f8[:,::1], i8[::1])",
    "limbs_read": (
        "(f8[:,::1], f8[:,::1], f8[:,::1], f8[::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[::1], i8[::1])"
    ),
}
"""The kernels, in the order in which they need each other, with the types of those that are called."""
