"""The checks of a robot's configurations, each against another way to calculate the same."""

import re
from dataclasses import replace
from functools import cache
from itertools import pairwise

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.robots import Robot, load_robot
from posekit.skeleton import DOFS
from posekit.synthesis import random_postures
from posekit.validators import Judgement, Report, Validator
from posekit.validators.robot.balance import convex_hull, inside_hull
from posekit.validators.robot.feet import find_soles
from posekit.validators.robot.made_up import fitted_capsules

FIGURE = load_figure()

SLIDER = """<robot name="slider">
  <link name="rail"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <link name="cart"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <link name="arm"><collision><origin xyz="0 0 0.3"/><geometry><sphere radius="0.05"/></geometry></collision></link>
  <joint name="slide" type="prismatic"><parent link="rail"/><child link="cart"/><origin xyz="1 0 0"/>
    <axis xyz="1 0 0"/><limit lower="-0.5" upper="0.25" effort="1" velocity="1"/></joint>
  <joint name="turn" type="revolute"><parent link="cart"/><child link="arm"/>
    <axis xyz="0 1 0"/><limit lower="-3.2" upper="1.0" effort="1" velocity="1"/></joint>
</robot>"""


@cache
def robot(name: str) -> Robot:
    return Robot(urdf=SLIDER, free_flyer=False) if name == "slider" else load_robot(name)


def random_q(name: str, count: int, seed: int, beyond: float = 0.0) -> np.ndarray:
    model = robot(name).model
    q = np.tile(pin.neutral(model), (count, 1))
    first = 7 if robot(name).free_flyer else 0
    lower, upper = robot(name).lower[first:], robot(name).upper[first:]
    q[:, first:] = np.random.default_rng(seed).uniform(lower - beyond, upper + beyond, (count, len(lower)))
    return q


def of(report: Report, check: str) -> Judgement:
    return next(one for one in report.judgements if one.check == check)


# --- limits ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["human", "talos", "slider"])
def test_limits_are_those_of_pinocchios_model(name: str) -> None:
    q = random_q(name, 500, 1, beyond=0.01)
    report = Validator(robot(name), checks=("joint-range",)).check(q=q)
    model = robot(name).model
    outside = (q < model.lowerPositionLimit - 1e-3) | (q > model.upperPositionLimit + 1e-3)
    near = (np.abs(q - model.lowerPositionLimit) < 1e-3) | (np.abs(q - model.upperPositionLimit) < 1e-3)
    sure = ~near.any(axis=1)
    np.testing.assert_array_equal(report.invalid[sure], outside.any(axis=1)[sure])
    assert 0.01 < report.invalid.mean() < 0.9
    assert report.undecided.sum() == 0


def test_margins_are_degrees_where_joints_turn_and_metres_where_they_slide() -> None:
    q = np.array([[0.30, 0.5], [0.20, -3.3], [0.25, 1.0], [-0.50, 0.0]])
    report = Validator(robot("slider"), checks=("joint-range",)).check(q=q)
    limits = of(report, "joint_range")
    assert limits.where == ("slide", "turn")
    assert limits.unit == ("m", "deg")
    np.testing.assert_allclose(limits.margin[:, 0], [-0.05, 0.05, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(limits.margin[:, 1], np.degrees([0.5, -0.1, 0.0, 1.0]), atol=1e-9)
    assert report.verdicts == ["invalid", "invalid", "valid", "valid"]
    # A centimetre counts as one degree.
    np.testing.assert_allclose(report.worst, [-5.0, np.degrees(-0.1), 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize(("beyond", "verdict"), [(0.0009, "valid"), (0.0011, "invalid"), (-1.0, "valid")])
def test_the_tolerance_of_a_limit_is_a_thousandth_of_a_degree(beyond: float, verdict: str) -> None:
    q = np.array([[0.0, np.radians(np.degrees(1.0) + beyond)]])
    assert Validator(robot("slider"), checks=("joint-range",)).check(q=q).verdicts == [verdict]
    q = np.array([[0.25 + 0.01 * beyond, 0.0]])
    assert Validator(robot("slider"), checks=("joint-range",)).check(q=q).verdicts == [verdict]


def test_a_figures_configurations_are_judged_under_its_own_names() -> None:
    q = random_postures(FIGURE, 100, np.random.default_rng(2))
    report = Validator(ranges="urdf").check(q=q)
    assert report.verdicts == ["valid"] * 100
    assert set(of(report, "joint_range").where) == set(DOFS)
    q[0, FIGURE.configuration_names.index("pelvis_flexion")] = np.radians(100)
    report = Validator(ranges="urdf").check(q=q)
    assert report.verdicts[:2] == ["invalid", "valid"]
    k = of(report, "joint_range").where.index("pelvis.flexion")
    assert of(report, "joint_range").value[0, k] == pytest.approx(100.0)


def test_a_figures_q_and_its_joints_get_the_same_verdicts() -> None:
    """Where the joints are rejected q is; q may also be another branch of a legal posture."""
    q = random_q("stick_figure", 300, 3, beyond=0.05)
    points = FIGURE.forward_kinematics(q)
    of_q = Validator().check(q=q)
    of_points = Validator().check(points[:, :14], points[:, 14:])
    np.testing.assert_array_equal(
        of(of_q, "collision").violated.any(axis=1), of(of_points, "collision").violated.any(axis=1)
    )
    rejected_q, rejected = (of(one, "joint_range").violated.any(axis=1) for one in (of_q, of_points))
    assert not (rejected & ~rejected_q).any()
    assert rejected.any()


# --- collision ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "count"), [("stick_figure", 400), ("talos", 40)])
def test_collisions_are_pinocchios_one_by_one(name: str, count: int) -> None:
    q = random_q(name, count, 4)
    report = Validator(robot(name), checks=("collision",)).check(q=q)
    model, geometry = robot(name).model, robot(name).geometry
    assert geometry is not None
    data, geometry_data = model.createData(), geometry.createData()
    contacts = report.contacts()
    for row in range(count):
        pin.computeCollisions(model, data, geometry, geometry_data, q[row], False)
        hits = [k for k, result in enumerate(geometry_data.collisionResults) if result.isCollision()]
        assert bool(hits) == report.invalid[row]
        assert contacts.pair[contacts.posture == row].tolist() == hits
    assert 0.05 < report.invalid.mean() < 0.95
    assert contacts.violated.all()
    assert (contacts.distance <= 1e-9).all()


def test_the_nearest_pair_is_measured_where_it_is_wanted() -> None:
    q = random_q("stick_figure", 60, 5)
    report = Validator(robot("stick_figure"), checks=("collision",)).check(q=q)
    contacts = report.contacts(nearest=True)
    model, geometry = FIGURE.model, FIGURE.geometry
    data, geometry_data = model.createData(), geometry.createData()
    free = np.flatnonzero(report.valid)
    assert set(contacts.posture[~contacts.violated].tolist()) == set(free.tolist())
    for row, distance in zip(contacts.posture, contacts.distance, strict=True):
        pin.computeDistances(model, data, geometry, geometry_data, q[row])
        least = min(result.min_distance for result in geometry_data.distanceResults)
        mine = contacts.distance[contacts.posture == row].min()
        assert mine == pytest.approx(least, abs=1e-9)
        assert distance >= mine


@pytest.mark.parametrize("name", ["stick_figure", "human"])
def test_a_larger_margin_never_accepts_more(name: str) -> None:
    q = random_q(name, 300, 6)
    rejected = [
        Validator(robot(name), checks=("collision",), contact_margin=margin).check(q=q).invalid
        for margin in (-0.02, 0.0, 0.02, 0.1)
    ]
    for smaller, larger in pairwise(rejected):
        assert not (smaller & ~larger).any()
        assert larger.sum() > smaller.sum()


def test_meshes_have_no_depth_to_allow() -> None:
    with pytest.raises(InputError, match=r"--contact-margin -0.01 m: the pair .* has a mesh"):
        Validator(robot("talos"), contact_margin=-0.01).check(q=random_q("talos", 1, 0))


def test_a_robot_without_two_bodies_gets_capsules_or_is_refused() -> None:
    assert not robot("human").collision_pairs
    settings = Validator(robot("human")).describe()
    assert settings["bodies"].startswith("made up")
    assert len(settings["pairs"]) >= 30
    with pytest.raises(InputError, match="--bodies urdf: no pair of bodies can collide"):
        Validator(robot("human"), bodies="urdf").check(q=random_q("human", 1, 0))


# --- bodies that are made up ----------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["human", "talos", "g1"])
def test_capsules_lie_on_the_segments_at_neutral(name: str) -> None:
    validator = Validator(load_robot(name, geometry=False), bodies="capsules")
    kinematics = validator._robot.models.kinematics
    geometry, model = fitted_capsules(kinematics), kinematics.model
    place = dict(zip(kinematics.names, kinematics.positions(kinematics.neutral[None])[0], strict=True))
    data, geometry_data = model.createData(), geometry.createData()
    pin.updateGeometryPlacements(model, data, geometry, geometry_data, pin.neutral(model))
    by_name = {body.name: k for k, body in enumerate(geometry.geometryObjects)}
    for side in ("right", "left"):
        k = by_name[f"{side}_shank"]
        capsule, oMg = geometry.geometryObjects[k].geometry, geometry_data.oMg[k]
        assert isinstance(capsule, coal.Capsule)
        knee, ankle = place[f"{side}_knee"], place[f"{side}_ankle"]
        length = float(np.linalg.norm(ankle - knee))
        assert capsule.radius == pytest.approx(0.032 / 0.37 * length)  # the stick figure's, in proportion
        axis = oMg.rotation[:, 2]
        along = (ankle - knee) / length
        assert abs(axis @ along) == pytest.approx(1.0)
        off = oMg.translation - knee
        assert np.linalg.norm(off - (off @ along) * along) < 1e-9
        assert 2 * capsule.halfLength < length
    assert not pin.computeCollisions(model, data, geometry, geometry.createData(), pin.neutral(model), True)
    checked = {frozenset(FIGURE.capsules[k].link for k in pair) for pair in FIGURE.collision_pairs}
    names = [re.sub(r"_\d+$", "", body.name) for body in geometry.geometryObjects]
    pairs = [frozenset((names[pair.first], names[pair.second])) for pair in geometry.collisionPairs]
    assert set(pairs) <= checked and len(pairs) > len(checked) / 2


def test_capsules_move_with_their_segments() -> None:
    validator = Validator(robot("human"), checks=("collision",))
    q = random_q("human", 30, 7)
    kinematics = validator._robot.models.kinematics
    geometry, model = fitted_capsules(kinematics), kinematics.model
    data, geometry_data = model.createData(), geometry.createData()
    column = {name: k for k, name in enumerate(kinematics.names)}
    points = kinematics.positions(q)
    k = [body.name for body in geometry.geometryObjects].index("left_forearm")
    for row in range(len(q)):
        pin.updateGeometryPlacements(model, data, geometry, geometry_data, q[row])
        elbow, wrist = (points[row, column[f"left_{joint}"]] for joint in ("elbow", "wrist"))
        middle = geometry_data.oMg[k].translation
        t = (middle - elbow) @ (wrist - elbow) / ((wrist - elbow) @ (wrist - elbow))
        assert 0.3 < t < 0.7
        assert np.linalg.norm(elbow + t * (wrist - elbow) - middle) < 1e-9


# --- balance --------------------------------------------------------------------------------------------


@given(seed=st.integers(0, 10_000), count=st.integers(3, 12))
def test_the_hull_is_scipys_and_the_margin_is_the_distance_to_its_edge(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    points, place = rng.normal(size=(count, 2)), rng.normal(size=2)
    oracle = ConvexHull(points)
    assert len(convex_hull(points)) == len(oracle.vertices)
    slack = oracle.equations[:, :2] @ place + oracle.equations[:, 2]
    inside = inside_hull(points, place)
    if slack.max() < 0:
        assert inside == pytest.approx(-slack.max())
    else:
        assert inside <= 0
        assert inside <= -slack.max() + 1e-12


def standing(name: str) -> np.ndarray:
    return np.asarray(pin.neutral(robot(name).model))[None]


def test_a_person_stands_until_the_centre_of_mass_leaves_the_feet() -> None:
    validator = Validator(robot("human"), checks=("balance",), up=(0.0, 1.0, 0.0))
    q = np.repeat(standing("human"), 3, axis=0)
    names = robot("human").configuration_names
    q[1, names.index("middle_lumbar_Z")] = np.radians(-80)
    q[1, names.index("right_hip_Z")] = q[1, names.index("left_hip_Z")] = 0.0
    q[2, names.index("left_hip_Z")] = np.radians(90)  # on the right foot alone
    report = validator.check(q=q)
    margin = of(report, "balance").margin[:, 0]
    assert report.verdicts == ["valid", "invalid", "invalid"]
    assert margin[0] > 0.02
    assert margin[1] < 0


def test_balance_is_undecided_without_masses_or_feet() -> None:
    person = robot("stick_figure")
    weightless = replace(person, urdf=re.sub(r"(?s)<inertial>.*?</inertial>", "", person.urdf))
    for weighed, verdict in ((person, "valid"), (weightless, "undecided")):
        report = Validator(weighed, checks=("balance",)).check(q=standing("stick_figure"))
        assert report.verdicts == [verdict]
    assert Validator(robot("slider"), checks=("balance",)).check(q=standing("slider")).verdicts == [
        "undecided"
    ]


def test_soles_are_the_robots_own_where_it_has_some() -> None:
    own = Validator(robot("talos"), checks=("balance",))
    q = standing("talos")
    assert own.check(q=q).verdicts == ["valid"]
    kinematics = own._robot.models.kinematics
    assert len(find_soles(kinematics, robot("talos").geometry)) > 8
    assert len(find_soles(kinematics, None)) == 8


def test_soles_are_made_as_a_persons_that_stands() -> None:
    """Forward is across hips and shanks: a quarter of the foot behind the ankle, symmetric about it."""
    for name in ("human", "talos"):
        kinematics = Validator(robot(name), checks=("balance",))._robot.models.kinematics
        data = kinematics.model.createData()
        pin.forwardKinematics(kinematics.model, data, pin.neutral(kinematics.model))
        at = dict(zip(kinematics.names, kinematics.positions(kinematics.neutral[None])[0], strict=True))
        places = np.array(
            [data.oMi[corner.joint].act(corner.place) for corner in find_soles(kinematics, None)]
        )
        for side, sole in zip(("right", "left"), places.reshape(2, 4, 3), strict=True):
            hip, knee, ankle = (at[f"{side}_{part}"] for part in ("hip", "knee", "ankle"))
            stature = (np.linalg.norm(hip - knee) + np.linalg.norm(knee - ankle)) / 0.491
            up = (knee - ankle) / np.linalg.norm(knee - ankle)
            forward = np.cross(at["left_hip"] - at["right_hip"], up)
            forward /= np.linalg.norm(forward)
            frame = (sole - ankle) @ np.stack([forward, np.cross(up, forward), up], axis=1) / stature
            heel, toe = -0.25 * 0.152, 0.75 * 0.152
            half = 0.055 / 2
            assert sorted(frame.round(9).tolist()) == pytest.approx(
                np.array(sorted([x, y, -0.039] for x in (heel, toe) for y in (-half, half)))
            )
