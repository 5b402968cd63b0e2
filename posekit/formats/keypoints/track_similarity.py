r"""How alike two detections are: COCO's object keypoint similarity, widened for motion.

.. math:: s(a, b) = \frac1n \sum_i \exp\left(-\frac{d_i^2}{2 A (k_i^2 + m^2 g^2)}\right)

over the n landmarks that both have, with d_i their distance in the picture, A the person's area, k_i twice COCO's
standard deviation of the landmark (cocodataset.org, "Keypoint Evaluation", 1.2: Object Keypoint Similarity; the numbers
as in pycocotools, ``cocoeval.Params.setKpParams``), and m the motion that is allowed a picture, g pictures apart.
COCO's measure is the one with m = 0. Matching the poses of successive pictures by it is Xiao, Wu & Wei 2018 (Simple
baselines for human pose estimation and tracking, §3).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.formats.skeleton_maps import LANDMARK_INDEX, LANDMARK_ORDER
from posekit.geometry import Array

LANDMARK_SIGMA: Final = {
    "nose": 0.026,
    "eye": 0.025,
    "ear": 0.035,
    "shoulder": 0.079,
    "elbow": 0.072,
    "wrist": 0.062,
    "hip": 0.107,
    "knee": 0.087,
    "ankle": 0.089,
}
"""COCO's standard deviation of each landmark, in units of the square root of the person's area."""
COMPARED_LANDMARKS: Final = tuple(
    LANDMARK_INDEX[name] for name in LANDMARK_ORDER if name.rpartition("_")[2] in LANDMARK_SIGMA
)
"""COCO's 17: the necks and pelvises of formats are other points in each."""
FALLOFF_K: Final = np.array(
    [2 * LANDMARK_SIGMA[LANDMARK_ORDER[k].rpartition("_")[2]] for k in COMPARED_LANDMARKS]
)

MOTION_SIGMA: Final = 0.12
"""Standard deviation of what the expected place is wrong by, a picture, in units of the square root of the area."""
AREA_OVER_BOX: Final = 0.53
"""A person's area as a fraction of the box around the key points: the usual one where there is no outline (MMPose)."""
MIN_WIDTH_OVER_HEIGHT: Final = 0.25
"""Width of a box against its height, at least: somebody who is seen from the side has hardly any."""
UNSEEN_SIMILARITY: Final = 1e-3
"""What is left of the similarity where nothing of both is seen."""


def area(points: Array) -> Array:
    """Return the areas of people (N,) of their points (N, P, 2), square pixels; NaN where fewer than two are known."""
    known = ~np.isnan(points[..., 0])
    low = np.where(known[..., None], points, np.inf).min(axis=1)
    high = np.where(known[..., None], points, -np.inf).max(axis=1)
    several = known.sum(axis=1) > 1
    width, height = np.where(several[:, None], high - low, np.nan).T
    longest = np.maximum(width, height)
    areas = (
        AREA_OVER_BOX
        * np.maximum(width, MIN_WIDTH_OVER_HEIGHT * longest)
        * np.maximum(height, MIN_WIDTH_OVER_HEIGHT * longest)
    )
    return np.asarray(np.where(areas > 0, areas, np.nan))


def similarity(expected: Array, seen: Array, areas: Array, gap: Array) -> Array:
    """Compare everybody with everybody.

    Parameters
    ----------
    expected : array (T, 17, 2)
        Where people are expected, pixels; NaN where a point is not known.
    seen : array (N, 17, 2)
        Where people are.
    areas : array (T, N)
        Their common areas, square pixels.
    gap : array (T,)
        Pictures between the two.

    Returns
    -------
    array (T, N)
        0 to 1.
    """
    squared = ((expected[:, None] - seen[None]) ** 2).sum(axis=-1)
    both = ~np.isnan(squared)
    spread = areas[..., None] * (FALLOFF_K**2 + (MOTION_SIGMA * gap[:, None, None]) ** 2)
    with np.errstate(invalid="ignore", under="ignore"):
        alike = np.where(both, np.exp(-np.where(both, squared, 0.0) / (2 * spread)), 0.0)
    count = both.sum(axis=-1)
    mean = alike.sum(axis=-1) / np.maximum(count, 1)
    return np.asarray(np.where((count > 0) & ~np.isnan(mean), mean, UNSEEN_SIMILARITY))
