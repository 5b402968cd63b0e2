"""Bodies that are drawn: which ones, where they look, what is written under them, and plots to scale."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import posekit
from posekit.cameras import PinholeCamera
from posekit.motion import Motion
from posekit.skeleton import JOINT
from posekit.synthesis import random_views
from posekit.viewer.scene import Stage
from posekit.viewer.subjects import Subject, subjects_of, upright_camera
from tests.test_formats_motion import squatting, walking
from tests.test_viewer_laws import paths_of

FIGURE = posekit.load_figure()


@pytest.fixture(scope="module")
def found() -> posekit.Recovery:
    return posekit.recover(posekit.builtin_view("seq1"), follow=1)


def front_of(one: Subject) -> np.ndarray:
    """Return the level direction (2,) to which the first posture of a body looks, world."""
    joints = one.robot.points(one.q[:1])[0] @ one.R_world_data.T
    across = joints[JOINT["left_shoulder"]] - joints[JOINT["right_shoulder"]]
    front = np.cross(across, joints[JOINT["neck"]] - joints[JOINT["pelvis"]])[:2]
    return np.asarray(front / np.linalg.norm(front))


@pytest.mark.parametrize("body", ["g1", "+z", "+y", "-y", "+x"])
@pytest.mark.parametrize(("azimuth", "seen"), [(None, 35.0), (0.0, 0.0), (90.0, 90.0), (-120.0, -120.0)])
def test_a_body_is_seen_from_the_azimuth_whatever_way_it_goes(
    azimuth: float | None, seen: float, body: str
) -> None:
    """A G1, or a person in a world with this axis up."""
    if body == "g1":
        motion = squatting(3, yaw=2.0)
    else:
        motion = replace(walking(3), q=None, q_names=(), robot="").rotated(body)
    (one,), captions, rate = subjects_of(motion, azimuth=azimuth, moving=True)
    angle = -np.pi / 2 - np.radians(seen)  # from the eye, which looks along y
    np.testing.assert_allclose(front_of(one), [np.cos(angle), np.sin(angle)], atol=2e-2)
    assert rate == pytest.approx(30.0)
    assert captions == ["frame 0, 0.00 s", "frame 1, 0.03 s", "frame 2, 0.07 s"]
    joints = one.robot.points(one.q[:1])[0] @ one.R_world_data.T
    assert joints[JOINT["neck"], 2] - joints[JOINT["right_ankle"], 2] > 0.6
    assert np.linalg.det(one.R_world_data) == pytest.approx(1.0)


def test_an_unknown_up_axis_is_that_of_the_trunks() -> None:
    motion = replace(walking(3), q=None, q_names=(), robot="").rotated("-y")
    (one,), *_ = subjects_of(replace(motion, up=""), moving=True)
    (same,), *_ = subjects_of(motion, moving=True)
    np.testing.assert_allclose(one.R_world_data, same.R_world_data)


def test_pictures_of_a_motion_show_frames_from_the_first_to_the_last() -> None:
    motion = replace(walking(24), q=None, q_names=(), robot="")
    for frame, numbers in ((None, [0, 5, 9, 14, 18, 23]), (7, [7]), ((3, 5), [3, 4, 5]), ((0, 23), 12)):
        subjects, captions, rate = subjects_of(motion, frame=frame)
        labels = [int(one.label.split(",")[0].removeprefix("frame ")) for one in subjects]
        assert labels == numbers if isinstance(numbers, list) else len(labels) == numbers
        assert (labels[0], labels[-1]) != (0, 0) and captions == [""] and rate is None
        q = FIGURE.configurations(motion.figure_joints[labels]).q
        for one, row in zip(subjects, q, strict=True):
            np.testing.assert_allclose(one.q[0, 7:], row[7:], atol=1e-6)


def test_clips_and_postures_without_times_are_named() -> None:
    walk = replace(walking(4), q=None, q_names=(), robot="")
    two = replace(walk, clip=[0, 0, 1, 1], clips=("a", "b"), frame=None, time=[0, 0.1, 0, 0.1])
    assert subjects_of(two, moving=True)[1] == [
        *("a: frame 0, 0.00 s", "a: frame 1, 0.10 s", "b: frame 0, 0.00 s", "b: frame 1, 0.10 s")
    ]
    several = Motion(joints=walk.figure_joints, frame=[0, 0, 1, 1], up="+z")
    assert subjects_of(several, moving=True)[1:] == (["frame 0", "frame 0", "frame 1", "frame 1"], 2.0)


@pytest.mark.parametrize("which", ["", "answer", "path", "all", "first", "2", "3,0"])
def test_postures_of_a_result_are_those_that_are_named(found: posekit.Recovery, which: str) -> None:
    frame, rows = 1, found.rows(1)
    answer = int(found.answer.survivor[frame]) - rows.start
    numbers = {
        "": [int(row) - rows.start for row in found.answer.representatives[frame][:4]],
        "answer": [answer],
        "path": [answer],
        "all": list(range(min(12, len(found[frame])))),
        "first": [0],
    }.get(which) or [int(part) for part in which.split(",")]
    subjects, captions, rate = subjects_of(found, which=which, frame=frame)
    assert (captions, rate) == ([""], None)
    shares = found[frame].probability
    assert [one.label for one in subjects] == [f"posture {k}, {shares[k]:.0%}" for k in numbers]
    for one, number in zip(subjects, numbers, strict=True):
        np.testing.assert_allclose(one.q[0], found[frame].q[number], atol=1e-9)


def test_a_film_of_a_result_follows_its_path(found: posekit.Recovery) -> None:
    assert found.path is not None
    (one,), captions, _ = subjects_of(found, moving=True)
    placed = one.robot.points(one.q)
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(placed, axis=1), axis=2),
        np.linalg.norm(np.diff(found.path.joints[0], axis=1), axis=2),
        atol=0.03,
    )
    assert len(captions) == len(found) and captions[2].startswith("frame 2")


@pytest.mark.parametrize("tilt", [0.0, 0.5, -0.7, np.pi / 2])
def test_the_world_of_a_camera_is_level_and_ahead_of_it(tilt: float) -> None:
    c, s = np.cos(tilt), np.sin(tilt)
    R = np.array([[1, 0, 0], [0, -s, -c], [0, c, -s]])  # z up; the camera looks down by the tilt
    K = np.array([[900, 0, 320], [0, 900, 240], [0, 0, 1.0]])
    camera = PinholeCamera(K=K, R=R, t=np.zeros(3), up="+z", size=(640, 480))
    joints = random_views(1, np.random.default_rng(0)).truth
    view = posekit.View(camera=camera, image=camera.project(joints @ R.T + [0, 0, 9]), time=np.zeros(1))
    turned = upright_camera(view)
    np.testing.assert_allclose(turned @ R, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(upright_camera(None), [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-12)


def test_the_eye_follows_a_body_that_goes_away() -> None:
    walk = walking(60)
    q = np.array(walk.q)
    q[:, 0] *= 5  # 9 m
    (one,), *_ = subjects_of(replace(walk, q=q, joints=FIGURE.forward_kinematics(q)), moving=True)
    stage = Stage([one])
    worlds, clip = stage.eyes((400, 300), None)
    assert np.linalg.norm(worlds[-1, :2, 3] - worlds[0, :2, 3]) > 7.0
    for points, world in zip(one.points, worlds, strict=True):
        at = np.column_stack([points, np.ones(len(points))]) @ (clip @ np.linalg.inv(world)).T
        assert np.abs(at[:, :2] / at[:, 3:]).max() < 1.05
    turns = np.linalg.norm(np.diff(worlds[:, :3, 3], n=2, axis=0), axis=1)
    assert turns.max() < 0.05  # it moves smoothly
    assert stage.grid == pytest.approx(0.5)


def test_plots_of_a_result_show_survivors_and_truth_to_scale(tmp_path: Path, found: posekit.Recovery) -> None:
    view = posekit.builtin_view("seq1")
    posekit.render(found, tmp_path / "angles.svg", which="angles", view=view)
    text = (tmp_path / "angles.svg").read_text(encoding="utf-8")
    index = FIGURE.angle_index
    true = np.degrees(FIGURE.configurations(view.truth).q[:, index])
    every = [np.degrees(found[k].q[:, index]) for k in range(len(found))]
    lower, upper = np.degrees(FIGURE.limits.lower), np.degrees(FIGURE.limits.upper)
    outside, dashed = (paths_of(text, name) for name in ("outside", "truth"))
    filled = re.findall(
        r'<g id="survivors">.*?<path id="[^"]*" d="([^"]*)".*?<use [^>]*y="([-\d.]+)"', text, re.DOTALL
    )
    bands = [
        np.array(re.findall(r"[ML] ([-\d.]+) ([-\d.]+)", path), dtype=float) + np.array([0.0, float(y)])
        for path, y in filled
    ]
    assert len(dashed) == len(bands) == len(index)
    for k, (line, band) in enumerate(zip(dashed, bands, strict=True)):
        low, high = outside[2 * k][:, 1].min(), outside[2 * k + 1][:, 1].max()

        def degrees(pixels: np.ndarray, k: int = k, low: float = low, high: float = high) -> np.ndarray:
            return np.asarray(lower[k] + (pixels - low) / (high - low) * (upper[k] - lower[k]))

        np.testing.assert_allclose(degrees(line[:, 1]), true[:, k], atol=0.5)
        for x, mine in zip(np.unique(np.round(line[:, 0], 3)), every, strict=True):
            at = degrees(band[np.abs(band[:, 0] - x) < 0.01, 1])
            assert (at.min(), at.max()) == pytest.approx((mine[:, k].min(), mine[:, k].max()), abs=0.5)
