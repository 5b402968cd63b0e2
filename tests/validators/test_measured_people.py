"""Defaults for people who were measured: lengths, noise and tolerances that the data tell."""

from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.body.measured import hips_outward, measured_person
from posekit.geometry import Array
from posekit.settings import ValidateSettings
from posekit.skeleton import JOINT, JOINTS, urdf_joint_name
from posekit.validators import Validator
from posekit.validators.measured import Allowance
from posekit.validators.ranges import load_ranges

FIGURE = load_figure()
STANDING = FIGURE.neutral_points[:14]


def standing(count: int, noise: float = 0.0, seed: int = 0) -> np.ndarray:
    return STANDING + np.random.default_rng(seed).normal(0.0, noise, (count, 14, 3))


@pytest.mark.parametrize("noise", [0.001, 0.005, 0.01])
def test_standing_is_valid_whatever_noise_it_was_measured_with(noise: float) -> None:
    joints = standing(200, noise)
    assert Validator().check(joints).valid.mean() >= 0.99
    if noise == 0.005:
        assert Validator(strict=True).check(joints).valid.mean() < 0.9


def test_an_elbow_that_is_ten_degrees_beyond_its_limit_is_found_under_noise() -> None:
    """Of 5 mm, for a third of a clip: the limit is -7.9 degrees."""
    joints = standing(300, 0.005)
    bent = STANDING.copy()
    arm = bent[JOINT["right_wrist"]] - bent[JOINT["right_elbow"]]
    turn = np.radians(-17.9)
    forward = np.array([1.0, 0.0, 0.0])
    down = arm / np.linalg.norm(arm)
    bent[JOINT["right_wrist"]] = bent[JOINT["right_elbow"]] + np.linalg.norm(arm) * (
        np.cos(turn) * down + np.sin(turn) * forward
    )
    joints[100:200] += bent - STANDING
    report = Validator().check(joints)
    assert report.invalid[100:200].mean() > 0.8
    assert report.invalid[:100].mean() <= 0.01


def test_people_of_other_sizes_are_valid_by_default_and_strictly_are_not() -> None:
    small = 0.8 * standing(20)
    assert Validator().check(small).valid.all()
    assert Validator(strict=True).check(small).invalid.all()


def test_kilometres_are_no_person() -> None:
    assert Validator().check(1000 * standing(20)).invalid.all()


def test_a_clip_of_other_lengths_for_a_while_is_judged_in_all_its_frames() -> None:
    joints = standing(300, 0.002)
    joints[100:200, JOINT["left_wrist"]] += [0.0, 0.0, 0.3]
    report = Validator().check(joints)
    assert report.invalid.tolist() == [False] * 100 + [True] * 100 + [False] * 100


def test_what_is_not_a_number_never_passes() -> None:
    joints = standing(50, 0.005)
    joints[10, JOINT["neck"]] = np.nan
    joints[20] = np.nan
    report = Validator().check(joints)
    assert not report.valid[[10, 20]].any()
    assert report.valid.sum() >= 46
    assert not Validator().check(np.full((20, 14, 3), np.nan)).valid.any()


@pytest.mark.parametrize(
    "given", [{"rigid_tolerance": 0.01}, {"angle_tolerance": 0.5}, {"noise": 0.0}, {"noise": 0.02}]
)
def test_what_is_given_stays_as_it_is(given: dict[str, Any]) -> None:
    validator = Validator(**given)
    _, suite = validator.figure_and_suite(standing(100, 0.01))
    by_name = {check.places[0].segment or check.name: check for check in suite}
    if "rigid_tolerance" in given:
        assert by_name["neck-pelvis"].tolerance == 0.01  # type: ignore[attr-defined]
    if "angle_tolerance" in given:
        assert by_name["joint_range"].tolerance == 0.5  # type: ignore[attr-defined]
    if "noise" in given:
        off = 3 * np.sqrt(2) * given["noise"]
        bone = by_name["left_knee-left_ankle"].tolerance  # type: ignore[attr-defined]
        assert bone == pytest.approx(np.hypot(0.03, off))


def test_more_noise_never_allows_less() -> None:
    allowed = [Allowance(settings=ValidateSettings(noise=noise)) for noise in (0.0, 0.001, 0.01)]
    for one, more in pairwise(allowed):
        assert more.contact_margin < one.contact_margin
        assert more.angle("", 0.3) > one.angle("", 0.3)
        assert more.rigid(FIGURE).widest > one.rigid(FIGURE).widest


def test_noise_is_allowed_for_by_three_deviations_of_a_direction() -> None:
    allowed = Allowance(settings=ValidateSettings(noise=0.005))
    assert allowed.angle("", 0.25) == pytest.approx(np.hypot(2.0, np.degrees(3 * np.sqrt(2) * 0.005 / 0.25)))
    assert Allowance(settings=ValidateSettings(strict=True)).angle("", 0.25) == 0.001


OTHER_SIDE = {"right": "left", "left": "right"}
SWAPPED = [JOINT["_".join(OTHER_SIDE.get(part, part) for part in name.split("_"))] for name in JOINTS]


def test_left_and_right_that_are_swapped_in_most_frames_leave_the_others_valid() -> None:
    q = np.tile(pin.neutral(FIGURE.model), (150, 1))
    for side in OTHER_SIDE:
        for angle, degrees in ((f"{side}_hip.flexion", 30.0), (f"{side}_knee.flexion", 50.0)):
            q[:, FIGURE.configuration_names.index(urdf_joint_name(angle))] = np.radians(degrees)
    joints = FIGURE.forward_kinematics(q)[:, :14] + np.random.default_rng(0).normal(0.0, 0.002, (150, 14, 3))
    joints[30:130] = joints[30:130][:, SWAPPED]
    report = Validator().check(joints)
    assert report.invalid[30:130].all()
    assert not report.invalid[:30].any() and not report.invalid[130:].any()


def test_lengths_that_a_robot_cannot_have_are_findings_of_its_frames() -> None:
    joints = standing(5)
    joints[:, JOINT["left_wrist"]] = joints[:, JOINT["left_elbow"]]
    assert Validator("human").check(joints).verdicts == ["invalid"] * 5
    assert Validator("human").check(np.zeros((2, 14, 3))).verdicts == ["invalid"] * 2


def test_a_robot_is_fitted_with_what_noise_allows_and_strictly_without() -> None:
    joints = standing(8, 0.004)
    usual, strict = (Validator("human", noise=0.004, strict=value).check(joints) for value in (False, True))
    assert usual.valid.sum() > strict.valid.sum()
    assert usual.valid.sum() >= 5
    assert Validator("human").check(standing(12)).valid.all()


def _turned(joints: Array, degrees: float, moved: tuple[str, ...], axis: int = 1) -> Array:
    """Turn some joints about the pelvis, in the sagittal plane of the figure."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.eye(3)
    first, second = (k for k in range(3) if k != axis)
    turn[[first, first, second, second], [first, second, first, second]] = c, s, -s, c
    turned = joints.copy()
    at = [JOINT[name] for name in moved]
    turned[:, at] = (joints[:, at] - joints[:, [JOINT["pelvis"]]]) @ turn.T + joints[:, [JOINT["pelvis"]]]
    return turned


def test_a_skeleton_whose_pelvis_is_far_before_or_behind_its_hips_has_its_zero_there() -> None:
    standing = np.tile(load_figure().neutral_points[:14], (40, 1, 1))
    for degrees in (-30.0, 30.0):
        hips = _turned(standing, degrees, ("right_hip", "left_hip"))
        person = measured_person(hips)
        assert abs(abs(person.hips_forward) - 30.0) < 1e-6
        anatomy = load_ranges("anatomical").anatomy
        assert anatomy is not None
        own = anatomy.with_hips(person.hips_forward)
        for side in ("lower", "upper"):
            for angle in ("pelvis.flexion", "hip.flexion"):
                sign = 1.0 if side == "upper" else -1.0
                assert sign * own.motions[angle].end(side)[0] >= sign * anatomy.motions[angle].end(side)[0]


def test_hips_that_are_wide_apart_let_thighs_lean_inward() -> None:
    lengths = dict(load_figure().lengths)
    assert hips_outward(lengths) == 0.0
    wide = {**lengths, "right_hip-left_hip": 2 * lengths["right_hip-left_hip"]}
    assert 5.0 < hips_outward(wide) < 25.0
    anatomy = load_ranges("anatomical").anatomy
    assert anatomy is not None
    usual, own = (
        one.motions["hip.abduction"].end("lower")[0] for one in (anatomy, anatomy.with_hips(13.5, 10.0))
    )
    assert own == usual - 10.0


def test_each_robot_judges_with_the_noise_of_its_own_person() -> None:
    validator = Validator("human", noise=None)
    people = [measured_person(standing(40, noise)) for noise in (0.004, 0.008, 0.004)]
    kept = [validator._robot_for(person) for person in people]
    for person, found in zip(people, kept, strict=True):
        allowed = Allowance(settings=validator.settings, person=person)
        own = allowed.of_robot(
            validator._robot.settings, made_up=validator._robot.models.bodies == "capsules"
        )
        assert found.settings == own
        assert validator._robot_for(people[2]) is kept[2]
    assert kept[0].settings != kept[1].settings


def test_reports_say_noise_to_a_micrometre() -> None:
    validator = Validator("human")
    person = measured_person(standing(40, 0.004))
    said = validator.told_of(person)["noise"]
    assert said == float(f"{person.noise:.6f}") != person.noise
