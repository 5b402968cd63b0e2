"""Jitter of joints: the part of motion that is not smooth."""

from __future__ import annotations

from collections.abc import Sequence
from math import comb
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from posekit.body.lengths import lengths_in_frames
from posekit.geometry import Array, groups, norm
from posekit.skeleton import JOINTS, SEGMENTS
from posekit.validators.motion.timeline import centred, filtered, spaced

#: Number of frames in a window over which jitter is measured.
TREMBLING_FRAMES: Final = 15

#: Contribution of fast motion to the sixth difference, as a share of the second difference over three frames.
CURVED_SHARE: Final = 0.4

#: Number of standard deviations of noise that are subtracted from the jitter of a length.
LENGTHS_NOISE: Final = 2.0

#: Share of the jitter of a length that is attributed to one joint; the joint at the other end may jitter too.
BOTH_ENDS: Final = 0.8

#: Median norm of a vector of three standard normal coordinates, and median absolute value of one coordinate.
MEDIAN_OF_THREE, MEDIAN_OF_ONE = 1.5382, 0.6745

#: Largest distance between jittering windows of one interval, frames.
NEAR_FRAMES: Final = 4

#: Number of frames before and after an interval in which its start and end are searched.
EDGE_FRAMES: Final = 20

#: Largest number of frames for the estimate of usual jitter.
SAMPLED_FRAMES: Final = 2000

#: Largest evidence of one joint in one frame: natural logarithm of a likelihood ratio.
MOST_EVIDENCE: Final = 6.0

#: Assumed ratio of jitter outside an interval to jitter inside; ratios from 0.15 to 0.55 give the same start and end.
OUTSIDE_SHARE: Final = 0.35

#: Order of the differences that measure jitter.
SIXTH_ORDER: Final = 6

_SEGMENTS_OF: Final = tuple(
    [k for k, segment in enumerate(SEGMENTS) if joint in segment] for joint in range(len(JOINTS))
)
_SIXTH: Final = np.array([(-1.0) ** k * comb(6, k) for k in range(7)]) / np.sqrt(comb(12, 6))
_FOURTH: Final = np.array([(-1.0) ** k * comb(4, k) for k in range(5)]) / np.sqrt(comb(8, 4))
_CURVATURE: Final = np.array([1.0, 0, 0, -2.0, 0, 0, 1.0]) / 9.0


def trembling_of(joints: Array, noise: float = 0.0) -> Array:
    """Return the standard deviation of jitter per coordinate (S, 14), metres, of joints (S, 14, 3) in time slots.

    Notes
    -----
    The sixth difference of noise with standard deviation s has the standard deviation s sqrt(924) in each coordinate.
    Its median norm over 15 frames measures persistent noise and ignores single jumps. The contribution of fast motion,
    estimated from the curvature, is subtracted. Segment lengths are a second measure, because motion does not change
    them: a joint also jitters if the lengths of all its segments jitter by more than the measurement noise.
    """
    if len(joints) <= SIXTH_ORDER:
        return np.full(joints.shape[:2], np.nan)
    rough = norm(filtered(joints, _SIXTH)) / MEDIAN_OF_THREE
    rough = np.maximum(rough - CURVED_SHARE * norm(filtered(joints, _CURVATURE)), 0.0)
    stretched = np.abs(filtered(lengths_in_frames(joints).T, _SIXTH)) / MEDIAN_OF_ONE
    found = _windows(np.concatenate([rough, stretched], axis=1))
    bodily, of_lengths = found[:, : joints.shape[1]], found[:, joints.shape[1] :]
    by_length = np.stack([of_lengths[:, of_joint].min(axis=1) for of_joint in _SEGMENTS_OF], axis=1)
    return centred(
        np.maximum(bodily, BOTH_ENDS * by_length - LENGTHS_NOISE * noise), len(joints), SIXTH_ORDER // 2
    )


def usual_trembling(joints: Array, percents: Sequence[float] = (50.0,)) -> Array:
    """Return percentiles, over the first frames of a clip, of the median jitter of joints (T, 14, 3), metres."""
    rough = norm(filtered(joints[:SAMPLED_FRAMES], _SIXTH)) / MEDIAN_OF_THREE
    known = rough[np.isfinite(rough).any(axis=1)]
    return np.percentile(np.nanmedian(known, axis=1), percents) if len(known) else np.zeros(len(percents))


def _windows(rough: Array) -> Array:
    """Return running medians of columns (N, K), computed at every third row and repeated; unknown values count as 0."""
    half = TREMBLING_FRAMES // 2
    padded = np.pad(np.nan_to_num(rough), ((half, half + 2), (0, 0)))
    windows = sliding_window_view(padded, TREMBLING_FRAMES, axis=0)[1::3]
    medians = np.partition(windows, half)[..., half]
    return np.repeat(medians, 3, axis=0)[: len(rough)]


def trembling_frames(joints: Array, hot: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return whether joints jitter in each slot (S, 14), given whether windows centred on the slots jitter (S, 14).

    Notes
    -----
    Windows of 15 frames blur the start and end of an interval with jitter; fourth differences span only five frames.
    Start and end maximize the likelihood of the fourth differences of all jittering joints. Noise is assumed to be
    normal, and `OUTSIDE_SHARE` times as large outside the interval as inside.
    """
    rough = norm(spaced(joints, _FOURTH, 1))
    exact = np.zeros(hot.shape, dtype=np.bool_)
    for part in groups(np.flatnonzero(hot.any(axis=1)), NEAR_FRAMES):
        first, last = int(part[0]), int(part[-1])
        which = np.flatnonzero(hot[first : last + 1].any(axis=0))
        low, high = max(first - EDGE_FRAMES, 0), min(last + EDGE_FRAMES, len(rough) - 1)
        inside = np.maximum(np.nanmedian(rough[first : last + 1, which], axis=0) / MEDIAN_OF_THREE, 1e-9)
        ratio = 3 * np.log(OUTSIDE_SHARE) + (rough[low : high + 1, which] / inside) ** 2 / 2.0 * (
            OUTSIDE_SHARE**-2.0 - 1.0
        )
        evidence = np.clip(np.nan_to_num(ratio), -MOST_EVIDENCE, MOST_EVIDENCE).sum(axis=1)
        total = np.concatenate([[0.0], np.cumsum(evidence)])
        middle = (first + last) // 2
        # Fourth differences extend two frames beyond the noise, where their evidence is weaker.
        ends = (
            low + int(total[: middle - low + 1].argmin()) + 1,
            middle + int(total[middle - low :].argmax()) - 2,
        )
        exact[min(ends) : max(ends) + 1, which] = True
    return exact
