"""Judgements of a small robot's configurations and fits: values, bounds and margins that can be written down."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.robots import Robot
from posekit.robots.kinematics import Kinematics, body_points
from posekit.settings import ValidateSettings
from posekit.validators import Report
from posekit.validators.robot.balance import ON_GROUND, Balance
from posekit.validators.robot.branches import Branches
from posekit.validators.robot.collision import SelfCollision
from posekit.validators.robot.contacts import Contacts, find_contacts
from posekit.validators.robot.feet import Corner
from posekit.validators.robot.fitting import Fit, Fitter
from posekit.validators.robot.flips import find_flips
from posekit.validators.robot.joint_range import beyond_limits, judge_joint_range, outside_limits
from posekit.validators.robot.load import load_subject
from posekit.validators.robot.models import Models
from posekit.validators.robot.reach import judge_reach, rigid_pairs
from posekit.validators.robot.robot_validator import RobotValidator, _of_fits
from posekit.validators.robot.settings import check_robot_names, reach_tolerance, robot_settings
from posekit.validators.robot.subject import Subject

UP = np.array([0.0, 0.0, 1.0])

# A cart on a rail, an arm of 0.3 m that turns about y, a forearm of 0.2 m that does too, and a hand without limits.
ARM = """<robot name="arm">
  <link name="rail"><inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="0.05"/></geometry></collision></link>
  <link name="cart"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    </link>
  <link name="upper"><collision><origin xyz="0 0 0.15"/><geometry><sphere radius="0.05"/></geometry></collision></link>
  <link name="lower"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 0.25"/><geometry><sphere radius="0.05"/></geometry></collision></link>
  <link name="hand"/>
  <joint name="slide" type="prismatic"><parent link="rail"/><child link="cart"/>
    <axis xyz="1 0 0"/><limit lower="-0.5" upper="0.25" effort="1" velocity="1"/></joint>
  <joint name="turn" type="revolute"><parent link="cart"/><child link="upper"/>
    <axis xyz="0 1 0"/><limit lower="-1.0" upper="2.0" effort="1" velocity="1"/></joint>
  <joint name="bend" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0 0 0.3"/>
    <axis xyz="0 1 0"/><limit lower="0.0" upper="2.5" effort="1" velocity="1"/></joint>
  <joint name="spin" type="continuous"><parent link="lower"/><child link="hand"/><origin xyz="0 0 0.2"/>
    <axis xyz="0 0 1"/></joint>
</robot>"""


@cache
def arm() -> Robot:
    return Robot(urdf=ARM, free_flyer=False)


def subject_of(**changes: object) -> Subject:
    given_ = {"model": arm().model, "lower": arm().lower, "upper": arm().upper, "geometry": arm().geometry}
    return Subject(**{**given_, **changes})


def at(*values: tuple[float, float, float]) -> Array:
    """Return configurations of slide, turn and bend; the hand is as it is."""
    q = np.tile(pin.neutral(arm().model), (len(values), 1))
    q[:, :3] = values
    return q


def points_of(q: Array) -> Array:
    """Place shoulder, elbow and hand by hand (N, 3, 3)."""
    slide, turn, both = q[:, 0], q[:, 1], q[:, 1] + q[:, 2]
    zero = np.zeros_like(slide)
    shoulder = np.stack([slide, zero, zero], axis=-1)
    elbow = shoulder + 0.3 * np.stack([np.sin(turn), zero, np.cos(turn)], axis=-1)
    hand = elbow + 0.2 * np.stack([np.sin(both), zero, np.cos(both)], axis=-1)
    return np.stack([shoulder, elbow, hand], axis=1)


@cache
def kinematics() -> Kinematics:
    return Kinematics(model=arm().model, points=tuple(body_points(("upper", "lower", "hand"))))


# --- limits ---------------------------------------------------------------------------------------------


def test_a_subject_lists_joints_with_limits_and_their_units() -> None:
    subject = subject_of()
    assert subject.joint_names == ("slide", "turn", "bend")
    assert subject.units == ("m", "deg", "deg")
    assert subject.index.tolist() == subject.velocity_index.tolist() == [0, 1, 2]
    np.testing.assert_allclose(subject.to_unit, [1.0, 57.29577951308232, 57.29577951308232])
    assert subject.pair_names == ("rail-upper", "rail-lower") or len(subject.pair_names) > 0
    assert subject_of(geometry=None).pair_names == ()
    half = arm().upper.copy()
    half[0] = np.inf
    assert subject_of(upper=half).joint_names == ("slide", "turn", "bend")
    lower = arm().lower.copy()
    lower[0] = -np.inf
    assert subject_of(upper=half, lower=lower).joint_names == ("turn", "bend")


@given(
    values=st.tuples(st.floats(-1, 1), st.floats(-3, 3), st.floats(-3, 3)),
    tolerance=st.sampled_from([0.0, 0.5, 5.0]),
)
def test_margins_are_distances_from_the_nearer_limit(
    values: tuple[float, float, float], tolerance: float
) -> None:
    """A hundredth of a metre counts as a degree."""
    q = at(values)
    found = judge_joint_range(subject_of(), q, tolerance=tolerance)
    limits = [(-0.5, 0.25, 1.0), (-1.0, 2.0, 180 / np.pi), (0.0, 2.5, 180 / np.pi)]
    for k, (value, (lower, upper, scale)) in enumerate(zip(values, limits, strict=True)):
        margin = min(value - lower, upper - value) * scale
        assert found.value[0, k] == pytest.approx(value * scale)
        assert (found.lower[0, k], found.upper[0, k]) == pytest.approx((lower * scale, upper * scale))
        assert found.margin[0, k] == pytest.approx(margin, abs=1e-9)
        allowed = tolerance * (0.01 if k == 0 else 1.0)
        if abs(margin + allowed) > 1e-9:
            assert found.violated[0, k] == (margin < -allowed)
        assert beyond_limits(subject_of(), q)[0, k] == pytest.approx(max(-margin, 0.0), abs=1e-9)
    assert outside_limits(subject_of(), q, tolerance=tolerance)[0] == found.violated.any()
    assert found.check == "joint_range" and found.where == ("slide", "turn", "bend")
    assert found.unit == ("m", "deg", "deg")


def test_thousands_of_configurations_are_judged_one_by_one() -> None:
    q = at(*[(0.0, 0.0, 1.0)] * 2500)
    wrong = [0, 1023, 1024, 1025, 2047, 2048, 2499]
    q[wrong, 1] = 2.5
    assert np.flatnonzero(outside_limits(subject_of(), q, tolerance=0.1)).tolist() == wrong


def test_what_is_not_seen_or_undecided_is_not_violated() -> None:
    q = at((0.5, 3.0, 1.0), (0.5, 3.0, 1.0))
    seen = np.array([[True, False, True], [False, True, True]])
    found = judge_joint_range(subject_of(), q, tolerance=0.0, seen=seen)
    assert found.violated.tolist() == [[True, False, False], [False, True, False]]
    np.testing.assert_array_equal(np.isnan(found.margin), ~seen)
    np.testing.assert_array_equal(np.isnan(found.value), ~seen)
    found = judge_joint_range(subject_of(), q, tolerance=0.0, undecided=np.array([True, False]))
    assert found.violated.tolist() == [[False] * 3, [True, True, False]]
    assert np.isnan(found.margin[0]).all() and np.isfinite(found.margin[1]).all()


@pytest.mark.parametrize(("degrees", "slack", "verdict"), [
    (4.0, 3.0, "valid"),  # within the tolerance of 5
    (6.0, 0.0, "invalid"),
    (6.0, 3.0, "undecided"),
    (7.9, 3.0, "undecided"),
    (8.1, 3.0, "invalid"),
])  # fmt: skip
def test_an_answer_of_a_solver_is_a_violation_where_it_is_clear(
    degrees: float, slack: float, verdict: str
) -> None:
    q = at((0.0, 2.0 + np.radians(degrees), 1.0))
    found = judge_joint_range(subject_of(), q, tolerance=5.0, slack=np.array([slack]))
    assert found.violated[0].tolist() == [False, verdict == "invalid", False]
    assert np.isnan(found.margin[0]).all() == (verdict == "undecided")


def test_a_slide_has_its_slack_in_centimetres() -> None:
    for metres, clear in ((0.075, False), (0.085, True)):
        found = judge_joint_range(
            subject_of(), at((0.25 + metres, 0.0, 1.0)), tolerance=5.0, slack=np.array([3.0])
        )
        assert found.violated[0, 0] == clear


# --- collisions -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("margin", [0.0, 0.02, -0.02])
def test_two_balls_collide_that_are_nearer_than_the_margin(margin: float) -> None:
    """The forearm's ball is 0.1 m wide, as the rail's; folded back it comes near."""
    collision = SelfCollision(subject=subject_of(), contact_margin=margin)
    bends = np.linspace(1.2, 3.1, 400)
    q = at(*[(0.03, 0.0, bend) for bend in bends])
    ends = points_of(q)
    balls = {
        "rail": np.zeros((400, 3)),
        "upper": (ends[:, 0] + ends[:, 1]) / 2,
        "lower": ends[:, 1] + 1.25 * (ends[:, 2] - ends[:, 1]),
    }
    pairs = [name.split("-") for name in subject_of().pair_names]
    distance = np.stack([np.linalg.norm(balls[a] - balls[b], axis=1) - 0.1 for a, b in pairs], axis=1)
    expected = np.asarray((distance < margin).any(axis=1))
    assert expected.any() and not expected.all()
    np.testing.assert_array_equal(collision.hits(q), expected)
    found = collision.judge(q)
    np.testing.assert_array_equal(found.violated[:, 0], expected)
    assert (found.value == margin).all() and (found.lower == margin).all() and (found.margin == 0.0).all()
    assert np.isinf(found.upper).all() and found.by_pairs and found.where == ("nearest pair",)
    assert found.unit == ("m",) and found.check == "collision"
    some = np.arange(400) % 3 == 0
    part = collision.judge(q, some)
    np.testing.assert_array_equal(part.violated[:, 0], expected & ~some)
    np.testing.assert_array_equal(np.isnan(part.value[:, 0]), some)
    contacts = collision.contacts(q, np.arange(400), nearest=True)
    for row, pair, apart, violated in zip(
        contacts.posture, contacts.pair, contacts.distance, contacts.violated, strict=True
    ):
        assert apart == pytest.approx(distance[row, pair], abs=1e-6)
        assert violated == expected[row]
        assert (
            (distance[row, pair] < margin)
            if violated
            else apart == pytest.approx(distance[row].min(), abs=1e-6)
        )
    assert set(contacts.posture.tolist()) == set(range(400))
    only = collision.contacts(q, np.arange(400))
    assert only.violated.all() and set(only.posture.tolist()) == set(np.flatnonzero(expected).tolist())
    assert len(only) == (distance < margin).sum()
    assert contacts.names == subject_of().pair_names


def test_nothing_collides_where_there_is_nothing_and_bodies_are_needed() -> None:
    assert SelfCollision(subject=subject_of()).hits(at((0, 0, 0))[:0]).tolist() == []
    with pytest.raises(InputError, match="without collision bodies"):
        SelfCollision(subject=subject_of(geometry=None))


def test_depth_of_meshes_is_refused_and_named() -> None:
    geometry = pin.GeometryModel(arm().geometry)
    box = coal.BVHModelOBBRSS()
    box.beginModel(1, 3)
    box.addTriangle(np.zeros(3), np.array([0.01, 0, 0]), np.array([0, 0.01, 0]))
    box.endModel()
    geometry.geometryObjects[0].geometry = box
    with_mesh = subject_of(geometry=geometry)
    collision = SelfCollision(subject=with_mesh, contact_margin=0.01)
    of_first = [0 in (pair.first, pair.second) for pair in geometry.collisionPairs]
    assert collision.with_mesh.tolist() == of_first and collision.has_meshes
    # A mesh's margin is the contact margin; of primitives a billionth of a metre is rounding.
    np.testing.assert_allclose(collision.margins, np.where(of_first, 0.01, 0.01 - 1e-9), rtol=0, atol=1e-15)
    named = with_mesh.pair_names[of_first.index(True)]
    with pytest.raises(InputError, match=rf"contact-margin -0\.01 m: the pair {named} has a mesh"):
        SelfCollision(subject=with_mesh, contact_margin=-0.01)
    without = SelfCollision(subject=subject_of(), contact_margin=-0.01)
    assert not without.has_meshes
    np.testing.assert_allclose(without.margins, -0.01 - 1e-9, rtol=0, atol=1e-15)


# --- balance --------------------------------------------------------------------------------------------


def soles(side: float = 0.2, lift: float = 0.0) -> tuple[Corner, ...]:
    square = [(x * side / 2, y * side / 2, 0.0) for x in (-1, 1) for y in (-1, 1)]
    raised = (*square[:3], (*square[3][:2], lift))
    return tuple(Corner(0, np.array(one)) for one in raised)


@given(slide=st.floats(-0.4, 0.2), turn=st.floats(-1, 2), bend=st.floats(0, 2.5))
def test_balance_is_how_far_the_centre_of_mass_is_from_the_edge(
    slide: float, turn: float, bend: float
) -> None:
    """Of 2 kg on the rail, 1 kg in the cart and 1 kg in the elbow: soles of 20 cm."""
    q = at((slide, turn, bend))
    found = Balance(model=arm().model, corners=soles(), up=UP).judge(q)
    centre = (slide + points_of(q)[0, 1, 0]) / 2  # the base has no mass in Pinocchio's model
    assert found.value[0, 0] == pytest.approx(0.1 - abs(centre), abs=1e-9)
    assert found.margin[0, 0] == found.value[0, 0] and found.violated[0, 0] == (abs(centre) > 0.1)
    assert found.lower.tolist() == [[0.0]] and np.isinf(found.upper).all()
    assert (found.check, found.where, found.unit) == ("balance", ("centre of mass",), ("m",))


@pytest.mark.parametrize("lift", [0.99 * ON_GROUND, 1.01 * ON_GROUND])
def test_a_corner_stands_on_the_ground_within_three_centimetres(lift: float) -> None:
    """Without the fourth corner the edge goes through the centre of mass."""
    found = Balance(model=arm().model, corners=soles(lift=lift), up=UP).judge(at((0.0, 0.0, 0.0)))
    assert found.value[0, 0] == pytest.approx(0.1 if lift < 0.03 else 0.0, abs=1e-9)


def test_balance_says_nothing_of_what_is_undecided_without_masses_or_feet() -> None:
    q = at((0.0, 0.0, 0.0), (0.2, 0.0, 0.0))
    balance = Balance(model=arm().model, corners=soles(), up=UP)
    found = balance.judge(q, np.array([True, False]))
    assert np.isnan(found.value[0, 0]) and np.isfinite(found.value[1, 0])
    assert found.violated.tolist() == [[False], [True]]
    assert np.isnan(replace(balance, corners=()).judge(q).value).all()


# --- fits -----------------------------------------------------------------------------------------------


def test_points_of_one_body_are_rigid_pairs() -> None:
    assert rigid_pairs(kinematics()).tolist() == [[0, 1], [1, 2]]


@pytest.mark.parametrize(("off", "proof"), [(0.019, False), (0.021, True)])
def test_a_length_that_is_off_by_twice_the_tolerance_is_proof(off: float, proof: bool) -> None:
    """Of a fit that is off by more than a centimetre nothing is known else."""
    q = at((0.0, 0.5, 1.0))
    targets = points_of(q)
    away = (targets[0, 1] - targets[0, 0]) / 0.3
    targets[0, 0] -= off * away
    residual = np.array([[off, 0.001, 0.0]])
    found = judge_reach(kinematics(), targets, residual, tolerance=0.01)
    assert found.violated.tolist() == [[proof, False, False]]
    assert np.isnan(found.margin).all() != proof
    if proof:
        np.testing.assert_allclose(found.margin, 0.01 - residual)
    np.testing.assert_array_equal(found.value, residual)
    assert (found.upper == 0.01).all() and (found.lower == -np.inf).all()
    assert found.where == ("upper", "lower", "hand") and found.unit == ("m", "m", "m")
    near = judge_reach(kinematics(), points_of(q), np.full((1, 3), 0.009), tolerance=0.01)
    assert not near.violated.any() and np.isfinite(near.margin).all()


def test_a_proof_of_one_posture_says_nothing_of_another() -> None:
    targets = points_of(at((0.0, 0.5, 1.0), (0.0, 0.5, 1.0)))
    targets[0, 0] -= 0.5
    found = judge_reach(kinematics(), targets, np.full((2, 3), 0.02), tolerance=0.01)
    assert found.violated.any(axis=1).tolist() == [True, False]
    assert np.isnan(found.margin).all(axis=1).tolist() == [False, True]


def test_a_fit_inside_its_limits_places_the_points() -> None:
    fitter = Fitter(kinematics=kinematics(), subject=subject_of(), tolerance=0.001)
    q = at((0.1, 0.4, 1.2), (-0.3, 1.5, 0.3), (0.0, -0.5, 2.0))
    fit = fitter.fit(points_of(q))
    np.testing.assert_allclose(fit.judged_q[:, :3], q[:, :3], atol=1e-3)
    assert not fit.suffers.any() and fit.judged_residual.max() < 1e-4
    again = fitter.fit(points_of(q), np.zeros(3, dtype=np.intp))
    np.testing.assert_allclose(again.judged_q[:, :3], q[:, :3], atol=1e-3)


def test_limits_keep_a_fit_off_by_what_they_take() -> None:
    fitter = Fitter(kinematics=kinematics(), subject=subject_of(), tolerance=0.001)
    q = at((0.0, 0.5, -0.6))  # bent backward: the other way would need another shoulder
    fit = fitter.fit(points_of(q))
    assert fit.suffers.all() and fit.kept_off[0] > 0.02
    np.testing.assert_allclose(fit.judged_q[:, :3], q[:, :3], atol=1e-3)
    assert fit.judged_residual.max() < 1e-4 < fit.residual.max()
    assert fit.q[0, 2] >= 0.0
    unseen = points_of(q)
    unseen[0, 2] = np.nan
    seen = fitter.seen(unseen)
    assert seen.tolist() == [[True, True, False]] and fitter.seen(points_of(q)).all()


class _Asked:
    """Keeps which configurations it was told to say nothing of."""

    undecided: list[bool]

    def judge(self, q: Array, undecided: Array) -> str:
        self.undecided = undecided.tolist()
        return f"{len(q)} judged"


@pytest.mark.parametrize("checks", [("collision",), ("balance",), ("collision", "balance")])
def test_nothing_is_said_of_fits_that_are_far_off_or_of_incomplete_postures(checks: tuple[str, ...]) -> None:
    settings = robot_settings(ValidateSettings(checks=checks, rigid_tolerance=0.01))
    judged: Any = SimpleNamespace(settings=settings, collision=_Asked(), balance=_Asked())
    residual = np.array([[0.0, 0.009], [0.0, 0.011], [np.nan, 0.0], [np.nan, np.nan]])
    q = at(*[(0, 0, 0)] * 4)
    fit = Fit(q=q, residual=residual, free_q=q, free_residual=residual, kept_off=np.zeros(4))
    complete = np.array([True, True, False, False])
    found: list[Any] = [*_of_fits(judged, fit, seen=np.ones((4, 3), dtype=bool), complete=complete)]
    assert found == ["4 judged"] * len(checks)
    for name in checks:
        assert getattr(judged, name).undecided == [False, True, True, True]


@pytest.mark.parametrize(("kept_off", "degrees", "verdict"), [
    (0.0, 0.2, "invalid"),
    (0.0009, 90.0, "undecided"),  # what a search may miss by is no proof
    (0.0011, 0.4, "undecided"),
    (0.0011, 0.6, "invalid"),  # half a degree, and one more for each centimetre of misfit
    (0.0011, 1.4, "undecided at a centimetre"),
    (0.0011, 1.6, "invalid at a centimetre"),
])  # fmt: skip
def test_limits_are_broken_where_they_clearly_keep_a_fit_off(
    kept_off: float, degrees: float, verdict: str
) -> None:
    settings = robot_settings(ValidateSettings(checks=("joint-range",), angle_tolerance=0.1))
    judged: Any = SimpleNamespace(settings=settings, subject=subject_of())
    q = at((0.0, 2.0 + np.radians(0.1 + degrees), 1.0))
    residual = np.full((1, 3), 0.01 if "centimetre" in verdict else 0.0)
    fit = Fit(q=q, residual=residual, free_q=q, free_residual=residual, kept_off=np.array([kept_off]))
    (found,) = _of_fits(judged, fit, seen=np.ones((1, 3), dtype=bool), complete=np.array([True]))
    assert found.violated.any() == verdict.startswith("invalid")
    assert np.isnan(found.margin).all() == verdict.startswith("undecided")


def test_which_configuration_stands_for_a_posture() -> None:
    """The one without limits where these keep the other off by any length at all."""
    one, free = at((0, 0, 0), (0, 0, 0)), at((0, 1, 0), (0, 1, 0))
    fit = Fit(
        q=one,
        residual=np.zeros((2, 3)),
        free_q=free,
        free_residual=np.ones((2, 3)),
        kept_off=np.array([0.0, 1e-9]),
    )
    assert fit.suffers.tolist() == [False, True]
    np.testing.assert_array_equal(fit.judged_q, [one[0], free[1]])
    np.testing.assert_array_equal(fit.judged_residual, [[0.0] * 3, [1.0] * 3])


def test_whole_turns_are_taken_off() -> None:
    branches = Branches(subject=subject_of())
    turned = at((0.1, 0.5 + 2 * np.pi, 1.0 - 4 * np.pi), (0.6, 2.2, 1.0), (0.0, 2.0 + np.pi, -0.1))
    found = branches.nearest_to_limits(turned)
    np.testing.assert_allclose(found[0, :3], [0.1, 0.5, 1.0], atol=1e-9)
    np.testing.assert_allclose(found[1, :3], [0.6, 2.2, 1.0], atol=1e-9)
    # Beyond the limits the end that is nearer is chosen: 2 + pi is 1.14 below -1 + 2 pi, and pi above 2.
    np.testing.assert_allclose(found[2, :3], [0.0, 2.0 - np.pi, -0.1], atol=1e-9)
    assert branches.balls == ()


def test_a_planar_arm_is_bent_one_way_alone() -> None:
    assert find_flips(kinematics()) == ()


TWIST = """<robot name="twist"><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
  <joint name="twist" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
    <limit lower="-1.5" upper="1.5" effort="1" velocity="1"/></joint>
  <joint name="hinge" type="revolute"><parent link="b"/><child link="c"/><origin xyz="0 0 0.4" rpy="0 0.25 0"/>
    <axis xyz="0 1 0"/><limit lower="-0.1" upper="2.5" effort="1" velocity="1"/></joint>
  <joint name="end" type="fixed"><parent link="c"/><child link="d"/><origin xyz="0 0 0.3"/></joint></robot>"""


def test_a_limb_that_twists_is_bent_in_two_ways() -> None:
    """The lower segment stands at 0.25 from straight where the hinge is at zero: both bends add up to minus 0.5."""
    model = Robot(urdf=TWIST, free_flyer=False).model
    kinematics_ = Kinematics(model=model, points=tuple(body_points(("c", "d"))))
    (flip,) = find_flips(kinematics_)
    assert (flip.turn, flip.bend) == (0, 1)
    assert flip.total == pytest.approx(-0.5, abs=2 * np.pi / 720)
    q = np.array([[0.3, 0.9], [-1.0, 0.2]])
    other = flip.apply(q)
    np.testing.assert_allclose(other, np.stack([q[:, 0] + np.pi, flip.total - q[:, 1]], axis=1))
    apart = kinematics_.positions(other) - kinematics_.positions(q)
    assert np.abs(apart).max() < 0.3 * 2 * np.pi / 720
    np.testing.assert_array_equal(q, [[0.3, 0.9], [-1.0, 0.2]])


# --- contacts of reports ----------------------------------------------------------------------------------


@pytest.mark.parametrize("nearest", [False, True])
def test_a_report_lists_contacts_of_one_collider_or_of_one_each(nearest: bool) -> None:
    q = at((0.03, 0.0, 2.9), (0.03, 0.0, 0.0), (0.03, 0.0, 3.0))
    one = SelfCollision(subject=subject_of(), contact_margin=0.02)
    found = Report(
        judgements=[
            one.judge(q),
            replace(one.judge(q), check="balance", by_pairs=False, violated=np.zeros((3, 1), bool)),
        ],
        complete=np.ones(3, dtype=bool),
        q=q,
        fk_distance=np.zeros(3),
        colliders=(one,),
    )
    hit = np.flatnonzero(found.invalid).tolist()
    assert hit == [0, 2]
    alone, each = (replace(found, colliders=(one,) * n).contacts(nearest=nearest) for n in (1, 3))
    for contacts in (alone, each):
        assert sorted(set(contacts.posture.tolist())) == ([0, 1, 2] if nearest else hit)
        assert contacts.names == subject_of().pair_names
    for name in ("posture", "pair", "distance", "violated"):
        np.testing.assert_allclose(getattr(alone, name), getattr(each, name))
    some = found.contacts(nearest=np.array([False, True, False]))
    assert sorted(set(some.posture.tolist())) == [0, 1, 2]
    none = replace(found, colliders=()).contacts()
    assert isinstance(none, Contacts) and len(none) == 0


def test_contacts_are_sought_among_the_pairs_that_there_are() -> None:
    subject = subject_of()
    assert subject.geometry is not None
    margins = np.zeros(len(subject.pair_names))
    found = find_contacts(
        subject, subject.geometry, at((0, 0, 0)), np.array([0]), margins=margins, nearest=True
    )
    assert found.violated.tolist() == [False] and found.distance[0] > 0
    assert len(find_contacts(subject, subject.geometry, at((0, 0, 0)), np.array([0]), margins=margins)) == 0
    none = find_contacts(
        subject, subject.geometry, at((0, 0, 0)), np.array([], dtype=np.intp), margins=margins
    )
    assert len(none) == 0 and none.posture.dtype == none.pair.dtype == np.intp
    assert none.distance.dtype == np.float64 and none.violated.dtype == np.bool_


# --- what is asked --------------------------------------------------------------------------------------


def test_robots_are_asked_four_checks_in_one_order() -> None:
    usual = robot_settings(ValidateSettings())
    assert usual.check_names == ("reach", "rigid-parts", "joint-range", "collision")
    assert usual.lengths == "median" and usual.ranges == "urdf"
    asked = robot_settings(ValidateSettings(checks=("balance", "reach"), lengths="each", ranges="mine.toml"))
    assert (
        asked.check_names == ("reach", "balance") and asked.lengths == "each" and asked.ranges == "mine.toml"
    )
    assert check_robot_names(["collision", "joint-range"]) == ("joint-range", "collision")
    with pytest.raises(
        InputError, match=r"'walking' is not a check of robots \(walking is for the stick figure\)"
    ):
        check_robot_names(["walking"])
    with pytest.raises(
        InputError, match="'dance' is not a check of robots; expected some of reach, rigid-parts"
    ):
        check_robot_names(["reach", "dance"])


@pytest.mark.parametrize(("options", "name"), [
    ({"srdf": "a.srdf"}, "--srdf"), ({"package_dirs": ["meshes"]}, "--package-dir"),
])  # fmt: skip
def test_files_of_a_robot_are_no_options_of_what_needs_none(
    options: dict[str, Any], name: str, tmp_path: Path
) -> None:
    path = tmp_path / "figure.urdf"
    load_figure().write(path)
    for urdf, words in (
        (arm(), "the object that was given needs none; expected a robot's URDF with it"),
        (load_figure(), "the object that was given needs none"),
        ("stick_figure", "the built-in stick figure needs none"),
        (path, "a stick figure, whose SRDF is the file of its name beside it needs none"),
    ):
        assert load_subject(urdf) is not None
        with pytest.raises(InputError) as caught:
            load_subject(urdf, **options)
        assert str(caught.value).startswith(f"{name}: ") and words in str(caught.value)


@pytest.mark.parametrize("untrusted", [None, True, False])
def test_the_file_of_a_figure_is_trusted_where_that_is_said(
    untrusted: bool | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "figure.urdf"
    load_figure().write(path)
    probed: list[object] = []
    monkeypatch.setattr("posekit.body.loading.probe", lambda *given, **_: probed.append(given))
    load_subject(path, untrusted=untrusted)
    assert bool(probed) == (untrusted is not False)


@pytest.mark.parametrize(("rigid", "reach"), [(0.0, 0.001), (0.0009, 0.001), (0.002, 0.002), (None, 0.03)])
def test_no_fit_is_asked_to_be_nearer_than_a_millimetre(rigid: float | None, reach: float) -> None:
    assert reach_tolerance(ValidateSettings(rigid_tolerance=rigid)) == reach


def test_configurations_are_judged_by_what_is_asked() -> None:
    q = at((0.0, 0.5, 1.0), (0.0, 2.5, 1.0), (0.1, 0.0, 2.5))
    for checks in (("joint-range",), ("collision",), ("joint-range", "collision")):
        settings = robot_settings(ValidateSettings(checks=checks))
        verdict = RobotValidator(robot=arm(), settings=settings).judge_configurations(q)
        assert [one.check for one in verdict.judgements] == [name.replace("-", "_") for name in checks]
        assert verdict.complete.all() and verdict.residual.shape == (3, 0) and verdict.points == ()
        assert not verdict.q.flags.writeable
        np.testing.assert_allclose(verdict.q[:, :3], q[:, :3])
    with pytest.raises(
        InputError, match=r"reach, rigid-parts: a configuration's lengths are the model's own"
    ):
        RobotValidator(
            robot=arm(), settings=robot_settings(ValidateSettings(checks=("rigid-parts", "reach")))
        ).judge_configurations(q)


def test_what_was_judged_is_described() -> None:
    models = Models(robot=arm(), settings=robot_settings(ValidateSettings(checks=("collision",))))
    found = models.describe()
    assert found["robot"] == arm().name and found["checks"] == ["collision"] and found["figure"] == arm().hash
    assert found["bodies"] == "the URDF's collision bodies"
    assert found["pairs_from"] == "all but neighbours and what touches in the neutral posture"
    assert found["pairs"] == list(subject_of().pair_names) and "bodies_because" not in found
    limits = Models(robot=arm(), settings=robot_settings(ValidateSettings(checks=("joint-range",))))
    assert set(limits.describe()) == {"figure", "robot", "checks"}
    assert limits.own.subject.geometry is None and limits.own.kinematics is None
    with pytest.raises(InputError, match="no joint map; give one"):
        _ = limits.own.fitter
    with pytest.raises(InputError, match="visuals=True"):
        _ = Models(robot=arm(), settings=robot_settings(ValidateSettings(bodies="visual"))).own
