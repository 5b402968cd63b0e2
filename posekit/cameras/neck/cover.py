"""Depths to grow the tree from: few, and so dense that some of them is near any depth that is possible."""

from __future__ import annotations

import numpy as np

from posekit.geometry import Array

WIDENING_FACTOR = 1.05


def cover(intervals: Array, reach: float, most: int) -> tuple[Array, float]:
    """Cover intervals with as few samples as leave no point of them farther than `reach` from one.

    Parameters
    ----------
    intervals : array (I, 2)
        Disjoint, ascending.
    reach : float
        Wanted; it grows where it takes more than `most` samples.
    most : int
        At least 1. With more intervals than that, the widest are covered.

    Returns
    -------
    samples : array (n,)
        Ascending.
    reach : float
        The farthest that a point of the covered intervals is from a sample.
    """
    if not len(intervals):
        return np.empty(0), 0.0
    width = intervals[:, 1] - intervals[:, 0]
    if len(intervals) > most:
        kept = np.sort(np.argsort(-width, kind="stable")[:most])
        intervals, width = intervals[kept], width[kept]
    count = _count(width, reach)
    while count.sum() > most:
        reach *= WIDENING_FACTOR
        count = _count(width, reach)
    samples = [
        low + (np.arange(n) + 0.5) / n * wide
        for (low, _), wide, n in zip(intervals, width, count, strict=True)
    ]
    return np.concatenate(samples), float((width / (2 * count)).max())


def meet(a: Array, b: Array) -> Array:
    """Return the intersection (I, 2) of two unions of intervals (A, 2) and (B, 2), ascending and disjoint."""
    low = np.maximum(a[:, None, 0], b[None, :, 0]).ravel()
    high = np.minimum(a[:, None, 1], b[None, :, 1]).ravel()
    order = np.argsort(low, kind="stable")
    merged: list[list[float]] = []
    for start, end in zip(low[order].tolist(), high[order].tolist(), strict=True):
        if end < start:
            continue
        if merged and start <= merged[-1][1]:
            merged[-1][1] = max(merged[-1][1], end)
        else:
            merged.append([start, end])
    return np.array(merged).reshape(-1, 2)


def _count(width: Array, reach: float) -> Array:
    return np.maximum(np.ceil(width / (2 * reach) - 1e-9), 1)
