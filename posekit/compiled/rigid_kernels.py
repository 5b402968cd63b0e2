"""Rigid parts as plain loops, for `posekit.compiled.check_kernels`: their frames, and screens of their shape.

All that a screen reads is in one array w, which is quick to hand on: first the points of one posture, x, y, z each, in
metres; from some place `at` on the numbers of its check (`posekit.compiled.frame_kernels.screen`). A frame is nine
numbers, row by row; NaN where it is not clear.
"""

from __future__ import annotations

import math
from typing import Any

from posekit.compiled.verdicts import NO_VIOLATION, NOT_CLEAR
from posekit.geometry import Array

SHORTEST_METRES = 1e-4
"""Metres below which a line between points, or what is left of one square to another, has no clear direction."""

CLEAR_LENGTH = 1e-12
"""Part of a distance, and metres, within which it is not clear: a thousand times the rounding."""

CLEAR_PLACE = 1e-10
"""The same of how far a point is from where the figure's would be, which takes a frame."""

FAR_METRES = 1e3
"""Metres from the camera beyond which rounding is larger than was said."""


def unit(x: Any, y: Any, z: Any) -> Any:
    """Return a vector scaled to length one; NaN where it is too short, or beyond all numbers."""
    size = math.sqrt(x * x + y * y + z * z)
    if not SHORTEST_METRES < size < math.inf:
        return math.nan, math.nan, math.nan
    return x / size, y / size, z / size


def unknown(w: Array, first: int, last: int) -> Any:
    """Return whether a coordinate of some points is NaN."""
    for i in range(3 * first, 3 * last):
        if math.isnan(w[i]):
            return True
    return False


def between(w: Array, a: int, b: int) -> Any:
    """Return the vector from one point to another."""
    return w[3 * b] - w[3 * a], w[3 * b + 1] - w[3 * a + 1], w[3 * b + 2] - w[3 * a + 2]


def frame_of(lx: Any, ly: Any, lz: Any, dx: Any, dy: Any, dz: Any) -> Any:
    """Return the frame with the columns down x left, left, -down."""
    return dy * lz - dz * ly, lx, -dx, dz * lx - dx * lz, ly, -dy, dx * ly - dy * lx, lz, -dz


def square(ax: Any, ay: Any, az: Any, bx: Any, by: Any, bz: Any) -> Any:
    """Return the direction of what one vector has square to another, which has length one."""
    along = ax * bx + ay * by + az * bz
    return unit(ax - along * bx, ay - along * by, az - along * bz)


def torso(w: Array) -> Any:
    """Return the torso's frame from neck, right and left shoulder and pelvis, the first four points."""
    dx, dy, dz = between(w, 0, 3)
    dx, dy, dz = unit(dx, dy, dz)
    ax, ay, az = between(w, 1, 2)
    lx, ly, lz = square(ax, ay, az, dx, dy, dz)
    return frame_of(lx, ly, lz, dx, dy, dz)


def hips(w: Array, first: int) -> Any:
    """Return the hips' frame from pelvis, right and left hip, three points from the first on."""
    lx, ly, lz = between(w, first + 1, first + 2)
    lx, ly, lz = unit(lx, ly, lz)
    ax, ay, az = between(w, first, first + 1)
    dx, dy, dz = square(ax, ay, az, lx, ly, lz)
    return frame_of(lx, ly, lz, dx, dy, dz)


def spine_hips(w: Array, pelvis: int, right: int, neck: int) -> Any:
    """Return the frame of hips with the pelvis between them, which turn with the line from neck to pelvis."""
    lx, ly, lz = between(w, right, right + 1)
    lx, ly, lz = unit(lx, ly, lz)
    ax, ay, az = between(w, neck, pelvis)
    dx, dy, dz = square(ax, ay, az, lx, ly, lz)
    return frame_of(lx, ly, lz, dx, dy, dz)


def rigid_frame(w: Array, kind: int) -> Any:
    """Return the frame of the part that a limb hangs on, the first points.

    By kind: 4, the torso's four points; 3, the hips' three; -4, the hips' three and the neck, which turns them.
    """
    if kind == 4:
        return torso(w)
    if kind == 3:
        return hips(w, 0)
    return spine_hips(w, 0, 1, 3)


def side(w: Array, at: int) -> Any:
    """Screen how far the shoulders of a torso lie in front of the line from neck to pelvis.

    The numbers are 1 or -1, and the least that this times the distance may be, metres.
    """
    if unknown(w, 0, 4):
        return NO_VIOLATION
    R = torso(w)
    x, y, z = between(w, 0, 1)
    value = w[at] * (R[0] * x + R[3] * y + R[6] * z)
    for k in range(0, 12, 3):
        if not abs(w[k]) + abs(w[k + 1]) + abs(w[k + 2]) < FAR_METRES:
            return NOT_CLEAR
    beyond = w[at + 1] - value
    if not abs(beyond) > CLEAR_PLACE * (1.0 + abs(value)):  # NaN too
        return NOT_CLEAR
    return 0 if beyond > 0 else NO_VIOLATION


def distance(w: Array, at: int) -> Any:
    """Screen the distance between two points; the numbers are its lower and upper bound, metres."""
    if unknown(w, 0, 2):
        return NO_VIOLATION
    x, y, z = between(w, 0, 1)
    value = math.sqrt(x * x + y * y + z * z)
    beyond = max(w[at] - value, value - w[at + 1])
    if not abs(beyond) > CLEAR_LENGTH * (1.0 + value):
        return NOT_CLEAR
    return 0 if beyond > 0 else NO_VIOLATION


def placement(w: Array, at: int) -> Any:
    """Screen how far the torso's points are from the figure's; the numbers are the tolerance, then these, metres."""
    if unknown(w, 0, 4):
        return NO_VIOLATION
    a, b, c, d, e, f, g, h, i = torso(w)
    worst = 0.0
    for k in range(0, 12, 3):
        u, v, t = w[at + 1 + k], w[at + 2 + k], w[at + 3 + k]
        x = w[0] + (a * u + b * v + c * t) - w[k]
        y = w[1] + (d * u + e * v + f * t) - w[k + 1]
        z = w[2] + (g * u + h * v + i * t) - w[k + 2]
        if not abs(w[k]) + abs(w[k + 1]) + abs(w[k + 2]) < FAR_METRES:
            return NOT_CLEAR
        off = x * x + y * y + z * z
        if not off <= worst:  # NaN too
            worst = off
        if math.isnan(worst):
            return NOT_CLEAR
    worst = math.sqrt(worst)
    beyond = worst - w[at]
    if not abs(beyond) > CLEAR_PLACE * (1.0 + worst):
        return NOT_CLEAR
    return 0 if beyond > 0 else NO_VIOLATION


COMPILED_TYPES = {
    "unit": "",
    "unknown": "",
    "between": "",
    "square": "",
    "frame_of": "",
    "torso": "",
    "hips": "",
    "spine_hips": "",
    "rigid_frame": "",
    "side": "",
    "distance": "",
    "placement": "",
}
"""The kernels, in the order in which they need each other."""
