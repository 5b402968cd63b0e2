"""Intervals of distances and volumes: exact of one joint, never too narrow of several, against brute force."""

from __future__ import annotations

from functools import cache
from itertools import combinations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.geometry import rotation_from_vector
from posekit.linkages.robot_linkage import Carried
from posekit.robots import Robot
from posekit.tree import Findings
from posekit.validators.attainable import Attainable, six_volumes
from posekit.validators.axis_points import _axis_point, find_axis_points, place_axis_point
from posekit.validators.robot_limits import RobotLimits

# Two hinges askew and a slide, each link with three points that are not on one line.
FIXED = (("a", "0.1 0.02 0"), ("b", "0 0.1 0.05"))
LINKS = "".join(
    f'<link name="{name}"/>'
    + "".join(
        f'<link name="{name}_{end}"/><joint name="{name}_f{end}" type="fixed"><parent link="{name}"/>'
        f'<child link="{name}_{end}"/><origin xyz="{at}"/></joint>'
        for end, at in FIXED
    )
    for name in ("base", "first", "second", "cart")
)
JOINTS_XML = """
  <joint name="one" type="revolute"><parent link="base"/><child link="first"/><origin xyz="0 0 0.3" rpy="0.3 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-0.7" upper="1.9" effort="1" velocity="1"/></joint>
  <joint name="two" type="revolute"><parent link="first"/><child link="second"/><origin xyz="0.25 0 0" rpy="0 0.4 0"/>
    <axis xyz="0 1 0"/><limit lower="-1.2" upper="0.4" effort="1" velocity="1"/></joint>
  <joint name="three" type="prismatic"><parent link="second"/><child link="cart"/><origin xyz="0 0.1 0"/>
    <axis xyz="0.6 0 0.8"/><limit lower="-0.1" upper="0.3" effort="1" velocity="1"/></joint>
"""
NAMES = tuple(f"{link}{end}" for link in ("base", "first", "second", "cart") for end in ("", "_a", "_b"))


@cache
def robot() -> Robot:
    return Robot(urdf=f'<robot name="askew">{LINKS}{JOINTS_XML}</robot>', free_flyer=False)


@cache
def attainable() -> Attainable:
    return Attainable(robot=robot(), names=NAMES)


def places(q: np.ndarray) -> np.ndarray:
    return attainable().kinematics.positions(q)


def spread(joints: tuple[int, ...], count: int) -> np.ndarray:
    """Return configurations with some joints over a grid of their limits, others at zero."""
    axes = [np.linspace(*attainable().ranges[joint], count) for joint in joints]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(joints))
    return attainable().configurations(joints, grid)


def groups(size: int, joints: tuple[int, ...]) -> np.ndarray:
    moved, left = attainable().carried.sides
    found = [
        each
        for each in combinations(range(len(NAMES)), size)
        if tuple(np.flatnonzero(moved[:, each].any(axis=1) & left[:, each].any(axis=1)).tolist()) == joints
    ]
    return np.array(found[:: 1 if size == 2 else 2], dtype=np.intp)


def test_ranges_are_the_limits() -> None:
    assert attainable().ranges == {1: (-0.7, 1.9), 2: (-1.2, 0.4), 3: (-0.1, 0.3)}


@pytest.mark.parametrize("joint", [1, 2, 3])
def test_of_one_joint_the_range_is_exact(joint: int) -> None:
    at = places(spread((joint,), 4001))
    pairs, quads = groups(2, (joint,)), groups(4, (joint,))
    assert len(pairs) >= 5 and len(quads) >= 5
    low, high = attainable().distances((joint,), pairs)
    seen = np.linalg.norm(at[:, pairs[:, 0]] - at[:, pairs[:, 1]], axis=-1)
    np.testing.assert_allclose(low, seen.min(axis=0), atol=1e-6)
    np.testing.assert_allclose(high, seen.max(axis=0), atol=1e-6)
    assert (low <= seen.min(axis=0) + 1e-12).all() and (high >= seen.max(axis=0) - 1e-12).all()
    low, high = attainable().volumes((joint,), quads)
    volumes = six_volumes(at, quads)
    np.testing.assert_allclose(low, volumes.min(axis=0), atol=1e-7)
    np.testing.assert_allclose(high, volumes.max(axis=0), atol=1e-7)


@pytest.mark.parametrize(("joints", "slack"), [((1, 2), 1e-4), ((2, 3), 1e-4), ((1, 2, 3), 6e-3)])
def test_of_several_joints_nothing_within_the_limits_is_outside(
    joints: tuple[int, ...], slack: float
) -> None:
    at = places(spread(joints, 41))
    pairs = groups(2, joints)
    low, high = attainable().distances(joints, pairs)
    seen = np.linalg.norm(at[:, pairs[:, 0]] - at[:, pairs[:, 1]], axis=-1)
    assert (low <= seen.min(axis=0) + 1e-9).all() and (high >= seen.max(axis=0) - 1e-9).all()
    np.testing.assert_allclose(low, seen.min(axis=0), atol=slack + 2e-3)
    np.testing.assert_allclose(high, seen.max(axis=0), atol=slack + 2e-3)
    if len(joints) == 2:
        quads = groups(4, joints)[::8]
        low, high = attainable().volumes(joints, quads)
        volumes = six_volumes(at, quads)
        assert (low <= volumes.min(axis=0) + 1e-9).all() and (high >= volumes.max(axis=0) - 1e-9).all()
        np.testing.assert_allclose(low, volumes.min(axis=0), atol=1e-3)
        np.testing.assert_allclose(high, volumes.max(axis=0), atol=1e-3)


def test_beyond_the_grid_is_left_what_second_derivatives_allow() -> None:
    """Half of a bound of these times half the spacing squared: of distances, squared, 2 E² + 2 E², of volumes 9 E³."""
    joints, half = (1, 2), 2.6 / 511 / 2
    first, second = np.linspace(-0.7, 1.9, 512), np.linspace(-1.2, 0.4, 801)
    grid = np.stack(np.meshgrid(first, [-1.0, 0.0, 1.0], indexing="ij"), axis=-1).reshape(-1, 2)
    at = places(attainable().configurations(joints, grid))

    def of_last(values: np.ndarray) -> np.ndarray:
        """Follow the last joint as a circle through three of its angles: (512 * 801, T)."""
        waves, everywhere = (
            np.stack([np.ones_like(q), np.cos(q), np.sin(q)], axis=-1)
            for q in (np.array([-1.0, 0.0, 1.0]), second)
        )
        circles = np.linalg.solve(waves, values.reshape(512, 3, -1))
        return np.asarray(everywhere @ circles).reshape(512 * 801, -1)

    pairs, quads = groups(2, joints)[:3], groups(4, joints)[:40:8]
    E = attainable().extent(pairs)
    squared = of_last(np.linalg.norm(at[:, pairs[:, 0]] - at[:, pairs[:, 1]], axis=-1) ** 2)
    low, high = attainable().distances(joints, pairs)
    gap = 0.5 * 4 * E * E * half**2
    np.testing.assert_allclose(low**2, squared.min(axis=0) - gap, atol=1e-6)
    np.testing.assert_allclose(high**2, squared.max(axis=0) + gap, atol=1e-6)
    E = attainable().extent(quads)
    volumes = of_last(six_volumes(at, quads))
    low, high = attainable().volumes(joints, quads)
    gap = 0.5 * 9 * E**3 * half**2
    np.testing.assert_allclose(low, volumes.min(axis=0) - gap, atol=1e-6)
    np.testing.assert_allclose(high, volumes.max(axis=0) + gap, atol=1e-6)


def test_no_two_points_are_farther_apart_than_their_extent() -> None:
    """The way along the bodies, joints at their farthest: from the first link to the cart by hand."""
    at = places(spread((1, 2, 3), 15))
    for a, b in combinations(range(len(NAMES)), 2):
        assert (
            np.linalg.norm(at[:, a] - at[:, b], axis=-1).max()
            <= attainable().extent(np.array([[a, b]])) + 1e-12
        )
    ends = NAMES.index("first_a"), NAMES.index("cart_b")
    expected = np.hypot(0.1, 0.02) + 0.25 + 0.1 + 0.3 + np.hypot(0.1, 0.05)
    assert attainable().extent(np.array([ends, (0, 1)])) == pytest.approx(expected)


@given(points=st.lists(st.tuples(*[st.floats(-1, 1)] * 3), min_size=4, max_size=4))
def test_six_volumes_are_determinants(points: list[tuple[float, float, float]]) -> None:
    a, b, c, d = (np.array(point) for point in points)
    expected = np.linalg.det(np.stack([b - a, c - a, d - a]))
    found = six_volumes(np.array(points)[None], np.array([[0, 1, 2, 3]]))
    np.testing.assert_allclose(found, [[expected]], atol=1e-12)


def test_points_on_axes_are_where_rigid_bodies_place_them() -> None:
    """An arm's two hinges, of which only the first body shows three points."""
    names = ("base", "base_a", "base_b", "first", "first_a", "first_b", "cart")
    carried = Carried(model=robot().model, names=names)
    found = find_axis_points(carried)
    assert found
    q = spread((1, 2, 3), 4)
    shown = Attainable(robot=robot(), names=names).kinematics.positions(q)
    extra = tuple((point.body, point.place) for point in found)
    true = Attainable(robot=robot(), names=names, extra=extra).kinematics.positions(q)[:, len(names) :]
    points = shown
    rng = np.random.default_rng(0)
    for k, point in enumerate(found):
        placed = place_axis_point(points, point)
        np.testing.assert_allclose(placed, true[:, k], atol=1e-9)
        points = np.concatenate([points, placed[:, None]], axis=1)
        assert min(point.corners) >= 0 and max(point.corners) < len(names) + k
        # No small moves of the points that are seen move it by more than its looseness says.
        steps = rng.normal(size=shown.shape)
        moved = shown + 1e-6 * steps / np.linalg.norm(steps, axis=-1, keepdims=True)
        for one in found[:k]:
            moved = np.concatenate([moved, place_axis_point(moved, one)[:, None]], axis=1)
        off = np.linalg.norm(place_axis_point(moved, point) - true[:, k], axis=-1).max() / 1e-6
        assert 0.2 * point.looseness < off < point.looseness * 1.001
        column = {corner: 10 * corner for corner in point.corners}
        assert point.among(column).corners == tuple(10 * corner for corner in point.corners)
        assert point.among(column).numbers == point.numbers


@pytest.mark.parametrize("tolerance", [0.0, 0.01])
def test_checks_pass_what_is_within_the_limits_and_say_by_how_much_others_are_outside(
    tolerance: float,
) -> None:
    limits = RobotLimits(robot=robot(), names=NAMES)
    checks = limits.checks(NAMES, tolerance=tolerance)
    inside = places(spread((1, 2, 3), 6))
    outside = inside.copy()
    outside[:, NAMES.index("second_a")] += [0.0, 0.0, 0.2]
    rejected = np.zeros(len(inside), dtype=bool)
    for check in checks:
        assert check.unit == "m" and check.name in ("robot_limits", "rigid_body")
        found: Findings = check.judge(inside[:, list(check.points)])
        loose = np.broadcast_to(found.tolerance, found.value.shape)
        assert (found.margin >= -1e-9 - loose).all()
        assert (loose >= 2 * tolerance - 1e-12).all()
        rejected |= check.judge(outside[:, list(check.points)]).violated.any(axis=1)
    assert rejected.all()
    of_joints = {check.where[0] for check in checks if check.name == "robot_limits"}
    assert {"one", "two", "three", "one+two"} <= of_joints


def test_tolerances_may_differ_from_joint_to_joint() -> None:
    limits = RobotLimits(robot=robot(), names=NAMES)
    asked: list[list[int]] = []

    def off(joints: object) -> float:
        asked.append(sorted(joints))  # type: ignore[call-overload]
        return 0.001 * (1 + max(asked[-1]))

    for check in limits.checks(NAMES, tolerance=off):
        tolerance = np.asarray(check.tolerance)  # type: ignore[attr-defined]
        assert (tolerance >= 0.002).all() and (tolerance <= 0.001 * 12 * 400).all()
    assert asked and all(max(each) < len(NAMES) for each in asked)


def test_a_point_on_an_axis_is_as_far_off_as_corners_that_are_off_can_put_it(
    rng: np.random.Generator,
) -> None:
    """Its looseness, by moving corners: within it to first order, and not far within."""
    for loose in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 2.0, 0.5]):
        standing = np.array([[0.2, 0.0, 0.0], [0.5, 0.0, 0.0], [0.2, 0.3, 0.0], [0.3, 0.1, 0.4]])
        *corners, place = np.array(standing @ rotation_from_vector(rng.normal(size=3)))
        carried: Any = SimpleNamespace(place=np.array([corners]))
        found = _axis_point(carried, 0, place, (0, 1, 2), loose)
        alpha, beta, gamma = found.numbers
        way = rng.normal(size=(20000, 3, 3))
        way *= 1e-6 * np.array(loose)[:, None] / np.linalg.norm(way, axis=-1, keepdims=True)
        a, b, c = np.moveaxis(corners + way, 1, 0)
        put = a + alpha * (b - a) + beta * (c - a) + gamma * np.cross(b - a, c - a)
        off = np.linalg.norm(put - place, axis=1).max() / 1e-6
        assert 0.6 * found.looseness < off < found.looseness * (1 + 1e-4)
