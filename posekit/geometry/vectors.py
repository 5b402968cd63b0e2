"""Products of vectors, with the batch first, (..., 3), or last, (..., 3, N)."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry.arrays import Array

DOT_SUBSCRIPTS: Final = {-1: "...i,...i->...", -2: "...in,...in->...n"}
"""How `numpy.einsum` writes the dot product, by the axis of the components."""


def dot(a: Array, b: Array, *, axis: int = -1) -> Array:
    """Return the dot products of vectors.

    Parameters
    ----------
    a, b : array (..., K) or (..., K, N)
        Vectors of K components; leading axes broadcast.
    axis : int
        The axis of the components: -1, or -2 where the batch is last.

    Returns
    -------
    array (...) or (..., N)
    """
    if axis == -2 and max(a.shape[-1], b.shape[-1]) == 1:
        # Of a single column `einsum` would add up the terms in another order than of many.
        return np.asarray((a * b).sum(axis=-2))
    return np.asarray(np.einsum(DOT_SUBSCRIPTS[axis], a, b))


def cross(a: Array, b: Array, *, axis: int = -1) -> Array:
    """Return the cross products a x b, without the overhead of `numpy.cross`.

    Parameters
    ----------
    a, b : array (..., 3) or (..., 3, N)
        Vectors; leading axes broadcast.
    axis : int
        The axis of the components: -1, or -2 where the batch is last.

    Returns
    -------
    array (..., 3) or (..., 3, N)
    """
    if axis == -1:
        x, y, z = a[..., 0], a[..., 1], a[..., 2]
        u, v, w = b[..., 0], b[..., 1], b[..., 2]
    else:
        x, y, z = a[..., 0, :], a[..., 1, :], a[..., 2, :]
        u, v, w = b[..., 0, :], b[..., 1, :], b[..., 2, :]
    first, second, third = y * w, z * u, x * v
    # In place: for long batches memory, not arithmetic, takes the time.
    first -= z * v
    second -= x * w
    third -= y * u
    return np.stack([first, second, third], axis=axis)


def unit(vectors: Array, *, axis: int = -1) -> Array:
    """Scale vectors to length one.

    Parameters
    ----------
    vectors : array (..., K) or (..., K, N)
        Vectors of K components.
    axis : int
        The axis of the components: -1, or -2 where the batch is last.

    Returns
    -------
    array (..., K) or (..., K, N)
        Unit vectors; NaN for the zero vector, which has no direction.
    """
    length = np.sqrt(dot(vectors, vectors, axis=axis))
    known = np.where(length > 0, length, np.nan)
    # Indexed, since `numpy.expand_dims` takes longer than the division of short batches.
    return np.asarray(vectors / (known[..., None] if axis == -1 else known[..., None, :]))


def perpendicular(vectors: Array, axis_vectors: Array, *, axis: int = -1) -> Array:
    """Return what of vectors is square to unit vectors: v - (v . a) a.

    Parameters
    ----------
    vectors : array (..., 3) or (..., 3, N)
        The vectors v.
    axis_vectors : array (..., 3) or (..., 3, N)
        The unit vectors a.
    axis : int
        The axis of the components: -1, or -2 where the batch is last.

    Returns
    -------
    array (..., 3) or (..., 3, N)
    """
    along = np.expand_dims(dot(vectors, axis_vectors, axis=axis), axis)
    return np.asarray(vectors - along * axis_vectors)
