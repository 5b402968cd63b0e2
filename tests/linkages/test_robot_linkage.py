"""The linkage of a robot: its lengths hold in every configuration, and it has all that do."""

from itertools import combinations

import numpy as np
import pinocchio as pin
import pytest

from posekit.errors import InputError
from posekit.linkages import span
from posekit.linkages.robot_linkage import Carried, linkage_of
from posekit.robots import Robot, load_robot

ROBOTS = ("panda", "ur5", "allegro", "solo12")


def frames_anywhere(robot, names, n, seed=0):
    """Place frames with Pinocchio in configurations that ignore the limits: (n, P, 3)."""
    rng = np.random.default_rng(seed)
    data = robot.model.createData()
    out = np.empty((n, len(names), 3))
    for k in range(n):
        q = pin.integrate(robot.model, pin.neutral(robot.model), rng.uniform(-3, 3, robot.model.nv))
        pin.framesForwardKinematics(robot.model, data, q)
        out[k] = [data.oMf[robot.model.getFrameId(name)].translation for name in names]
    return out


def urdf(joints, links=None):
    """Write a URDF of (name, type, parent, child, xyz, axis) rows."""
    names = links or sorted({link for row in joints for link in row[2:4]})
    text = "".join(f'<link name="{name}"/>' for name in names)
    for name, kind, parent, child, xyz, axis in joints:
        limit = "" if kind == "fixed" else '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
        text += (
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>{limit}</joint>'
        )
    return Robot(urdf=f'<robot name="made">{text}</robot>', name="made", with_geometry=False)


@pytest.mark.parametrize("name", ROBOTS)
def test_lengths_hold_in_every_configuration(name):
    robot = load_robot(name, geometry=False)
    linkage = linkage_of(robot)
    points = frames_anywhere(robot, linkage.points, 60)
    a, b = np.array(linkage.segments).T
    lengths = np.linalg.norm(points[:, a] - points[:, b], axis=-1)
    assert np.abs(lengths - linkage.lengths).max() < 1e-8
    assert linkage.unit == 1.0 and linkage.urdf == name


@pytest.mark.parametrize("name", ROBOTS)
def test_every_distance_that_holds_is_a_segment(name):
    robot = load_robot(name, geometry=False)
    linkage = linkage_of(robot)
    points = frames_anywhere(robot, linkage.points, 40, seed=1)
    rigid = {
        pair
        for pair in combinations(range(len(linkage.points)), 2)
        if np.ptp(np.linalg.norm(points[:, pair[0]] - points[:, pair[1]], axis=-1)) < 1e-7
    }
    assert rigid == {(min(ends), max(ends)) for ends in linkage.segments}


@pytest.mark.parametrize("name", ROBOTS)
def test_no_two_points_are_one(name):
    robot = load_robot(name, geometry=False)
    linkage = linkage_of(robot)
    points = frames_anywhere(robot, linkage.points, 5)
    a, b = np.triu_indices(len(linkage.points), 1)
    assert np.linalg.norm(points[:, a] - points[:, b], axis=-1).max(axis=0).min() > 1e-3


@pytest.mark.parametrize("name", ROBOTS)
def test_joints_between_are_those_that_change_the_shape(name):
    robot = load_robot(name, geometry=False)
    linkage = linkage_of(robot)
    carried = Carried(model=robot.model, names=linkage.points)
    rng = np.random.default_rng(2)
    data = robot.model.createData()
    base = pin.integrate(robot.model, pin.neutral(robot.model), rng.uniform(-1, 1, robot.model.nv))

    def distance(q, pair):
        pin.framesForwardKinematics(robot.model, data, q)
        a, b = (data.oMf[robot.model.getFrameId(linkage.points[point])].translation for point in pair)
        return np.linalg.norm(a - b)

    pairs = list(combinations(range(len(linkage.points)), 2))
    for pair in (pairs[k] for k in rng.permutation(len(pairs))[:12]):
        changing = []
        for joint in range(2, robot.model.njoints):
            dv = np.zeros(robot.model.nv)
            dv[robot.model.idx_vs[joint]] = 0.7
            turned = pin.integrate(robot.model, base, dv)
            if abs(distance(turned, pair) - distance(base, pair)) > 1e-9:
                changing.append(joint)
        assert set(changing) <= set(carried.joints_between(pair))


def test_coincident_origins_are_one_point_named_after_the_first():
    points = linkage_of(load_robot("panda", geometry=False)).points
    assert "panda_joint1" in points and "panda_joint2" not in points
    assert points[0] == "panda_link0" and points[-1] == "panda_hand_tcp"


def test_a_body_of_three_points_is_a_rigid_triangle():
    linkage = linkage_of(load_robot("panda", geometry=False))
    # panda_joint3's axis goes through the shoulder: shoulder, joint 3 and joint 4 move as one.
    triangle = {"panda_joint1-panda_joint3", "panda_joint3-panda_joint4", "panda_joint1-panda_joint4"}
    assert triangle <= set(linkage.segment_names)
    assert len(span(linkage).chords) == 2


def test_the_free_flyer_changes_nothing():
    floating, fixed = (load_robot("ur5", geometry=False, free_flyer=free) for free in (True, False))
    a, b = linkage_of(floating), linkage_of(fixed)
    assert a.points == b.points and a.segments == b.segments
    np.testing.assert_allclose(a.lengths, b.lengths, atol=1e-15)


def test_what_lies_beyond_a_slide_is_left_out():
    robot = urdf(
        [
            ("turn", "revolute", "base", "arm", "0 0 0.3", "0 1 0"),
            ("elbow", "revolute", "arm", "forearm", "0.4 0 0", "0 1 0"),
            ("slide", "prismatic", "forearm", "rod", "0.2 0 0", "1 0 0"),
            ("wrist", "revolute", "rod", "hand", "0.1 0 0", "0 1 0"),
        ]
    )
    linkage = linkage_of(robot)
    assert linkage.points == ("base", "turn", "elbow")
    np.testing.assert_allclose(linkage.lengths, [0.3, 0.4])


def test_ends_that_lie_away_are_points_and_others_are_not():
    robot = urdf(
        [
            ("turn", "revolute", "base", "arm", "0 0 0", "0 1 0"),
            ("elbow", "revolute", "arm", "forearm", "0.4 0 0", "0 1 0"),
            ("tip", "fixed", "forearm", "finger", "0.2 0 0", "1 0 0"),
            ("mark", "fixed", "forearm", "sticker", "0.001 0 0", "1 0 0"),
            ("camera", "fixed", "arm", "eye", "0.1 0.1 0", "1 0 0"),
        ]
    )
    # The base's origin is the first joint's, and the eye is on a link from which a joint leads further.
    assert linkage_of(robot).points == ("turn", "elbow", "finger")
    assert linkage_of(robot, points=("eye", "elbow", "finger", "turn")).points[0] == "eye"


def test_bad_requests_are_one_line():
    panda = load_robot("panda", geometry=False)
    with pytest.raises(InputError, match=r"no link or joint .*panda_join4.*did you mean panda_joint4"):
        linkage_of(panda, points=("panda_joint1", "panda_join4"))
    with pytest.raises(InputError, match="1 points"):
        linkage_of(panda, points=("panda_joint1",))
    with pytest.raises(InputError, match="falls into 2 parts"):
        linkage_of(panda, points=("panda_link0", "panda_joint1", "panda_joint5", "panda_joint7"))
    with pytest.raises(InputError, match="finite length above zero"):
        linkage_of(panda, points=("panda_joint1", "panda_joint2"))
    still = urdf([("weld", "fixed", "base", "top", "0 0 1", "1 0 0")])
    with pytest.raises(InputError, match="expected two or more joints that turn"):
        linkage_of(still)


def test_points_that_are_no_frames_are_refused_by_name():
    panda = load_robot("panda", geometry=False)
    with pytest.raises(InputError, match="no frame 'elbow'"):
        Carried(model=panda.model, names=("elbow",))
