"""Linear algebra of small matrices for a batch, the batch as the last axis."""

from __future__ import annotations

import numpy as np

from posekit.cameras import Array

TINY = 1e-300
"""Least pivot: a matrix that is positive but for rounding must not give NaN."""


def cholesky(matrix: Array) -> Array:
    """Factor symmetric positive definite matrices (k, k, ...): L (k, k, ...), lower, L L' = A; A is overwritten."""
    left = matrix
    for j in range(len(left)):
        pivot = np.sqrt(np.maximum(left[j, j], TINY))
        left[j, j] = pivot
        if j + 1 < len(left):
            column = left[j + 1 :, j]
            column /= pivot
            for i in range(len(column)):
                left[j + 1 + i, j + 1 : j + 2 + i] -= column[i] * column[: i + 1]
    return left


def forward(factor: Array, right: Array) -> Array:
    """Solve L y = b for right sides (k, m, ...), in place."""
    for j in range(len(factor)):
        right[j] /= factor[j, j]
        for i in range(j + 1, len(factor)):
            right[i] -= factor[i, j] * right[j]
    return right


def backward(factor: Array, right: Array) -> Array:
    """Solve L' x = y for right sides (k, m, ...), in place."""
    for j in range(len(factor) - 1, -1, -1):
        right[j] /= factor[j, j]
        for i in range(j):
            right[i] -= factor[j, i] * right[j]
    return right


def product(a: Array, b: Array) -> Array:
    """Multiply matrices (..., i, j, N) and (..., j, k, N)."""
    out: Array = a[..., :, 0, None, :] * b[..., None, 0, :, :]
    for j in range(1, a.shape[-2]):
        out += a[..., :, j, None, :] * b[..., None, j, :, :]
    return out


def turned(a: Array, vectors: Array) -> Array:
    """Multiply matrices (..., i, j, N) and vectors (..., j, N)."""
    out: Array = a[..., :, 0, :] * vectors[..., None, 0, :]
    for j in range(1, a.shape[-2]):
        out += a[..., :, j, :] * vectors[..., None, j, :]
    return out


def dot(a: Array, b: Array) -> Array:
    """Multiply vectors (..., 3, N)."""
    return np.asarray(a[..., 0, :] * b[..., 0, :] + a[..., 1, :] * b[..., 1, :] + a[..., 2, :] * b[..., 2, :])


def cross(a: Array, b: Array) -> Array:
    """Cross vectors (..., 3, N)."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.subtract(a[..., j, :] * b[..., k, :], a[..., k, :] * b[..., j, :], out=out[..., i, :])
    return out


def rotation(turn: Array) -> Array:
    r"""Return the rotations (3, 3, N) of rotation vectors (3, N): Rodrigues' formula, exact for small angles too."""
    square = dot(turn, turn)
    angle = np.sqrt(square)
    small = square < 1e-8
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 1.0 - square / 6.0, np.sin(safe) / safe)
    half = np.sin(0.5 * safe) / safe
    b = np.where(small, 0.5 - square / 24.0, 2.0 * half * half)
    x, y, z = turn
    out = b * turn[:, None] * turn[None, :]
    diagonal = 1.0 - b * square
    for i in range(3):
        out[i, i] += diagonal
    for i, j, w in ((0, 1, -z), (0, 2, y), (1, 2, -x)):
        out[i, j] += a * w
        out[j, i] -= a * w
    return out
