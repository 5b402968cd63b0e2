"""Table 1's angles as rotations from standing, as plain loops, for `posekit.compiled.check_kernels`.

They do what `posekit.validators.rotation_angles` does with arrays, and their numbers are laid out as those of
`posekit.compiled.projected_kernels`, of which the second, a shortest projection, is below zero.
"""

from __future__ import annotations

import math
from typing import Any

from posekit.compiled.projected_kernels import (
    CLEAR_ANGLE,
    IN_DEGREES,
    IS_INSIDE,
    IS_OUTSIDE,
    SHORTEST_PART,
    bounded,
    crossed,
    dot,
    in_torso,
)
from posekit.compiled.rigid_kernels import between, torso, unit, unknown
from posekit.compiled.verdicts import NO_VIOLATION, NOT_CLEAR
from posekit.geometry import Array

CLEAR_PART_BESIDE = 1e-7
"""How much of a bend lies beside the hinge's axis is known to the root of the rounding; of it the tolerance depends."""

LEAST_DEGREES_FLEXED = 1e-3
"""Degrees of flexion at the least by which a hip's range widens."""


def angle_rate(sine: Any, cosine: Any) -> Any:
    """Return an angle over its sine, NaN where that is not clear."""
    if not sine > SHORTEST_PART:
        return 1.0 + sine * sine / 6.0 if cosine > 0 else math.nan
    return math.atan2(sine, cosine) / sine


def judged_within(angle: Any, gain: Any, w: Array, at: int, lower: Any, upper: Any) -> Any:
    """Judge an angle, degrees, that turns so many times as fast as a segment; NaN is not clear."""
    return bounded(angle, CLEAR_ANGLE * gain, lower, upper, w[at] * gain)


def hip_flexion(x: Any, y: Any, middle: Any) -> Any:
    """Return the flexion of a thigh, degrees, within 180 of the middle of its range; NaN where that is not clear."""
    if not x * x + y * y > SHORTEST_PART * SHORTEST_PART:
        return math.nan
    off = IN_DEGREES * math.atan2(x, y) - middle
    if abs(abs(off) - 180.0) < SHORTEST_PART:
        return math.nan
    if off > 180.0:
        off -= 360.0
    elif off < -180.0:
        off += 360.0
    return middle + off


def turned_ball(w: Array, at: int) -> Any:
    """Screen a shoulder or hip: the torso's four points, then the joint and the one beyond.

    After the bounds is 1 for a shoulder.
    """
    if unknown(w, 0, 6):
        return NO_VIOLATION
    x, y, z = between(w, 4, 5)
    x, y, z = unit(x, y, z)
    x, y, z = in_torso(torso(w), x, y, z)
    z *= w[at + 3]
    if w[at + 8] > 0:
        gain = angle_rate(math.sqrt(x * x + z * z), y)
        flexion, abduction, beside = IN_DEGREES * gain * x, IN_DEGREES * gain * z, gain
    else:
        across = math.sqrt(x * x + y * y)
        flexion = hip_flexion(x, y, (w[at + 4] + w[at + 5]) / 2)
        if not across > SHORTEST_PART:
            return NOT_CLEAR
        abduction, gain, beside = IN_DEGREES * math.atan2(z, across), 1.0 / across, 1.0
    found = judged_within(flexion, gain, w, at, w[at + 4], w[at + 5])
    if found != IS_INSIDE:
        return 0 if found == IS_OUTSIDE else NOT_CLEAR
    found = judged_within(abduction, beside, w, at, w[at + 6], w[at + 7])
    if found != IS_INSIDE:
        return 1 if found == IS_OUTSIDE else NOT_CLEAR
    return NO_VIOLATION


def turned_hinge(w: Array, at: int) -> Any:
    """Screen an elbow or knee: the torso's four points, then the limb's three; numbers are `projected_hinge`'s."""
    if unknown(w, 0, 7):
        return NO_VIOLATION
    R = torso(w)
    ux, uy, uz = between(w, 4, 5)
    ux, uy, uz = unit(ux, uy, uz)
    ux, uy, uz = in_torso(R, ux, uy, uz)
    vx, vy, vz = between(w, 5, 6)
    vx, vy, vz = unit(vx, vy, vz)
    vx, vy, vz = in_torso(R, vx, vy, vz)
    elbow = w[at + 3] > 0
    top = 1.0 + uy if elbow else 1.0 - uz * uz
    if not top > SHORTEST_PART:
        return NOT_CLEAR
    if elbow:
        ax, ay, az = -ux * uz / top, -uz, 1.0 - uz * uz / top
        carried = math.sqrt((1.0 - uy) / top) if uy < 1.0 else 0.0
    else:
        across = math.sqrt(top)
        ax, ay, az = ux * uz / across, uy * uz / across, -across
        carried = abs(uz) / across
    wx, wy, wz = crossed(vx, vy, vz, ux, uy, uz)
    sine, part = math.sqrt(dot(wx, wy, wz, wx, wy, wz)), dot(wx, wy, wz, ax, ay, az)
    each = angle_rate(sine, dot(ux, uy, uz, vx, vy, vz))
    beside = math.sqrt(max(sine * sine - part * part, 0.0))
    gain = 1.0 + each * beside * carried
    if sine > SHORTEST_PART:
        gain += (each - 1.0) * beside / sine
    flexion = IN_DEGREES * each * part
    clear = each * (1.0 + carried) * (CLEAR_ANGLE + CLEAR_PART_BESIDE * w[at])
    hinge = bounded(flexion, clear, w[at + 4], w[at + 5], w[at] * gain)
    if hinge != IS_INSIDE:
        return 0 if hinge == IS_OUTSIDE else NOT_CLEAR
    if elbow:
        return NO_VIOLATION
    share = min(max(flexion / max(w[at + 6], LEAST_DEGREES_FLEXED), 0.0), 1.0)
    lower = (1.0 - share) * w[at + 9] + share * w[at + 7]
    upper = (1.0 - share) * w[at + 10] + share * w[at + 8]
    bent = hip_flexion(ux, uy, (w[at + 7] + w[at + 8]) / 2)
    blur = CLEAR_ANGLE / across + clear * 360.0 / max(w[at + 6], LEAST_DEGREES_FLEXED)
    found = bounded(bent, blur, lower, upper, w[at] / across)
    if found != IS_INSIDE:
        return 1 if found == IS_OUTSIDE else NOT_CLEAR
    return NO_VIOLATION


def turned_plane(nx: Any, ny: Any, nz: Any, ax: Any, ay: Any, az: Any, w: Array, at: int) -> Any:
    """Judge flexion, rotation and bending of a part by its plane's unit normal and the direction along it.

    The numbers go on with the three angles' signs, and with the bounds of each.
    """
    ax, ay, az = unit(ax, ay, az)
    zx, zy, zz = crossed(nx, ny, nz, ax, ay, az)
    # The rotation's columns are normal, along and their product: its axis is in what is not symmetric.
    x, y, z = az - zy, zx - nz, ny - ax
    sine = math.sqrt(dot(x, y, z, x, y, z)) / 2.0
    each = angle_rate(sine, (nx + ay + zz - 1.0) / 2.0) / 2.0
    for k in range(3):
        part = -z if k == 0 else -y if k == 1 else x
        angle = w[at + 3 + k] * IN_DEGREES * each * part
        found = judged_within(angle, 1.0, w, at, w[at + 6 + 2 * k], w[at + 7 + 2 * k])
        if found != IS_INSIDE:
            return k if found == IS_OUTSIDE else NOT_CLEAR
    return NO_VIOLATION


COMPILED_TYPES = {
    "angle_rate": "",
    "judged_within": "",
    "hip_flexion": "",
    "turned_ball": "(f8[::1], i8)",
    "turned_hinge": "(f8[::1], i8)",
    "turned_plane": "(f8, f8, f8, f8, f8, f8, f8[::1], i8)",
}
"""The kernels, in the order in which they need each other, with the types of those that are called."""
