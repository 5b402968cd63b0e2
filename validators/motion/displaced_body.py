r"""How far a body is displaced for good, at once or over a sixth of a second, by what nothing can push it.

A body that goes a way D beyond what its velocities before and after explain, in a time T, is sped up and
slowed down again: by :math:`4 D / T^2` at least, half of the time each way. Where people are faster than that, in
rolls, kicks and flips, their joints do not all go the same way; a body that is displaced does.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.validators.motion.timeline import filtered, norm

LONGEST_SECONDS: Final = 1.0 / 6.0
"""Over which a body is displaced at most: slower, it is motion."""

BETWEEN_SECONDS: Final = 1.0 / 30.0
"""By which the times differ over which displacements are looked for, after those of one frame."""

VELOCITY_SECONDS: Final = 1.0 / 15.0
"""Before and after, that say how fast joints go."""

PUSHED_ACCELERATION: Final = 20.0
"""Metres a second squared by which a body that goes as one is pushed: three times its weight, less its own; runners
and jumpers have such (Cavanagh & Lafortune 1980, J. Biomech. 13)."""

BESIDE_SHARE: Final = 0.75
"""Of a displacement's speed, that another one beside it has: half of it comes of velocities that it misleads."""

APART_TIMES: Final = 2.0
"""By which the median difference of joints from the body's displacement is taken off it."""


def displaced_by(joints: Array, step: float) -> Array:
    """Return by how much a body is displaced for good, in the frames that it goes in (S,); NaN in others.

    Parameters
    ----------
    joints : array (S, 14, 3)
        Metres, in slots of even time; NaN where unknown.
    step : float
        Seconds a slot; NaN where that is not known: then only what is displaced at once is found.

    Returns
    -------
    array (S,)
        Metres above what pushes and the joints' own motion explain.
    """
    timed = step > 0
    side, apart = (
        max(round(seconds / step), 1) if timed else 2 for seconds in (VELOCITY_SECONDS, BETWEEN_SECONDS)
    )
    most = int(LONGEST_SECONDS / step + 1e-6) if timed else 1
    known = np.isfinite(joints[..., 0])
    # The mean is quickly found, and is displaced where the body is.
    centre = np.nan_to_num(joints).sum(axis=1) / np.maximum(known.sum(axis=1), 1)[:, None]
    gaps = np.concatenate([[0], np.cumsum(~known.any(axis=1))])
    best, over = np.full(len(joints), -np.inf), np.ones(len(joints), dtype=np.intp)
    for count in sorted({1, *range(max(apart, 2), most + 1, apart)}):
        pushed = PUSHED_ACCELERATION * (count * step) ** 2 / 4 if timed else 0.0
        beyond = _beyond(joints, centre, gaps, count, side, pushed) / count
        better = beyond > best
        best[better], over[better] = beyond[better], count
    # Where it goes fastest is where it goes: a window that ends amid that is misled by a velocity of half of it.
    found = np.full(len(joints), np.nan)
    while best.max(initial=0.0) > 0:
        first = int(best.argmax()) + 1
        last = first + int(over[first - 1]) - 1
        found[first : last + 1] = best[first - 1] * over[first - 1]
        # Windows with these frames say the same again; those beside them what comes of it, where they say less.
        starts, fastest = np.arange(len(best)), best[first - 1]
        again = (starts < last) & (starts + over >= first)
        beside = (starts - side < last + apart) & (starts + over + side >= first - apart)
        best[again | (beside & (best < BESIDE_SHARE * fastest))] = 0.0
    return found


def _beyond(
    joints: Array, centre: Array, gaps: NDArray[np.intp], count: int, side: int, pushed: float
) -> Array:
    """Return the displacement (S,) within so many slots after each, above what explains it; 0 where all of it is.

    Of the joints, by their mean (S, 3), and by how many slots without any there are before each (S + 1,).
    """
    weights = np.zeros(count + 2 * side + 1)
    share = count / (2.0 * side)
    weights[[0, side, side + count, -1]] = share, -1.0 - share, 1.0 + share, -share
    beyond = np.zeros(len(joints))
    at = np.flatnonzero(norm(filtered(centre, weights)) > pushed / 2.0)
    at = at[gaps[at + len(weights)] == gaps[at]]
    if len(at):
        ways = sum(weights[k] * joints[at + k] for k in np.flatnonzero(weights))
        body = middle(ways)
        apart = middle(norm(ways - body[:, None]))
        beyond[at + side] = np.nan_to_num(norm(body) - APART_TIMES * apart - pushed)
    return beyond


def middle(values: Array) -> Array:
    """Return the median over joints of (S, 14, ...): of those that are known."""
    known = np.isfinite(values)
    if known.all():
        half = values.shape[1] // 2
        ordered = np.partition(values, (half - 1, half), axis=1)
        return np.asarray((ordered[:, half - 1] + ordered[:, half]) / 2.0)
    ordered = np.sort(values, axis=1)  # what is not known comes last
    number = known.sum(axis=1, keepdims=True)
    low, high = (
        np.take_along_axis(ordered, np.maximum(k, 0), axis=1) for k in ((number - 1) // 2, number // 2)
    )
    return np.asarray(((low + np.where(number % 2, low, high)) / 2.0)[:, 0])
