"""Checks: laws over all of them, verdicts against independent oracles, and a check of one's own through every door."""

from __future__ import annotations

import math
import os
import runpy
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

import posekit
from posekit.errors import InputError
from posekit.geometry import segment_distance
from posekit.motion import Motion
from posekit.settings import EXACT, ValidateSettings
from posekit.skeleton import DOFS, JOINT, JOINTS
from posekit.synthesis.walker import Walker
from posekit.validators import Body, Judgement, judge_postures, validate_motion
from posekit.validators.judge import KNOWN, POSTURE_CHECKS, PostureJudge, early_checks

EXAMPLE = Path(__file__).parent.parent / "examples" / "own_check.py"
FIGURE = posekit.load_figure()


def walk(seconds: float = 4.0, rate: float = 30.0) -> np.ndarray:
    """Return joints (T, 14, 3) of a walk on the plane z = 0, metres, z up."""
    time = np.arange(round(seconds * rate)) / rate
    walker = Walker(velocity=1.0)
    points = FIGURE.points(walker.configurations(walker.phase(time))) + walker.travel(time)[:, None]
    points = points[..., [0, 2, 1]] * [1.0, -1.0, 1.0]
    lowest = points[:, [12, 13], 2].min(axis=1)
    points[..., 2] += 0.066 - lowest[:, None]  # the lower foot stands
    return points


def postures(count: int, seed: int = 0) -> np.ndarray:
    """Return joints (N, 14, 3) of random configurations, some beyond the limits."""
    rng = np.random.default_rng(seed)
    q = np.tile(FIGURE.neutral, (count, 1))
    low, high = FIGURE.limits.lower, FIGURE.limits.upper
    q[:, FIGURE.angle_index] = (low + high) / 2 + rng.uniform(-0.6, 0.6, (count, len(DOFS))) * (high - low)
    return FIGURE.points(q)


def bent(part: str, degrees: float, frames: int = 1) -> np.ndarray:
    q = np.tile(FIGURE.neutral, (frames, 1))
    q[:, FIGURE.angle_index[DOFS.index(part)]] = math.radians(degrees)
    return FIGURE.points(q)


# Laws over all checks of postures


@pytest.mark.parametrize("name", sorted(POSTURE_CHECKS))
@pytest.mark.parametrize("ranges", ["anatomical", "urdf", "table1", "table1-printed"])
def test_unknown_points_are_undecided_and_never_rejected(name: str, ranges: str) -> None:
    nothing = np.full((3, 14, 3), np.nan)
    settings = ValidateSettings(ranges=ranges, rules=(1, 2, 3, 4, 5))
    found = judge_postures(
        nothing, [POSTURE_CHECKS[name]], FIGURE, settings, tolerance=EXACT, up=np.array([0, 0, 1.0])
    )
    assert not any(one.violated.any() for one in found.values())
    report = posekit.Validator(settings=settings, checks=[name]).check(nothing)
    assert not report.ok.any() and report.undecided.all() and np.isnan(report.worst).all()


@pytest.mark.parametrize("name", ["rigid-parts", "joint-range", "collision"])
def test_verdicts_do_not_depend_on_order_batches_or_the_frame_of_the_points(name: str) -> None:
    joints = postures(60)
    R = pin.Quaternion(np.array([0.1, 0.5, -0.3, 0.8]) / np.linalg.norm([0.1, 0.5, -0.3, 0.8])).matrix()
    order = np.random.default_rng(1).permutation(60)
    judge = PostureJudge(FIGURE, ValidateSettings(), EXACT)
    whole = judge(POSTURE_CHECKS[name], joints).margin
    np.testing.assert_allclose(judge(POSTURE_CHECKS[name], joints[order]).margin, whole[order], atol=1e-9)
    one = np.concatenate([judge(POSTURE_CHECKS[name], joints[k : k + 1]).margin for k in range(60)])
    np.testing.assert_allclose(one, whole, atol=1e-9)
    moved = judge(POSTURE_CHECKS[name], joints @ R.T + [3.0, -2.0, 7.0]).margin
    np.testing.assert_allclose(moved, whole, atol=1e-6)


@pytest.mark.parametrize(
    ("field", "values"),
    [
        ("contact_margin", (0.02, 0.0, -0.02, -0.05)),
        ("angle_tolerance", (0.0, 1.0, 5.0, 20.0)),
        ("rigid_tolerance", (0.0, 0.01, 0.05)),
    ],
)
def test_a_looser_tolerance_never_rejects_more(field: str, values: tuple[float, ...]) -> None:
    joints = postures(200) + np.random.default_rng(2).normal(0, 0.02, (200, 14, 3))
    rejected = [
        posekit.Validator(settings=posekit.ValidateSettings(**{field: value})).check(joints).invalid
        for value in values
    ]
    for tighter, looser in pairwise(rejected):
        assert not (looser & ~tighter).any()
    assert rejected[0].sum() > rejected[-1].sum()


def test_early_parts_reject_only_what_the_whole_check_rejects() -> None:
    joints = np.concatenate([postures(150), np.full((150, 5, 3), np.nan)], axis=1)
    judge = PostureJudge(FIGURE, ValidateSettings(), EXACT)
    settings = ValidateSettings(checks=["rigid-parts", "joint-range", "collision"])
    whole = {name: judge(POSTURE_CHECKS[name], joints).violated.any(axis=1) for name in settings.checks or ()}
    parts = dict.fromkeys(whole, np.zeros(150, dtype=bool))
    for check in early_checks(settings):
        points: Any = check
        known = [
            (*JOINTS, "nose", "right_eye", "left_eye", "right_ear", "left_ear").index(p)
            for p in points.points
        ]
        seen = np.full_like(joints, np.nan)
        seen[:, known] = joints[:, known]
        parts[check.name] = parts[check.name] | judge(check, seen).violated.any(axis=1)
    for name, rejected in whole.items():
        np.testing.assert_array_equal(parts[name], rejected, err_msg=name)
    assert whole["joint-range"].any() and whole["collision"].any()


# Oracles


def test_distances_of_capsules_are_those_of_coal() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        ends = rng.normal(size=(2, 2, 3))
        radius = float(rng.uniform(0.01, 0.1))
        shapes = [coal.Capsule(radius, float(np.linalg.norm(b - a))) for a, b in ends]
        places = []
        for a, b in ends:
            axis = (b - a) / np.linalg.norm(b - a)
            turn = pin.Quaternion.FromTwoVectors(np.array([0, 0, 1.0]), axis).matrix()
            places.append(coal.Transform3s(turn, (a + b) / 2))
        result = coal.DistanceResult()
        coal.distance(shapes[0], places[0], shapes[1], places[1], coal.DistanceRequest(), result)
        middle, half = ends.mean(axis=1), (ends[:, 1] - ends[:, 0]) / 2
        mine = segment_distance((middle[1] - middle[0])[None], half[:1], half[1:])[0] - 2 * radius
        if result.min_distance > 0:
            assert mine == pytest.approx(result.min_distance, abs=1e-6)
        else:
            assert mine < 1e-6


def test_collision_of_configurations_is_what_pinocchio_finds() -> None:
    rng = np.random.default_rng(3)
    q = np.tile(FIGURE.neutral, (300, 1))
    q[:, FIGURE.angle_index] = rng.uniform(FIGURE.limits.lower, FIGURE.limits.upper, (300, len(DOFS)))
    report = posekit.Validator(FIGURE, checks=["collision"]).check(q)
    data, geometry = FIGURE.model.createData(), FIGURE.geometry.createData()
    hits = [pin.computeCollisions(FIGURE.model, data, FIGURE.geometry, geometry, one, True) for one in q]
    np.testing.assert_array_equal(report.invalid, hits)
    assert 10 < sum(hits) < 290


@pytest.mark.parametrize(
    ("part", "legal", "beyond"),
    [
        ("right_elbow.flexion", 140.0, 165.0),
        ("left_knee.flexion", 150.0, 175.0),
        ("right_hip.abduction", 45.0, 70.0),
        ("left_shoulder.flexion", 160.0, 200.0),
        ("pelvis.bending", 30.0, 60.0),
    ],
)
def test_ranges_of_people(part: str, legal: float, beyond: float) -> None:
    judge = PostureJudge(FIGURE, ValidateSettings(), EXACT)
    assert not judge(POSTURE_CHECKS["joint-range"], bent(part, legal)).violated.any()
    found = judge(POSTURE_CHECKS["joint-range"], bent(part, beyond))
    named = [found.places[k] for k in np.flatnonzero(found.violated[0])]
    assert any(part.partition(".")[0] in place for place in named), named


def test_configurations_are_judged_by_the_limits_of_their_urdf() -> None:
    index = FIGURE.angle_index[DOFS.index("right_knee.flexion")]
    q = np.tile(FIGURE.neutral, (2, 1))
    q[0, index] = FIGURE.upper[index] - 0.01
    q[1, index] = FIGURE.upper[index] + 0.01
    report = posekit.Validator().check(q)
    assert report.ok.tolist() == [True, False]
    assert report.table()["place"].tolist() == ["right_knee_flexion"]


def test_table1_of_the_paper_bounds_its_own_angles() -> None:
    validator = posekit.Validator(
        settings=posekit.ValidateSettings(ranges="table1", strict=True, checks=["joint-range"])
    )
    assert validator.check(bent("right_shoulder.flexion", 170.0)).ok[0]
    assert validator.check(bent("right_knee.flexion", 131.0)).table()["place"].tolist() == [
        "right_knee.flexion"
    ]
    wide = bent("right_hip.flexion", 100.0)  # more than 90 degrees need a bent knee (note a)
    assert validator.check(wide).table()["place"].tolist() == ["right_hip.flexion"]


def test_the_rotation_of_a_straight_limb_of_measured_people_is_undecided() -> None:
    # A knee with 4 degrees of valgus turns the apparent rotation of an almost straight leg by a right angle.
    joints = np.tile(FIGURE.neutral_points[:14], (30, 1, 1))
    shank = joints[:, JOINT["right_ankle"]] - joints[:, JOINT["right_knee"]]
    turn = pin.rpy.rpyToMatrix(math.radians(-4.0), 0.0, 0.0)
    joints[:, JOINT["right_ankle"]] = joints[:, JOINT["right_knee"]] + shank @ turn.T
    assert posekit.validate(joints, rate=30, up="+z").ok.all()


def test_an_elbow_that_bends_backward_is_named_itself() -> None:
    flexion = np.concatenate([np.linspace(40, 25, 20), np.full(20, -25.0), np.linspace(25, 40, 20)])
    q = np.tile(FIGURE.neutral, (60, 1))
    q[:, FIGURE.angle_index[DOFS.index("left_elbow.flexion")]] = np.radians(flexion)
    report = posekit.validate(FIGURE.points(q), rate=30, up="+z", checks=["joint-range"])
    assert set(report.table()["place"]) == {"left_elbow.flexion"}
    assert np.flatnonzero(report.invalid).tolist() == list(range(20, 40))


@pytest.mark.parametrize(("rule", "flexions"), [(1, (40, 40, 0, 0)), (2, (40, -40, 40, -40))])
def test_rules_of_walking(rule: int, flexions: tuple[float, ...]) -> None:
    def posture(angles: tuple[float, ...]) -> np.ndarray:
        q = FIGURE.neutral.copy()
        parts = ("right_shoulder", "left_shoulder", "right_hip", "left_hip")
        for part, angle in zip(parts, angles, strict=True):
            q[FIGURE.angle_index[DOFS.index(f"{part}.flexion")]] = math.radians(angle)
        return FIGURE.points(q[None])

    validator = posekit.Validator(
        settings=posekit.ValidateSettings(checks=["walking"], rules=(rule,), strict=True)
    )
    assert validator.check(posture(flexions)).invalid[0]
    in_turn = (40.0, -40.0, -40.0, 40.0)
    assert not validator.check(posture(in_turn)).invalid[0]


# Robots


def test_a_robot_is_judged_by_limits_and_collision_with_real_depths() -> None:
    robot = posekit.load_robot("g1")
    q = np.tile(robot.neutral, (3, 1))
    elbow = robot.configuration_names.index("left_elbow_joint")
    q[1, elbow] = robot.upper[elbow] + 0.1
    q[2, robot.configuration_names.index("left_shoulder_roll_joint")] = -1.5
    report = posekit.Validator(robot).check(q)
    assert report.ok.tolist() == [True, False, False]
    assert report.worst[0] > 0 > report.worst[1]
    table = report.to_pandas()
    assert table[table.frame == table.frame].check.isin(["joint-range", "collision"]).all()
    depth = table[table.check == "collision"].value
    assert ((depth < 0) & (depth > -0.5)).all() and len(depth)


# A check of one's own


@pytest.fixture
def own(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.chdir(EXAMPLE.parent)
    sys.modules.pop("own_check", None)
    return runpy.run_path(str(EXAMPLE))["FeetAboveGround"]


def names(found: Any) -> set[str]:
    return set(found.checks)


def test_an_own_check_works_through_every_door(own: Any, tmp_path: Path) -> None:
    by_name = ["joint-range", "own_check:FeetAboveGround"]
    joints = walk(1.0)
    sunk = joints - np.array([0.0, 0.0, 0.3])
    above, below = (Motion(joints=one, time=np.arange(len(one)) / 30, up="+z") for one in (joints, sunk))
    for motion, expected in ((above, True), (below, False)):
        path = tmp_path / f"{expected}.npz"
        posekit.save(motion, path)
        for report in (
            posekit.validate(path, checks=by_name),
            posekit.validate(motion.joints, rate=30, up="+z", checks=by_name),
            posekit.Validator(checks=["joint-range", own()]).check(motion),
            validate_motion(motion, ValidateSettings(checks=by_name)),
        ):
            assert names(report) == {"joint-range", "feet-above-ground"}
            assert bool(report.ok.all()) is expected
            assert report.messages["feet-above-ground"] == "A foot is below the ground"
    robot = posekit.load_robot("g1")
    q = np.tile(robot.neutral, (4, 1))
    q[:, 2] = 0.8
    high = Motion(q=q, q_names=robot.configuration_names, robot="g1", time=np.arange(4) / 30, up="+z")
    assert posekit.Validator(robot, checks=by_name).check(high).ok.all()


def test_postures_have_a_ground_only_if_it_is_stated() -> None:
    @posekit.check("above", unit="m", reads=("joints", "up", "ground"))
    def above(body: Any) -> posekit.Judgement:
        """A joint is below the ground."""
        return posekit.Judgement(JOINTS, body.height - body.ground, lower=0.0)

    postures = Motion(joints=walk(1.0)[:3], frame=[0, 0, 0], up="+z")
    unknown = posekit.Validator(checks=[above]).check(postures)
    assert "above" in unknown.not_asked and not unknown.checks
    stated = posekit.Validator(checks=[above], ground=0.05).check(postures)
    assert stated.ok.tolist() == (postures.joints[..., 2].min(axis=1) >= 0.05).tolist()


def test_an_own_check_works_on_the_command_line(tmp_path: Path) -> None:
    path = tmp_path / "sunk.npz"
    sunk = walk(0.5) - np.array([0.0, 0.0, 0.3])
    posekit.save(Motion(joints=sunk, time=np.arange(len(sunk)) / 30, up="+z"), path)
    command = [
        sys.executable,
        "-m",
        "posekit",
        "validate",
        str(path),
        "--checks",
        "own_check:FeetAboveGround",
    ]
    root = str(EXAMPLE.parent.parent)
    ended = subprocess.run(
        command,
        cwd=EXAMPLE.parent,
        env={**os.environ, "PYTHONPATH": root},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 1, ended.stderr
    assert ended.stdout.startswith("keep 0 of 1 clip; 1 dropped by feet-above-ground")


def test_an_own_check_prunes_a_recovery(own: Any) -> None:
    view = posekit.builtin_view("seq1").take(slice(1, 2))
    physical = ["rigid-parts", "joint-range", "collision"]
    without, with_own = (
        posekit.recover(view, checks=checks) for checks in (physical, [*physical, own(-0.78)])
    )
    again = posekit.recover(view, checks=[*physical, own(-9.0)])
    assert 0 < len(with_own.survivors) < len(without.survivors) == len(again.survivors)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("joint-rang", "did you mean joint-range"),
        ("nowhere:Check", "cannot be imported"),
        (object(), "no name, no unit, no reads, no judge"),
    ],
)
def test_what_is_no_check_is_refused_with_a_remedy(given: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        posekit.Validator(checks=[given])


@pytest.mark.parametrize(("nearer", "invalid"), [(0.03, 0), (0.07, 15)])
def test_shoulders_come_nearer_by_as_much_as_clavicles_turn(nearer: float, invalid: int) -> None:
    joints = np.repeat(FIGURE.points(FIGURE.neutral[None]), 60, axis=0)
    joints += np.random.default_rng(0).normal(0, 0.002, joints.shape)
    right, left = JOINT["right_shoulder"], JOINT["left_shoulder"]
    across = joints[45:, left] - joints[45:, right]
    inward = nearer / 2 * across / np.linalg.norm(across, axis=1, keepdims=True)
    joints[45:, right] += inward
    joints[45:, left] -= inward
    found = posekit.Validator(checks=["rigid-parts"]).check(joints).to_pandas()
    # 2 · 0.8 · 20 cm · (1 - cos 30°) = 4.3 cm, and the tolerance of measured bones.
    assert (found.place == "right_shoulder-left_shoulder").sum() == invalid


def test_a_function_becomes_a_check_and_says_what_it_lacks() -> None:
    @posekit.check("low-feet", unit="m", reads=("joints", "up"))
    def low_feet(body: Body, *, most: float = 1.0) -> Judgement:
        """A foot is too high."""
        return Judgement(["feet"], body.height[:, 12], upper=most)

    joints = walk(0.5)
    report = posekit.Validator(checks=[low_feet]).check(joints)
    assert report.not_asked == {"low-feet": "the direction up is not known (--up)"}
    assert posekit.validate(joints, up="+z", checks=[low_feet]).ok.all()
    tight = low_feet.with_thresholds(most=-1.0)
    assert not posekit.validate(joints, up="+z", checks=[tight]).ok.any()


def test_every_check_has_a_message_and_one_spelling() -> None:
    for name, check in KNOWN.items():
        assert name == check.name and "_" not in name
        assert posekit.Validator(checks=[name.replace("-", "_")]) is not None


def test_joint_angles_alone_have_their_root_at_neutral_and_a_zero_quaternion_is_refused() -> None:
    validator = posekit.Validator("g1", posekit.ValidateSettings(bodies="capsules"))
    q = np.tile(validator.robot.neutral, (3, 1))
    assert validator.check(q[:, 7:]).ok.all()
    q[1, 3:7] = 0.0
    with pytest.raises(posekit.InputError, match="row 1: root_joint: got a quaternion of length 0"):
        validator.check(q)
    q[1, 3:7] = np.nan
    assert validator.check(q).undecided.tolist() == [False, True, False]
