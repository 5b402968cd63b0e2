"""Jerk of the root, joint velocities of robots, speed over gaps: checks whose values have a closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from posekit.geometry import Array
from posekit.skeleton import JOINT, JOINTS
from posekit.validators.motion import MotionClip, judge_motion
from posekit.validators.motion.joint_velocity import JointVelocity
from posekit.validators.motion.root_jerk import RootJerk
from posekit.validators.motion.speed import JointSpeed

UP = np.array([0.0, 0.0, 1.0])


def swaying(hertz: float, metres: float, *, rate: float = 60.0, seconds: float = 12.0) -> MotionClip:
    time = np.arange(round(seconds * rate)) / rate
    joints = np.zeros((len(time), len(JOINTS), 3))
    joints[..., 0] = metres * np.sin(2 * np.pi * hertz * time)[:, None]
    return MotionClip(joints=joints, time=time, rate=rate, up=UP)


@pytest.mark.parametrize("hertz", [0.5, 1.0, 1.5])
def test_mean_jerk_of_a_sway_is_that_of_its_sine(hertz: float) -> None:
    (found,) = judge_motion([RootJerk()], swaying(hertz, 0.1)).judgements
    expected = 0.1 * (2 * np.pi * hertz) ** 3 * 2 / np.pi
    assert found.value[len(found.value) // 2, 0] == pytest.approx(expected, rel=0.03)


def test_what_is_faster_than_the_filter_is_no_jerk_of_the_root() -> None:
    (found,) = judge_motion([RootJerk()], swaying(12.0, 0.01)).judgements
    assert np.nanmax(found.value) < 0.01 * 0.01 * (2 * np.pi * 12.0) ** 3


def test_jerk_of_a_short_clip_is_not_asked() -> None:
    assert "1 s" in judge_motion([RootJerk()], swaying(1.0, 0.1, seconds=0.5)).not_asked["root-jerk"]


def test_speed_over_a_gap_is_the_way_over_its_time() -> None:
    clip = swaying(0.0, 0.0, rate=30.0, seconds=2.0)
    joints = clip.joints + (6.0 * clip.time)[:, None, None] * np.array([1.0, 0.0, 0.0])
    kept = np.delete(np.arange(60), slice(20, 30))
    gone = MotionClip(joints=joints[kept], time=clip.time[kept], rate=30.0, up=UP)
    (found,) = judge_motion([JointSpeed()], gone).judgements
    assert np.allclose(found.value[1:], 6.0)
    assert np.isnan(found.value[0]).all()


def robot(velocity: Array, fastest: Array) -> MotionClip:
    count = len(velocity)
    return MotionClip(
        joints=np.full((count, len(JOINTS), 3), np.nan),
        time=np.arange(count) / 50.0,
        rate=50.0,
        velocity=velocity,
        velocity_limits=fastest,
        velocity_names=("root.0", "knee", "ankle"),
    )


def test_joint_velocities_are_shares_of_the_limits_that_there_are() -> None:
    velocity = np.array([[np.nan] * 3, [9.0, -3.0, 1.0], [9.0, 4.5, 1.0]])
    (found,) = judge_motion([JointVelocity()], robot(velocity, np.array([np.inf, 4.0, 0.0]))).judgements
    assert found.where == ("knee",)
    assert found.violated.ravel().tolist() == [False, False, True]
    assert found.value[1:, 0] == pytest.approx([0.75, 1.125])


def test_joint_velocities_are_not_asked_without_limits() -> None:
    verdict = judge_motion([JointVelocity()], robot(np.zeros((3, 3)), np.full(3, np.inf)))
    assert "no velocity limits" in verdict.not_asked["joint-velocity"]
    unknown = replace(robot(np.zeros((3, 3)), np.ones(3)), velocity_limits=None)
    assert "no configurations" in judge_motion([JointVelocity()], unknown).not_asked["joint-velocity"]
    assert JointVelocity().places(unknown) == ()
    people = MotionClip(joints=np.zeros((3, len(JOINTS), 3)), time=np.arange(3) / 50.0, rate=50.0)
    assert "no configurations" in judge_motion([JointVelocity()], people).not_asked["joint-velocity"]


def test_a_joint_that_is_never_known_breaks_nothing() -> None:
    clip = swaying(1.0, 0.1)
    joints = clip.joints.copy()
    joints[:, JOINT["pelvis"]] = np.nan
    (found,) = judge_motion([JointSpeed()], MotionClip(joints=joints, time=clip.time, rate=60.0)).judgements
    assert not found.violated.any()
    assert np.isfinite(found.value[1:, JOINT["neck"]]).all()
