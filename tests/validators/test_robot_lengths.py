"""When a robot's own lengths are those of a posture, so that it is judged as it stands."""

from __future__ import annotations

from functools import cache

import pytest

from posekit.robots import load_robot
from posekit.robots.scaling import model_lengths
from posekit.settings import ValidateSettings
from posekit.validators.robot.models import SAME_LENGTH, Models
from posekit.validators.robot.settings import robot_settings


@cache
def models() -> Models:
    return Models(robot=load_robot("human"), settings=robot_settings(ValidateSettings()))


@pytest.mark.parametrize("share", [-2.0, -0.5, 0.0, 0.5, 2.0])
def test_lengths_are_a_robots_own_to_a_difference_that_is_none(share: float) -> None:
    own = model_lengths(models().kinematics)
    assert models().has_lengths({}) and models().has_lengths({"nose-elbow": 0.1})
    for name in models()._rigid_segments:
        assert models().has_lengths(own | {name: own[name] + share * SAME_LENGTH}) == (abs(share) < 1)
