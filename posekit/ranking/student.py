r"""Student's t in several dimensions, and mixtures of it: what is far from the middle is no impossibility.

.. math::

    \log p(x) = c + \log \sum_k s_k \left(1 + \frac{(x - m_k)^T S^{-1} (x - m_k)}{\nu}\right)^{-(\nu + d) / 2}

Some of its coordinates alone have the same law, with their part of m and S (Kotz & Nadarajah 2004, Multivariate t
distributions and their applications, §1.10): unknown ones are left out by leaving them out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from posekit.geometry import Array

BLOCK_COLUMNS: Final = 512
"""Points that are judged together: few enough that their distances from all middles stay in the cache."""


MOST_WIDER = 16
"""Wider distributions that are kept: each way up that is asked for has its own."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StudentMixture:
    """A mixture of K t distributions of d coordinates that differ in their middles only.

    Parameters
    ----------
    means : array (K, d)
        The middles of the distributions: m. One middle (d,) is a t distribution.
    scale : array (d, d)
        Symmetric, positive definite: S.
    dof : float
        Degrees of freedom: the fewer, the heavier the tails.
    share : array (K,), optional
        How much each distribution counts: s, positive, taken in proportion; all the same if not given.
    """

    means: Array
    scale: Array
    dof: float
    share: Array | None = None

    def __post_init__(self) -> None:
        means = np.atleast_2d(np.array(self.means, dtype=np.float64))
        share = np.ones(len(means)) if self.share is None else np.array(self.share, dtype=np.float64)
        scale = np.array(self.scale, dtype=np.float64)
        for name, value in (("means", means), ("scale", scale), ("share", share / share.sum())):
            value.flags.writeable = False
            object.__setattr__(self, name, value)

    @property
    def shares(self) -> Array:
        """How much each distribution counts (K,), summing to one."""
        assert self.share is not None
        return self.share

    @cached_property
    def whitening(self) -> Array:
        """The lower triangular matrix W with W' W = S^-1: its first k rows whiten the first k coordinates."""
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.scale)))

    @cached_property
    def moments(self) -> StudentMixture:
        """The one t distribution with the same middle and, S being what is within each, the same spread."""
        mean = self.shares @ self.means
        away = self.means - mean
        return replace(self, means=mean, share=None, scale=self.scale + (away.T * self.shares) @ away)

    def widened(self, variance: Array) -> StudentMixture:
        """Return the same with more variance (d,) in each coordinate; made once for each that is asked for."""
        key = tuple(variance.tolist())
        if key not in self._wider:
            if len(self._wider) >= MOST_WIDER:
                self._wider.clear()
            self._wider[key] = replace(self, scale=self.scale + np.diag(variance))
        return self._wider[key]

    @cached_property
    def _wider(self) -> dict[tuple[float, ...], StudentMixture]:
        return {}

    def excess(self, x: Array, parts: Sequence[int]) -> Array:
        """Return how much higher the log-density is than it is on average over the distribution itself.

        The average over several is taken where they do not overlap: of each its own law's, at its middle that of all.

        Parameters
        ----------
        x : array (d, N)
            NaN where a coordinate is not known: what is known is judged, against its own average.
        parts : sequence of int
            Numbers of leading coordinates.

        Returns
        -------
        array (len(parts), N)
            Of the first k coordinates, for each k of `parts`; 0 where none of them is known.
        """
        known = np.isfinite(x)
        if known.all():
            return self._excess(x, parts)
        found = np.empty((len(parts), x.shape[1]))
        patterns, which = np.unique(known, axis=1, return_inverse=True)
        for k, pattern in enumerate(patterns.T):
            rows = np.flatnonzero(pattern)
            columns = np.flatnonzero(which.reshape(-1) == k)
            part = replace(self, means=self.means[:, rows], scale=self.scale[np.ix_(rows, rows)])
            found[:, columns] = part._excess(
                x[np.ix_(rows, columns)], [int(pattern[:n].sum()) for n in parts]
            )
        return found

    def _excess(self, x: Array, parts: Sequence[int]) -> Array:
        found = np.empty((len(parts), x.shape[1]))
        for start in range(0, x.shape[1], BLOCK_COLUMNS):
            part = slice(start, start + BLOCK_COLUMNS)
            points = self.whitening @ x[:, part]
            for row, count in enumerate(parts):
                if not count:
                    found[row, part] = 0.0
                    continue
                found[row, part] = self._log_sum(points[:count]) - self._usual(count)
        return found

    def _usual(self, count: int) -> float:
        """Return the average of the log of the sum over the distribution of the first coordinates."""
        if count not in self._averages:
            power = (self.dof + count) / 2
            own = power * (digamma(power) - digamma(self.dof / 2))
            self._averages[count] = float(self.shares @ self._log_sum(self._middles[:count])) - own
        return self._averages[count]

    @cached_property
    def _averages(self) -> dict[int, float]:
        return {}

    @cached_property
    def _middles(self) -> Array:
        return np.asarray(self.whitening @ self.means.T)

    def _log_sum(self, points: Array) -> Array:
        """Return the log of the sum over the distributions at the first whitened coordinates of points (k, N)."""
        middles = self._middles[: len(points)]
        power = (self.dof + len(points)) / 2
        squared = middles.T @ points
        squared *= -2.0
        squared += (points**2).sum(axis=0)
        squared += (middles**2).sum(axis=0)[:, None]
        np.maximum(squared, 0.0, out=squared)
        squared /= self.dof
        squared += 1.0
        nearest = squared.min(axis=0)
        # Counted from the nearest, no power vanishes.
        np.divide(nearest, squared, out=squared)
        return np.asarray(np.log(self.shares @ _raised(squared, power)) - power * np.log(nearest))


def _raised(base: Array, power: float) -> Array:
    """Return base ** power for powers of whole halves by multiplications, which NumPy's power takes twenty of."""
    if 2 * power != round(2 * power) or power > 64:
        return np.asarray(base**power)
    found = np.sqrt(base) if round(2 * power) % 2 else None
    rest = int(power)
    while rest:
        if rest & 1:
            found = base if found is None else found * base
        rest >>= 1
        if rest:
            base = base * base
    assert found is not None
    return np.asarray(found)


def excess(squared: Array, count: int, dof: float) -> Array:
    """Return the log-density of t at a squared distance (in units of S), above its average over the distribution.

    Parameters
    ----------
    squared : array
        The squared distance from the mean.
    count : int
        Of coordinates.
    dof : float
        Degrees of freedom: the fewer, the heavier the tails.
    """
    power = (dof + count) / 2
    return np.asarray(power * (digamma(power) - digamma(dof / 2)) - power * np.log1p(squared / dof))


def digamma(x: float) -> float:
    """Return the logarithmic derivative of the gamma function at x > 0 (Abramowitz & Stegun 1964, 6.3.5 and 6.3.18)."""
    # The series is for large x: digamma(x) = digamma(x + 1) - 1 / x leads there.
    below = 0.0
    while x < 12.0:
        below -= 1.0 / x
        x += 1.0
    inverse = 1.0 / (x * x)
    series = inverse * (
        1 / 12 - inverse * (1 / 120 - inverse * (1 / 252 - inverse * (1 / 240 - inverse / 132)))
    )
    return below + math.log(x) - 0.5 / x - series
