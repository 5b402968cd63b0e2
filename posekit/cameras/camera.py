"""What the tree asks of a camera, and the ray-sphere intersection behind every lift."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array

COINCIDENT_METRES = 1e-7
"""Half the distance (m) between the two candidates below which they count as one.

The candidates are at the foot of the perpendicular on the ray, plus and minus ``sqrt(l^2 - h^2)``. Rounding
leaves about 1e-15 m^2 under the root a few metres away, so this is as near as the two can be told apart.
"""


class Lift(NamedTuple):
    """The ends that a segment can have.

    Attributes
    ----------
    points : array (..., 2, 3)
        The nearer and the farther candidate, camera frame, metres. NaN where the ray is unknown.
    valid : bool array (..., 2)
        Whether each is a solution: both, the nearer alone (tangent, both coincide), or none.
    excess : array (...)
        Distance from the segment's start to the ray less the segment's length, metres: positive where the
        segment is too short for its image.
    """

    points: Array
    valid: NDArray[np.bool_]
    excess: Array


class Camera(Protocol):
    """Anything that projects points and lifts segments."""

    def project(self, points: Array) -> Array:
        """Project points (F, ..., 3), camera frame, to image points (F, ..., 2)."""
        ...

    def lift(self, start: Array, pixel: Array, length: Array, *, tolerance: float) -> Lift:
        """Find the ends of segments from `start` (F, ..., 3) of `length` (m) seen at `pixel` (F, ..., 2)."""
        ...


def meet_sphere(origin: Array, direction: Array, start: Array, length: Array, *, tolerance: float) -> Lift:
    r"""Meet the ray of a pixel with the sphere of a segment's ends.

    With the foot of the perpendicular from the start :math:`s` on the ray at parameter :math:`t_0`, and
    :math:`h` the distance between the two, the ends are at :math:`t_0 \pm \sqrt{l^2 - h^2}` (Lee & Chen 1985,
    eqs. 6-7, solved for the ray's parameter instead of k).

    Parameters
    ----------
    origin, direction : array (..., 3)
        The ray, its direction of unit length; parameters below zero are behind the camera.
    start : array (..., 3)
        The segment's known end, metres.
    length : array (...)
        The segment's length, metres.
    tolerance : float
        Metres by which the ray may pass outside the sphere and still be taken as tangent to it.

    Returns
    -------
    Lift
    """
    offset = start - origin
    along = np.einsum("...i,...i->...", offset, direction)
    height = np.linalg.norm(offset - along[..., None] * direction, axis=-1)
    half = np.sqrt(np.maximum((length - height) * (length + height), 0.0))
    tangent = half <= COINCIDENT_METRES
    half = np.where(tangent, 0.0, half)
    depth = along[..., None] + np.stack([-half, half], axis=-1)
    excess = height - length
    reachable = excess <= np.maximum(tolerance, 0.0)
    valid = reachable[..., None] & (depth > 0.0)
    valid[..., 1] &= ~tangent
    points = origin[..., None, :] + depth[..., None] * direction[..., None, :]
    return Lift(points, valid, excess)
