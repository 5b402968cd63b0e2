"""A periodic curve through points that never overshoots them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from posekit.errors import InputError
from posekit.geometry import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class PeriodicMonotoneCubic:
    r"""The periodic piecewise cubic that is monotone wherever its points are.

    Between two points it is the cubic Hermite curve of their values and slopes. With the secants
    :math:`\Delta_k` and widths :math:`h_k`, the slope at a point is 0 where the secants on its sides differ
    in sign, else their weighted harmonic mean

    .. math:: \frac{w_1 + w_2}{w_1/\Delta_{k-1} + w_2/\Delta_k}, \quad
              w_1 = 2h_k + h_{k-1},\; w_2 = h_k + 2h_{k-1},

    which lies inside the region of monotonicity of Fritsch & Carlson 1980 (*SIAM J. Numer. Anal.*
    17:238-246); the mean is Fritsch & Butland's (1984, *SIAM J. Sci. Stat. Comput.* 5:300-304).

    Parameters
    ----------
    x : array (K,)
        Increasing, spanning less than one period, K of two or more.
    y : array (K,)
        The values there; the curve has y[0] again at x[0] + period.
    period : float
        What x is increased by until the curve repeats.

    Raises
    ------
    InputError
        Where the points are not such.

    Examples
    --------
    >>> curve = PeriodicMonotoneCubic(x=[0.0, 0.5], y=[1.0, 3.0])
    >>> curve([0.0, 0.25, 0.5, 1.0]).tolist()
    [1.0, 2.0, 3.0, 1.0]
    """

    x: ArrayLike
    y: ArrayLike
    period: float = 1.0
    _knots: tuple[Array, Array, Array] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        x, y = np.array(self.x, dtype=np.float64), np.array(self.y, dtype=np.float64)
        if x.ndim != 1 or x.shape != y.shape or len(x) < 2 or not np.isfinite([x, y]).all():
            raise InputError(
                f"a curve needs two or more finite points x, y; got shapes {x.shape} and {y.shape}"
            )
        if (np.diff(x) <= 0).any() or not x[-1] - x[0] < self.period:
            raise InputError(
                f"a curve's x must increase and span less than the period {self.period:g}; got {x.tolist()}"
            )
        # The last point of the period before and the first two of the next give every point two neighbours.
        x = np.concatenate([[x[-1] - self.period], x, x[:2] + self.period])
        y = np.concatenate([[y[-1]], y, y[:2]])
        width = np.diff(x)
        secant = np.diff(y) / width
        object.__setattr__(self, "_knots", (x[1:-1], y[1:-1], _harmonic_mean(width, secant)))

    def __call__(self, at: ArrayLike) -> Array:
        """Evaluate the curve at any places, of any shape."""
        x, y, slope = self._knots
        place = x[0] + np.mod(np.asarray(at, dtype=np.float64) - x[0], self.period)
        k = np.clip(np.searchsorted(x, place, side="right") - 1, 0, len(x) - 2)
        h = x[k + 1] - x[k]
        s = (place - x[k]) / h
        rise = y[k + 1] - y[k]
        bulge = (1 - s) * slope[k] * h - s * slope[k + 1] * h
        curve: Array = y[k] + rise * s * s * (3 - 2 * s) + s * (1 - s) * bulge
        return curve


def _harmonic_mean(width: Array, secant: Array) -> Array:
    """Return the slopes (K - 2,) at the inner points of K - 1 intervals."""
    w1, w2 = 2 * width[1:] + width[:-1], width[1:] + 2 * width[:-1]
    before, after = secant[:-1], secant[1:]
    turning = before * after <= 0
    safe_before, safe_after = np.where(turning, 1.0, before), np.where(turning, 1.0, after)
    return np.where(turning, 0.0, (w1 + w2) / (w1 / safe_before + w2 / safe_after))
