"""Linear algebra of small vectors and matrices for a batch, the batch as the last axis."""

from __future__ import annotations

import numpy as np

from posekit.geometry import Array

MIN_PIVOT = 1e-300
"""Least pivot: a matrix that is positive but for rounding must not give NaN."""


def dot(a: Array, b: Array) -> Array:
    """Multiply vectors (..., k, N): (..., N)."""
    return np.asarray(np.einsum("...in,...in->...n", a, b))


def turned(a: Array, vectors: Array) -> Array:
    """Multiply matrices (..., i, j, N) and vectors (..., j, N)."""
    return np.asarray(np.einsum("...ijn,...jn->...in", a, vectors))


def product(a: Array, b: Array) -> Array:
    """Multiply matrices (..., i, j, N) and (..., j, k, N)."""
    return np.asarray(np.einsum("...ijn,...jkn->...ikn", a, b))


def cross(a: Array, b: Array) -> Array:
    """Cross vectors (..., 3, N)."""
    twice_a = np.concatenate([a, a[..., :2, :]], axis=-2)
    twice_b = np.concatenate([b, b[..., :2, :]], axis=-2)
    out = twice_a[..., 1:4, :] * twice_b[..., 2:5, :]
    out -= twice_a[..., 2:5, :] * twice_b[..., 1:4, :]
    return np.asarray(out)


def unit(vectors: Array) -> Array:
    """Scale vectors (..., 3, N) to length one."""
    return np.asarray(vectors / np.sqrt(dot(vectors, vectors))[..., None, :])


def rotation(turn: Array) -> Array:
    r"""Return rotations (3, 3, N) about vectors (3, N), by their lengths to third order.

    The rotation of the quaternion :math:`(1, \omega / 2)`, whose angle is :math:`2 \arctan(|\omega| / 2)`: a step of
    the search need be no exact exponential.
    """
    half = 0.5 * turn
    scale = 2.0 / (1.0 + dot(half, half))
    x, y, z = half
    out = scale * half[:, None] * half[None, :]
    diagonal = 1.0 - scale * dot(half, half)
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
