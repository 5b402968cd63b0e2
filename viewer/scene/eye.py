"""Where a picture is taken from: a free pose, or exactly the view's own camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from posekit.errors import ViewerError
from posekit.geometry import Array, cross
from posekit.viewer.scene.world import World

NEAR_METRES, FAR_METRES = 0.01, 1000.0
"""Metres in front of the camera between which things are drawn."""

RELATIVE_REACH_METRES = 100.0
"""Metres before and behind the origin between which things are drawn where depth is relative."""

OPENGL_FACING: Array = np.diag([1.0, -1.0, -1.0])
"""From OpenCV's camera axes (y down, z forward) to OpenGL's (y up, z backward), and back."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Eye:
    """A free pose: from `position` one looks at `target`, upright.

    Parameters
    ----------
    position, target : array (3,)
        World, metres, z up.
    fov : float
        Vertical field of view, degrees.
    """

    position: Array
    target: Array
    fov: float = 35.0

    def __post_init__(self) -> None:
        for name in ("position", "target"):
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.shape != (3,) or not np.isfinite(array).all():
                raise ViewerError(
                    f"the camera's {name} is {array.tolist()}; expected three finite numbers, metres"
                )
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if not 0 < self.fov < 180:
            raise ViewerError(f"the field of view is {self.fov:g} degrees; expected one between 0 and 180")
        if np.linalg.norm(self.position - self.target) < 1e-6:
            raise ViewerError("the camera stands on what it looks at; move its position away")

    def json(self) -> dict[str, Any]:
        """Return it as ``player.js`` takes it."""
        return {"position": self.position.tolist(), "target": self.target.tolist(), "fov": self.fov}

    def turned(self, degrees: float) -> Eye:
        """Return the pose after a turn about the vertical through the target."""
        angle = np.radians(degrees)
        c, s = np.cos(angle), np.sin(angle)
        R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return Eye(position=self.target + R @ (self.position - self.target), target=self.target, fov=self.fov)

    def matrices(self, width: int, height: int) -> tuple[Array, Array]:
        """Return the pose in the world and the clip matrix, (4, 4) both."""
        back = self.position - self.target
        back = back / np.linalg.norm(back)
        right = cross(np.array([0.0, 0.0, 1.0]), back)
        if np.linalg.norm(right) < 1e-9:  # from right above or below, the world's x is up
            right = np.array([0.0, -1.0, 0.0])
        right = right / np.linalg.norm(right)
        pose = np.eye(4)
        pose[:3, :3] = np.stack([right, cross(back, right), back], axis=1)
        pose[:3, 3] = self.position
        f = height / 2 / np.tan(np.radians(self.fov) / 2)
        K = np.array([[f, 0.0, width / 2], [0.0, f, height / 2], [0.0, 0.0, 1.0]])
        return pose, clip_matrix(K, width, height)


@dataclass(frozen=True, kw_only=True, eq=False)
class ViewEye:
    """The view's own pinhole camera: the picture is what that camera sees (without its distortion).

    Parameters
    ----------
    K : array (3, 3)
        Intrinsics in pixels of the picture, whose first pixel is centred on (0, 0).
    world : World
        Where the view's camera stands.
    """

    K: Array
    world: World

    def matrices(self, width: int, height: int) -> tuple[Array, Array]:
        """Return the pose in the world and the clip matrix, (4, 4) both."""
        pose = self.world.T_world_cam
        pose[:3, :3] = pose[:3, :3] @ OPENGL_FACING
        K = np.array(self.K, dtype=np.float64)
        K[:2, 2] += 0.5  # to the picture's corner from the middle of its first pixel
        return pose, clip_matrix(K, width, height)


@dataclass(frozen=True, kw_only=True, eq=False)
class ParallelEye:
    r"""The camera of an uncalibrated view: :math:`u = a\,x + c_u`, :math:`v = b\,y + c_v`, whatever the depth.

    Parameters
    ----------
    scale : array (2,)
        a and b, pixels of the picture a metre.
    centre : array (2,)
        Where the origin of the camera's frame is seen, in pixels of the picture, whose first pixel is centred on
        (0, 0).
    world : World
        Where the view's camera stands.
    """

    scale: Array
    centre: Array
    world: World

    def matrices(self, width: int, height: int) -> tuple[Array, Array]:
        """Return the pose in the world and the clip matrix, (4, 4) both."""
        pose = self.world.T_world_cam
        pose[:3, :3] = pose[:3, :3] @ OPENGL_FACING
        (a, b), (u, v) = np.asarray(self.scale), np.asarray(self.centre) + 0.5
        clip = np.zeros((4, 4))
        clip[0, [0, 3]] = 2 * a / width, 2 * u / width - 1
        clip[1, [1, 3]] = 2 * b / height, 1 - 2 * v / height
        clip[2, 2], clip[3, 3] = -1 / RELATIVE_REACH_METRES, 1.0
        return pose, clip


CameraEye = ViewEye | ParallelEye
"""The camera of a view, whichever it is."""


def clip_matrix(K: ArrayLike, width: int, height: int) -> Array:
    r"""Return OpenGL's clip matrix (4, 4) of a camera with intrinsics K, counted from the picture's corner.

    With :math:`u = f_x x / z + s y / z + c_x` in ``[0, width]`` going to ``[-1, 1]``, and v downwards.
    """
    K = np.asarray(K, dtype=np.float64)
    clip = np.zeros((4, 4))
    clip[0, :3] = 2 * K[0, 0] / width, -2 * K[0, 1] / width, 1 - 2 * K[0, 2] / width
    clip[1, 1:3] = 2 * K[1, 1] / height, 2 * K[1, 2] / height - 1
    clip[2, 2:] = (
        -(FAR_METRES + NEAR_METRES) / (FAR_METRES - NEAR_METRES),
        -2 * FAR_METRES * NEAR_METRES / (FAR_METRES - NEAR_METRES),
    )
    clip[3, 2] = -1.0
    return clip
