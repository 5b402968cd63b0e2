"""The frames of torso, hips and head in a posture given by its points.

Each is a rotation R_cam_part whose columns are the part's URDF axes (x forward, y left, z up). The paper's
torso axes (y down, z left, x forward) are the same three directions, named otherwise.
"""

from __future__ import annotations

import numpy as np

from posekit.geometry import Array


def unit(vectors: Array) -> Array:
    """Scale vectors (..., 3) to length one; NaN for the zero vector."""
    length = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
    return vectors / np.where(length > 0, length, np.nan)[..., None]


def torso_frame(neck: Array, right_shoulder: Array, left_shoulder: Array, pelvis: Array) -> Array:
    """Return R_cam_torso (..., 3, 3), §3.1: down is neck to pelvis, left the shoulders' line square to it."""
    down = unit(pelvis - neck)
    across = left_shoulder - right_shoulder
    left = unit(across - np.einsum("...i,...i->...", across, down)[..., None] * down)
    return np.stack([cross(down, left), left, -down], axis=-1)


def hips_frame(pelvis: Array, right_hip: Array, left_hip: Array) -> Array:
    """Return R_cam_hips (..., 3, 3): left is the hips' line, down points from the pelvis square to it."""
    left = unit(left_hip - right_hip)
    drop = right_hip - pelvis
    down = unit(drop - np.einsum("...i,...i->...", drop, left)[..., None] * left)
    return np.stack([cross(down, left), left, -down], axis=-1)


def fit_rotation(body: Array, seen: Array) -> Array:
    r"""Return the rotation that turns rigid offsets into seen ones best.

    Minimises :math:`\sum_p |y_p - R x_p|^2` over rotations by the singular value decomposition of
    :math:`\sum_p y_p x_p^T` (Kabsch 1976; Umeyama 1991 for the sign).

    Parameters
    ----------
    body : array (P, 3)
        Offsets in the body's frame.
    seen : array (N, P, 3)
        The same in the camera frame.

    Returns
    -------
    array (N, 3, 3)
        NaN where a seen offset is NaN.
    """
    covariance = np.einsum("npi,pj->nij", seen, body)
    known = np.isfinite(covariance).all(axis=(1, 2))
    rotation = np.full(covariance.shape, np.nan)
    if known.any():
        U, _, Vt = np.linalg.svd(covariance[known])
        U[:, :, 2] *= np.sign(np.linalg.det(U @ Vt))[:, None]
        rotation[known] = U @ Vt
    return rotation


def cross(a: Array, b: Array) -> Array:
    """Return a x b for (..., 3), without the overhead of the general function."""
    return np.stack(
        [
            a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
            a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
            a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0],
        ],
        axis=-1,
    )


def quaternions(R: Array) -> Array:
    """Turn rotations (N, 3, 3) into unit quaternions (N, 4), order x, y, z, w, w >= 0.

    The largest of the four is found first, so that no root of a small number is divided by (Shepperd 1978).
    """
    xx, yy, zz = R[:, 0, 0], R[:, 1, 1], R[:, 2, 2]
    squares = np.stack([1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz, 1 + xx + yy + zz], axis=-1)
    a, b, c = R[:, 1, 0] + R[:, 0, 1], R[:, 0, 2] + R[:, 2, 0], R[:, 2, 1] + R[:, 1, 2]
    u, v, w = R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]
    rows = np.stack(
        [
            np.stack([squares[:, 0], a, b, u], axis=-1),
            np.stack([a, squares[:, 1], c, v], axis=-1),
            np.stack([b, c, squares[:, 2], w], axis=-1),
            np.stack([u, v, w, squares[:, 3]], axis=-1),
        ],
        axis=1,
    )
    largest = np.argmax(squares, axis=1)
    q = np.take_along_axis(rows, largest[:, None, None], axis=1)[:, 0]
    q = q / np.linalg.norm(q, axis=1, keepdims=True)
    return np.asarray(q * np.where(q[:, 3:] < 0, -1.0, 1.0))


def into(R: Array, vectors: Array) -> Array:
    """Express camera-frame vectors (N, 3) in the frames R_cam_part (N, 3, 3)."""
    return np.asarray(np.einsum("nji,nj->ni", R, vectors))


def transposed_product(R_a: Array, R_b: Array) -> Array:
    """Return R_a^T R_b for batches of rotations."""
    return np.asarray(np.einsum("nji,njk->nik", R_a, R_b))
