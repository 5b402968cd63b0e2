r"""How often chance alone gives a sum of squares as large: the survival function of the chi-square distribution.

:math:`P(\chi^2_k > x) = Q(k/2, x/2)`, the regularised incomplete gamma function. For whole k it is a finite sum
(Abramowitz & Stegun 1964, 26.4.4 and 26.4.5): from :math:`Q(\frac12, y) = \mathrm{erfc}\sqrt y` or
:math:`Q(1, y) = e^{-y}` by :math:`Q(a + 1, y) = Q(a, y) + y^a e^{-y} / \Gamma(a + 1)`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from posekit.errors import InputError
from posekit.geometry import Array

MAX_DEGREES_OF_FREEDOM = 1000
"""Degrees of freedom beyond which the sum is refused: no posture has so many."""

MAX_HALF_CHI2 = 740.0
"""Half a sum of squares from which on the exponential is no number; the probability is then zero to 1e-14."""


def _erfc(x: Array) -> Array:
    """Return the complementary error function."""
    return np.array([math.erfc(value) for value in x.ravel().tolist()]).reshape(x.shape)


def chi2_survival(chi2: ArrayLike, dof: ArrayLike) -> Array:
    """Return the probability that noise alone gives at least `chi2`.

    Parameters
    ----------
    chi2 : array (...)
        Sums of squares, not negative; NaN gives NaN.
    dof : int array, broadcastable to (...)
        Degrees of freedom, 0 to 1000. With none, nothing can disagree: the probability is 1 where `chi2` is finite.

    Returns
    -------
    array (...)

    Raises
    ------
    InputError
        Where a sum is negative, or degrees of freedom are no whole numbers from 0 to 1000.

    Examples
    --------
    >>> round(float(chi2_survival(16.266, 3)), 6)
    0.001
    """
    x, freedom = np.broadcast_arrays(np.asarray(chi2, dtype=np.float64), np.asarray(dof, dtype=np.float64))
    if (x < 0).any():
        raise InputError(f"chi2 is {float(np.nanmin(x)):g}; expected a sum of squares, zero or more")
    if not ((freedom >= 0) & (freedom <= MAX_DEGREES_OF_FREEDOM) & (freedom == np.floor(freedom))).all():
        raise InputError(f"degrees of freedom must be whole numbers from 0 to {MAX_DEGREES_OF_FREEDOM}")
    y = np.minimum(x / 2, MAX_HALF_CHI2)
    odd = np.mod(freedom, 2) == 1
    # The terms y^a e^-y / Gamma(a + 1), each from the one before; in logarithms they would lose digits.
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        decay = np.exp(-y)
        first = np.where(odd, _erfc(np.sqrt(y)), decay)
        term = np.where(odd, decay * np.sqrt(y) / math.gamma(1.5), decay * y)
        a = np.where(odd, 0.5, 1.0)
        total = np.where(freedom == 0, np.where(np.isnan(y), np.nan, 1.0), first)
        for _ in range(int(freedom.max(initial=0.0) - 1) // 2):
            total = np.where(a < freedom / 2, total + term, total)
            a = a + 1
            term = term * y / a
    return np.asarray(np.minimum(total, 1.0))
