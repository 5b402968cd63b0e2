"""Trunk and head of one posture as plain loops, for `posekit.compiled.posture_kernels`.

The formulas are those of `posekit.refinement.trunk_terms`, `head_terms` and `state`. Numbers of a posture stand where
`posekit.compiled.posture_numbers` says.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.compiled import limb_block_kernels, limb_limit_kernels
from posekit.compiled.limb_block_kernels import see
from posekit.compiled.limb_limit_kernels import past, within_half_turn
from posekit.compiled.posture_numbers import (
    AT_HEAD,
    AT_HIPS,
    AT_ROOT,
    AT_SHAPE,
    AT_TORSO,
    HEAD_COUNT,
    HEAD_OFFSETS,
    HIP_LIMITS,
    LIMB_STARTS,
    LIMIT_COUNT,
    LIMIT_SCALE,
    MIDDLE_PELVIS,
    NECK_BOX,
    NECK_LIMITS,
    PELVIS_BOX,
    ROOT_PRIOR,
    ROOT_WEIGHT,
    SHAPE_SQUARES,
    SHAPE_WEIGHTS,
)
from posekit.geometry import Array

TRUNK_POINTS, LIMB_COUNT = 6, 4
"""Joints of the trunk, and how many limbs there are."""

TURN_TORSO, TURN_HIPS, TO_SHAPE = 3, 6, 9
"""Which unknowns turn torso and hips, and change the trunk's shape."""

LEAST_BALL_COSINE = 0.05
"""As `posekit.refinement.limits.MIN_COSINE`."""

SPINE_WEIGHT = 1e3
"""One over `posekit.refinement.trunk_terms.SPINE_TURN_DEVIATION`."""


def place_trunk(s: Array, offsets: Array) -> None:
    """Place the trunk's joints relative to the root (6, 3), as `posekit.refinement.state.trunk_offsets` does."""
    for i in range(3):
        x, y, z = s[AT_TORSO + 3 * i], s[AT_TORSO + 3 * i + 1], s[AT_TORSO + 3 * i + 2]
        offsets[0, i] = 0.0
        offsets[3, i] = -s[AT_SHAPE] * z
        down = offsets[3, i] - s[AT_SHAPE + 6] * s[AT_HIPS + 3 * i + 2]
        for side in range(2):
            offsets[1 + side, i] = (
                s[AT_SHAPE + 1] * x + s[AT_SHAPE + 2 + 2 * side] * y + s[AT_SHAPE + 3 + 2 * side] * z
            )
            offsets[4 + side, i] = down + s[AT_SHAPE + 7 + side] * s[AT_HIPS + 3 * i + 1]


def ball(
    s: Array, parent: Any, child: Any, f: Array, bounds: Any, watch: NDArray[np.int8], o: Array, J: Array
) -> None:
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
        angle = (
            math.atan2(sine, cosine) if k == 0 else math.atan2(y, h) if k == 1 else math.atan2(turned, level)
        )
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
            x[i] += apart[row, i, k] * s[AT_SHAPE + k]
        square += x[i] * x[i]
    return f[SHAPE_WEIGHTS + row] * 0.5 * math.log(square / f[SHAPE_SQUARES + row]), square


def spine_turn(s: Array, normal: Array) -> Any:
    """Return how far hips are turned from where the spine has them; the normal is written down."""
    turn = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        turn += s[AT_HIPS + 3 * i] * s[AT_TORSO + 3 * i + 2]
        normal[i] = (
            s[AT_HIPS + 3 * j] * s[AT_TORSO + 3 * k + 2] - s[AT_HIPS + 3 * k] * s[AT_TORSO + 3 * j + 2]
        )
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


def joint_jacobian(s: Array, offsets: Array, J: Array) -> None:
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
            if joint > 3:
                arm = offsets[joint, k] - offsets[3, k]
                J[joint, i, TURN_HIPS + j], J[joint, j, TURN_HIPS + i] = arm, -arm
    if width == TO_SHAPE:
        return
    for i in range(3):
        forward, left, up = s[AT_TORSO + 3 * i], s[AT_TORSO + 3 * i + 1], s[AT_TORSO + 3 * i + 2]
        for joint in range(3, TRUNK_POINTS):
            J[joint, i, TO_SHAPE] = -up
        for side in range(2):
            J[1 + side, i, TO_SHAPE + 1] = forward
            J[1 + side, i, TO_SHAPE + 2 + 2 * side] = left
            J[1 + side, i, TO_SHAPE + 3 + 2 * side] = up
            J[4 + side, i, TO_SHAPE + 6] = -s[AT_HIPS + 3 * i + 2]
            J[4 + side, i, TO_SHAPE + 7 + side] = s[AT_HIPS + 3 * i + 1]


def trunk_room() -> Any:
    """Make room for a trunk: a point's residual and derivative, a ball's, a vector, and a row of a Jacobian."""
    return np.empty(2), np.empty((2, 3)), np.empty((2, 3)), np.empty((3, 3)), np.empty(3), np.empty(9)


def trunk_block(
    s: Array,
    d: Array,
    f: Array,
    apart: Array,
    offsets: Array,
    watch: NDArray[np.int8],
    room: Any,
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
    r, A, o, J, normal, slope = room
    for joint in range(TRUNK_POINTS):
        x, y, z = (
            s[AT_ROOT] + offsets[joint, 0],
            s[AT_ROOT + 1] + offsets[joint, 1],
            s[AT_ROOT + 2] + offsets[joint, 2],
        )
        see(d, x, y, z, joint, r, A)
        chi2 += r[0] * r[0] + r[1] * r[1]
        for i in range(3):
            g[joint, i] = A[0, i] * r[0] + A[1, i] * r[1]
            for k in range(3):
                P[joint, i, k] = A[0, i] * A[0, k] + A[1, i] * A[1, k]
    for k in range(3):
        away = 0.0
        for i in range(3):
            away += d[ROOT_WEIGHT + 3 * k + i] * (s[AT_ROOT + i] - d[ROOT_PRIOR + i])
        chi2 += away * away
        for i in range(3):
            weight = d[ROOT_WEIGHT + 3 * k + i]
            gradient[i] += weight * away
            for j in range(3):
                matrix[i, j] += weight * d[ROOT_WEIGHT + 3 * k + j]
    squared = f[LIMIT_SCALE] * f[LIMIT_SCALE]
    if squared > 0.0:
        ball(s, AT_TORSO, AT_HIPS, f, PELVIS_BOX, watch[HIP_LIMITS:NECK_LIMITS], o, J)
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
    room: Any,
    own: Array,
    right: Array,
    trunk: Array,
    push: Array,
) -> Any:
    """Linearise the head, as `posekit.refinement.head_terms.head_terms` does; return chi2 and slack.

    Filled are its matrix (3, 3), coupling with root and torso and gradient (3, 7), and those of root and torso
    (6, 6), (6,).
    """
    chi2, slack = 0.0, 0.0
    r, A, o, J, x, row = room
    for a in range(6):
        push[a] = 0.0
        for b in range(6):
            trunk[a, b] = 0.0
    for a in range(3):
        for b in range(7):
            right[a, b] = 0.0
            if b < 3:
                own[a, b] = 0.0
    for point in range(int(f[HEAD_COUNT])):
        for i in range(3):
            x[i] = 0.0
            for k in range(3):
                x[i] += s[AT_HEAD + 3 * i + k] * f[HEAD_OFFSETS + 3 * point + k]
        see(d, s[AT_ROOT] + x[0], s[AT_ROOT + 1] + x[1], s[AT_ROOT + 2] + x[2], 14 + point, r, A)
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
        ball(s, AT_TORSO, AT_HEAD, f, NECK_BOX, watch[NECK_LIMITS:LIMIT_COUNT], o, J)
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


def curve(offsets: Array, g: Array, matrix: Array) -> None:
    """Add the curvature of turning torso and hips, as `posekit.refinement.trunk_terms.to_unknowns` does."""
    for joint in range(1, TRUNK_POINTS):
        on_hips = joint > 3
        at = TURN_HIPS if on_hips else TURN_TORSO
        square, outward = 0.0, 0.0
        for i in range(3):
            arm = offsets[joint, i] - offsets[3, i] if on_hips else offsets[joint, i]
            pull = g[joint, i] + (g[4, i] + g[5, i] if joint == 3 else 0.0)
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
                    P[joint, i, 0] * J[joint, 0, c]
                    + P[joint, i, 1] * J[joint, 1, c]
                    + P[joint, i, 2] * J[joint, 2, c]
                )
        for c in range(width):
            a, b, e = J[joint, 0, c], J[joint, 1, c], J[joint, 2, c]
            if a == 0.0 and b == 0.0 and e == 0.0:
                continue
            gradient[c] += a * g[joint, 0] + b * g[joint, 1] + e * g[joint, 2]
            for m in range(width):
                matrix[c, m] += a * moving[0, m] + b * moving[1, m] + e * moving[2, m]


def add_limb(
    limb: Any,
    turn: Any,
    J: Array,
    own: Array,
    push: Array,
    P: Array,
    g: Array,
    matrix: Array,
    gradient: Array,
) -> None:
    """Add what an eliminated limb leaves at its start, and of how its part is turned."""
    joint, width = LIMB_STARTS[limb], len(gradient)
    for i in range(3):
        g[joint, i] += push[i]
        gradient[turn + i] += push[3 + i]
        for k in range(3):
            P[joint, i, k] += own[i, k]
            matrix[turn + i, turn + k] += own[3 + i, 3 + k]
    for i in range(3):
        for c in range(width):
            cross = (
                own[3 + i, 0] * J[joint, 0, c]
                + own[3 + i, 1] * J[joint, 1, c]
                + own[3 + i, 2] * J[joint, 2, c]
            )
            matrix[turn + i, c] += cross
            matrix[c, turn + i] += cross


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


KERNEL_PARTS = (
    limb_limit_kernels,
    limb_block_kernels,
)

COMPILED_TYPES = {
    "place_trunk": "",
    "ball": "",
    "distance": "",
    "spine_turn": "",
    "add_turn": "",
    "joint_jacobian": "",
    "trunk_room": "",
    "trunk_block": "",
    "head_block": "",
    "curve": "",
    "gather_trunk": "",
    "add_limb": "",
    "turn_part": "",
}
"""The kernels, in the order in which they need each other: compiled into those that call them."""
