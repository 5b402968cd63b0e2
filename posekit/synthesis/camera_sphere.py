"""Cameras on a sphere around a person, such that the whole person is in the picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import PinholeCamera
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.synthesis.viewpoints import look_at, to_camera, uniform_directions

MAX_DRAWS = 200
"""Draws of one camera before it is said that none fits."""


class CameraPlacements(NamedTuple):
    """Where cameras stand.

    Attributes
    ----------
    R_cam_world : array (N, 3, 3)
        Rotations from the world into each camera's frame.
    position : array (N, 3)
        Optical centres, world frame, metres.
    """

    R_cam_world: Array
    position: Array


@dataclass(frozen=True, kw_only=True)
class CameraSphere:
    """A camera that may stand anywhere around a person.

    Parameters
    ----------
    distance : (float, float)
        Nearest and farthest distance of the optical centre from the body's middle, metres.
    f : float
        Focal length, pixels.
    size : (int, int)
        Width and height of the picture, pixels; the principal point is its middle.

    Raises
    ------
    InputError
        Where one of them is impossible.
    """

    distance: tuple[float, float] = (2.5, 6.0)
    f: float = 1500.0
    size: tuple[int, int] = (1920, 1080)

    def __post_init__(self) -> None:
        near, far = self.distance
        if not 0 < near <= far < np.inf:
            raise InputError(f"camera distances are {near:g} to {far:g} m; expected positive, nearer first")
        if not 0 < self.f < np.inf:
            raise InputError(f"the focal length is {self.f:g} pixels; expected positive and finite")
        if min(self.size) <= 0:
            raise InputError(f"the picture is {self.size[0]} x {self.size[1]} pixels; expected both positive")

    @property
    def camera(self) -> PinholeCamera:
        """The camera, its principal point in the middle of the picture."""
        width, height = self.size
        return PinholeCamera(K=np.array([[self.f, 0, width / 2], [0, self.f, height / 2], [0, 0, 1.0]]))

    def place(self, points: Array, up: Array, rng: np.random.Generator) -> CameraPlacements:
        """Draw a camera for each of N bodies until its points are in front of it and inside the picture.

        The direction is uniform on the sphere and the distance uniform in its range; the camera looks at the
        middle of the body's bounding box, upright. Both are drawn again where the body does not fit.

        Parameters
        ----------
        points : array (N, P, 3)
            Each body's points, or all its points in all frames of one camera; NaN is no point.
        up : array (3,)
            The world's up.
        rng : Generator
            Seeded by the caller.

        Raises
        ------
        InputError
            Where a body does not fit from any of `MAX_DRAWS` cameras.
        """
        n = len(points)
        middle = (np.nanmin(points, axis=1) + np.nanmax(points, axis=1)) / 2
        R, position = np.empty((n, 3, 3)), np.empty((n, 3))
        rows: NDArray[np.intp] = np.arange(n)
        for _ in range(MAX_DRAWS):
            distance = rng.uniform(*self.distance, len(rows))
            position[rows] = middle[rows] + distance[:, None] * uniform_directions(len(rows), rng)
            R[rows] = look_at(position[rows], middle[rows], up)
            rows = rows[~self.fits(to_camera(points[rows], R[rows], position[rows]))]
            if len(rows) == 0:
                return CameraPlacements(R, position)
        raise InputError(
            f"body {rows[0]} does not fit into {self.size[0]} x {self.size[1]} pixels at f = {self.f:g} from "
            f"{self.distance[0]:g} to {self.distance[1]:g} m, in {MAX_DRAWS} tries; move away or lower f"
        )

    def fits(self, points_cam: Array) -> NDArray[np.bool_]:
        """Tell which bodies (N, P, 3), camera frame, are in front of the camera and in the picture (N,)."""
        known = ~np.isnan(points_cam[..., 2])
        pixels = self.camera.project(points_cam)
        inside = ((pixels >= 0) & (pixels <= np.array(self.size))).all(axis=-1)
        return np.asarray((inside | ~known).all(axis=1))
