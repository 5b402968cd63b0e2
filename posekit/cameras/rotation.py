"""Rotations as camera files spell them: rotation vectors, quaternions, matrices that were rounded."""

from __future__ import annotations

import numpy as np

from posekit.errors import CameraError
from posekit.geometry import Array

ROUNDED = 1e-3
"""How far R R^T may be from the identity, or a quaternion from unit length: what rounding to four digits costs."""


def cross_matrix(vector: Array) -> Array:
    """Return the matrix (3, 3) that takes p to ``vector x p``."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_from_vector(vector: Array) -> Array:
    r"""Turn a rotation vector (3,), axis times angle, into a matrix (3, 3).

    :math:`R = I + \sin\theta\,[a]_\times + (1 - \cos\theta)\,[a]_\times^2` (Rodrigues' formula, as OpenCV's
    `Rodrigues` has it).

    Raises
    ------
    CameraError
        Where the vector is not three finite numbers.
    """
    values = np.asarray(vector, dtype=np.float64)
    if values.size != 3 or not np.isfinite(values).all():
        raise CameraError(f"a rotation vector must be three finite numbers; got {values.tolist()}")
    angle = float(np.linalg.norm(values))
    # Near zero both quotients have their limits, 1 and 1/2: written so that nothing is divided by zero.
    K = cross_matrix(values.ravel())
    half = np.sinc(angle / 2 / np.pi)
    rotation: Array = np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * half * half * (K @ K)
    return rotation


def vector_from_rotation(R: Array) -> Array:
    """Turn a rotation matrix (3, 3) into its vector (3,), the angle from 0 to pi; by way of the quaternion."""
    trace = float(np.trace(R))
    # The four squares add up to one: dividing by the largest never divides by little (Shepperd 1978).
    squares = np.array([trace, R[0, 0], R[1, 1], R[2, 2]])
    largest = int(np.argmax(squares))
    if largest == 0:
        q = np.array([1 + trace, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    else:
        i = largest - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        q = np.empty(4)
        q[0] = R[k, j] - R[j, k]
        q[1 + i] = 1 + R[i, i] - R[j, j] - R[k, k]
        q[1 + j], q[1 + k] = R[j, i] + R[i, j], R[k, i] + R[i, k]
    q = q / np.linalg.norm(q)
    if q[0] < 0:
        q = -q
    sine = float(np.linalg.norm(q[1:]))
    if sine == 0:
        return np.zeros(3)
    angle = 2 * np.arctan2(sine, q[0])
    return np.asarray(q[1:] * (angle / sine))


def rotation_from_quaternion(q: Array) -> Array:
    """Turn a Hamilton quaternion w, x, y, z (4,) into a matrix (3, 3).

    Raises
    ------
    CameraError
        Where it is not of unit length, up to rounding.
    """
    norm = float(np.linalg.norm(q))
    if not abs(norm - 1) <= ROUNDED:
        raise CameraError(f"a quaternion must be of length 1; got {norm:g} for {np.asarray(q).tolist()}")
    w, x, y, z = np.asarray(q, dtype=np.float64) / norm
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def nearest_rotation(matrix: Array) -> Array:
    """Return the rotation nearest to a matrix (3, 3) that was rounded (Higham 1989: the polar factor).

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
    if not error <= ROUNDED:
        raise CameraError(f"R must be a rotation; R R^T is off the identity by {error:.2g}")
    u, _, vt = np.linalg.svd(R)
    nearest: Array = u @ vt
    if np.linalg.det(nearest) < 0:
        raise CameraError("R must be a rotation; its determinant is -1, so it mirrors")
    return nearest
