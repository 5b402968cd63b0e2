"""Linear algebra of small vectors and matrices with the batch as the last axis, along which NumPy is fastest."""

from __future__ import annotations

import numpy as np

from posekit.geometry.arrays import Array
from posekit.geometry.vectors import dot

MIN_PIVOT = 1e-300
"""Least pivot: a matrix that is positive but for rounding must not give NaN."""


def matrix_vector(a: Array, vectors: Array) -> Array:
    """Multiply matrices (..., i, j, N) and vectors (..., j, N)."""
    if max(a.shape[-1], vectors.shape[-1]) == 1:
        # Of a single column `einsum` would add up the terms in another order than of many.
        return np.asarray((a * vectors[..., None, :, :]).sum(axis=-2))
    return np.asarray(np.einsum("...ijn,...jn->...in", a, vectors))


def matrix_product(a: Array, b: Array) -> Array:
    """Multiply matrices (..., i, j, N) and (..., j, k, N)."""
    return np.asarray(np.einsum("...ijn,...jkn->...ikn", a, b))


def step_rotation(turn: Array) -> Array:
    r"""Return rotations (3, 3, N) about vectors (3, N), by their lengths to third order.

    The rotation of the quaternion :math:`(1, \omega / 2)`, whose angle is :math:`2 \arctan(|\omega| / 2)` (Cayley
    1846): a step of a search need be no exact exponential, and this one takes no sine.
    """
    half = 0.5 * turn
    squared = dot(half, half, axis=-2)
    scale = 2.0 / (1.0 + squared)
    x, y, z = half
    out = scale * half[:, None] * half[None, :]
    diagonal = 1.0 - scale * squared
    for i in range(3):
        out[i, i] += diagonal
    for i, j, w in ((0, 1, -z), (0, 2, y), (1, 2, -x)):
        sine = scale * w
        out[i, j] += sine
        out[j, i] -= sine
    return np.asarray(out)


def cholesky(matrix: Array) -> Array:
    """Factor symmetric positive definite matrices (k, k, ...), in place: L of L L' in the lower triangle."""
    for j in range(len(matrix)):
        pivot = np.sqrt(np.maximum(matrix[j, j], MIN_PIVOT))
        matrix[j, j] = pivot
        column = matrix[j + 1 :, j]
        column /= pivot
        for i in range(len(column)):
            matrix[j + 1 + i, j + 1 : j + 2 + i] -= column[i] * column[: i + 1]
    return matrix


def forward(factor: Array, right: Array) -> Array:
    """Solve L y = b for right sides (k, m, ...), in place."""
    for j in range(len(factor)):
        right[j] /= factor[j, j]
        if j + 1 < len(factor):
            right[j + 1 :] -= _each(factor[j + 1 :, j], right) * right[j]
    return right


def backward(factor: Array, right: Array) -> Array:
    """Solve L' x = y for right sides (k, m, ...), in place."""
    for j in range(len(factor) - 1, -1, -1):
        right[j] /= factor[j, j]
        if j:
            right[:j] -= _each(factor[j, :j], right) * right[j]
    return right


def _each(column: Array, right: Array) -> Array:
    """Let a column (k, ...) of a factor count for each of the right sides (k, m, ...), where there are several."""
    return column[:, None] if right.ndim > column.ndim else column
