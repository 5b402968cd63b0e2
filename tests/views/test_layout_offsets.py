"""Key points of a layout are not joints: lengths between them, of those between joints."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

import posekit
from posekit.body.anthropometry import lengths_from_proportions
from posekit.body.anthropometry.body import HIP_WIDTH, SHOULDER_WIDTH, TRUNK_LENGTH, dimensions_of
from posekit.formats.skeleton_maps import load_skeleton_map
from posekit.skeleton import SEGMENT_NAMES
from posekit.views.layout_offsets import between_key_points, offsets_of

DETECTORS = ("coco_17", "body_25b", "halpe_26", "mediapipe_33")
BESIDE = (
    "right_shoulder-right_elbow",
    "left_shoulder-left_elbow",
    "right_hip-right_knee",
    "left_hip-left_knee",
)


@given(stature=st.floats(1.4, 2.1), layout=st.sampled_from(DETECTORS))
def test_limbs_and_widths_change_by_the_offsets_and_the_trunk_stays(stature: float, layout: str) -> None:
    given_lengths = lengths_from_proportions("de-leva", stature)
    skeleton = load_skeleton_map(layout)
    found = between_key_points(given_lengths, stature, skeleton)
    shoulder, hip = (offsets_of(skeleton)[name] for name in ("shoulder", "hip"))
    before, after = dimensions_of(given_lengths.lengths), dimensions_of(found.lengths)
    changed = dict.fromkeys(before, 0.0) | {
        SHOULDER_WIDTH: 2 * shoulder.outward,
        HIP_WIDTH: 2 * hip.outward,
        TRUNK_LENGTH: 0.0,
        **dict.fromkeys(BESIDE[:2], shoulder.up),
        **dict.fromkeys(BESIDE[2:], hip.up),
    }
    for name, length in after.items():
        assert length == pytest.approx(before[name] + stature * changed[name], abs=1e-9)
    posekit.load_figure().scaled(found.lengths)


@pytest.mark.parametrize("layout", DETECTORS)
def test_lengths_are_never_better_known_for_it(layout: str) -> None:
    lengths = lengths_from_proportions("de-leva", 1.7)
    found = between_key_points(lengths, 1.7, load_skeleton_map(layout))
    for name in SEGMENT_NAMES:
        least = lengths.deviation[name] / lengths.lengths[name]
        assert found.deviation[name] / found.lengths[name] >= least * (1 - 1e-9)


@pytest.mark.parametrize("layout", ["joint_centres", "h36m_17", "plug_in_gait"])
def test_who_marks_joints_keeps_the_lengths_between_them(layout: str) -> None:
    lengths = lengths_from_proportions("de-leva", 1.7)
    assert between_key_points(lengths, 1.7, load_skeleton_map(layout)) is lengths
