"""From key points to views: neck and pelvis are put where they project to, nothing missing becomes a point."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import posekit
from posekit.cameras import PinholeCamera
from posekit.errors import InputError
from posekit.formats.keypoints import KeyPoints
from posekit.formats.own import OpenCVModel, ScaledOrthographicModel, View
from posekit.formats.skeleton_maps import load_skeleton_map
from posekit.geometry import Array
from posekit.skeleton import HEAD_POINTS, JOINT, JOINTS
from posekit.synthesis import random_views
from posekit.views.builtin import view_of
from posekit.views.person_view import pelvis_fraction, person_view
from tests.detector_files import view_keypoints

FIGURE = posekit.load_figure()
LIMBS = [k for k, name in enumerate(JOINTS) if name not in ("neck", "pelvis")]


def views(count: int = 20, seed: int = 3) -> View:
    return view_of(random_views(FIGURE, count, np.random.default_rng(seed)))


def seen(view: View, layout: str = "coco_17") -> KeyPoints:
    return view_keypoints(view, "coco", layout)


def test_limbs_and_head_keep_their_pixels_and_the_rest_is_derived() -> None:
    view = views()
    again = person_view(seen(view), view.camera, FIGURE)
    np.testing.assert_array_equal(again.image[:, LIMBS], view.image[:, LIMBS])
    np.testing.assert_array_equal(again.head_image, view.head_image)
    assert again.derived == ("neck", "pelvis")
    assert len(again) == len(view)


def test_derived_joints_are_within_centimetres_of_where_they_are() -> None:
    """Perspective alone moves the middle of the shoulders; a bent spine moves the pelvis."""
    view = views(200)
    assert isinstance(view.camera, OpenCVModel)
    again = person_view(seen(view), view.camera, FIGURE)
    f = view.camera.K[0, 0]
    for name, most in (("neck", 0.01), ("pelvis", 0.11)):
        j = JOINT[name]
        true = view.image[:, j]
        if name == "neck":
            shoulders = [JOINT["right_shoulder"], JOINT["left_shoulder"]]
            middle = view.truth[:, shoulders].mean(axis=1)
            true = PinholeCamera(K=view.camera.K, distortion=view.camera.distortion).project(middle)
        off = np.linalg.norm(again.image[:, j] - true, axis=1) * view.truth[:, j, 2] / f
        assert np.median(off) < most / 2
        assert np.quantile(off, 0.95) < most


def test_the_pelvis_is_at_its_fraction_of_a_straight_spine() -> None:
    fraction = pelvis_fraction(FIGURE)
    joints = FIGURE.neutral_points
    shoulders = (joints[JOINT["right_shoulder"]] + joints[JOINT["left_shoulder"]]) / 2
    hips = (joints[JOINT["right_hip"]] + joints[JOINT["left_hip"]]) / 2
    expected = (shoulders[2] - joints[JOINT["pelvis"], 2]) / (shoulders[2] - hips[2])
    assert fraction == pytest.approx(expected, abs=0.01)


@settings(deadline=None, derandomize=True, max_examples=60)
@given(missing=st.sets(st.integers(0, 16)), frame=st.integers(0, 4))
def test_a_missing_point_is_missing_and_never_at_the_origin(missing: set[int], frame: int) -> None:
    view = views(5)
    keypoints = seen(view)
    points = keypoints.points.copy()
    points[frame, sorted(missing)] = np.nan
    lost = KeyPoints(
        format="coco",
        source="a.json",
        layout=keypoints.layout,
        pictures=keypoints.pictures,
        frame=keypoints.frame,
        points=points,
    )
    names = [keypoints.layout.points[k] for k in missing]
    shoulders = not any("shoulder" in name for name in names)
    again = person_view(lost, view.camera, FIGURE)
    assert len(again) == 5
    assert np.isnan(again.image[frame, JOINT["neck"]]).all() == (not shoulders)
    for name in names:
        row = (
            again.image[frame, JOINT[name]]
            if name in JOINT
            else again.head_image[frame, HEAD_POINTS.index(name)]
        )
        assert np.isnan(row).all()
    trunk = [name for name in names if "hip" in name or "shoulder" in name]
    assert np.isnan(again.image[frame, JOINT["pelvis"]]).all() == bool(trunk)


def test_confidences_are_kept_and_unsure_points_left_out() -> None:
    view = views(3)
    keypoints = seen(view)
    confidence = np.full(keypoints.points.shape[:2], 0.9)
    confidence[:, keypoints.layout.points.index("left_wrist")] = 0.1
    sure = KeyPoints(
        format="coco",
        source="a.json",
        layout=keypoints.layout,
        pictures=keypoints.pictures,
        frame=keypoints.frame,
        points=keypoints.points,
        confidence=confidence,
    )
    everything = person_view(sure, view.camera, FIGURE)
    assert everything.confidence[:, JOINT["left_wrist"]] == pytest.approx(0.1)
    assert everything.confidence[:, JOINT["neck"]] == pytest.approx(0.9)
    some = person_view(sure, view.camera, FIGURE, minimum_confidence=0.3)
    assert np.isnan(some.image[:, JOINT["left_wrist"]]).all()
    assert np.isnan(some.confidence[:, JOINT["left_wrist"]]).all()
    assert np.isfinite(some.image[:, JOINT["left_elbow"]]).all()


def test_an_uncalibrated_camera_needs_no_neck() -> None:
    view = views(2)
    points = seen(view).points.copy()
    points[0, load_skeleton_map("coco_17").points.index("left_shoulder")] = np.nan
    again = person_view(changed(seen(view), points), ScaledOrthographicModel(scale=None), FIGURE)
    assert len(again) == 2


@pytest.mark.parametrize("calibrated", [True, False])
@pytest.mark.parametrize("shown", [[0, 1, 3], [2], [1, 2]])
def test_pictures_without_the_person_are_frames_too(shown: list[int], calibrated: bool) -> None:
    """Of a sequence, at its ends too: numbers and times of frames are those of the pictures."""
    view = views(4)
    keypoints = seen(view)
    gone = KeyPoints(
        format="coco",
        source="a.json",
        layout=keypoints.layout,
        pictures=keypoints.pictures,
        frame=np.array(shown),
        points=keypoints.points[shown],
    )
    camera = view.camera if calibrated else ScaledOrthographicModel(scale=None)
    again = person_view(gone, camera, FIGURE, rate=10.0)
    np.testing.assert_allclose(again.time, [0.0, 0.1, 0.2, 0.3], rtol=0, atol=1e-12)
    whole = person_view(keypoints, camera, FIGURE, rate=10.0)
    np.testing.assert_array_equal(again.image[shown], whole.image[shown])
    others = np.setdiff1d(np.arange(4), shown)
    for values in (again.image, again.head_image, again.confidence):
        assert np.isnan(values[others]).all()
    photographs = replace(gone, sequence=False)  # in which nobody is in all
    assert len(person_view(photographs, camera, FIGURE)) == len(shown)


def test_bad_key_points_are_refused() -> None:
    view = views(2)
    keypoints = seen(view)
    nothing = np.full_like(keypoints.points, np.nan)
    with pytest.raises(InputError, match=r"both shoulders.* in none of 2 pictures"):
        person_view(changed(keypoints, nothing), view.camera, FIGURE)
    twice = KeyPoints(
        format="coco",
        source="a.json",
        layout=keypoints.layout,
        pictures=keypoints.pictures,
        frame=np.array([0, 0]),
        points=keypoints.points,
    )
    with pytest.raises(InputError, match=r"000000: more than one person.*--person"):
        person_view(twice, view.camera, FIGURE)
    fractions = KeyPoints(
        format="mediapipe",
        source="a.json",
        layout=keypoints.layout,
        pictures=keypoints.pictures,
        frame=keypoints.frame,
        points=keypoints.points / 2000,
        normalised=True,
    )
    with pytest.raises(InputError, match=r"fractions of the picture.*--size"):
        person_view(fractions, view.camera, FIGURE)


def changed(keypoints: KeyPoints, points: Array) -> KeyPoints:
    return KeyPoints(
        format="coco",
        source="a.json",
        layout=keypoints.layout,
        pictures=keypoints.pictures,
        frame=keypoints.frame,
        points=points,
    )
