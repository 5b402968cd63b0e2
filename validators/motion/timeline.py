"""Frames on an even grid of time: so that a gap is a gap, and neighbours are neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.validators.body import Body, once

#: Largest number of slots of a gap: longer gaps are cut to it.
LONGEST_GAP: Final = 16

#: Slots that are filtered at a time.
CACHED_SLOTS: Final = 256


@dataclass(frozen=True, kw_only=True, eq=False)
class Timeline:
    """The slot of each frame of a clip on an even grid of time, and gaps and displacements by its time stamps.

    Parameters
    ----------
    slots : int array (T,)
        Ascending with time, one step of the clip's rate each; -1 for a frame whose time another has.
    count : int
        The number of slots.
    place : int array (T,)
        Frames by which each is out of its place in time.
    missing : array (T,)
        Steps that lie between a frame and the one before it in time, beyond one; NaN where times are not known.
    """

    slots: NDArray[np.intp]
    count: int
    place: NDArray[np.intp]
    missing: Array

    def spread(self, values: Array) -> Array:
        """Put values of frames (T, ...) into their slots (S, ...); NaN where a slot has no frame."""
        found = np.full((self.count, *values.shape[1:]), np.nan)
        placed = self.slots >= 0
        found[self.slots[placed]] = values[placed]
        return found

    def of_frames(self, values: Array) -> Array:
        """Return, for each frame, what is in its slot: (S, ...) to (T, ...); NaN where it has none."""
        found = np.asarray(values, dtype=np.float64)[self.slots]
        found[self.slots < 0] = np.nan
        return found


@once
def timeline_of(body: Body) -> Timeline:
    """Place the frames of a clip by their times, or one after the other where times are not known."""
    count = len(body)
    frames = np.arange(count)
    if not body.dt > 0 or not np.isfinite(body.time).all():
        return Timeline(
            slots=frames, count=count, place=np.zeros(count, dtype=np.intp), missing=np.full(count, np.nan)
        )
    order = np.argsort(body.time, kind="stable")
    steps = np.diff(body.time[order], prepend=body.time[order[:1]] - body.dt) / body.dt
    # A stamp that is a quarter of a step off is still in its slot: videos have such; one that is no later has none.
    ways = np.clip(np.round(steps), 0, LONGEST_GAP).astype(np.intp)
    ways[(ways == 0) & (steps > 0.25)] = 1
    ways[:1] = 1
    slots, missing, place = np.empty(count, dtype=np.intp), np.empty(count), np.empty(count, dtype=np.intp)
    slots[order] = np.where(ways > 0, np.cumsum(ways) - 1, -1)
    missing[order] = steps - 1.0
    place[order] = frames - order
    return Timeline(slots=slots, count=int(slots.max(initial=-1)) + 1, place=place, missing=missing)


def filtered(points: Array, weights: Array) -> Array:
    """Sum `weights` (K,) over K neighbouring slots of (S, ...): (S - K + 1, ...)."""
    room = max(len(points) - len(weights) + 1, 0)
    total = np.zeros((room, *points.shape[1:]))
    # Blocks of this size stay in the cache.
    for start in range(0, room, CACHED_SLOTS):
        part = total[start : start + CACHED_SLOTS]
        for k, weight in enumerate(weights):
            if weight:
                part += weight * points[start + k : start + k + len(part)]
    return total


def centred(values: Array, count: int, first: int) -> Array:
    """Lay the output of a filter (N, ...) amid NaN (count, ...), from some frame on."""
    found = np.full((count, *values.shape[1:]), np.nan)
    found[first : first + len(values)] = values[: max(count - first, 0)]
    return found


def spaced(points: Array, weights: Sequence[float] | Array, apart: int) -> Array:
    """Return weighted sums of K slots, `apart` slots apart and centred on each slot (S, ...); NaN at the ends."""
    spread = np.zeros((len(weights) - 1) * apart + 1)
    spread[::apart] = weights
    return centred(filtered(points, spread), len(points), len(spread) // 2)


def median_of_five(values: Array) -> Array:
    """Return medians over five slots (S, ...), mirrored at the ends: NaN where one is not known."""
    padded = np.pad(values, ((2, 2), *[(0, 0)] * (values.ndim - 1)), mode="reflect")
    a, b, c, d, e = (padded[k : k + len(values)] for k in range(5))
    # The least and the greatest of two pairs are not the median of five; it is that of the two between and the fifth.
    low = np.maximum(np.minimum(a, b), np.minimum(d, e))
    high = np.minimum(np.maximum(a, b), np.maximum(d, e))
    return np.asarray(np.maximum(np.minimum(low, high), np.minimum(np.maximum(low, high), c)))
