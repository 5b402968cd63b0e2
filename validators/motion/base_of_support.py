"""How far points are from over what bears a body."""

from __future__ import annotations

import itertools

import numpy as np

from posekit.geometry import Array


def beyond_support(points: Array, bearing: Array, up: Array) -> Array:
    r"""Return how far points are, along the ground, beyond the convex hull of what bears.

    The distance from a convex set is :math:`\max_u \, u \cdot x - \max_i u \cdot p_i` over directions u: it is
    greatest for the normal of an edge, or for the way from the nearest corner.

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
    across = np.stack([first, np.cross(up, first)], axis=1)
    at, corners = points @ across, bearing @ across
    one, other = zip(*itertools.permutations(range(corners.shape[1]), 2), strict=True)
    edges = corners[:, other] - corners[:, one]
    normals = edges[..., ::-1] * [1.0, -1.0]
    ways = np.concatenate([normals, at[:, None] - corners], axis=1)
    lengths = np.linalg.norm(ways, axis=2, keepdims=True)
    ways = ways / np.where(lengths > 0, lengths, np.nan)
    reach = np.fmax.reduce(np.einsum("tdi,tpi->tdp", ways, corners), axis=2)
    beyond = np.fmax.reduce(np.einsum("tdi,ti->td", ways, at) - reach, axis=1)
    # On the only corner there is no way from it.
    on_it = (at[:, None] == corners).all(axis=2).any(axis=1)
    return np.asarray(np.where(np.isnan(beyond) & on_it, 0.0, beyond))
