"""Scores if the truth is known: errors of postures, calibration of probabilities, correct poses."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from posekit.geometry import Array, Ints, align, mpjpe

#: Mean error of the joints in the camera frame; after moving the middle of the joints onto the truth's; after a
#: similarity (`posekit.geometry.align`); error of the worst joint in the camera frame, and after the similarity.
MEASURES: Final = ("mpjpe", "centred", "pa", "worst", "worst_pa")

#: Largest threshold of the correct-poses score, metres (Wandt et al. 2021).
CPS_RANGE: Final = 0.3

#: Bins of probability, of equal width.
N_BINS: Final = 10

#: Postures that are measured together.
POSTURES_AT_ONCE: Final = 50_000


def posture_errors(joints: Array, truth: Array) -> Array:
    """Return the five `MEASURES` of N postures.

    Parameters
    ----------
    joints, truth : array (N, 14, 3)
        Camera frame, metres; NaN if unknown.

    Returns
    -------
    array (N, 5)
        Metres; NaN if no joint is known in both.
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
    """Return the correct-poses score in millimetres: 300 is perfect, 0 is no posture within 30 cm.

    It is the area, from 0 to 300 mm, under the share of postures all of whose joints are nearer than the threshold
    (Wandt et al. 2021, *CanonPose*, CVPR, §4.1).

    Parameters
    ----------
    worst : array (F,)
        Error of each posture's worst joint, metres; NaN if there is no posture, which is never correct.
    """
    room = np.maximum(CPS_RANGE - np.where(np.isnan(worst), np.inf, worst), 0.0)
    return float(room.mean() * 1000) if len(worst) else float("nan")


def reliability(probability: Array, event: Array) -> dict[str, Any] | None:
    """Compare stated probabilities with events, in ten bins of equal width.

    Parameters
    ----------
    probability : array (N,)
        0 to 1; NaN entries are left out.
    event : array (N,)
        1 if it happened, 0 if not; NaN entries are left out.

    Returns
    -------
    dict or None
        ``ece``: expected calibration error, the mean over entries of the distance between a bin's mean probability and
        its share of events (Guo et al. 2017, ICML, eq. 3). ``brier``: mean squared difference (Brier 1950). ``bins``:
        entries, mean probability and share of events of each bin that is not empty. None if nothing was stated.

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
