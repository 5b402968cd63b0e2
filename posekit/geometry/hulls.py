"""Distances from convex hulls."""

from __future__ import annotations

import itertools

import numpy as np

from posekit.geometry.vectors import Array, unit


def beyond_hull(points: Array, corners: Array, normal: Array) -> Array:
    r"""Return how far points are beyond convex hulls, along a plane.

    The distance from a convex set is :math:`\max_u \, u \cdot x - \max_i u \cdot p_i` over directions u: the maximum is
    at the normal of an edge, or at the direction from the nearest corner to x.

    Parameters
    ----------
    points : array (T, 3)
        Metres.
    corners : array (T, P, 3)
        Points that span the hulls; NaN where there is none.
    normal : array (3,)
        Unit normal of the plane.

    Returns
    -------
    array (T,)
        Signed distances, metres, negative inside; NaN if the hull has no corner or the point is unknown.
    """
    first = unit(np.cross(normal, np.eye(3)[np.abs(normal).argmin()]))
    across = np.stack([first, np.cross(normal, first)], axis=1)
    at, corners = points @ across, corners @ across
    one, other = zip(*itertools.permutations(range(corners.shape[1]), 2), strict=True)
    edges = corners[:, other] - corners[:, one]
    normals = edges[..., ::-1] * [1.0, -1.0]
    ways = unit(np.concatenate([normals, at[:, None] - corners], axis=1))
    reach = np.fmax.reduce(np.einsum("tdi,tpi->tdp", ways, corners), axis=2)
    beyond = np.fmax.reduce(np.einsum("tdi,ti->td", ways, at) - reach, axis=1)
    # A point on the only corner has no way from it.
    on_it = (at[:, None] == corners).all(axis=2).any(axis=1)
    return np.asarray(np.where(np.isnan(beyond) & on_it, 0.0, beyond))
