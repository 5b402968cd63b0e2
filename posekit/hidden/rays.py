"""The rays of seen joints, found once a frame through the camera's own lift."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Camera, Lift
from posekit.cameras.camera import meet_sphere
from posekit.geometry import Array

Index = NDArray[np.intp]

RAY_START_BEHIND_METRES = 1e7
"""Metres behind the body at which a ray is looked for that has no start: a parallel camera's."""

N_RAY_BISECTIONS = 70
"""Bisections of `RAY_START_BEHIND_METRES`: 1e7 m / 2^70 is 1e-14 m."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Rays:
    """Where each joint of F frames is seen, as rays in space; NaN where it is not, or is out of reach.

    Parameters
    ----------
    origin : array (F, J, 3)
        A point on each ray, before anything that the body can reach; camera frame, metres. What is before it is
        behind the camera.
    direction : array (F, J, 3)
        Unit vectors, away from the camera.
    """

    origin: Array
    direction: Array

    def foot(self, joint: int, frame: Index, point: Array) -> tuple[Array, Array]:
        """Return the foot (n, 3) of the perpendicular from points (n, 3) on a joint's ray, and its height (n,)."""
        origin, direction = self.origin[frame, joint], self.direction[frame, joint]
        along = np.einsum("ni,ni->n", point - origin, direction)
        foot = origin + along[:, None] * direction
        return foot, np.asarray(np.linalg.norm(point - foot, axis=1))

    def lift(self, joint: int, frame: Index, start: Array, length: float, tolerance: float) -> Lift:
        """Lift a joint in some frames (n,) from starts (n, 3): see `posekit.cameras.Camera.lift`."""
        return meet_sphere(
            self.origin[frame, joint],
            self.direction[frame, joint],
            start,
            np.asarray(length),
            tolerance=tolerance,
        )


def find_rays(camera: Camera, root: Array, image: Array, reach: float) -> Rays:
    """Find the rays of all seen joints.

    The two ends of a segment that is longer than the body lie on the ray, whatever the camera: they are the ray.

    Parameters
    ----------
    camera : Camera
        The calibrated camera, whose first axis counts frames.
    root : array (F, 3)
        The neck, camera frame, metres.
    image : array (F, J, 2)
        NaN where a joint was not seen.
    reach : float
        Metres from the root that no joint can leave.
    """
    start = np.broadcast_to(root[:, None], (*image.shape[:2], 3))
    with np.errstate(over="ignore", invalid="ignore"):  # nothing reaches the ray of an image point at 1e300
        ends = camera.lift(start, image, np.asarray(4.0 * reach), tolerance=0.0)
        points = np.where((ends.excess < 0.0)[..., None, None], ends.points, np.nan)
        middle = points.mean(axis=-2)
        direction = points[..., 1, :] - points[..., 0, :]
        direction = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
        # Bisect for where the ray begins: what is before it is behind the camera and has no image.
        low, high = np.full(image.shape[:2], -RAY_START_BEHIND_METRES), np.full(image.shape[:2], 4.0 * reach)
        endless = _in_front(camera, middle + low[..., None] * direction)
        for _ in range(N_RAY_BISECTIONS):
            half = (low + high) / 2.0
            front = _in_front(camera, middle + half[..., None] * direction)
            low, high = np.where(front, low, half), np.where(front, half, high)
    # Nearer than this nothing of the body can be; a nearer origin would only cost digits.
    along = np.maximum(np.where(endless, -np.inf, low), -4.0 * reach)
    return Rays(origin=middle + along[..., None] * direction, direction=direction)


def _in_front(camera: Camera, points: Array) -> NDArray[np.bool_]:
    return np.asarray(np.isfinite(camera.project(points)).all(axis=-1))
