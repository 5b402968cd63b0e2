"""Limbs as plain loops over postures, for `posekit.refinement`, where the formulas are.

What the image, the limits and the lengths say of one limb (`posekit.refinement.limb_terms`, `limits`, `walls`), with
derivatives and without, and the search of a limb by itself (`posekit.refinement.limb_descent`). The numbers of a posture
stand where `posekit.compiled.posture_numbers` says.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.compiled import limb_kernels
from posekit.compiled.frame_kernels import NUMBERS_AT
from posekit.compiled.limb_kernels import beyond_limits
from posekit.compiled.posture_numbers import (
    BOX,
    BRANCH_COUNT,
    BRANCHES,
    CAMERA,
    CENTRE,
    DIRECTIONS,
    DISTORTED,
    DISTORTION,
    FOCAL,
    FOCAL_V,
    FREE,
    HIPS,
    LEGS_ON_TORSO,
    LIMB_OWN,
    LIMB_WEIGHTS,
    LIMBS,
    LIMIT_SCALE,
    PERSPECTIVE,
    POINTS,
    SKEW,
    TORSO,
    VARIED_LIMBS,
    WALLED,
)
from posekit.geometry import Array
from posekit.geometry.batch_last import MIN_PIVOT

MIDDLES, ENDS = (6, 7, 10, 11), (8, 9, 12, 13)
"""The joints in the middle and at the end of each limb."""

FIRST_LEG = 2
"""Limbs from which on they hang on the hips."""

FAR_BEHIND = 1e100
"""Deviations by which a joint behind the camera is off, as `posekit.refinement.problem.BEHIND_CAMERA_RESIDUAL`."""

LEAST_SECOND_COSINE = 0.05
"""As `posekit.refinement.limits.MIN_COSINE`."""

WALL_STEP, WALL_SLOPE, WALL_REACH = 1e-6, 100.0, 0.3
"""As `STEP_RADIANS`, `MAX_SLOPE` and `REACH_RADIANS` of `posekit.refinement.walls`."""

BOX_ANGLES = 4
"""Angles of a limb."""

INITIAL, SMALLEST, LARGEST, GROWTH, DECAY, LIGHT, FLOOR, STEPS, PRECISION, HOPELESS = range(10)
"""Where a search's settings stand: those of its damping, the floor of diagonals, and when it ends."""

FULL_TURN = 2.0 * math.pi

LEAST_PROMISE = 1e-300
"""As `posekit.least_squares.MIN_PROMISE`."""


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


def see(d: Array, x: Any, y: Any, z: Any, point: Any, r: Array, A: Array) -> None:
    """Write down by how many deviations a point is off (2,), and how that changes along it (2, 3)."""
    at = POINTS + 3 * point
    weight = d[at + 2]
    fx, skew, fy = d[CAMERA + FOCAL], d[CAMERA + SKEW], d[CAMERA + FOCAL_V]
    for i in range(3):
        A[0, i] = A[1, i] = 0.0
    if d[CAMERA + PERSPECTIVE] == 0.0:
        r[0], r[1] = (x * fx - d[at]) * weight, (y * fy - d[at + 1]) * weight
        A[0, 0], A[1, 1] = fx * weight, fy * weight
        return
    if not z > 0.0:
        r[0] = r[1] = FAR_BEHIND if weight > 0.0 else 0.0
        return
    inverse = 1.0 / z
    u, v = x * inverse, y * inverse
    if d[CAMERA + DISTORTED] == 0.0:
        A[0, 0], A[0, 1], A[0, 2] = fx * inverse, skew * inverse, -(fx * u + skew * v) * inverse
        A[1, 1], A[1, 2] = fy * inverse, -fy * v * inverse
    else:
        at_lens = CAMERA + DISTORTION
        k1, k2, p1, p2, k3 = d[at_lens], d[at_lens + 1], d[at_lens + 2], d[at_lens + 3], d[at_lens + 4]
        r2 = u * u + v * v
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3))
        xx = radial + u * u * slope + 2 * p1 * v + 6 * p2 * u
        yy = radial + v * v * slope + 6 * p1 * v + 2 * p2 * u
        xy = u * v * slope + 2 * p1 * u + 2 * p2 * v
        a, b = fx * xx + skew * xy, fx * xy + skew * yy
        A[0, 0], A[0, 1], A[0, 2] = a * inverse, b * inverse, -(a * u + b * v) * inverse
        a, b = fy * xy, fy * yy
        A[1, 0], A[1, 1], A[1, 2] = a * inverse, b * inverse, -(a * u + b * v) * inverse
        u, v = (
            u * radial + 2 * p1 * u * v + p2 * (r2 + 2 * u * u),
            v * radial + p1 * (r2 + 2 * v * v) + 2 * p2 * u * v,
        )
    r[0] = (fx * u + skew * v + d[CAMERA + CENTRE] - d[at]) * weight
    r[1] = (fy * v + d[CAMERA + CENTRE + 1] - d[at + 1]) * weight
    for i in range(3):
        A[0, i] *= weight
        A[1, i] *= weight


def damped_factor(matrix: Array, width: Any, damping: Any, floor: Any, damped: Array) -> None:
    """Add a fraction of its diagonal and a floor to a matrix, write down what, and factor it: L in the lower triangle."""
    for j in range(width):
        damped[j] = matrix[j, j] * damping + floor
        matrix[j, j] += damped[j]
    for j in range(width):
        for i in range(j, width):
            total = matrix[i, j]
            for m in range(j):
                total -= matrix[i, m] * matrix[j, m]
            if i == j:
                matrix[j, j] = math.sqrt(MIN_PIVOT if total < MIN_PIVOT else total)
            else:
                matrix[i, j] = total / matrix[j, j]


def solve_forward(L: Array, width: Any, right: Array, columns: Any) -> None:
    """Solve L y = b for the columns of right sides, in place."""
    for i in range(width):
        for c in range(columns):
            total = right[i, c]
            for m in range(i):
                total -= L[i, m] * right[m, c]
            right[i, c] = total / L[i, i]


def solve_backward(L: Array, width: Any, x: Array) -> None:
    """Solve L' x = y, in place."""
    for i in range(width - 1, -1, -1):
        total = x[i]
        for m in range(i + 1, width):
            total -= L[m, i] * x[m]
        x[i] = total / L[i, i]


def next_damping(h: Array, damping: Any, better: Any, decrease: Any, promise: Any, ran: Any) -> Any:
    """Return the damping of the next step, as `posekit.least_squares.Damping.updated` does."""
    factor = 1.0 if ran else h[GROWTH]
    if better:
        ratio = min(max(decrease / max(promise, LEAST_PROMISE), 0.0), 1.0)
        factor = max(1.0 - (2.0 * ratio - 1.0) ** 3, h[DECAY])
    return max(damping * factor, h[SMALLEST])


def part_of(f: Array, limb: Any) -> Any:
    """Return where the rotation of the part stands by which a limb is judged."""
    return HIPS if limb >= FIRST_LEG and f[LEGS_ON_TORSO] == 0.0 else TORSO


def angles_and_tangents(s: Array, limb: Any, part: Any, g: Array, tangents: Array) -> None:
    """Write down a limb's angles, their cosines and sines (3, 4), and the tangents of its directions (4, 3)."""
    u, v = DIRECTIONS + 6 * limb, DIRECTIONS + 6 * limb + 3
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
        middle, half = f[BOX + 4 * limb + k], f[BOX + 16 + 4 * limb + k]
        outer = outer or abs(g[0, k] - middle) > half
    if not (outer or watched):
        return False, 1.0, 0.0
    best, side, euler = math.inf, 1.0, 0.0
    w0, w2 = g[1, 1], g[2, 3]
    for b in range(int(f[BRANCH_COUNT])):
        branch, hinge = f[BRANCHES + 2 * b], f[BRANCHES + 2 * b + 1]
        total = 0.0
        for k in range(BOX_ANGLES):
            angle = g[0, k]
            if branch > 0.0 and k == 0:
                angle += math.pi
            elif branch > 0.0 and k == 1:
                angle = math.pi - angle
            elif k == 2 and (branch > 0.0) != (hinge < 0.0):  # noqa: PLR2004 - the third angle
                angle += math.pi
            elif k == 3:  # noqa: PLR2004 - the fourth
                angle *= hinge
            away = within_half_turn(angle - f[BOX + 4 * limb + k])
            out = past(away, f[BOX + 16 + 4 * limb + k])
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
        away, half = o[0, k], f[BOX + 16 + 4 * limb + k]
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
    first_judged, third_judged = first / math.sqrt(1.0 + first * first), third / math.sqrt(1.0 + third * third)
    for c in range(7):
        alpha, beta, rotation, bend = 0.0, 0.0, 0.0, 0.0
        if c < BOX_ANGLES:
            alpha, beta = (1.0 if c == 0 else 0.0), (1.0 if c == 1 else 0.0)
            rotation, bend = (1.0 if c == 2 else 0.0), (1.0 if c == 3 else 0.0)  # noqa: PLR2004 - of the hinge
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


def wall_limits(s: Array, limb: Any, part: Any, ends: Array, w: Array, watch: NDArray[np.int8], o: Array, q: Array) -> Any:
    """Judge a limb by its anatomical ranges; return in which writing, -1 where the judge must say it.

    Written down are what each angle is over, the side that counts, and which limit is passed (3, 4); and in `q` what is
    above and below (2, 4), then the directions in the part's frame (2, 3), each in a row.
    """
    for segment in range(2):
        at = DIRECTIONS + 6 * limb + 3 * segment
        for j in range(3):
            q[2 + segment, j] = s[part + j] * s[at] + s[part + 3 + j] * s[at + 1] + s[part + 6 + j] * s[at + 2]
    for k in range(BOX_ANGLES):
        q[0, k] = q[1, k] = -math.inf
        o[0, k] = o[1, k] = o[2, k] = 0.0
    writing = beyond_limits(q[2, :3], q[3, :3], ends, w, -1, q[0], q[1])
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
    s: Array, limb: Any, part: Any, ends: Array, w: Array, tangents: Array, writing: Any, o: Array, q: Array, J: Array
) -> Any:
    """Differentiate by differences what is judged (4, 7); return whether that could be told."""
    for k in range(BOX_ANGLES):
        for c in range(7):
            J[k, c] = 0.0
    for t in range(BOX_ANGLES):
        segment, at = t // 2, DIRECTIONS + 6 * limb + 3 * (t // 2)
        size = 0.0
        for j in range(3):
            along = (
                s[part + j] * tangents[t, 0] + s[part + 3 + j] * tangents[t, 1] + s[part + 6 + j] * tangents[t, 2]
            )
            q[4, j] = q[2 + segment, j] + WALL_STEP * along
            size += q[4, j] * q[4, j]
        size = math.sqrt(size)
        for j in range(3):
            q[4, j] /= size
        for k in range(BOX_ANGLES):
            q[0, k] = q[1, k] = -math.inf
        if segment == 0:
            told = beyond_limits(q[4, :3], q[3, :3], ends, w, writing, q[0], q[1])
        else:
            told = beyond_limits(q[2, :3], q[4, :3], ends, w, writing, q[0], q[1])
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


def limb_block(
    s: Array,
    d: Array,
    f: Array,
    limb: Any,
    start: Array,
    ends: Array,
    w: Array,
    watch: NDArray[np.int8],
    room: Array,
    matrix: Array,
    right: Array,
    own: Array,
    push: Array,
    tangents: Array,
) -> Any:
    """Linearise one limb, as `posekit.refinement.limb_terms.limb_terms` does.

    Parameters
    ----------
    start : array (3,)
        Where it starts, metres.
    ends, w, watch
        Of its limits.
    room : array (16, 7)
        To be overwritten.
    matrix, right, own, push, tangents : array (U, U), (U, 7), (6, 6), (6,), (4, 3)
        Filled: its own matrix; coupling with start and part, then the gradient; of start and part; tangents.

    Returns
    -------
    chi2, slack : float
    folds : int
        NaN and -1 where a judge must be asked. Which limits are passed stands in the room's tenth row.
    """
    at, u = LIMBS + 2 * limb, DIRECTIONS + 6 * limb
    first, second = s[at], s[at + 1]
    A, r, g, o, q, J = room[0:4, :3], room[4, :4], room[5:8, :4], room[8:11, :4], room[11:16, :4], room[16:20]
    x, y, z = start[0] + first * s[u], start[1] + first * s[u + 1], start[2] + first * s[u + 2]
    see(d, x, y, z, MIDDLES[limb], r[:2], A[:2])
    see(d, x + second * s[u + 3], y + second * s[u + 4], z + second * s[u + 5], ENDS[limb], r[2:], A[2:])
    chi2 = r[0] * r[0] + r[1] * r[1] + (r[2] * r[2] + r[3] * r[3])
    part = part_of(f, limb)
    angles_and_tangents(s, limb, part, g, tangents)
    width = 6 if f[VARIED_LIMBS] > 0.0 else 4
    for k in range(BOX_ANGLES):
        o[2, k] = 0.0
    for a in range(6):
        push[a] = 0.0
        for b in range(6):
            own[a, b] = 0.0
    rows = room[20:24, :6]
    for c in range(4):
        for v in range(6):
            rows[c, v] = 0.0
        for i in range(3):
            rows[c, 0] += A[c, i] * first * tangents[0, i]
            rows[c, 1] += A[c, i] * first * tangents[1, i]
            rows[c, 4] += A[c, i] * first * s[u + i]
            if c > 1:
                rows[c, 2] += A[c, i] * second * tangents[2, i]
                rows[c, 3] += A[c, i] * second * tangents[3, i]
                rows[c, 5] += A[c, i] * second * s[u + 3 + i]
    for a in range(width):
        for b in range(a + 1):
            total = 0.0
            for c in range(4):
                total += rows[c, a] * rows[c, b]
            matrix[a, b] = matrix[b, a] = total
        for b in range(7):
            right[a, b] = 0.0
        for c in range(4):
            for i in range(3):
                right[a, i] += rows[c, a] * A[c, i]
            right[a, 6] += rows[c, a] * r[c]
    for i in range(3):
        for j in range(3):
            for c in range(4):
                own[i, j] += A[c, i] * A[c, j]
        for c in range(4):
            push[i] += A[c, i] * r[c]
    folds = 0
    for segment in range(2):
        outward = 0.0
        for i in range(3):
            pull = push[i] if segment == 0 else A[2, i] * r[2] + A[3, i] * r[3]
            outward += s[u + 3 * segment + i] * pull
        bend = max(-s[at + segment] * outward, 0.0)
        k = 2 * segment
        a, b, c_ = matrix[k, k], matrix[k + 1, k + 1], matrix[k, k + 1]
        if bend > 0.0 and (bend > a or bend > b or (a - bend) * (b - bend) < c_ * c_):
            folds += 1
        matrix[k, k] += bend
        matrix[k + 1, k + 1] += bend
        if width > 4:  # noqa: PLR2004 - lengths are varied
            weight = f[LIMB_WEIGHTS + 2 * limb + segment]
            stretch = weight * math.log(s[at + segment] / f[LIMB_OWN + 2 * limb + segment])
            chi2 += stretch * stretch
            matrix[4 + segment, 4 + segment] += weight * weight
            right[4 + segment, 6] += weight * stretch
    scale, slack = f[LIMIT_SCALE], 0.0
    if scale == 0.0 or (d[FREE + limb] > 0.0):
        return chi2, slack, folds
    if f[WALLED] > 0.0:
        writing = wall_limits(s, limb, part, ends, w, watch, o, q)
        if writing < 0:
            return math.nan, slack, -1
        felt = False
        for k in range(BOX_ANGLES):
            felt = felt or o[1, k] != 0.0
        if felt and not wall_slopes(s, limb, part, ends, w, tangents, writing, o, q, J):
            return math.nan, slack, -1
        for k in range(BOX_ANGLES):
            o[1, k] = o[0, k]
    else:
        felt, side, euler = box_limits(f, limb, g, watch, o)
        if felt:
            box_rows(g, tangents, o, side, euler, J)
    if not felt:
        return chi2, slack, folds
    cost, judged = 0.0, 0.0
    for k in range(BOX_ANGLES):
        one = o[1, k] * scale
        judged += one * one
        if o[2, k] != 0.0:
            cost += one * one
        for a in range(7):
            slope = J[k, a] * scale
            if slope == 0.0:
                continue
            if a < BOX_ANGLES:
                right[a, 6] += slope * one
                for b in range(BOX_ANGLES):
                    matrix[a, b] += slope * J[k, b] * scale
                for b in range(3):
                    right[a, 3 + b] += slope * J[k, 4 + b] * scale
            else:
                push[a - 1] += slope * one
                for b in range(3):
                    own[a - 1, 3 + b] += slope * J[k, 4 + b] * scale
    return chi2 + cost, judged - cost, folds


def limb_value(
    s: Array,
    d: Array,
    f: Array,
    limb: Any,
    start: Array,
    ends: Array,
    w: Array,
    room: Array,
    nothing: NDArray[np.int8],
    passed: NDArray[np.int8],
) -> Any:
    """Return one limb's chi2, and write down which limits (4,) it passes; NaN where a judge must be asked."""
    at, u = LIMBS + 2 * limb, DIRECTIONS + 6 * limb
    first, second = s[at], s[at + 1]
    A, r, g, o, q, tangents = room[0:4, :3], room[4, :4], room[5:8, :4], room[8:11, :4], room[11:16, :4], room[16:20, :3]
    x, y, z = start[0] + first * s[u], start[1] + first * s[u + 1], start[2] + first * s[u + 2]
    see(d, x, y, z, MIDDLES[limb], r[:2], A[:2])
    see(d, x + second * s[u + 3], y + second * s[u + 4], z + second * s[u + 5], ENDS[limb], r[2:], A[2:])
    chi2 = r[0] * r[0] + r[1] * r[1] + (r[2] * r[2] + r[3] * r[3])
    if f[VARIED_LIMBS] > 0.0:
        for segment in range(2):
            weight = f[LIMB_WEIGHTS + 2 * limb + segment]
            stretch = weight * math.log(s[at + segment] / f[LIMB_OWN + 2 * limb + segment])
            chi2 += stretch * stretch
    for k in range(BOX_ANGLES):
        passed[k] = 0
    scale = f[LIMIT_SCALE]
    if scale == 0.0 or d[FREE + limb] > 0.0:
        return chi2
    part = part_of(f, limb)
    if f[WALLED] > 0.0:
        if wall_limits(s, limb, part, ends, w, nothing, o, q) < 0:
            return math.nan
        for k in range(BOX_ANGLES):
            o[1, k] = o[0, k]
    else:
        angles_and_tangents(s, limb, part, g, tangents)
        box_limits(f, limb, g, nothing, o)
    for k in range(BOX_ANGLES):
        if o[2, k] != 0.0:
            passed[k] = 1 if o[2, k] > 0.0 else -1
            chi2 += o[1, k] * o[1, k] * scale * scale
    return chi2


def move_limb(s: Array, limb: Any, step: Array, tangents: Array, width: Any, out: Array) -> None:
    """Turn and lengthen a limb by a step (U,): in `out`."""
    for segment in range(2):
        at, size = DIRECTIONS + 6 * limb + 3 * segment, 0.0
        for i in range(3):
            out[at + i] = (
                s[at + i] + step[2 * segment] * tangents[2 * segment, i] + step[2 * segment + 1] * tangents[2 * segment + 1, i]
            )
            size += out[at + i] * out[at + i]
        size = math.sqrt(size)
        for i in range(3):
            out[at + i] /= size
        k = LIMBS + 2 * limb + segment
        # The logarithm of a length is varied: no step makes it negative.
        out[k] = s[k] * math.exp(step[4 + segment]) if width > 4 else s[k]  # noqa: PLR2004 - lengths are varied


def fit_limbs(
    states: Array,
    data: Array,
    f: Array,
    starts: Array,
    used: NDArray[np.bool_],
    ends: Array,
    numbers: Array,
    h: Array,
    chi2: Array,
    asked: NDArray[np.bool_],
) -> None:
    """Fit limbs (M, 4) that are used by themselves, from their starts (M, 4, 3), as `limb_descent.fit_limbs` does.

    States (M, 71) and chi2 (M, 4) are overwritten; where a judge must be asked, which is written down, they stay.
    """
    room, matrix, right, own = np.empty((24, 7)), np.empty((6, 6)), np.empty((6, 7)), np.empty((6, 6))
    push, tangents, step, damped = np.empty(6), np.empty((4, 3)), np.empty(6), np.empty(6)
    watch, passed, nothing = np.zeros(4, np.int8), np.zeros(4, np.int8), np.zeros(4, np.int8)
    now, trial = np.empty(states.shape[1]), np.empty(states.shape[1])
    W = np.empty((4, NUMBERS_AT + numbers.shape[1]))
    W[:, NUMBERS_AT:] = numbers
    width = 6 if f[VARIED_LIMBS] > 0.0 else 4
    for m in range(len(states)):
        for limb in range(4):
            if not used[m, limb] or not chi2[m, limb] > h[PRECISION]:
                continue
            now[:] = states[m]
            trial[:] = now
            watch[:] = 0
            value, damping, watching = chi2[m, limb], h[INITIAL], False
            d, start = data[m], starts[m, limb]
            for _ in range(int(h[STEPS])):
                told, slack, folds = limb_block(
                    now, d, f, limb, start, ends[limb], W[limb], watch, room, matrix, right, own, push, tangents
                )
                if folds < 0:
                    asked[m, limb] = True
                    break
                damped_factor(matrix, width, damping, h[FLOOR], damped)
                for i in range(width):
                    right[i, 0] = right[i, 6]
                solve_forward(matrix, width, right, 1)
                gain = -slack
                for i in range(width):
                    gain += right[i, 0] * right[i, 0]
                    step[i] = right[i, 0]
                solve_backward(matrix, width, step)
                for i in range(width):
                    step[i] = -step[i]
                    gain += damped[i] * step[i] * step[i]
                done = damping > h[LARGEST] or (gain <= h[PRECISION] and (damping <= h[LIGHT] or watching))
                if done or (value > h[HOPELESS] and gain < 0.5 * value and not watching):
                    break
                move_limb(now, limb, step, tangents, width, trial)
                new = limb_value(trial, d, f, limb, start, ends[limb], W[limb], room, nothing, passed)
                if math.isnan(new) and not math.isnan(value):
                    asked[m, limb] = True
                    break
                better, ran = new <= value, False
                for k in range(BOX_ANGLES):
                    fresh = passed[k] if watch[k] == 0 and not better else 0
                    ran = ran or fresh != 0
                    watch[k] = 0 if better else watch[k] + fresh
                watching = (watching or ran) and not better
                damping = next_damping(h, damping, better, value - new, gain, ran)
                if better:
                    now[:] = trial
                    value = new
            if not asked[m, limb]:
                states[m] = now
                chi2[m, limb] = value


KERNEL_PARTS = (limb_kernels,)

COMPILED_TYPES = {
    "within_half_turn": "",
    "past": "",
    "see": "",
    "damped_factor": "",
    "solve_forward": "",
    "solve_backward": "",
    "next_damping": "",
    "part_of": "",
    "angles_and_tangents": "",
    "box_limits": "",
    "box_rows": "",
    "wall_limits": "",
    "wall_slopes": "",
    "limb_block": "",
    "limb_value": "",
    "move_limb": "",
}
"""The kernels, in the order in which they need each other: compiled into those that call them."""
