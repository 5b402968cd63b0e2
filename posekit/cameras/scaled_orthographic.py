"""The scaled orthographic camera of an uncalibrated picture (Taylor 2000, eq. 1)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from posekit.cameras.camera import COINCIDENT_METRES, Camera, Lift, per_frame, positive
from posekit.geometry import PER_METRE, Array

#: Relative rounding error of coordinates. At the smallest possible s one segment is parallel to the image; despite
#: rounding it must have exactly one possible end.
BOUND_ROUNDING: Final = 1e-15


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ScaledOrthographicCamera(Camera):
    r"""A distant camera with one scale for the whole body: :math:`(u, v) = s\,(x, y)` (Taylor 2000, eq. 1).

    The frame is OpenCV's: x right, y down, z forward. x and y are zero at the image's origin; depth has an arbitrary
    origin.

    Parameters
    ----------
    scale : float or array (F,), optional
        s, pixels per metre, one number or one per frame; None if unknown.
    aspect : float
        Ratio of a pixel's width to its height. u is multiplied by this ratio, so that the scale s fits both axes.

    Raises
    ------
    CameraError
        If the scale or the aspect ratio is not finite and positive.
    """

    perspective = False

    scale: float | Array | None
    aspect: float = 1.0

    def __post_init__(self) -> None:
        self._set("scale", positive("scale", self.scale))
        self._set("aspect", positive("aspect", self.aspect))

    def project(self, points: Array) -> Array:
        """Project points (F, ..., 3), metres, to pixels (F, ..., 2)."""
        scale = per_frame("scale", self.scale, points.ndim) / np.array([self.aspect, 1.0])
        return np.asarray(points[..., :2] * scale)

    def normalize(self, image: Array) -> Array:
        """Convert pixels (F, ..., 2) to x, y (F, ..., 2), metres; the depth remains unknown."""
        return np.asarray(image * np.array([self.aspect, 1.0]) / per_frame("scale", self.scale, image.ndim))

    def jacobian(self, normalized: Array) -> Array:
        """Return the Jacobian (F, ..., 2, 2) of pixels with respect to x, y (F, ..., 2), metres."""
        scale = per_frame("scale", self.scale, normalized.ndim) / np.array([self.aspect, 1.0])
        return np.asarray(np.broadcast_to(scale, normalized.shape)[..., None] * np.eye(2))

    def rays(self, image: Array) -> tuple[Array, Array]:
        """Return the rays of pixels (F, ..., 2): origins at depth 0 and directions (0, 0, 1), both (F, ..., 3)."""
        place = self.normalize(image)
        origin = np.concatenate([place, np.zeros_like(place[..., :1])], axis=-1)
        return origin, np.broadcast_to(np.array([0.0, 0.0, 1.0]), origin.shape)

    def lift(self, start: Array, rays: tuple[Array, Array], length: Array, *, tolerance: float) -> Lift:
        r"""Compute the near and far positions of segments' ends, at the start's depth minus and plus dZ.

        :math:`dZ = \sqrt{l^2 - |\Delta xy|^2}` (Taylor 2000, eq. 2), with the segment's length l and the difference
        :math:`\Delta xy` between the x and y of its ends. All depths are valid, because this camera has no optical
        centre.
        """
        place = rays[0][..., :2]
        apart = np.linalg.norm(place - start[..., :2], axis=-1)
        sizes = np.abs(place).max(axis=-1) + np.abs(start[..., :2]).max(axis=-1)
        rounding = BOUND_ROUNDING * (length + sizes)
        squared = np.maximum((length - apart) * (length + apart), 0.0)
        # Lengths may be relative and thus large, so the threshold of coincident candidates is proportional to them.
        tangent = squared <= (COINCIDENT_METRES * np.maximum(length, 1.0)) ** 2 + 2 * length * rounding
        half = np.where(tangent, 0.0, np.sqrt(squared))
        depth = start[..., 2, None] + np.stack([-half, half], axis=-1)
        excess = apart - length
        reachable = excess <= max(tolerance, 0.0) + rounding
        valid = np.stack([reachable, reachable & ~tangent], axis=-1)
        beside = np.broadcast_to(place[..., None, :], (*depth.shape, 2))
        return Lift(np.concatenate([beside, depth[..., None]], axis=-1), valid, excess)

    def take(self, rows: Any) -> ScaledOrthographicCamera:
        """Return the camera of the selected frames."""
        return replace(self, scale=self.scale[rows]) if isinstance(self.scale, np.ndarray) else self

    def fields(self, unit: str = "m") -> dict[str, Any]:
        """Return the camera as a mapping to write to a file, with the scale in pixels per `unit`."""
        scale = None if self.scale is None else (np.asarray(self.scale) / PER_METRE[unit]).tolist()
        fields: dict[str, Any] = {"model": "scaled-orthographic", "scale": scale}
        return fields if self.aspect == 1 else {**fields, "aspect": self.aspect}
