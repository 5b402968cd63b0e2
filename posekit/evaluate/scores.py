"""Scores of many frames: the correct-poses score, and how well probabilities are calibrated."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array

CPS_RANGE: Final = 0.3
"""Metres up to which thresholds go."""

THRESHOLDS_METRES: Final = np.arange(301) / 1000.0
"""Metres at which the curve is told: every millimetre."""

N_BINS: Final = 10
"""Bins of probability."""


def correct_poses(worst: Array) -> Array:
    """Return the share of postures all of whose joints are nearer than each of `THRESHOLDS_METRES` (301,).

    Wandt, Rudolph, Zell, Rhodin & Rosenhahn 2021, "CanonPose: Self-Supervised Monocular 3D Human Pose Estimation in the
    Wild", CVPR, section 4.1: a posture is correct at a threshold if every joint is, after alignment.

    Parameters
    ----------
    worst : array (F,)
        The error of each posture's worst joint, metres; NaN or infinite where there is no posture, which is never
        correct.
    """
    if not len(worst):
        return np.full(len(THRESHOLDS_METRES), np.nan)
    known = np.sort(np.where(np.isnan(worst), np.inf, worst))
    return np.searchsorted(known, THRESHOLDS_METRES, side="left") / len(worst)


def correct_poses_score(worst: Array) -> float:
    """Return the area under that curve from 0 to 300 mm, in millimetres: 300 is perfect, 0 is nothing within 30 cm."""
    if not len(worst):
        return float("nan")
    room = np.maximum(CPS_RANGE - np.where(np.isnan(worst), np.inf, worst), 0.0)
    return float(room.mean() * 1000)


class Reliability(NamedTuple):
    """A reliability table, and its expected calibration error.

    Attributes
    ----------
    error : float
        The mean over frames of the distance between a bin's mean probability and its share of events (Naeini, Cooper &
        Hauskrecht 2015, AAAI; Guo, Pleiss, Sun & Weinberger 2017, ICML, eq. 3).
    brier : float
        The mean squared difference of probability and event (Brier 1950).
    lower : array (B,)
        Where each bin begins; it ends where the next begins, the last at 1.
    frames : int array (B,)
        How many it has.
    probability, share : array (B,)
        Mean probability, and share of events, of each bin; NaN where it is empty.
    """

    error: float
    brier: float
    lower: Array
    frames: NDArray[np.intp]
    probability: Array
    share: Array


def reliability(probability: Array, event: Array) -> Reliability | None:
    """Compare stated probabilities with what happened, in ten bins of equal width; None where nothing was stated.

    Parameters
    ----------
    probability : array (F,)
        0 to 1; NaN where none was stated: left out.
    event : array (F,)
        1 where it happened, 0 where not; NaN where nobody knows: left out.
    """
    stated = np.isfinite(probability) & np.isfinite(event)
    p, y = probability[stated], event[stated]
    if not len(p):
        return None
    which = np.minimum((p * N_BINS).astype(np.intp), N_BINS - 1)
    count = np.asarray(np.bincount(which, minlength=N_BINS), dtype=np.intp)
    sums = [np.bincount(which, weights=values, minlength=N_BINS) for values in (p, y)]
    mean, share = (np.where(count > 0, each / np.maximum(count, 1), np.nan) for each in sums)
    error = float(np.nansum(count * np.abs(mean - share)) / len(p))
    return Reliability(error, float(((p - y) ** 2).mean()), np.arange(N_BINS) / N_BINS, count, mean, share)
