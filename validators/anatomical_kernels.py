"""Limbs under anatomical ranges as one plain loop, for `posekit.tree.compiled`: a screen that tells what is clear.

It does in degrees what `posekit.validators.anatomical_checks.AnatomicalLimb.judge` does with arrays. It says that a
limb passes, or which place it violates first, where that is clear by more than any rounding; else it is unsure, and
the judge is asked.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.tree import PASSED, UNSURE

CLEAR = 1e-7
"""Degrees within which nothing is clear: a million times the rounding."""

SINGULAR = 1e-5
"""Sine below which an angle is nearly free, and rounding is not small any more."""

AT_TURN = 6
"""What a coupling bounds: readings are flexion, abduction, rotation, hinge, elevation and plane; then the turn."""

BEYOND_ALL = 1e9
"""Degrees of an end that is none."""


def near(angle: Any, middle: Any) -> Any:
    """Add full turns so that an angle lies within half a turn of a middle, degrees; NaN where the turn is unclear."""
    turn = (angle - middle + 180.0) % 360.0
    if turn < CLEAR or turn > 360.0 - CLEAR:
        return math.nan
    return middle + turn - 180.0


def between(knots: Array, first: int, last: int, x: Any) -> Any:
    """Interpolate linearly between knots; constant beyond the outer ones."""
    if x <= knots[first, 0]:
        return knots[first, 1]
    for k in range(first + 1, last):
        if x <= knots[k, 0]:
            share = (x - knots[k - 1, 0]) / (knots[k, 0] - knots[k - 1, 0])
            return knots[k - 1, 1] + share * (knots[k, 1] - knots[k - 1, 1])
    return knots[last - 1, 1]


def limbs(  # noqa: PLR0912, PLR0915 - one loop: what is called from it would be compiled into it again
    upper: Array,
    lower: Array,
    signs: Array,
    arm: bool,
    ends: Array,
    couplings: Array,
    starts: NDArray[np.int64],
    knots: Array,
    judged: NDArray[np.int64],
    settings: Array,
) -> NDArray[np.int8]:
    """Screen limbs, from the directions of their segments in the frame of the part they hang on.

    Parameters
    ----------
    upper : array (N, 3)
    lower : array (N, 3) or (0, 3)
        Empty where only the upper segment is judged.
    signs : array (4,)
        Of the four angles, as `posekit.figure.angles.Limits` has them.
    arm : bool
        Whether elevation and plane are read.
    ends, couplings, starts, knots, judged
        As `posekit.validators.anatomical_screen.LimbTable` has them.
    settings : array (5,)
        Power of the sinus, 0 without one, and what it leaves at least; the plane (degrees) at which the turn is cut;
        tolerance, and the tolerance from which on a rotation is not seen, degrees.

    Returns
    -------
    int8 array (N,)
        The first place violated, `PASSED` or `UNSURE`.
    """
    power, least, seam, tolerance, unseen = settings[0], settings[1], settings[2], settings[3], settings[4]
    degrees = 180.0 / math.pi
    whole = len(lower) > 0
    count = len(judged)
    # Elevation and turn are the same in both branches of the ball joint.
    one_branch = arm and judged[count - 1] == 4 and ends[2, 1] <= -BEYOND_ALL and ends[2, 3] >= BEYOND_ALL
    places = np.empty(len(upper), np.int8)
    v, low, high = np.empty(6), np.empty(6), np.empty(6)
    for n in range(len(upper)):
        places[n] = UNSURE
        ux, uy, uz = upper[n, 0], upper[n, 1], upper[n, 2]
        flat = math.sqrt(ux * ux + uz * uz)
        if not flat > SINGULAR:
            continue
        x, y, z, bend = 0.0, 0.0, 0.0, 1.0
        if whole and math.isnan(lower[n, 0] + lower[n, 1] + lower[n, 2]):
            continue
        best, second, first_place, edge = math.inf, math.inf, PASSED, False
        clear = True
        for branch in range(1 if one_branch else 2):
            alpha, beta = math.atan2(-ux, -uz), math.atan2(uy, flat)
            if branch == 1:
                alpha, beta = alpha + math.pi, math.pi - beta
            hinge = 0.0
            if whole:
                ca, sa, cb, sb = math.cos(alpha), math.sin(alpha), math.cos(beta), math.sin(beta)
                forward = sa * lower[n, 0] + ca * lower[n, 2]
                x, y, z = (
                    ca * lower[n, 0] - sa * lower[n, 2],
                    cb * lower[n, 1] + sb * forward,
                    -sb * lower[n, 1] + cb * forward,
                )
                bend = math.sqrt(x * x + y * y)
                if not bend > SINGULAR:
                    clear = False
                    break
                hinge = math.atan2(bend, -z)
            a, b = alpha * signs[0] * degrees, beta * signs[1] * degrees
            v[4], v[5], offset = 0.0, 0.0, 0.0
            if arm:
                ra, rb = a / degrees, b / degrees
                fx, fy, fz = math.sin(ra) * math.cos(rb), math.sin(rb), math.cos(ra) * math.cos(rb)
                size = math.sqrt(fx * fx + fy * fy)
                if not size > SINGULAR:
                    clear = False
                    break
                v[4], v[5] = math.atan2(size, fz) * degrees, math.atan2(fy, fx) * degrees
                if abs(v[5] - seam) < CLEAR:
                    clear = False
                    break
                from_side = 90.0 - (v[5] + 360.0 if v[5] < seam else v[5])
                twist = -2.0 * math.atan2(
                    math.sin(ra / 2) * math.sin(rb / 2), math.cos(ra / 2) * math.cos(rb / 2)
                )
                offset = twist * degrees - (1.0 - fz) * from_side
            for side in range(2 if whole else 1):
                turn = 1.0 - 2.0 * side
                v[0], v[1] = near(a, ends[0, 0]), near(b, ends[1, 0])
                v[2], v[3] = 0.0, 0.0
                if whole:
                    v[2] = near(math.atan2(-turn * y, -turn * x) * signs[2] * degrees, ends[2, 0])
                    v[3] = near(turn * hinge * signs[3] * degrees, ends[3, 0])
                if math.isnan(v[0] + v[1] + v[2] + v[3]):
                    clear = False
                    break
                for k in range(4):
                    low[k], high[k] = ends[k, 2], ends[k, 4]
                low[4], high[4], low[5], high[5] = -BEYOND_ALL, BEYOND_ALL, -BEYOND_ALL, BEYOND_ALL
                rotation_low, rotation_high = ends[2, 1], ends[2, 3]
                turn_middle, turns = 0.0, 0
                for c in range(len(couplings)):
                    if couplings[c, 0] == AT_TURN:
                        turn_middle += between(knots, starts[c], starts[c + 1], v[int(couplings[c, 1])])
                        turns += 1
                shift = 0.0
                if turns > 0:
                    turned = near(v[2] + offset, turn_middle / turns)
                    if math.isnan(turned):
                        clear = False
                        break
                    shift = v[2] - turned
                for c in range(len(couplings)):
                    mean = between(knots, starts[c], starts[c + 1], v[int(couplings[c, 1])])
                    at = int(couplings[c, 0])
                    if at == AT_TURN:
                        mean += shift
                        at = 2
                    limit = mean + couplings[c, 2] * couplings[c, 3]
                    if couplings[c, 2] < 0:
                        low[at] = max(low[at], limit)
                        if at == 2:
                            rotation_low = max(rotation_low, mean)
                    else:
                        high[at] = min(high[at], limit)
                        if at == 2:
                            rotation_high = min(rotation_high, mean)
                if power > 0.0:
                    used = 0.0
                    for k in range(3 if whole else 2):
                        middle = ends[k, 0] if k < 2 else (rotation_low + rotation_high) / 2
                        if k > 0:
                            left = max(1.0 - used, least**power) ** (1.0 / power)
                            low[k] = middle + (low[k] - middle) * left
                            high[k] = middle + (high[k] - middle) * left
                        if k < 2:
                            off = v[k] - middle
                            half = (ends[k, 4] - middle if off >= 0 else middle - ends[k, 2]) + tolerance
                            used += (abs(off) / half) ** power
                worst, first, close = -math.inf, PASSED, False
                for place in range(count):
                    k = judged[place]
                    allowed = tolerance
                    if k == 2:
                        allowed = tolerance / bend
                        if abs(allowed - unseen) <= 1e-9 * allowed:
                            clear = False
                        if allowed > unseen:
                            continue
                    beyond = max(low[k] - v[k], v[k] - high[k]) - allowed
                    close = close or abs(beyond) <= CLEAR
                    if beyond > 0 and first == PASSED:
                        first = place
                    worst = max(worst, beyond)
                if worst < best:
                    best, second, first_place, edge = worst, best, first, close
                elif worst < second:
                    second = worst
            if not clear:
                break
        if not clear or math.isnan(best):
            continue
        if best < -CLEAR:
            places[n] = PASSED
        elif best > CLEAR and second - best > CLEAR and not edge:
            places[n] = first_place
    return places


COMPILED = {
    "near": "",
    "between": "",
    "limbs": (
        "(f8[:, ::1], f8[:, ::1], f8[::1], b1, f8[:, ::1], f8[:, ::1], i8[::1], f8[:, ::1], i8[::1], f8[::1])"
    ),
}
"""The kernels, in the order in which they need each other, with the types they take."""
