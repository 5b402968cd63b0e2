"""The base class of cameras: the ray of each image point, and a joint's near and far positions on its ray."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar, Final, NamedTuple

import numpy as np

from posekit.errors import CameraError, refusal, shown
from posekit.geometry import FARTHEST_COORDINATE, Array, Flags, Record, dot, norm, read_only

#: Half the distance (m) between the near and the far position below which they count as one.
#:
#: Both are at the distance ``sqrt(l^2 - h^2)`` from the foot of the perpendicular on the ray (see `meet_sphere`). At a
#: few metres from the camera, ``l^2 - h^2`` has a rounding error of about 1e-15 m^2, so closer positions cannot be
#: distinguished.
COINCIDENT_METRES: Final = 1e-7


class Lift(NamedTuple):
    """The near and far positions of a segment's end on the ray of its image point.

    Attributes
    ----------
    points : array (..., 2, 3)
        The near and the far position, camera frame, metres. Both are NaN if the ray is unknown.
    valid : bool array (..., 2)
        Whether each position is in front of the camera and at the segment's length from its start. If both positions
        coincide, only the near one is valid.
    excess : array (...)
        Distance from the segment's start to the ray minus the segment's length, metres. A positive value means that the
        segment is too short to reach the ray.
    """

    points: Array
    valid: Flags
    excess: Array


class Camera(Record):
    """Base class of the three camera models.

    The camera frame is OpenCV's: x right, y down, z forward. Normalised image points are (x/z, y/z) for a perspective
    camera, and (x, y) in metres for the scaled orthographic camera. The first axis of every array is the index of the
    picture, because focal length or scale may differ between pictures.
    """

    #: Whether rays meet in the optical centre; otherwise they are parallel.
    perspective: ClassVar[bool] = True

    @abstractmethod
    def project(self, points: Array) -> Array:
        """Project points (F, ..., 3), camera frame, metres, to image points (F, ..., 2)."""

    @abstractmethod
    def normalize(self, image: Array) -> Array:
        """Convert image points (F, ..., 2) to normalised image points; NaN if no ray projects to the point."""

    @abstractmethod
    def jacobian(self, normalized: Array) -> Array:
        """Return the Jacobian (F, ..., 2, 2) of image points with respect to normalised image points (F, ..., 2)."""

    def rays(self, image: Array) -> tuple[Array, Array]:
        """Return origins and unit directions (F, ..., 3) of the rays of image points (F, ..., 2)."""
        direction = np.concatenate([self.normalize(image), np.ones_like(image[..., :1])], axis=-1)
        direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
        return np.zeros_like(direction), direction

    def lift(self, start: Array, rays: tuple[Array, Array], length: Array, *, tolerance: float) -> Lift:
        """Compute the near and far positions of segments' ends on their rays; see `meet_sphere`.

        Parameters
        ----------
        start : array (F, ..., 3)
            Known ends of the segments, camera frame, metres.
        rays : pair of arrays broadcastable to (F, ..., 3)
            Origins and unit directions of the rays of the other ends.
        length : array broadcastable to (F, ...)
            Lengths, metres.
        tolerance : float
            Distance by which a segment may be too short to reach its ray, metres.
        """
        return meet_sphere(*rays, start, length, tolerance=tolerance)


def meet_sphere(origin: Array, direction: Array, start: Array, length: Array, *, tolerance: float) -> Lift:
    r"""Intersect the ray of an image point with the sphere around a segment's start.

    The sphere's radius is the segment's length :math:`l`. The perpendicular from the start to the ray has length
    :math:`h`, and its foot is at distance :math:`t_0` from the ray's origin. The ray meets the sphere at the distances
    :math:`t_0 \pm \sqrt{l^2 - h^2}` from its origin (Lee & Chen 1985, eqs. 6-7).

    Parameters
    ----------
    origin, direction : array (..., 3)
        Origin and unit direction of the ray; negative distances along the ray are behind the camera.
    start : array (..., 3)
        The segment's known end, metres.
    length : array (...)
        The segment's length, metres.
    tolerance : float
        Distance by which the ray may miss the sphere and still count as tangent, metres.
    """
    offset = start - origin
    along = dot(offset, direction)
    height = norm(offset - along[..., None] * direction)
    half = np.sqrt(np.maximum((length - height) * (length + height), 0.0))
    tangent = half <= COINCIDENT_METRES
    half = np.where(tangent, 0.0, half)
    depth = along[..., None] + np.stack([-half, half], axis=-1)
    excess = height - length
    reachable = excess <= np.maximum(tolerance, 0.0)
    valid = reachable[..., None] & (depth > 0.0)
    valid[..., 1] &= ~tangent
    return Lift(origin[..., None, :] + depth[..., None] * direction[..., None, :], valid, excess)


def positive(name: str, value: float | Array | None) -> float | Array | None:
    """Check that a focal length or scale is positive; return it as a float or a read-only array (F,), or None.

    Raises
    ------
    CameraError
        If a value is not positive and finite.
    """
    if value is None:
        return None
    values = read_only(value)
    good = (values >= 1 / FARTHEST_COORDINATE) & (values <= FARTHEST_COORDINATE)
    if values.ndim > 1 or not good.all():
        expected = f"a number from {1 / FARTHEST_COORDINATE:g} to {FARTHEST_COORDINATE:g}, one or one a frame"
        raise refusal("camera", name, shown(values.tolist()), expected, error=CameraError)
    return values if values.ndim else float(values)


def per_frame(name: str, value: float | Array | None, ndim: int) -> Array:
    """Reshape a number, or an array (F,), so that it broadcasts against an array (F, ...) with `ndim` axes.

    Raises
    ------
    CameraError
        If the value is unknown.
    """
    if value is None:
        raise refusal("camera", name, "null", "a positive number", "give it", error=CameraError)
    values = np.asarray(value, dtype=np.float64)
    return values.reshape(*values.shape, *(1,) * (ndim - 1)) if values.ndim else values
