"""What readers are told of answers."""

from __future__ import annotations

import numpy as np
import pytest

from posekit.answers import Answer, ListedBodies, answers_of
from posekit.answers.wording import answer_lines, difference, percent
from posekit.geometry import Array
from posekit.skeleton import JOINT

WRIST, ELBOW, KNEE = JOINT["right_wrist"], JOINT["right_elbow"], JOINT["left_knee"]


def posture(**depths: float) -> Array:
    """Return all joints in one plane, but for the depth of some."""
    joints = np.full((14, 3), 4.0)
    for name, depth in depths.items():
        joints[JOINT[name], 2] += depth
    return joints


def answer(probability: list[float], *postures: Array) -> Answer:
    joints = np.array(postures).reshape(-1, 14, 3)
    return answers_of([ListedBodies(joints=joints, probability=np.array(probability), uncertainty=0.005)])[0]


TWO = answer([0.8, 0.2], posture(right_wrist=-0.2), posture(right_wrist=0.2))
ONE = answer([1.0], posture(right_wrist=-0.2))
NONE = answer([])


def test_one_frame_is_told_with_its_limbs_and_its_alternative():
    assert answer_lines([TWO]) == [
        "likeliest: 80 % sure, to 5 cm in every joint; the right forearm points to the camera (80 %)",
        "what else it can be: 2 distinct postures hold 95 % (80 %, 20 %); in the second the right forearm points away "
        "from the camera",
    ]


def test_nothing_is_sure_of_joints_that_no_picture_shows():
    uncertainty = np.tile(np.eye(3) * 0.005**2, (1, 14, 1, 1))
    uncertainty[:, [JOINT["left_knee"], JOINT["left_ankle"]]] = np.nan
    (half,) = answers_of(
        [ListedBodies(joints=ONE.bodies.joints, probability=np.ones(1), uncertainty=uncertainty)]
    )
    assert "sure, to 5 cm in every joint that is seen (2 of 14 are not); " in answer_lines([half])[0]
    assert "in every joint that is seen (up to 2 of 14 are not); " in answer_lines([ONE, half])[0]


def test_what_is_sure_is_told_as_sure():
    first, second = answer_lines([ONE])
    assert first.startswith("likeliest: 100 % sure")
    assert "over 95 % sure" in first
    assert "nothing that differs" in second


def test_of_frames_the_least_sure_is_named_counted_from_0():
    first, second = answer_lines([ONE, NONE, TWO, ONE])
    assert "least sure is frame 2, 80 %: the right forearm" in first
    assert second.endswith("1 distinct posture holds 95 % in the median frame, 2 in frame 2")
    assert "2 distinct postures hold 95 % in the median frame" in answer_lines([ONE, TWO])[1]


def test_what_is_not_listed_counts_against_what_is_said():
    (sure,) = answers_of(
        [ListedBodies(joints=ONE.bodies.joints, probability=np.ones(1), uncertainty=0.005, unlisted=0.4)]
    )
    first, second = answer_lines([sure])
    assert first.startswith("likeliest: 60 % sure")
    assert first.endswith("over 95 % sure of what is listed")
    assert second == "what else it can be: what is not listed, which may hold 40 %"
    assert answer_lines([sure, ONE])[1].endswith("what is not listed, which may hold 40 % of a frame")
    bodies = ListedBodies(joints=TWO.bodies.joints, probability=np.array([0.8, 0.2]), unlisted=0.4)
    assert "2 distinct postures hold 60 % (48 %, 12 %)" in answer_lines(answers_of([bodies]))[1]


@pytest.mark.parametrize("answers", [[], [NONE], [NONE, NONE]])
def test_of_nothing_nothing_is_told(answers):
    assert answer_lines(answers) == []


@pytest.mark.parametrize(
    ("depths", "said"),
    [
        ({"left_knee": 0.3}, "the left thigh points away from the camera, the left lower leg to it"),
        ({"neck": -0.3}, "the trunk leans to the camera"),
        ({"right_shoulder": -0.3}, "the right shoulder is the nearer one"),
        ({"right_hip": 0.3}, "the left hip is the nearer one"),
    ],
)
def test_what_turned_is_named_as_readers_name_it(depths, said):
    other = {name: -depth for name, depth in depths.items()}
    assert said in difference(posture(**other), posture(**depths))


def test_without_a_turn_the_joint_that_moved_most_is_named():
    moved = posture()
    moved[WRIST, 0] += 0.07
    assert difference(posture(), moved) == "the right wrist is 7 cm elsewhere"


@pytest.mark.parametrize(
    ("probability", "written"),
    [(1.0, "100 %"), (0.999, "over 99 %"), (0.5, "50 %"), (0.001, "under 1 %"), (0.0, "0 %")],
)
def test_100_percent_is_certain(probability, written):
    assert percent(probability) == written
