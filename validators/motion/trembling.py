"""How much joints tremble, and in which frames: what is left of motion when all that is smooth is taken off."""

from __future__ import annotations

from math import comb
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.validators.motion.timeline import centred, filtered, norm

TREMBLING_FRAMES: Final = 15
"""Over which trembling is measured."""

CURVED_SHARE: Final = 0.3
"""Of the second difference, over three frames each way, that fast motion at few frames leaves in the sixth."""

MEDIAN_OF_THREE: Final = 1.5382
"""Median length of a vector of three normal coordinates of unit deviation."""

NEAR_FRAMES: Final = 4
"""Between two stretches that are one."""

EDGE_FRAMES: Final = 20
"""By which the edges of a stretch are looked for, either way."""

OUTSIDE_FRAMES: Final = 40
"""Before and after a stretch that say how much joints tremble outside it."""

LEAST_SHARE, FEW_FRAMES_SHARE = 0.1, 0.3
"""Of the trembling inside that there is outside at least; and where a few frames are all that says so."""

MOST_EVIDENCE: Final = 6.0
"""Of one joint in one frame that it trembles, or not: natural logarithm of a ratio of likelihoods."""

_SIXTH: Final = np.array([(-1.0) ** k * comb(6, k) for k in range(7)])
_FOURTH: Final = np.array([(-1.0) ** k * comb(4, k) for k in range(5)]) / np.sqrt(comb(8, 4))
_CURVATURE: Final = np.array([1.0, 0, 0, -2.0, 0, 0, 1.0]) / 9.0


def trembling_of(joints: Array) -> Array:
    """Return the standard deviation of a coordinate's trembling (S, 14), metres, of joints in even time (S, 14, 3).

    Notes
    -----
    The sixth difference of noise of deviation s has the deviation s sqrt(924) in each coordinate. Its median length
    over 15 frames is that of noise which lasts, not of one jump; what the curvature of fast motion leaves in it
    is taken off.
    """
    rough = norm(filtered(joints, _SIXTH)) / (np.sqrt(comb(12, 6)) * MEDIAN_OF_THREE)
    rough = np.maximum(rough - CURVED_SHARE * norm(filtered(joints, _CURVATURE)), 0.0)
    half = TREMBLING_FRAMES // 2
    padded = np.pad(np.nan_to_num(rough), ((half, half), (0, 0)))
    if not len(rough):
        return np.full(joints.shape[:2], np.nan)
    return centred(np.median(sliding_window_view(padded, TREMBLING_FRAMES, axis=0), axis=-1), len(joints), 3)


def trembling_frames(joints: Array, hot: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Say in which frames joints tremble (S, 14), from where they do so over a window (S, 14).

    Notes
    -----
    A window blurs the ends of a stretch. They are put where fourth differences, which five frames enter, turn from
    what they are outside to what they are inside, by the likelihood of normal noise, all joints of the stretch
    together.
    """
    rough = centred(norm(filtered(joints, _FOURTH)), len(joints), 2)
    exact = np.zeros(hot.shape, dtype=np.bool_)
    at = np.flatnonzero(hot.any(axis=1))
    for part in np.split(at, np.flatnonzero(np.diff(at) > NEAR_FRAMES) + 1):
        first, last = int(part[0]), int(part[-1])
        which = np.flatnonzero(hot[first : last + 1].any(axis=0))
        start, end = _edges(rough[:, which], first, last)
        exact[start : end + 1, which] = True
    return exact


def _edges(rough: Array, first: int, last: int) -> tuple[int, int]:
    """Return the first and the last frame that tremble, near those of a window's."""
    low, high = max(first - EDGE_FRAMES, 0), min(last + EDGE_FRAMES, len(rough) - 1)
    beyond = np.r_[max(first - OUTSIDE_FRAMES, 0) : max(first - 2, 0), last + 3 : last + OUTSIDE_FRAMES]
    outside = rough[beyond[beyond < len(rough)]]
    share = LEAST_SHARE if len(outside) >= TREMBLING_FRAMES else FEW_FRAMES_SHARE
    inside = _spread(rough[first : last + 1])
    outside_spread = np.clip(_spread(outside) if len(outside) else 0.0, share * inside, 0.6 * inside)
    ratio = 3.0 * np.log(outside_spread / inside) + rough[low : high + 1] ** 2 / 2.0 * (
        outside_spread**-2.0 - inside**-2.0
    )
    evidence = np.clip(np.nan_to_num(ratio), -MOST_EVIDENCE, MOST_EVIDENCE).sum(axis=1)
    total = np.concatenate([[0.0], np.cumsum(evidence)])
    middle = (first + last) // 2 - low
    # Two frames beyond the noise a fourth difference has a part of it: less than is evidence, the nearer one more.
    start = low + int(total[: middle + 1].argmin()) + 1
    end = low + middle + int(total[middle:].argmax()) - 2
    return min(start, end), max(start, end)


def _spread(rough: Array) -> Array:
    """Return the deviation of a coordinate (K,) from lengths (N, K); little where nothing is known."""
    return np.maximum(np.median(np.nan_to_num(rough), axis=0) / MEDIAN_OF_THREE, 1e-9)
