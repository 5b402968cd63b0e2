"""A camera as a file has it: intrinsics, distortion, pose, and whether it was calibrated or guessed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from posekit.cameras import PinholeCamera
from posekit.cameras.pinhole import MAX_DISTORTION
from posekit.cameras.rotation import rotation_from_rounded
from posekit.display.short_repr import ShortRepr
from posekit.errors import CameraError, InputError
from posekit.geometry import Array
from posekit.safe_io import nearest, refusal, shown

COEFFICIENT_COUNTS: Final = (0, 4, 5, 8, 12, 14)
"""How many coefficients OpenCV's models have: Brown's four or five, the rational model's eight, with thin prism
twelve, with a tilted sensor fourteen. Its fisheye model has none or four."""
N_BROWN_COEFFICIENTS: Final = 5
"""Coefficients k1, k2, p1, p2, k3, which `posekit.cameras.PinholeCamera` takes."""
SAYS_CALIBRATED: Final = "calibrated"
MAX_PICTURE_SIDE: Final = 10**6
"""Pixels that a picture may have a side."""
UP_AXES: Final = ("", "+x", "-x", "+y", "-y", "+z", "-z")


def _none() -> Array:
    return np.empty(0)


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibratedCamera(ShortRepr):
    """One camera.

    Parameters
    ----------
    name : str
        As the file has it.
    K : array (3, 3)
        Intrinsics, pixels; the middle of the first pixel is (0, 0), as in OpenCV.
    distortion : array (n,)
        Coefficients in OpenCV's order, n one of `COEFFICIENT_COUNTS`: k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4,
        tau_x, tau_y; where `fisheye`, k1, k2, k3, k4 of its own model.
    fisheye : bool
        Whether it is OpenCV's fisheye model (Kannala & Brandt 2006).
    size : (int, int), optional
        Width and height of the pictures, pixels.
    R : array (3, 3), optional
        Rotation from the world to the camera: ``p_cam = R p_world + t``.
    t : array (3,), optional
        Translation of the same, metres; None too where the file's world has no metres.
    up : str
        The world's axis that points up, ``+x`` … ``-z``; empty where the file does not say.
    how : str
        ``calibrated``, or in words what was guessed.
    deviation : float
        Standard deviation of the focal length, as a fraction of it, where it was guessed; 0 where calibrated.

    Raises
    ------
    CameraError
        Where the parameters describe no camera.
    """

    name: str
    K: Array
    distortion: Array = field(default_factory=_none)
    fisheye: bool = False
    size: tuple[int, int] | None = None
    R: Array | None = None
    t: Array | None = None
    up: str = ""
    how: str = SAYS_CALIBRATED
    deviation: float = 0.0

    def __post_init__(self) -> None:
        K = np.array(self.K, dtype=np.float64)
        if K.shape != (3, 3):
            raise CameraError(f"camera {shown(self.name)}: K has shape {K.shape}; expected (3, 3)")
        distortion = np.array(self.distortion, dtype=np.float64).ravel()
        counts = (0, 4) if self.fisheye else COEFFICIENT_COUNTS
        try:
            PinholeCamera(K=K)
            R = None if self.R is None else rotation_from_rounded(self.R)
        except CameraError as error:
            raise CameraError(f"camera {shown(self.name)}: {error}") from None
        usable = abs(distortion) <= MAX_DISTORTION
        if len(distortion) not in counts or not usable.all():
            model = "the fisheye model" if self.fisheye else "OpenCV's models"
            raise CameraError(
                f"camera {shown(self.name)}: distortion has {len(distortion)} coefficients, "
                f"{int(usable.sum())} of them numbers of {MAX_DISTORTION:g} at most; expected "
                f"{', '.join(map(str, counts))} such numbers for {model}"
            )
        t = None if self.t is None else np.array(self.t, dtype=np.float64).ravel()
        if t is not None and (t.shape != (3,) or not np.isfinite(t).all()):
            raise CameraError(f"camera {shown(self.name)}: t must be three finite numbers; got {t.tolist()}")
        if self.size is not None:
            _check_size(self.name, self.size)
        if self.up not in UP_AXES:
            raise CameraError(
                f"camera {shown(self.name)}: up is {shown(self.up)}; expected {', '.join(UP_AXES[1:])}"
            )
        if not (math.isfinite(self.deviation) and 0 <= self.deviation < 1):
            raise CameraError(
                f"camera {shown(self.name)}: the deviation of f is {self.deviation:g}; expected a fraction below 1"
            )
        for attribute, array in (("K", K), ("distortion", distortion), ("R", R), ("t", t)):
            if array is not None:
                array.flags.writeable = False
            object.__setattr__(self, attribute, array)

    @property
    def guessed(self) -> bool:
        """Whether the focal length is a guess."""
        return self.deviation > 0

    @property
    def position(self) -> Array | None:
        """Return the optical centre (3,) in the world, metres; None where the pose is not known."""
        return None if self.R is None or self.t is None else np.asarray(-self.R.T @ self.t)


def _check_size(name: str, size: tuple[int, int]) -> None:
    if len(size) != 2 or not all(isinstance(side, int) and 0 < side <= MAX_PICTURE_SIDE for side in size):
        raise CameraError(
            f"camera {shown(name)}: size must be width and height in pixels, 1 to {MAX_PICTURE_SIDE:,}; got {size}"
        )


def needs_undistortion(camera: CalibratedCamera) -> bool:
    """Tell whether points must go through `undistorted` first: the model is more than Brown's five coefficients."""
    return camera.fisheye or bool(np.any(camera.distortion[N_BROWN_COEFFICIENTS:]))


def pinhole_of(camera: CalibratedCamera) -> PinholeCamera:
    """Make the camera that the interpretation tree uses.

    Where `needs_undistortion`, it is ideal: for the points that `undistorted` gives, not for the file's own.
    """
    if needs_undistortion(camera) or not camera.distortion.any():
        return PinholeCamera(K=camera.K)
    brown = np.zeros(N_BROWN_COEFFICIENTS)
    brown[: len(camera.distortion[:N_BROWN_COEFFICIENTS])] = camera.distortion[:N_BROWN_COEFFICIENTS]
    return PinholeCamera(K=camera.K, distortion=brown)


def choose_camera(cameras: Mapping[str, CalibratedCamera], name: str | None = None) -> CalibratedCamera:
    """Choose a camera by name, or the only one.

    Raises
    ------
    InputError
        Where there is no such camera, or several and none was named: the candidates are listed.
    """
    if name is None and len(cameras) == 1:
        return next(iter(cameras.values()))
    names = [shown(one) for one in list(cameras)[:8]]
    listed = ", ".join(names) + (f" and {len(cameras) - 8} more" if len(cameras) > 8 else "")
    if name is None:
        raise refusal("", "camera", f"{len(cameras)} cameras", "the name of one", f"choose one of {listed}")
    if name not in cameras:
        near = nearest(name, cameras) if len(cameras) > 8 else f"choose one of {listed}"
        raise InputError(
            f"camera: got {shown(name)}; expected the name of a camera in the file; {near[:300]}"
        )
    return cameras[name]
