r"""How much room the picture leaves a limb: more beside the picture's plane than towards the camera.

A direction is a point of the sphere, and what is seen of it is its shadow: :math:`d\omega = dA / |\cos\theta|`,
:math:`\theta` being the angle with the ray. A segment that lies in the picture's plane stands for more directions
than one that points to the camera; a posture's probability is the density of its directions times their room.
Noise has no edge: near the plane the room is that of :math:`\sqrt{\cos^2\theta + c^2}`.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from posekit.geometry import Array, dot
from posekit.ranking.directions import SEGMENT_ENDS, SEGMENT_STARTS

LEAST_COSINE: Final = 0.2
"""c: noise of a few pixels, or lengths known to some hundredths, hide a slope of ten degrees."""

USUAL_LOG_ROOM: Final = 1 - 0.5 * math.log(1 + LEAST_COSINE**2) - LEAST_COSINE * math.atan(1 / LEAST_COSINE)
"""The average over directions that are spread evenly, of one segment."""


def log_room(joints: Array) -> Array:
    """Return the logarithm of the room that the picture leaves limbs, above its average (N,).

    Parameters
    ----------
    joints : array (14, 3, N)
        Camera frame, any unit. Where a joint is behind the camera's centre, rays are parallel to z. A segment with an
        unknown end counts nothing.
    """
    parallel = (joints[:, 2] <= 0).any(axis=0)
    z = np.array([0.0, 0.0, 1.0])[:, None]
    start, end = joints[SEGMENT_STARTS], joints[SEGMENT_ENDS]
    along, ray = end - start, np.where(parallel, z, end)
    across = dot(along, along, axis=-2) * dot(ray, ray, axis=-2)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine_square = dot(along, ray, axis=-2) ** 2 / across
    each = -0.5 * np.log(cosine_square + LEAST_COSINE**2) - USUAL_LOG_ROOM
    return np.asarray(np.nan_to_num(each).sum(axis=0))
