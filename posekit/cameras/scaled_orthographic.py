"""The scaled orthographic camera of an uncalibrated picture (Taylor 2000, eq. 1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posekit.cameras.camera import COINCIDENT_METRES, Lift
from posekit.errors import CameraError
from posekit.geometry import Array

BOUND_ROUNDING = 1e-15
"""Of the coordinates: at the bound of s the segment that sets it must not fail, nor split in two, by its last bits."""


@dataclass(frozen=True, kw_only=True)
class ScaledOrthographicCamera:
    r"""A camera far away: all of the body is seen at one scale, :math:`(u, v) = s\,(x, y)` (Taylor 2000, eq. 1).

    The frame is OpenCV's: x right, y down, z forward; its origin is the image's, and its depth is arbitrary.

    Parameters
    ----------
    scale : float or array (F,)
        s, pixels a metre (or a unit of length); one for all frames, or one a frame. Finite and positive.
    aspect : float
        Width of a pixel over its height, where it is not square: u is rescaled by it, and s counts in v.

    Raises
    ------
    CameraError
        Where the scale or the aspect ratio is not finite and positive.
    """

    scale: float | Array
    aspect: float = 1.0

    def __post_init__(self) -> None:
        scale = np.array(self.scale, dtype=np.float64)
        if scale.ndim > 1 or not (np.isfinite(scale) & (scale > 0)).all():
            raise CameraError(f"scale must be finite and positive, one or one a frame; got {scale.tolist()}")
        if not (np.isfinite(self.aspect) and self.aspect > 0):
            raise CameraError(f"aspect must be finite and positive; got {self.aspect:g}")
        scale.flags.writeable = False
        object.__setattr__(self, "scale", scale)

    def project(self, points: Array) -> Array:
        """Project points (F, ..., 3), metres, to pixels (F, ..., 2)."""
        image: Array = points[..., :2] * self._scale(points.ndim) / np.array([self.aspect, 1.0])
        return image

    def unproject(self, pixels: Array) -> Array:
        """Turn pixels (F, ..., 2) into x, y (F, ..., 2), metres: all but the depth is known."""
        place: Array = pixels * np.array([self.aspect, 1.0]) / self._scale(pixels.ndim)
        return place

    def lift(self, start: Array, pixel: Array, length: Array, *, tolerance: float) -> Lift:
        r"""Find the ends of segments: the start's depth, less or more :math:`dZ = \sqrt{l^2 - |\Delta xy|^2}`.

        (Taylor 2000, eq. 2.) Nothing is behind this camera.

        Parameters
        ----------
        start : array (F, ..., 3)
            Known ends, metres.
        pixel : array (F, ..., 2)
            Where the other ends are seen.
        length : array broadcastable to (F, ...)
            Lengths, metres.
        tolerance : float
            Metres by which a segment may be too short for its image.
        """
        place = self.unproject(pixel)
        apart = np.linalg.norm(place - start[..., :2], axis=-1)
        lost = BOUND_ROUNDING * (length + np.abs(place).max(axis=-1) + np.abs(start[..., :2]).max(axis=-1))
        squared = np.maximum((length - apart) * (length + apart), 0.0)
        # Lengths may be relative, hence large: what is coincident grows with them.
        tangent = squared <= (COINCIDENT_METRES * np.maximum(length, 1.0)) ** 2 + 2 * length * lost
        half = np.where(tangent, 0.0, np.sqrt(squared))
        depth = start[..., 2, None] + np.stack([-half, half], axis=-1)
        excess = apart - length
        reachable = excess <= max(tolerance, 0.0) + lost
        valid = np.stack([reachable, reachable & ~tangent], axis=-1)
        points = np.concatenate(
            [np.broadcast_to(place[..., None, :], (*depth.shape, 2)), depth[..., None]], axis=-1
        )
        return Lift(points, valid, excess)

    def _scale(self, ndim: int) -> Array:
        """Shape the scale so that it broadcasts against an array of `ndim` axes."""
        scale = np.asarray(self.scale)
        return scale.reshape(*scale.shape, *(1,) * (ndim - 1)) if scale.ndim else scale
