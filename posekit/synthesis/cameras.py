"""Virtual cameras: positions and rotations, and the test whether a body is inside a picture."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.cameras import PinholeCamera
from posekit.errors import refusal
from posekit.geometry import Array, Flags, Ints, cross, unit

#: Sine between optical axis and `up`, below which no roll makes the camera upright.
MIN_SINE_TO_UP: Final = 1e-6

#: Largest number of draws for one camera; after that distance and focal length are refused.
MAX_DRAWS: Final = 200

#: Default range of distances from the optical centre to the middle of the body, metres.
DISTANCE_RANGE: Final = (2.5, 6.0)


def default_camera() -> PinholeCamera:
    """Return the default camera: f = 1500 pixels, 1920 x 1080, principal point in the middle."""
    return PinholeCamera(K=np.array([[1500.0, 0, 960], [0, 1500, 540], [0, 0, 1]]), size=(1920, 1080))


def look_at(position: Array, target: Array, up: Array) -> Array:
    """Return the rotations of upright cameras that look at targets.

    Parameters
    ----------
    position, target : array (..., 3)
        Optical centre and a point on the optical axis, world frame.
    up : array (3,)
        World direction that points up in the image, i.e. along -y of OpenCV's camera frame. If the camera looks along
        `up`, the world axis with the largest angle to the optical axis replaces `up`.

    Returns
    -------
    array (..., 3, 3)
        R_cam_world, whose rows are the camera's axes x, y, z in world coordinates.

    Raises
    ------
    InputError
        If a position equals its target.
    """
    forward = unit(target - position)
    if np.isnan(forward).any():
        raise refusal("", "camera", "a position equal to its target", "two points", "move one of them")
    # If the camera looks along `up`, no roll is upright, so the axis farthest from the line of sight is used.
    spare = np.eye(3)[np.argmin(np.abs(forward), axis=-1)]
    right = cross(forward, unit(np.broadcast_to(up, forward.shape)))
    upright = np.linalg.norm(right, axis=-1, keepdims=True) > MIN_SINE_TO_UP
    right = unit(np.where(upright, right, cross(forward, spare)))
    return np.stack([right, cross(forward, right), forward], axis=-2)


def to_camera(points: Array, R_cam_world: Array, position: Array) -> Array:
    """Transform world points (..., P, 3) to the camera frame: ``R (p - position)``."""
    return np.asarray(np.einsum("...ij,...pj->...pi", R_cam_world, points - position[..., None, :]))


def in_picture(camera: PinholeCamera, points_cam: Array) -> Flags:
    """Return whether each body (N, P, 3), in the camera frame, is in front of the camera and inside its picture (N,).

    NaN points are ignored.
    """
    pixels = camera.project(points_cam)
    inside = ((pixels >= 0) & (pixels <= np.array(camera.size))).all(axis=-1)
    return np.asarray((inside | np.isnan(points_cam[..., 2])).all(axis=1))


def middle_of(points: Array) -> Array:
    """Return the centre (..., 3) of the bounding box of points (..., P, 3); NaN points are ignored."""
    return np.asarray((np.nanmin(points, axis=-2) + np.nanmax(points, axis=-2)) / 2)


def place_cameras(
    points: Array,
    up: Array,
    rng: np.random.Generator,
    *,
    camera: PinholeCamera | None = None,
    distance: tuple[float, float] = DISTANCE_RANGE,
) -> tuple[Array, Array]:
    """Draw a random camera for each of N bodies, such that the whole body is in front of it and inside the picture.

    Directions from body to camera are uniform on the sphere (Muller 1959), and distances are uniform in `distance`.
    Each camera is upright and looks at the middle of the body's bounding box.

    Parameters
    ----------
    points : array (N, P, 3)
        Points of each body, world frame, metres; NaN is ignored. For one camera of many frames, N is 1, and P counts
        the points of all frames.
    up : array (3,)
        Up direction of the world.
    rng : Generator
        Random number generator.
    camera : PinholeCamera, optional
        Intrinsics and picture size; `default_camera` if not given.
    distance : (float, float)
        Range of distances from the middle of the body, metres.

    Returns
    -------
    R_cam_world : array (N, 3, 3)
    position : array (N, 3)
        Optical centres, world frame, metres.

    Raises
    ------
    InputError
        If the distances are impossible, or if after `MAX_DRAWS` draws a body is still outside its picture.
    """
    camera = camera or default_camera()
    near, far = distance
    if not 0 < near <= far < np.inf:
        raise refusal("", "distance", f"{near:g} to {far:g} m", "two positive distances, the smaller first")
    middle = middle_of(points)
    R, position = np.empty((len(points), 3, 3)), np.empty((len(points), 3))
    rows: Ints = np.arange(len(points))
    for _ in range(MAX_DRAWS):
        away = rng.uniform(near, far, len(rows))
        position[rows] = middle[rows] + away[:, None] * unit(rng.standard_normal((len(rows), 3)))
        R[rows] = look_at(position[rows], middle[rows], up)
        rows = rows[~in_picture(camera, to_camera(points[rows], R[rows], position[rows]))]
        if len(rows) == 0:
            return R, position
    seen = f"body {rows[0]} outside the picture from {near:g} to {far:g} m in {MAX_DRAWS} draws"
    raise refusal("", "camera", seen, "the whole body in view", "take a larger distance or a shorter f")
