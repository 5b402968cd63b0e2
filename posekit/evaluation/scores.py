"""Scores of postures whose truth is known: joint errors, calibration of probabilities, correct-poses score."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from posekit.geometry import Array, Ints, align, mpjpe

#: Mean joint error in the camera frame; after alignment of the joints' mean positions; after alignment by a similarity
#: (`posekit.geometry.align`); error of the worst joint in the camera frame; and after alignment by a similarity.
MEASURES: Final = ("mpjpe", "centred", "pa", "worst", "worst_pa")

#: Largest threshold of the correct-poses score, metres (Wandt et al. 2021).
CPS_RANGE: Final = 0.3

#: Number of bins of probability, with equal widths.
N_BINS: Final = 10

#: Number of postures in one batch.
POSTURES_AT_ONCE: Final = 50_000


def posture_errors(joints: Array, truth: Array) -> Array:
    """Return five joint errors of each of N postures, in the order of `MEASURES`.

    Parameters
    ----------
    joints, truth : array (N, 14, 3)
        Joint positions in the camera frame, metres; NaN if unknown.

    Returns
    -------
    array (N, 5)
        Errors, metres; NaN if no joint is known in both postures.
    """
    parts = range(0, len(joints), POSTURES_AT_ONCE)
    found = [_errors(joints[k : k + POSTURES_AT_ONCE], truth[k : k + POSTURES_AT_ONCE]) for k in parts]
    return np.concatenate(found) if found else np.empty((0, len(MEASURES)))


def _errors(joints: Array, truth: Array) -> Array:
    known = np.asarray(np.isfinite(joints + truth).all(axis=-1))
    target = np.where(known[..., None], truth, np.nan)
    count, aligned = np.maximum(known.sum(axis=1), 1), align(joints, target).apply(joints)
    shift = np.where(known[..., None], target - joints, 0.0).sum(axis=1, keepdims=True) / count[:, None, None]
    means = [mpjpe(moved, target) for moved in (joints, joints + shift, aligned)]
    away = [np.linalg.norm(moved - target, axis=-1) for moved in (joints, aligned)]
    return np.stack([*means, *(np.fmax.reduce(one, axis=1) for one in away)], axis=1)


def correct_poses_score(worst: Array) -> float:
    """Return the correct-poses score in millimetres, from 0 (no posture within 30 cm) to 300 (all are exact).

    A posture is correct if the error of every joint is below a threshold. The score is the integral of the share of
    correct postures over thresholds from 0 to 300 mm (Wandt et al. 2021, *CanonPose*, CVPR, §4.1).

    Parameters
    ----------
    worst : array (F,)
        Error of each posture's worst joint, metres; NaN for a missing posture, which counts as incorrect.
    """
    room = np.maximum(CPS_RANGE - np.where(np.isnan(worst), np.inf, worst), 0.0)
    return float(room.mean() * 1000) if len(worst) else float("nan")


def reliability(probability: Array, event: Array) -> dict[str, Any] | None:
    """Compare stated probabilities with frequencies of the events, in ten bins of equal width.

    Parameters
    ----------
    probability : array (N,)
        Stated probabilities, 0 to 1; NaN entries are excluded.
    event : array (N,)
        1 if the event happened, 0 otherwise; NaN entries are excluded.

    Returns
    -------
    dict or None
        ``ece``: expected calibration error, the mean absolute difference between a bin's mean probability and its share
        of events, weighted by entries (Guo et al. 2017, ICML, eq. 3). ``brier``: mean squared difference between
        probability and event (Brier 1950). ``bins``: number of entries, mean probability and share of events of each
        bin that is not empty. The result is None if there are no entries.

    Examples
    --------
    >>> reliability(np.array([0.75, 0.75, 0.75, 0.75]), np.array([1.0, 1.0, 1.0, 0.0]))["ece"]
    0.0
    """
    stated = np.isfinite(probability) & np.isfinite(event)
    p, y = probability[stated], event[stated]
    if not len(p):
        return None
    which: Ints = np.minimum((p * N_BINS).astype(np.intp), N_BINS - 1)
    bins = [
        {"entries": int(one.sum()), "probability": float(p[one].mean()), "share": float(y[one].mean())}
        for one in (which == k for k in range(N_BINS))
        if one.any()
    ]
    gaps = sum(one["entries"] * abs(one["probability"] - one["share"]) for one in bins)
    return {"ece": gaps / len(p), "brier": float(((p - y) ** 2).mean()), "entries": len(p), "bins": bins}
