"""Rotations as camera files spell them: rotation vectors, quaternions, matrices that were rounded."""

from __future__ import annotations

import numpy as np

from posekit.errors import CameraError
from posekit.geometry import Array, best_rotation, rotation_from_quaternion, rotation_from_vector

ROUNDING_OF_ROTATIONS = 1e-3
"""How far R R^T may be from the identity, or a quaternion from unit length: what rounding to four digits costs."""


def rotation_from_given_vector(vector: Array) -> Array:
    """Turn a rotation vector (3,), axis times angle as OpenCV's `Rodrigues` has it, into a matrix (3, 3).

    Raises
    ------
    CameraError
        Where the vector is not three finite numbers.
    """
    values = np.asarray(vector, dtype=np.float64)
    if values.size != 3 or not np.isfinite(values).all():
        raise CameraError(f"a rotation vector must be three finite numbers; got {values.tolist()}")
    return rotation_from_vector(values.ravel())


def rotation_from_wxyz(q: Array) -> Array:
    """Turn a Hamilton quaternion w, x, y, z (4,), the order of COLMAP's files, into a matrix (3, 3).

    Raises
    ------
    CameraError
        Where it is not of unit length, up to rounding.
    """
    norm = float(np.linalg.norm(q))
    if not abs(norm - 1) <= ROUNDING_OF_ROTATIONS:
        raise CameraError(f"a quaternion must be of length 1; got {norm:g} for {np.asarray(q).tolist()}")
    return rotation_from_quaternion(np.roll(np.asarray(q, dtype=np.float64) / norm, -1))


def rotation_from_rounded(matrix: Array) -> Array:
    """Return the rotation nearest to a matrix (3, 3) that was rounded.

    Raises
    ------
    CameraError
        Where it is no rotation even when rounding is allowed for, or mirrors.
    """
    R = np.asarray(matrix, dtype=np.float64)
    if R.shape != (3, 3) or not np.isfinite(R).all():
        raise CameraError(f"R must be a finite 3x3 matrix; got {R.tolist()}")
    with np.errstate(over="ignore", invalid="ignore"):
        error = float(np.abs(R @ R.T - np.eye(3)).max())
    if not error <= ROUNDING_OF_ROTATIONS:
        raise CameraError(f"R must be a rotation; R R^T is off the identity by {error:.2g}")
    rotation, values = best_rotation(R)
    if values[2] < 0:
        raise CameraError("R must be a rotation; its determinant is -1, so it mirrors")
    return rotation
