"""Joint ranges as plain loops, for `posekit.compiled.check_kernels`: the formulas are `posekit.body.angles`'s.

The numbers of a check are signs, lower and upper limits of K angles (radians), then its tolerance; what follows is said
where it is read. Of every branch is written down how far each angle is outside its limits (from `OVER_AT` on, four a
branch), and how far the branch is (from `COST_AT` on).

The second branch of a ball joint is the first with half a turn more in every angle, the second abduction mirrored: all
branches come from the same three or four arcus tangents.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from posekit.compiled.frame_kernels import ROOM_AT
from posekit.compiled.noise_kernels import ALLOWED_AT, BLUR_AT, beside, loosened
from posekit.compiled.rigid_kernels import between, hips, rigid_frame, spine_hips, torso, unit, unknown
from posekit.compiled.verdicts import NO_VIOLATION, NOT_CLEAR
from posekit.geometry import Array
from posekit.geometry.rotations import TIED_ANGLES_RADIANS

CLEAR_RADIANS = 1e-9
"""Radians, or what is compared with them, within which nothing is clear: a million times the rounding."""

DEGREE_RADIANS = math.pi / 180.0
"""A degree, radians."""

SINGULAR_SINE = 1e-5
"""Sine below which an angle is nearly free, and rounding is not small any more."""

STRAIGHT_COSTS = 7.0
"""Radians that an axial rotation is outside its limits at most, more than a turn."""

OVER_AT, COST_AT, TURN_AT = ROOM_AT, ROOM_AT + 16, ROOM_AT + 20
"""Where branches and two matrices are written down."""

MOST_STEPS = 30
"""Newton's steps towards a rotation; six are usual."""


def outside(angle: Any, lower: Any, upper: Any) -> Any:
    """Return how far an angle is outside its limits, negative inside; NaN where it is unclear by how many turns."""
    off = angle - (lower + upper) / 2
    off = abs(off - 2 * math.pi * np.floor(off / (2 * math.pi) + 0.5))
    if off > math.pi - CLEAR_RADIANS:
        return math.nan
    return off - (upper - lower) / 2


def verdict(w: Array, count: int, width: int, tolerance: Any, loose: Any) -> Any:
    """Judge the branch that a closed form would choose.

    Parameters
    ----------
    count, width : int
        How many branches and angles are written down. The first branch that is inside is chosen, else the one that is
        least far (`TIED_ANGLES_RADIANS`).
    tolerance, loose : float
        How far outside is no violation; `loose` for the third angle, infinite where it is not judged.
    """
    least = math.inf
    for b in range(count):
        if not abs(w[COST_AT + b]) > CLEAR_RADIANS:  # NaN too
            return NOT_CLEAR
        least = min(least, w[COST_AT + b])
    if least < 0:
        return NO_VIOLATION
    chosen = -1
    for b in range(count):
        if abs(w[COST_AT + b] - least - TIED_ANGLES_RADIANS) <= CLEAR_RADIANS:
            return NOT_CLEAR
        if chosen < 0 and w[COST_AT + b] < least + TIED_ANGLES_RADIANS:
            chosen = b
    for k in range(width):
        beyond = w[OVER_AT + 4 * chosen + k] - loosened(w, k, loose if k == 2 else tolerance, DEGREE_RADIANS)
        if abs(beyond) <= CLEAR_RADIANS + w[BLUR_AT]:
            return NOT_CLEAR
        if beyond > 0:
            return k
    return NO_VIOLATION


def ball(R: Any, w: Array, at: int) -> Any:
    """Judge the three angles of a rotation, nine numbers row by row."""
    ux, uy, uz = -R[2], -R[5], -R[8]
    level = ux * ux + uz * uz
    if not level > SINGULAR_SINE * SINGULAR_SINE:
        return NOT_CLEAR
    level = math.sqrt(level)
    cosine, sine = -uz / level, -ux / level
    forward = sine * R[0] + cosine * R[6]
    alpha, beta = math.atan2(-ux, -uz), math.atan2(uy, level)
    gamma = math.atan2(level * R[3] + uy * forward, cosine * R[0] - sine * R[6])
    for b in range(2):
        if b == 1:
            alpha, beta, gamma = alpha + math.pi, math.pi - beta, gamma + math.pi
        first = outside(alpha * w[at], w[at + 3], w[at + 6])
        second = outside(beta * w[at + 1], w[at + 4], w[at + 7])
        third = outside(gamma * w[at + 2], w[at + 5], w[at + 8])
        w[OVER_AT + 4 * b], w[OVER_AT + 4 * b + 1], w[OVER_AT + 4 * b + 2] = first, second, third
        w[COST_AT + b] = worst(worst(first, second), third)
        if w[COST_AT + b] < -CLEAR_RADIANS:
            return NO_VIOLATION if b == 0 or abs(w[COST_AT]) > CLEAR_RADIANS else NOT_CLEAR
    return verdict(w, 2, 3, w[at + 9], w[at + 9])


def worst(a: Any, b: Any) -> Any:
    """Return the larger of two numbers, NaN where one is."""
    if a > b or math.isnan(a):
        return a
    return b


def transposed(A: Any, B: Any) -> Any:
    """Return the product of A's transpose and B, nine numbers each."""
    return (
        A[0] * B[0] + A[3] * B[3] + A[6] * B[6],
        A[0] * B[1] + A[3] * B[4] + A[6] * B[7],
        A[0] * B[2] + A[3] * B[5] + A[6] * B[8],
        A[1] * B[0] + A[4] * B[3] + A[7] * B[6],
        A[1] * B[1] + A[4] * B[4] + A[7] * B[7],
        A[1] * B[2] + A[4] * B[5] + A[7] * B[8],
        A[2] * B[0] + A[5] * B[3] + A[8] * B[6],
        A[2] * B[1] + A[5] * B[4] + A[8] * B[7],
        A[2] * B[2] + A[5] * B[5] + A[8] * B[8],
    )


def pelvis(w: Array, at: int) -> Any:
    """Screen the pelvis: the torso's four points, then both hips; after the tolerance, 1 where the neck turns these."""
    if unknown(w, 0, 6):
        return NO_VIOLATION
    R = spine_hips(w, 3, 4, 0) if w[at + 10] > 0 else hips(w, 3)
    return ball(transposed(torso(w), R), w, at)


def polar(w: Array) -> Any:
    """Turn the matrix at `TURN_AT` into the rotation nearest to it, and say whether that is clear.

    By Newton's iteration (Higham 1986). Not where the determinant is negative or small: then the nearest orthogonal
    matrix is a reflection, or unclear.
    """
    size = 0.0
    for i in range(3):
        for j in range(3):
            size += w[TURN_AT + 3 * i + j] * w[TURN_AT + 3 * i + j]
    size = math.sqrt(size)
    if not (size > 0 and size < math.inf):
        return False
    for i in range(3):
        for j in range(3):
            w[TURN_AT + 3 * i + j] = w[TURN_AT + 3 * i + j] / size * math.sqrt(3.0)
    for step in range(MOST_STEPS):
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            for j in range(3):
                c, d = (j + 1) % 3, (j + 2) % 3
                w[TURN_AT + 9 + 3 * i + j] = (
                    w[TURN_AT + 3 * a + c] * w[TURN_AT + 3 * b + d]
                    - w[TURN_AT + 3 * a + d] * w[TURN_AT + 3 * b + c]
                )
        determinant = (
            w[TURN_AT] * w[TURN_AT + 9] + w[TURN_AT + 1] * w[TURN_AT + 10] + w[TURN_AT + 2] * w[TURN_AT + 11]
        )
        if not determinant > (1e-5 if step == 0 else 0.0):
            return False
        change = 0.0
        for i in range(3):
            for j in range(3):
                new = (w[TURN_AT + 3 * i + j] + w[TURN_AT + 9 + 3 * i + j] / determinant) / 2
                change = max(change, abs(new - w[TURN_AT + 3 * i + j]))
                w[TURN_AT + 3 * i + j] = new
        if change < 1e-13:
            return True
    return False


def laid_head(w: Array, at: int) -> Any:
    """Lay the head onto the five points after the torso's four: its frame is at `TURN_AT`. Return whether it is clear.

    From some place on are the offsets of its points from the neck.
    """
    for i in range(3):
        for j in range(3):
            w[TURN_AT + 3 * i + j] = 0.0
            for k in range(5):
                w[TURN_AT + 3 * i + j] += (w[3 * (4 + k) + i] - w[i]) * w[at + 3 * k + j]
    return polar(w)


def neck(w: Array, at: int) -> Any:
    """Screen the neck: the torso's four points, then the head's five, whose offsets follow the tolerance."""
    if unknown(w, 0, 9):
        return NO_VIOLATION
    if not laid_head(w, at + 10):
        return NOT_CLEAR
    head = (
        w[TURN_AT],
        w[TURN_AT + 1],
        w[TURN_AT + 2],
        w[TURN_AT + 3],
        w[TURN_AT + 4],
        w[TURN_AT + 5],
        w[TURN_AT + 6],
        w[TURN_AT + 7],
        w[TURN_AT + 8],
    )
    return ball(transposed(torso(w), head), w, at)


def direction(w: Array, a: int, b: int, R: Any) -> Any:
    """Return the direction from one point to another in the frame R."""
    x, y, z = between(w, a, b)
    x, y, z = unit(x, y, z)
    return R[0] * x + R[3] * y + R[6] * z, R[1] * x + R[4] * y + R[7] * z, R[2] * x + R[5] * y + R[8] * z


def limb(w: Array, at: int) -> Any:
    """Screen a limb: its rigid part (points of torso or hips), then two joints, or three of a whole one.

    The tolerance is followed by that from which on an axial rotation is not seen (radians), as
    `posekit.validators.joint_range.Limb` has it; by the kind of the rigid part
    (`posekit.compiled.rigid_kernels.rigid_frame`), and by 1 for a whole limb.
    Where the end is not known the first two angles are judged alone.
    """
    rigid, whole = abs(int(w[at + 14])), w[at + 15] > 0
    if unknown(w, 0, rigid + 2):
        return NO_VIOLATION  # nothing is judged
    R = rigid_frame(w, int(w[at + 14]))
    ux, uy, uz = direction(w, rigid, rigid + 1, R)
    level = ux * ux + uz * uz
    if not level > SINGULAR_SINE * SINGULAR_SINE:
        return NOT_CLEAR
    level = math.sqrt(level)
    beside(w, level, uy)
    tolerance, unseen = w[at + 12], w[at + 13]
    alpha, beta = math.atan2(-ux, -uz), math.atan2(uy, level)
    first = outside(alpha * w[at], w[at + 4], w[at + 8])
    second = outside(beta * w[at + 1], w[at + 5], w[at + 9])
    first_turned = outside((alpha + math.pi) * w[at], w[at + 4], w[at + 8])
    second_turned = outside((math.pi - beta) * w[at + 1], w[at + 5], w[at + 9])
    if not whole or unknown(w, rigid + 2, rigid + 3):
        w[OVER_AT], w[OVER_AT + 1], w[COST_AT] = first, second, worst(first, second)
        w[OVER_AT + 4], w[OVER_AT + 5], w[COST_AT + 1] = (
            first_turned,
            second_turned,
            worst(first_turned, second_turned),
        )
        return verdict(w, 2, 2, tolerance, tolerance)
    lx, ly, lz = direction(w, rigid + 1, rigid + 2, R)
    wx, wy, wz = uy * lz - uz * ly, uz * lx - ux * lz, ux * ly - uy * lx
    cosine, sine = -uz / level, -ux / level
    forward = sine * lx + cosine * lz
    x, y, z = cosine * lx - sine * lz, level * ly + uy * forward, -uy * ly + level * forward
    bend = math.sqrt(x * x + y * y)
    hinge = math.atan2(bend, -z)
    bent = outside(hinge * w[at + 3], w[at + 7], w[at + 11])
    back = outside(-hinge * w[at + 3], w[at + 7], w[at + 11])
    straight = wx * wx + wy * wy + wz * wz
    if not straight > SINGULAR_SINE * SINGULAR_SINE:
        # The axial rotation is as good as free, and not judged. It costs a branch next to nothing, and so the one
        # that is chosen is hardly worse than the best without it.
        loose = math.sqrt(straight) + CLEAR_RADIANS
        if math.isnan(first + second + first_turned + second_turned + bent + back):
            return NOT_CLEAR
        least = min(max(first, second), max(first_turned, second_turned))
        least = max(least, min(bent, back), 0.0) + STRAIGHT_COSTS * loose + 2 * TIED_ANGLES_RADIANS
        allowed = tolerance * w[ALLOWED_AT] if w[ALLOWED_AT] > 0 else tolerance
        clear = (
            tolerance > unseen * loose * (1 + CLEAR_RADIANS) and least < allowed - CLEAR_RADIANS - w[BLUR_AT]
        )
        return NO_VIOLATION if clear else NOT_CLEAR
    loose = tolerance / bend
    if abs(loose - unseen) <= CLEAR_RADIANS * loose:
        return NOT_CLEAR
    if loose > unseen:
        loose = math.inf
    gamma = math.atan2(-y, -x)
    third = outside(gamma * w[at + 2], w[at + 6], w[at + 10])
    third_turned = outside((gamma + math.pi) * w[at + 2], w[at + 6], w[at + 10])
    for b in range(4):
        w[OVER_AT + 4 * b], w[OVER_AT + 4 * b + 1] = (
            (first, second) if b < 2 else (first_turned, second_turned)
        )
        w[OVER_AT + 4 * b + 2] = third_turned if 0 < b < 3 else third
        w[OVER_AT + 4 * b + 3] = bent if b % 2 == 0 else back
        # The axial rotation counts by how far it turns the lower segment.
        w[COST_AT + b] = worst(
            worst(worst(w[OVER_AT + 4 * b], w[OVER_AT + 4 * b + 1]), w[OVER_AT + 4 * b + 2] * bend),
            w[OVER_AT + 4 * b + 3],
        )
        if not abs(w[COST_AT + b]) > CLEAR_RADIANS:
            return NOT_CLEAR
        if w[COST_AT + b] < 0:
            return NO_VIOLATION
    return verdict(w, 4, 4, tolerance, loose)


COMPILED_TYPES = {
    "outside": "",
    "worst": "",
    "verdict": "",
    "ball": "(UniTuple(f8, 9), f8[::1], i8)",
    "transposed": "",
    "pelvis": "(f8[::1], i8)",
    "polar": "(f8[::1],)",
    "laid_head": "(f8[::1], i8)",
    "neck": "(f8[::1], i8)",
    "direction": "",
    "limb": "",
}
"""The kernels, in the order in which they need each other, with the types of those that are called.

The others are compiled into those that call them, again and again: that takes long, and pays only for what is asked
often.
"""
