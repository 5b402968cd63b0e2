"""Sums, boxes and choices over the rows of each group of a table that is sorted by group."""

from __future__ import annotations

import numpy as np

from posekit.geometry import Array
from posekit.hidden.posture_rows import Index


def offsets(group: Index, n: int) -> Index:
    """Return where each of n groups starts and the last ends (n + 1,)."""
    return np.searchsorted(group, np.arange(n + 1))


def box(group: Index, n: int, points: Array) -> tuple[Array, Array]:
    """Return each group's least and largest coordinates (n, 3); NaN where it is empty."""
    lower, upper = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    start = offsets(group, n)
    some = np.flatnonzero(np.diff(start))
    if len(some):
        lower[some] = np.minimum.reduceat(points, start[some], axis=0)
        upper[some] = np.maximum.reduceat(points, start[some], axis=0)
    return lower, upper


def mean(group: Index, n: int, points: Array) -> Array:
    """Return each group's mean (n, 3); NaN where it is empty."""
    count = np.bincount(group, minlength=n).astype(np.float64)
    count[count == 0] = np.nan
    return np.stack([np.bincount(group, points[:, k], n) / count for k in range(3)], axis=1)


def largest(group: Index, n: int, value: Array) -> tuple[Index, Array]:
    """Return the row of each group's largest value (n,), -1 where it is empty, and that value."""
    row, most = np.full(n, -1), np.full(n, -np.inf)
    start = offsets(group, n)
    some = np.flatnonzero(np.diff(start))
    if len(some):
        most[some] = np.maximum.reduceat(value, start[some])
        rows = np.flatnonzero(value == most[group])
        row[group[rows[::-1]]] = rows[::-1]  # the first of equals is written last
    return row, most


def pairs(group: Index, key: Index, n: int) -> tuple[Index, Index]:
    """List, for each key, all rows of its group: (position in `key`, row), in order."""
    start = offsets(group, n)
    count = np.diff(start)[key]
    which = np.repeat(np.arange(len(key)), count)
    rank = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    return which, start[key][which] + rank


def distinct(group: Index, n: int, label: Index) -> Index:
    """Count the different labels (at least 0) in each group (n,)."""
    known = label >= 0
    width = int(label.max(initial=0)) + 1
    seen = np.unique(group[known] * width + label[known])
    return np.bincount(seen // width, minlength=n)
