r"""How long a segment is seen: the density of a projected length, smeared by noise.

A segment whose direction is isotropic has the cosine c of its angle to the line of sight uniform in 0 to 1, and is seen
at :math:`x = \sqrt{1 - c^2}` of its length: the density of x is :math:`x / \sqrt{1 - x^2}`, which has its pole at
the full length. That pole, cut down by noise, is what tells the length: most views are little foreshortened, none is
longer.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np

from posekit.geometry import Array

OUTLIER_SHARE: Final = 0.02
"""Share of lengths that have nothing to do with the segment: swapped sides, another person's limb."""
NOISE_GRID: Final = np.geomspace(0.01, 0.8, 32)
"""Relative noise at which the density is tabulated."""
DENSITY_STEP: Final = 0.004
MAX_RATIO: Final = 4.0
N_NODES: Final = 240

_LOG_NOISE = np.log(NOISE_GRID)
_NOISE_STEP = float(_LOG_NOISE[1] - _LOG_NOISE[0])


def log_density(seen: Array, noise: Array, concentration: float = 0.0) -> Array:
    r"""Return the logarithm of the density of x = (length seen) / (length at that scale).

    Parameters
    ----------
    seen : array
        x, 0 or more; beyond 4 it counts as 4.
    noise : array broadcastable to `seen`
        Standard deviation of x, as a fraction of the full length, 0.01 to 0.8.
    concentration : float
        0 where all directions are as likely; directions are weighted by :math:`\exp(-\kappa c^2)` (Watson's
        distribution): positive where segments lie rather in the picture, negative where along the line of sight.

    Returns
    -------
    array
        NaN where `seen` is.
    """
    table = _table(float(concentration))
    column = np.clip(seen, 0.0, MAX_RATIO - DENSITY_STEP) / DENSITY_STEP
    row = (np.log(np.clip(noise, NOISE_GRID[0], NOISE_GRID[-1])) - _LOG_NOISE[0]) / _NOISE_STEP
    known = np.isfinite(column)
    left = np.where(known, column, 0.0).astype(np.intp)
    above = np.minimum(row, len(NOISE_GRID) - 1 - 1e-9).astype(np.intp)
    u, v = column - left, row - above
    width = table.shape[1]
    flat = table.ravel()
    at = above * width + left
    low = flat[at] * (1 - u) + flat[at + 1] * u
    high = flat[at + width] * (1 - u) + flat[at + width + 1] * u
    return np.asarray(low * (1 - v) + high * v)


def cosine_variance(concentration: float) -> float:
    """Return the variance of the squared cosine; 4/45 where all directions are as likely."""
    c, share = _directions(concentration)
    mean = float(share @ c**2)
    return float(share @ (c**2 - mean) ** 2)


def _directions(concentration: float) -> tuple[Array, Array]:
    """Return cosines from 0 to 1, and the share of directions that has each."""
    nodes, weights = np.polynomial.legendre.leggauss(N_NODES)
    c = (nodes + 1) / 2
    # The largest exponent is taken out: a strong concentration would overflow.
    exponent = -concentration * c * c
    share = weights * np.exp(exponent - exponent.max())
    return np.asarray(c), np.asarray(share / share.sum())


@lru_cache(maxsize=16)
def _table(concentration: float) -> Array:
    """Tabulate the logarithm (32, 1001) over noise and x."""
    c, share = _directions(concentration)
    full = np.sqrt(1 - c * c)
    x = np.arange(0.0, MAX_RATIO + DENSITY_STEP / 2, DENSITY_STEP)
    table = np.empty((len(NOISE_GRID), len(x)))
    for row, noise in enumerate(NOISE_GRID):
        # Lengths are not negative: what noise pushes below zero comes back.
        bells = np.exp(-0.5 * ((x[:, None] - full) / noise) ** 2)
        bells += np.exp(-0.5 * ((x[:, None] + full) / noise) ** 2)
        density = bells @ share / (noise * np.sqrt(2 * np.pi))
        table[row] = np.log((1 - OUTLIER_SHARE) * density + OUTLIER_SHARE * 2 / (np.pi * (1 + x * x)))
    table.flags.writeable = False
    return table
