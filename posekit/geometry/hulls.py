"""Distances from convex hulls."""

from __future__ import annotations

import itertools

import numpy as np

from posekit.geometry.vectors import Array, unit


def beyond_hull(points: Array, corners: Array, normal: Array) -> Array:
    r"""Return the signed distances of points from convex hulls, both projected onto a plane.

    The signed distance of a point x from the convex hull of corners :math:`p_i` is :math:`\max_u (u \cdot x - \max_i u
    \cdot p_i)` over unit directions u. The maximum is at the normal of an edge, or at the direction from the nearest
    corner to the point.

    Parameters
    ----------
    points : array (T, 3)
        Points, metres.
    corners : array (T, P, 3)
        Corners of each hull, metres; a corner that is NaN is ignored.
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
    # If the point is the hull's only corner, no direction leads from the corner to it: the distance is zero.
    on_it = (at[:, None] == corners).all(axis=2).any(axis=1)
    return np.asarray(np.where(np.isnan(beyond) & on_it, 0.0, beyond))
