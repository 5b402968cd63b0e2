"""Rotation matrices (..., 3, 3) from axes, angles and rotation vectors, and the inverse conversions."""

from __future__ import annotations

import numpy as np

from posekit.geometry.quaternions import quaternion_from_rotation, quaternion_log
from posekit.geometry.vectors import Array, cross, dot


def cross_matrix(vectors: Array) -> Array:
    """Return the matrices (..., 3, 3) that map p to ``v x p``, for vectors v (..., 3)."""
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*x.shape, 3, 3)


def rotation_about(axis: Array, angle: Array) -> Array:
    r"""Return the rotations by angles about axes.

    :math:`R = I + \sin\theta\,[a]_\times + (1 - \cos\theta)\,[a]_\times^2` (Rodrigues 1840; Murray, Li and Sastry 1994,
    eq. 2.14).

    Parameters
    ----------
    axis : array (..., 3)
        Unit vectors.
    angle : array (...)
        Radians, by the right-hand rule.

    Returns
    -------
    array (..., 3, 3)
    """
    return _rodrigues(cross_matrix(axis), np.sin(angle), 1.0 - np.cos(angle))


def rotation_from_vector(vectors: Array) -> Array:
    """Return the rotations (..., 3, 3) of rotation vectors (..., 3), axis times angle in radians (Rodrigues 1840)."""
    angle = np.linalg.norm(vectors, axis=-1)
    # sin(angle) / angle, and (1 - cos(angle)) / angle^2 as half a square: no division by zero, no cancellation.
    half = np.sinc(angle / (2 * np.pi))
    return _rodrigues(cross_matrix(vectors), np.sinc(angle / np.pi), half * half / 2)


def vector_from_rotation(R: Array) -> Array:
    """Return the rotation vectors (..., 3), with lengths of at most pi, of rotations (..., 3, 3)."""
    return quaternion_log(quaternion_from_rotation(R))


def coordinate_rotation(axis: int, angle: Array) -> Array:
    """Return the rotations (..., 3, 3) by angles (...), radians, about coordinate axis 0, 1 or 2 (x, y, z)."""
    j, k = (axis + 1) % 3, (axis + 2) % 3
    angle = np.asarray(angle)
    R = np.zeros((*angle.shape, 3, 3))
    R[..., axis, axis] = 1.0
    R[..., j, j] = R[..., k, k] = np.cos(angle)
    R[..., k, j] = np.sin(angle)
    R[..., j, k] = -R[..., k, j]
    return R


def frame_along(axis: Array) -> Array:
    """Return rotations (..., 3, 3) whose first columns are given unit vectors (..., 3).

    The result is a continuous function of the given vector except where its z is 0 (Duff et al. 2017, *Building an
    Orthonormal Basis, Revisited*, JCGT 6(1), listing 3).
    """
    x, y, z = axis[..., 0], axis[..., 1], axis[..., 2]
    sign = np.where(z >= 0.0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    first = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=-1)
    second = np.stack([b, sign + y * y * a, -y], axis=-1)
    return np.stack([axis, first, second], axis=-1)


def rotation_between(start: Array, end: Array) -> Array:
    """Return the shortest rotations (..., 3, 3) from unit vectors `start` (..., 3) to unit vectors `end` (..., 3)."""
    axis = cross(start, end)
    sine = np.linalg.norm(axis, axis=-1)
    # Opposite vectors are joined by half a turn about any perpendicular axis.
    turning = axis / np.where(sine, sine, 1.0)[..., None]
    safe = np.where(sine[..., None] > 0.0, turning, frame_along(start)[..., 1])
    return rotation_about(safe, np.arctan2(sine, dot(start, end)))


def rotate_back(R: Array, vectors: Array) -> Array:
    """Return R^T v: convert vectors (N, 3) from the camera frame to the frames R_cam_part (N, 3, 3)."""
    return np.asarray(np.einsum("nji,nj->ni", R, vectors))


def relative_rotation(R_a: Array, R_b: Array) -> Array:
    """Return R_a_b = R_cam_a^T R_cam_b (N, 3, 3), the rotations of frames b relative to frames a."""
    return np.asarray(np.einsum("nji,njk->nik", R_a, R_b))


def turned_near(angles: Array, middle: Array | float, *, half_turn: float = np.pi) -> Array:
    """Add full turns so that each angle lies within half a turn of a given centre.

    Parameters
    ----------
    angles : array (...)
        Radians, or the unit of `half_turn`.
    middle : array (...) or float
        Centre of the returned interval; broadcast.
    half_turn : float
        Half a turn in the unit of the angles: pi for radians, 180 for degrees.

    Returns
    -------
    array (...)
        In [middle - half_turn, middle + half_turn).
    """
    # `floor` costs a fraction of `mod`.
    turns = np.floor((angles - middle + half_turn) / (2 * half_turn))
    return np.asarray(angles - 2 * half_turn * turns)


def _rodrigues(cross_matrices: Array, first: Array, second: Array) -> Array:
    """Return I + a K + b K^2 for cross-product matrices K and coefficients a (`first`) and b (`second`)."""
    square = cross_matrices @ cross_matrices
    return np.asarray(np.eye(3) + first[..., None, None] * cross_matrices + second[..., None, None] * square)
