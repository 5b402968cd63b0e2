"""The pinhole camera: OpenCV's frame and distortion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.cameras.camera import Lift, meet_sphere
from posekit.errors import CameraError
from posekit.geometry import Array

UNDISTORTION_STEPS = 20

MAX_DISTORTION: Final = 1e9
"""Of a coefficient: no lens is near it, and products of five stay numbers."""


@dataclass(frozen=True, kw_only=True)
class PinholeCamera:
    r"""A perspective camera in OpenCV's convention: x right, y down, z forward, origin at the optical centre.

    Parameters
    ----------
    K : array (3, 3) or (F, 3, 3)
        Intrinsics; one for all frames, or one a frame. Finite, with positive focal lengths.
    distortion : array (5,), optional
        Brown's coefficients k1, k2, p1, p2, k3, as OpenCV orders them.

    Raises
    ------
    CameraError
        Where K or the distortion describe no camera.
    """

    K: Array
    distortion: Array | None = None

    def __post_init__(self) -> None:
        K = np.array(self.K, dtype=np.float64)
        if K.ndim not in (2, 3) or K.shape[-2:] != (3, 3) or not np.isfinite(K).all():
            raise CameraError(f"K must be finite, of shape (3, 3) or (F, 3, 3); got {K.tolist()}")
        if (K[..., 0, 0] <= 0).any() or (K[..., 1, 1] <= 0).any():
            raise CameraError(
                f"focal lengths must be positive; K has {K[..., 0, 0].min():g} and {K[..., 1, 1].min():g}"
            )
        if not np.allclose(K[..., 2, :], [0, 0, 1], rtol=0, atol=0) or (K[..., 1, 0] != 0).any():
            raise CameraError("K must be upper triangular with 1 in its last corner")
        K.flags.writeable = False
        object.__setattr__(self, "K", K)
        if self.distortion is not None:
            distortion = np.array(self.distortion, dtype=np.float64)
            if distortion.shape != (5,) or not (abs(distortion) <= MAX_DISTORTION).all():
                raise CameraError(
                    f"distortion must be five numbers k1, k2, p1, p2, k3 of {MAX_DISTORTION:g} at most; "
                    f"got {distortion.tolist()}"
                )
            distortion.flags.writeable = False
            object.__setattr__(self, "distortion", distortion)

    def project(self, points: Array) -> Array:
        r"""Project points to pixels.

        Parameters
        ----------
        points : array (F, ..., 3)
            Camera frame, metres; the first axis counts frames where K does.

        Returns
        -------
        array (F, ..., 2)
            Pixels; NaN for points that are not in front of the camera.
        """
        depth = points[..., 2:]
        normalized = points[..., :2] / np.where(depth > 0, depth, np.nan)
        if self.distortion is not None:
            normalized = distort(normalized, self.distortion)
        K = self._intrinsics(points.ndim)
        u = K[..., 0, 0] * normalized[..., 0] + K[..., 0, 1] * normalized[..., 1] + K[..., 0, 2]
        v = K[..., 1, 1] * normalized[..., 1] + K[..., 1, 2]
        return np.stack([u, v], axis=-1)

    def normalize(self, pixels: Array) -> Array:
        """Turn pixels (F, ..., 2) into undistorted image coordinates (x/z, y/z)."""
        K = self._intrinsics(pixels.ndim)
        y = (pixels[..., 1] - K[..., 1, 2]) / K[..., 1, 1]
        x = (pixels[..., 0] - K[..., 0, 2] - K[..., 0, 1] * y) / K[..., 0, 0]
        normalized = np.stack([x, y], axis=-1)
        return normalized if self.distortion is None else undistort(normalized, self.distortion)

    def lift(self, start: Array, pixel: Array, length: Array, *, tolerance: float) -> Lift:
        """Find the ends of segments: see `posekit.cameras.camera.meet_sphere`.

        Parameters
        ----------
        start : array (F, ..., 3)
            Known ends, camera frame, metres.
        pixel : array (F, ..., 2)
            Where the other ends are seen.
        length : array broadcastable to (F, ...)
            Lengths, metres.
        tolerance : float
            Metres by which a segment may be too short for its image.
        """
        normalized = self.normalize(pixel)
        direction = np.concatenate([normalized, np.ones_like(normalized[..., :1])], axis=-1)
        direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
        return meet_sphere(np.zeros(3), direction, start, length, tolerance=tolerance)

    def _intrinsics(self, ndim: int) -> Array:
        """Shape K so that it broadcasts against an array of `ndim` axes less its last."""
        if self.K.ndim == 2:
            return self.K
        return self.K.reshape(self.K.shape[0], *(1,) * (ndim - 2), 3, 3)


def distort(normalized: Array, distortion: Array) -> Array:
    """Apply Brown's radial and tangential distortion (Brown 1966; OpenCV's first five coefficients)."""
    k1, k2, p1, p2, k3 = distortion
    x, y = normalized[..., 0], normalized[..., 1]
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        ],
        axis=-1,
    )


def fold_radius(distortion: Array) -> float:
    r"""Return the radius in (x/z, y/z) where the radial distortion turns back; infinite where it never does.

    The first zero of :math:`d/dr\,(r + k_1 r^3 + k_2 r^5 + k_3 r^7)`. Beyond it a polynomial fitted to a lens
    says nothing about the lens.
    """
    k1, k2, _, _, k3 = distortion
    # In 1 / r^2: the leading coefficient is one, however small the lens's own are.
    roots = np.roots([1.0, 3 * k1, 5 * k2, 7 * k3])
    turning = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)]
    return float(1 / np.sqrt(turning.max())) if len(turning) else np.inf


def undistort(distorted: Array, distortion: Array) -> Array:
    """Invert `distort` by Newton's method; NaN where no ray inside `fold_radius` reaches the pixel."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # where it diverges
        normalized = _newton(distorted, distorted, distortion)
        error = np.abs(distort(normalized, distortion) - distorted).max(axis=-1, keepdims=True)
        radius = np.linalg.norm(normalized, axis=-1, keepdims=True)
        return np.where((error < 1e-9) & (radius <= fold_radius(distortion)), normalized, np.nan)


def _newton(normalized: Array, distorted: Array, distortion: Array) -> Array:
    k1, k2, p1, p2, k3 = distortion
    for _ in range(UNDISTORTION_STEPS):
        x, y = normalized[..., 0], normalized[..., 1]
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3))
        xx = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x
        yy = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x
        xy = x * y * slope + 2 * p1 * x + 2 * p2 * y
        error = distort(normalized, distortion) - distorted
        determinant = xx * yy - xy * xy
        step_x = (yy * error[..., 0] - xy * error[..., 1]) / determinant
        step_y = (xx * error[..., 1] - xy * error[..., 0]) / determinant
        normalized = normalized - np.stack([step_x, step_y], axis=-1)
    return normalized
