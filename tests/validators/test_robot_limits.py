"""Limits of robots: what a configuration within them can do is never rejected, and what none can do is."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.errors import InputError
from posekit.linkages.robot_linkage import Carried, linkage_of
from posekit.robots import Robot, load_robot
from posekit.robots.kinematics import BodyPoint, BodySite, Kinematics, body_points
from posekit.validators.attainable import Attainable, six_volumes
from posekit.validators.axis_points import find_axis_points, place_axis_point
from posekit.validators.robot_limits import RobotLimits

EPSILON = 1e-7


def within_limits(robot, n, rng, corners=0.3):
    """Draw configurations within the limits, some joints exactly at one; the base anywhere."""
    space = Kinematics(model=robot.model, points=body_points(linkage_of(robot).points)).space
    q = np.tile(pin.neutral(robot.model), (n, 1))
    lower, upper = (np.clip(limit, -np.pi, np.pi) for limit in (space.lower, space.upper))
    for at in space.bounded_q:
        q[:, at] = rng.uniform(lower[at], upper[at], n)
        stuck = rng.random(n) < corners
        q[stuck, at] = np.where(rng.random(stuck.sum()) < 0.5, lower[at], upper[at])
    turned = rng.standard_normal((n, 4))
    q[:, 3:7] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    q[:, :3] = rng.uniform(-1, 1, (n, 3))
    return q


def rejected(checks, points):
    """Return which postures (N, P, 3) some check rejects."""
    dead = np.zeros(len(points), dtype=bool)
    for check in checks:
        dead |= check.judge(points[:, list(check.points)]).violated.any(axis=1)
    return dead


@pytest.fixture(scope="module")
def known():
    found = {}

    def of(name):
        if name not in found:
            robot = load_robot(name, geometry=False)
            names = linkage_of(robot).points
            found[name] = (robot, names, RobotLimits(robot=robot, names=names))
        return found[name]

    return of


@st.composite
def arms(draw):
    """Draw an arm of two to five joints, turning and sliding, with limits anywhere."""
    number = st.floats(-0.5, 0.5).map(lambda value: round(value, 3))
    count = draw(st.integers(2, 5))
    text = '<link name="l0"/>'
    for k in range(1, count + 1):
        kind = draw(st.sampled_from(["revolute", "revolute", "revolute", "continuous", "prismatic"]))
        axis = draw(st.sampled_from(["1 0 0", "0 1 0", "0 0 1", "0.6 0.8 0", "0 -0.6 0.8"]))
        xyz = [draw(number) for _ in range(3)]
        xyz[draw(st.integers(0, 2))] += 0.3
        rpy = [draw(number) for _ in range(3)]
        lower = draw(st.floats(-3, 1).map(lambda value: round(value, 2)))
        upper = lower + draw(st.floats(0, 7).map(lambda value: round(value, 2)))
        limit = (
            ""
            if kind == "continuous"
            else f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/>'
        )
        text += (
            f'<link name="l{k}"/><joint name="j{k}" type="{kind}"><parent link="l{k - 1}"/><child link="l{k}"/>'
            f'<origin xyz="{xyz[0]} {xyz[1]} {xyz[2]}" rpy="{rpy[0]} {rpy[1]} {rpy[2]}"/><axis xyz="{axis}"/>'
            f"{limit}</joint>"
        )
    text += f'<link name="tip"/><joint name="end" type="fixed"><parent link="l{count}"/><child link="tip"/>'
    text += '<origin xyz="0.1 0.2 0.05"/></joint>'
    return Robot(urdf=f'<robot name="drawn">{text}</robot>', name="drawn", with_geometry=False)


def configurations_of(robot, n, rng):
    """Draw configurations of a drawn arm within its limits, ends included."""
    model = robot.model
    q = np.tile(pin.neutral(model), (n, 1))
    for joint in range(2, model.njoints):
        at = model.idx_qs[joint]
        if model.nqs[joint] == 2:
            angle = rng.uniform(-np.pi, np.pi, n)
            q[:, at], q[:, at + 1] = np.cos(angle), np.sin(angle)
        else:
            lower, upper = model.lowerPositionLimit[at], model.upperPositionLimit[at]
            q[:, at] = rng.uniform(lower, upper, n)
            q[: n // 8, at], q[n // 8 : n // 4, at] = lower, upper
    return q


class TestLaws:
    @pytest.mark.parametrize("name", ["panda", "ur5", "allegro", "solo12"])
    def test_what_is_within_the_limits_is_never_rejected(self, known, name):
        robot, names, limits = known(name)
        q = within_limits(robot, 400, np.random.default_rng(0))
        points = Kinematics(model=robot.model, points=body_points(names)).positions(q)
        checks = limits.checks(names, tolerance=EPSILON)
        assert checks and not rejected(checks, points).any()

    @given(robot=arms(), seed=st.integers(0, 99))
    @settings(deadline=None, max_examples=25, derandomize=True)
    def test_nor_of_any_drawn_arm(self, robot, seed):
        names = (*(f"j{k}" for k in range(1, len(robot.joint_names))), "tip", "l0")
        q = configurations_of(robot, 200, np.random.default_rng(seed))
        points = Kinematics(model=robot.model, points=body_points(names)).positions(q)
        limits = RobotLimits(robot=robot, names=names)
        assert not rejected(limits.checks(names, tolerance=EPSILON), points).any()

    @given(robot=arms(), seed=st.integers(0, 99))
    @settings(deadline=None, max_examples=25, derandomize=True)
    def test_bounds_hold_and_those_of_one_joint_are_reached(self, robot, seed):
        names = (*(f"j{k}" for k in range(1, len(robot.joint_names))), "tip", "l0")
        attainable = Attainable(robot=robot, names=names)
        rng = np.random.default_rng(seed)
        q = configurations_of(robot, 400, rng)
        positions = Kinematics(model=robot.model, points=body_points(names)).positions(q)
        for size in (2, 4):
            for _ in range(4):
                if len(names) < size:
                    continue
                group = np.sort(rng.choice(len(names), size, replace=False))[None]
                joints = attainable.carried.joints_between(group[0])
                if len(joints) > {2: 3, 4: 2}[size]:
                    continue
                if size == 2:
                    low, high = attainable.distances(joints, group)
                    value = np.linalg.norm(positions[:, group[0, 0]] - positions[:, group[0, 1]], axis=1)
                else:
                    low, high = attainable.volumes(joints, group)
                    value = six_volumes(positions, group)[:, 0]
                assert (low - 1e-12 <= value).all() and (value <= high + 1e-12).all()
                if len(joints) == 1:
                    dense = configurations_of(robot, 4, rng)[:1].repeat(4001, axis=0)
                    at, model = robot.model.idx_qs[joints[0]], robot.model
                    sweep = np.linspace(*attainable.ranges[joints[0]], 4001)
                    if model.nqs[joints[0]] == 2:
                        dense[:, at], dense[:, at + 1] = np.cos(sweep), np.sin(sweep)
                    else:
                        dense[:, at] = sweep
                    swept = Kinematics(model=model, points=body_points(names)).positions(dense)
                    if size == 2:
                        value = np.linalg.norm(swept[:, group[0, 0]] - swept[:, group[0, 1]], axis=1)
                    else:
                        value = six_volumes(swept, group)[:, 0]
                    np.testing.assert_allclose([value.min(), value.max()], [low[0], high[0]], atol=1e-5)

    @pytest.mark.parametrize("name", ["panda", "allegro"])
    def test_moving_the_camera_changes_nothing(self, known, name):
        _, names, limits = known(name)
        rng = np.random.default_rng(3)
        points = rng.uniform(-0.3, 0.3, (50, len(names), 3))
        turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        for check in limits.checks(names, tolerance=EPSILON):
            here = check.judge(points[:, list(check.points)])
            there = check.judge((points @ turn.T + [1, 2, 3])[:, list(check.points)])
            np.testing.assert_allclose(here.value, there.value, atol=1e-9)

    def test_a_looser_tolerance_never_rejects_more(self, known):
        robot, names, limits = known("panda")
        rng = np.random.default_rng(4)
        q = within_limits(robot, 300, rng)
        points = Kinematics(model=robot.model, points=body_points(names)).positions(q)
        points += rng.normal(0, 0.01, points.shape)
        dead = [rejected(limits.checks(names, tolerance=t), points) for t in (0.0, 1e-3, 1e-2, 1e-1)]
        assert dead[0].sum() > dead[-1].sum()
        assert all((later <= earlier).all() for earlier, later in pairwise(dead))

    @pytest.mark.parametrize("name", ["panda", "ur5"])
    def test_points_on_axes_are_where_the_joints_have_them(self, known, name):
        robot, names, _ = known(name)
        carried = Carried(model=robot.model, names=names)
        axis_points = find_axis_points(carried)
        assert axis_points
        q = within_limits(robot, 50, np.random.default_rng(5))
        points = Kinematics(model=robot.model, points=body_points(names)).positions(q)
        for point in axis_points:
            placed = place_axis_point(points, point)
            joint = robot.model.names[point.body]
            site = BodySite(frame=joint, offset=tuple(point.place))
            known_body = joint in robot.frame_names and point.body > 1
            if known_body:
                truth = Kinematics(model=robot.model, points=(BodyPoint(name="p", sites=(site,)),)).positions(
                    q
                )
                np.testing.assert_allclose(placed, truth[:, 0], atol=1e-9)
            points = np.concatenate([points, placed[:, None]], axis=1)


class TestVerdicts:
    def elbow(self, known, angle):
        """Place a panda whose elbow alone is bent, to an angle that may be beyond its limits."""
        robot, names, _ = known("panda")
        q = pin.neutral(robot.model)[None].copy()
        q[0, robot.model.idx_qs[robot.model.getJointId("panda_joint4")]] = angle
        q[0, robot.model.idx_qs[robot.model.getJointId("panda_joint6")]] = 1.0
        return Kinematics(model=robot.model, points=body_points(names)).positions(q)

    @pytest.mark.parametrize(
        ("angle", "dead"), [(-0.0699, False), (-0.0690, True), (-3.0717, False), (-3.0730, True), (0.5, True)]
    )
    def test_an_elbow_at_its_limits(self, known, angle, dead):
        _, names, limits = known("panda")
        points = self.elbow(known, angle)
        found = [check for check in limits.checks(names, tolerance=EPSILON) if rejected([check], points)[0]]
        assert bool(found) is dead
        if dead:
            assert all(check.name == "robot_limits" for check in found)
            assert any(check.where[0] == "panda_joint4" for check in found)

    def test_a_hand_is_told_from_its_mirror_image(self, known):
        robot, names, limits = known("allegro")
        q = within_limits(robot, 40, np.random.default_rng(6))
        points = Kinematics(model=robot.model, points=body_points(names)).positions(q)
        rigid = [c for c in limits.checks(names, tolerance=EPSILON) if c.name == "rigid_body"]
        assert not rejected(rigid, points).any()
        assert rejected(rigid, points * [1, 1, -1]).all()

    def test_an_arm_with_symmetric_limits_is_not(self, known):
        robot, names, limits = known("panda")
        q = within_limits(robot, 40, np.random.default_rng(7))
        points = Kinematics(model=robot.model, points=body_points(names)).positions(q)
        assert not rejected(limits.checks(names, tolerance=EPSILON), points * [1, 1, -1]).any()

    def test_a_finger_that_leaves_its_plane_is_rejected(self, known):
        robot, names, limits = known("allegro")
        q = within_limits(robot, 20, np.random.default_rng(8), corners=0.0)
        q[:, robot.model.idx_qs[robot.model.getJointId("joint_2.0")]] = (
            0.8  # straight, it would have no plane
        )
        points = Kinematics(model=robot.model, points=body_points(names)).positions(q)
        a, b, tip = (names.index(name) for name in ("joint_2.0", "joint_3.0", "link_3.0_tip"))
        plane = np.cross(points[:, a] - points[:, names.index("joint_1.0")], points[:, b] - points[:, a])
        plane /= np.linalg.norm(plane, axis=1, keepdims=True)
        points[:, tip] += 0.005 * plane
        dead = rejected(limits.checks(names, tolerance=EPSILON), points)
        assert dead.all()

    def test_where_is_the_joint_and_the_value_lies_outside(self, known):
        _, names, limits = known("panda")
        points = self.elbow(known, 0.5)
        for check in limits.checks(names, tolerance=EPSILON):
            findings = check.judge(points[:, list(check.points)])
            assert len(check.where) == findings.value.shape[1]
            assert ((findings.margin < 0) | ~findings.violated).all()

    def test_unknown_points_are_undecided(self, known):
        _, names, limits = known("panda")
        points = self.elbow(known, -1.0)
        points[:, names.index("panda_joint5")] = np.nan
        checks = limits.checks(names, tolerance=EPSILON)
        assert not rejected(checks, points).any()
        asked = [check for check in checks if names.index("panda_joint5") in check.points]
        assert asked and all(check.judge(points[:, list(check.points)]).undecided.any() for check in asked)

    def test_checks_ask_only_for_points_of_the_tree(self, known):
        _, names, limits = known("panda")
        order = [name for name in names if name != "panda_joint4"]
        checks = limits.checks(order, tolerance=EPSILON)
        assert checks and max(max(check.points) for check in checks) < len(order)
        assert len(checks) < len(limits.checks(names, tolerance=EPSILON))

    def test_a_name_that_is_no_frame_is_refused(self):
        robot = load_robot("panda", geometry=False)
        with pytest.raises(InputError, match="no frame 'elbow'"):
            RobotLimits(robot=robot, names=("panda_joint1", "elbow"))


def test_a_share_is_of_the_widest_that_a_volume_could_be_but_of_a_thousandth_of_a_cube_at_least(known):
    robot, _, limits = known("ur5")
    floors = 0
    for each in limits.volumes:
        joints = tuple(robot.model.getJointId(name) for name in each.joints)
        free = float(limits._attainable.free(joints, np.array([each.points]))[0])
        widest = max(free, 0.001 * each.length**3)
        floors += widest > free
        low, high = np.clip(np.array([each.lower, each.upper]) * each.length**2, -widest, widest)
        assert each.share == pytest.approx((high - low) / (2 * widest), abs=1e-9)
        assert each.share < 0.999
    assert floors


@pytest.mark.parametrize(("name", "most"), [("ur5", 2), ("panda", 1)])
def test_intervals_are_of_points_with_few_joints_between(known, name, most):
    """At most three for a distance, two for a volume; of the second arm volumes over one alone are narrow enough."""
    _, _, limits = known(name)
    assert max(len(each.joints) for each in limits.distances) == 3
    assert max(len(each.joints) for each in limits.volumes) == most


def test_joints_that_hardly_turn_are_bounded_over_few_joints_all_the_same():
    """Three for a distance, two for a volume: over more, sums of intervals would be narrow, and many."""
    text = '<link name="l0"/>'
    for k, axis in enumerate(["1 0 0", "0 1 0", "0 0 1", "0.6 0.8 0", "0 -0.6 0.8", "1 0 0"], 1):
        text += (
            f'<link name="l{k}"/><joint name="j{k}" type="revolute"><parent link="l{k - 1}"/><child link="l{k}"/>'
            f'<origin xyz="0.{k} 0.3 -0.2" rpy="0.{k} 0.2 0"/><axis xyz="{axis}"/>'
            '<limit lower="-0.02" upper="0.02" effort="1" velocity="1"/></joint>'
        )
    robot = Robot(urdf=f'<robot name="stiff">{text}</robot>', name="stiff", with_geometry=False)
    limits = RobotLimits(robot=robot, names=tuple(f"j{k}" for k in range(1, 7)))
    assert {len(each.joints) for each in limits.distances} == {1, 2, 3}
    assert max(len(each.joints) for each in limits.volumes) == 2
