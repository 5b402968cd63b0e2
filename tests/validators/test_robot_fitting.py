"""Postures of any robot: what it can do is never rejected, what it cannot is named."""

from functools import cache
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.robots import Robot, load_robot
from posekit.robots.joint_map import postures_of
from posekit.skeleton import JOINT, JOINTS
from posekit.synthesis import random_postures
from posekit.validators import Report, Validator
from posekit.validators.robot.branches import Branches
from posekit.validators.robot.fitting import ROUND_DEVIATIONS, Fitter
from posekit.validators.robot.subject import Subject

FIGURE = load_figure()
STANDING = FIGURE.neutral_points[None, :14].copy()


@cache
def validator(name: str, lengths: str = "model") -> Validator:
    return Validator(name, lengths=lengths, bodies="capsules")


def configurations(name: str, count: int, seed: int) -> np.ndarray:
    """Draw configurations uniformly inside the limits, the root at the origin."""
    robot = validator(name).robot
    assert robot is not None
    q = np.tile(pin.neutral(robot.model), (count, 1))
    q[:, 7:] = np.random.default_rng(seed).uniform(robot.lower[7:], robot.upper[7:], (count, q.shape[1] - 7))
    return q


def joints_at(name: str, q: np.ndarray) -> np.ndarray:
    kinematics = validator(name)._robot.models.kinematics
    return postures_of(kinematics.positions(q), kinematics)[:, :14]


def bent(name: str, **degrees: float) -> np.ndarray:
    """Place the joints of a robot that stands with some joints bent: (1, 14, 3)."""
    robot = validator(name).robot
    assert robot is not None
    q = pin.neutral(robot.model)[None]
    for joint, angle in degrees.items():
        q[0, robot.configuration_names.index(joint)] = np.radians(angle)
    return joints_at(name, q)


def judged(report: Report, check: str) -> dict[str, tuple[float, float, bool]]:
    """Return value, margin and verdict of the first posture at each place of a check."""
    one = next(judgement for judgement in report.judgements if judgement.check == check)
    return {
        where: (float(one.value[0, k]), float(one.margin[0, k]), bool(one.violated[0, k]))
        for k, where in enumerate(one.where)
    }


def rejected(report: Report, check: str) -> np.ndarray:
    return np.asarray(next(one for one in report.judgements if one.check == check).violated.any(axis=1))


@pytest.mark.parametrize(("name", "count"), [("human", 150), ("talos", 100), ("simple_humanoid", 100)])
def test_what_the_robot_can_do_is_never_rejected_for_its_limits(name: str, count: int) -> None:
    """Uniform in all joints: folds and singular postures are among them."""
    report = validator(name).check(joints_at(name, configurations(name, count, 3)))
    for check in ("reach", "rigid_parts", "joint_range"):
        assert not rejected(report, check).any()
    assert report.undecided.mean() <= 0.02
    known = report.residual[:, : len(report.points)]
    assert np.percentile(known.max(axis=1), 99) < 1e-3


def test_any_frame_will_do() -> None:
    joints = joints_at("human", configurations("human", 20, 4))
    R = pin.Quaternion(0.5, -0.5, 0.5, 0.5).toRotationMatrix()
    report = validator("human").check(joints @ R.T + [3.0, -2.0, 10.0])
    assert not rejected(report, "joint_range").any()
    assert not rejected(report, "reach").any()


@pytest.mark.parametrize(
    ("joint", "angle"),
    [("right_knee_Z", -12.0), ("left_knee_Z", -6.0), ("right_elbow_Z", 160.0), ("left_hip_Z", -75.0)],
)
def test_a_limit_that_is_broken_is_named_with_its_value(joint: str, angle: float) -> None:
    report = validator("human").check(bent("human", **{joint: angle}))
    assert report.verdicts == ["invalid"]
    value, margin, bad = judged(report, "joint_range")[joint]
    assert bad
    assert value == pytest.approx(angle, abs=0.5)
    robot = validator("human").robot
    assert robot is not None
    k = robot.configuration_names.index(joint)
    lower, upper = np.degrees(robot.lower[k]), np.degrees(robot.upper[k])
    assert margin == pytest.approx(min(value - lower, upper - value))
    assert report.worst[0] == pytest.approx(margin)


def test_each_round_starts_as_far_around_as_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    """What no limited fit reaches is tried from the free fit, once, and then around the best, farther and nearer."""
    starts: list[str | float] = []
    inside, around = Fitter._inside, Fitter._from_around

    def from_around(self: Fitter, targets: np.ndarray, q: np.ndarray, start: int) -> np.ndarray:
        starts.append(ROUND_DEVIATIONS[start])
        return around(self, targets, q, start)

    def from_free(self: Fitter, targets: np.ndarray, start: np.ndarray, steps: int = 0) -> np.ndarray:
        starts.extend([] if steps else ["free"])
        return inside(self, targets, start, *([steps] if steps else []))

    monkeypatch.setattr(Fitter, "_from_around", from_around)
    monkeypatch.setattr(Fitter, "_inside", from_free)
    validator("human").check(bent("human", right_elbow_Z=160.0))
    assert starts == ["free", *ROUND_DEVIATIONS]


@pytest.mark.parametrize("angle", [-0.05, -0.2, -0.4])
def test_too_close_to_call_is_undecided_or_valid_but_not_invalid(angle: float) -> None:
    """The limits keep the ankle off by less than a millimetre, or the knee is outside by less than half a degree."""
    report = validator("human").check(bent("human", right_knee_Z=angle, right_hip_Z=20.0))
    assert not report.invalid[0]


def test_beyond_that_it_is_invalid() -> None:
    assert validator("human").check(bent("human", right_knee_Z=-3.0, right_hip_Z=20.0)).verdicts == [
        "invalid"
    ]


def test_a_wider_tolerance_never_rejects_more() -> None:
    joints = np.concatenate([bent("human", right_knee_Z=angle) for angle in (-1.5, -4.0, -9.0, 20.0)])
    rejects = []
    for tolerance in (0.0, 5.0, 30.0):
        report = Validator(
            "human", lengths="model", checks=("joint-range",), angle_tolerance=tolerance
        ).check(joints)
        rejects.append(report.invalid)
    for tighter, looser in pairwise(rejects):
        assert not (looser & ~tighter).any()
    assert rejects[0].sum() > rejects[-1].sum() == 0


def test_a_batch_is_its_postures_one_at_a_time() -> None:
    joints = np.concatenate(
        [joints_at("human", configurations("human", 6, 5)), bent("human", right_knee_Z=-12.0)]
    )
    together = validator("human").check(joints)
    for k in range(len(joints)):
        alone = validator("human").check(joints[k : k + 1])
        assert alone.verdicts == [together.verdicts[k]]
        np.testing.assert_allclose(alone.q[0], together.q[k], atol=1e-6)


def test_the_model_takes_the_lengths_of_the_postures() -> None:
    tall = FIGURE.from_stature(2.0)
    joints = tall.forward_kinematics(random_postures(tall, 30, np.random.default_rng(6)))[:, :14]
    own = validator("human", "median").check(joints)
    assert not rejected(own, "rigid_parts").any()
    assert not rejected(own, "reach").any()
    assert own.fk_distance.max() < 0.02
    assert rejected(validator("human", "model").check(joints), "rigid_parts").all()


@pytest.mark.parametrize("behind", [True, False])
@pytest.mark.parametrize("lengths", ["each", "median"])
def test_the_model_has_its_shoulders_on_the_side_where_the_postures_have_them(
    lengths: str, behind: bool
) -> None:
    figure = FIGURE.scaled({"right_shoulder-left_shoulder": 0.408}, behind=behind)
    joints = figure.forward_kinematics(random_postures(figure, 1, np.random.default_rng(3)))[:, :14]
    assert validator("human", lengths).check(joints).fk_distance.max() < 1e-5


def test_each_posture_may_have_its_own_lengths() -> None:
    joints = np.concatenate([STANDING, 0.8 * STANDING, np.zeros((1, 14, 3))])
    report = validator("human", "each").check(joints)
    assert report.verdicts == ["valid", "valid", "invalid"]
    assert report.q.shape[0] == 3
    assert rejected(validator("human", "median").check(joints[:2]), "rigid_parts").any()


def test_a_sequence_is_judged_as_its_frames() -> None:
    robot = validator("human").robot
    assert robot is not None
    q = np.tile(pin.neutral(robot.model), (20, 1))
    for joint, last in (("right_shoulder_Z", 150.0), ("right_elbow_Z", 90.0), ("left_knee_Z", -8.0)):
        q[:, robot.configuration_names.index(joint)] = np.radians(np.linspace(2.0, last, 20))
    joints = joints_at("human", q)
    one_by_one, in_time = (
        validator("human").check(joints, sequence=which) for which in (None, np.zeros(20, dtype=int))
    )
    assert one_by_one.verdicts == in_time.verdicts
    assert in_time.verdicts[0] == "valid"
    assert in_time.verdicts[-1] == "invalid"


# --- what is not known ----------------------------------------------------------------------------------


@pytest.mark.parametrize("joint", JOINTS)
def test_a_posture_with_an_unknown_joint_is_undecided(joint: str) -> None:
    joints = bent("human", right_elbow_Z=40.0, left_elbow_Z=40.0)
    joints[0, JOINT[joint]] = np.nan
    assert validator("human").check(joints).verdicts == ["undecided"]


def test_what_is_known_can_still_be_wrong() -> None:
    joints = bent("human", right_knee_Z=-12.0)
    joints[0, JOINT["left_wrist"]] = np.nan
    report = validator("human").check(joints)
    assert report.verdicts == ["invalid"]
    assert judged(report, "joint_range")["right_knee_Z"][2]
    assert np.isnan(judged(report, "joint_range")["left_elbow_Z"][0])


def test_joints_that_no_point_shows_are_not_judged() -> None:
    """The human's wrists, ankles and neck carry no point of the map."""
    found = judged(validator("human").check(bent("human")), "joint_range")
    unseen = {where for where, (value, _, _) in found.items() if np.isnan(value)}
    assert unseen == {
        *(
            f"{side}_{joint}"
            for side in ("left", "right")
            for joint in ("wrist_Z", "wrist_X", "ankle_Z", "ankle_X")
        ),
        *(f"middle_cervical_{axis}" for axis in "XYZ"),
        *(f"{side}_elbow_Y" for side in ("left", "right")),
    }


def test_nothing_known_and_nothing_given() -> None:
    report = validator("human").check(np.full((2, 14, 3), np.nan))
    assert report.verdicts == ["undecided"] * 2
    assert np.isnan(report.fk_distance).all()
    assert validator("human").check(np.empty((0, 14, 3))).verdicts == []


# --- reach ----------------------------------------------------------------------------------------------


def test_a_length_that_no_fit_can_have_is_proof() -> None:
    """A shank longer by 10 cm: whatever the fit, knee or ankle is off by 5."""
    joints = bent("human")
    joints[0, JOINT["right_ankle"]] += 0.10 * np.array([0.0, -1.0, 0.0])
    report = validator("human").check(joints)
    assert {place for place, (_, _, bad) in judged(report, "reach").items() if bad} <= {
        "right_knee",
        "right_ankle",
    }
    assert rejected(report, "reach")[0]
    assert max(value for value, _, _ in judged(report, "reach").values()) >= 0.05 - 1e-9


def test_a_misfit_without_proof_is_undecided() -> None:
    """The trunk drawn out by 20 cm: a spine that bends has no length that would prove it."""
    joints = bent("human")
    upper = [
        JOINT[name] for name in JOINTS if not any(part in name for part in ("hip", "knee", "ankle", "pelvis"))
    ]
    joints[0, upper] += [0.0, 0.2, 0.0]
    report = validator("human").check(joints)
    assert not rejected(report, "reach")[0]
    assert report.verdicts == ["undecided"]
    assert report.fk_distance[0] > 0.03


# --- branches -------------------------------------------------------------------------------------------


def subject(name: str) -> Subject:
    robot = load_robot(name, geometry=False)
    return Subject(model=robot.model, lower=robot.lower, upper=robot.upper)


@pytest.mark.parametrize(("name", "balls"), [("human", 6), ("stick_figure", 6)])
def test_the_second_solution_of_three_hinges_places_all_alike(name: str, balls: int) -> None:
    branches = Branches(subject=subject(name))
    assert len(branches.balls) >= balls - 2
    model, rng = branches.subject.model, np.random.default_rng(7)
    q = np.tile(pin.neutral(model), (20, 1))
    q[:, 7:] = rng.uniform(-7.0, 7.0, (20, model.nq - 7))
    best = branches.nearest_to_limits(q)
    data, other = model.createData(), model.createData()
    changed = 0
    for a, b in zip(q, best, strict=True):
        pin.framesForwardKinematics(model, data, a)
        pin.framesForwardKinematics(model, other, b)
        ends = [joint for joint in range(model.njoints) if not model.children[joint]]
        for joint in ends:
            np.testing.assert_allclose(data.oMi[joint].homogeneous, other.oMi[joint].homogeneous, atol=1e-8)
        changed += not np.allclose(a, b)
    assert changed == 20


@pytest.mark.parametrize(
    ("hinges", "balls"), [(2, []), (3, [(0, 1, 2)]), (4, [(0, 1, 2)]), (6, [(0, 1, 2), (3, 4, 5)])]
)
def test_a_hinge_is_of_one_ball_alone(hinges: int, balls: list[tuple[int, int, int]]) -> None:
    """Hinges through one point about x, y, x, y and so on: any three that follow each other have a second solution."""
    links = "".join(f'<link name="l{k}"/>' for k in range(hinges + 1))
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
        f'<axis xyz="{1 - k % 2} {k % 2} 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for k in range(hinges)
    )
    robot = Robot(urdf=f'<robot name="wrist">{links}{joints}</robot>', free_flyer=False)
    found = Branches(subject=Subject(model=robot.model, lower=robot.lower, upper=robot.upper)).balls
    at = {int(robot.model.idx_qs[k + 1]): k for k in range(hinges)}
    assert [tuple(at[index] for index in (one.first, one.middle, one.last)) for one in found] == balls


def test_a_configuration_inside_its_limits_stays() -> None:
    branches = Branches(subject=subject("human"))
    q = configurations("human", 50, 8)
    np.testing.assert_array_equal(branches.nearest_to_limits(q), q)
