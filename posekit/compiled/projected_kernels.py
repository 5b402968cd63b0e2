"""Projected angles (Lee & Chen 1985, section 3.2.A) as plain loops, for `posekit.compiled.check_kernels`.

They do what the checks of `posekit.validators.projected_angles` do with arrays: angles are measured in the planes of
the torso's frame, x forward, y down, z left. They say which place is violated first where that is clear by more than
any rounding; else they are unsure, and the judge is asked.

The numbers of every check begin with its tolerance (degrees), the part of a segment below which its projection has no
direction, and the angle (degrees) below which a full turn is added; what follows is said where it is read.
"""

from __future__ import annotations

import math
from typing import Any

from posekit.compiled.rigid_kernels import between, torso, unknown
from posekit.compiled.verdicts import NO_VIOLATION, NOT_CLEAR
from posekit.geometry import Array

CLEAR_ANGLE = 1e-8
"""Degrees, over the part of a segment that is seen in a plane, within which its angle there is not clear."""

CLEAR_PART = 1e-10
"""Part of a length within which it is not clear: a torso whose shoulders are near its spine has no clear frame."""

SHORTEST_PART = 1e-5
"""Part of a segment below which its projection tells no angle, whatever the table of ranges says."""

IN_DEGREES = 180.0 / math.pi

IS_OUTSIDE, IS_INSIDE, IS_UNCLEAR = 1, 0, -1
"""What is said of one place."""


def dot(ax: Any, ay: Any, az: Any, bx: Any, by: Any, bz: Any) -> Any:
    """Return the dot product of two vectors."""
    return ax * bx + ay * by + az * bz


def crossed(ax: Any, ay: Any, az: Any, bx: Any, by: Any, bz: Any) -> Any:
    """Return the cross product of two vectors."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


def in_torso(R: Any, x: Any, y: Any, z: Any) -> Any:
    """Return a vector in the paper's axes, of the torso's frame R row by row: x forward, y down, z left."""
    return (
        R[0] * x + R[3] * y + R[6] * z,
        -(R[2] * x + R[5] * y + R[8] * z),
        R[1] * x + R[4] * y + R[7] * z,
    )


def bounded(angle: Any, clear: Any, lower: Any, upper: Any, tolerance: Any) -> Any:
    """Compare an angle that is known to so many degrees with its bounds."""
    beyond = max(lower - angle, angle - upper) - tolerance
    if not abs(beyond) > clear:
        return IS_UNCLEAR
    return IS_OUTSIDE if beyond > 0 else IS_INSIDE


def in_plane(x: Any, y: Any, size: Any, sign: Any, w: Array, at: int, lower: Any, upper: Any) -> Any:
    """Judge the angle from the second axis of a plane towards the first, times a sign; `size` is the whole vector's."""
    across = math.sqrt(x * x + y * y)
    if not abs(across - w[at + 1] * size) > CLEAR_PART * size:  # NaN too
        return IS_UNCLEAR
    if across < w[at + 1] * size:
        return IS_INSIDE  # it has no direction, and is not judged
    if not across > SHORTEST_PART * size:
        return IS_UNCLEAR
    angle, clear = IN_DEGREES * math.atan2(x, y), CLEAR_ANGLE * size / across
    if abs(angle - w[at + 2]) <= clear:
        return IS_UNCLEAR
    if angle < w[at + 2]:
        angle += 360.0
    return bounded(sign * angle, clear, lower, upper, w[at])


def projected_ball(w: Array, at: int) -> Any:
    """Screen a shoulder or hip: the torso's four points, then the joint and the one beyond.

    The numbers go on with 1 on the left and -1 on the right, the bounds of flexion and those of abduction.
    """
    if unknown(w, 0, 6):
        return NO_VIOLATION
    x, y, z = between(w, 4, 5)
    x, y, z = in_torso(torso(w), x, y, z)
    size = math.sqrt(dot(x, y, z, x, y, z))
    flexion = in_plane(x, y, size, 1.0, w, at, w[at + 4], w[at + 5])
    abduction = in_plane(w[at + 3] * z, y, size, 1.0, w, at, w[at + 6], w[at + 7])
    if flexion != IS_INSIDE:
        return 0 if flexion == IS_OUTSIDE else NOT_CLEAR
    if abduction != IS_INSIDE:
        return 1 if abduction == IS_OUTSIDE else NOT_CLEAR
    return NO_VIOLATION


def projected_hinge(w: Array, at: int) -> Any:
    """Screen an elbow or knee: the torso's four points, then the limb's three.

    The numbers go on with 1 for an elbow and -1 for a knee, and the bounds of its flexion. At a knee follow the flexion
    above which it counts as flexed, and the hip's bounds where it is and where it is not.
    """
    if unknown(w, 0, 7):
        return NO_VIOLATION
    R = torso(w)
    ux, uy, uz = between(w, 4, 5)
    vx, vy, vz = between(w, 5, 6)
    ux, uy, uz = in_torso(R, ux, uy, uz)
    vx, vy, vz = in_torso(R, vx, vy, vz)
    wx, wy, wz = crossed(vx, vy, vz, ux, uy, uz)
    upper, both = math.sqrt(dot(ux, uy, uz, ux, uy, uz)), math.sqrt(dot(vx, vy, vz, vx, vy, vz))
    both *= upper
    size = math.sqrt(dot(wx, wy, wz, wx, wy, wz))
    bend = IN_DEGREES * math.atan2(size, dot(ux, uy, uz, vx, vy, vz))
    forward = w[at + 3] * wz + w[at] / IN_DEGREES * size
    if not (both > 0 and abs(forward) < math.inf):
        return NOT_CLEAR
    # Which way a limb bends that is all but straight is not clear; nor need it be where either is judged alike.
    unclear = not abs(forward) > CLEAR_PART * both
    found = NOT_CLEAR
    for way in range(2):
        if not unclear and (forward > 0) == (way == 1):
            continue
        flexion = bend if way == 0 else -bend
        place = NO_VIOLATION
        hinge = bounded(flexion, CLEAR_ANGLE, w[at + 4], w[at + 5], w[at])
        if hinge != IS_INSIDE:
            place = 0 if hinge == IS_OUTSIDE else NOT_CLEAR
        elif w[at + 3] < 0:
            if not abs(flexion - w[at + 6]) > CLEAR_ANGLE:
                return NOT_CLEAR
            k = at + 7 if flexion > w[at + 6] else at + 9
            hip = in_plane(ux, uy, upper, 1.0, w, at, w[k], w[k + 1])
            if hip != IS_INSIDE:
                place = 1 if hip == IS_OUTSIDE else NOT_CLEAR
        if unclear and way == 1 and place != found:
            return NOT_CLEAR
        found = place
    return found


def tilted(nx: Any, ny: Any, nz: Any, ax: Any, ay: Any, az: Any, w: Array, at: int) -> Any:
    """Judge flexion, rotation and bending of a part by its plane's normal and the direction along it.

    The numbers go on with the three angles' signs, and with the bounds of each.
    """
    along = math.sqrt(dot(ax, ay, az, ax, ay, az))
    for k in range(3):
        x = -ny if k == 0 else nz if k == 1 else az
        found = in_plane(
            x,
            ay if k == 2 else nx,
            along if k == 2 else 1.0,
            w[at + 3 + k],
            w,
            at,
            w[at + 6 + 2 * k],
            w[at + 7 + 2 * k],
        )
        if found != IS_INSIDE:
            return k if found == IS_OUTSIDE else NOT_CLEAR
    return NO_VIOLATION


COMPILED_TYPES = {
    "dot": "",
    "crossed": "",
    "in_torso": "",
    "bounded": "",
    "in_plane": "(f8, f8, f8, f8, f8[::1], i8, f8, f8)",
    "projected_ball": "(f8[::1], i8)",
    "projected_hinge": "(f8[::1], i8)",
    "tilted": "(f8, f8, f8, f8, f8, f8, f8[::1], i8)",
}
"""The kernels, in the order in which they need each other, with the types of those that are called."""
