r"""Where each joint is with 95 %, whichever of the postures it is.

A joint's places are a mixture of Gaussians, one a body. Bodies whose joint is within 5 cm are put together into one
mode with their mean and covariance: :math:`f(x) = \sum_m p_m N(x; \mu_m, \Sigma_m)`. The region is where this density
is highest, :math:`\{x: f(x) \ge \lambda\}` (Hyndman 1996, The American Statistician 50:120), with :math:`\lambda` such
that it holds 95 % of the mixture of all bodies. It has as many parts as the joint has places.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.answers.cover import cover
from posekit.answers.listed_bodies import ListedBodies
from posekit.display.short_repr import ShortRepr
from posekit.geometry import Array

REGION_PROBABILITY: Final = 0.95
"""What a region holds."""

MODE_METRES: Final = 0.05
"""Metres within which places of a joint are put together into one Gaussian with the mean and covariance of them all."""

MODES_HOLD: Final = 0.999
"""Of a joint's probability: what is left is spread over the modes."""

POINTS_OF_REGION: Final = 256
"""Points of the mixture by which its level is found."""

KRONECKER_ROOT: Final = 1.2207440846057596
"""The root of x^4 = x + 1."""

LOG_NORMALISER: Final = 1.5 * np.log(2 * np.pi)
LEAST_LOG_DENSITY: Final = -700.0
"""Of a point that is nowhere near: its exponential is just a number."""


@dataclass(frozen=True, kw_only=True, eq=False)
class JointRegions(ShortRepr):
    """The 95 % region of each of the 14 joints of a frame: as many modes as the joint has places.

    Parameters
    ----------
    mean : array (14, M, 3)
        The middle of each mode, camera frame, metres, the likeliest first; NaN where a joint has fewer.
    covariance : array (14, M, 3, 3)
        Square metres, likewise.
    probability : array (14, M)
        Of each mode; zero where a joint has fewer.
    level : array (14,)
        Logarithm of the density, per cubic metre, that the points of the region have at least; NaN where a joint is not
        known.
    """

    mean: Array
    covariance: Array
    probability: Array
    level: Array

    def __post_init__(self) -> None:
        for values in (self.mean, self.covariance, self.probability, self.level):
            values.flags.writeable = False

    def log_density(self, points: ArrayLike) -> Array:
        """Return the logarithm of the density of points (..., 14, 3), one a joint: (..., 14), per cubic metre."""
        x = np.asarray(points, dtype=np.float64)
        by_joint = np.moveaxis(x.reshape(-1, *x.shape[-2:]), 1, 0)
        density = _log_density(by_joint, self.mean, self.covariance, self.probability)
        return density.T.reshape(x.shape[:-1])

    def holds(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Return whether each joint's region holds its point (..., 14); no region of an unknown joint does."""
        return np.asarray(self.log_density(points) >= self.level)

    @property
    def radius(self) -> Array:
        """How many deviations from its middle each mode's ellipsoid reaches (14, M), taken alone; 0 if it does not."""
        peak = _log_peaks(_filled(self.covariance), self.probability) - self.level[:, None]
        return np.sqrt(2.0 * np.maximum(np.where(np.isnan(peak), 0.0, peak), 0.0))


def joint_regions(bodies: ListedBodies) -> JointRegions:
    """Find the regions of a frame."""
    joints, covariance = bodies.joints, bodies.covariance
    J = joints.shape[1]
    known = np.isfinite(joints).all(axis=-1) & np.isfinite(covariance).all(axis=(-2, -1))
    body, joint = np.nonzero(known)
    x, S, p = joints[known], covariance[known], bodies.probability[body]
    stands = cover(x[:, None], joint, p, within=MODE_METRES, hold=MODES_HOLD)
    kept = stands >= 0
    x, S, p, joint = x[kept], S[kept], p[kept], joint[kept]
    centre, mode = np.unique(stands[kept], return_inverse=True)
    weight = _summed(p, mode, len(centre))
    share = p / np.maximum(weight, np.finfo(float).tiny)[mode]
    mean = _summed(share[:, None] * x, mode, len(centre))
    off = x - mean[mode]
    spread = _summed(share[:, None, None] * (S + off[:, :, None] * off[:, None, :]), mode, len(centre))
    owner = np.empty(len(centre), dtype=np.intp)
    owner[mode] = joint
    order = np.lexsort((-weight, owner))
    count = np.bincount(owner, minlength=J)
    row, place = owner[order], np.arange(len(order)) - np.repeat(np.cumsum(count) - count, count)
    M = int(count.max(initial=0))
    means, covariances = np.full((J, M, 3), np.nan), np.full((J, M, 3, 3), np.nan)
    weights = np.zeros((J, M))
    means[row, place], covariances[row, place] = mean[order], spread[order]
    weights[row, place] = weight[order]
    weights /= np.maximum(weights.sum(axis=1, keepdims=True), np.finfo(float).tiny)
    density = _log_density(_drawn(bodies), means, covariances, weights)
    return JointRegions(mean=means, covariance=covariances, probability=weights, level=_levels(density))


def _drawn(bodies: ListedBodies) -> Array:
    """Draw points (14, S, 3) of the mixture of all bodies, evenly, without chance; NaN where one is not known."""
    below = np.cumsum(bodies.probability)
    if not len(below):
        return np.full((14, POINTS_OF_REGION, 3), np.nan)
    at = below[-1] * (np.arange(POINTS_OF_REGION) + 0.5) / POINTS_OF_REGION
    drawn, which = np.unique(np.searchsorted(below, at), return_inverse=True)
    covariance = bodies.covariance[drawn]
    root = np.linalg.cholesky(_filled(covariance))
    root[np.isnan(covariance).any(axis=(-2, -1))] = np.nan
    points = bodies.joints[drawn][which] + np.einsum(
        "sjab,sb->sja", root[which], even_normal(POINTS_OF_REGION)
    )
    return np.asarray(points.swapaxes(0, 1))


def _levels(density: Array) -> Array:
    """Find the log density (G,) above which 95 % of the points (G, S) are that are known; NaN where none is."""
    density = -np.sort(-density, axis=1)  # NaN comes last
    place = REGION_PROBABILITY * np.isfinite(density).sum(axis=1) - 0.5
    low = np.maximum(place.astype(np.intp), 0)
    ends = np.stack([low, np.minimum(low + 1, density.shape[1] - 1)], axis=1)
    at = np.take_along_axis(density, ends, axis=1)
    return np.asarray(at[:, 0] + (place - low) * (at[:, 1] - at[:, 0]))


@cache
def even_normal(count: int) -> Array:
    r"""Spread points (count, 3) as a standard normal distribution is, with nothing left to chance.

    Lengths are quantiles of Maxwell's distribution, :math:`F(r) = \mathrm{erf}(r / \sqrt 2) - \sqrt{2 / \pi} r
    e^{-r^2 / 2}`, directions are even on the sphere; both, and the order of points, are evenly mixed by multiples of
    three irrational numbers, powers of the root of :math:`x^4 = x + 1` (Roberts 2018, "The unreasonable effectiveness
    of quasirandom sequences").
    """
    at = np.modf(0.5 + np.arange(count)[:, None] * KRONECKER_ROOT ** -np.arange(1.0, 4.0))[0]
    r = np.linspace(0.0, 6.0, 1201)
    below = [math.erf(value / math.sqrt(2.0)) for value in r] - np.sqrt(2.0 / np.pi) * r * np.exp(
        -(r**2) / 2.0
    )
    height, turn = 1.0 - 2.0 * at[:, 1], 2.0 * np.pi * at[:, 2]
    across = np.sqrt(1.0 - height**2)
    direction = np.stack([across * np.cos(turn), across * np.sin(turn), height], axis=-1)
    return np.asarray(np.interp(at[:, :1], below, r) * direction)


def _log_density(x: Array, mean: Array, covariance: Array, weight: Array) -> Array:
    """Return log densities (G, S) of points (G, S, 3) in mixtures (G, M); NaN where no mode has any weight."""
    S = _filled(covariance)
    off = x[:, :, None] - np.nan_to_num(mean)[:, None]
    distance = np.einsum("gsmi,gmij,gsmj->gsm", off, np.linalg.inv(S), off, optimize=True)
    parts = _log_peaks(S, weight)[:, None] - 0.5 * distance
    top = parts.max(axis=-1, initial=LEAST_LOG_DENSITY)
    found = np.asarray(top + np.log(np.exp(parts - top[..., None]).sum(axis=-1) + np.exp(LEAST_LOG_DENSITY)))
    found[weight.sum(axis=-1) == 0.0] = np.nan
    return found


def _log_peaks(covariance: Array, weight: Array) -> Array:
    """Return the log density (G, M) in the middle of each mode, minus infinity where it has no weight."""
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(weight) - LOG_NORMALISER - 0.5 * np.linalg.slogdet(covariance)[1])


def _filled(covariance: Array) -> Array:
    return np.where(np.isnan(covariance), np.eye(3), covariance)


def _summed(values: Array, mode: NDArray[np.intp], modes: int) -> Array:
    out = np.zeros((modes, *values.shape[1:]))
    np.add.at(out, mode, values)
    return out
