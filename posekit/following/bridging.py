"""What a path does not know: joints of frames that it passes over, and joints that were not seen.

Between two frames in which a segment is known it turns from one direction to the other on the shortest way, at an even
rate (Shoemake 1985, "Animating rotation with quaternion curves", SIGGRAPH, for rotations), and its length goes from one
to the other: lengths that are equal stay. The neck moves on a straight line. Before the first such frame and after the
last, segments keep their direction, and the neck its velocity for a while.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.following.channels import directions
from posekit.geometry import Array, cross
from posekit.skeleton import TREE_SEGMENTS

COASTING_SECONDS: Final = 0.2
"""Seconds for which the neck keeps its velocity where nothing is known any more; then it stands."""


def bridge(time: Array, joints: Array) -> Array:
    """Fill in the joints that are not known.

    Parameters
    ----------
    time : array (T,)
        Seconds, ascending.
    joints : array (T, 14, 3)
        Camera frame, metres; NaN where not known.

    Returns
    -------
    array (T, 14, 3)
        NaN where a joint is never known, and nothing that it could hang from.
    """
    unknown = np.isnan(joints[..., 0])
    if not unknown.any():
        return joints.copy()
    unit, length = directions(joints)
    filled = joints.copy()
    filled[:, 0] = _moving(time, joints[:, 0])
    for segment, (start, end) in enumerate(TREE_SEGMENTS):
        rows = np.flatnonzero(unknown[:, end])
        if not len(rows):
            continue
        known = np.flatnonzero(~np.isnan(length[:, segment]))
        if len(known):
            along = _turning(time, unit[:, segment], length[:, segment], known, rows)
            filled[rows, end] = filled[rows, start] + along
        # Where that gives nothing (the start is not known, or the direction never is), the end is followed by itself.
        lost = rows[np.isnan(filled[rows, end, 0])]
        filled[lost, end] = _moving(time, joints[:, end])[lost]
    return filled


def _between(
    time: Array, known: NDArray[np.intp], rows: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Find the known frames before and after some, and how far on the way each is; at the ends both are the nearest."""
    place = np.searchsorted(known, rows)
    before = known[np.clip(place - 1, 0, len(known) - 1)]
    after = known[np.clip(place, 0, len(known) - 1)]
    before = np.where(place == 0, after, before)
    after = np.where(place == len(known), before, after)
    gap = time[after] - time[before]
    part = np.where(gap > 0, (time[rows] - time[before]) / np.where(gap > 0, gap, 1.0), 0.0)
    return before, after, part


def _moving(time: Array, points: Array) -> Array:
    """Fill in points (T, 3): straight on between known ones, coasting at the ends."""
    known = np.flatnonzero(~np.isnan(points[:, 0]))
    if not len(known):
        return points.copy()
    rows = np.flatnonzero(np.isnan(points[:, 0]))
    before, after, part = _between(time, known, rows)
    filled = points.copy()
    filled[rows] = points[before] + part[:, None] * (points[after] - points[before])
    # Before the first and after the last known point the mean velocity of the nearest ones is kept for a while.
    for edge, outside in ((known[0], rows < known[0]), (known[-1], rows > known[-1])):
        near = known[np.abs(time[known] - time[edge]) <= COASTING_SECONDS]
        if len(near) > 1 and outside.any():
            first, last = near[0], near[-1]
            velocity = (points[last] - points[first]) / (time[last] - time[first])
            away = np.clip(time[rows[outside]] - time[edge], -COASTING_SECONDS, COASTING_SECONDS)
            filled[rows[outside]] = points[edge] + away[:, None] * velocity
    return filled


def _turning(
    time: Array, unit: Array, length: Array, known: NDArray[np.intp], rows: NDArray[np.intp]
) -> Array:
    """Return segments (len(rows), 3) on the way between known ones."""
    before, after, part = _between(time, known, rows)
    a, b = unit[before], unit[after]
    sine = np.linalg.norm(cross(a, b), axis=1)
    angle = np.arctan2(sine, (a * b).sum(axis=1))
    level = sine < 1e-9  # the same, or opposite: no way is shortest
    safe = np.where(level, 1.0, sine)
    turned = (np.sin((1 - part) * angle) / safe)[:, None] * a + (np.sin(part * angle) / safe)[:, None] * b
    turned = np.where(level[:, None], np.where((part < 0.5)[:, None], a, b), turned)
    return np.asarray(turned * (length[before] + part * (length[after] - length[before]))[:, None])
