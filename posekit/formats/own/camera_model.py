"""The camera that a view was taken with, as far as its file knows it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import PinholeCamera
from posekit.cameras.calibrated import UP_AXES
from posekit.errors import CameraError
from posekit.formats.own.units import FARTHEST_COORDINATE, PER_METRE, Unit, from_metres
from posekit.safe_io import shown

Array = NDArray[np.float64]

ORTHONORMAL_TOLERANCE = 1e-6
"""How far R R^T may be from the identity, entry by entry: files round R to six digits or more."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LeeChenModel:
    """The camera of Lee & Chen 1985.

    Parameters
    ----------
    f : float or None
        Distance from the centre of projection to the image plane, metres; None where it is not known.
    """

    f: float | None

    def __post_init__(self) -> None:
        if self.f is not None:
            check_positive("f", self.f)


@dataclass(frozen=True, kw_only=True, eq=False)
class OpenCVModel:
    """A calibrated pinhole camera in OpenCV's convention.

    Parameters
    ----------
    K : array (3, 3)
        Intrinsics, pixels.
    distortion : array (5,), optional
        k1, k2, p1, p2, k3.
    R : array (3, 3), optional
        Rotation from the world to the camera: ``p_cam = R p_world + t``.
    t : array (3,), optional
        Translation of the same, metres.
    size : (int, int), optional
        Width and height of the picture, pixels.
    up : str
        The world's axis that points against gravity, ``+x`` … ``-z``, where R is given; empty where nobody says.
    """

    K: Array
    distortion: Array | None = None
    R: Array | None = None
    t: Array | None = None
    size: tuple[int, int] | None = None
    up: str = ""

    def __post_init__(self) -> None:
        camera = PinholeCamera(K=self.K, distortion=self.distortion)
        if camera.K.ndim != 2:
            raise CameraError("K must be of shape (3, 3): one for all frames")
        object.__setattr__(self, "K", camera.K)
        object.__setattr__(self, "distortion", camera.distortion)
        for name in ("R", "t"):
            value = getattr(self, name)
            if value is not None:
                array = np.array(value, dtype=np.float64)
                array.flags.writeable = False
                object.__setattr__(self, name, array)
        if self.R is not None:
            check_rotation(self.R)
        if self.t is not None and (self.t.shape != (3,) or not np.isfinite(self.t).all()):
            raise CameraError(f"t must be three finite numbers; got {self.t.tolist()}")
        if self.size is not None and not (len(self.size) == 2 and min(self.size) > 0):
            raise CameraError(f"size must be a positive width and height in pixels; got {self.size}")
        if self.up not in UP_AXES:
            raise CameraError(f"up must be one of {', '.join(UP_AXES[1:])}; got {shown(self.up)}")


@dataclass(frozen=True, kw_only=True, eq=False)
class ScaledOrthographicModel:
    """The uncalibrated camera of Taylor 2000: ``(u, v) = s (x, y)``.

    Parameters
    ----------
    scale : float or None
        s, pixels a metre (files give pixels a `unit`); None where it is not known.
    aspect : float
        Width of a pixel over its height; s counts in v.
    """

    scale: float | None
    aspect: float = 1.0

    def __post_init__(self) -> None:
        if self.scale is not None:
            check_positive("scale", self.scale)
        check_positive("aspect", self.aspect)


CameraModel = LeeChenModel | OpenCVModel | ScaledOrthographicModel


def camera_fields(camera: CameraModel, unit: Unit) -> dict[str, Any]:
    """Return a camera as files spell it, with lengths in `unit`."""
    fields: dict[str, Any]
    if isinstance(camera, LeeChenModel):
        return {"model": "lee-chen", "f": None if camera.f is None else float(from_metres(camera.f, unit))}
    if isinstance(camera, ScaledOrthographicModel):
        scale = camera.scale
        fields = {"model": "scaled-orthographic", "scale": None if scale is None else scale / PER_METRE[unit]}
        return fields if camera.aspect == 1 else {**fields, "aspect": camera.aspect}
    fields = {"model": "opencv", "K": camera.K.tolist()}
    if camera.distortion is not None:
        fields["distortion"] = camera.distortion.tolist()
    if camera.R is not None:
        fields["R"] = camera.R.tolist()
    if camera.t is not None:
        fields["t"] = from_metres(camera.t, unit).tolist()
    if camera.size is not None:
        fields["size"] = [int(extent) for extent in camera.size]
    if camera.up:
        fields["up"] = camera.up
    return fields


def check_positive(name: str, value: float) -> None:
    """Refuse a focal length or a scale that no camera has."""
    if not 1 / FARTHEST_COORDINATE <= value <= FARTHEST_COORDINATE:
        raise CameraError(
            f"{name} must be from {1 / FARTHEST_COORDINATE:g} to {FARTHEST_COORDINATE:g}; got {value:g}"
        )


def check_intrinsics(K: list[list[float]]) -> None:
    """Refuse a K that is no camera's."""
    PinholeCamera(K=np.array(K))


def check_rotation(R: Array | list[list[float]]) -> None:
    """Refuse a matrix that is not orthonormal to 1e-6 or that mirrors."""
    matrix = np.asarray(R, dtype=np.float64)
    if matrix.shape != (3, 3) or not np.isfinite(matrix).all():
        raise CameraError("R must be a finite 3x3 matrix")
    with np.errstate(over="ignore", invalid="ignore"):
        error = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    if not error <= ORTHONORMAL_TOLERANCE:
        raise CameraError(f"R must be a rotation; R R^T is off the identity by {error:.2g}")
    if np.linalg.det(matrix) < 0:
        raise CameraError("R must be a rotation; its determinant is -1, so it mirrors")
