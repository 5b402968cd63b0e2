"""Virtual cameras around a person: swept in yaw from the front over one side to the back, at several heights."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import PinholeCamera
from posekit.errors import InputError
from posekit.geometry import Array, cross, unit
from posekit.skeleton import JOINT
from posekit.synthesis.camera_sphere import CameraSphere
from posekit.synthesis.viewpoints import look_at

CAMERA_STEP_DEGREES: Final = 15.0
"""Degrees between cameras. Wang et al. (2014) do not print theirs; the axis of their Fig. 6 is marked every 20."""

CAMERA_HEIGHTS_METRES: Final = (0.5, 1.5, 2.5)
"""Metres over the ground: below the hips, at the eyes, above the head."""

MIN_SINE_TO_VERTICAL: Final = 0.3
"""Sine to the vertical below which a line of the body does not tell where it faces."""

MOST_CAMERAS: Final = 10_000


class SweepCameras(NamedTuple):
    """Where C cameras stand for each of F frames.

    Attributes
    ----------
    R_cam_world : array (C, F, 3, 3)
        Rotations from the world into each camera's frame.
    position : array (C, F, 3)
        Optical centres, metres.
    """

    R_cam_world: Array
    position: Array


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """Which cameras see every frame: each height at each yaw.

    The sweep is that of Wang, Wang, Lin, Yuille & Gao 2014 ("Robust Estimation of 3D Human Poses from a Single Image",
    CVPR, section 4.3.3, Fig. 6): the body is turned about its upright by 0 to 180 degrees, 0 being the frontal view and
    90 the profile, counted from the line through the hips. Two things differ. The turn is about the world's up, not the
    spine, so that the camera stays upright and has a height; and the camera is a perspective one.

    Parameters
    ----------
    yaws : tuple of float
        Degrees: 0 is ahead of the person, 90 on the left, 180 behind.
    heights : tuple of float
        Of the optical centre over the clip's lowest joint, metres.
    distance : float
        From the optical centre to the middle of the body, metres.
    f : float
        Focal length, pixels.
    size : (int, int)
        Width and height of the picture, pixels.

    Raises
    ------
    InputError
        Where one of them is impossible.
    """

    yaws: tuple[float, ...] = tuple(float(yaw) for yaw in np.arange(0.0, 181.0, CAMERA_STEP_DEGREES))
    heights: tuple[float, ...] = CAMERA_HEIGHTS_METRES
    distance: float = 4.0
    f: float = 1500.0
    size: tuple[int, int] = (1920, 1080)

    def __post_init__(self) -> None:
        _ = self.sphere
        for name, values, unit_name in (("yaws", self.yaws, "degrees"), ("heights", self.heights, "metres")):
            if not values or not all(math.isfinite(value) for value in values):
                raise InputError(
                    f"--{name}: {list(values)}; expected one or more finite numbers, {unit_name}"
                )
            if len(set(values)) != len(values):
                raise InputError(f"--{name}: {list(values)}; expected each once; leave out what is repeated")
        if len(self) > MOST_CAMERAS:
            raise InputError(
                f"{len(self)} cameras ({len(self.yaws)} yaws, {len(self.heights)} heights); expected at most "
                f"{MOST_CAMERAS}; give a larger --yaw-step"
            )

    def __len__(self) -> int:
        """Count the cameras."""
        return len(self.yaws) * len(self.heights)

    @property
    def sphere(self) -> CameraSphere:
        """The camera itself."""
        return CameraSphere(distance=(self.distance, self.distance), f=self.f, size=self.size)

    @property
    def camera(self) -> PinholeCamera:
        """The intrinsics, the same for all."""
        return self.sphere.camera

    @property
    def poses(self) -> Array:
        """Yaw (degrees) and height (metres) of each camera (C, 2)."""
        return np.array([(yaw, height) for yaw in self.yaws for height in self.heights])

    def place(self, middle: Array, forward: Array, up: Array, ground: float) -> SweepCameras:
        """Place all cameras around each frame, looking at the middle of the body.

        Parameters
        ----------
        middle, forward : array (F, 3)
            The body's middle (m), and where it faces: horizontal unit vectors.
        up : array (3,)
            The direction against gravity, world frame, unit length.
        ground : float
            Height of the ground along `up`, metres.

        Raises
        ------
        InputError
            Where a height is farther from the body's middle than the distance.
        """
        # A camera's height takes from its level distance, so that all stand equally far from the middle.
        yaw, height = np.radians(self.poses[:, 0]), self.poses[:, 1]
        above = height[:, None] - (middle @ up - ground)
        if not (np.abs(above) < 0.99 * self.distance).all():
            worst = float(height[np.abs(above).max(axis=1).argmax()])
            raise InputError(
                f"--heights: {worst:g} m is as far above or below the body as the camera is away "
                f"({self.distance:g} m); expected less; give a larger --distance"
            )
        left = cross(np.broadcast_to(up, forward.shape), forward)
        beside = np.cos(yaw)[:, None, None] * forward + np.sin(yaw)[:, None, None] * left
        away = np.sqrt(self.distance**2 - above**2)
        position = middle + away[..., None] * beside + above[..., None] * up
        return SweepCameras(look_at(position, np.broadcast_to(middle, position.shape), up), position)


def facing(joints: Array, up: Array) -> Array:
    """Return where each body (F, 14, 3) faces: horizontal unit vectors (F, 3).

    At right angles to the line of the hips, as Wang et al. (2014) count it; where that line is near the vertical, of
    the shoulders; of a body that lies on its side, along the spine.
    """
    hips, shoulders = (
        joints[:, JOINT[f"left_{name}"]] - joints[:, JOINT[f"right_{name}"]] for name in ("hip", "shoulder")
    )
    spine = joints[:, JOINT["neck"]] - joints[:, JOINT["pelvis"]]
    upward = np.broadcast_to(up, hips.shape)
    spare = np.broadcast_to(np.eye(3)[np.argmin(np.abs(up))], hips.shape)
    found: Array = np.full(hips.shape, np.nan)
    flat: NDArray[np.bool_] = np.zeros(len(joints), dtype=np.bool_)
    for way in (cross(unit(hips), upward), cross(unit(shoulders), upward), unit(spine), spare):
        level = way - (way @ up)[:, None] * up
        take = ~flat & (np.linalg.norm(level, axis=1) > MIN_SINE_TO_VERTICAL)
        found[take] = unit(level[take])
        flat |= take
    return found


def middles(points: Array) -> Array:
    """Return the middles (F, 3) of the boxes around points (F, P, 3); NaN is no point."""
    return np.asarray((np.nanmin(points, axis=1) + np.nanmax(points, axis=1)) / 2)
