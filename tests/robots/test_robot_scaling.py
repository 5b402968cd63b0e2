"""Models with the lengths of a person: exact where the structure allows it, and said by how much where not."""

from __future__ import annotations

from functools import cache

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.robots import load_robot
from posekit.robots.ik import InverseKinematics
from posekit.robots.joint_map import load_joint_map, postures_of, targets_of
from posekit.robots.kinematics import BodyPoint, BodySite, Kinematics
from posekit.robots.scaling import model_lengths, scaled, segment_lengths
from posekit.robots.stretching import shoulders_are_behind
from posekit.robots.structure import LIMB_SEGMENTS
from posekit.skeleton import JOINT, JOINTS, SEGMENT_NAMES, segment_name
from posekit.synthesis import random_postures

MODELS = ("stick_figure", "human", "simple_humanoid", "g1", "talos")
LIMB_NAMES = tuple(segment_name((JOINT[a], JOINT[b])) for a, b in LIMB_SEGMENTS)
PERSON = {  # a plausible one, the two sides a little different
    "neck-right_shoulder": 0.19,
    "neck-left_shoulder": 0.195,
    "neck-pelvis": 0.45,
    "pelvis-right_hip": 0.14,
    "pelvis-left_hip": 0.135,
    "right_shoulder-right_elbow": 0.31,
    "left_shoulder-left_elbow": 0.305,
    "right_elbow-right_wrist": 0.25,
    "left_elbow-left_wrist": 0.255,
    "right_hip-right_knee": 0.42,
    "left_hip-left_knee": 0.425,
    "right_knee-right_ankle": 0.40,
    "left_knee-left_ankle": 0.395,
    "right_shoulder-left_shoulder": 0.375,
    "right_shoulder-pelvis": 0.46,
    "left_shoulder-pelvis": 0.465,
    "right_hip-left_hip": 0.21,
}


@cache
def mapped(name: str) -> Kinematics:
    return load_joint_map(name).kinematics(load_robot(name, geometry=False).model)


def person(seed: int) -> dict[str, float]:
    """Take lengths from a body that exists: a posture of the figure with its joints moved a little."""
    rng = np.random.default_rng(seed)
    points = load_figure().neutral_points[: len(JOINTS)] * rng.uniform(0.7, 1.3)
    return segment_lengths((points + rng.normal(0, 0.02, points.shape))[None])


@pytest.mark.parametrize("name", MODELS)
def test_a_person_s_lengths_are_met(name: str) -> None:
    result = scaled(mapped(name), PERSON)
    assert max(map(abs, result.residual.values())) < 1e-9
    assert set(result.residual) == set(SEGMENT_NAMES)
    for segment, length in PERSON.items():
        assert result.lengths[segment] == pytest.approx(length, abs=1e-9)


@settings(max_examples=10)
@given(st.integers(0, 2**32 - 1), st.sampled_from(MODELS))
def test_limbs_are_met_whatever_the_torso_is(seed: int, name: str) -> None:
    wanted = person(seed)
    rng = np.random.default_rng(seed)
    wanted["right_shoulder-left_shoulder"] *= rng.uniform(0.5, 2)  # no such torso need exist
    result = scaled(mapped(name), wanted)
    assert max(abs(result.residual[limb]) for limb in LIMB_NAMES) < 1e-9
    for segment, residual in result.residual.items():
        assert residual == pytest.approx(result.lengths[segment] - wanted[segment], abs=1e-12)


@pytest.mark.parametrize("name", MODELS)
def test_a_limb_keeps_its_ratio_in_every_configuration(name: str, rng: np.random.Generator) -> None:
    before = mapped(name)
    after = scaled(before, PERSON).kinematics
    q = np.array(
        [
            pin.integrate(before.model, pin.neutral(before.model), v)
            for v in rng.uniform(-1, 1, (5, before.model.nv))
        ]
    )
    places = [dict(zip(k.names, k.positions(q).transpose(1, 0, 2), strict=True)) for k in (before, after)]
    old = model_lengths(before)
    for start, end in LIMB_SEGMENTS:
        first, second = (np.linalg.norm(place[start] - place[end], axis=1) for place in places)
        limb = segment_name((JOINT[start], JOINT[end]))
        np.testing.assert_allclose(second / first, PERSON[limb] / old[limb], rtol=1e-9)


@pytest.mark.parametrize("name", MODELS)
def test_ball_joints_stay_ball_joints(name: str, rng: np.random.Generator) -> None:
    """What did not depend on the configuration does not after scaling: joints that met in one point still do."""
    before = mapped(name)
    after = scaled(before, PERSON).kinematics
    steps = rng.uniform(-1, 1, (8, before.model.nv))
    q = np.array([pin.integrate(before.model, pin.neutral(before.model), step) for step in steps])
    places = [dict(zip(k.names, k.positions(q).transpose(1, 0, 2), strict=True)) for k in (before, after)]
    for a in JOINTS:
        for b in JOINTS:
            first, second = (np.linalg.norm(place[a] - place[b], axis=1) for place in places)
            if np.ptp(first) < 1e-9:
                assert np.ptp(second) < 1e-9, (a, b)


@pytest.mark.parametrize("name", MODELS)
def test_equal_lengths_change_nothing(name: str) -> None:
    before = mapped(name)
    after = scaled(before, model_lengths(before)).kinematics
    for old, new in zip(before.model.jointPlacements, after.model.jointPlacements, strict=True):
        np.testing.assert_array_equal(old.homogeneous, new.homogeneous)
    assert after.points == before.points


def test_one_limb_alone_changes_one_limb_alone() -> None:
    before = mapped("human")
    after = scaled(before, {"left_hip-left_knee": 0.5}).kinematics
    moved = [
        before.model.names[j]
        for j in range(1, before.model.njoints)
        if not before.model.jointPlacements[j].isApprox(after.model.jointPlacements[j], 1e-12)
    ]
    assert moved == ["left_knee_Z"]


def test_masses_stay_and_the_given_model_is_untouched() -> None:
    before = mapped("human")
    placements = [placement.homogeneous.copy() for placement in before.model.jointPlacements]
    levers = [inertia.lever.copy() for inertia in before.model.inertias]
    result = scaled(before, PERSON)
    for old, new in zip(before.model.inertias, result.kinematics.model.inertias, strict=True):
        assert old.mass == new.mass
        np.testing.assert_array_equal(old.inertia, new.inertia)
    for old, placement in zip(placements, before.model.jointPlacements, strict=True):
        np.testing.assert_array_equal(old, placement.homogeneous)
    for lever, inertia in zip(levers, before.model.inertias, strict=True):
        np.testing.assert_array_equal(lever, inertia.lever)
    knee = before.model.getJointId("right_hip_Y")
    ratio = PERSON["right_hip-right_knee"] / model_lengths(before)["right_hip-right_knee"]
    np.testing.assert_allclose(result.kinematics.model.inertias[knee].lever, ratio * levers[knee])


def test_capsules_grow_with_their_limb() -> None:
    robot = load_robot("stick_figure")
    assert robot.geometry is not None
    kinematics = mapped("stick_figure")
    result = scaled(kinematics, PERSON, robot.geometry)
    assert result.geometry is not None
    old = {body.name: body for body in robot.geometry.geometryObjects}
    new = {body.name: body for body in result.geometry.geometryObjects}
    ratio = PERSON["right_shoulder-right_elbow"] / model_lengths(kinematics)["right_shoulder-right_elbow"]
    name = next(name for name in old if name.startswith("right_upper_arm"))
    assert isinstance(new[name].geometry, coal.Capsule)
    assert new[name].geometry.radius == pytest.approx(ratio * old[name].geometry.radius)
    assert new[name].geometry.halfLength == pytest.approx(ratio * old[name].geometry.halfLength)
    np.testing.assert_allclose(new[name].placement.translation, ratio * old[name].placement.translation)
    torso = next(name for name in old if name.startswith("torso"))
    along = PERSON["neck-pelvis"] / model_lengths(kinematics)["neck-pelvis"]
    across = (
        PERSON["right_shoulder-left_shoulder"] / model_lengths(kinematics)["right_shoulder-left_shoulder"]
    )
    assert new[torso].geometry.halfLength == pytest.approx(along * old[torso].geometry.halfLength)
    assert new[torso].geometry.radius == pytest.approx(across * old[torso].geometry.radius)
    # The pairs are still checked, by the same indices.
    assert len(result.geometry.collisionPairs) == len(robot.geometry.collisionPairs)
    data = result.geometry.createData()
    pin.computeCollisions(
        result.kinematics.model,
        result.kinematics.model.createData(),
        result.geometry,
        data,
        kinematics.neutral,
        False,
    )


def test_every_shape_grows() -> None:
    kinematics = mapped("stick_figure")
    model = kinematics.model
    joint = model.getJointId("right_elbow_flexion")
    vertices = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(4, 4)
    mesh.addVertices(vertices)
    mesh.addTriangles(np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype=np.uint64))
    mesh.endModel()
    shapes = {
        "box": coal.Box(0.1, 0.2, 0.3),
        "sphere": coal.Sphere(0.1),
        "cylinder": coal.Cylinder(0.1, 0.2),
        "cone": coal.Cone(0.1, 0.2),
        "ellipsoid": coal.Ellipsoid(0.1, 0.2, 0.3),
        "mesh": mesh,
    }
    geometry = pin.GeometryModel()
    for name, shape in shapes.items():
        geometry.addGeometryObject(pin.GeometryObject(name, joint, pin.SE3.Random(), shape))
    ratio = 2.0
    wanted = {"right_elbow-right_wrist": ratio * model_lengths(kinematics)["right_elbow-right_wrist"]}
    result = scaled(kinematics, wanted, geometry)
    assert result.geometry is not None
    new = {body.name: body for body in result.geometry.geometryObjects}
    for body in geometry.geometryObjects:
        np.testing.assert_allclose(new[body.name].placement.translation, ratio * body.placement.translation)
        np.testing.assert_allclose(new[body.name].placement.rotation, body.placement.rotation)
        np.testing.assert_allclose(new[body.name].meshScale, ratio * body.meshScale)
    np.testing.assert_allclose(new["box"].geometry.halfSide, [0.1, 0.2, 0.3])
    assert new["sphere"].geometry.radius == pytest.approx(0.2)
    assert new["cylinder"].geometry.radius == pytest.approx(0.2)
    assert new["cone"].geometry.halfLength == pytest.approx(0.2)
    np.testing.assert_allclose(new["ellipsoid"].geometry.radii, [0.2, 0.4, 0.6])
    np.testing.assert_allclose(new["mesh"].geometry.vertices(), ratio * vertices, atol=1e-12)
    assert new["mesh"].geometry.num_tris == 4
    np.testing.assert_allclose(mesh.vertices(), vertices)
    geometry.addGeometryObject(pin.GeometryObject("floor", joint, pin.SE3.Identity(), coal.Halfspace()))
    with pytest.raises(InputError, match="geometry 'floor' is a Halfspace"):
        scaled(kinematics, wanted, geometry)


def test_what_the_structure_does_not_allow_is_said() -> None:
    human = mapped("human")
    between = (BodySite(frame="right_upperarm"), BodySite(frame="left_upperarm"))
    points = tuple(
        BodyPoint(name="neck", sites=between) if point.name == "neck" else point for point in human.points
    )
    result = scaled(Kinematics(model=human.model, points=points), PERSON)
    # A neck that is the middle of the shoulders is half their distance from each.
    off = PERSON["right_shoulder-left_shoulder"] / 2 - PERSON["neck-right_shoulder"]
    assert result.residual["neck-right_shoulder"] == pytest.approx(off, abs=3e-3)
    assert max(abs(result.residual[limb]) for limb in LIMB_NAMES) < 1e-9


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("behind", [True, False])
def test_shoulders_lie_on_the_side_that_is_asked_for(name: str, behind: bool) -> None:
    result = scaled(mapped(name), PERSON, behind=behind)
    assert max(map(abs, result.residual.values())) < 1e-9
    kinematics = result.kinematics
    posture = postures_of(kinematics.positions(kinematics.neutral[None]), kinematics)[:, : len(JOINTS)]
    assert shoulders_are_behind(posture) == behind
    # Mirrored twice it is the same again.
    again = scaled(scaled(kinematics, {}, behind=not behind).kinematics, {}, behind=behind)
    places = [k.positions(kinematics.neutral[None]) for k in (kinematics, again.kinematics)]
    np.testing.assert_allclose(places[1], places[0], atol=1e-9)


def test_the_side_of_unseen_shoulders_is_not_known() -> None:
    assert shoulders_are_behind(np.full((2, len(JOINTS), 3), np.nan)) is None
    assert shoulders_are_behind(load_figure().neutral_points[None, : len(JOINTS)]) is False


def test_lengths_are_medians_of_what_is_seen() -> None:
    postures = np.tile(load_figure().neutral_points[: len(JOINTS)], (3, 1, 1))
    postures[0] *= 2
    postures[:, JOINT["left_wrist"]] = np.nan
    lengths = segment_lengths(postures)
    assert "left_elbow-left_wrist" not in lengths
    assert lengths["neck-pelvis"] == pytest.approx(load_figure().lengths["neck-pelvis"])


@pytest.mark.parametrize(
    ("lengths", "message"),
    [
        ({"neck-pelvi": 0.4}, "'neck-pelvi' is not a segment; did you mean neck-pelvis"),
        ({"pelvis-neck": 0.4}, "did you mean neck-pelvis"),
        ({"neck-pelvis": 0.0}, "neck-pelvis is 0 m; expected positive and finite"),
        ({"neck-pelvis": -1.0}, "expected positive and finite"),
        ({"neck-pelvis": float("nan")}, "expected positive and finite"),
        ({"neck-pelvis": 46.3}, "expected 0.05 to 20 times that; give metres"),
    ],
)
def test_impossible_lengths_are_refused(lengths: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        scaled(mapped("human"), lengths)


def test_postures_of_the_figure_are_followed_by_the_human() -> None:
    """From joint positions to configurations of another model: scale it, solve the sequence, look at what is left."""
    figure = load_figure()
    q = random_postures(figure, 3, np.random.default_rng(5))
    rest = pin.neutral(figure.model)
    frames = np.array(
        [pin.interpolate(figure.model, rest, end, 0.5 * t) for end in q for t in np.linspace(0, 1, 8)]
    )
    postures = figure.forward_kinematics(frames)[:, : len(JOINTS)]
    result = scaled(mapped("human"), segment_lengths(postures))
    assert max(map(abs, result.residual.values())) < 1e-9
    solver = InverseKinematics(kinematics=result.kinematics, tolerance=0.05)
    targets = targets_of(postures, result.kinematics)
    solution = solver.solve_sequence(targets, sequence=np.repeat([0, 1, 2], 8))
    # The human's spine bends in two places and its shoulders lift: it can do what the figure does.
    assert np.median(solution.residual) < 1e-5
    assert np.percentile(solution.residual, 95) < 0.002
    reached = postures_of(result.kinematics.positions(solution.q), result.kinematics)[:, : len(JOINTS)]
    np.testing.assert_allclose(np.linalg.norm(reached - postures, axis=2), solution.residual, atol=1e-9)
