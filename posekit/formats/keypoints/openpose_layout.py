"""Whether 25 points are BODY_25 or BODY_25B: OpenPose's files do not say.

Both have a nose first and feet last; between them the orders differ, so that one reading of a body puts the knee where
the other has the wrist. Read in the right order, the segments of a body are short. In the median over the
detections, the mean length of `COMPARED_SEGMENTS` in one reading must be `CLEAR_LENGTH_RATIO` times that in the other.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.keypoints.keypoints import FARTHEST_PIXEL
from posekit.formats.skeleton_maps import SkeletonMap, load_skeleton_map
from posekit.geometry import Array

COMPARED_SEGMENTS: Final = (
    *(
        (f"{side}{start}", f"{side}{end}")
        for side in "RL"
        for start, end in (
            ("Shoulder", "Elbow"),
            ("Elbow", "Wrist"),
            ("Hip", "Knee"),
            ("Knee", "Ankle"),
            ("Shoulder", "Hip"),
            ("Ear", "Shoulder"),
            ("Eye", "Ear"),
            ("Ankle", "Heel"),
            ("Ankle", "BigToe"),
        )
    ),
    ("Nose", "REye"),
    ("Nose", "LEye"),
    ("LShoulder", "RShoulder"),
    ("LHip", "RHip"),
)
"""Segments of a body by the points' names in both layouts."""
MIN_SEGMENTS_KNOWN: Final = 6
"""Segments that a detection must have in both readings to be asked."""
CLEAR_LENGTH_RATIO: Final = 1.28
"""The natural logarithm of it is a quarter. Single detections of 3,000 projected postures of real motion, with 8
pixels of noise and with up to 60 % of their points left out at random, were then taken for the wrong one in at most
0.23 %; of 253 detections in photographs and videos, read as either, none was."""


def tell_apart(points: Array) -> list[SkeletonMap]:
    """List the layouts that detections may be in.

    Parameters
    ----------
    points : array (D, 25, 2)
        In the file's order; NaN where missing.

    Returns
    -------
    list of SkeletonMap
        One where it is clear, else both.
    """
    layouts = [load_skeleton_map(name) for name in ("body_25", "body_25b")]
    with np.errstate(invalid="ignore"):
        points = np.where(np.abs(points) <= FARTHEST_PIXEL, points, np.nan)
    first, second = (_lengths(points, layout) for layout in layouts)
    asked = np.minimum(_count(first), _count(second)) >= MIN_SEGMENTS_KNOWN
    if not asked.any():
        return layouts
    ratio = float(np.median(np.log(_mean(first[asked]) / _mean(second[asked]))))
    if ratio < -np.log(CLEAR_LENGTH_RATIO):
        return layouts[:1]
    return layouts[1:] if ratio > np.log(CLEAR_LENGTH_RATIO) else layouts


def _lengths(points: Array, layout: SkeletonMap) -> Array:
    """Return the lengths of the segments (D, S) in one reading, pixels; NaN where an end is missing."""
    ends = np.array([[layout.points.index(name) for name in segment] for segment in COMPARED_SEGMENTS])
    lengths: Array = np.linalg.norm(points[:, ends[:, 0]] - points[:, ends[:, 1]], axis=-1)
    return lengths


def _count(lengths: Array) -> NDArray[np.intp]:
    count: NDArray[np.intp] = np.count_nonzero(~np.isnan(lengths), axis=1)
    return count


def _mean(lengths: Array) -> Array:
    """Return the mean of the known lengths (D,), never zero: a body in one point fits both."""
    mean: Array = np.maximum(np.nansum(lengths, axis=1) / _count(lengths), 1e-9)
    return mean
