"""Stand where all that is drawn is in the picture: free, around it, or where the view's camera stands."""

from __future__ import annotations

import numpy as np

from posekit.cameras import ScaledOrthographicCamera
from posekit.errors import ViewerError
from posekit.geometry import Array, cross
from posekit.viewer.scene.eye import CameraEye, Eye, ParallelEye, ViewEye
from posekit.viewer.scene.image_sight import ImageSight
from posekit.viewer.scene.world import World

FLESH_METRES = 0.13
"""Metres of body around the outermost joints, to be kept in the picture."""


def fitted_eye(
    points: Array,
    world: World,
    *,
    azimuth: float,
    elevation: float,
    fov: float = 30.0,
    aspect: float = 16 / 9,
) -> Eye:
    """Stand so that all points are in the picture, and no farther.

    Parameters
    ----------
    points : array (M, 3)
        World, metres; NaN where unknown.
    world : World
        The frame of the points, which says where the view's camera looks.
    azimuth, elevation : float
        Degrees. At azimuth 0 one stands where the view's camera does, at 90 on its right-hand side.
    fov : float
        Vertical field of view, degrees.
    aspect : float
        The picture's width by its height.
    """
    axes = _axes(world, azimuth, elevation)
    across, tall = _half_angles(fov, aspect)
    # In the eye's own axes: how far to the right, how high, how near.
    extent = points[np.isfinite(points).all(axis=1)] @ axes.T
    centre = (extent.min(axis=0) + extent.max(axis=0)) / 2
    distance = _distance(extent - centre, across, tall)
    for _ in range(20):  # what is nearer looks larger: shift the middle until both sides touch the frame
        seen = (extent - centre)[:, :2] / (distance - (extent - centre)[:, 2:])
        centre[:2] += distance * (seen.min(axis=0) + seen.max(axis=0)) / 2
        distance = _distance(extent - centre, across, tall)
    target = centre @ axes
    return Eye(position=target + distance * axes[2], target=target, fov=fov)


def orbit(
    points: Array,
    world: World,
    *,
    count: int,
    azimuth: float,
    elevation: float,
    fov: float = 30.0,
    aspect: float = 16 / 9,
) -> list[Eye]:
    """Go once around the points in `count` steps, at a distance from which all are always in the picture."""
    known = points[np.isfinite(points).all(axis=1)]
    # One distance for all steps: one that followed the body's outline would pump.
    target = (known.min(axis=0) + known.max(axis=0)) / 2
    across, tall = _half_angles(fov, aspect)
    turns = [_axes(world, azimuth + 360 * k / count, elevation) for k in range(count)]
    distance = max(_distance((known - target) @ axes.T, across, tall) for axes in turns)
    return [Eye(position=target + distance * axes[2], target=target, fov=fov) for axes in turns]


def view_eye(sight: ImageSight | None, world: World, size: tuple[int, int]) -> CameraEye:
    """Look through the view's own camera: its image, as large as fits, in the middle of the picture.

    Parameters
    ----------
    sight : ImageSight
        What the view's camera sees; None where that is not known.
    world : World
        Where the view's camera stands.
    size : (int, int)
        Width and height of the picture, pixels.

    Raises
    ------
    ViewerError
        Where the camera is not known.
    """
    if sight is None:
        raise ViewerError(
            "the view's camera is not known, so one cannot look through it; give the view (--view), or a pose"
        )
    corners = sight.frame()
    low, high = corners.min(axis=0), corners.max(axis=0)
    scale = float((np.array(size) / (high - low)).min())
    # The middle of the image goes to the picture's, whose first pixel is centred on (0, 0).
    shift = np.array(size) / 2 - 0.5 - scale * (low + high) / 2
    camera = sight.camera
    if isinstance(camera, ScaledOrthographicCamera):
        per_metre = float(camera.scale) / np.array([camera.aspect, 1.0])
        return ParallelEye(scale=scale * per_metre, centre=shift, world=world)
    fit = np.array([[scale, 0.0, shift[0]], [0.0, scale, shift[1]], [0.0, 0.0, 1.0]])
    return ViewEye(K=fit @ camera.K, world=world)


def _axes(world: World, azimuth: float, elevation: float) -> Array:
    """Return the rows right, up and back (3, 3), world, of one who looks from there."""
    if not (np.isfinite(azimuth) and -89 <= elevation <= 89):
        raise ViewerError(
            f"azimuth {azimuth:g}, elevation {elevation:g} degrees; expected a finite one, and one from -89 to 89"
        )
    right, ahead = sight_axes(world, azimuth)
    e = np.radians(elevation)
    back = -np.cos(e) * ahead + np.sin(e) * np.array([0.0, 0.0, 1.0])
    return np.stack([right, cross(back, right), back])


def sight_axes(world: World, azimuth: float) -> tuple[Array, Array]:
    """Return the level directions to the right of and ahead of one who looks from an azimuth, (3,) both."""
    forward, right = world.level_axes()
    a = np.radians(azimuth)
    return np.cos(a) * right + np.sin(a) * forward, np.cos(a) * forward - np.sin(a) * right


def _half_angles(fov: float, aspect: float) -> tuple[float, float]:
    if not 0 < fov < 180:
        raise ViewerError(f"the field of view is {fov:g} degrees; expected one between 0 and 180")
    tall = float(np.tan(np.radians(fov) / 2))
    return tall * aspect, tall


def _distance(extent: Array, across: float, tall: float) -> float:
    """Return how far from the middle one must stand: extent (M, 3) to the right, up and towards one."""
    x, y, z = extent.T
    return float(
        max((z + (np.abs(x) + FLESH_METRES) / across).max(), (z + (np.abs(y) + FLESH_METRES) / tall).max())
    )
