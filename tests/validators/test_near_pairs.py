"""Pairs that are far apart are not asked, nor the distance of meshes that cross: what is found is the same."""

from functools import lru_cache
from unittest import mock

import coal
import numpy as np
import pinocchio as pin
import pytest

from posekit.robots import load_robot
from posekit.validators import Validator
from posekit.validators.robot import contacts
from posekit.validators.robot.collision import SelfCollision
from posekit.validators.robot.contacts import Contacts, find_contacts
from posekit.validators.robot.near_pairs import NearPairs

ROBOTS = ("ur5", "human")


@lru_cache
def collider(name: str, margin: float = 0.0) -> SelfCollision:
    validator = Validator(name, checks=("collision",), contact_margin=margin)
    return validator.check(q=pin.neutral(load_robot(name).model)[None]).colliders[0]


@lru_cache
def some_q(name: str, count: int = 150, away: float = 0.0) -> np.ndarray:
    robot = load_robot(name)
    rng = np.random.default_rng(3)
    q = np.tile(pin.neutral(robot.model), (count, 1))
    first = 7 if robot.model.joints[1].shortname() == "JointModelFreeFlyer" else 0
    q[:, first:] = rng.uniform(robot.lower[first:], robot.upper[first:], (count, q.shape[1] - first))
    q[:, :first][:, :3] = away * rng.normal(size=(count, min(first, 3)))
    return q


def near_pairs(judge: SelfCollision) -> NearPairs:
    assert judge.subject.geometry is not None
    return NearPairs(judge.subject.model, judge.subject.geometry, judge.margins)


def all_asked(judge: SelfCollision, q: np.ndarray) -> Contacts:
    subject = judge.subject
    assert subject.geometry is not None
    return find_contacts(subject, subject.geometry, q, np.arange(len(q)), margins=judge.margins)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("away", [0.0, 1e6])
def test_what_touches_is_near(name: str, away: float) -> None:
    judge, q = collider(name, 0.02), some_q(name, away=away)
    found = all_asked(judge, q)
    near = near_pairs(judge).of(q)
    assert near.shape == (len(q), len(judge.subject.pair_names))
    assert len(found) > 50
    assert near[found.posture, found.pair].all()
    assert near.mean() < (0.6 if name == "ur5" else 0.4)


def test_it_is_the_same_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    near, q = near_pairs(collider("human")), some_q("human")
    whole = near.of(q)
    monkeypatch.setattr("posekit.validators.robot.near_pairs.ROWS_AT_ONCE", 7)
    assert np.array_equal(near.of(q), whole)
    assert near.of(q[:0]).shape == (0, whole.shape[1])


@pytest.mark.parametrize("margin", [0.0, 0.03])
def test_contacts_of_meshes_are_those_of_asking_everything(margin: float) -> None:
    judge, q = collider("ur5", margin), some_q("ur5")
    assert judge.has_meshes
    expected = all_asked(judge, q)
    asked: list[int] = []

    def measure(geometry: pin.GeometryModel, data: pin.GeometryData, pair: int) -> object:
        asked.append(pair)
        return pin.computeDistance(geometry, data, pair)

    # Pinocchio's own functions stay as they are: the module's are counted.
    counted = mock.Mock(wraps=pin, computeDistance=measure)
    with mock.patch.object(contacts, "pin", counted):
        found = judge.contacts(q, np.arange(len(q)))
    for name in ("posture", "pair", "distance", "violated"):
        assert getattr(found, name).tobytes() == getattr(expected, name).tobytes(), name
    assert (len(asked) < len(found)) == (margin == 0)  # coal stops at the margin, before they cross
    assert (found.distance > 0).any() == (margin > 0)
    assert (found.distance < 0).any()


def test_bodies_without_end_are_always_asked() -> None:
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    geometry = pin.GeometryModel()
    for name, parent, shape in (("ball", joint, coal.Sphere(0.1)), ("floor", 0, coal.Halfspace(0, 0, 1, 0))):
        geometry.addGeometryObject(pin.GeometryObject(name, parent, pin.SE3.Identity(), shape))
    geometry.addGeometryObject(pin.GeometryObject("other", 0, pin.SE3.Identity(), coal.Sphere(0.1)))
    geometry.addCollisionPair(pin.CollisionPair(0, 1))
    geometry.addCollisionPair(pin.CollisionPair(0, 2))
    q = np.array([[0.0], [0.19], [9.0], [np.nan]])
    assert NearPairs(model, geometry, np.zeros(2)).of(q).tolist() == [
        [True, True],
        [True, True],
        [True, False],
        [True, True],
    ]


def test_joints_of_other_kinds_have_every_pair_asked() -> None:
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    geometry = pin.GeometryModel()
    for name, parent, x in (("a", joint, 0.0), ("b", 0, 9.0)):
        placement = pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))
        geometry.addGeometryObject(pin.GeometryObject(name, parent, placement, coal.Sphere(0.1)))
    geometry.addCollisionPair(pin.CollisionPair(0, 1))
    assert NearPairs(model, geometry, np.zeros(1)).of(np.zeros((3, 4))).all()
