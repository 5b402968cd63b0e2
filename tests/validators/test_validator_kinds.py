"""Functions of validators are given and return what their annotations say, to the dtype."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.robots import load_robot
from posekit.synthesis import random_views
from posekit.validators import Validator
from posekit.validators.motion import MOTION_CHECKS, judge_motion
from posekit.validators.suite import Judgement
from tests.annotated import watched
from tests.validators.test_ground_laws import standing
from tests.validators.test_motion_bounds import going
from tests.validators.test_motion_laws import BROKEN, WALK

VIEWS = random_views(load_figure(), 6, np.random.default_rng(42))
UNITS = {"m", "deg", "1", "s", "frames", "m/s", "m/s²", "m/s³"}
PEOPLE = VIEWS.joints_cam + np.random.default_rng(43).normal(0.0, 0.01, VIEWS.joints_cam.shape)


def told(judgements: Sequence[Judgement], count: int) -> None:
    """Assert that every number of each posture has a place, a unit and a verdict."""
    for one in judgements:
        shape = (count, len(one.where))
        assert one.value.shape == one.margin.shape == one.violated.shape == shape
        assert np.broadcast_to(one.lower, shape).shape == np.broadcast_to(one.upper, shape).shape
        assert len(one.unit) == len(one.where) and set(one.unit) <= UNITS


@pytest.mark.parametrize(
    "asked",
    [{}, {"strict": True}, {"noise": 0.01}, {"ranges": "table1"}, {"ranges": "anatomical"}],
    ids=lambda asked: " ".join(map(str, asked.values())) or "as it is",
)
def test_judging_postures_is_what_annotations_say(asked: dict[str, Any]) -> None:
    hidden = PEOPLE.copy()
    hidden[0, 7], hidden[1, 0] = np.nan, np.nan
    with watched("posekit.validators") as wrong:
        for joints in (PEOPLE, hidden, PEOPLE[:0]):
            report = Validator(**asked).check(joints)
            assert len(report.verdicts) == len(joints)
            told(report.judgements, len(joints))
            report.contacts(nearest=True)
    assert wrong == set()


@pytest.mark.parametrize("checks", [None, ("joint-range", "balance"), ("collision",)])
@pytest.mark.parametrize("name", ["human", "talos"])
def test_judging_robots_is_what_annotations_say(name: str, checks: Any) -> None:
    robot = load_robot(name)
    q = np.tile(pin.neutral(robot.model), (5, 1))
    q[1:, 7:] += np.random.default_rng(44).normal(0.0, 0.7, q[1:, 7:].shape)
    with watched("posekit.validators") as wrong:
        for some in (q, q[:0]):
            report = Validator(robot, checks=checks).check(q=some)
            assert len(report.verdicts) == len(some)
            told(report.judgements, len(some))
            report.contacts()
            report.contacts(nearest=True)
    assert wrong == set()


def test_fitting_a_robot_is_what_annotations_say() -> None:
    with watched("posekit.validators") as wrong:
        for joints in (PEOPLE[:3], PEOPLE[:0]):
            report = Validator("human").check(joints)
            assert len(report.verdicts) == len(joints)
            told(report.judgements, len(joints))
            report.contacts()
    assert wrong == set()


CLIPS = {**BROKEN, "walk": WALK, "stand": standing(60), "glide": going(), "noisy": going(noise=0.002)}


@pytest.mark.parametrize("name", CLIPS)
def test_judging_motion_is_what_annotations_say(name: str) -> None:
    clip = CLIPS[name]
    hidden = clip.joints.copy()
    hidden[5:9, 7], hidden[20] = np.nan, np.nan
    checks = [kind() for kind in MOTION_CHECKS.values()]
    with watched("posekit.validators") as wrong:
        for one in (clip, replace(clip, joints=hidden)):
            verdict = judge_motion(checks, one)
            told(verdict.judgements, len(clip.joints))
    assert wrong == set()
