"""Segment lengths from a person's stature."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from posekit.body.lengths import hips_points, torso_points
from posekit.errors import FigureError
from posekit.skeleton import SEGMENTS, SIDES, segment_name

UPPER_ARM = 0.186
FOREARM_OF_STATURE = 0.146
THIGH_OF_STATURE = 0.245
SHANK_OF_STATURE = 0.246
SHOULDER_WIDTH = 0.259
HIP_WIDTH = 0.191
SHOULDER_TO_HIP = 0.818 - 0.530
"""Fractions of stature: Drillis & Contini 1966, "Body segment parameters", Technical Report 1166.03, New York
University, as reprinted in Winter, "Biomechanics and Motor Control of Human Movement" (figure 4.1)."""

MIN_STATURE_METRES, MAX_STATURE_METRES = 0.4, 2.8
"""Metres: beyond the statures ever recorded a number is more likely in another unit."""


def stature_from_lengths(lengths: Mapping[str, float]) -> float:
    """Estimate a person's stature (m) from the limbs, by the same fractions: the total length over its share."""
    share = {
        ("shoulder", "elbow"): UPPER_ARM,
        ("elbow", "wrist"): FOREARM_OF_STATURE,
        ("hip", "knee"): THIGH_OF_STATURE,
        ("knee", "ankle"): SHANK_OF_STATURE,
    }
    total = sum(lengths[f"{side}_{a}-{side}_{b}"] for side in SIDES for a, b in share)
    return total / (2 * sum(share.values()))


def lengths_from_stature(stature: float, reference: dict[str, float]) -> dict[str, float]:
    """Estimate the 17 lengths of a person of a given stature.

    Limbs and widths are Drillis & Contini's fractions of stature (1966). They do not give the figure's inner
    torso (neck, pelvis joint): its shape is the reference figure's, scaled across by the widths of shoulders
    and hips and along by the height of the shoulders above the hips.

    Parameters
    ----------
    stature : float
        Standing height, metres.
    reference : dict
        The reference figure's lengths, metres.

    Returns
    -------
    dict
        Lengths, metres, by segment name.

    Raises
    ------
    FigureError
        Where the stature is not a person's in metres.
    """
    if not (math.isfinite(stature) and MIN_STATURE_METRES <= stature <= MAX_STATURE_METRES):
        raise FigureError(
            f"stature is {stature:g} m; expected {MIN_STATURE_METRES} to {MAX_STATURE_METRES} m; is it in another unit?"
        )
    torso, hips = torso_points(reference), hips_points(reference)
    shoulder_scale = SHOULDER_WIDTH * stature / (torso[2, 1] - torso[1, 1])
    hip_scale = HIP_WIDTH * stature / (hips[2, 1] - hips[1, 1])
    height = (torso[1, 2] + torso[2, 2]) / 2 - (torso[3, 2] + (hips[1, 2] + hips[2, 2]) / 2)
    height_scale = SHOULDER_TO_HIP * stature / height
    torso *= [shoulder_scale, shoulder_scale, height_scale]
    hips *= [1.0, hip_scale, height_scale]
    place = dict(zip((0, 1, 2, 3), torso, strict=True)) | {4: hips[1] + torso[3], 5: hips[2] + torso[3]}
    lengths = {
        segment_name((a, b)): float(np.linalg.norm(place[a] - place[b]))
        for a, b in SEGMENTS
        if a in place and b in place
    }
    for side in SIDES:
        lengths[f"{side}_shoulder-{side}_elbow"] = UPPER_ARM * stature
        lengths[f"{side}_elbow-{side}_wrist"] = FOREARM_OF_STATURE * stature
        lengths[f"{side}_hip-{side}_knee"] = THIGH_OF_STATURE * stature
        lengths[f"{side}_knee-{side}_ankle"] = SHANK_OF_STATURE * stature
    return lengths
