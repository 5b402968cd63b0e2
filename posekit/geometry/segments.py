"""The distance between two line segments."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry.vectors import Array, cross, dot

#: Squared sine of the angle between two segments; below it they count as parallel.
PARALLEL: Final = 1e-30


def segment_distance(gap: Array, half_a: Array, half_b: Array) -> Array:
    r"""Return the distance between two segments, in closed form.

    Points of segment a are :math:`s\,h_a` and points of segment b are :math:`g + t\,h_b`, with s and t in [-1, 1], gap
    g and half segments h. The unconstrained minimiser is clamped in s; then t is computed and clamped, and s is
    computed again (Ericson 2005, *Real-Time Collision Detection*, §5.1.9). For nearly parallel segments this solution
    is ill-conditioned, so the distances of the four ends from the other segment are computed as well.

    Parameters
    ----------
    gap : array (N, 3)
        Vector from the middle of segment a to the middle of segment b, metres.
    half_a, half_b : array (N, 3)
        Vector from the middle of each segment to one of its ends, metres; zero for a point.

    Returns
    -------
    array (N,)
    """
    aa, bb, ab = dot(half_a, half_a), dot(half_b, half_b), dot(half_a, half_b)
    ag, bg, normal = dot(half_a, gap), dot(half_b, gap), cross(half_a, half_b)
    determinant = dot(normal, normal)
    parallel = determinant <= PARALLEL * aa * bb
    aa, bb = np.where(aa > 0, aa, 1.0), np.where(bb > 0, bb, 1.0)
    # Lagrange's identity: the products of cross products keep the digits that aa bb - ab^2 cancels.
    s = np.where(parallel, 0.0, dot(normal, cross(gap, half_b)) / np.where(parallel, 1.0, determinant))
    inner, one = np.clip((np.clip(s, -1.0, 1.0) * ab - bg) / bb, -1.0, 1.0), np.ones(len(gap))
    least = np.full(len(gap), np.inf)
    tried = [(np.clip((ag + t * ab) / aa, -1.0, 1.0), t) for t in (inner, -one, one)]
    tried += [(s, np.clip((s * ab - bg) / bb, -1.0, 1.0)) for s in (-one, one)]
    for s, t in tried:
        apart = gap + t[:, None] * half_b - s[:, None] * half_a
        least = np.minimum(least, dot(apart, apart))
    return np.asarray(np.sqrt(least))
