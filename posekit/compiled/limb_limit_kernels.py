"""Limits of one limb as plain loops, for `posekit.compiled.limb_block_kernels`.

The formulas are those of `posekit.refinement.limits` for boxes of angles, and of `posekit.refinement.walls` for
anatomical ranges. Numbers of a posture stand where `posekit.compiled.posture_numbers` says.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.compiled import limb_kernels
from posekit.compiled.limb_kernels import beyond_limits
from posekit.compiled.posture_numbers import (
    AT_DIRECTIONS,
    AT_HIPS,
    AT_TORSO,
    BOX_BRANCHES,
    BRANCH_COUNT,
    LEGS_ON_TORSO,
    LIMB_BOX,
)
from posekit.geometry import Array

FIRST_LEG = 2
"""Limbs from which on they hang on the hips."""

LEAST_SECOND_COSINE = 0.05
"""As `posekit.refinement.limits.MIN_COSINE`."""

WALL_STEP, WALL_SLOPE, WALL_REACH = 1e-6, 100.0, 0.3
"""As `STEP_RADIANS`, `MAX_SLOPE` and `REACH_RADIANS` of `posekit.refinement.walls`."""

BOX_ANGLES = 4
"""Angles of a limb."""

FULL_TURN = 2.0 * math.pi


def within_half_turn(angle: Any) -> Any:
    """Return an angle less its full turns."""
    return angle - FULL_TURN * np.rint(angle / FULL_TURN)


def past(away: Any, half: Any) -> Any:
    """Return by what an angle is outside a range about zero; NaN where it is not known."""
    if away > half:
        return away - half
    if away < -half:
        return away + half
    return away - away


def part_of(f: Array, limb: Any) -> Any:
    """Return where the rotation of the part stands by which a limb is judged."""
    return AT_HIPS if limb >= FIRST_LEG and f[LEGS_ON_TORSO] == 0.0 else AT_TORSO


def angles_and_tangents(s: Array, limb: Any, part: Any, g: Array, tangents: Array) -> None:
    """Write down a limb's angles, their cosines and sines (3, 4), and the tangents of its directions (4, 3)."""
    u, v = AT_DIRECTIONS + 6 * limb, AT_DIRECTIONS + 6 * limb + 3
    x = s[part] * s[u] + s[part + 3] * s[u + 1] + s[part + 6] * s[u + 2]
    y = s[part + 1] * s[u] + s[part + 4] * s[u + 1] + s[part + 7] * s[u + 2]
    z = s[part + 2] * s[u] + s[part + 5] * s[u + 1] + s[part + 8] * s[u + 2]
    h = math.sqrt(x * x + z * z)
    sin_a, cos_a = 0.0, 1.0
    if h > 0.0:
        sin_a, cos_a = -x / h, -z / h
    a_lower = b_lower = bent = 0.0
    for i in range(3):
        row = part + 3 * i
        a = sin_a * s[row + 2] - cos_a * s[row]
        b = sin_a * y * s[row] + h * s[row + 1] + cos_a * y * s[row + 2]
        tangents[0, i], tangents[1, i] = a, b
        a_lower += a * s[v + i]
        b_lower -= b * s[v + i]
        bent += s[u + i] * s[v + i]
    sin_e = math.sqrt(a_lower * a_lower + b_lower * b_lower)
    cos_g, sin_g = 1.0, 0.0
    if sin_e > 0.0:
        cos_g, sin_g = a_lower / sin_e, b_lower / sin_e
    g[1, 0], g[1, 1], g[1, 2], g[1, 3] = cos_a, h, cos_g, bent
    g[2, 0], g[2, 1], g[2, 2], g[2, 3] = sin_a, y, sin_g, sin_e
    for k in range(BOX_ANGLES):
        g[0, k] = math.atan2(g[2, k], g[1, k])
    for i in range(3):
        a, b = tangents[0, i], tangents[1, i]
        tangents[2, i] = -sin_g * a - cos_g * b
        tangents[3, i] = bent * cos_g * a - bent * sin_g * b - sin_e * s[u + i]


def box_limits(f: Array, limb: Any, g: Array, watch: NDArray[np.int8], o: Array) -> Any:
    """Judge a limb by its box of angles; return whether any limit is felt, and the side and branch that are judged.

    Written down are what each angle is over, what is judged of it, and which limit is passed (3, 4).
    """
    watched, outer = False, False
    for k in range(BOX_ANGLES):
        o[0, k] = o[1, k] = o[2, k] = 0.0
        watched = watched or watch[k] != 0
        middle, half = f[LIMB_BOX + 4 * limb + k], f[LIMB_BOX + 16 + 4 * limb + k]
        outer = outer or abs(g[0, k] - middle) > half
    if not (outer or watched):
        return False, 1.0, 0.0
    best, side, euler = math.inf, 1.0, 0.0
    w0, w2 = g[1, 1], g[2, 3]
    for b in range(int(f[BRANCH_COUNT])):
        branch, hinge = f[BOX_BRANCHES + 2 * b], f[BOX_BRANCHES + 2 * b + 1]
        total = 0.0
        for k in range(BOX_ANGLES):
            angle = g[0, k]
            if branch > 0.0 and k == 0:
                angle += math.pi
            elif branch > 0.0 and k == 1:
                angle = math.pi - angle
            elif k == 2 and (branch > 0.0) != (hinge < 0.0):
                angle += math.pi
            elif k == 3:
                angle *= hinge
            away = within_half_turn(angle - f[LIMB_BOX + 4 * limb + k])
            out = past(away, f[LIMB_BOX + 16 + 4 * limb + k])
            o[2, k] = away
            if k in (0, 2):
                out = out / math.sqrt(1.0 + out * out) * (w0 if k == 0 else w2)
            total += out * out
        if total < best:
            best, side, euler = total, hinge, branch
            for k in range(BOX_ANGLES):
                o[0, k] = o[2, k]
    felt = best > 0.0
    for k in range(BOX_ANGLES):
        away, half = o[0, k], f[LIMB_BOX + 16 + 4 * limb + k]
        beyond = past(away, half)
        over = beyond
        if beyond == 0.0 and watch[k] != 0:
            over = away - watch[k] * half
            felt = True
        o[0, k] = over
        o[1, k] = over
        if k in (0, 2):
            o[1, k] = over / math.sqrt(1.0 + over * over) * (w0 if k == 0 else w2)
        o[2, k] = 1.0 if beyond > 0.0 else -1.0 if beyond < 0.0 else 0.0
    if not felt:
        for k in range(BOX_ANGLES):
            o[0, k] = o[1, k] = o[2, k] = 0.0
    return felt, side, euler


def box_rows(g: Array, tangents: Array, o: Array, side: Any, euler: Any, J: Array) -> None:
    """Differentiate what is judged (4, 7): along the four tangents, then the part's rotation vector."""
    cos_b, cos_g, cos_e = max(g[1, 1], LEAST_SECOND_COSINE), g[1, 2], g[1, 3]
    true_cos_b, sin_b, sin_g, sin_e = g[1, 1], g[2, 1], g[2, 2], g[2, 3]
    by_rotation, by_bend = true_cos_b * cos_e * sin_g + sin_b * sin_e, true_cos_b * cos_g
    first, third = o[0, 0], o[0, 2]
    first_slope, third_slope = (1.0 + first * first) ** -1.5, (1.0 + third * third) ** -1.5
    first_judged, third_judged = (
        first / math.sqrt(1.0 + first * first),
        third / math.sqrt(1.0 + third * third),
    )
    for c in range(7):
        alpha, beta, rotation, bend = 0.0, 0.0, 0.0, 0.0
        if c < BOX_ANGLES:
            alpha, beta = (1.0 if c == 0 else 0.0), (1.0 if c == 1 else 0.0)
            rotation, bend = (1.0 if c == 2 else 0.0), (1.0 if c == 3 else 0.0)
        else:
            i = c - BOX_ANGLES
            alpha, beta, rotation, bend = -tangents[1, i], tangents[0, i], -tangents[3, i], tangents[2, i]
        per_alpha = alpha / cos_b
        rotation += per_alpha * by_rotation + beta * (cos_e * cos_g)
        bend += beta * sin_g - per_alpha * by_bend
        J[0, c] = (first_slope * alpha - first_judged * sin_b * beta) if o[0, 0] != 0.0 else 0.0
        J[1, c] = (-beta if euler > 0.0 else beta) if o[0, 1] != 0.0 else 0.0
        J[2, c] = (third_slope * rotation + third_judged * cos_e * bend) if o[0, 2] != 0.0 else 0.0
        J[3, c] = side * bend if o[0, 3] != 0.0 else 0.0


def wall_limits(
    s: Array, limb: Any, part: Any, ends: Array, w: Array, watch: NDArray[np.int8], o: Array, q: Array
) -> Any:
    """Judge a limb by its anatomical ranges; return in which writing, -1 where the judge must say it.

    Written down are what each angle is over, the side that counts, and which limit is passed (3, 4); and in `q` what is
    above and below (2, 4), then the directions in the part's frame (2, 3), each in a row.
    """
    for segment in range(2):
        at = AT_DIRECTIONS + 6 * limb + 3 * segment
        for j in range(3):
            q[2 + segment, j] = (
                s[part + j] * s[at] + s[part + 3 + j] * s[at + 1] + s[part + 6 + j] * s[at + 2]
            )
    for k in range(BOX_ANGLES):
        q[0, k] = q[1, k] = -math.inf
        o[0, k] = o[1, k] = o[2, k] = 0.0
    writing = beyond_limits(q[2], q[3], ends, w, -1, q[0], q[1])
    if writing < 0:
        return writing
    for k in range(BOX_ANGLES):
        above, below = q[0, k], q[1, k]
        crossed = 1.0 if above > 0.0 and above >= below else -1.0 if below > 0.0 else 0.0
        side = crossed
        if crossed == 0.0 and watch[k] != 0 and (above if watch[k] > 0 else below) > -WALL_REACH:
            side = float(watch[k])
        o[2, k], o[1, k] = crossed, side
        o[0, k] = above if side > 0.0 else -below if side < 0.0 else 0.0
    return writing


def wall_slopes(
    s: Array,
    limb: Any,
    part: Any,
    ends: Array,
    w: Array,
    tangents: Array,
    writing: Any,
    o: Array,
    q: Array,
    J: Array,
) -> Any:
    """Differentiate by differences what is judged (4, 7); return whether that could be told."""
    for k in range(BOX_ANGLES):
        for c in range(7):
            J[k, c] = 0.0
    for t in range(BOX_ANGLES):
        segment, at = t // 2, AT_DIRECTIONS + 6 * limb + 3 * (t // 2)
        size = 0.0
        for j in range(3):
            along = (
                s[part + j] * tangents[t, 0]
                + s[part + 3 + j] * tangents[t, 1]
                + s[part + 6 + j] * tangents[t, 2]
            )
            q[4, j] = q[2 + segment, j] + WALL_STEP * along
            size += q[4, j] * q[4, j]
        size = math.sqrt(size)
        for j in range(3):
            q[4, j] /= size
        for k in range(BOX_ANGLES):
            q[0, k] = q[1, k] = -math.inf
        if segment == 0:
            told = beyond_limits(q[4], q[3], ends, w, writing, q[0], q[1])
        else:
            told = beyond_limits(q[2], q[4], ends, w, writing, q[0], q[1])
        if told < 0:
            return False
        x = s[at + 1] * tangents[t, 2] - s[at + 2] * tangents[t, 1]
        y = s[at + 2] * tangents[t, 0] - s[at] * tangents[t, 2]
        z = s[at] * tangents[t, 1] - s[at + 1] * tangents[t, 0]
        for k in range(BOX_ANGLES):
            if o[1, k] == 0.0:
                continue
            slope = ((q[0, k] if o[1, k] > 0.0 else -q[1, k]) - o[0, k]) / WALL_STEP
            if abs(slope) < WALL_SLOPE:
                J[k, t] = slope
                J[k, 4] -= slope * x
                J[k, 5] -= slope * y
                J[k, 6] -= slope * z
    return True


KERNEL_PARTS = (limb_kernels,)

COMPILED_TYPES = {
    "within_half_turn": "",
    "past": "",
    "part_of": "",
    "angles_and_tangents": "",
    "box_limits": "",
    "box_rows": "",
    "wall_limits": "",
    "wall_slopes": "",
}
"""The kernels, in the order in which they need each other: compiled into those that call them."""
