"""Limbs as plain loops over postures: the formulas are those of `posekit.refinement.limb_terms`.

What the image, the limits and the lengths say of one limb, with derivatives and without, and the search of a limb by
itself (`posekit.refinement.limb_descent`). Numbers of a posture stand where `posekit.compiled.posture_numbers` says.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.compiled import block_kernels, limb_limit_kernels
from posekit.compiled.block_kernels import (
    DIAGONAL_FLOOR,
    FIRST_DAMPING,
    GAIN_PRECISION,
    HOPELESS_CHI2,
    LIGHT_DAMPING,
    MOST_DAMPING,
    MOST_STEPS,
    damped_factor,
    next_damping,
    solve_backward,
    solve_forward,
)
from posekit.compiled.frame_kernels import NUMBERS_AT
from posekit.compiled.limb_limit_kernels import (
    BOX_ANGLES,
    angles_and_tangents,
    box_limits,
    box_rows,
    part_of,
    wall_limits,
    wall_slopes,
)
from posekit.compiled.posture_numbers import (
    AT_CAMERA,
    AT_DIRECTIONS,
    AT_FREE,
    AT_LIMBS,
    AT_POINTS,
    CAMERA_CENTRE,
    CAMERA_DISTORTED,
    CAMERA_DISTORTION,
    CAMERA_FOCAL,
    CAMERA_FOCAL_V,
    CAMERA_PERSPECTIVE,
    CAMERA_SKEW,
    HAS_WALLS,
    LIMB_ENDS,
    LIMB_MIDDLES,
    LIMB_OWN,
    LIMB_WEIGHTS,
    LIMIT_SCALE,
    VARIED_LIMBS,
)
from posekit.geometry import Array

FAR_BEHIND = 1e100
"""Deviations by which a joint behind the camera is off, as `posekit.refinement.problem.BEHIND_CAMERA_RESIDUAL`."""


def see(d: Array, x: Any, y: Any, z: Any, point: Any, r: Array, A: Array) -> None:
    """Write down by how many deviations a point is off (2,), and how that changes along it (2, 3)."""
    at = AT_POINTS + 3 * point
    weight = d[at + 2]
    fx, skew, fy = d[AT_CAMERA + CAMERA_FOCAL], d[AT_CAMERA + CAMERA_SKEW], d[AT_CAMERA + CAMERA_FOCAL_V]
    for i in range(3):
        A[0, i] = A[1, i] = 0.0
    if d[AT_CAMERA + CAMERA_PERSPECTIVE] == 0.0:
        r[0], r[1] = (x * fx - d[at]) * weight, (y * fy - d[at + 1]) * weight
        A[0, 0], A[1, 1] = fx * weight, fy * weight
        return
    if not z > 0.0:
        r[0] = r[1] = FAR_BEHIND if weight > 0.0 else 0.0
        return
    inverse = 1.0 / z
    u, v = x * inverse, y * inverse
    if d[AT_CAMERA + CAMERA_DISTORTED] == 0.0:
        A[0, 0], A[0, 1], A[0, 2] = fx * inverse, skew * inverse, -(fx * u + skew * v) * inverse
        A[1, 1], A[1, 2] = fy * inverse, -fy * v * inverse
    else:
        at_lens = AT_CAMERA + CAMERA_DISTORTION
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
    r[0] = (fx * u + skew * v + d[AT_CAMERA + CAMERA_CENTRE] - d[at]) * weight
    r[1] = (fy * v + d[AT_CAMERA + CAMERA_CENTRE + 1] - d[at + 1]) * weight
    for i in range(3):
        A[0, i] *= weight
        A[1, i] *= weight


def limb_room() -> Any:
    """Make room for one limb.

    How its points' image moves (4, 3) and by how much it is off (4,); its angles (3, 4), what is judged of them (3, 4),
    and what walls say (5, 4); derivatives of what is judged (4, 7) and of the image (4, 6); and tangents (4, 3).
    """
    return (
        np.empty((4, 3)),
        np.empty(4),
        np.empty((3, 4)),
        np.empty((3, 4)),
        np.empty((5, 4)),
        np.empty((4, 7)),
        np.empty((4, 6)),
        np.empty((4, 3)),
    )


def limb_block(
    s: Array,
    d: Array,
    f: Array,
    limb: Any,
    start: Array,
    ends: Array,
    w: Array,
    watch: NDArray[np.int8],
    room: Any,
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
    room : tuple of arrays
        Of `limb_room`, to be overwritten.
    matrix, right, own, push, tangents : array (U, U), (U, 7), (6, 6), (6,), (4, 3)
        Filled: its own matrix; coupling with start and part, then the gradient; of start and part; tangents.

    Returns
    -------
    chi2, slack : float
    folds : int
        NaN and -1 where a judge must be asked. Which limits are passed stands in the room.
    """
    at, u = AT_LIMBS + 2 * limb, AT_DIRECTIONS + 6 * limb
    first, second = s[at], s[at + 1]
    A, r, g, o, q, J, rows, _ = room
    x, y, z = start[0] + first * s[u], start[1] + first * s[u + 1], start[2] + first * s[u + 2]
    see(d, x, y, z, LIMB_MIDDLES[limb], r[:2], A[:2])
    see(d, x + second * s[u + 3], y + second * s[u + 4], z + second * s[u + 5], LIMB_ENDS[limb], r[2:], A[2:])
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
        if width > 4:
            weight = f[LIMB_WEIGHTS + 2 * limb + segment]
            stretch = weight * math.log(s[at + segment] / f[LIMB_OWN + 2 * limb + segment])
            chi2 += stretch * stretch
            matrix[4 + segment, 4 + segment] += weight * weight
            right[4 + segment, 6] += weight * stretch
    scale, slack = f[LIMIT_SCALE], 0.0
    if scale == 0.0 or (d[AT_FREE + limb] > 0.0):
        return chi2, slack, folds
    if f[HAS_WALLS] > 0.0:
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
    room: Any,
    nothing: NDArray[np.int8],
    passed: NDArray[np.int8],
) -> Any:
    """Return one limb's chi2, and write down which limits (4,) it passes; NaN where a judge must be asked."""
    at, u = AT_LIMBS + 2 * limb, AT_DIRECTIONS + 6 * limb
    first, second = s[at], s[at + 1]
    A, r, g, o, q, _, _, tangents = room
    x, y, z = start[0] + first * s[u], start[1] + first * s[u + 1], start[2] + first * s[u + 2]
    see(d, x, y, z, LIMB_MIDDLES[limb], r[:2], A[:2])
    see(d, x + second * s[u + 3], y + second * s[u + 4], z + second * s[u + 5], LIMB_ENDS[limb], r[2:], A[2:])
    chi2 = r[0] * r[0] + r[1] * r[1] + (r[2] * r[2] + r[3] * r[3])
    if f[VARIED_LIMBS] > 0.0:
        for segment in range(2):
            weight = f[LIMB_WEIGHTS + 2 * limb + segment]
            stretch = weight * math.log(s[at + segment] / f[LIMB_OWN + 2 * limb + segment])
            chi2 += stretch * stretch
    for k in range(BOX_ANGLES):
        passed[k] = 0
    scale = f[LIMIT_SCALE]
    if scale == 0.0 or d[AT_FREE + limb] > 0.0:
        return chi2
    part = part_of(f, limb)
    if f[HAS_WALLS] > 0.0:
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
        at, size = AT_DIRECTIONS + 6 * limb + 3 * segment, 0.0
        for i in range(3):
            out[at + i] = (
                s[at + i]
                + step[2 * segment] * tangents[2 * segment, i]
                + step[2 * segment + 1] * tangents[2 * segment + 1, i]
            )
            size += out[at + i] * out[at + i]
        size = math.sqrt(size)
        for i in range(3):
            out[at + i] /= size
        k = AT_LIMBS + 2 * limb + segment
        # The logarithm of a length is varied: no step makes it negative.
        out[k] = s[k] * math.exp(step[4 + segment]) if width > 4 else s[k]


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
    room, matrix, right, own = limb_room(), np.empty((6, 6)), np.empty((6, 7)), np.empty((6, 6))
    push, tangents, step, damped = np.empty(6), np.empty((4, 3)), np.empty(6), np.empty(6)
    watch, passed, nothing = np.zeros(4, np.int8), np.zeros(4, np.int8), np.zeros(4, np.int8)
    now, trial = np.empty(states.shape[1]), np.empty(states.shape[1])
    W = np.empty((4, NUMBERS_AT + numbers.shape[1]))
    W[:, NUMBERS_AT:] = numbers
    width = 6 if f[VARIED_LIMBS] > 0.0 else 4
    for m in range(len(states)):
        for limb in range(4):
            if not used[m, limb] or not chi2[m, limb] > h[GAIN_PRECISION]:
                continue
            now[:] = states[m]
            trial[:] = now
            watch[:] = 0
            value, damping, watching = chi2[m, limb], h[FIRST_DAMPING], False
            d, start = data[m], starts[m, limb]
            for _ in range(int(h[MOST_STEPS])):
                _, slack, folds = limb_block(
                    now,
                    d,
                    f,
                    limb,
                    start,
                    ends[limb],
                    W[limb],
                    watch,
                    room,
                    matrix,
                    right,
                    own,
                    push,
                    tangents,
                )
                if folds < 0:
                    asked[m, limb] = True
                    break
                damped_factor(matrix, width, damping, h[DIAGONAL_FLOOR], damped)
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
                done = damping > h[MOST_DAMPING] or (
                    gain <= h[GAIN_PRECISION] and (damping <= h[LIGHT_DAMPING] or watching)
                )
                if done or (value > h[HOPELESS_CHI2] and gain < 0.5 * value and not watching):
                    break
                move_limb(now, limb, step, tangents, width, trial)
                new = limb_value(trial, d, f, limb, start, ends[limb], W[limb], room, nothing, passed)
                if math.isnan(new):
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


KERNEL_PARTS = (
    block_kernels,
    limb_limit_kernels,
)

COMPILED_TYPES = {
    "see": "",
    "limb_room": "",
    "limb_block": "",
    "limb_value": "",
    "move_limb": "",
    "fit_limbs": (
        "(f8[:,::1], f8[:,::1], f8[::1], f8[:,:,::1], b1[:,::1], f8[:,:,::1], f8[:,::1], f8[::1], f8[:,::1],"
        " b1[:,::1])"
    ),
}
"""The kernels, in the order in which they need each other, with the types of the one that is called."""
