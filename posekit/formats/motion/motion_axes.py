"""Axes: turn a motion so that another axis points up, exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from posekit.formats.motion.motion import UP_DIRECTIONS, Motion
from posekit.geometry import Array, cross, cross_matrix


def up_rotation(start: str, end: str) -> Array:
    """Return the rotation (3, 3) that takes one axis into another: ``+z`` into ``+y``.

    All go by +z, so that whoever turns in two steps faces where one step takes him: a body in TRC, BVH and C3D is the
    same way round. Its entries are 0, 1 and -1: coordinates change places and signs and nothing is rounded.
    """
    return _from_z(end) @ _from_z(start).T


def _from_z(end: str) -> Array:
    """Return the least rotation that takes +z into an axis; half a turn is about x."""
    z, up = UP_DIRECTIONS["+z"], UP_DIRECTIONS[end]
    axis = cross(z, up)
    if not axis.any():
        return np.diag([1.0, up[2], up[2]])
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
