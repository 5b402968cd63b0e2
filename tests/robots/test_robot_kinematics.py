"""Batched kinematics against Pinocchio's own, on published models and on small ones of every joint type."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.errors import InputError
from posekit.robots import load_robot
from posekit.robots.configuration_space import ConfigurationSpace
from posekit.robots.kinematics import BodyPoint, BodySite, Kinematics, body_points, frame_index

PUBLISHED = ("human", "simple_humanoid", "talos", "g1", "ur5", "panda", "allegro_left_hand", "icub", "tiago")
ROUNDING = 1e-10

MIXED = """<robot name="mixed"><link name="root"/><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
<link name="e"/><link name="tip"/>
<joint name="turn" type="continuous"><parent link="root"/><child link="a"/><origin xyz="0.1 0.2 0" rpy="0.3 0 1"/>
<axis xyz="0 1 0"/></joint>
<joint name="skew" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0 0.2 0.1"/>
<axis xyz="0 0.6 0.8"/></joint>
<joint name="slide" type="prismatic"><parent link="b"/><child link="c"/><origin rpy="0.5 0.2 0.1"/>
<axis xyz="1 0 0"/><limit lower="-0.5" upper="0.7" effort="1" velocity="1"/></joint>
<joint name="oblique" type="prismatic"><parent link="c"/><child link="d"/><axis xyz="0.6 0 0.8"/>
<limit lower="-0.5" upper="0.7" effort="1" velocity="1"/></joint>
<joint name="bend" type="revolute"><parent link="d"/><child link="e"/><origin xyz="0 0 0.3"/>
<axis xyz="0.48 0.6 0.64"/><limit lower="-1" upper="2" effort="1" velocity="1"/></joint>
<joint name="end" type="fixed"><parent link="e"/><child link="tip"/><origin xyz="0.1 0.2 0.3" rpy="1 0 0"/></joint>
</robot>"""


def model_of(name: str, *, free: bool = True) -> pin.Model:
    if name == "mixed":
        return (
            pin.buildModelFromXML(MIXED, pin.JointModelFreeFlyer()) if free else pin.buildModelFromXML(MIXED)
        )
    return load_robot(name, geometry=False, free_flyer=free).model


def random_configurations(
    model: pin.Model, n: int, rng: np.random.Generator, size: float = 2.0
) -> np.ndarray:
    """Step with Pinocchio itself: the oracle's own manifold."""
    return np.array(
        [pin.integrate(model, pin.neutral(model), v) for v in rng.uniform(-size, size, (n, model.nv))]
    )


@pytest.mark.parametrize("free", [True, False], ids=["free", "fixed"])
@pytest.mark.parametrize("name", [*PUBLISHED, "mixed"])
def test_positions_and_jacobians_are_those_of_pinocchio(
    name: str, free: bool, rng: np.random.Generator
) -> None:
    model = model_of(name, free=free)
    frames = frame_index(model)
    names = [*frames][:: max(1, len(frames) // 25)]
    chosen = rng.choice([*frames], 3, replace=False)
    mean = tuple(
        BodySite(frame=str(frame), offset=tuple(rng.normal(size=3)), weight=float(rng.uniform(0.2, 2)))
        for frame in chosen
    )
    points = (*body_points(names), BodyPoint(name="a mean", sites=mean))
    kinematics = Kinematics(model=model, points=points)
    q = random_configurations(model, 5, rng)
    placed = kinematics.placed(q)
    data = model.createData()
    for row in range(len(q)):
        pin.computeJointJacobians(model, data, q[row])
        pin.framesForwardKinematics(model, data, q[row])
        for index, point in enumerate(points):
            total = sum(site.weight for site in point.sites)
            where, moves = np.zeros(3), np.zeros((3, model.nv))
            for site in point.sites:
                frame = frames[site.frame]
                arm = data.oMf[frame].rotation @ site.offset
                jacobian = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
                where += site.weight / total * (data.oMf[frame].translation + arm)
                moves += site.weight / total * (jacobian[:3] - pin.skew(arm) @ jacobian[3:])
            np.testing.assert_allclose(placed.positions[row, index], where, atol=ROUNDING)
            np.testing.assert_allclose(placed.jacobians[row, index], moves, atol=ROUNDING)
    np.testing.assert_array_equal(kinematics.positions(q), placed.positions)


@pytest.mark.parametrize("name", [*PUBLISHED, "mixed"])
def test_steps_and_differences_are_those_of_pinocchio(name: str, rng: np.random.Generator) -> None:
    model = model_of(name)
    space = ConfigurationSpace(model)
    a, b = random_configurations(model, 20, rng), random_configurations(model, 20, rng)
    dv = rng.normal(size=(20, model.nv)) * 10.0 ** rng.uniform(-9, 0.3, (20, 1))
    there = np.array([pin.integrate(model, *pair) for pair in zip(a, dv, strict=True)])
    np.testing.assert_allclose(space.integrate(a, dv), there, atol=ROUNDING)
    steps = np.array([pin.difference(model, *pair) for pair in zip(a, b, strict=True)])
    np.testing.assert_allclose(space.difference(a, b), steps, atol=ROUNDING)


@given(st.floats(-9.0, 0.45), st.integers(0, 2**32 - 1))
def test_a_difference_is_the_step_that_was_taken(exponent: float, seed: int) -> None:
    model = model_of("mixed")
    space, rng = ConfigurationSpace(model), np.random.default_rng(seed)
    q = random_configurations(model, 4, rng)
    dv = rng.normal(size=(4, model.nv))
    # No turn reaches pi: beyond it the shorter way round is returned.
    dv *= 10.0**exponent / np.linalg.norm(dv, axis=1).max()
    np.testing.assert_allclose(space.difference(q, space.integrate(q, dv)), dv, atol=1e-9)
    back = space.integrate(space.integrate(q, dv), space.difference(space.integrate(q, dv), q))
    np.testing.assert_allclose(back, q, atol=1e-9)


def test_the_jacobian_is_the_derivative_along_a_step(rng: np.random.Generator) -> None:
    model = model_of("human")
    kinematics = Kinematics(model=model, points=body_points(["right_hand", "middle_head", "left_foot"]))
    q, dv, h = random_configurations(model, 3, rng), rng.normal(size=(3, model.nv)), 1e-6
    ahead = kinematics.positions(kinematics.space.integrate(q, h * dv))
    behind = kinematics.positions(kinematics.space.integrate(q, -h * dv))
    slope = np.einsum("npiv,nv->npi", kinematics.placed(q).jacobians, dv)
    np.testing.assert_allclose((ahead - behind) / (2 * h), slope, atol=1e-8)


def test_a_batch_is_its_rows(rng: np.random.Generator) -> None:
    model = model_of("human")
    kinematics = Kinematics(model=model, points=body_points(["right_hand", "left_foot"]))
    q = random_configurations(model, 600, rng)  # more than are worked on at once
    whole = kinematics.placed(q)
    for row in (0, 255, 256, 599):
        alone = kinematics.placed(q[row : row + 1])
        np.testing.assert_allclose(whole.positions[row], alone.positions[0], atol=1e-14)
        np.testing.assert_allclose(whole.jacobians[row], alone.jacobians[0], atol=1e-14)
    assert kinematics.placed(q[:0]).jacobians.shape == (0, 2, 3, model.nv)


def test_what_is_carried_can_be_seen_from_its_carrier(rng: np.random.Generator) -> None:
    model = model_of("human")
    carrier = model.getJointId("right_shoulder_Y")
    points = body_points(["right_lowerarm", "right_hand"])
    seen = Kinematics(model=model, points=points, carrier=carrier)
    q = random_configurations(model, 4, rng)
    world = Kinematics(model=model, points=points)
    rotation, origin = world.joint_placements(q, carrier)
    expected = np.einsum("nji,npj->npi", rotation, world.positions(q) - origin[:, None])
    np.testing.assert_allclose(seen.positions(q), expected, atol=1e-14)
    with pytest.raises(InputError, match="'left_hand' is not beyond joint 'right_shoulder_Y'"):
        Kinematics(model=model, points=body_points(["left_hand"]), carrier=carrier)


def test_what_moves_a_point() -> None:
    model = model_of("human")
    kinematics = Kinematics(model=model, points=body_points(["right_lowerarm", "right_hand"]))
    movers = {
        point: {model.names[j] for j in range(2, model.njoints) if kinematics.moved_by[k, model.idx_vs[j]]}
        for k, point in enumerate(kinematics.names)
    }
    # The forearm's twist turns the hand about itself; the shoulder's does not move the elbow.
    assert "right_elbow_Z" in movers["right_hand"] and "right_elbow_Y" not in movers["right_hand"]
    assert (
        "right_shoulder_Z" in movers["right_lowerarm"] and "right_shoulder_Y" not in movers["right_lowerarm"]
    )
    assert not any(name.startswith("left") for names in movers.values() for name in names)


@pytest.mark.parametrize(
    ("joint", "kind"),
    [
        (pin.JointModelPlanar(), "Planar"),
        (pin.JointModelSpherical(), "Spherical"),
        (pin.JointModelTranslation(), "T"),
    ],
)
def test_other_joints_are_refused(joint: pin.JointModel, kind: str) -> None:
    model = pin.Model()
    model.addJoint(0, joint, pin.SE3.Identity(), "odd")
    with pytest.raises(InputError, match=f"joint 'odd' is a {kind}"):
        ConfigurationSpace(model)


def test_a_mimic_joint_is_refused() -> None:
    text = MIXED.replace(
        '<axis xyz="0.48 0.6 0.64"/><limit', '<axis xyz="0.48 0.6 0.64"/><mimic joint="slide"/><limit'
    )
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer(), True)
    with pytest.raises(InputError, match="joint 'bend' is a Mimic"):
        ConfigurationSpace(model)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (body_points(["right_hnd"]), "no frame 'right_hnd'; the nearest are right_hand"),
        ((), "no points were given"),
        (body_points(["right_hand", "right_hand"]), "'right_hand' is given twice"),
        ((BodyPoint(name="x", sites=()),), "'x' has no frame"),
        (
            (BodyPoint(name="x", sites=(BodySite(frame="right_hand", offset=(np.nan, 0, 0)),)),),
            "three finite numbers",
        ),
        ((BodyPoint(name="x", sites=(BodySite(frame="right_hand", weight=-1.0),)),), "positive and finite"),
        ((BodyPoint(name="x", sites=(BodySite(frame="right_hand", weight=np.nan),)),), "positive and finite"),
    ],
)
def test_impossible_points_are_refused(points: tuple[BodyPoint, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Kinematics(model=model_of("human"), points=points)


@pytest.mark.parametrize("place", [3, 7, 9])
@pytest.mark.parametrize("value", [np.nan, np.inf, 7.0])
def test_unsound_configurations_are_refused(place: int, value: float) -> None:
    model = model_of("mixed")
    kinematics = Kinematics(model=model, points=body_points(["tip"]))
    q = np.tile(pin.neutral(model), (3, 1))
    q[1, place] = value
    with pytest.raises(InputError, match="configuration 1"):
        kinematics.positions(q)
    with pytest.raises(InputError, match="expected \\(N, "):
        kinematics.positions(q[0])
