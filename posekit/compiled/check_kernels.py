"""The checks' screens as plain loops, for `posekit.compiled.compiling`: they tell what is clear.

A screen says of a posture that it passes, or which place it violates first, where that is clear by more than any
rounding; else that it is unsure, and the check's own `judge` is asked (`posekit.tree.Rule`). So these formulas
decide nothing that the judge would decide otherwise, and need no care at singularities: there they are unsure.

`screen` knows every kind: trees are grown with it in one go (`posekit.compiled.frame_kernels`). This file has the
capsules; rigid parts and joint ranges are in files of their own.
"""

from __future__ import annotations

import math
from typing import Any

from posekit.compiled import (
    anatomical_kernels,
    angle_kernels,
    capsule_kernels,
    noise_kernels,
    plane_kernels,
    projected_kernels,
    rigid_kernels,
    turned_kernels,
)
from posekit.compiled.anatomical_kernels import anatomical
from posekit.compiled.angle_kernels import limb, neck, pelvis
from posekit.compiled.capsule_kernels import least_apart, mean
from posekit.compiled.frame_kernels import PRESUMED_AT
from posekit.compiled.noise_kernels import AT_COUNT, AT_PAIRS, PAIR_NUMBERS, allow, forget
from posekit.compiled.plane_kernels import head_plane, hip_plane
from posekit.compiled.projected_kernels import projected_ball, projected_hinge
from posekit.compiled.rigid_kernels import (
    distance,
    hips,  # noqa: F401 - to be compiled
    placement,
    rigid_frame,  # noqa: F401 - to be compiled
    side,
    spine_hips,  # noqa: F401 - to be compiled
    torso,  # noqa: F401 - to be compiled
    unit,
    unknown,
)
from posekit.compiled.screen_kinds import (
    OF_ANATOMICAL_LIMB,
    OF_CAPSULES,
    OF_DISTANCE,
    OF_HEAD_PLANE,
    OF_HIP_PLANE,
    OF_LIMB,
    OF_NECK,
    OF_NOISY,
    OF_PELVIS,
    OF_PLACEMENT,
    OF_PROJECTED_BALL,
    OF_PROJECTED_HINGE,
    OF_SIDE,
    OF_TURNED_BALL,
    OF_TURNED_HINGE,
)
from posekit.compiled.turned_kernels import turned_ball, turned_hinge
from posekit.compiled.verdicts import NO_VIOLATION, NOT_CLEAR
from posekit.geometry import Array

CLEAR_GAP = 1e-6
"""Metres between two capsules from which they are clear of contact: a thousand times what the judge cares for."""


def capsules(w: Array, at: int) -> Any:
    """Screen two capsules: they are clear of each other, or they penetrate, which coal must confirm.

    The numbers are center and half length of each, then both radii and the contact margin, metres; and how many points
    start and end each. Where they seem to penetrate, position and quaternion of each are what is presumed. See
    `posekit.validators.collision` for the formulas.
    """
    starts_a, ends_a, starts_b, ends_b = int(w[at + 5]), int(w[at + 6]), int(w[at + 7]), int(w[at + 8])
    second = starts_a + ends_a
    if unknown(w, 0, second + starts_b + ends_b):
        return NO_VIOLATION
    center_a, half_a, center_b, half_b, reach = w[at], w[at + 1], w[at + 2], w[at + 3], w[at + 4]
    # Of bodies that may overlap by more than their radii are, coal is asked about the lines in their middles.
    far, near, deep = half_a + half_b + reach + CLEAR_GAP, max(reach, 0.0) + CLEAR_GAP, reach - CLEAR_GAP
    sx, sy, sz = mean(w, 0, starts_a)
    ex, ey, ez = mean(w, starts_a, ends_a)
    ux, uy, uz = unit(ex - sx, ey - sy, ez - sz)
    tx, ty, tz = mean(w, second, starts_b)
    fx, fy, fz = mean(w, second + starts_b, ends_b)
    vx, vy, vz = unit(fx - tx, fy - ty, fz - tz)
    sx, sy, sz = sx + center_a * ux, sy + center_a * uy, sz + center_a * uz
    tx, ty, tz = tx + center_b * vx, ty + center_b * vy, tz + center_b * vz
    gx, gy, gz = tx - sx, ty - sy, tz - sz
    squared = gx * gx + gy * gy + gz * gz
    if not squared < math.inf:
        return NOT_CLEAR
    if far > 0 and squared > far * far:
        return NO_VIOLATION
    ax, ay, az, bx, by, bz = half_a * ux, half_a * uy, half_a * uz, half_b * vx, half_b * vy, half_b * vz
    least = least_apart(gx, gy, gz, ax, ay, az, bx, by, bz)
    if least > near * near:
        return NO_VIOLATION
    if not (deep > 0 and least < deep * deep):
        return NOT_CLEAR
    w[PRESUMED_AT], w[PRESUMED_AT + 1], w[PRESUMED_AT + 2] = sx, sy, sz
    w[PRESUMED_AT + 7], w[PRESUMED_AT + 8], w[PRESUMED_AT + 9] = tx, ty, tz
    onto(ux, uy, uz, w, PRESUMED_AT + 3)
    onto(vx, vy, vz, w, PRESUMED_AT + 10)
    return 0


def onto(x: Any, y: Any, z: Any, q: Array, at: int) -> None:
    """Put into q, from some place on, the unit quaternion that turns z onto an axis or its opposite."""
    sign = -1.0 if z < 0 else 1.0
    w = 1.0 + sign * z
    size = math.sqrt(2.0 * w)
    q[at], q[at + 1], q[at + 2], q[at + 3] = -sign * y / size, sign * x / size, 0.0, w / size


def noisy(w: Array, at: int) -> Any:
    """Screen an angle as another screen does, with what noise allows (`posekit.compiled.noise_kernels`)."""
    if not allow(w, at):
        return NOT_CLEAR
    kind, own = int(w[at]), at + AT_PAIRS + PAIR_NUMBERS * int(w[at + AT_COUNT])
    found = NOT_CLEAR
    if kind == OF_ANATOMICAL_LIMB:
        found = int(anatomical(w, own))
    elif kind == OF_LIMB:
        found = int(limb(w, own))
    elif kind == OF_PELVIS:
        found = int(pelvis(w, own))
    elif kind == OF_NECK:
        found = int(neck(w, own))
    forget(w)
    return found


def screen(kind: int, w: Array, at: int) -> Any:
    """Screen one posture by one check, of a kind; see `posekit.compiled.frame_kernels.screen`."""
    if kind == OF_CAPSULES:
        return capsules(w, at)
    if kind == OF_LIMB:
        return limb(w, at)
    if kind == OF_DISTANCE:
        return distance(w, at)
    if kind == OF_ANATOMICAL_LIMB:
        return anatomical(w, at)
    if kind == OF_SIDE:
        return side(w, at)
    if kind == OF_NOISY:
        return noisy(w, at)
    if kind == OF_PLACEMENT:
        return placement(w, at)
    if kind == OF_PROJECTED_BALL:
        return projected_ball(w, at)
    if kind == OF_PROJECTED_HINGE:
        return projected_hinge(w, at)
    if kind == OF_TURNED_BALL:
        return turned_ball(w, at)
    if kind == OF_TURNED_HINGE:
        return turned_hinge(w, at)
    if kind == OF_HIP_PLANE:
        return hip_plane(w, at)
    if kind == OF_HEAD_PLANE:
        return head_plane(w, at)
    if kind == OF_PELVIS:
        return pelvis(w, at)
    if kind == OF_NECK:
        return neck(w, at)
    return NOT_CLEAR


KERNEL_PARTS = (
    rigid_kernels,
    capsule_kernels,
    noise_kernels,
    angle_kernels,
    anatomical_kernels,
    projected_kernels,
    turned_kernels,
    plane_kernels,
)
"""Other modules whose kernels are compiled with these."""

COMPILED_TYPES = {
    "torso": "(f8[::1],)",
    "hips": "(f8[::1], i8)",
    "spine_hips": "(f8[::1], i8, i8, i8)",
    "rigid_frame": "(f8[::1], i8)",
    "side": "(f8[::1], i8)",
    "distance": "(f8[::1], i8)",
    "placement": "(f8[::1], i8)",
    "onto": "",
    "capsules": "",
    "noisy": "(f8[::1], i8)",
    "screen": "",
}
"""The kernels, in the order in which they need each other, with the types of those that are called.

Those of rigid parts are among them: they are wanted in many places, and asked seldom.
"""
