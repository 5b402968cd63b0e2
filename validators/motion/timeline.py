"""A regular time grid of slots for the frames of a clip, with gaps for missing frames; and filters on this grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.validators.body import Body, once

#: Largest number of slots of a gap; longer gaps are shortened to it.
LONGEST_GAP: Final = 16

#: Number of slots in one batch of a filter.
CACHED_SLOTS: Final = 256


@dataclass(frozen=True, kw_only=True, eq=False)
class Timeline:
    """Slots of a clip's frames on a regular time grid, and the gaps and order of the time stamps.

    Parameters
    ----------
    slots : int array (T,)
        Slot of each frame, ascending with time; the distance between slots is one time step. -1 for a frame with the
        same time as an earlier frame.
    count : int
        Number of slots.
    place : int array (T,)
        Index of each frame in the order of time, minus its index in the clip.
    missing : array (T,)
        Number of missing time steps before each frame; NaN if times are unknown.
    """

    slots: NDArray[np.intp]
    count: int
    place: NDArray[np.intp]
    missing: Array

    def spread(self, values: Array) -> Array:
        """Return values of frames (T, ...) by slot (S, ...); NaN in slots without a frame."""
        found = np.full((self.count, *values.shape[1:]), np.nan)
        placed = self.slots >= 0
        found[self.slots[placed]] = values[placed]
        return found

    def of_frames(self, values: Array) -> Array:
        """Return values of slots (S, ...) by frame (T, ...); NaN in frames without a slot."""
        found = np.asarray(values, dtype=np.float64)[self.slots]
        found[self.slots < 0] = np.nan
        return found


@once
def timeline_of(body: Body) -> Timeline:
    """Return the timeline of a clip; if times are unknown, each frame's slot is its index."""
    count = len(body)
    frames = np.arange(count)
    if not body.dt > 0 or not np.isfinite(body.time).all():
        return Timeline(
            slots=frames, count=count, place=np.zeros_like(frames), missing=np.full(count, np.nan)
        )
    order = np.argsort(body.time, kind="stable")
    steps = np.diff(body.time[order], prepend=body.time[order[:1]] - body.dt) / body.dt
    # In some videos a time stamp is early by up to 3/4 of a step. A frame with an even earlier stamp has no slot.
    ways = np.clip(np.round(steps), 0, LONGEST_GAP).astype(np.intp)
    ways[(ways == 0) & (steps > 0.25)] = 1
    ways[:1] = 1
    slots, missing, place = np.empty(count, dtype=np.intp), np.empty(count), np.empty(count, dtype=np.intp)
    slots[order] = np.where(ways > 0, np.cumsum(ways) - 1, -1)
    missing[order] = steps - 1.0
    place[order] = frames - order
    return Timeline(slots=slots, count=int(slots.max(initial=-1)) + 1, place=place, missing=missing)


def filtered(points: Array, weights: Array) -> Array:
    """Return sums of K neighbouring slots of `points` (S, ...) with `weights` (K,): shape (S - K + 1, ...)."""
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
    """Pad the output of a filter (N, ...) with NaN to (count, ...), so that it starts at index `first`."""
    found = np.full((count, *values.shape[1:]), np.nan)
    found[first : first + len(values)] = values[: max(count - first, 0)]
    return found


def spaced(points: Array, weights: Sequence[float] | Array, apart: int) -> Array:
    """Return weighted sums of K slots at a distance of `apart` slots, centred on each slot; NaN at start and end."""
    spread = np.zeros((len(weights) - 1) * apart + 1)
    spread[::apart] = weights
    return centred(filtered(points, spread), len(points), len(spread) // 2)


def median_of_five(values: Array) -> Array:
    """Return running medians over five slots (S, ...), mirrored at start and end; NaN if a slot is unknown."""
    padded = np.pad(values, ((2, 2), *[(0, 0)] * (values.ndim - 1)), mode="reflect")
    a, b, c, d, e = (padded[k : k + len(values)] for k in range(5))
    # Without the smaller of two minima and the larger of two maxima, the three remaining values have the same median.
    low = np.maximum(np.minimum(a, b), np.minimum(d, e))
    high = np.minimum(np.maximum(a, b), np.maximum(d, e))
    return np.asarray(np.maximum(np.minimum(low, high), np.minimum(np.maximum(low, high), c)))
