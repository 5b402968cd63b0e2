"""Answers of frames: the expected posture, the probability that it is right, and a few representative postures."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Final

import numpy as np

from posekit.body import lay
from posekit.geometry import Array, Flags, Ints, norm
from posekit.ranking import WITHIN_METRES, representatives
from posekit.skeleton import PARENTS, TREE_SEGMENTS

#: Total probability of the represented postures.
REPRESENTED: Final = 0.95

#: Number of samples of each mode. The standard error of `sure` is 0.06 if one mode has all the probability, less
#: otherwise.
N_SAMPLES: Final = 64

#: Number of modes sampled in one block, so that they stay in the processor's cache.
SAMPLED_AT_ONCE: Final = 64

#: Degrees of freedom of the t distribution within a mode: its heavy tails model wrong lengths and bent spines.
TAIL_DEGREES_OF_FREEDOM: Final = 4

#: Scale of that t distribution relative to the standard deviation: the ratio of the 97.5 % quantiles of the normal and
#: the t distribution, so that 95 % lies within the same radius.
TAIL_SCALE: Final = 1.960 / 2.776


def _tailed_draws() -> Array:
    """Return 32 fixed samples of 42 coordinates from a t distribution."""
    rng = np.random.default_rng(1985)
    normal = rng.normal(size=(N_SAMPLES // 2, 42))
    spread = np.sqrt(TAIL_DEGREES_OF_FREEDOM / rng.chisquare(TAIL_DEGREES_OF_FREEDOM, len(normal)))
    return np.asarray(TAIL_SCALE * spread[:, None] * normal)


DRAWS: Final = _tailed_draws()

#: Variance (square metres, and relative to the trace) added to every covariance, which may be singular: a given neck
#: has no variance.
ROUNDING: Final = 1e-8

#: 95 % quantile of the standard normal distribution.
NORMAL_95: Final = 1.6449


def answers_of(
    joints: Array,
    frame: Ints,
    probability: Array,
    covariance: Array | None,
    lengths: Array,
    relative: Flags,
    unlisted: Array,
) -> dict[str, Any]:
    r"""Return the answers of K frames; the answer of a frame depends on that frame alone.

    Under noise, an answer is the probability-weighted mean of the modes, moved to the nearest posture with the person's
    segment lengths. With samples X of each mode m and the joints a of the answer, `sure` is :math:`\sum_m p_m P(\max_j
    |X_j - a_j| < 5 cm \mid X \sim t_4(\mu_m, \Sigma_m))`.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Survivors by frame, the likeliest first, metres, camera frame; NaN where a joint is not known.
    frame : int array (N,)
        Frame of each survivor, 0 to K - 1.
    probability : array (N,)
        Probability of each survivor; within a frame the sum is one minus `unlisted`.
    covariance : array (N, 42, 42), optional
        Covariance of the joints of each posture, square metres; None for exact postures.
    lengths : array (17,)
        The person's segment lengths, in the order of `posekit.skeleton.SEGMENTS`, metres. An answer has these lengths,
        scaled to the mean size of its survivors.
    relative : bool array (K,)
        True for frames in which distances are relative to the neck, because the depth of the neck is unknown.
    unlisted : array (K,)
        Probability of postures that are not listed.

    Returns
    -------
    dict
        Columns of `posekit.recovery.Answer`; the survivors of each frame are numbered from 0.
    """
    starts = np.flatnonzero(np.diff(frame, prepend=-1))
    weight = probability / np.add.reduceat(probability, starts)[frame]
    base = np.where(relative[frame, None, None], joints[:, :1], 0.0)
    shape, listed = joints - base, 1.0 - unlisted
    hold = np.minimum(REPRESENTED / np.maximum(listed, REPRESENTED), 1.0)
    rows, held = representatives(np.nan_to_num(shape), frame, weight, hold)
    row, held = rows - starts[frame[rows]], held * listed[frame[rows]]
    ends = np.searchsorted(frame[rows], np.arange(len(starts) + 1))
    parts = [slice(*pair) for pair in pairwise(ends.tolist())]
    if covariance is None:
        # The mean of exact postures is not a possible posture, so the answer is the first representative.
        survivor = rows[ends[:-1]] - starts
        laid = shape[starts + survivor]
    else:
        a, b = np.array(TREE_SEGMENTS).T
        sizes = np.log(norm(shape[:, a] - shape[:, b]) / lengths[: len(a)])
        size = np.add.reduceat(weight * np.nan_to_num(sizes).mean(axis=1), starts)
        laid = lay(np.add.reduceat(weight[:, None, None] * shape, starts), np.exp(size)[:, None] * lengths)
        away = np.nan_to_num(norm(shape - laid[frame])).mean(axis=1)
        survivor = np.lexsort((away, frame))[starts] - starts
    inside, sides = np.empty(len(shape)), np.empty((len(shape), 2, len(PARENTS) - 1))
    step = len(shape) if covariance is None else SAMPLED_AT_ONCE
    for own in (slice(at, at + step) for at in range(0, len(shape), step)):
        draws = shape[own, None]
        if covariance is not None:
            draws = draws + _drawn(covariance[own], relative[frame[own]])
        away = norm(draws - laid[frame[own], None])
        inside[own] = 1.0 - (away > WITHIN_METRES).any(axis=2).mean(axis=1)  # NaN is not outside
        gap = draws[..., 1:, 2] - draws[..., PARENTS[1:], 2]
        sides[own] = np.stack([gap < -WITHIN_METRES, gap > WITHIN_METRES], axis=1).mean(axis=2)
    near, far = np.add.reduceat(weight[:, None, None] * sides, starts).transpose(1, 0, 2)
    each = np.stack([1.0 - near - far, near, far]).round(9)  # the first of equal values counts
    known = np.isfinite(laid[:, 1:, 2] - laid[:, PARENTS[1:], 2])
    return {
        "joints": laid + np.add.reduceat(weight[:, None, None] * base, starts),
        "sure": np.add.reduceat(weight * inside, starts) * listed,
        "sure_of": np.where(relative, "relative to the neck", "position").tolist(),
        "survivor": survivor,
        "representatives": [row[own] for own in parts],
        "represented": [held[own] for own in parts],
        "nearer": np.where(known, np.array([0, 1, -1])[each.argmax(axis=0)], 0),
        "nearer_sure": np.where(known, each.max(axis=0) * listed[:, None], np.nan),
    }


def joint_radius(covariance: Array) -> Array:
    r"""Return the radii (...) in metres within which joints with covariances (..., 3, 3) lie with 95 % probability.

    The squared error of a joint is a weighted sum of three chi-square variables. The sum is approximated by a gamma
    distribution of equal mean and variance (Satterthwaite 1946). The cube root of a gamma variable is nearly normal
    (Wilson & Hilferty 1931).
    """
    mean = np.einsum("...ii->...", covariance)
    variance = 2 * np.einsum("...ij,...ij->...", covariance, covariance)
    known = mean > 0
    mean, variance = np.where(known, mean, 1.0), np.where(known, variance, 1.0)
    shape = mean**2 / variance
    root = 1.0 - 1.0 / (9.0 * shape) + NORMAL_95 / (3.0 * np.sqrt(shape))
    return np.where(known, np.sqrt(mean * root**3), 0.0)


def _drawn(covariance: Array, relative: Flags) -> Array:
    """Return S samples of the errors of N modes (N, S, 14, 3), metres; relative to the neck where `relative` (N,)."""
    regular = covariance.copy()
    diagonal = np.einsum("nii->ni", regular)
    diagonal += ROUNDING * (1.0 + diagonal.sum(axis=1, keepdims=True))
    off = (DRAWS @ np.linalg.cholesky(regular).transpose(0, 2, 1)).reshape(len(regular), len(DRAWS), -1, 3)
    off -= np.where(relative[:, None, None, None], off[:, :, :1], 0.0)
    return np.concatenate([off, -off], axis=1)
