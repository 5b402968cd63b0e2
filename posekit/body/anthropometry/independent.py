"""As how many independent frames those of a recording count, for each segment."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array

STRANGER_CORRELATION: Final = 0.05
"""Correlation at which neighbours count as strangers."""
ALIKE_DIFFERENCE: Final = 0.15
"""Root mean square of the differences of squared cosines at which two frames show the same; among isotropic ones it is
0.42."""
ENOUGH_VARIANCE: Final = 0.5
"""Share of the usual variance at which a segment has turned enough: samples scatter, and so does the noise."""


def independent_frames(squared_cosine: Array, noise: Array, usual: Array) -> Array:
    r"""Estimate how many independent directions a segment has shown.

    Three things make them fewer than frames. Neighbours in a film are alike (`unlike_neighbours`). Somebody who walks
    shows the same postures at every step (`unlike_frames`). And a segment that
    keeps to one direction, as the shoulders of somebody who walks by, shows one however long it is filmed: where the
    squared cosine varies less than half of what is usual, any two frames are taken to be correlated by what is
    missing, and n frames so correlated by r count as :math:`n / (1 + (n - 1) r)`.

    Parameters
    ----------
    squared_cosine : array (T, M)
        Of M segments' angle to the line of sight, in T frames in order; NaN is missing.
    noise : array (T, M)
        Variance of each by the noise of the key points.
    usual : array (M,)
        Variance of independent ones: `posekit.body.anthropometry.foreshortening.cosine_variance`.

    Returns
    -------
    array (M,)
        0 where a segment was never seen, else 1 to T.
    """
    known = np.isfinite(squared_cosine)
    count = known.sum(axis=0)
    blur = np.where(known, noise, 0.0).sum(axis=0) / np.maximum(count, 1)
    neighbours, variance = unlike_neighbours(squared_cosine, blur)
    neighbours = np.minimum(neighbours, unlike_frames(squared_cosine))
    shared = np.clip(1 - variance / (ENOUGH_VARIANCE * usual), 0.0, 1.0)
    more = np.maximum(neighbours, 1.0) - 1
    return np.where(count > 0, np.maximum(neighbours / (1 + more * shared), 1.0), 0.0)


def unlike_frames(squared_cosine: Array) -> int:
    """Count frames less those that repeat an earlier one, their squared cosines (T, M) within `ALIKE_DIFFERENCE`."""
    known = np.isfinite(squared_cosine)
    values = np.where(known, squared_cosine, 0.0)
    left = known.any(axis=1)
    count = 0
    while left.any():
        one = int(np.argmax(left))
        both = known & known[one]
        off = np.where(both, values - values[one], 0.0)
        # A frame that shares no segment with this one repeats nothing of it.
        apart = (off * off).sum(axis=1) > ALIKE_DIFFERENCE**2 * both.sum(axis=1)
        left &= apart | ~both.any(axis=1)
        left[one] = False
        count += 1
    return count


def unlike_neighbours(values: Array, noise: Array) -> tuple[Array, Array]:
    r"""Count frames less those that repeat their neighbours.

    :math:`T / (1 + 2 \sum_k \rho_k)` with the autocorrelation :math:`\rho_k` at k frames apart, summed until it fades
    (Geyer 1992).

    Parameters
    ----------
    values : array (T, M)
        M series over T frames in order; NaN is missing.
    noise : array (M,)
        Variance by noise, which neighbours do not share.

    Returns
    -------
    count : array (M,)
        0 where nothing is known, else 1 to T.
    variance : array (M,)
        Of the values, without the noise.
    """
    known = np.isfinite(values)
    count = known.sum(axis=0)
    mean = np.where(known, values, 0.0).sum(axis=0) / np.maximum(count, 1)
    off = np.where(known, values - mean, 0.0)
    raw = (off * off).sum(axis=0) / np.maximum(count - 1, 1)
    variance = np.maximum(raw - noise, 0.0)
    some = variance > 1e-12
    total = np.ones(len(count))
    alike = some
    for lag in range(1, len(values) // 2):
        pairs = (known[lag:] & known[:-lag]).sum(axis=0)
        covariance = (off[lag:] * off[:-lag]).sum(axis=0) / np.maximum(pairs, 1)
        correlation = np.divide(covariance, variance, out=np.zeros_like(variance), where=some)
        alike = alike & (correlation >= STRANGER_CORRELATION) & (pairs > 0)
        if not alike.any():
            break
        total += 2 * np.where(alike, np.minimum(correlation, 1.0), 0.0)
    least = np.minimum(count, 1)
    return np.where(some, np.clip(count / total, least, count), least).astype(np.float64), variance
