"""Vectors of many postures with the postures last, (3, N): NumPy is fastest along the last axis."""

from __future__ import annotations

import numpy as np

from posekit.geometry import Array


def dot(a: Array, b: Array) -> Array:
    """Return a . b (N,) of two sets of vectors (3, N), or of one (3, 1)."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def cross(a: Array, b: Array) -> Array:
    """Return a x b (3, N)."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def unit(vectors: Array) -> Array:
    """Scale vectors (3, N) to length one; NaN for the zero vector."""
    squared = dot(vectors, vectors)
    return np.asarray(vectors / np.sqrt(np.where(squared > 0, squared, np.nan)))


def across(vectors: Array, axis: Array) -> Array:
    """Return what of vectors (3, N) is square to a unit axis (3, N)."""
    return np.asarray(vectors - dot(vectors, axis) * axis)
