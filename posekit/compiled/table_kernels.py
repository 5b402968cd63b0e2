"""What else refinement asks of postures as plain loops: quadratics and what covariances follow from.

The quadratics of trunks and limbs are those of `posekit.refinement.joint_step`, the other those of
`posekit.refinement.covariance`. Numbers of a posture stand where `posekit.compiled.posture_numbers` says.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.compiled import limb_block_kernels, trunk_block_kernels
from posekit.compiled.block_kernels import (
    eliminate_coupled,
    solve_backward,
)
from posekit.compiled.frame_kernels import NUMBERS_AT
from posekit.compiled.limb_block_kernels import (
    limb_block,
    limb_room,
)
from posekit.compiled.limb_limit_kernels import BOX_ANGLES, FIRST_LEG
from posekit.compiled.posture_numbers import (
    AT_CAMERA,
    AT_DIRECTIONS,
    AT_LIMBS,
    AT_ROOT,
    CAMERA_PERSPECTIVE,
    HEAD_COUNT,
    LEGS_ON_TORSO,
    LIMB_ENDS,
    LIMB_MIDDLES,
    LIMB_STARTS,
    LIMIT_COUNT,
)
from posekit.compiled.trunk_block_kernels import (
    LIMB_COUNT,
    TO_SHAPE,
    TRUNK_POINTS,
    TURN_HIPS,
    TURN_TORSO,
    add_limb,
    curve,
    gather_trunk,
    head_block,
    joint_jacobian,
    place_trunk,
    trunk_block,
    trunk_room,
)
from posekit.geometry import Array

ANGLE_INFORMATION, PLACE_INFORMATION, MOST_TURN_INFORMATION, LEAST_LENGTH = 3.0 / math.pi**2, 1e-2, 0.5, 1e-12
"""As `posekit.refinement.covariance` has them: of what nothing is known, and of a turn that the image hardly shows."""


def tabulate_trunks(
    states: Array,
    data: Array,
    f: Array,
    apart: Array,
    floor: Any,
    matrix: Array,
    gradient: Array,
    head: Array,
) -> None:
    """Fill in matrices (N, C, C) and gradients (N, C) of trunks alone, and how heads follow (N, 3, 7)."""
    width = matrix.shape[1]
    room, offsets, J = trunk_room(), np.empty((6, 3)), np.empty((6, 3, width))
    P, g, moving = np.empty((6, 3, 3)), np.empty((6, 3)), np.empty((3, width))
    L, right, own, push = np.empty((6, 6)), np.empty((6, 7)), np.empty((6, 6)), np.empty(6)
    damped, column, nothing = np.empty(6), np.empty(3), np.zeros(LIMIT_COUNT, np.int8)
    for n in range(len(states)):
        s, d = states[n], data[n]
        place_trunk(s, offsets)
        joint_jacobian(s, offsets, J)
        trunk_block(s, d, f, apart, offsets, nothing, room, matrix[n], gradient[n], P, g)
        gather_trunk(J, P, g, matrix[n], gradient[n], moving)
        curve(offsets, g, matrix[n])
        if f[HEAD_COUNT] > 0.0:
            head_block(s, d, f, nothing, room, L, right, own, push)
            eliminate_coupled(L, right, 3, 0.0, floor, damped, own, push)
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

    Filled are what they add to matrix (4, M, C, C) and gradient (4, M, C), their own step (4, M, U) and how it follows
    the trunk's (4, M, U, C), tangents (4, M, 4, 3), and how many folds and limits there are (4, M, 2), -1 where a judge
    must be asked.
    """
    width, reach = matrix.shape[2], step.shape[2]
    room_of_limb, offsets, J, start = limb_room(), np.empty((6, 3)), np.empty((6, 3, width)), np.empty(3)
    L, right, own, push = np.empty((6, 6)), np.empty((6, 7)), np.empty((6, 6)), np.empty(6)
    damped, column, starts, carried = np.empty(6), np.empty(6), np.zeros((6, width)), np.empty((6, width))
    nothing = np.zeros(4, np.int8)
    W = np.empty((4, NUMBERS_AT + numbers.shape[1]))
    W[:, NUMBERS_AT:] = numbers
    for m in range(len(states)):
        s, d = states[m], data[m]
        place_trunk(s, offsets)
        joint_jacobian(s, offsets, J)
        for limb in range(LIMB_COUNT):
            joint = LIMB_STARTS[limb]
            turn = TURN_TORSO if limb < FIRST_LEG or f[LEGS_ON_TORSO] > 0.0 else TURN_HIPS
            for i in range(3):
                start[i] = s[AT_ROOT + i] + offsets[joint, i]
                for c in range(width):
                    starts[i, c] = J[joint, i, c]
                    starts[3 + i, c] = 1.0 if c == turn + i else 0.0
            folds = limb_block(
                s,
                d,
                f,
                limb,
                start,
                ends[limb],
                W[limb],
                nothing,
                room_of_limb,
                L,
                right,
                own,
                push,
                tangents[limb, m],
            )[2]
            counts[limb, m, 0], counts[limb, m, 1] = folds, 0
            if folds < 0:
                continue
            for k in range(BOX_ANGLES):
                counts[limb, m, 1] += room_of_limb[3][2, k] != 0.0
            eliminate_coupled(L, right, reach, 0.0, floor, damped, own, push)
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
                    if a == 6:
                        step[limb, m, k] = -column[k]
                        continue
                    for c in range(width):
                        slope[limb, m, k, c] -= column[k] * starts[a, c]


def know_turns(s: Array, d: Array, limb: Any, x: Array, tangents: Array, A: Array, matrix: Array) -> None:
    """Add what is known of turns that the image does not show, as `posekit.refinement.covariance` says.

    The limb's middle and end (2, 3), and how the image moves with them, as `limb_block` left it in its room (4, 3).
    """
    for segment in range(2):
        at, k = AT_DIRECTIONS + 6 * limb + 3 * segment, 2 * segment
        seen, first, second = 0.0, 0.0, 0.0
        for c in range(2):
            moved = 0.0
            for i in range(3):
                moved += A[2 * segment + c, i] * s[at + i]
            seen += moved * moved
        for i in range(3):
            ray = x[segment, i] if d[AT_CAMERA + CAMERA_PERSPECTIVE] > 0.0 else 1.0 if i == 2 else 0.0
            first += tangents[k, i] * ray
            second += tangents[k + 1, i] * ray
        size = max(math.sqrt(first * first + second * second), LEAST_LENGTH)
        known = MOST_TURN_INFORMATION * s[AT_LIMBS + 2 * limb + segment] * math.sqrt(seen) / (size * size)
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
    room_of_limb, room, offsets, start = limb_room(), trunk_room(), np.empty((6, 3)), np.empty(3)
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
        joint_jacobian(s, offsets, J)
        trunk_block(s, d, f, apart, offsets, nothing, room, M, gradient, P, g)
        for joint in range(TRUNK_POINTS):
            for i in range(3):
                joints[joint, i, n] = s[AT_ROOT + i] + offsets[joint, i]
        for limb in range(LIMB_COUNT):
            for i in range(3):
                start[i] = joints[LIMB_STARTS[limb], i, n]
            told = limb_block(
                s,
                d,
                f,
                limb,
                start,
                ends[limb],
                W[limb],
                nothing[:4],
                room_of_limb,
                L,
                along,
                own,
                push,
                tangents,
            )
            if told[2] < 0:
                asked[n] = True
                break
            for segment in range(2):
                length, at = s[AT_LIMBS + 2 * limb + segment], AT_DIRECTIONS + 6 * limb + 3 * segment
                for i in range(3):
                    x[segment, i] = (start[i] if segment == 0 else x[0, i]) + length * s[at + i]
                    joints[LIMB_MIDDLES[limb] if segment == 0 else LIMB_ENDS[limb], i, n] = x[segment, i]
                    for end in range(segment, 2):
                        levers[end, limb, i, 2 * segment, n] = length * tangents[2 * segment, i]
                        levers[end, limb, i, 2 * segment + 1, n] = length * tangents[2 * segment + 1, i]
                        if reach > 4:
                            levers[end, limb, i, 4 + segment, n] = length * s[at + i]
            know_turns(s, d, limb, x, tangents, room_of_limb[0], L)
            eliminate_coupled(L, along, reach, 0.0, floor, damped, own, push)
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
            eliminate_coupled(L, along, 3, 0.0, floor, damped, own, push)
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


KERNEL_PARTS = (trunk_block_kernels, limb_block_kernels)

COMPILED_TYPES = {
    "tabulate_trunks": (
        "(f8[:,::1], f8[:,::1], f8[::1], f8[:,:,::1], f8, f8[:,:,::1], f8[:,::1], f8[:,:,::1])"
    ),
    "tabulate_limbs": (
        "(f8[:,::1], f8[:,::1], f8[::1], f8[:,:,::1], f8[:,::1], f8, f8[:,:,:,::1], f8[:,:,::1], f8[:,:,::1],"
        " f8[:,:,:,::1], f8[:,:,:,::1], i8[:,:,::1])"
    ),
    "know_turns": "",
    "know_postures": (
        "(f8[:,::1], f8[:,::1], f8[::1], f8[:,:,::1], f8[:,:,::1], f8[:,::1], f8[:,:,::1], f8[:,:,:,::1],"
        " f8[:,:,:,::1], f8[:,:,:,::1], f8[:,:,:,:,::1], f8[:,:,::1], b1[::1])"
    ),
}
"""The kernels, in the order in which they need each other, with the types of those that are called."""
