"""Views through every format of key points and back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.cameras.calibrated import CalibratedCamera
from posekit.formats import own as files
from posekit.formats.cameras import write_cameras
from posekit.formats.keypoints import chosen, key_point_formats, read_keypoints
from posekit.formats.own import OpenCVModel, View
from posekit.geometry import Array
from posekit.skeleton import JOINT, JOINTS, POINTS
from tests.detector_files import view_keypoints, write_keypoints

FRAMES, RATE = 8, 25.0
DERIVED = (JOINT["neck"], JOINT["pelvis"])
KEPT = [k for k in range(len(POINTS)) if k not in DERIVED]
FACE = list(range(len(JOINTS), len(POINTS)))
FORMATS: Final = (
    "openpose-body_25",
    "openpose-body_25b",
    "openpose-coco_18",
    "coco",
    "coco-halpe_26",
    "coco-h36m_17",
    "coco-results",
    "coco-wholebody",
    "mediapipe",
    "mmpose",
    "mmpose-h36m_17",
    "mmpose-list",
    "mmpose-list-h36m_17",
    "alphapose",
    "deeplabcut",
)
FLAGGED = ("coco", "coco-wholebody")
"""Formats that say of a point whether it is visible, and not how sure it is."""
TIMED = ("mediapipe",)


def with_gaps(view: View) -> View:
    """Take some points away, and say how sure the others are."""
    rng = np.random.default_rng(7)
    image, head = view.image.copy(), view.head_image.copy()
    image[2, JOINT["left_wrist"]] = image[3, JOINT["right_knee"]] = image[3, JOINT["right_ankle"]] = np.nan
    head[1, 2] = head[5] = np.nan
    sure = np.round(rng.uniform(0.3, 1.0, (len(view), len(POINTS))), 3)
    sure[np.isnan(np.concatenate([image, head], axis=1)[..., 0])] = np.nan
    return replace(view, image=image, head_image=head, confidence=sure)


def points_of(view: View) -> Array:
    return np.concatenate([view.image, view.head_image], axis=1)


def base(name: str) -> str:
    return chosen(name)[0].name


def path_for(folder: Path, name: str) -> Path:
    return folder / ("key_points" + {"openpose": "", "deeplabcut": ".csv"}.get(base(name), ".json"))


@pytest.fixture(scope="module")
def view(walking: View) -> View:
    return with_gaps(walking)


@pytest.fixture(scope="module")
def calibration(tmp_path_factory: pytest.TempPathFactory, view: View) -> Path:
    path = tmp_path_factory.mktemp("camera") / "calibration.toml"
    model = view.camera
    assert isinstance(model, OpenCVModel)
    one = CalibratedCamera(name="cam", K=model.K, size=model.size, R=model.R, t=model.t)
    write_cameras(path, {"cam": one, "other": replace(one, name="other")})
    return path


def test_every_format_is_among_them() -> None:
    assert {base(name) for name in FORMATS} == set(key_point_formats())


@pytest.mark.parametrize("name", FORMATS)
def test_a_view_comes_back_from_key_points(
    name: str, view: View, calibration: Path, tmp_path: Path, command: Callable[..., Any]
) -> None:
    files.write_view(tmp_path / "view.json", view)
    between, back = path_for(tmp_path, name), tmp_path / "back.json"
    write_keypoints(between, view_keypoints(view, name), name)
    options = [] if base(name) in TIMED else ["--fps", RATE]
    here = command("convert", between, back, "--to", "view", "--camera", f"{calibration}:cam", *options)
    assert here.code == 0, here.err
    again = files.read_view(back)
    assert len(again) == FRAMES
    faceless = name.endswith("h36m_17")
    carried = [k for k in KEPT if not (faceless and k in FACE)]
    decimals = 1e-9 if base(name) == "mediapipe" else 0
    np.testing.assert_allclose(
        points_of(again)[:, carried], points_of(view)[:, carried], rtol=0, atol=decimals, equal_nan=True
    )
    if faceless:
        assert np.isnan(again.head_image).all()
    if base(name) in FLAGGED:
        assert np.isnan(again.confidence).all()
    else:
        np.testing.assert_allclose(
            again.confidence[:, carried], view.confidence[:, carried], rtol=0, atol=1e-12, equal_nan=True
        )
    np.testing.assert_allclose(again.time, view.time, rtol=0, atol=1e-9)
    assert again.derived == ("neck", "pelvis")
    shoulders = view.image[:, [JOINT["right_shoulder"], JOINT["left_shoulder"]]].mean(axis=1)
    np.testing.assert_allclose(again.image[:, JOINT["neck"]], shoulders, rtol=0, atol=1e-9)
    model = again.camera
    assert isinstance(model, OpenCVModel)
    assert isinstance(view.camera, OpenCVModel)
    np.testing.assert_allclose(model.K, view.camera.K, rtol=0, atol=1e-9)


@settings(max_examples=25)
@given(data=st.data())
def test_any_points_may_be_missing_in_any_format(
    data: st.DataObject, walking: View, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """A frame keeps at least a nose, for formats have no word for a person without points."""
    name = data.draw(st.sampled_from([name for name in FORMATS if not name.endswith("h36m_17")]))
    missing = data.draw(
        st.lists(st.sets(st.sampled_from([k for k in KEPT if k != FACE[0]])), min_size=3, max_size=3)
    )
    image, head = walking.image[:3].copy(), walking.head_image[:3].copy()
    for frame, lost in enumerate(missing):
        for k in lost:
            (image[frame] if k < len(JOINTS) else head[frame])[k if k < len(JOINTS) else k - len(JOINTS)] = (
                np.nan
            )
    sure = np.where(np.isnan(np.concatenate([image, head], axis=1)[..., 0]), np.nan, 0.5)
    shown = View(camera=walking.camera, time=walking.time[:3], image=image, head_image=head, confidence=sure)
    path = path_for(tmp_path_factory.mktemp("any"), name)
    given_points = view_keypoints(shown, name)
    write_keypoints(path, given_points, name)
    again = read_keypoints(path, name)
    assert again.landmarks.shape == given_points.landmarks.shape
    expected = given_points.landmarks
    assert isinstance(walking.camera, OpenCVModel)
    assert walking.camera.size is not None
    size = walking.camera.size if again.normalised else (1, 1)
    np.testing.assert_allclose(again.landmarks * size, expected, rtol=0, atol=1e-9, equal_nan=True)
    if base(name) not in FLAGGED:
        known = np.isfinite(expected[..., 0])
        np.testing.assert_allclose(again.landmark_confidence[known], 0.5, rtol=0, atol=1e-12)
        assert np.isnan(again.landmark_confidence[~known]).all()


def test_what_is_lost_is_said_by_reading_it_under_its_name(view: View, tmp_path: Path) -> None:
    """Seventeen points without names are COCO's, unless the format is said with its layout."""
    path = tmp_path / "results.json"
    given_points = view_keypoints(view, "coco-results-h36m_17")
    write_keypoints(path, given_points, "coco-results-h36m_17")
    again = read_keypoints(path, "coco-results-h36m_17")
    np.testing.assert_allclose(again.landmarks, given_points.landmarks, rtol=0, atol=0, equal_nan=True)
