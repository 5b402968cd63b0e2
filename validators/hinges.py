"""Elbows and knees that bend backward, found by comparison with neighbouring frames.

Two directions alone do not separate a limb that bends backward from one that is turned by half a turn about its upper
segment. Motion does: an arm turns about itself by a few degrees a frame, not by half a turn.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, cross, dot, unit

#: Bend from which a frame shows the axis of its hinge, degrees: carrying angles turn it by 35 at most.
BENT_DEGREES: Final = 20.0

#: Bend from which a hinge is read by the axis of its neighbours, degrees.
LEAST_DEGREES: Final = 8.0

#: Cosine between the axis of a frame and that of its neighbours below which the hinge bends backward.
OPPOSITE_COSINE: Final = -0.8

#: Time to the neighbours that show the axis, seconds: within it people seldom turn a straight arm by half a turn.
NEAR_SECONDS: Final = 1.0


def bent_backward(upper: Array, lower: Array, legal: NDArray[np.bool_], dt: float) -> Array:
    """Return the flexion of hinges that bend backward as their neighbours show.

    Parameters
    ----------
    upper, lower : array (T, 3)
        Unit directions of the two segments, frame after frame.
    legal : bool array (T,)
        Whether the limb is within its ranges if the hinge bends forward.
    dt : float
        Seconds from a frame to the next.

    Returns
    -------
    array (T,)
        Degrees, negative; NaN for frames in which nothing shows that the hinge bends backward.
    """
    count = len(upper)
    found = np.full(count, np.nan)
    normal = cross(upper, lower)
    bend = np.degrees(np.arctan2(np.sqrt(dot(normal, normal)), dot(upper, lower)))
    shows = np.flatnonzero(legal & (bend >= BENT_DEGREES))
    asked = np.flatnonzero(~legal & (bend >= LEAST_DEGREES) | (bend >= LEAST_DEGREES) & (bend < BENT_DEGREES))
    if not len(shows) or not len(asked) or not dt > 0:
        return found
    axis = unit(normal)
    after = np.searchsorted(shows, asked)
    opposite = np.zeros(len(asked), dtype=np.bool_)
    agree = np.ones(len(asked), dtype=np.bool_)
    for neighbour in (after - 1, after):
        inside = (neighbour >= 0) & (neighbour < len(shows))
        other = shows[np.clip(neighbour, 0, len(shows) - 1)]
        near = inside & (np.abs(other - asked) * dt <= NEAR_SECONDS)
        # The shortest rotation from one upper segment to the other carries the axis along.
        a, b = upper[other], upper[asked]
        carried = axis[other] - (dot(axis[other], b) / np.maximum(1.0 + dot(a, b), 0.1))[:, None] * (a + b)
        turned = dot(carried, axis[asked]) < OPPOSITE_COSINE
        opposite |= near & turned
        agree &= ~near | turned
    backward = asked[opposite & agree]
    found[backward] = -bend[backward]
    return found
