"""Numbers of the sample files: where the camera stands, what the person measures, how far mistakes go."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.robots import load_robot
from posekit.samples import samples
from posekit.skeleton import JOINT, JOINTS


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("sample-numbers")
    samples(made)
    return made


@pytest.fixture(scope="module")
def walk(folder: Path) -> Any:
    return posekit.open(folder / "walk.npz")


def test_the_two_takes_of_the_jump_are_thirty_centimetres_apart(folder: Path, walk: Any) -> None:
    jump = posekit.open(folder / "jump.bvh")
    away = jump.figure_joints - walk.figure_joints
    limb = [JOINT["right_elbow"], JOINT["right_wrist"]]
    rest = [k for k in range(len(JOINTS)) if k not in limb]
    np.testing.assert_allclose(away[:70, rest], 0.0, atol=1e-4)
    np.testing.assert_allclose(away[70:], np.broadcast_to([0.0, 0.0, 0.3], away[70:].shape), atol=1e-4)
    upper, lower = (
        jump.figure_joints[:, JOINT[b]] - jump.figure_joints[:, JOINT[a]]
        for a, b in (("right_shoulder", "right_elbow"), ("right_elbow", "right_wrist"))
    )
    cosine = (upper * lower).sum(axis=1) / np.linalg.norm(upper, axis=1) / np.linalg.norm(lower, axis=1)
    bend = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    np.testing.assert_allclose(bend[30:36], 25.0, atol=0.1)
    wrong = np.flatnonzero(np.abs(away[:, limb[1]]).max(axis=1) > 0.01)
    assert wrong[wrong < 70].tolist() == list(range(30, 36))


def test_the_camera_of_the_key_points_looks_at_the_middle_of_the_walk(folder: Path, walk: Any) -> None:
    (camera,) = posekit.open(folder / "calibration.toml").values()
    assert camera.size == (1280, 720)
    np.testing.assert_allclose(camera.K, [[1000, 0, 640], [0, 1000, 360], [0, 0, 1]])
    to_z_up = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    np.testing.assert_allclose(-camera.R.T @ camera.t, to_z_up @ [4.6, 1.3, 3.2], atol=1e-6)
    middle = (walk.joints.min(axis=(0, 1)) + walk.joints.max(axis=(0, 1))) / 2
    seen = camera.R @ (to_z_up @ middle) + camera.t
    np.testing.assert_allclose(seen[:2] / seen[2], 0.0, atol=1e-6)


def test_key_points_are_written_as_openpose_writes_them(folder: Path) -> None:
    files = sorted((folder / "keypoints").iterdir())
    assert [file.name for file in files] == [f"walk_{k:012d}_keypoints.json" for k in range(12)]
    for file in files:
        (person,) = json.loads(file.read_text())["people"]
        rows = np.array(person["pose_keypoints_2d"]).reshape(25, 3)
        assert (rows[19:] == 0).all()
        assert ((rows[:19, 2] >= 0.8) & (rows[:19, 2] <= 0.95)).all() and np.ptp(rows[:19, 2]) > 0.05
        for middle, right, left in ((1, 2, 5), (8, 9, 12)):  # of shoulders and hips
            np.testing.assert_allclose(rows[middle, :2], (rows[right, :2] + rows[left, :2]) / 2, atol=2e-3)


def test_the_walker_measures_a_metre_seventy_five(walk: Any) -> None:
    """By Winter's shares; lengths of limbs vary between people, but one has both its sides alike."""
    shares = {("hip", "knee"): 0.245, ("knee", "ankle"): 0.246}
    statures = []
    for (start, end), share in shares.items():
        both = [
            np.linalg.norm(walk.points([f"{side}_{start}"]) - walk.points([f"{side}_{end}"]), axis=-1)
            for side in ("right", "left")
        ]
        assert np.ptp(both) < 1e-6
        statures.append(float(both[0].mean()) / share)
    assert np.mean(statures) == pytest.approx(1.75, rel=0.1)


def test_the_robot_squats_on_its_feet_but_for_its_mistakes(folder: Path) -> None:
    arrays = np.load(folder / "robot.npz")
    names, frames = list(arrays["dof_names"]), np.arange(90)
    angle = {name.removesuffix("_joint"): arrays["dof_pos"][:, k] for k, name in enumerate(names)}
    bend, turn = 0.3 * (1 - np.cos(2 * np.pi * frames / 90)), 0.4 * np.sin(2 * np.pi * frames / 90)
    for side, sign in (("left", 1), ("right", -1)):
        for joint, expected in (("hip_pitch", -bend), ("knee", 2 * bend), ("ankle_pitch", -bend)):
            np.testing.assert_allclose(angle[f"{side}_{joint}"], expected, atol=1e-6)
        np.testing.assert_allclose(angle[f"{side}_shoulder_pitch"], sign * turn, atol=1e-6)
    np.testing.assert_allclose(angle["right_shoulder_roll"], -0.3, atol=1e-6)
    for name, usual, span, change in (
        ("left_elbow", 0.0, (10, 35), 2.6),
        ("left_shoulder_roll", 0.3, (46, 55), -0.75),
    ):
        away = angle[name] - usual
        assert set(np.flatnonzero(np.abs(away) > 1e-6)) <= set(range(*span))
        assert away[np.argmax(np.abs(away))] == pytest.approx(change, rel=0.04)
    robot = load_robot("g1", bodies="none")
    q = np.zeros((90, robot.model.nq))
    q[:, :3], q[:, 3:7] = arrays["root_pos"], arrays["root_quat_xyzw"]
    q[:, 7:] = arrays["dof_pos"][:, [names.index(name) for name in robot.configuration_names[7:]]]
    ankles = robot.points(q)[:, [JOINT["right_ankle"], JOINT["left_ankle"]]]
    sunk = ankles[..., 2] - ankles[0, :, 2]
    assert set(np.flatnonzero(np.abs(sunk).max(axis=1) > 1e-6)) <= set(range(65, 85))
    assert sunk.min() == pytest.approx(-0.06, rel=0.02)
    np.testing.assert_allclose(ankles[..., 0], ankles[:1, :, 0].repeat(90, axis=0), atol=1e-6)
    assert float(arrays["fps"]) == 30.0
