"""Unit quaternions (..., 4) in Pinocchio's order x, y, z, w: q and -q are the same rotation."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from posekit.geometry.vectors import Array, cross


def quaternion_rotate(q: Array, vectors: Array) -> Array:
    """Rotate vectors (..., 3) by unit quaternions (..., 4): v + 2 w (u x v) + 2 u x (u x v), u the vector part."""
    axis, w = q[..., :3], q[..., 3:]
    twice = 2.0 * cross(axis, vectors)
    return np.asarray(vectors + w * twice + cross(axis, twice))


def median_lean(q: Array, up: Array, axis: ArrayLike = (0.0, 0.0, 1.0)) -> float:
    """Rotate an axis (3,) by unit quaternions (N, 4); return its median angle to the unit vector `up`, degrees."""
    turned = quaternion_rotate(q, np.tile(axis, (len(q), 1)))
    return float(np.degrees(np.arccos(np.clip(np.median(turned @ up), -1, 1))))


def quaternion_log(q: Array) -> Array:
    """Convert unit quaternions (..., 4) to rotation vectors (..., 3) with lengths of at most pi."""
    turned = shorter_quaternion(q)
    sine = np.linalg.norm(turned[..., :3], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, turned[..., 3:])  # well conditioned at all angles, unlike the arc cosine
    return np.asarray(turned[..., :3] * np.where(sine > 0, angle / np.where(sine > 0, sine, 1.0), 2.0))


def shorter_quaternion(q: Array) -> Array:
    """Return q or -q (..., 4), whichever has w >= 0 and therefore a rotation angle of at most pi."""
    return np.asarray(q * np.where(q[..., 3:] < 0, -1.0, 1.0))


def quaternion_from_rotation(R: Array, *, shorter: bool = True) -> Array:
    """Convert rotation matrices to unit quaternions.

    The entry with the largest absolute value is computed first, so that no divisor is small (Shepperd 1978, *Quaternion
    from rotation matrix*, J. Guidance and Control 1(3)).

    Parameters
    ----------
    R : array (..., 3, 3)
        Rotations.
    shorter : bool
        Whether the sign is chosen so that w >= 0; otherwise the entry of largest absolute value is positive.

    Returns
    -------
    array (..., 4)
    """
    xx, yy, zz = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    a, b, c = R[..., 1, 0] + R[..., 0, 1], R[..., 0, 2] + R[..., 2, 0], R[..., 2, 1] + R[..., 1, 2]
    u, v, w = R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]
    # Row i is 4 q_i q; its diagonal entry is 4 q_i^2.
    candidates = [
        [1 + xx - yy - zz, a, b, u],
        [a, 1 - xx + yy - zz, c, v],
        [b, c, 1 - xx - yy + zz, w],
        [u, v, w, 1 + xx + yy + zz],
    ]
    rows = np.stack([np.stack(row, axis=-1) for row in candidates], axis=-2)
    largest = np.argmax(np.einsum("...ii->...i", rows), axis=-1)
    q = np.take_along_axis(rows, largest[..., None, None], axis=-2)[..., 0, :]
    q = np.asarray(q / np.linalg.norm(q, axis=-1, keepdims=True))
    return shorter_quaternion(q) if shorter else q


def rotation_from_quaternion(q: Array) -> Array:
    """Convert unit quaternions (..., 4) to rotation matrices (..., 3, 3)."""
    x, y, z, w = np.moveaxis(np.asarray(q), -1, 0)
    entries = [
        *(1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        *(2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        *(2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    ]
    return np.stack(entries, axis=-1).reshape(*x.shape, 3, 3)
