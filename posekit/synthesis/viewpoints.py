"""Where a virtual camera stands and how it is turned."""

from __future__ import annotations

import numpy as np

from posekit.errors import InputError
from posekit.geometry import Array, cross, unit

MIN_SINE_TO_UP = 1e-6
"""Sine between line of sight and `up` below which no roll makes the camera upright."""


def look_at(position: Array, target: Array, up: Array) -> Array:
    """Turn cameras towards targets, upright.

    Parameters
    ----------
    position, target : array (..., 3)
        Optical centre and a point on the optical axis.
    up : array (..., 3)
        What shall point up in the image: y of OpenCV's frame points the other way. Where the camera looks
        along it, the world axis that is farthest from the line of sight takes its place.

    Returns
    -------
    array (..., 3, 3)
        R_cam_world: its rows are the camera's x, y, z in world coordinates.

    Raises
    ------
    InputError
        Where a position is its own target.
    """
    forward = unit(target - position)
    if np.isnan(forward).any():
        raise InputError("the camera stands where it shall look at; move it, or name another target")
    up = np.broadcast_to(up, forward.shape)
    # Looking along `up`, no roll is upright: any axis across the line of sight will do, the farthest one is safest.
    spare = np.eye(3)[np.argmin(np.abs(forward), axis=-1)]
    right = cross(forward, unit(up))
    upright = np.linalg.norm(right, axis=-1, keepdims=True) > MIN_SINE_TO_UP
    right = unit(np.where(upright, right, cross(forward, spare)))
    return np.stack([right, cross(forward, right), forward], axis=-2)


def uniform_directions(n: int, rng: np.random.Generator) -> Array:
    """Draw n unit vectors (n, 3), uniform on the sphere (Muller 1959: normalised Gaussians)."""
    return unit(rng.standard_normal((n, 3)))


def to_camera(points: Array, R_cam_world: Array, position: Array) -> Array:
    """Express world points (..., P, 3) in the camera frame: ``R (p - position)``."""
    points_cam: Array = np.einsum("...ij,...pj->...pi", R_cam_world, points - position[..., None, :])
    return points_cam
