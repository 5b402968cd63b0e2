"""Joint ranges on the figure's own angles: both ends of each of the 22, and what is unknown."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.compiled.screen_kinds import OF_LIMB
from posekit.compiled.verdicts import NO_VIOLATION
from posekit.errors import FigureError
from posekit.skeleton import DOFS, HEAD, JOINT, POINTS
from posekit.synthesis import random_views
from posekit.tree import Check
from posekit.tree.screening import screened
from posekit.validators import Ranges, joint_range

FIGURE = load_figure()
CHECKS = joint_range(FIGURE)
GENERIC = {"flexion": 0.5, "bending": 0.1, "abduction": 0.2, "rotation": 0.1}
"""Angles (radians) at which no other way to write the posture is inside the limits."""


def posture(angles: dict[str, float]) -> np.ndarray:
    """Place one posture (1, 19, 3) with some angles (radians) set and generic others."""
    q = pin.neutral(FIGURE.model)[None].copy()
    q[0, :3] = [0.2, -0.1, 4.0]
    q[0, 3:7] = np.array([0.3, -0.5, 0.7, 0.2]) / np.linalg.norm([0.3, -0.5, 0.7, 0.2])
    for dof, index in zip(DOFS, FIGURE.angle_index, strict=True):
        q[0, index] = angles.get(dof, GENERIC[dof.split(".")[1]])
    return FIGURE.forward_kinematics(q)


def judged(points: np.ndarray, checks: list[Check] = CHECKS) -> dict[str, tuple[bool, float, float]]:
    """Return the verdict, value and margin of the last check of each place."""
    result: dict[str, tuple[bool, float, float]] = {}
    for check in checks:
        findings = check.judge(points[:, check.points])
        for k, where in enumerate(check.where):
            result[where] = (
                bool(findings.violated[0, k]),
                float(findings.value[0, k]),
                float(np.broadcast_to(findings.margin, findings.value.shape)[0, k]),
            )
    return result


def random_postures(n: int) -> np.ndarray:
    rng = np.random.default_rng(5)
    q = np.tile(pin.neutral(FIGURE.model), (n, 1))
    q[:, 2] = 4
    turn = rng.normal(size=(n, 4))
    q[:, 3:7] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    limits = FIGURE.limits
    q[:, FIGURE.angle_index] = limits.lower + rng.random((n, 22)) * (limits.upper - limits.lower)
    return FIGURE.forward_kinematics(q)


def test_all_22_angles_are_judged() -> None:
    assert {where for check in CHECKS for where in check.where} == set(DOFS)


@pytest.mark.parametrize("dof", DOFS)
@pytest.mark.parametrize("end", ["lower", "upper"])
@pytest.mark.parametrize(
    ("outside", "passes"), [(-0.01, True), (0.0, True), (0.0005, True), (0.003, False), (1, False)]
)
def test_each_limit_just_passes_and_just_fails(dof: str, end: str, outside: float, passes: bool) -> None:
    limits = FIGURE.limits
    row = DOFS.index(dof)
    lower, upper = limits.lower[row], limits.upper[row]
    angle = upper + np.radians(outside) if end == "upper" else lower - np.radians(outside)
    verdicts = judged(posture({dof: angle}))
    rejected, value, margin = verdicts.pop(dof)
    assert rejected == (not passes)
    assert value == pytest.approx(np.degrees(angle), abs=1e-6)
    assert margin == pytest.approx(-outside, abs=1e-6)
    assert not any(bad for bad, _, _ in verdicts.values())


def test_random_legal_postures_pass() -> None:
    points = random_postures(3000)
    for check in CHECKS:
        assert not check.judge(points[:, check.points]).violated.any()


def test_the_upper_segment_alone_never_rejects_what_the_whole_limb_passes(rng: np.random.Generator) -> None:
    q = np.tile(pin.neutral(FIGURE.model), (3000, 1))
    q[:, FIGURE.angle_index] = rng.uniform(-np.pi, np.pi, (3000, 22))
    points = FIGURE.forward_kinematics(q)
    for part, whole in zip(CHECKS[2::2], CHECKS[3::2], strict=True):
        assert whole.where[:2] == part.where
        early = part.judge(points[:, part.points]).violated.any(axis=1)
        late = whole.judge(points[:, whole.points]).violated.any(axis=1)
        assert (late | ~early).all()
        assert early.any()


def test_the_verdict_does_not_depend_on_where_the_person_stands(rng: np.random.Generator) -> None:
    q = np.tile(pin.neutral(FIGURE.model), (1000, 1))
    q[:, FIGURE.angle_index] = rng.uniform(-2, 2, (1000, 22))
    turned = q.copy()
    turned[:, :3] = rng.normal(size=(1000, 3))
    turn = rng.normal(size=(1000, 4))
    turned[:, 3:7] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    here, there = FIGURE.forward_kinematics(q), FIGURE.forward_kinematics(turned)
    for check in CHECKS:
        np.testing.assert_array_equal(
            check.judge(here[:, check.points]).violated.any(axis=1),
            check.judge(there[:, check.points]).violated.any(axis=1),
        )


@pytest.mark.parametrize("missing", POINTS)
def test_a_missing_point_never_rejects_and_leaves_something_undecided(missing: str) -> None:
    points = random_postures(20)
    outside = points.copy()
    outside[:, JOINT["right_wrist"]] += 0.1
    k = POINTS.index(missing)
    for broken in (points, outside):
        broken[:, k] = np.nan
        for check in CHECKS:
            findings = check.judge(broken[:, check.points])
            assert not (findings.violated & findings.undecided).any()
            if k in check.points:
                assert findings.undecided.any(axis=1).all()
    for check in CHECKS:
        assert not check.judge(points[:, check.points]).violated.any()


def test_with_the_wrist_missing_the_upper_arm_is_still_judged() -> None:
    # Not the arm: without its axial rotation a shoulder reaches everything.
    points = posture({"right_hip.flexion": np.radians(-60)})
    points[:, JOINT["right_ankle"]] = np.nan
    verdicts = judged(points)
    assert verdicts["right_hip.flexion"][0]
    assert np.isnan(verdicts["right_knee.flexion"][1])
    assert not verdicts["right_knee.flexion"][0]


@pytest.mark.parametrize("bend", [0.0, 1e-4, 0.05, 1.0, 20.0])
def test_a_looser_tolerance_never_rejects_more(rng: np.random.Generator, bend: float) -> None:
    q = np.tile(pin.neutral(FIGURE.model), (500, 1))
    q[:, FIGURE.angle_index] = rng.uniform(-1.5, 1.5, (500, 22))
    hinges = [
        DOFS.index(f"{side}_{joint}.flexion") for side in ("right", "left") for joint in ("elbow", "knee")
    ]
    q[:, FIGURE.angle_index[hinges]] = np.radians(bend)
    points = FIGURE.forward_kinematics(q)
    rejected = []
    for tolerance in (0.0, 1e-3, 0.1, 1.0, 10.0):
        checks = joint_range(FIGURE, tolerance=tolerance)
        rejected.append(np.any([c.judge(points[:, c.points]).violated.any(axis=1) for c in checks], axis=0))
    for strict, loose in pairwise(rejected):
        assert (strict | ~loose).all()


def test_the_rotation_of_a_limb_that_is_almost_straight_is_rounding() -> None:
    # A micrometre at the ankle turns a straight leg's rotation by anything; a centimetre does not.
    points = posture(
        {f"right_{dof}": 0.0 for dof in ("hip.flexion", "hip.abduction", "hip.rotation", "knee.flexion")}
    )
    knee, ankle, hip = (points[0, JOINT[f"right_{name}"]] for name in ("knee", "ankle", "hip"))
    aside = np.cross(points[0, JOINT["left_hip"]] - hip, knee - hip)
    aside = np.cross(ankle - knee, aside / np.linalg.norm(aside))
    aside /= np.linalg.norm(aside)
    for off, passes in ((1e-9, True), (1e-7, True), (1e-6, True), (0.01, False), (-0.01, False)):
        moved = points.copy()
        moved[0, JOINT["right_ankle"]] += off * aside
        assert judged(moved)["right_hip.rotation"][0] == (not passes)


def test_with_the_head_missing_the_neck_is_undecided() -> None:
    points = posture({"neck.flexion": 3.0})
    assert judged(points)["neck.flexion"][0]
    points[:, HEAD] = np.nan
    verdicts = judged(points)
    assert all(np.isnan(verdicts[f"neck.{angle}"][1]) for angle in ("flexion", "bending", "rotation"))
    assert not any(bad for bad, _, _ in verdicts.values())


def test_a_segment_of_no_length_is_undecided() -> None:
    points = posture({})
    points[:, JOINT["right_wrist"]] = points[:, JOINT["right_elbow"]]
    points[:, JOINT["left_hip"]] = points[:, JOINT["right_hip"]]
    verdicts = judged(points)
    assert np.isnan(verdicts["right_elbow.flexion"][1])
    assert np.isnan(verdicts["pelvis.flexion"][1])
    assert not any(bad for bad, _, _ in verdicts.values())


def test_named_ranges_replace_only_the_limits_they_name() -> None:
    ranges = Ranges(name="stiff", kind="configuration", limits={"right_elbow.flexion": (0.0, 20.0)})
    checks = joint_range(FIGURE, ranges)
    verdicts = judged(posture({}), checks)
    assert verdicts["right_elbow.flexion"][0]
    assert verdicts["right_elbow.flexion"][2] == pytest.approx(20 - np.degrees(0.5), abs=1e-6)
    assert not verdicts["left_elbow.flexion"][0]


def test_ranges_of_an_unknown_joint_are_refused() -> None:
    ranges = Ranges(name="odd", kind="configuration", limits={"tail.flexion": (0.0, 20.0)})
    with pytest.raises(FigureError, match="tail_flexion"):
        joint_range(FIGURE, ranges)


@pytest.mark.parametrize("elbow", [0, 90, 150])
@pytest.mark.parametrize("flexion", [-40, 0, 60, 150])
@pytest.mark.parametrize("rotation", [-70, 0, 100])
def test_arms_held_exactly_sideways_pass(flexion: float, rotation: float, elbow: float) -> None:
    angles = {f"{side}_shoulder.abduction": np.pi / 2 for side in ("right", "left")}
    for side in ("right", "left"):
        angles |= {
            f"{side}_shoulder.flexion": np.radians(flexion),
            f"{side}_shoulder.rotation": np.radians(rotation),
            f"{side}_elbow.flexion": np.radians(elbow),
        }
    assert not any(bad for bad, _, _ in judged(posture(angles)).values())


def test_what_passes_the_screen_by_the_tolerance_alone_passes_with_directions() -> None:
    """And where angles are exact they are no screen of the check itself, which allows some of them more."""
    scene = random_views(load_figure(), 400, np.random.default_rng(5), ranges="urdf")
    points = np.concatenate([scene.joints_cam, scene.head_cam], axis=1)
    points = points + np.random.default_rng(6).normal(scale=0.05, size=points.shape)
    more = 0
    for check in joint_range(load_figure(), tolerance=3.0, directions=True):
        own = points[:, list(check.points)]
        passing = check.passing
        assert passing is not None
        clear = screened([passing], [check.points], points)[0][:, 0] == NO_VIOLATION
        violated = np.asarray(check.judge(own).violated.any(axis=1))
        assert not violated[clear].any()
        assert clear.any() and violated.any()
        more += int((~clear & ~violated).sum())
        assert (check.rule is None) == (passing.kind == OF_LIMB)
    assert more


@pytest.mark.parametrize("angle", ["flexion", "rotation"])
@pytest.mark.parametrize("limb", ["shoulder", "hip"])
def test_with_directions_an_angle_near_a_pole_may_be_off_by_what_its_direction_may(
    limb: str, angle: str
) -> None:
    """At an angle of sine s from its axis a direction may turn by t: then that angle by the tangent of asin(t / s)."""
    tolerance, checks = 3.0, joint_range(FIGURE, tolerance=3.0, directions=True)
    hinge = {"shoulder": "elbow", "hip": "knee"}[limb]
    end = FIGURE.limits.upper[DOFS.index(f"right_{limb}.{angle}")]
    # How far the upper segment is from the first angle's axis, and the lower one from the last.
    turned = {f"right_{limb}.abduction": 0.7, f"right_{hinge}.flexion": 0.6}
    sine = np.cos(0.7) if angle == "flexion" else np.sin(0.6)
    allowed = np.tan(np.arcsin(np.radians(tolerance) / sine))
    for share, passes in ((0.97, True), (1.03, False)):
        whole = posture({**turned, f"right_{limb}.{angle}": end + share * allowed})
        assert judged(whole, checks)[f"right_{limb}.{angle}"][0] != passes
