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
    """Choose the writing that the closed form takes: 0 or 1 of the hinge's side, 2 more for the other branch.

    `posekit.body.angles.limb_angles`: that which violates the figure's limits least, of those that tie the first; -1
    where that is not clear.
    """
    least = math.inf
    for k in range(4):
        other, back = k >= 2, k % 2 == 1
        cost = worst(
            outside_by(flexion + HALF_TURN if other else flexion, ends, 0),
            outside_by(HALF_TURN - abduction if other else abduction, ends, 1),
        )
        cost = worst(
            cost, bend * outside_by(rotation + HALF_TURN if other != back else rotation, ends, OF_ROTATION)
        )
        w[WORST_AT + k] = worst(cost, outside_by(-hinge if back else hinge, ends, OF_HINGE))
        if math.isnan(w[WORST_AT + k]):
            return -1
        least = min(least, w[WORST_AT + k])
    tied = least + (TIED_ANGLES_RADIANS * PER_RADIAN if least > 0 else 0.0)
    for k in range(4):
        if w[WORST_AT + k] <= tied:
            return k
    return -1


def beyond_limits(u: Array, v: Array, ends: Array, w: Array, above: Array, below: Array) -> Any:
    """Say how far one limb is beyond its limits, radians; return whether that is clear, else the judge must say it.

    Parameters
    ----------
    u, v : array (3,)
        Unit directions of its segments in the frame of the part on which it hangs.
    ends : array (4, 2)
        The figure's limits of the four angles, degrees, which choose among ways to write them.
    w : array
        Room, and from `NUMBERS_AT` on the numbers of the check.
    above, below : array (4,)
        To be written: for each place of the check; minus infinity where nothing is judged.
    """
    at = NUMBERS_AT
    flexion, abduction, rotation, hinge, bend = angles_of(u, v, w)
    if math.isnan(bend) or not w[at + AT_WHOLE] > 0:
        return False
    first = first_writing(flexion, abduction, rotation, hinge, bend, ends, w)
    tolerance, unseen = w[at + AT_TOLERANCE], w[at + AT_UNSEEN]
    if first < 0 or not abs(tolerance - unseen * bend) > CLEAR_SHARE * tolerance:
        return False
    loose = tolerance / bend
    seen, offset = loose <= unseen, 0.0
    w[READ_AT + OF_ELEVATION], w[READ_AT + OF_PLANE] = math.nan, math.nan
    if w[at + AT_ARM] > 0:
        ahead, aside, down = -u[0] * w[at + AT_SIGNS], u[1] * w[at + AT_SIGNS + 1], -u[2]
        raised = math.sqrt(ahead * ahead + aside * aside)
        if not raised > SINGULAR_SINE:
            return False
        plane = math.atan2(aside, ahead) * PER_RADIAN
        w[READ_AT + OF_ELEVATION], w[READ_AT + OF_PLANE] = math.atan2(raised, down) * PER_RADIAN, plane
        alpha, beta = flexion / PER_RADIAN, abduction / PER_RADIAN
        twist = -2.0 * math.atan2(
            math.sin(alpha / 2) * math.sin(beta / 2), math.cos(alpha / 2) * math.cos(beta / 2)
        )
        from_side = 90.0 - (plane + 360.0 if plane < w[at + AT_CUT] else plane)
        offset = twist * PER_RADIAN - (1.0 - down) * from_side
    least, judged = math.inf, int(w[at + AT_JUDGED])
    # Where elevation and turn say all, both branches of the ball joint are the same.
    for k in range(4 if w[at + AT_BRANCHES] == 2 else 2):
        other, back = (first >= 2) != (k >= 2), (first % 2 == 1) != (k % 2 == 1)
        w[READ_AT] = near(flexion + HALF_TURN if other else flexion, w[at + AT_ENDS])
        w[READ_AT + 1] = near(HALF_TURN - abduction if other else abduction, w[at + AT_ENDS + 5])
        w[READ_AT] -= min(max(w[READ_AT] - w[at + AT_ENDS], w[at + AT_TURN_LEAST]), w[at + AT_TURN_MOST])
        w[READ_AT + OF_ROTATION] = near(
            rotation + HALF_TURN if other != back else rotation, w[at + AT_ENDS + 5 * OF_ROTATION]
        )
        w[READ_AT + OF_HINGE] = near(-hinge if back else hinge, w[at + AT_ENDS + 5 * OF_HINGE])
        known = w[READ_AT] + w[READ_AT + 1] + w[READ_AT + OF_ROTATION] + w[READ_AT + OF_HINGE]
        if math.isnan(known) or not bounds(w, at, offset + HALF_TURN if other else offset, False):
            return False
        most = -math.inf
        for place in range(judged):
            i = int(w[at + AT_JUDGED + 1 + place])
            if math.isnan(w[LOW_AT + i] + w[HIGH_AT + i]):
                return False
            over, under = w[READ_AT + i] - w[HIGH_AT + i], w[LOW_AT + i] - w[READ_AT + i]
            if w[HIGH_AT + i] >= BEYOND_ALL or (i == OF_ROTATION and not seen):
                over = -math.inf
            if w[LOW_AT + i] <= -BEYOND_ALL or (i == OF_ROTATION and not seen):
                under = -math.inf
            w[JUDGED_AT + place], w[JUDGED_AT + 4 + place] = over, under
            most = max(most, max(over, under) - (loose if i == OF_ROTATION else tolerance))
        if most < least:
            least = most
            for place in range(judged):
                # A rotation of an almost straight limb has its tolerance over the sine of the bend: its weight is that.
                i = int(w[at + AT_JUDGED + 1 + place])
                weight = (bend if i == OF_ROTATION else 1.0) / PER_RADIAN
                above[place], below[place] = (
                    w[JUDGED_AT + place] * weight,
                    w[JUDGED_AT + 4 + place] * weight,
                )
    return least < math.inf


def limbs_beyond(
    upper: Array,
    lower: Array,
    ends: Array,
    numbers: Array,
    above: Array,
    below: Array,
    unclear: NDArray[np.bool_],
) -> None:
    """Say how far limbs (N, 3), (N, 3) are beyond their limits: `above` and `below` (N, 4) and `unclear` (N,)."""
    w = np.empty(NUMBERS_AT + len(numbers))
    w[NUMBERS_AT:] = numbers
    for n in range(len(upper)):
        unclear[n] = not beyond_limits(upper[n], lower[n], ends, w, above[n], below[n])


COMPILED_TYPES = {
    "near": "",
    "worst": "",
    "coupled": "",
    "off_plane": "(f8[::1], i8)",
    "bounds": "(f8[::1], i8, f8, b1)",
    "angles_of": "",
    "outside_by": "",
    "first_writing": "",
    "beyond_limits": "(f8[::1], f8[::1], f8[:,::1], f8[::1], f8[::1], f8[::1])",
    "limbs_beyond": "(f8[:,::1], f8[:,::1], f8[:,::1], f8[::1], f8[:,::1], f8[:,::1], b1[::1])",
}
"""The kernels, in the order in which they need each other, with the types of those that are called."""
