"""From the camera's frame to a world that stands upright."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posekit.errors import ViewerError
from posekit.geometry import Array, cross

CAMERA_UPRIGHT: Array = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""R_world_cam of a camera that is held upright and level: it looks along the world's x, z is up."""

ANKLE_HEIGHT_METRES = 0.06
"""Metres from the lowest joint down to the ground: an ankle is not the sole."""


@dataclass(frozen=True, kw_only=True, eq=False)
class World:
    """The frame in which a scene is drawn: metres, z up, the ground at z = 0 below the postures.

    Parameters
    ----------
    R_world_cam : array (3, 3)
        Rotation from the view's camera frame into the world.
    t_world_cam : array (3,)
        ``p_world = R_world_cam p_cam + t_world_cam``.
    """

    R_world_cam: Array
    t_world_cam: Array

    def __post_init__(self) -> None:
        for name, shape in (("R_world_cam", (3, 3)), ("t_world_cam", (3,))):
            array = np.array(getattr(self, name), dtype=np.float64).reshape(shape)
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def place(self, points: Array) -> Array:
        """Take points (..., 3) from the camera's frame to the world's."""
        placed: Array = points @ self.R_world_cam.T + self.t_world_cam
        return placed

    @property
    def T_world_cam(self) -> Array:
        """The same as a homogeneous matrix (4, 4)."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.R_world_cam, self.t_world_cam
        return matrix

    def level_axes(self) -> tuple[Array, Array]:
        """Return where the view's camera looks and its right-hand side, both level (3,)."""
        forward = self.R_world_cam[:, 2] * [1.0, 1.0, 0.0]
        if (
            np.linalg.norm(forward) < 1e-3
        ):  # it looks straight down or up: what is above in its picture is ahead
            forward = -self.R_world_cam[:, 1] * [1.0, 1.0, 0.0]
        forward = forward / np.linalg.norm(forward)
        return forward, cross(forward, np.array([0.0, 0.0, 1.0]))


def upright_world(points: Array, R_cam_world: Array | None = None) -> World:
    """Stand the world upright around postures.

    Parameters
    ----------
    points : array (..., 3)
        All that is to be drawn, OpenCV camera frame, metres; NaN where unknown.
    R_cam_world : array (3, 3), optional
        The rotation of the view's camera, ``p_cam = R p_world + t``, from a world whose z is up. Without it
        the camera is taken to be held upright and level: a tilted camera then gives a tilted ground.

    Returns
    -------
    World
        Its origin is on the ground, below the middle of the points.

    Raises
    ------
    ViewerError
        Where no point is known.
    """
    known = points[np.isfinite(points).all(axis=-1)]
    if len(known) == 0:
        raise ViewerError("no joint of any posture is known (all are NaN); expected at least one to draw")
    R = CAMERA_UPRIGHT if R_cam_world is None else np.asarray(R_cam_world, dtype=np.float64).T
    turned = known @ R.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    middle = (low + high) / 2
    return World(R_world_cam=R, t_world_cam=-np.array([middle[0], middle[1], low[2] - ANKLE_HEIGHT_METRES]))
