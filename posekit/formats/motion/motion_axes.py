"""Axes: turn a motion so that another axis points up, exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from posekit.formats.motion.motion import UP_DIRECTIONS, Motion
from posekit.geometry import Array, cross, cross_matrix


def up_rotation(start: str, end: str) -> Array:
    """Return the rotation (3, 3), a quarter or half turn, that takes one axis into another: ``+z`` into ``+y``.

    Its entries are 0, 1 and -1: coordinates change places and signs and nothing is rounded.
    """
    a, b = UP_DIRECTIONS[start], UP_DIRECTIONS[end]
    axis = cross(a, b)
    if not axis.any():
        across = np.roll(a, 1) ** 2  # half a turn about an axis square to both
        return np.eye(3) if start == end else 2 * np.outer(across, across) - np.eye(3)
    K = cross_matrix(axis)
    return np.asarray(np.eye(3) + K + K @ K)


def with_up(motion: Motion, up: str) -> Motion:
    """Turn a motion so that `up` points up; one whose up is not known stays as it is."""
    if motion.up in ("", up):
        return motion
    R = up_rotation(motion.up, up)
    source = np.argmax(np.abs(R), axis=1)  # by columns, for a missing point times zero is still missing
    points = motion.points[..., source] * R[np.arange(3), source]
    return replace(motion, points=points, up=up)
