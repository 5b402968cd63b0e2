"""Limbs under anatomical ranges as plain loops, for `posekit.compiled.check_kernels`.

It does in degrees what `posekit.validators.anatomical_checks.AnatomicalLimb.judge` does with arrays: of every writing
of the limb is written down how far its worst angle is outside, and which place is violated first. It says that a limb
passes, or which place it violates first, where that is clear by more than any rounding; else it is unsure, and the
judge is asked.

The numbers of a check are laid out by `posekit.validators.anatomical_screen.limb_numbers`.
"""

from __future__ import annotations

import math
from typing import Any

from posekit.compiled.angle_kernels import direction, worst
from posekit.compiled.frame_kernels import ROOM_AT
from posekit.compiled.noise_kernels import ALLOWED_AT, BLUR_AT, beside, loosened
from posekit.compiled.rigid_kernels import rigid_frame, unknown
from posekit.compiled.verdicts import NO_VIOLATION, NOT_CLEAR
from posekit.geometry import Array

CLEAR_DEGREES = 1e-7
"""Degrees within which nothing is clear: a million times the rounding."""

SINGULAR_SINE = 1e-5
"""Sine below which an angle is nearly free, and rounding is not small any more."""

CLEAR_SHARE = 1e-9
"""The same, as a part of one: of a range that is used up, or of a tolerance."""

AT_RIGID, AT_WHOLE, AT_ARM, AT_BRANCHES, AT_POWER, AT_LEAST, AT_CUT, AT_TOLERANCE, AT_UNSEEN = range(9)
"""What the first numbers of a check are.

The kind of its rigid part; 1 for a limb of three joints; 1 for an arm, whose elevation and plane are read; how
many branches of the ball joint differ, 0 where only the judge knows which it takes; power of the sinus, 0 without one,
and the least of what is left of a range, to that power; the plane at which the turn is cut; tolerance, and that from
which on a rotation is not seen: degrees.
"""

AT_TURN_LEAST, AT_TURN_MOST = 9, 10
"""Then from where to where a pelvis between the hips may be flexed, of which thighs take what they need, degrees."""

AT_SIGNS, AT_ENDS, AT_JUDGED, AT_COUPLED = 11, 15, 35, 42
"""Where the others begin.

Signs of the four angles; five numbers of each: the middle between the means, lower mean and limit, upper mean and
limit; how many places are judged, then the reading of each; how many couplings there are, then each with its knots.
"""

COUPLING_NUMBERS = 5
"""Numbers of a coupling before its knots.

What it bounds, by which reading; -1 for a lower and 1 for an upper end; how far the limit is beyond the mean; how many
knots follow, reading and mean of each.
"""

OF_ROTATION, OF_HINGE, OF_ELEVATION, OF_PLANE, AT_TURN, AT_VALGUS = 2, 3, 4, 5, 6, 7
"""Readings after flexion and abduction, which may be bounded too; then turn and valgus, which are bounded alone."""

READ_AT, LOW_AT, HIGH_AT, WORST_AT, FIRST_AT = ROOM_AT, ROOM_AT + 6, ROOM_AT + 12, ROOM_AT + 18, ROOM_AT + 22
"""Where readings and their limits are written down, and of four writings what was found."""

RIGHT_ANGLE = 90.0
"""Degrees of bend at which ranges of axial rotation are measured."""

BEYOND_ALL = 1e9
"""Degrees of an end that is none."""

PER_RADIAN = 180.0 / math.pi


def near(angle: Any, middle: Any) -> Any:
    """Add full turns so that an angle lies within half a turn of a middle, degrees; NaN where the turn is unclear."""
    turn = angle - middle + 180.0
    turn -= 360.0 * math.floor(turn / 360.0)  # a quarter of the time that a remainder takes
    if turn < CLEAR_DEGREES or turn > 360.0 - CLEAR_DEGREES:
        return math.nan
    return middle + turn - 180.0


def coupled(w: Array, row: int, x: Any) -> Any:
    """Interpolate linearly between the knots of a coupling; constant beyond the outer ones, NaN of NaN."""
    first, last = row + COUPLING_NUMBERS, row + COUPLING_NUMBERS + 2 * int(w[row + 4]) - 2
    if x <= w[first] or math.isnan(x):
        return w[first + 1] if x <= w[first] else math.nan
    for k in range(first + 2, last + 2, 2):
        if x <= w[k]:
            share = (x - w[k - 2]) / (w[k] - w[k - 2])
            return w[k - 1] + share * (w[k + 1] - w[k - 1])
    return w[last + 1]


def off_plane(w: Array, at: int) -> Any:
    """Move the limits of the rotation for valgus, as `posekit.validators.anatomical_limb` does; say if clear."""
    if math.isnan(w[READ_AT + OF_ROTATION] + w[READ_AT + OF_HINGE]):
        return True
    row = at + AT_COUPLED + 1
    for _ in range(int(w[at + AT_COUPLED])):
        if w[row] == AT_VALGUS:
            side = w[row + 2]
            off = side * coupled(w, row, w[READ_AT + OF_HINGE]) + w[row + 3]
            if off > 0:
                bend = math.sin(w[READ_AT + OF_HINGE] / PER_RADIAN)
                size, part = abs(bend), math.sin(off / PER_RADIAN)
                if size < SINGULAR_SINE or abs(part - size) < CLEAR_SHARE:
                    return False
                turn = PER_RADIAN * (math.asin(part / size) if part < size else math.pi / 2)
                turn = max(turn - max(side * coupled(w, row, RIGHT_ANGLE) + w[row + 3], 0.0), 0.0)
                # Valgus looks like external rotation of an arm, like internal rotation of a leg.
                if side * bend * (1.0 if w[at + AT_ARM] > 0 else -1.0) > 0:
                    w[LOW_AT + OF_ROTATION] -= turn
                else:
                    w[HIGH_AT + OF_ROTATION] += turn
        row += COUPLING_NUMBERS + 2 * int(w[row + 4])
    return True


def bounds(w: Array, at: int, offset: Any, free: bool) -> Any:
    """Write down the limits of one writing, whose readings are; say whether they are clear.

    Parameters
    ----------
    offset : float
        The turn of this writing without rotation, degrees.
    free : bool
        Whether the rotation could be any, so that nothing may depend on it.
    """
    for k in range(4):
        w[LOW_AT + k], w[HIGH_AT + k] = w[at + AT_ENDS + 5 * k + 2], w[at + AT_ENDS + 5 * k + 4]
    for k in range(OF_ELEVATION, OF_PLANE + 1):
        w[LOW_AT + k], w[HIGH_AT + k] = -BEYOND_ALL, BEYOND_ALL
    rotation_low, rotation_high = w[at + AT_ENDS + 5 * OF_ROTATION + 1], w[at + AT_ENDS + 5 * OF_ROTATION + 3]
    couplings = int(w[at + AT_COUPLED])
    middle, turns, row = 0.0, 0, at + AT_COUPLED + 1
    for _ in range(couplings):
        if w[row] == AT_TURN:
            middle += coupled(w, row, w[READ_AT + int(w[row + 1])])
            turns += 1
        row += COUPLING_NUMBERS + 2 * int(w[row + 4])
    shift = math.nan
    if turns > 0 and not math.isnan(w[READ_AT + OF_ROTATION]):
        turned = near(w[READ_AT + OF_ROTATION] + offset, middle / turns)
        if math.isnan(turned):
            return False
        shift = w[READ_AT + OF_ROTATION] - turned
    row = at + AT_COUPLED + 1
    for _ in range(couplings):
        k, of = int(w[row]), int(w[row + 1])
        if free and of == OF_ROTATION:
            return False
        if k == AT_VALGUS:
            row += COUPLING_NUMBERS + 2 * int(w[row + 4])
            continue
        end = coupled(w, row, w[READ_AT + of])
        if k == AT_TURN:
            k, end = OF_ROTATION, end + shift
        limit = end + w[row + 2] * w[row + 3]
        if w[row + 2] < 0:
            w[LOW_AT + k] = worst(w[LOW_AT + k], limit)
            if k == OF_ROTATION:
                rotation_low = worst(rotation_low, end)
        else:
            w[HIGH_AT + k] = -worst(-w[HIGH_AT + k], -limit)
            if k == OF_ROTATION:
                rotation_high = -worst(-rotation_high, -end)
        row += COUPLING_NUMBERS + 2 * int(w[row + 4])
    power = w[at + AT_POWER]
    if power > 0:
        used = 0.0
        for k in range(3):
            centre = w[at + AT_ENDS + 5 * k] if k < OF_ROTATION else (rotation_low + rotation_high) / 2
            if k > 0:
                if abs(1.0 - used) < CLEAR_SHARE:
                    return False
                left = max(1.0 - used, w[at + AT_LEAST]) ** (1.0 / power)
                w[LOW_AT + k] = centre + (w[LOW_AT + k] - centre) * left
                w[HIGH_AT + k] = centre + (w[HIGH_AT + k] - centre) * left
            if k < OF_ROTATION:
                off = w[READ_AT + k] - centre
                half = (
                    w[at + AT_ENDS + 5 * k + 4] - centre if off >= 0 else centre - w[at + AT_ENDS + 5 * k + 2]
                )
                used += (abs(off) / (half + w[at + AT_TOLERANCE])) ** power
    return off_plane(w, at)


def writing(w: Array, at: int, loose: Any, to: int) -> None:
    """Write down of one writing, whose readings and limits are, how far its worst angle is outside, and which is first.

    The first is `NOT_CLEAR` where an angle is at its limit. Angles that are not known, or whose limits are not, do not
    count.

    Parameters
    ----------
    loose : float
        The tolerance of the rotation, degrees; infinite where it is not seen.
    to : int
        Which of the four writings it is.
    """
    most, first, edge = -math.inf, NO_VIOLATION, False
    for place in range(int(w[at + AT_JUDGED])):
        k = int(w[at + AT_JUDGED + 1 + place])
        low, value, high = w[LOW_AT + k], w[READ_AT + k], w[HIGH_AT + k]
        if math.isnan(low + value + high):
            continue
        outside = max(low - value, value - high)
        tolerance = loose if k == OF_ROTATION else w[at + AT_TOLERANCE]
        most = max(most, outside - tolerance)
        beyond = outside - loosened(w, place, tolerance, 1.0)
        edge = edge or abs(beyond) <= CLEAR_DEGREES + w[BLUR_AT] * PER_RADIAN
        if beyond > 0 and first == NO_VIOLATION:
            first = place
    w[WORST_AT + to], w[FIRST_AT + to] = most, NOT_CLEAR if edge else first


def anatomical(w: Array, at: int) -> Any:
    """Screen a limb: its rigid part (points of torso or hips), then two joints, or three of a whole one.

    Where the end is not known, nor are rotation and hinge, nor anything that depends on them.
    """
    rigid, whole = abs(int(w[at + AT_RIGID])), w[at + AT_WHOLE] > 0
    if unknown(w, 0, rigid + 2):
        return NO_VIOLATION  # nothing is judged
    R = rigid_frame(w, int(w[at + AT_RIGID]))
    ux, uy, uz = direction(w, rigid, rigid + 1, R)
    level = math.sqrt(ux * ux + uz * uz)
    if not (level > SINGULAR_SINE and w[at + AT_BRANCHES] > 0):
        return NOT_CLEAR
    beside(w, level, uy)
    alpha, beta = math.atan2(-ux, -uz) * w[at + AT_SIGNS], math.atan2(uy, level) * w[at + AT_SIGNS + 1]
    flexion, abduction = alpha * PER_RADIAN, beta * PER_RADIAN
    rotation, hinge, loose, free = math.nan, math.nan, math.inf, False
    tolerance, unseen = w[at + AT_TOLERANCE], w[at + AT_UNSEEN]
    seen = whole and not unknown(w, rigid + 2, rigid + 3)
    if seen:
        lx, ly, lz = direction(w, rigid + 1, rigid + 2, R)
        cosine, sine = -uz / level, -ux / level
        forward = sine * lx + cosine * lz
        x, y, z = cosine * lx - sine * lz, level * ly + uy * forward, -uy * ly + level * forward
        bend = math.sqrt(x * x + y * y)
        if not abs(tolerance - unseen * bend) > CLEAR_SHARE * tolerance:
            return NOT_CLEAR
        hinge = math.atan2(bend, -z) * w[at + AT_SIGNS + OF_HINGE] * PER_RADIAN
        free = bend <= SINGULAR_SINE
        if unseen * bend > tolerance:
            if free:
                return NOT_CLEAR
            loose = tolerance / bend
        if not free:
            rotation = math.atan2(-y, -x) * w[at + AT_SIGNS + OF_ROTATION] * PER_RADIAN
    offset = 0.0
    if w[at + AT_ARM] > 0:
        # As elevation_and_plane has it, of the direction itself.
        ahead, aside, down = -ux * w[at + AT_SIGNS], uy * w[at + AT_SIGNS + 1], -uz
        raised = math.sqrt(ahead * ahead + aside * aside)
        plane = math.atan2(aside, ahead) * PER_RADIAN
        if not (raised > SINGULAR_SINE and abs(plane - w[at + AT_CUT]) > CLEAR_DEGREES):
            return NOT_CLEAR
        w[READ_AT + OF_ELEVATION], w[READ_AT + OF_PLANE] = math.atan2(raised, down) * PER_RADIAN, plane
        if seen and not free:
            twist = -2.0 * math.atan2(
                math.sin(alpha / 2) * math.sin(beta / 2), math.cos(alpha / 2) * math.cos(beta / 2)
            )
            from_side = 90.0 - (plane + 360.0 if plane < w[at + AT_CUT] else plane)
            offset = twist * PER_RADIAN - (1.0 - down) * from_side
    else:
        w[READ_AT + OF_ELEVATION], w[READ_AT + OF_PLANE] = math.nan, math.nan
    # The judge chooses among writings by the tolerance without noise: one that this allows, noise of a degree does too.
    allowed = w[ALLOWED_AT] if w[ALLOWED_AT] > 0 else 1.0
    count = 0
    for branch in range(int(w[at + AT_BRANCHES])):
        if branch == 1:
            flexion, abduction, rotation, offset = (
                flexion + 180.0,
                180.0 - abduction,
                rotation + 180.0,
                offset + 180.0,
            )
        w[READ_AT], w[READ_AT + 1] = near(flexion, w[at + AT_ENDS]), near(abduction, w[at + AT_ENDS + 5])
        w[READ_AT] -= min(max(w[READ_AT] - w[at + AT_ENDS], w[at + AT_TURN_LEAST]), w[at + AT_TURN_MOST])
        for side in range(2 if seen else 1):
            w[READ_AT + OF_ROTATION] = near(rotation + 180.0 * side, w[at + AT_ENDS + 5 * OF_ROTATION])
            w[READ_AT + OF_HINGE] = near(hinge if side == 0 else -hinge, w[at + AT_ENDS + 5 * OF_HINGE])
            known = w[READ_AT] + w[READ_AT + 1]
            if seen:
                known += w[READ_AT + OF_HINGE] + (0.0 if free else w[READ_AT + OF_ROTATION])
            if math.isnan(known) or not bounds(w, at, offset, free):
                return NOT_CLEAR
            writing(w, at, loose, count)
            if w[WORST_AT + count] < -CLEAR_DEGREES and allowed >= 1.0:
                return NO_VIOLATION
            count += 1
    least = math.inf
    for i in range(count):
        least = min(least, w[WORST_AT + i])
    if not (least > CLEAR_DEGREES or allowed < 1.0):
        return NOT_CLEAR
    first = NO_VIOLATION
    for i in range(count):
        if w[WORST_AT + i] <= least + CLEAR_DEGREES:
            # Of writings that are equally far outside the judge may choose any.
            if first != NO_VIOLATION and w[FIRST_AT + i] != first:
                return NOT_CLEAR
            first = int(w[FIRST_AT + i])
    return first


COMPILED_TYPES = {
    "near": "",
    "coupled": "",
    "off_plane": "(f8[::1], i8)",
    "bounds": "(f8[::1], i8, f8, b1)",
    "writing": "(f8[::1], i8, f8, i8)",
    "anatomical": "(f8[::1], i8)",
}
"""The kernels, in the order in which they need each other, with the types of those that are called."""
