r"""Find the point that does not fit the rest.

A head is fitted again without each of its points. If one point alone is wrong, the squared error falls to
what measuring leaves. For normal errors of unknown size, and one point chosen beforehand,

.. math:: F = \frac{(S - S_j)/2}{S_j / m}

follows Fisher's distribution with 2 and m degrees of freedom, m being what remains without the point (twice
its fellows, less the unknowns), and so :math:`P(F > x) = (1 + 2x/m)^{-m/2} = (S_j/S)^{m/2}` (the
mean-shift outlier test of Cook & Weisberg 1982, for a pair of observations). All P points are looked
at, hence the factor P (Bonferroni).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from posekit.cameras.head.fit import HeadFit, fit
from posekit.cameras.head.perspective import HeadPlacement, Heads, look
from posekit.cameras.head.starts import affine_start
from posekit.geometry import Array

FALSE_ALARMS = 5e-3
"""The chance that a head of sound points with normal errors has one of them named."""

ROUNDING_ERROR = 1e-10
"""Error, as a fraction of the head's size in the image, that is taken for rounding and never looked into."""

MISFIT_PRECISION = 1e-3
"""Fraction to which the squared error without a point is found: enough to judge it."""


def misfits(heads: Heads, plane: Array, fitted: HeadFit) -> tuple[NDArray[np.intp], Array, Array]:
    """Name the point that does not fit.

    Parameters
    ----------
    heads : Heads
        What is seen of the heads.
    plane : array (F, P, 2)
        The image points, normalised where K is known.
    fitted : HeadFit
        Of all points.

    Returns
    -------
    point : int array (F,)
        The row of the point, -1 where all fit.
    cost : array (F,)
        The squared error without it; NaN where all fit.
    chance : array (F,)
        The chance of so good a fit without one point, were all sound; 1 at most.
    """
    total, count = heads.seen.shape
    floor = ROUNDING_ERROR**2 * spread(heads)
    frames, points = np.nonzero((heads.seen > 0) & (fitted.cost > floor)[:, None])
    without = heads.take(frames)
    seen = without.seen.copy()
    seen[np.arange(len(points)), points] = 0.0
    without = without._replace(seen=seen)
    again = fit(without, _start(without, plane[frames], fitted.placement.take(frames)), MISFIT_PRECISION)
    left = np.full((total, count), np.inf)
    left[frames, points] = np.maximum(again.cost, floor[frames])
    point = left.argmin(axis=-1)
    cost = left[np.arange(total), point]
    n = heads.seen.sum(axis=-1)
    freedom = 2 * (n - 1) - heads.unknowns
    chance = np.minimum(n * (cost / fitted.cost) ** (freedom / 2), 1.0)
    chance = np.where(np.isfinite(cost), chance, 1.0)
    named = chance <= FALSE_ALARMS
    return np.where(named, point, -1), np.where(named, cost, np.nan), chance


def beyond_chance(chance: Array) -> NDArray[np.bool_]:
    """Say which of many heads have a misfit that is more than the accident of looking at many.

    Of the chances (F,), the k smallest where the k-th is at most k / F of `FALSE_ALARMS`, for the largest
    such k (Benjamini & Hochberg 1995): one head is judged as by `misfits`, among thousands an accident is
    not, and an error that all heads share is.
    """
    order = np.argsort(chance)
    allowed = FALSE_ALARMS * np.arange(1, len(chance) + 1) / max(len(chance), 1)
    below = np.flatnonzero(chance[order] <= allowed)
    beyond = np.zeros(len(chance), dtype=np.bool_)
    beyond[order[: below[-1] + 1 if below.size else 0]] = True
    return beyond


def _start(heads: Heads, plane: Array, placement: HeadPlacement) -> HeadPlacement:
    """Start from the placement of all points or, where that is led far astray, the orthographic view."""
    start = affine_start(heads.points, plane, heads.seen > 0, heads.K is not None)
    costs = []
    for candidate in (placement, start):
        residual, _, possible = look(heads, candidate)
        costs.append(np.where(possible, np.einsum("fi,fi->f", residual, residual), np.inf))
    better = costs[1] < costs[0]
    placement.put(better, start.take(better))
    return placement


def spread(heads: Heads) -> Array:
    """Sum of the squared distances of the image points from their mean, one a head."""
    weight = heads.seen[..., None]
    mean = (heads.image * weight).sum(axis=1, keepdims=True) / weight.sum(axis=1, keepdims=True)
    squares: Array = (((heads.image - mean) * weight) ** 2).sum(axis=(1, 2))
    return squares
