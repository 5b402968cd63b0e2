"""What the validator of robots takes, and what it refuses."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.errors import FigureError, InputError
from posekit.robots import QuaternionWarning, load_robot
from posekit.robots.find import find
from posekit.robots.joint_map import load_joint_map
from posekit.validators import Validator
from posekit.validators.robot import ROBOT_CHECKS, ROBOT_DEFAULT

FIGURE = load_figure()
STANDING = FIGURE.neutral_points[None, :14].copy()
HUMAN = load_robot("human")
NEUTRAL = pin.neutral(HUMAN.model)[None]
LIMITS = ("joint-range",)


def test_no_name_is_the_stick_figure_and_human_is_a_robot() -> None:
    assert Validator().figure is FIGURE
    assert Validator("stick_figure").robot is None
    validator = Validator("human")
    assert validator.robot is not None
    assert validator.robot.name == "human"
    assert validator.checks == ROBOT_DEFAULT
    with pytest.raises(InputError, match="the validator judges a robot"):
        _ = validator.figure


def test_a_file_with_the_figures_joints_is_a_figure_and_any_other_a_robot(tmp_path: Path) -> None:
    FIGURE.from_stature(1.6).write(tmp_path / "short.urdf")
    short = Validator(str(tmp_path / "short.urdf"))
    assert short.robot is None
    assert short.figure.lengths["neck-pelvis"] < FIGURE.lengths["neck-pelvis"]
    assert Validator(find("human").urdf).robot is not None


def test_a_robot_and_a_map_may_be_objects() -> None:
    validator = Validator(HUMAN, joint_map=load_joint_map("human"), checks=LIMITS)
    assert validator.check(STANDING).q.shape == (1, HUMAN.model.nq)
    assert Validator(HUMAN, joint_map="human", checks=LIMITS).robot is HUMAN


def test_checks_are_applied_in_one_order() -> None:
    validator = Validator(HUMAN, checks=tuple(reversed(ROBOT_CHECKS)))
    assert validator.checks == ROBOT_CHECKS
    names = [one.check for one in validator.check(q=NEUTRAL).judgements]
    assert names == ["joint_range", "collision", "balance"]


def test_each_check_can_be_switched_off() -> None:
    for check in ROBOT_CHECKS:
        report = Validator(HUMAN, checks=(check,), lengths="model").check(STANDING)
        assert [one.check for one in report.judgements] == [check.replace("-", "_")]


def test_an_arm_is_judged_without_a_joint_map() -> None:
    panda = load_robot("panda", free_flyer=False, geometry=False)
    validator = Validator(panda, checks=("joint-range", "balance"))
    q = np.clip(pin.neutral(panda.model), panda.lower, panda.upper)[None]
    report = validator.check(q=q)
    assert not report.invalid.any()
    assert validator.configuration_names == panda.configuration_names
    with pytest.raises(InputError, match="no built-in joint map fits"):
        validator.check(STANDING)


def test_a_joint_map_that_is_given_must_fit_even_where_none_is_needed() -> None:
    panda = load_robot("panda", free_flyer=False, geometry=False)
    assert Validator(panda, checks=("joint-range",)).kinematics is None
    with pytest.raises(InputError, match="human"):
        _ = Validator(panda, checks=("joint-range",), joint_map="human").kinematics


def test_a_report_says_which_bodies_were_taken() -> None:
    told = {"urdf": "the URDF's collision bodies", "capsules": "made up: capsules along the segments"}
    for bodies, words in {**told, "visual": "the URDF's visual bodies"}.items():
        robot = load_robot("talos", visuals=bodies == "visual")
        assert Validator(robot, checks=("collision",), bodies=bodies).describe()["bodies"].startswith(words)


def test_quaternions_that_are_nearly_of_unit_length_are_normalised_with_a_warning() -> None:
    q = NEUTRAL.copy()
    q[0, 6] = 1.001
    with pytest.warns(QuaternionWarning, match="normalised"):
        report = Validator(HUMAN, checks=LIMITS).check(q=q)
    assert np.linalg.norm(report.q[0, 3:7]) == pytest.approx(1.0)


def test_what_was_judged_is_described() -> None:
    settings = Validator(HUMAN).describe()
    assert settings["robot"] == "human"
    assert settings["figure"] == HUMAN.hash
    assert settings["checks"] == list(ROBOT_DEFAULT)
    assert all("-" in pair for pair in settings["pairs"])
    assert "stick figure's SRDF" in settings["pairs_from"]
    own = Validator("talos").describe()
    assert own["pairs_from"] == "the SRDF"
    assert "collision bodies" in own["bodies"] and "bodies_because" not in own
    assert settings["bodies_because"] == "no pair of the robot's own bodies can collide"
    assert "bodies_because" not in Validator(HUMAN, bodies="capsules").describe()


@pytest.mark.parametrize("subject", ["human", "figure"])
def test_nothing_is_decided_of_a_configuration_with_nan_and_the_others_are_judged(subject: str) -> None:
    q = np.repeat(NEUTRAL if subject == "human" else NEUTRAL[:, :29], 4, axis=0)
    q[1, 9], q[3, 7:] = np.nan, 3.0
    report = Validator(HUMAN if subject == "human" else None, checks=LIMITS).check(q=q)
    alone = Validator(HUMAN if subject == "human" else None, checks=LIMITS).check(q=q[[0, 2, 3]])
    assert [report.verdicts[k] for k in (0, 2, 3)] == alone.verdicts and "invalid" in alone.verdicts
    assert report.verdicts[1] == "undecided" and np.isnan(report.q[1]).all()
    assert not (report.contacts(nearest=True).posture == 1).any()
    listed = Validator(HUMAN if subject == "human" else None, checks=LIMITS).check(q=q.tolist())
    assert listed.verdicts == report.verdicts


@pytest.mark.parametrize(
    ("q", "text"),
    [
        (NEUTRAL[:, :5], r"got shape \(1, 5\); expected shape \(N, 43\)"),
        (NEUTRAL[0], r"got shape \(43,\)"),
        (np.where(np.arange(43) == 9, np.inf, NEUTRAL), "got inf"),
        (0 * NEUTRAL, "the quaternion of 'root_joint' of length 0"),
        (2 * NEUTRAL, "of length 2"),
        ([["a"]], "no array of numbers"),
    ],
)
@pytest.mark.parametrize("subject", ["human", "figure"])
def test_what_is_no_configuration_is_refused(subject: str, q: Any, text: str) -> None:
    if subject == "figure":
        text = text.replace("43", "29")
        q = np.asarray(q)[..., :29] if np.shape(q)[-1] == 43 else q
    with pytest.raises(InputError, match=text) as caught:
        Validator(HUMAN if subject == "human" else None, checks=LIMITS).check(q=q)
    assert re.match(r"q\b(?!_)", str(caught.value))


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"checks": ("walking",)}, r"'walking' is not a check of robots \(walking is for the stick figure\)"),
        ({"checks": ()}, "--checks: none is given"),
        ({"lengths": "mean"}, "--lengths: 'mean'; expected one of model, median, each"),
        ({"bodies": "mesh"}, "--bodies: 'mesh'; expected one of auto, urdf, visual, capsules"),
        ({"rigid_tolerance": -1.0}, "the rigid tolerance is -1.0"),
        ({"angle_tolerance": np.nan}, "the angle tolerance is nan"),
        ({"contact_margin": np.inf}, "the contact margin is inf m"),
        ({"up": (0.0, 0.0, 0.0)}, "up is "),
        ({"up": (0.0, 1.0)}, "up is "),
    ],
)
def test_impossible_options_are_refused(options: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        Validator(HUMAN, **options)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"joint_map": "human"}, "--joint-map human: the stick figure has its own"),
        ({"bodies": "capsules"}, "--bodies capsules"),
        ({"lengths": "each"}, "--lengths each"),
        ({"srdf": "a.srdf"}, "--srdf: the built-in stick figure needs none"),
        ({"package_dirs": ("a",)}, "--package-dir"),
        ({"checks": ("balance",)}, "'balance' is not a check"),
    ],
)
def test_options_of_robots_are_refused_for_the_figure(options: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        Validator(**options)


@pytest.mark.parametrize("name", ["humna", "", "nowhere.urdf", "/", "a\nb"])
def test_what_is_neither_file_nor_robot_is_refused(name: str) -> None:
    with pytest.raises(FigureError, match="no such file or robot"):
        Validator(name)


def test_a_map_that_does_not_fit_is_refused() -> None:
    with pytest.raises(InputError, match="the model has no frame 'torso_link'"):
        Validator(HUMAN, joint_map="g1").check(STANDING)


def test_either_postures_or_configurations() -> None:
    for options in ({}, {"postures": STANDING, "q": NEUTRAL}):
        with pytest.raises(InputError, match="give either postures or q"):
            Validator(HUMAN).check(**options)


@pytest.mark.parametrize("sequence", [[0, 1], np.zeros(1), "a"])
def test_a_sequence_is_a_whole_number_a_posture(sequence: Any) -> None:
    with pytest.raises(InputError, match="sequence: "):
        Validator(HUMAN).check(STANDING, sequence=sequence)


def test_another_unit_is_told_by_the_lengths() -> None:
    with pytest.raises(InputError, match="give metres"):
        Validator(HUMAN).check(1000 * STANDING)


def test_checks_of_what_was_seen_have_nothing_to_say_about_configurations() -> None:
    with pytest.raises(InputError, match="nothing would be judged"):
        Validator(HUMAN, checks=("reach", "rigid-parts")).check(q=NEUTRAL)
    with pytest.raises(InputError, match="nothing would be judged"):
        Validator(checks=("rigid-parts",)).check(q=pin.neutral(FIGURE.model)[None])
