"""Unit quaternions (..., 4) in Pinocchio's order x, y, z, w: q and -q are the same rotation."""

from __future__ import annotations

import numpy as np

from posekit.geometry.arrays import Array
from posekit.geometry.vectors import cross, dot


def quaternion_product(a: Array, b: Array) -> Array:
    """Return the Hamilton products (..., 4) of quaternions (..., 4): the rotation b, then a."""
    vector = a[..., 3:] * b[..., :3] + b[..., 3:] * a[..., :3] + cross(a[..., :3], b[..., :3])
    scalar = a[..., 3:] * b[..., 3:] - dot(a[..., :3], b[..., :3])[..., None]
    return np.concatenate([vector, scalar], axis=-1)


def quaternion_conjugate(q: Array) -> Array:
    """Return the quaternions (..., 4) of the rotations back."""
    return np.asarray(q * np.array([-1.0, -1.0, -1.0, 1.0]))


def quaternion_rotate(q: Array, vectors: Array) -> Array:
    """Rotate vectors (..., 3) by unit quaternions (..., 4): v + 2 w (u x v) + 2 u x (u x v), u the vector part."""
    axis, w = q[..., :3], q[..., 3:]
    twice = 2.0 * cross(axis, vectors)
    return np.asarray(vectors + w * twice + cross(axis, twice))


def quaternion_exp(vectors: Array) -> Array:
    """Turn rotation vectors (..., 3), axis times angle in radians, into unit quaternions (..., 4)."""
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    half = np.sinc(angle / (2 * np.pi)) / 2  # sin(angle / 2) / angle, which at zero is one half
    return np.concatenate([half * vectors, np.cos(angle / 2)], axis=-1)


def quaternion_log(q: Array) -> Array:
    """Turn unit quaternions (..., 4) into rotation vectors (..., 3) no longer than pi."""
    turned = shorter_quaternion(q)
    sine = np.linalg.norm(turned[..., :3], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, turned[..., 3:])  # well conditioned at all angles, as the arc cosine is not
    return np.asarray(turned[..., :3] * np.where(sine > 0, angle / np.where(sine > 0, sine, 1.0), 2.0))


def shorter_quaternion(q: Array) -> Array:
    """Return of q and -q (..., 4) the one with w >= 0, whose angle is no more than half a turn."""
    return np.asarray(q * np.where(q[..., 3:] < 0, -1.0, 1.0))


def quaternion_from_rotation(R: Array, *, shorter: bool = True) -> Array:
    """Turn rotations into unit quaternions.

    The squares of the four entries add up to one: the largest is found first, so that no root of a small number is
    divided by (Shepperd 1978, *Quaternion from rotation matrix*, J. Guidance and Control 1(3)).

    Parameters
    ----------
    R : array (..., 3, 3)
        Rotations.
    shorter : bool
        Take of q and -q the one with w >= 0; else the one whose largest entry is positive.

    Returns
    -------
    array (..., 4)
    """
    xx, yy, zz = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    a, b, c = R[..., 1, 0] + R[..., 0, 1], R[..., 0, 2] + R[..., 2, 0], R[..., 2, 1] + R[..., 1, 2]
    u, v, w = R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]
    # Each row is the quaternion times four of its own entries, of which the diagonal has the square.
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


def rotation_from_quaternion(q: Array, *, axis: int = -1) -> Array:
    """Turn unit quaternions into rotations.

    Parameters
    ----------
    q : array (..., 4) or (4, N)
        Unit quaternions.
    axis : int
        The axis of the four entries: -1, or 0 where the batch is last.

    Returns
    -------
    array (..., 3, 3) or (3, 3, N)
    """
    x, y, z, w = np.moveaxis(q, axis, 0)
    entries = [
        *(1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        *(2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        *(2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    ]
    shape = (3, 3, *x.shape) if axis == 0 else (*x.shape, 3, 3)
    return np.stack(entries, axis=axis).reshape(shape)
