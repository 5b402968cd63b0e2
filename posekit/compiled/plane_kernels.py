"""Planes of hips and head against the torso's, as plain loops, for `posekit.compiled.check_kernels`.

Their angles are rotations (`posekit.compiled.turned_kernels`) where the shortest projection, the second number of the
check, is below zero; else projections (`posekit.compiled.projected_kernels`).
"""

from __future__ import annotations

from typing import Any

from posekit.compiled.angle_kernels import TURN_AT, laid_head
from posekit.compiled.projected_kernels import crossed, in_torso, tilted
from posekit.compiled.rigid_kernels import between, spine_hips, torso, unit, unknown
from posekit.compiled.turned_kernels import turned_plane
from posekit.compiled.verdicts import NO_VIOLATION, NOT_CLEAR
from posekit.geometry import Array


def against_torso(nx: Any, ny: Any, nz: Any, ax: Any, ay: Any, az: Any, w: Array, at: int) -> Any:
    """Judge a part by its plane's unit normal and the direction along it, in the paper's axes of the torso."""
    if w[at + 1] < 0:
        return turned_plane(nx, ny, nz, ax, ay, az, w, at)
    return tilted(nx, ny, nz, ax, ay, az, w, at)


def hip_plane(w: Array, at: int) -> Any:
    """Screen the pelvis: the torso's four points, then both hips; after the bounds, 1 where the neck turns these."""
    if unknown(w, 0, 6):
        return NO_VIOLATION
    R = torso(w)
    x, y, z = (
        (w[12] + w[15]) / 2 - w[9],
        (w[13] + w[16]) / 2 - w[10],
        (w[14] + w[17]) / 2 - w[11],
    )
    if w[at + 12] > 0:
        H = spine_hips(w, 3, 4, 0)
        x, y, z = -H[2], -H[5], -H[8]
    mx, my, mz = in_torso(R, x, y, z)
    x, y, z = between(w, 4, 5)
    x, y, z = in_torso(R, x, y, z)
    x, y, z = crossed(mx, my, mz, x, y, z)
    nx, ny, nz = unit(x, y, z)
    return against_torso(nx, ny, nz, mx, my, mz, w, at)


def head_plane(w: Array, at: int) -> Any:
    """Screen the neck: the torso's four points, then the head's five, whose offsets follow the bounds."""
    if unknown(w, 0, 9):
        return NO_VIOLATION
    if not laid_head(w, at + 12):
        return NOT_CLEAR
    R = torso(w)
    nx, ny, nz = in_torso(R, w[TURN_AT], w[TURN_AT + 3], w[TURN_AT + 6])
    cx, cy, cz = in_torso(R, w[TURN_AT + 2], w[TURN_AT + 5], w[TURN_AT + 8])
    return against_torso(nx, ny, nz, -cx, -cy, -cz, w, at)


COMPILED_TYPES = {
    "against_torso": "",
    "hip_plane": "(f8[::1], i8)",
    "head_plane": "(f8[::1], i8)",
}
"""The kernels, in the order in which they need each other, with the types of those that are called."""
