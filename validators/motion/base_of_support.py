"""How far points are from over what bears a body."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array

HULL_DIRECTIONS: Final = 96
"""Of which edges of supports are taken: distances are short by 0.05 % at most."""


def beyond_support(points: Array, bearing: Array, up: Array) -> Array:
    r"""Return how far points are, along the ground, beyond the convex hull of what bears.

    The distance from a convex set is :math:`\max_u \, u \cdot x - \max_i u \cdot p_i` over directions u.

    Parameters
    ----------
    points : array (T, 3)
        Metres.
    bearing : array (T, P, 3)
        The corners; NaN where one bears nothing.
    up : array (3,)
        The unit vector against gravity.

    Returns
    -------
    array (T,)
        Metres; negative inside, by how deep; NaN where nothing bears, or the point is not known.
    """
    first = np.cross(up, np.eye(3)[np.abs(up).argmin()])
    first = first / np.linalg.norm(first)
    angle = np.arange(HULL_DIRECTIONS) * (2 * np.pi / HULL_DIRECTIONS)
    around = np.outer(np.cos(angle), first) + np.outer(np.sin(angle), np.cross(up, first))
    beyond = np.full(len(points), -np.inf)
    for direction in around:
        beyond = np.maximum(beyond, points @ direction - np.fmax.reduce(bearing @ direction, axis=1))
    return beyond
