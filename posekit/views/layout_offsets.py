"""Key points of a layout are not joints: how far they are beside them, and what a body's lengths are between them.

A key point that lies at a fixed place beside its joint, in the frame of the trunk, belongs to a body of other lengths:
with such lengths key points are recovered as they were meant. How well a place is known bounds how well the lengths
are, which are the same in all frames of a clip: what is off systematically is no noise of a frame. Tables of lengths
have room for where a detector sees the joints (`posekit.body.anthropometry.proportions`), so that the larger counts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Final, NamedTuple

from posekit.body.anthropometry import SegmentLengths
from posekit.body.anthropometry.body import (
    HIP_WIDTH,
    SHOULDER_WIDTH,
    TRUNK_LENGTH,
    dimensions_of,
    lengths_of,
    limb,
)
from posekit.formats.skeleton_maps import SkeletonMap
from posekit.skeleton import SIDES


class LayoutOffset(NamedTuple):
    """Where key points are beside what a table's lengths are between, as shares of the stature, in the trunk's frame.

    Attributes
    ----------
    outward, up : float
        Away from the middle of the body, and along the trunk from hips to shoulders.
    deviation : float
        Standard deviation of each of the two.
    """

    outward: float = 0.0
    up: float = 0.0
    deviation: float = 0.0


SHOULDER_OFFSET: Final = LayoutOffset(outward=-0.0227, up=0.0, deviation=0.006)
"""Of shoulders, from the acromia: detectors put them 4 cm further in, near the heads of the humeri.

Learned from one recording (MediaPipe's points, triangulated by four cameras, 0.66 of the trunk apart; the acromia are
0.82). In the other (OpenPose's BODY_25B), which it was not learned from, they are 0.655 of the trunk apart.
"""

HIP_OFFSET: Final = LayoutOffset(outward=0.0, up=0.0, deviation=0.014)
"""Of hips, from the heads of the femurs: detectors are 30 to 50 mm off there (Needham et al. 2021, "The accuracy of
several pose estimation methods for 3D joint centre localisation", Sci. Rep. 11:20673). Which way differs: the thighs of
one of the two recordings are 4 cm longer than between joints, those of the other are not; all of it is left open.
"""

JOINT_LAYOUTS: Final = ("h36m_17",)
"""Layouts of joints that motion capture has put: Human3.6M's."""


def offsets_of(layout: SkeletonMap) -> Mapping[str, LayoutOffset]:
    """Return where shoulders and hips of a detector's layout are beside a table's; nothing of one that marks joints.

    Motion capture has no order of its points, and who marks a neck that is no middle of the shoulders marks joints.
    """
    if "neck" in layout.landmarks or not layout.points or layout.name in JOINT_LAYOUTS:
        return {}
    return {"shoulder": SHOULDER_OFFSET, "hip": HIP_OFFSET}


def between_key_points(lengths: SegmentLengths, stature: float, layout: SkeletonMap) -> SegmentLengths:
    """Return a person's lengths between the key points of a layout, of those between joints.

    Parameters
    ----------
    lengths : SegmentLengths
        All 17, as a table has them that gives joint centres and the width over the acromia.
    stature : float
        Metres.
    layout : SkeletonMap
        The detector's.
    """
    offsets = offsets_of(layout)
    if not offsets:
        return lengths
    shoulder, hip = offsets["shoulder"], offsets["hip"]
    dimensions = dimensions_of(lengths.lengths)
    moved = {SHOULDER_WIDTH: 2 * shoulder.outward, HIP_WIDTH: 2 * hip.outward, TRUNK_LENGTH: 0.0}
    for side in SIDES:
        moved |= {limb(side, "upper_arm"): shoulder.up, limb(side, "thigh"): hip.up}
    own = {"shoulder": shoulder.deviation, "hip": hip.deviation}
    seen = {name: one + stature * moved.get(name, 0.0) for name, one in dimensions.items()}
    found = lengths_of(seen, lengths.lengths)
    off = {}
    for name, one in lengths.deviation.items():
        relative = one / lengths.lengths[name]
        beside = math.hypot(*(own.get(_part(end), 0.0) for end in name.split("-"))) if name in moved else 0.0
        off[name] = max(relative * found[name], stature * beside)
    return replace(lengths, lengths=found, deviation=off)


def _part(joint: str) -> str:
    """Return which part of the body a joint is, whatever its side."""
    return joint.rpartition("_")[2]
