"""The camera in the scene: its frustum, the image on its plane, the rays through the image's points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posekit.cameras import Array, PinholeCamera
from posekit.skeleton import PARENTS, POINTS
from posekit.viewer.scene.colours import FRUSTUM, POINT_SIDES, SIDES, rgb
from posekit.viewer.scene.scene import Scene
from posekit.viewer.scene.shapes import add_ball, add_sheet, add_tubes, glow
from posekit.viewer.scene.world import World

PLANE = rgb("#dfe5ec")
RAY_RADIUS, EDGE_RADIUS, IMAGE_RADIUS, DOT = 0.0022, 0.004, 0.004, 0.011
"""Metres: rays, the frustum's edges, the image's segments and points."""

RAY_OPACITY = 0.45

BORDER = 0.08
"""Of an image whose size is not known: the share of its points' extent that is added on each side."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sight:
    """What a camera sees.

    Parameters
    ----------
    camera : PinholeCamera
        With one K.
    image : array (14, 2) or (19, 2)
        Image points, joints and head, y down, in the camera's unit; NaN where not seen.
    size : (width, height), optional
        Of the picture, in the same unit; without it the frame is drawn around the points.
    """

    camera: PinholeCamera
    image: Array
    size: tuple[float, float] | None = None

    def frame(self) -> Array:
        """Return the corners of the image (4, 2)."""
        if self.size is not None:
            width, height = self.size
            low, high = np.array([-0.5, -0.5]), np.array([width - 0.5, height - 0.5])
        else:
            seen = self.image[np.isfinite(self.image).all(axis=1)]
            low, high = seen.min(axis=0), seen.max(axis=0)
            border = BORDER * max(float((high - low).max()), 1e-9)
            low, high = low - border, high + border
        return np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])

    def rays(self, pixels: Array) -> Array:
        """Return the points (N, 3) of the plane z = 1 (camera frame) that are seen at `pixels` (N, 2)."""
        normalized = self.camera.normalize(pixels)
        return np.concatenate([normalized, np.ones((len(pixels), 1))], axis=1)


def add_sight(
    scene: Scene,
    sight: Sight,
    *,
    world: World,
    points: Array | None = None,
    depth: float | None = None,
    name: str = "camera",
    rays: bool = True,
) -> None:
    """Draw the camera below ``/meshcat/NAME``: ``frustum``, ``plane``, ``image``, ``points/POINT``, ``rays``.

    Parameters
    ----------
    sight : Sight
    world : World
    points : array (..., 14, 3) or (..., 19, 3), optional
        The postures, camera frame, metres: rays end where they pass the last of them; without them all rays
        end beyond the image plane.
    depth : float, optional
        Metres from the camera at which its image plane is drawn; default a quarter of the way to the postures.
    rays : bool
        Whether the rays are drawn.
    """
    far = _depths(points, len(sight.image))
    nearest = float(np.nanmin(far)) if np.isfinite(far).any() else 4.0
    depth = depth or min(1.2, 0.25 * nearest)
    apex = world.place(np.zeros(3))
    corners = world.place(depth * sight.rays(sight.frame()))
    if np.isfinite(corners).all():
        edges = (
            np.concatenate([corners, corners]),
            np.concatenate([np.tile(apex, (4, 1)), np.roll(corners, -1, 0)]),
        )
        colours = np.tile(FRUSTUM, (8, 1))
        add_tubes(scene, f"{name}/frustum", *edges, colours, radius=EDGE_RADIUS)
        add_sheet(scene, f"{name}/plane", corners, glow(PLANE, 0.55))
    add_ball(scene, f"{name}/eye", apex, 8 * EDGE_RADIUS, glow(FRUSTUM))
    on_plane = world.place(depth * sight.rays(sight.image))
    colours = np.array([SIDES[POINT_SIDES[k]] for k in range(len(sight.image))])
    ends = np.arange(1, len(PARENTS))
    add_tubes(
        scene,
        f"{name}/image",
        on_plane[np.array(PARENTS)[1:]],
        on_plane[1 : len(PARENTS)],
        colours[ends],
        radius=IMAGE_RADIUS,
    )
    for k, middle in enumerate(on_plane):
        if np.isfinite(middle).all():
            radius = DOT if k < len(PARENTS) else DOT / 2
            add_ball(scene, f"{name}/points/{POINTS[k]}", middle, radius, glow(tuple(colours[k])))
    if rays:
        reach = np.where(np.isfinite(far), far, np.nanmax(far) if np.isfinite(far).any() else 2 * depth)
        tips = world.place(sight.rays(sight.image) * reach[:, None])
        add_tubes(
            scene,
            f"{name}/rays",
            np.tile(apex, (len(tips), 1)),
            tips,
            colours,
            radius=RAY_RADIUS,
            opacity=RAY_OPACITY,
        )


def _depths(points: Array | None, count: int) -> Array:
    """Return the depth of the farthest posture's point on each ray (count,), metres; NaN where unknown."""
    far = np.full(count, np.nan)
    if points is not None:
        depths = points.reshape(-1, points.shape[-2], 3)[..., 2]
        shared = min(count, depths.shape[1])
        far[:shared] = np.fmax.reduce(depths[:, :shared], axis=0)
    return far
