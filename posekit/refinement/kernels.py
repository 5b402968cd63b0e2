"""The arrow of small blocks as plain loops, for `posekit.tree.compiled`: posture by posture, in the arrays' order.

They do what `posekit.refinement.equations` and `posekit.refinement.covariance` do with arrays, sum by sum.
Every function here also runs as it is, slowly. The batch is the last axis.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array

TINY = 1e-300
"""Least pivot, as `posekit.refinement.small.TINY`."""


def factor(A: Array, k: int) -> None:
    """Factor a symmetric positive definite matrix (k, k), in place: L of L L' in the lower triangle."""
    for j in range(k):
        pivot = math.sqrt(max(A[j, j], TINY))
        A[j, j] = pivot
        for i in range(j + 1, k):
            A[i, j] /= pivot
        for i in range(j + 1, k):
            for c in range(j + 1, i + 1):
                A[i, c] -= A[i, j] * A[c, j]


def forth(L: Array, right: Array, k: int, m: int) -> None:
    """Solve L y = b for right sides (k, m), in place."""
    for j in range(k):
        pivot = L[j, j]
        for c in range(m):
            right[j, c] /= pivot
        for i in range(j + 1, k):
            share = L[i, j]
            for c in range(m):
                right[i, c] -= share * right[j, c]


def back(L: Array, right: Array, k: int, m: int) -> None:
    """Solve L' x = y for right sides (k, m), in place."""
    for j in range(k - 1, -1, -1):
        pivot = L[j, j]
        for c in range(m):
            right[j, c] /= pivot
        for i in range(j):
            share = L[j, i]
            for c in range(m):
                right[i, c] -= share * right[j, c]


def reduce(
    n: int,
    matrix: Array,
    coupling: Array,
    gradient: Array,
    damping: float,
    floor: float,
    L: Array,
    right: Array,
    damped: Array,
) -> None:
    """Eliminate a block of posture n, (k, k, N), (k, 6, N) and (k, N): `posekit.refinement.equations.eliminate`."""
    k = len(matrix)
    for i in range(k):
        for j in range(k):
            L[i, j] = matrix[i, j, n]
        for j in range(6):
            right[i, j] = coupling[i, j, n]
        right[i, 6] = gradient[i, n]
    for i in range(k):
        damped[i] = L[i, i] * damping + floor
        L[i, i] += damped[i]
    factor(L, k)
    forth(L, right, k, 7)


def gathered(  # noqa: PLR0912, PLR0915 - the sums of one posture, one after the other
    n: int,
    limbs: Array,
    couplings: Array,
    gradients: Array,
    starts: Array,
    pushes: Array,
    own: Array,
    own_gradient: Array,
    points: Array,
    pulls: Array,
    ways: Array,
    offsets: Array,
    turns: NDArray[np.int64],
    head: Array,
    head_coupling: Array,
    head_gradient: Array,
    head_trunk: Array,
    head_push: Array,
    damping: float,
    floor: float,
    L: Array,
    right: Array,
    damped: Array,
    head_L: Array,
    head_right: Array,
    head_damped: Array,
    W: Array,
    M: Array,
    g: Array,
) -> None:
    """Eliminate limbs and head of posture n: what remains of its trunk is (M, g); `assemble` with arrays.

    W (6, 3, C) becomes how the trunk's unknowns move its joints.
    """
    count, width = len(g), len(limbs)
    P, pull = np.empty((6, 3, 3)), np.empty((6, 3))
    left, push = np.zeros((4, 6, 6)), np.zeros((4, 6))
    for j in range(6):
        for i in range(3):
            pull[j, i] = pulls[j, i, n]
            for k in range(3):
                P[j, i, k] = points[j, i, k, n]
            for c in range(count):
                W[j, i, c] = ways[j, i, c, n]
    if width > 0:
        for limb in range(4):
            reduce(
                n,
                limbs[:, :, limb],
                couplings[:, :, limb],
                gradients[:, limb],
                damping,
                floor,
                L[limb],
                right[limb],
                damped[limb],
            )
            for i in range(6):
                total = 0.0
                for k in range(width):
                    total += right[limb, k, i] * right[limb, k, 6]
                push[limb, i] = pushes[i, limb, n] - total
                for j in range(6):
                    total = 0.0
                    for k in range(width):
                        total += right[limb, k, i] * right[limb, k, j]
                    left[limb, i, j] = starts[i, j, limb, n] - total
            joint = limb + 1 if limb < 2 else limb + 2
            for i in range(3):
                pull[joint, i] += push[limb, i]
                for k in range(3):
                    P[joint, i, k] += left[limb, i, k]
    for c in range(count):
        g[c] = 0.0
        for d in range(count):
            M[c, d] = 0.0
    row = np.empty(count)
    for j in range(6):
        for i in range(3):
            for d in range(count):
                row[d] = P[j, i, 0] * W[j, 0, d] + P[j, i, 1] * W[j, 1, d] + P[j, i, 2] * W[j, 2, d]
            for c in range(count):
                way = W[j, i, c]
                if way != 0.0:
                    for d in range(count):
                        M[c, d] += way * row[d]
                    g[c] += way * pull[j, i]
    for c in range(count):
        g[c] += own_gradient[c, n]
        for d in range(count):
            M[c, d] += own[c, d, n]
    arm, outer = np.empty(3), np.empty(3)
    for part in range(2):
        first, begin, end = (3, 1, 4) if part == 0 else (6, 4, 6)
        bent, sums = 0.0, np.zeros((3, 3))
        for j in range(begin, end):
            along, square = 0.0, 0.0
            for i in range(3):
                arm[i] = offsets[j, i, n] - (offsets[3, i, n] if part == 1 else 0.0)
                outer[i] = pull[j, i] + ((pull[4, i] + pull[5, i]) if j == 3 else 0.0)
                along += arm[i] * outer[i]
                square += arm[i] * arm[i]
            outward = max(-along, 0.0)
            share = outward / (square if square > 0.0 else 1.0)
            bent += outward
            for i in range(3):
                for k in range(3):
                    sums[i, k] += share * arm[i] * arm[k]
        for i in range(3):
            for k in range(3):
                M[first + i, first + k] -= sums[i, k]
            M[first + i, first + i] += bent
    if width > 0:
        for limb in range(4):
            turn = turns[limb]
            joint = limb + 1 if limb < 2 else limb + 2
            for i in range(3):
                g[turn + i] += push[limb, 3 + i]
                for k in range(3):
                    M[turn + i, turn + k] += left[limb, 3 + i, 3 + k]
            for i in range(3):
                for c in range(count):
                    row[c] = (
                        left[limb, 3 + i, 0] * W[joint, 0, c]
                        + left[limb, 3 + i, 1] * W[joint, 1, c]
                        + left[limb, 3 + i, 2] * W[joint, 2, c]
                    )
                for c in range(count):
                    M[turn + i, c] += row[c]
                for c in range(count):
                    M[c, turn + i] += row[c]
    if len(head) > 0:
        reduce(n, head, head_coupling, head_gradient, damping, floor, head_L, head_right, head_damped)
        for i in range(6):
            total = 0.0
            for k in range(3):
                total += head_right[k, i] * head_right[k, 6]
            g[i] += head_push[i, n] - total
            for j in range(6):
                total = 0.0
                for k in range(3):
                    total += head_right[k, i] * head_right[k, j]
                M[i, j] += head_trunk[i, j, n] - total


def followed(L: Array, right: Array, damped: Array, k: int, shift: Array, step: Array) -> float:
    """Let an eliminated block follow a shift (6,): its step (k, 1), and the decrease of chi2 that it promises."""
    gain = 0.0
    for i in range(k):
        total = 0.0
        for j in range(6):
            total += right[i, j] * shift[j]
        step[i, 0] = right[i, 6] + total
        gain += right[i, 6] * right[i, 6]
    back(L, step, k, 1)
    more = 0.0
    for i in range(k):
        step[i, 0] = -step[i, 0]
        more += damped[i] * step[i, 0] * step[i, 0]
    return gain + more


def steps(
    limbs: Array,
    couplings: Array,
    gradients: Array,
    starts: Array,
    pushes: Array,
    own: Array,
    own_gradient: Array,
    points: Array,
    pulls: Array,
    ways: Array,
    offsets: Array,
    turns: NDArray[np.int64],
    head: Array,
    head_coupling: Array,
    head_gradient: Array,
    head_trunk: Array,
    head_push: Array,
    damping: Array,
    floor: float,
    trunk_step: Array,
    limb_step: Array,
    head_step: Array,
    gain: Array,
) -> None:
    """Solve for the steps of all postures, and what they promise: `posekit.refinement.equations.solve`.

    Of the results, `trunk_step` is (C, N), `limb_step` (U, 4, N), `head_step` (3, N) and `gain` (N,).
    """
    count, width = len(own), len(limbs)
    L, right, damped = np.zeros((4, width, width)), np.zeros((4, width, 7)), np.zeros((4, width))
    head_L, head_right, head_damped = np.zeros((3, 3)), np.zeros((3, 7)), np.zeros(3)
    W, M, g = np.empty((6, 3, count)), np.empty((count, count)), np.empty(count)
    right_side, added = np.empty((count, 1)), np.empty(count)
    step, shift = np.empty((max(width, 3), 1)), np.empty(6)
    for n in range(own.shape[2]):
        gathered(
            n,
            limbs,
            couplings,
            gradients,
            starts,
            pushes,
            own,
            own_gradient,
            points,
            pulls,
            ways,
            offsets,
            turns,
            head,
            head_coupling,
            head_gradient,
            head_trunk,
            head_push,
            damping[n],
            floor,
            L,
            right,
            damped,
            head_L,
            head_right,
            head_damped,
            W,
            M,
            g,
        )
        for c in range(count):
            added[c] = M[c, c] * damping[n] + floor
            M[c, c] += added[c]
            right_side[c, 0] = g[c]
        factor(M, count)
        forth(M, right_side, count, 1)
        total = 0.0
        for c in range(count):
            total += right_side[c, 0] * right_side[c, 0]
        back(M, right_side, count, 1)
        more = 0.0
        for c in range(count):
            trunk_step[c, n] = -right_side[c, 0]
            more += added[c] * (right_side[c, 0] * right_side[c, 0])
        promised = total + more
        if width > 0:
            total = 0.0
            for limb in range(4):
                joint = limb + 1 if limb < 2 else limb + 2
                for i in range(3):
                    moving = 0.0
                    for c in range(count):
                        moving += W[joint, i, c] * trunk_step[c, n]
                    shift[i] = moving
                    shift[3 + i] = trunk_step[turns[limb] + i, n]
                total += followed(L[limb], right[limb], damped[limb], width, shift, step)
                for i in range(width):
                    limb_step[i, limb, n] = step[i, 0]
            promised += total
        if len(head) > 0:
            for i in range(6):
                shift[i] = trunk_step[i, n]
            promised += followed(head_L, head_right, head_damped, 3, shift, step)
            for i in range(3):
                head_step[i, n] = step[i, 0]
        gain[n] = promised


def spreads(  # noqa: PLR0912 - the same
    limbs: Array,
    couplings: Array,
    gradients: Array,
    starts: Array,
    pushes: Array,
    own: Array,
    own_gradient: Array,
    points: Array,
    pulls: Array,
    ways: Array,
    offsets: Array,
    turns: NDArray[np.int64],
    head: Array,
    head_coupling: Array,
    head_gradient: Array,
    head_trunk: Array,
    head_push: Array,
    priors: Array,
    floor: float,
    tangents: Array,
    directions: Array,
    lengths: Array,
    out: Array,
) -> None:
    """Write the covariance of every joint (N, 14, 3, 3): `posekit.refinement.covariance`.

    `priors` (C,) are added to the trunk's diagonal.
    """
    count, width = len(own), len(limbs)
    L, right, damped = np.zeros((4, width, width)), np.zeros((4, width, 7)), np.zeros((4, width))
    head_L, head_right, head_damped = np.zeros((3, 3)), np.zeros((3, 7)), np.zeros(3)
    W, M, g = np.empty((6, 3, count)), np.empty((count, count)), np.empty(count)
    joints, whitened = np.empty((count, 18)), np.empty((count, count))
    shift, slope, alone = np.empty((6, count)), np.empty((width, count)), np.empty((width, width))
    moving, apart, U = np.empty((3, count)), np.empty((3, width)), np.empty((3, width))
    for n in range(own.shape[2]):
        gathered(
            n,
            limbs,
            couplings,
            gradients,
            starts,
            pushes,
            own,
            own_gradient,
            points,
            pulls,
            ways,
            offsets,
            turns,
            head,
            head_coupling,
            head_gradient,
            head_trunk,
            head_push,
            0.0,
            floor,
            L,
            right,
            damped,
            head_L,
            head_right,
            head_damped,
            W,
            M,
            g,
        )
        for c in range(count):
            M[c, c] += priors[c]
            for j in range(6):
                for i in range(3):
                    joints[c, 3 * j + i] = W[j, i, c]
            for d in range(count):
                whitened[c, d] = 1.0 if c == d else 0.0
        factor(M, count)
        forth(M, joints, count, 18)
        back(M, whitened, count, count)
        for j in range(6):
            for i in range(3):
                for k in range(3):
                    total = 0.0
                    for c in range(count):
                        total += joints[c, 3 * j + i] * joints[c, 3 * j + k]
                    out[n, j, i, k] = total
        for limb in range(4):
            joint = limb + 1 if limb < 2 else limb + 2
            for i in range(3):
                for w in range(count):
                    shift[i, w] = 0.0
                    shift[3 + i, w] = whitened[turns[limb] + i, w]
                for c in range(count):
                    way = W[joint, i, c]
                    if way != 0.0:
                        for w in range(count):
                            shift[i, w] += way * whitened[c, w]
            for u in range(width):
                for w in range(count):
                    slope[u, w] = 0.0
                for i in range(6):
                    share = right[limb, u, i]
                    for w in range(count):
                        slope[u, w] += share * shift[i, w]
                for v in range(width):
                    alone[u, v] = 1.0 if u == v else 0.0
            back(L[limb], slope, width, count)
            back(L[limb], alone, width, width)
            for segment in range(2):
                for i in range(3):
                    for u in range(width):
                        U[i, u] = 0.0
                    for s in range(segment + 1):
                        length = lengths[limb, s, n]
                        U[i, 2 * s] = length * tangents[limb, s, 0, i, n]
                        U[i, 2 * s + 1] = length * tangents[limb, s, 1, i, n]
                        if width > 4:
                            U[i, 4 + s] = length * directions[limb, s, i, n]
                    for w in range(count):
                        moving[i, w] = 0.0
                    for w in range(width):
                        apart[i, w] = 0.0
                    for u in range(width):
                        share = U[i, u]
                        for w in range(count):
                            moving[i, w] -= share * slope[u, w]
                        for w in range(width):
                            apart[i, w] += share * alone[u, w]
                    for w in range(count):
                        moving[i, w] += shift[i, w]
                place = 6 + 2 * limb + segment
                for i in range(3):
                    for k in range(3):
                        total = 0.0
                        for w in range(count):
                            total += moving[i, w] * moving[k, w]
                        for w in range(width):
                            total += apart[i, w] * apart[k, w]
                        out[n, place, i, k] = total


_ARROW = (
    "f8[:, :, :, ::1], f8[:, :, :, ::1], f8[:, :, ::1], f8[:, :, :, ::1], f8[:, :, ::1], "
    "f8[:, :, ::1], f8[:, ::1], f8[:, :, :, ::1], f8[:, :, ::1], f8[:, :, :, ::1], f8[:, :, ::1], i8[::1], "
    "f8[:, :, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], "
)

COMPILED = {
    "factor": "",
    "forth": "",
    "back": "",
    "reduce": "",
    "gathered": "",
    "followed": "",
    "steps": f"({_ARROW}f8[::1], f8, f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[::1])",
    "spreads": f"({_ARROW}f8[::1], f8, f8[:, :, :, :, ::1], f8[:, :, :, ::1], f8[:, :, ::1], f8[:, :, :, ::1])",
}
"""The kernels, in the order in which they need each other, with the types they take."""
