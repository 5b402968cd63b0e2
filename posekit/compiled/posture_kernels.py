"""The search for the likeliest posture as a plain loop over postures, for `posekit.refinement.descent`.

The equations are those of `posekit.refinement.equations`. One posture at a time: its small matrices stay in a core's
cache. Numbers of a posture stand where `posekit.compiled.posture_numbers` says.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.compiled import limb_block_kernels, limb_kernels, table_kernels
from posekit.compiled.block_kernels import (
    DIAGONAL_FLOOR,
    FIRST_DAMPING,
    GAIN_PRECISION,
    HOPELESS_CHI2,
    LIGHT_DAMPING,
    MOST_DAMPING,
    MOST_STEPS,
    damped_factor,
    eliminate_coupled,
    follow,
    next_damping,
    solve_backward,
    solve_forward,
)
from posekit.compiled.frame_kernels import NUMBERS_AT
from posekit.compiled.limb_block_kernels import (
    limb_block,
    limb_room,
    limb_value,
    move_limb,
    see,
)
from posekit.compiled.limb_limit_kernels import FIRST_LEG
from posekit.compiled.posture_numbers import (
    AT_HEAD,
    AT_HIPS,
    AT_ROOT,
    AT_SHAPE,
    AT_TORSO,
    HEAD_COUNT,
    HEAD_OFFSETS,
    HIP_LIMITS,
    LEGS_ON_TORSO,
    LIMB_STARTS,
    LIMIT_COUNT,
    LIMIT_SCALE,
    MIDDLE_PELVIS,
    NECK_BOX,
    NECK_LIMITS,
    PELVIS_BOX,
    ROOT_PRIOR,
    ROOT_WEIGHT,
    TRUNK_ONLY,
    VARIED_LIMBS,
    VARIED_SHAPE,
)
from posekit.compiled.trunk_block_kernels import (
    LIMB_COUNT,
    SPINE_WEIGHT,
    TO_SHAPE,
    TRUNK_POINTS,
    TURN_HIPS,
    TURN_TORSO,
    add_limb,
    ball,
    curve,
    distance,
    gather_trunk,
    head_block,
    joint_jacobian,
    place_trunk,
    spine_turn,
    trunk_block,
    trunk_room,
    turn_part,
)
from posekit.geometry import Array

BEYOND_COUNTING = 1e150
"""As `posekit.refinement.equations.MAX_CHI2`."""


def posture_value(
    s: Array,
    d: Array,
    f: Array,
    apart: Array,
    ends: Array,
    W: Array,
    offsets: Array,
    start: Array,
    room_of_limb: Any,
    room: Any,
    nothing: NDArray[np.int8],
    passed: NDArray[np.int8],
) -> Any:
    """Return the chi2 of a posture, and write down which limits (22,) it passes; NaN where a judge must be asked."""
    place_trunk(s, offsets)
    for k in range(LIMIT_COUNT):
        passed[k] = 0
    chi2 = 0.0
    r, A, o, J, x, _ = room
    for joint in range(TRUNK_POINTS):
        see(
            d,
            s[AT_ROOT] + offsets[joint, 0],
            s[AT_ROOT + 1] + offsets[joint, 1],
            s[AT_ROOT + 2] + offsets[joint, 2],
            joint,
            r,
            A,
        )
        chi2 += r[0] * r[0] + r[1] * r[1]
    for k in range(3):
        away = 0.0
        for i in range(3):
            away += d[ROOT_WEIGHT + 3 * k + i] * (s[AT_ROOT + i] - d[ROOT_PRIOR + i])
        chi2 += away * away
    squared = f[LIMIT_SCALE] * f[LIMIT_SCALE]
    if squared > 0.0:
        ball(s, AT_TORSO, AT_HIPS, f, PELVIS_BOX, nothing[:3], o, J)
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
            x[i] = s[AT_ROOT + i]
            for k in range(3):
                x[i] += s[AT_HEAD + 3 * i + k] * f[HEAD_OFFSETS + 3 * point + k]
        see(d, x[0], x[1], x[2], 14 + point, r, A)
        chi2 += r[0] * r[0] + r[1] * r[1]
    if f[HEAD_COUNT] > 0.0 and squared > 0.0:
        ball(s, AT_TORSO, AT_HEAD, f, NECK_BOX, nothing[:3], o, J)
        for k in range(3):
            chi2 += o[0, k] * o[0, k] * squared
            passed[NECK_LIMITS + k] = int(o[1, k])
    if f[TRUNK_ONLY] == 0.0:
        for limb in range(LIMB_COUNT):
            for i in range(3):
                start[i] = s[AT_ROOT + i] + offsets[LIMB_STARTS[limb], i]
            of_limb = limb_value(
                s,
                d,
                f,
                limb,
                start,
                ends[limb],
                W[limb],
                room_of_limb,
                nothing,
                passed[4 * limb : 4 * limb + 4],
            )
            if math.isnan(of_limb):
                return math.nan
            chi2 += of_limb
    return chi2 if chi2 < BEYOND_COUNTING else math.inf


def descend_postures(
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

    Filled are chi2 (N,), and the counts (N, 4): steps, whether it is settled, folds, limits that are felt. Where a
    judge must be asked, which is written down, they mean nothing.
    """
    whole, seen = f[TRUNK_ONLY] == 0.0, f[HEAD_COUNT] > 0.0
    width, reach = 18 if f[VARIED_SHAPE] > 0.0 else 9, 6 if f[VARIED_LIMBS] > 0.0 else 4
    room_of_limb, room, offsets, start = limb_room(), trunk_room(), np.empty((6, 3)), np.empty(3)
    matrix, gradient, J = np.empty((width, width)), np.empty(width), np.empty((6, 3, width))
    P, g, moving, shift = np.empty((6, 3, 3)), np.empty((6, 3)), np.empty((3, width)), np.empty(6)
    L, right = np.empty((5, 6, 6)), np.empty((5, 6, 7))
    own, push, tangents = np.empty((6, 6)), np.empty(6), np.empty((4, 4, 3))
    damped, last, last_damped, step = (
        np.empty((5, 6)),
        np.empty((width, 1)),
        np.empty(width),
        np.empty((5, 6)),
    )
    trunk_step = np.empty(width)
    watch, passed, nothing = (
        np.zeros(LIMIT_COUNT, np.int8),
        np.zeros(LIMIT_COUNT, np.int8),
        np.zeros(4, np.int8),
    )
    now, trial = np.empty(states.shape[1]), np.empty(states.shape[1])
    W = np.empty((4, NUMBERS_AT + numbers.shape[1]))
    W[:, NUMBERS_AT:] = numbers
    for n in range(len(states)):
        d = data[n]
        now[:] = states[n]
        trial[:] = now
        watch[:] = 0
        damping, watching, taken = h[FIRST_DAMPING], False, 0
        value = posture_value(now, d, f, apart, ends, W, offsets, start, room_of_limb, room, nothing, passed)
        if math.isnan(value):
            asked[n] = True
            continue
        active = 0
        for k in range(LIMIT_COUNT):
            active += passed[k] != 0
        for turn in range(int(h[MOST_STEPS]) + 1):
            place_trunk(now, offsets)
            joint_jacobian(now, offsets, J)
            slack = trunk_block(now, d, f, apart, offsets, watch, room, matrix, gradient, P, g)[1]
            folds, unclear = 0, False
            if whole:
                for limb in range(LIMB_COUNT):
                    for i in range(3):
                        start[i] = now[AT_ROOT + i] + offsets[LIMB_STARTS[limb], i]
                    _, more, bent = limb_block(
                        now,
                        d,
                        f,
                        limb,
                        start,
                        ends[limb],
                        W[limb],
                        watch[4 * limb : 4 * limb + 4],
                        room_of_limb,
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
                    eliminate_coupled(
                        L[limb], right[limb], reach, damping, h[DIAGONAL_FLOOR], damped[limb], own, push
                    )
                    of_torso = limb < FIRST_LEG or f[LEGS_ON_TORSO] > 0.0
                    add_limb(
                        limb, TURN_TORSO if of_torso else TURN_HIPS, J, own, push, P, g, matrix, gradient
                    )
            if unclear:
                asked[n] = True
                break
            gather_trunk(J, P, g, matrix, gradient, moving)
            curve(offsets, g, matrix)
            if seen:
                slack += head_block(now, d, f, watch, room, L[4], right[4], own, push)[1]
                eliminate_coupled(L[4], right[4], 3, damping, h[DIAGONAL_FLOOR], damped[4], own, push)
                for a in range(6):
                    gradient[a] += push[a]
                    for b in range(6):
                        matrix[a, b] += own[a, b]
            damped_factor(matrix, width, damping, h[DIAGONAL_FLOOR], last_damped)
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
                            shift[i] += J[LIMB_STARTS[limb], i, c] * trunk_step[c]
                    gain += follow(L[limb], right[limb], reach, shift, damped[limb], step[limb])
            if seen:
                for i in range(6):
                    shift[i] = trunk_step[i]
                gain += follow(L[4], right[4], 3, shift, damped[4], step[4])
            settled = damping > h[MOST_DAMPING] or (
                gain <= h[GAIN_PRECISION] and (damping <= h[LIGHT_DAMPING] or watching)
            )
            counts[n, 1], counts[n, 2] = settled, folds
            given_up = not value < math.inf or (
                value > h[HOPELESS_CHI2] and gain < 0.5 * value and not watching
            )
            if settled or given_up or turn == int(h[MOST_STEPS]):
                break
            for i in range(3):
                trial[AT_ROOT + i] = now[AT_ROOT + i] + trunk_step[i]
            turn_part(now, AT_TORSO, trunk_step[3], trunk_step[4], trunk_step[5], trial)
            turn_part(now, AT_HIPS, trunk_step[6], trunk_step[7], trunk_step[8], trial)
            if seen:
                turn_part(now, AT_HEAD, step[4, 0], step[4, 1], step[4, 2], trial)
            for c in range(TO_SHAPE, width):
                trial[AT_SHAPE + c - TO_SHAPE] = now[AT_SHAPE + c - TO_SHAPE] + trunk_step[c]
            if whole:
                for limb in range(LIMB_COUNT):
                    move_limb(now, limb, step[limb], tangents[limb], reach, trial)
            new = posture_value(
                trial, d, f, apart, ends, W, offsets, start, room_of_limb, room, nothing, passed
            )
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
    room_of_limb, room, offsets, start = limb_room(), trunk_room(), np.empty((6, 3)), np.empty(3)
    passed, nothing = np.zeros(LIMIT_COUNT, np.int8), np.zeros(4, np.int8)
    W = np.empty((4, NUMBERS_AT + numbers.shape[1]))
    W[:, NUMBERS_AT:] = numbers
    for n in range(len(states)):
        chi2[n] = posture_value(
            states[n], data[n], f, apart, ends, W, offsets, start, room_of_limb, room, nothing, passed
        )


def value_limbs(
    states: Array, data: Array, f: Array, starts: Array, ends: Array, numbers: Array, chi2: Array
) -> None:
    """Fill in chi2 (M, 4) of limbs from their starts (M, 4, 3); NaN where a judge must be asked."""
    room_of_limb, passed, nothing = limb_room(), np.zeros(4, np.int8), np.zeros(4, np.int8)
    W = np.empty((4, NUMBERS_AT + numbers.shape[1]))
    W[:, NUMBERS_AT:] = numbers
    for m in range(len(states)):
        for limb in range(LIMB_COUNT):
            chi2[m, limb] = limb_value(
                states[m],
                data[m],
                f,
                limb,
                starts[m, limb],
                ends[limb],
                W[limb],
                room_of_limb,
                nothing,
                passed,
            )


KERNEL_PARTS = (table_kernels,)

COMPILED_TYPES = {
    "posture_value": "",
    "fit_limbs": limb_block_kernels.COMPILED_TYPES["fit_limbs"],
    "descend_postures": (
        "(f8[:,::1], f8[:,::1], f8[::1], f8[:,:,::1], f8[:,:,::1], f8[:,::1], f8[::1], f8[::1], i8[:,::1], b1[::1])"
    ),
    "value_postures": "(f8[:,::1], f8[:,::1], f8[::1], f8[:,:,::1], f8[:,:,::1], f8[:,::1], f8[::1])",
    "value_limbs": "(f8[:,::1], f8[:,::1], f8[::1], f8[:,:,::1], f8[:,:,::1], f8[:,::1], f8[:,::1])",
    "limbs_beyond": limb_kernels.COMPILED_TYPES["limbs_beyond"],
    **table_kernels.COMPILED_TYPES,
}
"""The kernels, in the order in which they need each other, with the types of those that are called."""
