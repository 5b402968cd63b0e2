"""The camera in the scene: its frustum, the image on its plane, the rays through the image's points."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from posekit.cameras import PinholeCamera, ScaledOrthographicCamera
from posekit.geometry import Array
from posekit.skeleton import PARENTS, POINTS
from posekit.viewer.scene.colours import FRUSTUM_RGB, POINT_SIDES, SIDE_RGB, rgb
from posekit.viewer.scene.scene import Scene
from posekit.viewer.scene.shapes import add_ball, add_sheet, add_tubes, glow
from posekit.viewer.scene.world import World

PLANE_RGB = rgb("#dfe5ec")
RAY_RADIUS, EDGE_RADIUS, IMAGE_RADIUS, DOT_RADIUS = 0.0022, 0.004, 0.004, 0.011
"""Metres: rays, the frustum's edges, the image's segments and points."""

RAY_OPACITY = 0.45

PLANE_GAP = 0.6
"""Metres from the image plane of a camera that is infinitely far to the nearest joint."""

IMAGE_BORDER_SHARE = 0.08
"""Of an image whose size is not known: the share of its points' extent that is added on each side."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ImageSight:
    """What a camera sees.

    Parameters
    ----------
    camera : PinholeCamera or ScaledOrthographicCamera
        With one K, or with one scale.
    image : array (14, 2) or (19, 2)
        Image points, joints and head, y down, in the camera's unit; NaN where not seen.
    size : (width, height), optional
        Of the picture, in the same unit; without it the frame is drawn around the points.
    """

    camera: PinholeCamera | ScaledOrthographicCamera
    image: Array
    size: tuple[float, float] | None = None

    @property
    def parallel(self) -> bool:
        """Whether the camera is infinitely far: its rays are parallel and depth is relative."""
        return isinstance(self.camera, ScaledOrthographicCamera)

    def frame(self) -> Array:
        """Return the corners of the image (4, 2)."""
        if self.size is not None:
            width, height = self.size
            low, high = np.array([-0.5, -0.5]), np.array([width - 0.5, height - 0.5])
        else:
            seen = self.image[np.isfinite(self.image).all(axis=1)]
            low, high = seen.min(axis=0), seen.max(axis=0)
            border = IMAGE_BORDER_SHARE * max(float((high - low).max()), 1e-9)
            low, high = low - border, high + border
        return np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])

    @property
    def middle(self) -> Array:
        """The middle of the seen points (2,), in pixels that are square."""
        width = self.camera.aspect if isinstance(self.camera, ScaledOrthographicCamera) else 1.0
        seen = self.image[np.isfinite(self.image).all(axis=1)]
        return np.asarray(seen.mean(axis=0) * np.array([width, 1.0]))

    def rescaled(self, scale: float) -> ImageSight:
        """Return the same image, seen by an uncalibrated camera at another scale, pixels a metre."""
        if not isinstance(self.camera, ScaledOrthographicCamera):
            return self
        return replace(self, camera=replace(self.camera, scale=scale))

    def at(self, pixels: Array, depth: float | Array) -> Array:
        """Return the points (N, 3) that are seen at `pixels` (N, 2) in a depth, camera frame, metres."""
        depths = np.broadcast_to(depth, (len(pixels),))[:, None]
        if isinstance(self.camera, ScaledOrthographicCamera):
            return np.concatenate([self.camera.unproject(pixels), depths], axis=1)
        return np.asarray(
            depths * np.concatenate([self.camera.normalize(pixels), np.ones((len(pixels), 1))], axis=1)
        )


def add_sight(
    scene: Scene,
    sight: ImageSight,
    *,
    world: World,
    points: Array | None = None,
    depth: float | None = None,
    name: str = "camera",
    rays: bool = True,
) -> Array:
    """Draw the camera below ``/meshcat/NAME``: ``frustum``, ``plane``, ``image``, ``points/POINT``, ``rays``.

    A camera that is infinitely far has no eye: its image plane hangs in front of the postures, and its rays are
    parallel.

    Parameters
    ----------
    sight : ImageSight
        What the camera sees.
    world : World
        The frame in which the camera stands.
    points : array (..., 14, 3) or (..., 19, 3), optional
        The postures, camera frame, metres: rays end where they pass the last of them; without them all rays
        end beyond the image plane.
    depth : float, optional
        Depth in metres at which the image plane is drawn; default a quarter of the way to the postures, or for a
        camera that is infinitely far 0.6 m before them.
    rays : bool
        Whether the rays are drawn.

    Returns
    -------
    array (M, 3)
        World, metres: the eye, or the corners of the plane where there is none.
    """
    far = _depths(points, len(sight.image))
    depth = _plane(sight, points, far) if depth is None else depth
    corners = world.place(sight.at(sight.frame(), depth))
    if np.isfinite(corners).all():
        starts, ends = corners, np.roll(corners, -1, 0)
        if not sight.parallel:
            apex = world.place(np.zeros(3))
            starts, ends = np.concatenate([corners, corners]), np.concatenate([np.tile(apex, (4, 1)), ends])
        colours = np.tile(FRUSTUM_RGB, (len(starts), 1))
        add_tubes(scene, f"{name}/frustum", starts, ends, colours, radius=EDGE_RADIUS)
        add_sheet(scene, f"{name}/plane", corners, glow(PLANE_RGB, 0.55))
    on_plane = world.place(sight.at(sight.image, depth))
    colours = np.array([SIDE_RGB[POINT_SIDES[k]] for k in range(len(sight.image))])
    children = np.arange(1, len(PARENTS))
    add_tubes(
        scene,
        f"{name}/image",
        on_plane[np.array(PARENTS)[1:]],
        on_plane[1 : len(PARENTS)],
        colours[children],
        radius=IMAGE_RADIUS,
    )
    for k, middle in enumerate(on_plane):
        if np.isfinite(middle).all():
            radius = DOT_RADIUS if k < len(PARENTS) else DOT_RADIUS / 2
            add_ball(scene, f"{name}/points/{POINTS[k]}", middle, radius, glow(tuple(colours[k])))
    eye = on_plane
    if not sight.parallel:
        eye = np.tile(world.place(np.zeros(3)), (len(on_plane), 1))
        add_ball(scene, f"{name}/eye", eye[0], 8 * EDGE_RADIUS, glow(FRUSTUM_RGB))
    if rays:
        beyond = depth + PLANE_GAP if sight.parallel else 2 * depth
        reach = np.where(np.isfinite(far), far, np.nanmax(far) if np.isfinite(far).any() else beyond)
        tips = world.place(sight.at(sight.image, reach))
        add_tubes(scene, f"{name}/rays", eye, tips, colours, radius=RAY_RADIUS, opacity=RAY_OPACITY)
    return corners[np.isfinite(corners).all(axis=1)] if sight.parallel else eye[:1]


def _plane(sight: ImageSight, points: Array | None, far: Array) -> float:
    """Choose the depth of the image plane, metres."""
    if sight.parallel:
        nearest = float(np.nanmin(points[..., 2])) if points is not None and np.isfinite(far).any() else 0.0
        return nearest - PLANE_GAP
    nearest = float(np.nanmin(far)) if np.isfinite(far).any() else 4.0
    return min(1.2, 0.25 * nearest)


def _depths(points: Array | None, count: int) -> Array:
    """Return the depth of the farthest posture's point on each ray (count,), metres; NaN where unknown."""
    far = np.full(count, np.nan)
    if points is not None:
        depths = points.reshape(-1, points.shape[-2], 3)[..., 2]
        shared = min(count, depths.shape[1])
        far[:shared] = np.fmax.reduce(depths[:, :shared], axis=0)
    return far
