"""Seventeen points without names: COCO's, which begin with the head, or Human3.6M's, which begin with a leg."""

from __future__ import annotations

import numpy as np

from posekit.geometry import Array

HEAD_COCO, HEAD_H36M = 0.33, 0.45
"""How large the first five points are against all: in COCO's order they are the head, in Human3.6M's a leg and more."""


def head_share(points: Array) -> float:
    """Return how large the first five points (D, 17, 2) are against all: the median ratio of the diagonals."""
    known = ~np.isnan(points[..., 0])
    rows = (known[:, :5].sum(axis=1) >= 2) & (known[:, 5:].sum(axis=1) >= 2)
    if not rows.any():
        return float("nan")
    first, whole = (_diagonal(points[rows][:, part]) for part in (slice(0, 5), slice(None)))
    return float(np.median(first / np.maximum(whole, 1e-9)))


def _diagonal(points: Array) -> Array:
    spans = np.nanmax(points, axis=1) - np.nanmin(points, axis=1)
    return np.asarray(np.hypot(spans[:, 0], spans[:, 1]))
