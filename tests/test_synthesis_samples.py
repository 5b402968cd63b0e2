"""The sample files: they open as what they are said to be, and hold the mistakes that they are said to hold."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import posekit
from posekit.cameras import LeeChenCamera, PinholeCamera, ScaledOrthographicCamera
from posekit.errors import InputError
from posekit.motion import Motion
from posekit.robots import load_robot
from posekit.samples import ELBOW_BACK, JUMP_FRAME, ROBOT_MISTAKES, SAMPLE_FILES, WALK_FRAMES, samples
from posekit.skeleton import JOINT


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("samples")
    lines = samples(made)
    assert len(lines) == len(SAMPLE_FILES) and lines[0].startswith("walk.json ")
    return made


def test_the_folder_has_the_files_and_no_others(folder: Path) -> None:
    assert {path.name for path in folder.iterdir()} == {name.rstrip("/") for name in SAMPLE_FILES}


def test_files_are_the_same_every_time(folder: Path, tmp_path: Path) -> None:
    samples(tmp_path)
    for name in ("walk.json", "photo.json", "gripper.json", "calibration.toml", "jump.bvh"):
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()


def test_views_open_with_their_cameras_and_truth(folder: Path) -> None:
    walk, photo = posekit.open(folder / "walk.json"), posekit.open(folder / "photo.json")
    assert isinstance(walk, posekit.View) and isinstance(walk.camera, LeeChenCamera) and len(walk) == 5
    assert isinstance(photo, posekit.View) and isinstance(photo.camera, ScaledOrthographicCamera)
    assert np.array_equal(photo.image, photo.image.round()) and photo.deviation == 2.0
    assert np.isfinite(walk.truth).all() and np.isfinite(photo.truth).all()


def test_key_points_lie_at_the_projections_of_the_walk(folder: Path) -> None:
    seen, cameras = posekit.open(folder / "keypoints"), posekit.open(folder / "calibration.toml")
    assert isinstance(seen, posekit.Detections) and isinstance(cameras, dict) and list(cameras) == ["cam_01"]
    camera, walk = cameras["cam_01"], posekit.open(folder / "walk.npz")
    assert isinstance(camera, PinholeCamera) and isinstance(walk, Motion)
    assert camera.R is not None and camera.t is not None
    assert camera.R[0, 2] == pytest.approx(0, abs=1e-9) and camera.R[1, 2] < -0.9  # level; z is up
    world = walk.points(("right_wrist", "left_ankle"))[:36:3]
    turned = world @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]).T  # y up to z up
    pixels = camera.project(turned @ camera.R.T + camera.t)
    found = seen.points[:, [list(seen.names).index(name) for name in ("right_wrist", "left_ankle")]]
    assert found.shape == pixels.shape
    assert np.abs(found - pixels).max() < 9 and np.std(found - pixels) == pytest.approx(2, rel=0.4)


def test_the_walk_stands_on_the_ground_in_step_with_its_rate(folder: Path) -> None:
    walk = posekit.open(folder / "walk.npz")
    ankles = walk.points(("right_ankle", "left_ankle"))
    assert ankles[..., 1].min() == pytest.approx(0.08) and ankles[..., 1].max() < 0.5
    assert walk.rate == pytest.approx(30.0) and len(walk) == WALK_FRAMES and walk.time[0] == 0
    speed = np.diff(walk.points(("pelvis",))[:, 0], axis=0) * walk.rate
    assert 0.8 < np.linalg.norm(speed.mean(axis=0)) < 1.6 and abs(speed.mean(axis=0)[1]) < 0.02


def test_the_jump_has_a_cut_and_an_elbow_that_bends_backward(folder: Path) -> None:
    walk, jump = posekit.open(folder / "walk.npz"), posekit.open(folder / "jump.bvh")
    assert isinstance(walk, Motion) and isinstance(jump, Motion) and jump.rate == pytest.approx(30, rel=1e-3)
    steps = np.linalg.norm(np.diff(jump.figure_joints[:, JOINT["pelvis"]], axis=0), axis=1)
    assert int(np.argmax(steps)) == JUMP_FRAME - 1 and steps.max() > 0.25
    wrists = [motion.figure_joints[:, JOINT["right_wrist"]] for motion in (walk, jump)]
    away = np.linalg.norm(wrists[0] - wrists[1], axis=1)
    assert (away[ELBOW_BACK] > 0.05).all() and away[:30].max() < 1e-3


def test_the_gripper_keeps_the_lengths_of_the_robot(folder: Path) -> None:
    view = json.loads((folder / "gripper.json").read_text())
    (frame,) = view["frames"]
    apart = np.subtract(frame["truth"]["panda_joint3"], frame["truth"]["panda_joint4"])
    assert np.linalg.norm(apart) == pytest.approx(0.0825, abs=1e-6)  # Franka's a4
    assert view["camera"] == {"model": "scaled-orthographic", "scale": None}


def test_the_robot_breaks_its_limits_where_stated(folder: Path) -> None:
    arrays = np.load(folder / "robot.npz")
    robot = load_robot("g1", bodies="none")
    frames, joint, _ = ROBOT_MISTAKES[0]
    upper = robot.upper[list(robot.configuration_names).index(joint)]
    beyond = arrays["dof_pos"][:, list(arrays["dof_names"]).index(joint)] > upper
    assert beyond.any() and set(np.flatnonzero(beyond)) <= set(range(frames.start, frames.stop))
    assert np.allclose(np.linalg.norm(arrays["root_quat_xyzw"], axis=1), 1)


def test_a_file_is_no_folder(folder: Path) -> None:
    with pytest.raises(InputError, match="expected a folder"):
        samples(folder / "walk.json")
