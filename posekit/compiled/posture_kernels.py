"""The search for the likeliest posture as a plain loop over postures, for `posekit.refinement.descent`.

Trunk, limbs and head are those of `posekit.refinement.trunk_terms`, `limb_terms` and `head_terms`, their equations those of
`posekit.refinement.equations`, where the formulas are. One posture at a time: its small matrices stay in a core's cache.
The numbers of a posture stand where `posekit.compiled.posture_numbers` says.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.compiled import limb_block_kernels
from posekit.compiled.frame_kernels import NUMBERS_AT
from posekit.compiled.limb_block_kernels import (
    BOX_ANGLES,
    ENDS,
    FIRST_LEG,
    FLOOR,
    HOPELESS,
    INITIAL,
    LARGEST,
    LIGHT,
    MIDDLES,
    PRECISION,
    STEPS,
    damped_factor,
    fit_limbs,  # noqa: F401 - to be compiled
    limb_block,
    limb_value,
    move_limb,
    next_damping,
    past,
    see,
    solve_backward,
    solve_forward,
    within_half_turn,
)
from posekit.compiled.posture_numbers import (
    CAMERA,
    DIRECTIONS,
    HEAD,
    HEAD_COUNT,
    HEAD_OFFSETS,
    HIP_LIMITS,
    HIPS,
    LEGS_ON_TORSO,
    LIMBS,
    LIMIT_COUNT,
    LIMIT_SCALE,
    MIDDLE_PELVIS,
    NECK,
    NECK_LIMITS,
    PELVIS,
    PERSPECTIVE,
    ROOT,
    ROOT_PRIOR,
    ROOT_WEIGHT,
    SHAPE,
    SHAPE_SQUARES,
    SHAPE_WEIGHTS,
    TORSO,
    TRUNK_ONLY,
    VARIED_LIMBS,
    VARIED_SHAPE,
)
from posekit.compiled.limb_kernels import limbs_beyond  # noqa: F401 - to be compiled
from posekit.geometry import Array

STARTS = (1, 2, 4, 5)
"""The joint of the trunk at which each limb starts."""

TRUNK_POINTS, LIMB_COUNT = 6, 4
"""Joints of the trunk, and how many limbs there are."""

TURN_TORSO, TURN_HIPS, TO_SHAPE = 3, 6, 9
"""Which unknowns turn torso and hips, and change the trunk's shape."""

LEAST_BALL_COSINE = 0.05
"""As `posekit.refinement.limits.MIN_COSINE`."""

SPINE_WEIGHT = 1e3
"""One over `posekit.refinement.trunk_terms.SPINE_TURN_DEVIATION`."""

ANGLE_INFORMATION, PLACE_INFORMATION, MOST_TURN_INFORMATION, LEAST_LENGTH = 3.0 / math.pi**2, 1e-2, 0.5, 1e-12
"""As `posekit.refinement.covariance` has them: of what nothing is known, and of a turn that the image hardly shows."""

BEYOND_COUNTING = 1e150
"""As `posekit.refinement.equations.MAX_CHI2`."""


def place_trunk(s: Array, offsets: Array) -> None:
    """Place the trunk's joints relative to the root (6, 3), as `posekit.refinement.state.trunk_offsets` does."""
    for i in range(3):
        x, y, z = s[TORSO + 3 * i], s[TORSO + 3 * i + 1], s[TORSO + 3 * i + 2]
        offsets[0, i] = 0.0
        offsets[3, i] = -s[SHAPE] * z
        down = offsets[3, i] - s[SHAPE + 6] * s[HIPS + 3 * i + 2]
        for side in range(2):
            offsets[1 + side, i] = s[SHAPE + 1] * x + s[SHAPE + 2 + 2 * side] * y + s[SHAPE + 3 + 2 * side] * z
            offsets[4 + side, i] = down + s[SHAPE + 7 + side] * s[HIPS + 3 * i + 1]


def ball(s: Array, parent: Any, child: Any, f: Array, bounds: Any, watch: NDArray[np.int8], o: Array, J: Array) -> None:
    """Judge a part on its parent, as `posekit.refinement.limits.ball_limits` does.

    Written down are what each angle is over, and which limit is passed (2, 3), and the derivative (3, 3).
    """
    x = y = z = 0.0
    for i in range(3):
        up = s[child + 3 * i + 2]
        x -= s[parent + 3 * i] * up
        y -= s[parent + 3 * i + 1] * up
        z -= s[parent + 3 * i + 2] * up
    h = math.sqrt(x * x + z * z)
    sine, cosine = 0.0, 1.0
    if h != 0.0:
        sine, cosine = -x / h, -z / h
    for i in range(3):
        J[1, i] = cosine * s[parent + 3 * i] - sine * s[parent + 3 * i + 2]
    turned = level = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        across = s[child + 3 * j + 2] * J[1, k] - s[child + 3 * k + 2] * J[1, j]
        turned += across * s[child + 3 * i]
        level += J[1, i] * s[child + 3 * i]
    least = max(h, LEAST_BALL_COSINE)
    for i in range(3):
        left, up = s[parent + 3 * i + 1], s[child + 3 * i + 2]
        J[0, i], J[2, i] = (left + y * up) / (least * least), (up + y * left) / (least * least)
    for k in range(3):
        angle = math.atan2(sine, cosine) if k == 0 else math.atan2(y, h) if k == 1 else math.atan2(turned, level)
        away = within_half_turn(angle - f[bounds + k])
        out = past(away, f[bounds + 3 + k])
        o[1, k] = 1.0 if out > 0.0 else -1.0 if out < 0.0 else 0.0
        if out == 0.0 and watch[k] != 0:
            out = away - watch[k] * f[bounds + 3 + k]
        o[0, k] = out
        if out == 0.0:
            for i in range(3):
                J[k, i] = 0.0


def distance(s: Array, f: Array, apart: Array, row: Any, x: Array) -> Any:
    """Return the residual of one of the trunk's distances, and its square in metres; the vector is written down."""
    square = 0.0
    for i in range(3):
        x[i] = 0.0
        for k in range(9):
            x[i] += apart[row, i, k] * s[SHAPE + k]
        square += x[i] * x[i]
    return f[SHAPE_WEIGHTS + row] * 0.5 * math.log(square / f[SHAPE_SQUARES + row]), square


def spine_turn(s: Array, normal: Array) -> Any:
    """Return how far hips are turned from where the spine has them; the normal is written down."""
    turn = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        turn += s[HIPS + 3 * i] * s[TORSO + 3 * i + 2]
        normal[i] = s[HIPS + 3 * j] * s[TORSO + 3 * k + 2] - s[HIPS + 3 * k] * s[TORSO + 3 * j + 2]
    return turn


def add_turn(residual: Any, J: Array, squared: Any, matrix: Array, gradient: Array) -> None:
    """Add a residual of the hips' turn against the torso's, with its derivative (3,)."""
    for i in range(3):
        push = J[i] * residual * squared
        gradient[TURN_TORSO + i] -= push
        gradient[TURN_HIPS + i] += push
        for j in range(3):
            normal = J[i] * J[j] * squared
            matrix[TURN_TORSO + i, TURN_TORSO + j] += normal
            matrix[TURN_HIPS + i, TURN_HIPS + j] += normal
            matrix[TURN_TORSO + i, TURN_HIPS + j] -= normal
            matrix[TURN_HIPS + i, TURN_TORSO + j] -= normal


def joint_jacobian(s: Array, f: Array, offsets: Array, J: Array) -> None:
    """Write down how the trunk's unknowns move its joints (6, 3, C)."""
    width = J.shape[2]
    for joint in range(TRUNK_POINTS):
        for i in range(3):
            for c in range(width):
                J[joint, i, c] = 0.0
            J[joint, i, i] = 1.0
    for joint in range(1, TRUNK_POINTS):
        on = min(joint, 3)
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            J[joint, i, TURN_TORSO + j], J[joint, j, TURN_TORSO + i] = offsets[on, k], -offsets[on, k]
            if joint > 3:  # noqa: PLR2004 - the hips
                arm = offsets[joint, k] - offsets[3, k]
                J[joint, i, TURN_HIPS + j], J[joint, j, TURN_HIPS + i] = arm, -arm
    if width == TO_SHAPE:
        return
    for i in range(3):
        forward, left, up = s[TORSO + 3 * i], s[TORSO + 3 * i + 1], s[TORSO + 3 * i + 2]
        for joint in range(3, TRUNK_POINTS):
            J[joint, i, TO_SHAPE] = -up
        for side in range(2):
            J[1 + side, i, TO_SHAPE + 1] = forward
            J[1 + side, i, TO_SHAPE + 2 + 2 * side] = left
            J[1 + side, i, TO_SHAPE + 3 + 2 * side] = up
            J[4 + side, i, TO_SHAPE + 6] = -s[HIPS + 3 * i + 2]
            J[4 + side, i, TO_SHAPE + 7 + side] = s[HIPS + 3 * i + 1]


def trunk_block(
    s: Array,
    d: Array,
    f: Array,
    apart: Array,
    offsets: Array,
    watch: NDArray[np.int8],
    room: Array,
    matrix: Array,
    gradient: Array,
    P: Array,
    g: Array,
) -> Any:
    """Linearise the trunk, as `posekit.refinement.trunk_terms.trunk_terms` does; return chi2 and slack.

    Filled are the matrix (C, C) and gradient (C,) of prior, limits and distances, and those of image points at their
    joints (6, 3, 3), (6, 3).
    """
    width = len(gradient)
    for a in range(width):
        gradient[a] = 0.0
        for b in range(width):
            matrix[a, b] = 0.0
    chi2, slack = 0.0, 0.0
    r, A, o, J, normal = room[0, :2], room[1:3, :3], room[3:5, :3], room[5:8, :3], room[8, :3]
    for joint in range(TRUNK_POINTS):
        x, y, z = s[ROOT] + offsets[joint, 0], s[ROOT + 1] + offsets[joint, 1], s[ROOT + 2] + offsets[joint, 2]
        see(d, x, y, z, joint, r, A)
        chi2 += r[0] * r[0] + r[1] * r[1]
        for i in range(3):
            g[joint, i] = A[0, i] * r[0] + A[1, i] * r[1]
            for k in range(3):
                P[joint, i, k] = A[0, i] * A[0, k] + A[1, i] * A[1, k]
    for k in range(3):
        away = 0.0
        for i in range(3):
            away += d[ROOT_WEIGHT + 3 * k + i] * (s[ROOT + i] - d[ROOT_PRIOR + i])
        chi2 += away * away
        for i in range(3):
            weight = d[ROOT_WEIGHT + 3 * k + i]
            gradient[i] += weight * away
            for j in range(3):
                matrix[i, j] += weight * d[ROOT_WEIGHT + 3 * k + j]
    squared = f[LIMIT_SCALE] * f[LIMIT_SCALE]
    if squared > 0.0:
        ball(s, TORSO, HIPS, f, PELVIS, watch[HIP_LIMITS:NECK_LIMITS], o, J)
        for k in range(3):
            one = o[0, k] * o[0, k] * squared
            if o[1, k] != 0.0:
                chi2 += one
            else:
                slack += one
            if o[0, k] != 0.0:
                add_turn(o[0, k], J[k], squared, matrix, gradient)
    if f[MIDDLE_PELVIS] > 0.0:
        turn = spine_turn(s, normal)
        add_turn(turn, normal, SPINE_WEIGHT * SPINE_WEIGHT, matrix, gradient)
        chi2 += (turn * SPINE_WEIGHT) ** 2
    if width > TO_SHAPE:
        slope = room[9, :9]
        for row in range(9):
            stretch, square = distance(s, f, apart, row, normal)
            chi2 += stretch * stretch
            for k in range(9):
                slope[k] = 0.0
                for i in range(3):
                    slope[k] += normal[i] * apart[row, i, k]
                slope[k] *= f[SHAPE_WEIGHTS + row] / square
            for k in range(9):
                if slope[k] == 0.0:
                    continue
                gradient[TO_SHAPE + k] += slope[k] * stretch
                for m in range(9):
                    matrix[TO_SHAPE + k, TO_SHAPE + m] += slope[k] * slope[m]
    return chi2, slack


def head_block(
    s: Array,
    d: Array,
    f: Array,
    watch: NDArray[np.int8],
    room: Array,
    own: Array,
    right: Array,
    trunk: Array,
    push: Array,
) -> Any:
    """Linearise the head, as `posekit.refinement.head_terms.head_terms` does; return chi2 and slack.

    Filled are its matrix (3, 3), coupling with root and torso and gradient (3, 7), and those of root and torso (6, 6), (6,).
    """
    chi2, slack = 0.0, 0.0
    r, A, o, J, x, row = room[0, :2], room[1:3, :3], room[3:5, :3], room[5:8, :3], room[8, :3], room[9, :6]
    for a in range(6):
        push[a] = 0.0
        for b in range(6):
            trunk[a, b] = 0.0
    for a in range(3):
        for b in range(7):
            right[a, b] = 0.0
            if b < 3:  # noqa: PLR2004 - its own three
                own[a, b] = 0.0
    for point in range(int(f[HEAD_COUNT])):
        for i in range(3):
            x[i] = 0.0
            for k in range(3):
                x[i] += s[HEAD + 3 * i + k] * f[HEAD_OFFSETS + 3 * point + k]
        see(d, s[ROOT] + x[0], s[ROOT + 1] + x[1], s[ROOT + 2] + x[2], 14 + point, r, A)
        for c in range(2):
            chi2 += r[c] * r[c]
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                row[i], row[3 + i] = x[j] * A[c, k] - x[k] * A[c, j], A[c, i]
            for a in range(3):
                right[a, 6] += row[a] * r[c]
                push[a] += row[3 + a] * r[c]
                for b in range(3):
                    own[a, b] += row[a] * row[b]
                    right[a, b] += row[a] * row[3 + b]
                    trunk[a, b] += row[3 + a] * row[3 + b]
    squared = f[LIMIT_SCALE] * f[LIMIT_SCALE]
    if squared > 0.0:
        ball(s, TORSO, HEAD, f, NECK, watch[NECK_LIMITS:LIMIT_COUNT], o, J)
        for k in range(3):
            one = o[0, k] * o[0, k] * squared
            if o[1, k] != 0.0:
                chi2 += one
            else:
                slack += one
            for a in range(3):
                pushed = J[k, a] * o[0, k] * squared
                right[a, 6] += pushed
                push[3 + a] -= pushed
                for b in range(3):
                    limit = J[k, a] * J[k, b] * squared
                    own[a, b] += limit
                    right[a, 3 + b] -= limit
                    trunk[3 + a, 3 + b] += limit
    return chi2, slack


def posture_value(
    s: Array,
    d: Array,
    f: Array,
    apart: Array,
    ends: Array,
    W: Array,
    offsets: Array,
    start: Array,
    limb_room: Array,
    room: Array,
    nothing: NDArray[np.int8],
    passed: NDArray[np.int8],
) -> Any:
    """Return the chi2 of a posture, and write down which limits (22,) it passes; NaN where a judge must be asked."""
    place_trunk(s, offsets)
    for k in range(LIMIT_COUNT):
        passed[k] = 0
    chi2 = 0.0
    r, A, o, J, x = room[0, :2], room[1:3, :3], room[3:5, :3], room[5:8, :3], room[8, :3]
    for joint in range(TRUNK_POINTS):
        see(
            d, s[ROOT] + offsets[joint, 0], s[ROOT + 1] + offsets[joint, 1], s[ROOT + 2] + offsets[joint, 2], joint, r, A
        )
        chi2 += r[0] * r[0] + r[1] * r[1]
    for k in range(3):
        away = 0.0
        for i in range(3):
            away += d[ROOT_WEIGHT + 3 * k + i] * (s[ROOT + i] - d[ROOT_PRIOR + i])
        chi2 += away * away
    squared = f[LIMIT_SCALE] * f[LIMIT_SCALE]
    if squared > 0.0:
        ball(s, TORSO, HIPS, f, PELVIS, nothing[:3], o, J)
        for k in range(3):
            chi2 += o[0, k] * o[0, k] * squared
            passed[HIP_LIMITS + k] = int(o[1, k])
    if f[MIDDLE_PELVIS] > 0.0:
        chi2 += (spine_turn(s, x) * SPINE_WEIGHT) ** 2
    if f[VARIED_SHAPE] > 0.0:
        for row in range(9):
            chi2 += distance(s, f, apart, row, x)[0] ** 2
    for point in range(int(f[HEAD_COUNT])):
        for i in range(3):
            x[i] = s[ROOT + i]
            for k in range(3):
                x[i] += s[HEAD + 3 * i + k] * f[HEAD_OFFSETS + 3 * point + k]
        see(d, x[0], x[1], x[2], 14 + point, r, A)
        chi2 += r[0] * r[0] + r[1] * r[1]
    if f[HEAD_COUNT] > 0.0 and squared > 0.0:
        ball(s, TORSO, HEAD, f, NECK, nothing[:3], o, J)
        for k in range(3):
            chi2 += o[0, k] * o[0, k] * squared
            passed[NECK_LIMITS + k] = int(o[1, k])
    if f[TRUNK_ONLY] == 0.0:
        for limb in range(LIMB_COUNT):
            for i in range(3):
                start[i] = s[ROOT + i] + offsets[STARTS[limb], i]
            of_limb = limb_value(
                s, d, f, limb, start, ends[limb], W[limb], limb_room, nothing, passed[4 * limb : 4 * limb + 4]
            )
            if math.isnan(of_limb):
                return math.nan
            chi2 += of_limb
    return chi2 if chi2 < BEYOND_COUNTING else math.inf


def turn_part(s: Array, at: Any, x: Any, y: Any, z: Any, out: Array) -> None:
    """Turn the rotation that stands at a place by a step, as `posekit.geometry.batch_last.step_rotation` does."""
    x, y, z = 0.5 * x, 0.5 * y, 0.5 * z
    squared = x * x + y * y + z * z
    scale = 2.0 / (1.0 + squared)
    one = 1.0 - scale * squared
    for k in range(3):
        a, b, c = s[at + k], s[at + 3 + k], s[at + 6 + k]
        along = scale * (x * a + y * b + z * c)
        out[at + k] = one * a + x * along + scale * (y * c - z * b)
        out[at + 3 + k] = one * b + y * along + scale * (z * a - x * c)
        out[at + 6 + k] = one * c + z * along + scale * (x * b - y * a)


def curve(offsets: Array, g: Array, matrix: Array) -> None:
    """Add the curvature of turning torso and hips, as `posekit.refinement.trunk_terms.to_unknowns` does."""
    for joint in range(1, TRUNK_POINTS):
        on_hips = joint > 3  # noqa: PLR2004 - the hips
        at = TURN_HIPS if on_hips else TURN_TORSO
        square, outward = 0.0, 0.0
        for i in range(3):
            arm = offsets[joint, i] - offsets[3, i] if on_hips else offsets[joint, i]
            pull = g[joint, i] + (g[4, i] + g[5, i] if joint == 3 else 0.0)  # noqa: PLR2004 - the pelvis carries the hips
            square += arm * arm
            outward -= arm * pull
        if not outward > 0.0:
            continue
        share = outward / (square if square > 0.0 else 1.0)
        for i in range(3):
            first = offsets[joint, i] - offsets[3, i] if on_hips else offsets[joint, i]
            matrix[at + i, at + i] += outward
            for k in range(3):
                other = offsets[joint, k] - offsets[3, k] if on_hips else offsets[joint, k]
                matrix[at + i, at + k] -= share * first * other


def gather_trunk(J: Array, P: Array, g: Array, matrix: Array, gradient: Array, moving: Array) -> None:
    """Add matrices and gradients at the trunk's joints to its unknowns."""
    width = len(gradient)
    for joint in range(TRUNK_POINTS):
        for i in range(3):
            for c in range(width):
                moving[i, c] = (
                    P[joint, i, 0] * J[joint, 0, c] + P[joint, i, 1] * J[joint, 1, c] + P[joint, i, 2] * J[joint, 2, c]
                )
        for c in range(width):
            a, b, e = J[joint, 0, c], J[joint, 1, c], J[joint, 2, c]
            if a == 0.0 and b == 0.0 and e == 0.0:
                continue
            gradient[c] += a * g[joint, 0] + b * g[joint, 1] + e * g[joint, 2]
            for m in range(width):
                matrix[c, m] += a * moving[0, m] + b * moving[1, m] + e * moving[2, m]


def leave(right: Array, width: Any, own: Array, push: Array) -> None:
    """Take from matrix (6, 6) and gradient (6,) what an eliminated block takes along."""
    for a in range(6):
        for b in range(6):
            for k in range(width):
                own[a, b] -= right[k, a] * right[k, b]
        for k in range(width):
            push[a] -= right[k, a] * right[k, 6]


def add_limb(limb: Any, turn: Any, J: Array, own: Array, push: Array, P: Array, g: Array, matrix: Array, gradient: Array) -> None:
    """Add what an eliminated limb leaves at its start, and of how its part is turned."""
    joint, width = STARTS[limb], len(gradient)
    for i in range(3):
        g[joint, i] += push[i]
        gradient[turn + i] += push[3 + i]
        for k in range(3):
            P[joint, i, k] += own[i, k]
            matrix[turn + i, turn + k] += own[3 + i, 3 + k]
    for i in range(3):
        for c in range(width):
            cross = own[3 + i, 0] * J[joint, 0, c] + own[3 + i, 1] * J[joint, 1, c] + own[3 + i, 2] * J[joint, 2, c]
            matrix[turn + i, c] += cross
            matrix[c, turn + i] += cross


def follow(L: Array, right: Array, width: Any, shift: Array, damped: Array, step: Array) -> Any:
    """Solve for the step of an eliminated block when what it is coupled with moves; return the decrease it promises."""
    gain = 0.0
    for k in range(width):
        step[k] = right[k, 6]
        gain += right[k, 6] * right[k, 6]
        for a in range(6):
            step[k] += right[k, a] * shift[a]
    solve_backward(L, width, step)
    for k in range(width):
        step[k] = -step[k]
        gain += damped[k] * step[k] * step[k]
    return gain


def descend_postures(  # noqa: PLR0912, PLR0915 - one step after the other, on numbers that are at hand
    states: Array,
    data: Array,
    f: Array,
    apart: Array,
    ends: Array,
    numbers: Array,
    h: Array,
    chi2: Array,
    counts: NDArray[np.int64],
    asked: NDArray[np.bool_],
) -> None:
    """Search from postures (N, 71), in place, as `posekit.refinement.descent.descend` does.

    Filled are chi2 (N,), and the counts (N, 4): steps, whether it is settled, folds, limits that are felt. Where a judge
    must be asked, which is written down, they mean nothing.
    """
    whole, seen = f[TRUNK_ONLY] == 0.0, f[HEAD_COUNT] > 0.0
    width, reach = 18 if f[VARIED_SHAPE] > 0.0 else 9, 6 if f[VARIED_LIMBS] > 0.0 else 4
    limb_room, room, offsets, start = np.empty((24, 7)), np.empty((10, 9)), np.empty((6, 3)), np.empty(3)
    matrix, gradient, J = np.empty((width, width)), np.empty(width), np.empty((6, 3, width))
    P, g, moving, shift = np.empty((6, 3, 3)), np.empty((6, 3)), np.empty((3, width)), np.empty(6)
    L, right = np.empty((5, 6, 6)), np.empty((5, 6, 7))
    own, push, tangents = np.empty((6, 6)), np.empty(6), np.empty((4, 4, 3))
    damped, last, last_damped, step = np.empty((5, 6)), np.empty((width, 1)), np.empty(width), np.empty((5, 6))
    trunk_step = np.empty(width)
    watch, passed, nothing = np.zeros(LIMIT_COUNT, np.int8), np.zeros(LIMIT_COUNT, np.int8), np.zeros(4, np.int8)
    now, trial = np.empty(states.shape[1]), np.empty(states.shape[1])
    W = np.empty((4, NUMBERS_AT + numbers.shape[1]))
    W[:, NUMBERS_AT:] = numbers
    for n in range(len(states)):
        d = data[n]
        now[:] = states[n]
        trial[:] = now
        watch[:] = 0
        damping, watching, taken = h[INITIAL], False, 0
        value = posture_value(now, d, f, apart, ends, W, offsets, start, limb_room, room, nothing, passed)
        if math.isnan(value):
            asked[n] = True
            continue
        active = 0
        for k in range(LIMIT_COUNT):
            active += passed[k] != 0
        for turn in range(int(h[STEPS]) + 1):
            place_trunk(now, offsets)
            joint_jacobian(now, f, offsets, J)
            slack = trunk_block(now, d, f, apart, offsets, watch, room, matrix, gradient, P, g)[1]
            folds, unclear = 0, False
            if whole:
                for limb in range(LIMB_COUNT):
                    for i in range(3):
                        start[i] = now[ROOT + i] + offsets[STARTS[limb], i]
                    _, more, bent = limb_block(
                        now,
                        d,
                        f,
                        limb,
                        start,
                        ends[limb],
                        W[limb],
                        watch[4 * limb : 4 * limb + 4],
                        limb_room,
                        L[limb],
                        right[limb],
                        own,
                        push,
                        tangents[limb],
                    )
                    if bent < 0:
                        unclear = True
                        break
                    folds += bent
                    slack += more
                    damped_factor(L[limb], reach, damping, h[FLOOR], damped[limb])
                    solve_forward(L[limb], reach, right[limb], 7)
                    leave(right[limb], reach, own, push)
                    of_torso = limb < FIRST_LEG or f[LEGS_ON_TORSO] > 0.0
                    add_limb(limb, TURN_TORSO if of_torso else TURN_HIPS, J, own, push, P, g, matrix, gradient)
            if unclear:
                asked[n] = True
                break
            gather_trunk(J, P, g, matrix, gradient, moving)
            curve(offsets, g, matrix)
            if seen:
                slack += head_block(now, d, f, watch, room, L[4], right[4], own, push)[1]
                damped_factor(L[4], 3, damping, h[FLOOR], damped[4])
                solve_forward(L[4], 3, right[4], 7)
                leave(right[4], 3, own, push)
                for a in range(6):
                    gradient[a] += push[a]
                    for b in range(6):
                        matrix[a, b] += own[a, b]
            damped_factor(matrix, width, damping, h[FLOOR], last_damped)
            for c in range(width):
                last[c, 0] = gradient[c]
            solve_forward(matrix, width, last, 1)
            gain = -slack
            for c in range(width):
                gain += last[c, 0] * last[c, 0]
                trunk_step[c] = last[c, 0]
            solve_backward(matrix, width, trunk_step)
            for c in range(width):
                trunk_step[c] = -trunk_step[c]
                gain += last_damped[c] * trunk_step[c] * trunk_step[c]
            if whole:
                for limb in range(LIMB_COUNT):
                    at = TURN_TORSO if limb < FIRST_LEG or f[LEGS_ON_TORSO] > 0.0 else TURN_HIPS
                    for i in range(3):
                        shift[i], shift[3 + i] = 0.0, trunk_step[at + i]
                        for c in range(width):
                            shift[i] += J[STARTS[limb], i, c] * trunk_step[c]
                    gain += follow(L[limb], right[limb], reach, shift, damped[limb], step[limb])
            if seen:
                for i in range(6):
                    shift[i] = trunk_step[i]
                gain += follow(L[4], right[4], 3, shift, damped[4], step[4])
            settled = damping > h[LARGEST] or (gain <= h[PRECISION] and (damping <= h[LIGHT] or watching))
            counts[n, 1], counts[n, 2] = settled, folds
            given_up = not value < math.inf or (value > h[HOPELESS] and gain < 0.5 * value and not watching)
            if settled or given_up or turn == int(h[STEPS]):
                break
            for i in range(3):
                trial[ROOT + i] = now[ROOT + i] + trunk_step[i]
            turn_part(now, TORSO, trunk_step[3], trunk_step[4], trunk_step[5], trial)
            turn_part(now, HIPS, trunk_step[6], trunk_step[7], trunk_step[8], trial)
            if seen:
                turn_part(now, HEAD, step[4, 0], step[4, 1], step[4, 2], trial)
            for c in range(TO_SHAPE, width):
                trial[SHAPE + c - TO_SHAPE] = now[SHAPE + c - TO_SHAPE] + trunk_step[c]
            if whole:
                for limb in range(LIMB_COUNT):
                    move_limb(now, limb, step[limb], tangents[limb], reach, trial)
            new = posture_value(trial, d, f, apart, ends, W, offsets, start, limb_room, room, nothing, passed)
            if math.isnan(new):
                asked[n] = True
                break
            taken += 1
            better, ran, felt = new <= value, False, 0
            for k in range(LIMIT_COUNT):
                fresh = passed[k] if watch[k] == 0 and not better else 0
                ran = ran or fresh != 0
                felt += passed[k] != 0
                watch[k] = 0 if better else watch[k] + fresh
            watching = (watching or ran) and not better
            damping = next_damping(h, damping, better, value - new, gain, ran)
            if better:
                now[:] = trial
                value, active = new, felt
        if not asked[n]:
            states[n] = now
            chi2[n], counts[n, 0], counts[n, 3] = value, taken, active


def value_postures(
    states: Array,
    data: Array,
    f: Array,
    apart: Array,
    ends: Array,
    numbers: Array,
    chi2: Array,
) -> None:
    """Fill in chi2 (N,) of postures (N, 71); NaN where a judge must be asked."""
    limb_room, room, offsets, start = np.empty((24, 7)), np.empty((10, 9)), np.empty((6, 3)), np.empty(3)
    passed, nothing = np.zeros(LIMIT_COUNT, np.int8), np.zeros(4, np.int8)
    W = np.empty((4, NUMBERS_AT + numbers.shape[1]))
    W[:, NUMBERS_AT:] = numbers
    for n in range(len(states)):
        chi2[n] = posture_value(
            states[n], data[n], f, apart, ends, W, offsets, start, limb_room, room, nothing, passed
        )


def value_limbs(
    states: Array, data: Array, f: Array, starts: Array, ends: Array, numbers: Array, chi2: Array
) -> None:
    """Fill in chi2 (M, 4) of limbs from their starts (M, 4, 3); NaN where a judge must be asked."""
    limb_room, passed, nothing = np.empty((24, 7)), np.zeros(4, np.int8), np.zeros(4, np.int8)
    W = np.empty((4, NUMBERS_AT + numbers.shape[1]))
    W[:, NUMBERS_AT:] = numbers
    for m in range(len(states)):
        for limb in range(LIMB_COUNT):
            chi2[m, limb] = limb_value(
                states[m], data[m], f, limb, starts[m, limb], ends[limb], W[limb], limb_room, nothing, passed
            )


def tabulate_trunks(
    states: Array, data: Array, f: Array, apart: Array, floor: Any, matrix: Array, gradient: Array, head: Array
) -> None:
    """Fill in matrices (N, C, C) and gradients (N, C) of trunks alone, and how heads follow (N, 3, 7)."""
    width = matrix.shape[1]
    room, offsets, J = np.empty((10, 9)), np.empty((6, 3)), np.empty((6, 3, width))
    P, g, moving = np.empty((6, 3, 3)), np.empty((6, 3)), np.empty((3, width))
    L, right, own, push = np.empty((6, 6)), np.empty((6, 7)), np.empty((6, 6)), np.empty(6)
    damped, column, nothing = np.empty(6), np.empty(3), np.zeros(LIMIT_COUNT, np.int8)
    for n in range(len(states)):
        s, d = states[n], data[n]
        place_trunk(s, offsets)
        joint_jacobian(s, f, offsets, J)
        trunk_block(s, d, f, apart, offsets, nothing, room, matrix[n], gradient[n], P, g)
        gather_trunk(J, P, g, matrix[n], gradient[n], moving)
        curve(offsets, g, matrix[n])
        if f[HEAD_COUNT] > 0.0:
            head_block(s, d, f, nothing, room, L, right, own, push)
            damped_factor(L, 3, 0.0, floor, damped)
            solve_forward(L, 3, right, 7)
            leave(right, 3, own, push)
            for a in range(6):
                gradient[n, a] += push[a]
                for b in range(6):
                    matrix[n, a, b] += own[a, b]
            for c in range(7):
                for k in range(3):
                    column[k] = right[k, c]
                solve_backward(L, 3, column)
                for k in range(3):
                    head[n, k, c] = -column[k]
        for c in range(width):
            matrix[n, c, c] += floor


def tabulate_limbs(
    states: Array,
    data: Array,
    f: Array,
    ends: Array,
    numbers: Array,
    floor: Any,
    matrix: Array,
    gradient: Array,
    step: Array,
    slope: Array,
    tangents: Array,
    counts: NDArray[np.int64],
) -> None:
    """Tabulate limbs on the trunks of postures (M, 71), as `posekit.refinement.joint_step.limb_tables` does.

    Filled are what they add to matrix (4, M, C, C) and gradient (4, M, C), their own step (4, M, U) and how it follows the
    trunk's (4, M, U, C), tangents (4, M, 4, 3), and how many folds and limits there are (4, M, 2), -1 where a judge must be
    asked.
    """
    width, reach = matrix.shape[2], step.shape[2]
    limb_room, offsets, J, start = np.empty((24, 7)), np.empty((6, 3)), np.empty((6, 3, width)), np.empty(3)
    L, right, own, push = np.empty((6, 6)), np.empty((6, 7)), np.empty((6, 6)), np.empty(6)
    damped, column, starts, carried = np.empty(6), np.empty(6), np.zeros((6, width)), np.empty((6, width))
    nothing = np.zeros(4, np.int8)
    W = np.empty((4, NUMBERS_AT + numbers.shape[1]))
    W[:, NUMBERS_AT:] = numbers
    for m in range(len(states)):
        s, d = states[m], data[m]
        place_trunk(s, offsets)
        joint_jacobian(s, f, offsets, J)
        for limb in range(LIMB_COUNT):
            joint = STARTS[limb]
            turn = TURN_TORSO if limb < FIRST_LEG or f[LEGS_ON_TORSO] > 0.0 else TURN_HIPS
            for i in range(3):
                start[i] = s[ROOT + i] + offsets[joint, i]
                for c in range(width):
                    starts[i, c] = J[joint, i, c]
                    starts[3 + i, c] = 1.0 if c == turn + i else 0.0
            folds = limb_block(
                s, d, f, limb, start, ends[limb], W[limb], nothing, limb_room, L, right, own, push, tangents[limb, m]
            )[2]
            counts[limb, m, 0], counts[limb, m, 1] = folds, 0
            if folds < 0:
                continue
            for k in range(BOX_ANGLES):
                counts[limb, m, 1] += limb_room[10, k] != 0.0
            damped_factor(L, reach, 0.0, floor, damped)
            solve_forward(L, reach, right, 7)
            leave(right, reach, own, push)
            for c in range(width):
                for i in range(6):
                    carried[i, c] = 0.0
                    for k in range(6):
                        carried[i, c] += own[i, k] * starts[k, c]
            for c in range(width):
                gradient[limb, m, c] = 0.0
                for i in range(6):
                    gradient[limb, m, c] += starts[i, c] * push[i]
                for e in range(width):
                    matrix[limb, m, c, e] = 0.0
                    for i in range(6):
                        matrix[limb, m, c, e] += starts[i, c] * carried[i, e]
                for k in range(reach):
                    slope[limb, m, k, c] = 0.0
            for a in range(7):
                for k in range(reach):
                    column[k] = right[k, a]
                solve_backward(L, reach, column)
                for k in range(reach):
                    if a == 6:  # noqa: PLR2004 - the last column is the gradient
                        step[limb, m, k] = -column[k]
                        continue
                    for c in range(width):
                        slope[limb, m, k, c] -= column[k] * starts[a, c]


def know_turns(s: Array, d: Array, limb: Any, x: Array, tangents: Array, room: Array, matrix: Array) -> None:
    """Add what is known of turns that the image does not show, as `posekit.refinement.covariance` says.

    The limb's middle and end (2, 3), and how the image moves with them, as `limb_block` left it in its room.
    """
    for segment in range(2):
        at, k = DIRECTIONS + 6 * limb + 3 * segment, 2 * segment
        seen, first, second = 0.0, 0.0, 0.0
        for c in range(2):
            moved = 0.0
            for i in range(3):
                moved += room[2 * segment + c, i] * s[at + i]
            seen += moved * moved
        for i in range(3):
            ray = x[segment, i] if d[CAMERA + PERSPECTIVE] > 0.0 else 1.0 if i == 2 else 0.0  # noqa: PLR2004 - along z
            first += tangents[k, i] * ray
            second += tangents[k + 1, i] * ray
        size = max(math.sqrt(first * first + second * second), LEAST_LENGTH)
        known = MOST_TURN_INFORMATION * s[LIMBS + 2 * limb + segment] * math.sqrt(seen) / (size * size)
        matrix[k, k] += known * first * first + ANGLE_INFORMATION
        matrix[k, k + 1] += known * first * second
        matrix[k + 1, k] += known * first * second
        matrix[k + 1, k + 1] += known * second * second + ANGLE_INFORMATION


def know_postures(
    states: Array,
    data: Array,
    f: Array,
    apart: Array,
    ends: Array,
    numbers: Array,
    matrix: Array,
    jacobian: Array,
    factor: Array,
    right: Array,
    levers: Array,
    joints: Array,
    asked: NDArray[np.bool_],
) -> None:
    """Fill in what covariances of postures (N, 71) follow from, as `posekit.refinement.covariance.joint_system` does.

    Arrays have the batch last: the trunk's matrix (C, C, N) and Jacobian (6, 3, C, N); the limbs' factors (U, U, 4, N),
    couplings and gradients (U, 7, 4, N) and levers (2, 4, 3, U, N); and all joints (14, 3, N).
    """
    width, reach = matrix.shape[0], factor.shape[0]
    limb_room, room, offsets, start = np.empty((24, 7)), np.empty((10, 9)), np.empty((6, 3)), np.empty(3)
    M, gradient, J, x = np.empty((width, width)), np.empty(width), np.empty((6, 3, width)), np.empty((2, 3))
    P, g, moving = np.empty((6, 3, 3)), np.empty((6, 3)), np.empty((3, width))
    L, along, own, push = np.empty((6, 6)), np.empty((6, 7)), np.empty((6, 6)), np.empty(6)
    tangents, damped, nothing = np.empty((4, 3)), np.empty(6), np.zeros(LIMIT_COUNT, np.int8)
    W = np.empty((4, NUMBERS_AT + numbers.shape[1]))
    W[:, NUMBERS_AT:] = numbers
    floor = ANGLE_INFORMATION * 1e-6
    for n in range(len(states)):
        s, d = states[n], data[n]
        place_trunk(s, offsets)
        joint_jacobian(s, f, offsets, J)
        trunk_block(s, d, f, apart, offsets, nothing, room, M, gradient, P, g)
        for joint in range(TRUNK_POINTS):
            for i in range(3):
                joints[joint, i, n] = s[ROOT + i] + offsets[joint, i]
        for limb in range(LIMB_COUNT):
            for i in range(3):
                start[i] = joints[STARTS[limb], i, n]
            told = limb_block(
                s, d, f, limb, start, ends[limb], W[limb], nothing[:4], limb_room, L, along, own, push, tangents
            )
            if told[2] < 0:
                asked[n] = True
                break
            for segment in range(2):
                length, at = s[LIMBS + 2 * limb + segment], DIRECTIONS + 6 * limb + 3 * segment
                for i in range(3):
                    x[segment, i] = (start[i] if segment == 0 else x[0, i]) + length * s[at + i]
                    joints[MIDDLES[limb] if segment == 0 else ENDS[limb], i, n] = x[segment, i]
                    for end in range(segment, 2):
                        levers[end, limb, i, 2 * segment, n] = length * tangents[2 * segment, i]
                        levers[end, limb, i, 2 * segment + 1, n] = length * tangents[2 * segment + 1, i]
                        if reach > 4:  # noqa: PLR2004 - lengths are varied
                            levers[end, limb, i, 4 + segment, n] = length * s[at + i]
            know_turns(s, d, limb, x, tangents, limb_room, L)
            damped_factor(L, reach, 0.0, floor, damped)
            solve_forward(L, reach, along, 7)
            leave(along, reach, own, push)
            of_torso = limb < FIRST_LEG or f[LEGS_ON_TORSO] > 0.0
            add_limb(limb, TURN_TORSO if of_torso else TURN_HIPS, J, own, push, P, g, M, gradient)
            for a in range(reach):
                for b in range(reach):
                    factor[a, b, limb, n] = L[a, b]
                for b in range(7):
                    right[a, b, limb, n] = along[a, b]
        if asked[n]:
            continue
        gather_trunk(J, P, g, M, gradient, moving)
        curve(offsets, g, M)
        if f[HEAD_COUNT] > 0.0:
            head_block(s, d, f, nothing, room, L, along, own, push)
            damped_factor(L, 3, 0.0, floor, damped)
            solve_forward(L, 3, along, 7)
            leave(along, 3, own, push)
            for a in range(6):
                for b in range(6):
                    M[a, b] += own[a, b]
        for a in range(width):
            turns = TURN_TORSO <= a < TO_SHAPE
            M[a, a] += ANGLE_INFORMATION if turns else PLACE_INFORMATION
            for b in range(width):
                matrix[a, b, n] = M[a, b]
            for joint in range(TRUNK_POINTS):
                for i in range(3):
                    jacobian[joint, i, a, n] = J[joint, i, a]


KERNEL_PARTS = (limb_block_kernels,)

COMPILED_TYPES = {
    "place_trunk": "",
    "ball": "",
    "distance": "",
    "spine_turn": "",
    "add_turn": "",
    "joint_jacobian": "",
    "trunk_block": "",
    "head_block": "",
    "posture_value": "",
    "turn_part": "",
    "curve": "",
    "gather_trunk": "",
    "leave": "",
    "add_limb": "",
    "follow": "",
    "fit_limbs": (
        "(f8[:,::1], f8[:,::1], f8[::1], f8[:,:,::1], b1[:,::1], f8[:,:,::1], f8[:,::1], f8[::1], f8[:,::1], b1[:,::1])"
    ),
    "descend_postures": (
        "(f8[:,::1], f8[:,::1], f8[::1], f8[:,:,::1], f8[:,:,::1], f8[:,::1], f8[::1], f8[::1], i8[:,::1], b1[::1])"
    ),
    "value_postures": "(f8[:,::1], f8[:,::1], f8[::1], f8[:,:,::1], f8[:,:,::1], f8[:,::1], f8[::1])",
    "value_limbs": "(f8[:,::1], f8[:,::1], f8[::1], f8[:,:,::1], f8[:,:,::1], f8[:,::1], f8[:,::1])",
    "tabulate_trunks": (
        "(f8[:,::1], f8[:,::1], f8[::1], f8[:,:,::1], f8, f8[:,:,::1], f8[:,::1], f8[:,:,::1])"
    ),
    "tabulate_limbs": (
        "(f8[:,::1], f8[:,::1], f8[::1], f8[:,:,::1], f8[:,::1], f8, f8[:,:,:,::1], f8[:,:,::1], f8[:,:,::1],"
        " f8[:,:,:,::1], f8[:,:,:,::1], i8[:,:,::1])"
    ),
    "know_turns": "",
    "know_postures": (
        "(f8[:,::1], f8[:,::1], f8[::1], f8[:,:,::1], f8[:,:,::1], f8[:,::1], f8[:,:,::1], f8[:,:,:,::1], f8[:,:,:,::1],"
        " f8[:,:,:,::1], f8[:,:,:,:,::1], f8[:,:,::1], b1[::1])"
    ),
    "limbs_beyond": "(f8[:,::1], f8[:,::1], f8[:,::1], f8[::1], f8[:,::1], f8[:,::1], i8[::1])",
}
"""The kernels, in the order in which they need each other, with the types of those that are called."""
