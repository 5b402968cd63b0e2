"""Frames in a wrong order, found by the motion alone."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, dot
from posekit.skeleton import JOINT
from posekit.validators.motion.sides import LEFT_JOINTS, RIGHT_JOINTS
from posekit.validators.motion.timeline import groups, norm

#: Joints that have no side.
MIDDLE_JOINTS: Final = (JOINT["neck"], JOINT["pelvis"])

#: Frames that are ordered at once; longer stretches are ordered in parts.
LONGEST_STRETCH: Final = 600

#: Length of the way through a stretch in the right order, at most, as a share of the way in the given order.
SHORTER_SHARE: Final = 0.6

#: Least number of frames out of place in a stretch.
LEAST_FRAMES: Final = 3

#: Least motion of a joint between frames that shows their order, metres.
LEAST_METRES: Final = 0.005

#: Least number of moving joints: one or two that turn back tremble.
LEAST_JOINTS: Final = 3

#: Frames per second from which motion shows the order: at fewer, people turn back between two frames.
ORDERED_RATE: Final = 20.0

#: Frames between two turns back of one stretch, at most.
TURNS_APART: Final = 6

#: Frames before and after a stretch that are ordered with it, so that its ends find their places.
AROUND_FRAMES: Final = 4


def displaced(joints: Array) -> NDArray[np.intp]:
    """Return the frames by which each frame is out of its place (T,); 0 where the motion is even.

    Parameters
    ----------
    joints : array (T, 14, 3)
        Metres, frame after frame.

    Notes
    -----
    Frames in a wrong order make most joints turn back from step to step. A stretch of such frames is put into the
    order that goes from its first neighbour to its last by a short way (each frame is inserted where it costs least:
    Rosenkrantz et al. 1977, SIAM J. Comput. 6:563); where that way is less than six tenths of the given one, the frames
    were out of order. Noise makes joints turn back, too, but no order of noisy frames is much shorter than another.
    """
    count = len(joints)
    places = np.zeros(count, dtype=np.intp)
    joints = _without_sides(joints)
    if count < LEAST_FRAMES + 2:
        return places
    steps = np.diff(joints, axis=0)
    moving = (norm(steps[1:]) > LEAST_METRES) & (norm(steps[:-1]) > LEAST_METRES)
    backward = (dot(steps[1:], steps[:-1]) < 0) & moving
    turning = np.zeros(count, dtype=np.bool_)
    turning[1:-1] = (2 * backward.sum(axis=1) > moving.sum(axis=1)) & (moving.sum(axis=1) >= LEAST_JOINTS)
    for first, last in _stretches(turning):
        rows = np.arange(max(first - AROUND_FRAMES, 0), min(last + AROUND_FRAMES + 1, count))
        rows = rows[np.isfinite(joints[rows]).all(axis=(1, 2))]
        if len(rows) >= LEAST_FRAMES + 2:
            order = _shortest(joints[rows].reshape(len(rows), -1))
            found = np.zeros(count, dtype=np.intp)
            found[rows[order]] = rows - rows[order]
            # Frames around it that go on evenly are in their places, though there may be a shorter way through them.
            near = slice(max(first - 2, 0), last + 3)
            places[near] = found[near]
    return places


def _without_sides(joints: Array) -> Array:
    """Return a posture without sides (T, 20, 3), metres, so that flickering labels are no wrong order.

    Neck, pelvis and the middles of pairs; and the vector d between a pair as its outer product with itself over its
    length, which is that of -d.
    """
    right, left = joints[:, RIGHT_JOINTS], joints[:, LEFT_JOINTS]
    across = (right - left) / 2.0
    lengths = np.maximum(norm(across), 1e-9)[..., None]
    squares, products = across**2 / lengths, across * np.roll(across, 1, axis=-1) / lengths
    return np.concatenate([joints[:, MIDDLE_JOINTS], (right + left) / 2.0, squares, products], axis=1)


def stretches_of(places: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return the frames (T,) of every stretch that holds frames out of place."""
    inside = np.zeros(len(places), dtype=np.bool_)
    for part in groups(np.flatnonzero(places), TURNS_APART):
        inside[part[0] : part[-1] + 1] = True
    return inside


def _stretches(turning: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return first and last of the stretches in which frames turn back, three of them or more."""
    found = []
    for part in groups(np.flatnonzero(turning), TURNS_APART):
        for first in range(int(part[0]), int(part[-1]) + 1, LONGEST_STRETCH):
            last = min(first + LONGEST_STRETCH - 1, int(part[-1]))
            if np.count_nonzero((part >= first) & (part <= last)) >= LEAST_FRAMES - 1:
                found.append((first, last))
    return found


def _shortest(points: Array) -> NDArray[np.intp]:
    """Return an order (N,) of points (N, K) with a short way from first to last; the given one where none is."""
    squares = (points**2).sum(axis=1)
    ways = np.sqrt(np.maximum(squares[:, None] + squares - 2 * points @ points.T, 0.0))
    given = np.arange(len(points))
    order = np.array([0, len(points) - 1])
    for point in given[1:-1]:
        costs = ways[order[:-1], point] + ways[point, order[1:]] - ways[order[:-1], order[1:]]
        order = np.insert(order, int(costs.argmin()) + 1, point)
    out_of_place = np.count_nonzero(order != given) >= LEAST_FRAMES
    return order if out_of_place and _length(order, ways) < SHORTER_SHARE * _length(given, ways) else given


def _length(order: NDArray[np.intp], ways: Array) -> float:
    return float(ways[order[:-1], order[1:]].sum())
