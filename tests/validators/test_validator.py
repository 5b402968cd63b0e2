"""The validator of whole postures: three verdicts, and what is behind each."""

import doctest
from importlib import import_module
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import posekit
from posekit.body import load_figure
from posekit.errors import FigureError, InputError
from posekit.skeleton import JOINT, JOINTS, SEGMENTS, segment_name
from posekit.synthesis import random_postures
from posekit.validators import (
    ALL_CHECKS,
    PHYSICAL_CHECKS,
    Report,
    Validator,
    check_names,
    load_ranges,
    make_checks,
)

FIGURE = load_figure()
STANDING = FIGURE.neutral_points[None, :14].copy()
HEAD = FIGURE.neutral_points[None, 14:].copy()


def posed(**angles: float) -> np.ndarray:
    """Place the 19 points with some angles in degrees, the others at neutral: (1, 19, 3)."""
    q = pin.neutral(FIGURE.model)[None]
    for name, angle in angles.items():
        q[0, FIGURE.configuration_names.index(name)] = np.radians(angle)
    return FIGURE.forward_kinematics(q)


def rejected_at(report: Report, k: int = 0) -> set[str]:
    """Return the places at which one posture is rejected."""
    return {
        f"{judgement.check}/{where}"
        for judgement in report.judgements
        for where, bad in zip(judgement.where, judgement.violated[k], strict=True)
        if bad
    }


def finding(report: Report, place: str, k: int = 0) -> tuple[float, float, float, float, str]:
    """Return value, bounds, margin and unit at a place of one posture."""
    check, where = place.split("/")
    judgement = next(one for one in report.judgements if one.check == check)
    column = judgement.where.index(where)
    numbers = (judgement.value, judgement.lower, judgement.upper, judgement.margin)
    value, lower, upper, margin = (float(array[k, column]) for array in numbers)
    return value, lower, upper, margin, judgement.unit[column]


def test_the_documented_example_runs() -> None:
    module = import_module("posekit.validators.validator")
    result = doctest.testmod(module, raise_on_error=False)
    assert result.attempted >= 3
    assert result.failed == 0


def test_it_is_what_posekit_offers() -> None:
    assert posekit.Validator is Validator


def test_every_random_legal_posture_is_valid_in_any_frame() -> None:
    rng = np.random.default_rng(1)
    q = random_postures(FIGURE, 300, rng)
    turn = rng.normal(size=(300, 4))
    q[:, :3], q[:, 3:7] = rng.normal(size=(300, 3)), turn / np.linalg.norm(turn, axis=1, keepdims=True)
    points = FIGURE.forward_kinematics(q)
    for head in (None, points[:, 14:]):
        report = Validator().check(points[:, :14], head)
        assert report.verdicts == ["valid"] * 300
        assert report.fk_distance.max() < 1e-9
        assert report.q.shape == (300, FIGURE.model.nq)
        again = FIGURE.forward_kinematics(report.q)[:, :14]
        np.testing.assert_allclose(again, points[:, :14], rtol=0, atol=1e-9)


def test_a_batch_is_its_postures_one_at_a_time() -> None:
    rng = np.random.default_rng(2)
    points = (
        FIGURE.forward_kinematics(random_postures(FIGURE, 40, rng)) + rng.normal(size=(40, 19, 3)) * 0.004
    )
    validator = Validator(strict=True)
    together = validator.check(points[:, :14], points[:, 14:])
    assert set(together.verdicts) == {"valid", "invalid"}
    for k in range(40):
        alone = validator.check(points[k : k + 1, :14], points[k : k + 1, 14:])
        assert alone.verdicts == [together.verdicts[k]]
        assert rejected_at(alone) == rejected_at(together, k)


@pytest.mark.parametrize("shoulder", [20.0, 60.0, 90.0])
def test_an_overstretched_elbow_is_invalid_and_says_where(shoulder: float) -> None:
    """By -20 degrees, or as the half turn of the upper arm that would explain it, whichever is nearer to legal."""
    report = Validator().check(posed(right_shoulder_flexion=shoulder, right_elbow_flexion=-20.0)[:, :14])
    assert report.verdicts == ["invalid"]
    places = rejected_at(report)
    assert places <= {f"joint_range/right_{angle}" for angle in ("elbow.flexion", "shoulder.flexion")}
    assert len(places) == 1
    value, lower, upper, margin, unit = finding(report, min(places))
    assert not lower <= value <= upper
    assert margin == pytest.approx(min(value - lower, upper - value))
    assert margin < -1
    assert unit == "deg"


@pytest.mark.parametrize("ranges", ["urdf", "table1"])
@pytest.mark.parametrize("side", ["right", "left"])
def test_an_overstretched_knee_is_invalid_and_says_where(side: str, ranges: str) -> None:
    points = posed(**{f"{side}_knee_flexion": -20.0, f"{side}_hip_flexion": 20.0})
    report = Validator(ranges=ranges).check(points[:, :14])
    assert report.verdicts == ["invalid"]
    assert any(place.startswith(f"joint_range/{side}_") for place in rejected_at(report))


def test_table1_rejects_an_elbow_bent_backward_at_the_elbow() -> None:
    report = Validator(ranges="table1").check(posed(left_elbow_flexion=-20.0)[:, :14])
    assert rejected_at(report) == {"joint_range/left_elbow.flexion"}
    assert finding(report, "joint_range/left_elbow.flexion")[0] == pytest.approx(-20.0, abs=1e-6)


@pytest.mark.parametrize(
    ("dof", "angle"), [("pelvis.flexion", 100.0), ("pelvis.rotation", -45.0), ("left_hip.flexion", -80.0)]
)
def test_a_range_that_is_broken_is_named_with_its_value(dof: str, angle: float) -> None:
    report = Validator(ranges="urdf").check(posed(**{dof.replace(".", "_"): angle})[:, :14])
    assert report.verdicts == ["invalid"]
    assert f"joint_range/{dof}" in rejected_at(report)
    assert finding(report, f"joint_range/{dof}")[0] == pytest.approx(angle, abs=1e-6)


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_elbow_of_a_hanging_arm_does_not_bend_backward(side: str) -> None:
    assert Validator().check(posed(**{f"{side}_elbow_flexion": -20.0})[:, :14]).verdicts == ["invalid"]


@pytest.mark.parametrize("stature", [1.2, 1.75, 2.0])
def test_a_person_of_any_stature_may_stand(stature: float) -> None:
    person = FIGURE.from_stature(stature)
    assert Validator(person).check(person.neutral_points[None, :14]).verdicts == ["valid"]


@pytest.mark.parametrize(("beyond", "verdict"), [(-0.01, "valid"), (0.0, "valid"), (0.01, "invalid")])
def test_the_limit_itself_is_inside(beyond: float, verdict: str) -> None:
    """A hundredth of a degree: ten times the tolerance for rounding."""
    index = FIGURE.configuration_names.index("pelvis_bending")
    limit = float(np.degrees(FIGURE.model.upperPositionLimit[index]))
    report = Validator(checks=("joint-range",), ranges="urdf", strict=True).check(
        posed(pelvis_bending=limit + beyond)[:, :14]
    )
    assert report.verdicts == [verdict]
    value, _, upper, margin, unit = finding(report, "joint_range/pelvis.bending")
    assert value == pytest.approx(limit + beyond, abs=1e-6)
    assert upper == pytest.approx(limit)
    assert unit == "deg"
    assert margin == pytest.approx(-beyond, abs=1e-6)


def test_an_arm_through_the_torso_collides() -> None:
    points = posed(right_shoulder_abduction=-40.0)
    report = Validator(checks=("collision",)).check(points[:, :14])
    assert report.verdicts == ["invalid"]
    assert any("torso" in place or "hips" in place for place in rejected_at(report))
    place = next(iter(rejected_at(report)))
    value, lower, upper, margin, unit = finding(report, place)
    assert (lower, upper, unit) == (0.0, np.inf, "m")
    assert margin == value < 0
    # As deep as it is, it may go with that contact margin.
    allowed = Validator(checks=("collision",), contact_margin=10 * value)
    assert allowed.check(points[:, :14]).verdicts == ["valid"]


@pytest.mark.parametrize(
    ("off", "verdict"), [(0.029, "valid"), (0.031, "invalid"), (-0.029, "valid"), (-0.031, "invalid")]
)
@pytest.mark.parametrize("segment", [segment for segment in SEGMENTS if segment[1] >= JOINT["right_elbow"]])
def test_a_limb_of_another_length_is_not_this_body(
    segment: tuple[int, int], off: float, verdict: str
) -> None:
    joints = STANDING.copy()
    start, end = segment
    along = joints[0, end] - joints[0, start]
    child = end
    while child:  # all that hangs on it goes along
        joints[0, child] += off * along / np.linalg.norm(along)
        child = next((b for a, b in SEGMENTS if a == child and b > child), 0)
    report = Validator(checks=("rigid-parts",), strict=True).check(joints)
    assert report.verdicts == [verdict]
    if verdict == "invalid":
        assert rejected_at(report) == {f"rigid_parts/{segment_name(segment)}"}


def test_the_rigid_tolerance_is_the_callers() -> None:
    joints = STANDING.copy()
    joints[0, JOINT["right_shoulder"]] += [0.0, -0.01, 0.0]
    assert Validator(checks=("rigid-parts",)).check(joints).verdicts == ["valid"]
    report = Validator(checks=("rigid-parts",), rigid_tolerance=0.005, strict=True).check(joints)
    assert report.verdicts == ["invalid"]
    assert "rigid_parts/right_shoulder-left_shoulder" in rejected_at(report)


# --- what is not known ----------------------------------------------------------------------------------


@pytest.mark.parametrize("joint", JOINTS)
def test_a_posture_with_an_unknown_joint_is_undecided_never_valid(joint: str) -> None:
    joints = STANDING.copy()
    joints[0, JOINT[joint]] = np.nan
    report = Validator(checks=ALL_CHECKS, rules=(1, 2, 3, 4, 5)).check(joints, HEAD)
    assert report.verdicts == ["undecided"]
    assert (report.valid | report.invalid).tolist() == [False]


def test_what_is_known_can_still_be_wrong() -> None:
    joints = posed(pelvis_flexion=100.0)[:, :14]
    joints[0, JOINT["right_wrist"]] = np.nan
    report = Validator().check(joints)
    assert report.verdicts == ["invalid"]
    assert "joint_range/pelvis.flexion" in rejected_at(report)


def test_one_unknown_coordinate_is_enough() -> None:
    joints = STANDING.copy()
    joints[0, JOINT["left_ankle"], 1] = np.nan
    assert Validator().check(joints).verdicts == ["undecided"]


def test_nothing_known_is_undecided() -> None:
    report = Validator(checks=ALL_CHECKS).check(np.full((3, 14, 3), np.nan))
    assert report.verdicts == ["undecided"] * 3
    assert np.isnan(report.fk_distance).all()
    assert np.isnan(report.q[:, 3:7]).all()


def test_all_joints_in_one_point_are_no_body() -> None:
    assert Validator().check(np.zeros((1, 14, 3))).verdicts == ["invalid"]


def test_the_three_verdicts_exclude_each_other() -> None:
    joints = np.concatenate([STANDING, posed(pelvis_flexion=100.0)[:, :14], STANDING])
    joints[2, JOINT["neck"]] = np.nan
    report = Validator().check(joints)
    assert report.verdicts == ["valid", "invalid", "undecided"]
    assert (report.valid.astype(int) + report.invalid + report.undecided).tolist() == [1, 1, 1]
    assert report.complete.tolist() == [True, True, False]


def test_no_postures_no_verdicts() -> None:
    report = Validator(checks=ALL_CHECKS).check(np.empty((0, 14, 3)))
    assert report.verdicts == []
    assert report.q.shape == (0, FIGURE.model.nq)


# --- the head -------------------------------------------------------------------------------------------


def test_the_neck_is_judged_where_the_head_is_given() -> None:
    points = posed(neck_flexion=80.0)
    without = Validator().check(points[:, :14])
    assert without.verdicts == ["valid"]
    assert np.isnan(finding(without, "joint_range/neck.flexion")[0])
    with_head = Validator().check(points[:, :14], points[:, 14:])
    assert with_head.verdicts == ["invalid"]
    assert rejected_at(with_head) == {"joint_range/neck.flexion"}
    assert finding(with_head, "joint_range/neck.flexion")[0] == pytest.approx(80.0, abs=1e-6)


def test_an_arm_hits_only_a_head_that_is_seen() -> None:
    rng = np.random.default_rng(5)
    q = np.tile(pin.neutral(FIGURE.model), (400, 1))
    limits = FIGURE.limits
    q[:, FIGURE.angle_index] = rng.uniform(limits.lower, limits.upper, (400, len(limits.lower)))
    points = FIGURE.forward_kinematics(q)
    validator = Validator(checks=("collision",))
    seen = validator.check(points[:, :14], points[:, 14:])
    unseen = validator.check(points[:, :14])
    head_alone = [
        k for k in range(400) if rejected_at(seen, k) and all("head" in p for p in rejected_at(seen, k))
    ]
    assert head_alone
    assert {unseen.verdicts[k] for k in head_alone} == {"valid"}


# --- figures, ranges, rules -----------------------------------------------------------------------------


def test_another_figure_by_object_and_by_file(tmp_path: Any) -> None:
    short = FIGURE.scaled({f"{side}_hip-{side}_knee": 0.30 for side in ("right", "left")})
    standing = short.neutral_points[None, :14]
    short.write(tmp_path / "short.urdf")
    for figure in (short, str(tmp_path / "short.urdf")):
        validator = Validator(figure)
        assert validator.check(standing).verdicts == ["valid"]
        assert validator.check(STANDING).verdicts == ["invalid"]
    assert Validator(strict=True).check(standing).verdicts == ["invalid"]
    assert Validator().check(standing).verdicts == ["valid"]
    assert Validator("stick_figure").figure.hash == FIGURE.hash


def test_table1_judges_the_papers_angles() -> None:
    names = {judgement.where for judgement in Validator(ranges="table1").check(STANDING).judgements}
    assert any("right_shoulder.abduction" in where for where in names)
    assert Validator(ranges="table1").check(STANDING).verdicts == ["valid"]
    # 150 degrees: the URDF's hip allows 120, and so does Table 1.
    high_knee = posed(right_hip_flexion=150.0, right_knee_flexion=90.0)[:, :14]
    assert Validator(ranges="table1", checks=("joint-range",)).check(high_knee).verdicts == ["invalid"]


def test_walking_rules_are_switched_on_one_by_one() -> None:
    both_forward = posed(right_shoulder_flexion=40.0, left_shoulder_flexion=40.0)[:, :14]
    assert not Validator(checks=ALL_CHECKS, rules=(2,)).check(both_forward, HEAD).invalid.any()
    report = Validator(checks=ALL_CHECKS, rules=(1, 2)).check(both_forward, HEAD)
    assert rejected_at(report) == {"walking/rule1.arms"}
    assert Validator().check(both_forward).verdicts == ["valid"]


def test_checks_are_applied_in_one_order_whatever_is_asked() -> None:
    validator = Validator(checks=("collision", "rigid-parts"))
    assert validator.checks == ("rigid-parts", "collision")
    assert [one.check for one in validator.check(STANDING).judgements] == ["rigid_parts", "collision"]
    assert check_names(reversed(ALL_CHECKS)) == ALL_CHECKS
    assert PHYSICAL_CHECKS == ALL_CHECKS[:3]


def test_worst_is_the_smallest_margin() -> None:
    for judgement in Validator(checks=ALL_CHECKS).check(STANDING).judgements:
        decided = judgement.margin[0][~np.isnan(judgement.margin[0])]
        assert judgement.worst.shape == (1,)
        assert np.isnan(judgement.worst[0]) if not len(decided) else judgement.worst[0] == decided.min()


def test_a_check_that_decided_nothing_leaves_the_posture_undecided() -> None:
    """A standing person swings nothing: that is no evidence for walking, nor against it."""
    assert Validator().check(STANDING, HEAD).verdicts == ["valid"]
    assert Validator(checks=ALL_CHECKS, rules=(1, 2)).check(STANDING, HEAD).verdicts == ["undecided"]


# --- bad input ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("postures", "text"),
    [
        (np.zeros((14, 3)), r"postures: the shape is \(14, 3\); expected \(N, 14, 3\)"),
        (np.zeros((2, 13, 3)), r"postures: the shape is \(2, 13, 3\)"),
        (np.zeros((2, 14, 2)), r"postures: the shape is \(2, 14, 2\)"),
        ([["neck"]], r"postures: not an array of numbers"),
        ([[0.0, 1.0], [2.0]], r"postures: not an array of numbers"),
        (np.full((1, 14, 3), np.inf), r"postures: a coordinate is inf m; expected finite ones"),
        (np.full((1, 14, 3), -1e200), r"postures: a coordinate is -1e\+200 m"),
    ],
)
def test_malformed_postures_are_refused(postures: Any, text: str) -> None:
    with pytest.raises(InputError, match=text):
        Validator().check(postures)


@pytest.mark.parametrize(
    ("head", "text"),
    [
        (np.zeros((1, 4, 3)), r"head: the shape is \(1, 4, 3\); expected \(1, 5, 3\)"),
        (np.zeros((3, 5, 3)), r"head: the shape is \(3, 5, 3\); expected \(1, 5, 3\)"),
        (np.full((1, 5, 3), np.inf), r"head: a coordinate is inf m"),
    ],
)
def test_malformed_heads_are_refused(head: np.ndarray, text: str) -> None:
    with pytest.raises(InputError, match=text):
        Validator().check(STANDING, head)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"checks": ("rigid",)}, r"--checks: 'rigid' is not a check; expected some of rigid-parts"),
        ({"checks": ()}, r"--checks: none is given, so nothing would be judged"),
        ({"ranges": "tabel1"}, r"--ranges tabel1: no such table or file"),
        ({"rules": (0,)}, r"--rules: 0 is not a rule"),
        ({"rules": (6,), "checks": ALL_CHECKS}, r"--rules: 6 is not a rule"),
        ({"rigid_tolerance": np.nan}, r"the rigid tolerance is nan"),
        ({"rigid_tolerance": -0.01}, r"the rigid tolerance is -0.01"),
        ({"contact_margin": np.nan}, r"the contact margin is nan m"),
        ({"contact_margin": np.inf}, r"the contact margin is inf m"),
    ],
)
def test_impossible_options_are_refused(options: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        Validator(**options)


def test_an_angle_tolerance_that_is_no_number_is_refused() -> None:
    with pytest.raises(InputError, match="the angle tolerance is nan"):
        make_checks(
            FIGURE, PHYSICAL_CHECKS, ranges=load_ranges("urdf"), rigid_tolerance=0.0, angle_tolerance=np.nan
        )


def test_a_figure_that_cannot_be_read_is_refused(tmp_path: Any) -> None:
    with pytest.raises(FigureError, match=r"nowhere.urdf"):
        Validator(str(tmp_path / "nowhere.urdf"))
    (tmp_path / "bad.urdf").write_text("<robot", encoding="utf-8")
    with pytest.raises(FigureError, match=r"bad.urdf"):
        Validator(str(tmp_path / "bad.urdf"))
