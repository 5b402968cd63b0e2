"""The body over the ground: lifted, lowered, or moved along it so that feet which stand stay."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, runs

Bools = NDArray[np.bool_]

SMOOTH_SECONDS: Final = 0.3
"""Seconds over which the height by which a body is shifted changes."""

MOST_SHIFT_METRES: Final = 0.5
"""Metres: a body that is farther from the ground is not meant to stand on it, or up is another way."""


def grounded(points: Array, height: Array, bad: Bools, up: Array, rate: float) -> Array:
    """Shift spans of frames along up by what they are above or below the ground, evenly over time.

    Parameters
    ----------
    points : array (T, P, 3)
        All points, metres.
    height : array (T,)
        Of the lowest over the ground, metres, negative below it.
    bad : bool array (T,)
        Frames that float or sink.
    up : array (3,)
        Against gravity.
    rate : float
        Frames a second.
    """
    out = points.copy()
    width = max(int(SMOOTH_SECONDS * rate) | 1, 1)
    for start, stop in runs(bad):
        by = -_over(np.mean, _over(np.median, height[start:stop], width), width)
        if np.abs(by).max() <= MOST_SHIFT_METRES:
            out[start:stop] += by[:, None, None] * up
    return out


def held_feet(points: Array, feet: Sequence[tuple[int, ...]], bad: Bools, up: Array) -> Array:
    """Move the body along the ground against what standing feet slide; what comes after stays where it then is.

    Parameters
    ----------
    points : array (T, P, 3)
        All points, metres.
    feet : sequence of 2 tuples of int
        The points of the right and the left foot, the best first.
    bad : bool array (T, 2)
        In which frames which foot slides while it stands.
    up : array (3,)
        Against gravity.
    """
    step = np.zeros((len(points), 3))
    slip = np.full((len(points), 2, 3), np.nan)
    for side, candidates in enumerate(feet):
        known = [k for k in candidates if np.isfinite(points[:, k]).all()]
        if known:
            way = np.diff(points[:, known[0]], axis=0, prepend=points[:1, known[0]])
            slip[:, side] = way - (way @ up)[:, None] * up
    rows = bad.any(axis=1)
    weight = np.where(bad[..., None] & np.isfinite(slip), 1.0, 0.0)
    total = weight.sum(axis=1)
    step[rows] = (np.nan_to_num(slip) * weight).sum(axis=1)[rows] / np.maximum(total[rows], 1.0)
    return points - np.cumsum(step, axis=0)[:, None]


def _over(function: Callable[..., Array], values: Array, width: int) -> Array:
    """Return a function of an odd number of values around each of (T,); the outer ones stand for what is beyond."""
    padded = np.pad(values, width // 2, mode="edge")
    return np.asarray(function(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1))
