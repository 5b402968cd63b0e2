r"""Student's t in several dimensions: like a Gaussian in the middle, but what is far from it is no impossibility.

.. math::

    \log p(x) = c - \frac{\nu + d}{2} \log\left(1 + \frac{(x - m)^T S^{-1} (x - m)}{\nu}\right)

Some of its coordinates alone have the same law, with their part of m and S (Kotz & Nadarajah 2004, Multivariate t
distributions and their applications, §1.10): unknown ones are left out by leaving them out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from posekit.geometry import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Student:
    """A t distribution of d coordinates.

    Parameters
    ----------
    mean : array (d,)
        The middle of the distribution: m.
    scale : array (d, d)
        Symmetric, positive definite: S.
    dof : float
        Degrees of freedom: the fewer, the heavier the tails.
    """

    mean: Array
    scale: Array
    dof: float

    def __post_init__(self) -> None:
        for name in ("mean", "scale"):
            value = np.array(getattr(self, name), dtype=np.float64)
            value.flags.writeable = False
            object.__setattr__(self, name, value)

    @cached_property
    def whitening(self) -> Array:
        """The lower triangular matrix W with W' W = S^-1: its first k rows whiten the first k coordinates."""
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.scale)))

    def widened(self, variance: Array) -> Student:
        """Return the same with more variance (d,) in each coordinate."""
        return replace(self, scale=self.scale + np.diag(variance))

    def excess(self, x: Array, parts: Sequence[int]) -> Array:
        """Return how much higher the log-density is than it is on average over the distribution itself.

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
            part = Student(mean=self.mean[rows], scale=self.scale[np.ix_(rows, rows)], dof=self.dof)
            found[:, columns] = part._excess(
                x[np.ix_(rows, columns)], [int(pattern[:n].sum()) for n in parts]
            )
        return found

    def _excess(self, x: Array, parts: Sequence[int]) -> Array:
        squares = (self.whitening @ (x - self.mean[:, None])) ** 2
        found = np.empty((len(parts), x.shape[1]))
        for row, count in enumerate(parts):
            found[row] = excess(squares[:count].sum(axis=0), count, self.dof)
        return found


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
