"""The pinhole camera, calibrated or guessed, with OpenCV's frame, lens models and pose in the world."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from posekit.cameras import lens
from posekit.cameras.camera import Camera
from posekit.errors import CameraError, refusal, shown
from posekit.geometry import UP_AXES, Array, best_rotation, from_metres

#: Largest accepted width or height of a picture, pixels.
MAX_PICTURE_SIDE: Final = 10**6

#: Largest error of an entry of R R^T: rounding R to four digits causes up to this.
ROTATION_ROUNDING: Final = 1e-3

#: Relative standard deviation of an f that is computed from an angle of view or a 35 mm equivalent. Such numbers are
#: rounded, refer to different axes, and ignore distortion. Rounding 26 mm to a millimetre changes f by 2 %. An
#: equivalent by width instead of diagonal changes f by 4 % for a 4:3 picture.
FOCAL_DEVIATION: Final = 0.05


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PinholeCamera(Camera):
    """A perspective camera: x right, y down, z forward, origin at the optical centre.

    Parameters
    ----------
    K : array (3, 3)
        Intrinsics, pixels, with positive focal lengths; the centre of the first pixel is (0, 0), as in OpenCV.
    distortion : array (n,), optional
        Coefficients in OpenCV's order, n one of 0, 4, 5, 8, 12, 14: k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4,
        tau_x, tau_y. A fisheye lens has no coefficients, or k1, k2, k3, k4.
    fisheye : bool
        Whether the lens is OpenCV's fisheye model (Kannala & Brandt 2006).
    R : array (3, 3), optional
        Rotation from the world to the camera: ``p_cam = R p_world + t``. If the entries of R are rounded, R is replaced
        by the nearest rotation.
    t : array (3,), optional
        Translation from the world to the camera, metres.
    size : (int, int), optional
        Width and height of the pictures, pixels.
    up : str
        The world's axis that points up, ``+x`` … ``-z``; empty if unknown.
    name : str
        Name of the camera in its file.
    how : str
        ``calibrated``, or a text that says how the focal length was guessed.
    deviation : float
        Relative standard deviation of a guessed focal length; 0 if the camera is calibrated.

    Raises
    ------
    CameraError
        If a parameter has a wrong shape or an impossible value.

    Examples
    --------
    >>> camera = PinholeCamera(K=[[1000, 0, 640], [0, 1000, 360], [0, 0, 1]])
    >>> camera.project(np.array([0.5, 0.0, 5.0])).tolist()
    [740.0, 360.0]
    """

    K: Array
    distortion: Array | None = None
    fisheye: bool = False
    R: Array | None = None
    t: Array | None = None
    size: tuple[int, int] | None = None
    up: str = ""
    name: str = ""
    how: str = "calibrated"
    deviation: float = 0.0

    def __post_init__(self) -> None:
        K = np.array(self.K, dtype=np.float64)
        if K.shape != (3, 3) or not np.isfinite(K).all():
            raise self._refused("K", shown(K.tolist()), "a finite matrix of shape (3, 3)")
        if not (K[0, 0] > 0 and K[1, 1] > 0):
            raise self._refused("K", f"focal lengths {K[0, 0]:g} and {K[1, 1]:g}", "positive focal lengths")
        if (K[2] != [0, 0, 1]).any() or K[1, 0] != 0:
            raise self._refused("K", shown(K.ravel().tolist()), "an upper triangular matrix with K[2, 2] = 1")
        self._set("K", K)
        if self.distortion is not None or self.fisheye:  # a fisheye lens bends rays without coefficients, too
            distortion = np.array(self.distortion if self.distortion is not None else (), np.float64).ravel()
            counts = (0, 4) if self.fisheye else lens.COEFFICIENT_COUNTS
            if len(distortion) not in counts or not (abs(distortion) <= lens.MAX_COEFFICIENT).all():
                model = "the fisheye model" if self.fisheye else "OpenCV's models"
                expected = (
                    f"{', '.join(map(str, counts))} coefficients of {model}, up to {lens.MAX_COEFFICIENT:g}"
                )
                got = f"{len(distortion)} coefficients {shown(distortion.tolist())}"
                raise self._refused("distortion", got, expected)
            self._set("distortion", distortion if distortion.any() or self.fisheye else None)
        if self.R is not None:
            self._set("R", self._rotation(np.asarray(self.R, dtype=np.float64)))
        if self.t is not None:
            t = np.array(self.t, dtype=np.float64).ravel()
            if t.shape != (3,) or not np.isfinite(t).all():
                raise self._refused("t", shown(t.tolist()), "three finite numbers")
            self._set("t", t)
        if self.size is not None:
            sides = tuple(self.size)
            if len(sides) != 2 or not all(side in range(1, MAX_PICTURE_SIDE + 1) for side in sides):
                expected = f"a width and a height in whole pixels, 1 to {MAX_PICTURE_SIDE:,}"
                raise self._refused("size", shown(sides), expected)
            self._set("size", (int(sides[0]), int(sides[1])))
        if self.up and self.up not in UP_AXES:
            raise self._refused("up", shown(self.up), f"one of {', '.join(UP_AXES)}")
        if not 0 <= self.deviation < 1:
            raise self._refused("deviation", f"{self.deviation:g}", "a fraction of the focal length below 1")

    def _rotation(self, given: Array) -> Array:
        """Return the rotation matrix nearest to a matrix (3, 3) with rounded entries."""
        with np.errstate(over="ignore", invalid="ignore"):
            off = np.abs(given @ given.T - np.eye(3)).max() if given.shape == (3, 3) else np.inf
        if not off <= ROTATION_ROUNDING:
            raise self._refused("R", shown(given.tolist()), "a rotation matrix of shape (3, 3)")
        rotation, values = best_rotation(given)
        if values[2] < 0:
            raise self._refused("R", "a mirroring matrix, of determinant -1", "a rotation")
        return rotation

    def _refused(self, field: str, got: str, expected: str) -> CameraError:
        source = f"camera {shown(self.name)}" if self.name else "camera"
        return refusal(source, field, got, expected, error=CameraError)  # type: ignore[return-value]

    @property
    def guessed(self) -> bool:
        """Whether the focal length is a guess."""
        return self.deviation > 0

    @property
    def position(self) -> Array | None:
        """The optical centre (3,) in the world, metres; None if the pose is unknown."""
        return None if self.R is None or self.t is None else np.asarray(-self.R.T @ self.t)

    def project(self, points: Array) -> Array:
        """Project points (..., 3), camera frame, metres, to pixels (..., 2).

        A pixel is NaN if its point is behind the camera, or outside the valid radius of the lens model
        (`lens.fold_radius`).
        """
        depth = points[..., 2:]
        normalized = points[..., :2] / np.where(depth > 0, depth, np.nan)
        if self.distortion is not None:
            fold = lens.fold_radius(self.distortion, fisheye=self.fisheye)
            inside = lens.lens_radius(normalized, fisheye=self.fisheye) <= fold
            normalized = lens.distort(normalized, self.distortion, fisheye=self.fisheye)
            normalized = np.where(inside[..., None], normalized, np.nan)
        return np.asarray(normalized @ self.K[:2, :2].T + self.K[:2, 2])

    def normalize(self, image: Array) -> Array:
        """Convert pixels (..., 2) to ideal image points (x/z, y/z); NaN if no ray projects to the pixel."""
        y = (image[..., 1] - self.K[1, 2]) / self.K[1, 1]
        x = (image[..., 0] - self.K[0, 2] - self.K[0, 1] * y) / self.K[0, 0]
        normalized = np.stack([x, y], axis=-1)
        if self.distortion is None:
            return normalized
        return lens.undistort(normalized, self.distortion, fisheye=self.fisheye)

    def jacobian(self, normalized: Array) -> Array:
        """Return the Jacobian (..., 2, 2) of pixels with respect to ideal image points (..., 2)."""
        scale = self.K[:2, :2]
        if self.distortion is None:
            return np.broadcast_to(scale, (*normalized.shape[:-1], 2, 2))
        return np.asarray(scale @ lens.lens_jacobian(normalized, self.distortion, fisheye=self.fisheye))

    def take(self, rows: Any) -> PinholeCamera:
        """Return this camera, because it is the same for all frames."""
        return self

    def fields(self, unit: str = "m") -> dict[str, Any]:
        """Return the camera as a mapping to write to a file, with t in `unit`."""
        optional = {
            "distortion": None if self.distortion is None else self.distortion.tolist(),
            "fisheye": self.fisheye,
            "R": None if self.R is None else self.R.tolist(),
            "t": None if self.t is None else from_metres(self.t, unit).tolist(),
            "size": None if self.size is None else list(self.size),
            "up": self.up,
            "name": self.name,
            "how": self.how if self.guessed else "",
            "deviation": self.deviation,
        }
        return {"model": "opencv", "K": self.K.tolist()} | {
            name: one for name, one in optional.items() if one
        }


def camera_from_fov(
    size: tuple[int, int],
    fov_degrees: float,
    axis: Literal["diagonal", "horizontal", "vertical"] = "diagonal",
    *,
    name: str = "",
    deviation: float = FOCAL_DEVIATION,
) -> PinholeCamera:
    r"""Guess a camera from its angle of view :math:`\alpha`: :math:`f = d / (2 \tan(\alpha / 2))`.

    Here d is the picture's diagonal, width or height (see `axis`), pixels. Pixels are square, the principal point is in
    the middle of the picture, and there is no distortion.

    Parameters
    ----------
    size : (int, int)
        Width and height of the whole picture, pixels.
    fov_degrees : float
        The angle of view, between 0 and 180 degrees.
    axis : str
        Direction in which the angle is measured: ``diagonal``, ``horizontal`` or ``vertical``.
    deviation : float
        Relative standard deviation of f.

    Raises
    ------
    CameraError
        If the angle, the size or the deviation has an impossible value.

    Examples
    --------
    >>> float(camera_from_fov((640, 480), 90, "horizontal").K[0, 0].round(6))
    320.0
    """
    if not 0 < fov_degrees < 180:
        raise refusal("camera", "fov", f"{fov_degrees:g}", "degrees between 0 and 180", error=CameraError)
    extents = {"diagonal": math.hypot(*size), "horizontal": size[0], "vertical": size[1]}
    f = extents[axis] / (2 * math.tan(math.radians(fov_degrees) / 2))
    how = f"a guess: {fov_degrees:g} degrees of view ({axis}), f within {100 * deviation:.0f} %"
    K = np.array([[f, 0.0, (size[0] - 1) / 2], [0.0, f, (size[1] - 1) / 2], [0.0, 0.0, 1.0]])
    return PinholeCamera(name=name, K=K, size=size, how=how, deviation=deviation)
