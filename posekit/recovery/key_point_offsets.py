"""How far key points are from a body's joints, where nothing but the picture tells: as far as people put them apart."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from posekit.geometry import Array
from posekit.skeleton import JOINTS

ANNOTATION_SIGMAS: Final = {
    "neck": 0.079,
    "shoulder": 0.079,
    "elbow": 0.072,
    "wrist": 0.062,
    "pelvis": 0.107,
    "hip": 0.107,
    "knee": 0.087,
    "ankle": 0.089,
}
"""Root mean square distance of annotators' points, over the root of the person's area in the picture.

The constants of COCO's object keypoint similarity, from 5000 images that were annotated more than once
(cocodataset.org/#keypoints-eval). Detectors' good key points are as far off (Ronchi & Perona 2017, "Benchmarking and
Error Diagnosis in Multi-Instance Pose Estimation"). COCO has no neck and no pelvis: they are as shoulders and hips.
"""

ROOT_AREA_METRES: Final = 0.67
"""Root of a person's area in a picture: a convex body shows a quarter of its surface on average (Cauchy), an adult's
surface is 1.8 square metres (Du Bois & Du Bois 1916)."""

PIXEL_DEVIATION: Final = 1.0
"""Standard deviation of image points, pixels, beside what they are off the joints: most are whole pixels."""

LENGTH_DEVIATION: Final = 0.05
"""Relative standard deviation of each length beside the common size, where nobody says whose body it is: what limbs
differ by among adults of a stature (3.5 to 5.7 %, Gordon et al. 2014, NATICK/TR-15/007)."""


def joint_offsets() -> Array:
    """Return the standard deviation of each coordinate of a key point from its joint (14,), metres."""
    sigmas = [ANNOTATION_SIGMAS[name.rpartition("_")[2]] for name in JOINTS]
    return np.array(sigmas) * ROOT_AREA_METRES / math.sqrt(2)
