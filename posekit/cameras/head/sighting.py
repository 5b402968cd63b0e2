"""The image points of a batch of heads: which are seen, and which frames can be used."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.cameras.head.points import DEGENERATE_EXTENT, HeadPoints, degeneracy
from posekit.errors import HeadError
from posekit.geometry import Array

VANISHING_SPREAD = 1e-100
"""Spread of image points below which their squares underflow."""


class HeadSighting(NamedTuple):
    """Image points of F heads of P points.

    Attributes
    ----------
    image : array (F, P, 2)
        Image points, 0 where they are not seen.
    seen : bool array (F, P)
        Whether a point is seen.
    reasons : list of str
        One a frame: why it determines no camera; empty where it may.
    """

    image: Array
    seen: NDArray[np.bool_]
    reasons: list[str]


def sight(head: HeadPoints, image: ArrayLike) -> HeadSighting:
    """Check image points (P, 2) or (F, P, 2), NaN where a point is not seen.

    Raises
    ------
    HeadError
        Where the shape does not fit the head or a coordinate is infinite.
    """
    points = np.array(image, dtype=np.float64)
    count = len(head.names)
    if points.ndim == 2:
        points = points[None]
    if points.ndim != 3 or points.shape[1:] != (count, 2):
        raise HeadError(
            f"image points have shape {np.shape(image)}; expected ({count}, 2) or (F, {count}, 2), one row "
            f"for each of {', '.join(head.names)}, NaN where a point is not seen"
        )
    if np.isinf(points).any():
        frame, row, _ = np.argwhere(np.isinf(points))[0]
        raise HeadError(
            f"frame {frame}: head point {head.names[row]} is at {points[frame, row].tolist()} in the image; "
            "expected finite numbers, or NaN where it is not seen"
        )
    seen = np.asarray(np.isfinite(points).all(axis=-1), dtype=np.bool_)
    points[~seen] = 0.0
    patterns, which = np.unique(seen, axis=0, return_inverse=True)
    by_pattern = [degeneracy(head.names, head.points, pattern) for pattern in patterns]
    reasons = [by_pattern[pattern] or "" for pattern in which.ravel()]
    for frame, spread in zip(*_flat(points, seen), strict=True):
        reasons[frame] = reasons[frame] or (
            f"the image points lie on one line or in one point (spread {spread[0]:.3g} by {spread[1]:.3g}): "
            "a head never looks so; check them"
        )
    return HeadSighting(points, seen, reasons)


def _flat(image: Array, seen: NDArray[np.bool_]) -> tuple[NDArray[np.intp], Array]:
    """Find frames whose seen image points lie on a line, and their spread along and across it (N, 2)."""
    weight = seen[..., None] / np.maximum(seen.sum(axis=-1), 1)[:, None, None]
    offset = (image - (weight * image).sum(axis=1, keepdims=True)) * np.sqrt(weight)
    spread = np.linalg.svd(offset, compute_uv=False)
    flat = np.flatnonzero(spread[:, 1] <= np.maximum(DEGENERATE_EXTENT * spread[:, 0], VANISHING_SPREAD))
    return flat, spread[flat]
