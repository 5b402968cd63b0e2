"""Covariances of joints as a plain loop over postures, for `posekit.refinement.covariance`, which has the formulas.

Arrays come as refinement has them, with the batch as their last axis; the small matrices of one posture then stay in a
core's cache, where NumPy goes through all postures once for each sum.
"""

from __future__ import annotations

import math

import numpy as np

from posekit.geometry import Array
from posekit.geometry.batch_last import MIN_PIVOT

TRUNK_COLUMNS, TURN_COLUMNS, FIRST_TURN = 18, 6, 3
"""Coordinates of the trunk's six joints; unknowns that turn torso and hips, and the first of them."""


def factor_trunk(matrix: Array, k: int, L: Array) -> None:
    """Write the Cholesky factor of posture k's matrix into the lower triangle of L."""
    width = len(L)
    for j in range(width):
        for i in range(j, width):
            total = matrix[i, j, k]
            for m in range(j):
                total -= L[i, m] * L[j, m]
            if i == j:
                L[j, j] = math.sqrt(max(total, MIN_PIVOT))
            else:
                L[i, j] = total / L[j, j]


def solve_rows(L: Array, rows: Array) -> None:
    """Replace each row r by the solution of L x = r."""
    width = len(L)
    for c in range(len(rows)):
        for i in range(width):
            total = rows[c, i]
            for m in range(i):
                total -= L[i, m] * rows[c, m]
            rows[c, i] = total / L[i, i]


def whiten(matrix: Array, jacobian: Array, k: int, L: Array, rows: Array) -> None:
    """Write down how the whitened trunk of posture k moves its joints (18, C), and turns its parts (6, C)."""
    factor_trunk(matrix, k, L)
    for m in range(len(L)):
        for c in range(TRUNK_COLUMNS):
            rows[c, m] = jacobian[c // 3, c % 3, m, k]
        for c in range(TURN_COLUMNS):
            rows[TRUNK_COLUMNS + c, m] = 1.0 if m == FIRST_TURN + c else 0.0
    solve_rows(L, rows)


def add_square(rows: Array, out: Array) -> None:
    """Add the scalar products of three rows with each other (3, 3)."""
    for i in range(3):
        for j in range(i + 1):
            total = 0.0
            for m in range(rows.shape[1]):
                total += rows[i, m] * rows[j, m]
            out[i, j] += total
            if j < i:
                out[j, i] += total


def follow_trunk(factor: Array, right: Array, limb: int, k: int, shift: Array, followed: Array) -> None:
    """Write down how a limb's unknowns follow the whitened trunk (u, w), and are free beside it (u, w to w + u)."""
    reach, width = len(followed), shift.shape[1]
    for u in range(reach):
        for m in range(width):
            total = 0.0
            for i in range(len(shift)):
                total -= right[u, i, limb, k] * shift[i, m]
            followed[u, m] = total
        for m in range(reach):
            followed[u, width + m] = 1.0 if u == m else 0.0
    for u in range(reach - 1, -1, -1):
        for v in range(u + 1, reach):
            share = factor[v, u, limb, k]
            for m in range(followed.shape[1]):
                followed[u, m] -= share * followed[v, m]
        pivot = factor[u, u, limb, k]
        for m in range(followed.shape[1]):
            followed[u, m] /= pivot


def joint_covariances(
    matrix: Array,
    jacobian: Array,
    turns: Array,
    factor: Array,
    right: Array,
    levers: Array,
    scaled: Array,
    out: Array,
) -> None:
    """Write the covariances of all joints.

    Parameters
    ----------
    matrix : array (C, C, N)
        The trunk's, limbs and head eliminated.
    jacobian : array (6, 3, C, N)
        How the trunk's unknowns move its joints.
    turns : array (4, 2)
        For each limb the trunk's joint from which it starts, and the first unknown that turns the part it is judged by.
    factor, right : array (U, U, 4, N), (U, 7, 4, N)
        The eliminated limbs (`posekit.refinement.equations.EliminatedBlock`).
    levers : array (2, 4, 3, U, N)
        How the limbs' unknowns move their middles and ends.
    scaled : array (15, 3, N)
        The joints' places, then the gain of a body's size; zeros where there is none.
    out : array (N, 14, 3, 3)
        To be written, in the order of trunk, then middle and end of each limb.
    """
    width, reach = len(matrix), len(factor)
    L = np.zeros((width, width))
    rows = np.empty((TRUNK_COLUMNS + TURN_COLUMNS, width))
    moved, shift, shrink = np.empty((3, width)), np.empty((6, width)), np.empty(width)
    followed, moving = np.empty((reach, width + reach)), np.empty((3, width + reach))
    for k in range(matrix.shape[2]):
        whiten(matrix, jacobian, k, L, rows)
        for m in range(width):
            shrink[m] = (
                rows[0, m] * scaled[14, 0, k] + rows[1, m] * scaled[14, 1, k] + rows[2, m] * scaled[14, 2, k]
            )
        out[k] = 0.0
        for joint in range(6):
            for i in range(3):
                for m in range(width):
                    moved[i, m] = rows[3 * joint + i, m] - scaled[joint, i, k] * shrink[m]
            add_square(moved, out[k, joint])
        for limb in range(4):
            start, turn = int(turns[limb, 0]), TRUNK_COLUMNS + int(turns[limb, 1]) - FIRST_TURN
            for i in range(3):
                for m in range(width):
                    shift[i, m], shift[3 + i, m] = rows[3 * start + i, m], rows[turn + i, m]
            follow_trunk(factor, right, limb, k, shift, followed)
            for segment in range(2):
                joint = 6 + 2 * limb + segment
                for i in range(3):
                    for m in range(width + reach):
                        total = shift[i, m] - scaled[joint, i, k] * shrink[m] if m < width else 0.0
                        for u in range(reach):
                            total += levers[segment, limb, i, u, k] * followed[u, m]
                        moving[i, m] = total
                add_square(moving, out[k, joint])


COMPILED_TYPES = {
    "factor_trunk": "",
    "solve_rows": "",
    "whiten": "",
    "add_square": "",
    "follow_trunk": "",
    "joint_covariances": (
        "(f8[:,:,::1], f8[:,:,:,::1], i8[:,::1], f8[:,:,:,::1], f8[:,:,:,::1], f8[:,:,:,:,::1], f8[:,:,::1],"
        " f8[:,:,:,::1])"
    ),
}
"""The kernels, in the order in which they need each other, with the types of those that are called."""
