"""Where the body goes in the frames of a sequence: the way of its neck, for rules of walking."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.validators.walking import SLOWEST_WALK

HALF_WINDOW_SECONDS: Final = 0.5
"""Seconds before and after a frame whose frames tell its heading: together about a stride, over which sway cancels."""

LEAST_SECONDS: Final = 0.3
"""Seconds that those must span at least."""

FASTEST_WALK: Final = 3.0
"""Metres a second above which nobody walks."""

STRAIGHT_METRES: Final = 0.1
"""Metres (root mean square) by which a walker's neck may leave the straight line; else frames are no sequence of one
camera that stands still, as photographs and virtual cameras, one a frame, are not."""


def headings(time: Array, frame: NDArray[np.intp], root: Array) -> Array:
    """Return the way that the body goes in each hypothesis of a sequence, as a camera that stands still sees it.

    The slope of a straight line through the necks around it: of each other frame the nearest one counts.

    Parameters
    ----------
    time : array (F,)
        Seconds.
    frame : int array (H,)
        The frame of each hypothesis, in order.
    root : array (H, 3)
        Its neck, metres.

    Returns
    -------
    array (H, 3)
        Unit vectors; NaN where nobody walks past a camera: the body is slower or faster, the camera goes along, or
        frames are no sequence.
    """
    found = np.full((len(root), 3), np.nan)
    first = np.searchsorted(frame, np.arange(len(time) + 1))
    for row in np.flatnonzero(np.isfinite(root).all(axis=1)).tolist():
        near = np.flatnonzero(np.abs(time - time[frame[row]]) <= HALF_WINDOW_SECONDS)
        necks = [_nearest(root[first[k] : first[k + 1]], root[row]) for k in near.tolist()]
        way, when = np.array(necks).reshape(-1, 3), time[near]
        known = np.isfinite(way).all(axis=1)
        if not known.any() or np.ptp(when[known]) < LEAST_SECONDS:
            continue
        since = when[known] - when[known].mean()
        velocity = since @ way[known] / (since @ since)
        off = way[known] - way[known].mean(axis=0) - since[:, None] * velocity
        speed = np.linalg.norm(velocity)
        if (
            SLOWEST_WALK <= speed <= FASTEST_WALK
            and np.sqrt((off * off).sum(axis=1).mean()) <= STRAIGHT_METRES
        ):
            found[row] = velocity / speed
    return found


def _nearest(points: Array, to: Array) -> Array:
    """Return the nearest of some points (N, 3); NaN where none is known."""
    apart = np.linalg.norm(points - to, axis=1)
    if not np.isfinite(apart).any():
        return np.full(3, np.nan)
    return np.asarray(points[np.nanargmin(apart)])
