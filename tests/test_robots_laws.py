"""Laws of robots: links stand where another reader of URDFs puts them, whatever kind of joint a joint follows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy

import posekit
from posekit.errors import InputError
from posekit.robots import Robot, load_robot
from posekit.skeleton import JOINTS
from tests.test_robots import LIMIT, configurations, joint, link, text


def following(of: str, factor: float, offset: float) -> str:
    return f'{LIMIT}<mimic joint="{of}" multiplier="{factor}" offset="{offset}"/>'


FOLLOWERS = text(
    *map(link, "abcdefgh"),
    joint("hinge", "a", "b"),
    joint("turn", "b", "c", "continuous", ""),
    joint("slide", "c", "d", "prismatic"),
    joint("behind_turn", "d", "e", inside=following("turn", 0.5, 0.2)),
    joint("turns_with_hinge", "e", "f", "continuous", '<mimic joint="hinge" multiplier="3" offset="-0.4"/>'),
    joint("slides_with_hinge", "f", "g", "prismatic", following("hinge", -0.25, 0.05)),
    joint("hinges_with_slide", "g", "h", inside=following("slide", 0.7, 0)),
)
"""Joints of each kind that follow joints of each kind."""


@pytest.mark.parametrize("upper", [False, True])
def test_links_stand_where_another_reader_of_the_urdf_puts_them(upper: bool, tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_text(FOLLOWERS, encoding="utf-8")
    other = yourdfpy.URDF.load(str(tmp_path / "r.urdf"), load_meshes=False, load_collision_meshes=False)
    robot = Robot(urdf=FOLLOWERS, fixed_base=True)
    names = ["hinge", "turn", "slide"]
    values = np.random.default_rng(1).uniform(-0.9, 0.9, (4, 3)) * [1, 3, 1]
    columns = [f"{name}_joint".upper() if upper else name for name in names]
    q, notes = robot.q_from_columns(columns, values)
    assert notes == () and np.allclose(robot.mimic_errors(q), 0, atol=1e-12)
    data = robot.model.createData()
    for row, given in zip(q, values, strict=True):
        other.update_cfg(dict(zip(names, given, strict=True)))
        pin.framesForwardKinematics(robot.model, data, row)
        for name in "bcdefgh":
            placed = data.oMf[robot.model.getFrameId(name)].homogeneous
            np.testing.assert_allclose(placed, other.get_transform(name, "a"), atol=1e-9)


@pytest.mark.parametrize(("name", "reach"), [("figure", 0.8), ("human", 0.8), ("g1", 0.3)])
def test_angles_of_a_posture_do_not_depend_on_where_it_stands_and_looks(name: str, reach: float) -> None:
    robot = load_robot(name, bodies="none")
    joints = robot.points(configurations(robot, 6, reach, seed=2))
    joints += np.random.default_rng(4).normal(0, 0.01, joints.shape)  # no configuration reaches them exactly
    turn, move = pin.rpy.rpyToMatrix(0.4, -0.8, 2.5), np.array([3.0, -20.0, 1.0])
    q, distance = robot.configurations(joints)
    moved, again = robot.configurations(joints @ turn.T + move)
    np.testing.assert_allclose(again, distance, atol=1e-6)
    np.testing.assert_allclose(moved[:, 7:], q[:, 7:], atol=1e-4)
    np.testing.assert_allclose(robot.points(moved), robot.points(q) @ turn.T + move, atol=1e-5)


@pytest.mark.parametrize(
    ("name", "size", "strict"),
    [("human", 1.0, False), ("human", 1.1, False), ("human", 1.1, True), ("g1", 1.0, True)],
)
def test_positions_are_judged_by_the_configurations_that_reach_them(
    name: str, size: float, strict: bool
) -> None:
    """A robot that is not scaled cannot reach the joints of a person of another size."""
    robot = load_robot(name, bodies="none")
    joints = size * robot.points(configurations(robot, 5, 0.3, seed=3))
    joints[1] = np.nan
    joints[2, JOINTS.index("left_wrist"), 2] += 3.0
    joints[3, JOINTS.index("right_elbow")] = np.nan
    settings = posekit.ValidateSettings(strict=strict, checks="reach,joint-range")
    report = posekit.validate(posekit.Motion(joints=joints), settings, urdf=name)
    table, near = report.table(), size == 1.0 or not strict
    assert report.ok.tolist() == [near, False, False, near, near]
    assert set(table["check"][table["verdict"] == "invalid"]) == {"reach"}
    assert table["verdict"][table["frame"] == 1].tolist() == ["undecided"] * 2
    assert 0.5 < table["value"][(table["frame"] == 2) & (table["place"] == "left_wrist")] < 3.0


def test_a_joint_may_be_beyond_reach_by_the_tolerance_of_lengths() -> None:
    robot = load_robot("human", bodies="none")
    joints = robot.points(robot.neutral[None])[:, :14]
    joints[:, JOINTS.index("left_wrist"), 2] -= 0.4

    def found(tolerance: float | None) -> posekit.Report:
        settings = posekit.ValidateSettings(strict=True, checks="reach", rigid_tolerance=tolerance)
        return posekit.validate(posekit.Motion(joints=joints), settings, urdf="human")

    worst = found(1e-4).table()["value"].max()
    assert 0.03 < worst < 0.4 and not found(None).ok and not found(0.99 * worst).ok and found(1.01 * worst).ok


def chain(count: int) -> str:
    joints = (joint(f"j{k}", f"l{k}", f"l{k + 1}", "fixed", "") for k in range(count - 1))
    return text(*(link(f"l{k}", "") for k in range(count)), *joints)


def star(count: int, kind: str = "fixed") -> str:
    joints = (joint(f"j{k}", "l0", f"l{k}", kind, "") for k in range(1, count))
    return text(*(link(f"l{k}", "") for k in range(count)), *joints)


def bodies(count: int) -> str:
    return text(f'<link name="a">{link("a").partition(">")[2].removesuffix("</link>") * count}</link>')


def long(count: int) -> str:
    urdf = text(link("a"), "<!---->")
    return urdf.replace("<!---->", f"<!--{'x' * (count - len(urdf))}-->")


def two(**about: Any) -> str:
    return text(link("a"), link("b"), joint("j", "a", "b", **about))


def limited(most: float, kind: str = "revolute", number: int = 2) -> str:
    """Return hinges or sliders with an upper limit."""
    own = [LIMIT.replace('"2"', f'"{most}"')] * number + [LIMIT] * (2 - number)
    return text(*map(link, "abc"), *(joint(n, "a", n, kind, one) for n, one in zip("bc", own, strict=True)))


@pytest.mark.parametrize(
    ("inside", "outside", "words"),
    [
        (chain(250), chain(251), "more than 250 links"),
        (star(1000), star(1001), "1,001 links"),
        (star(201, "continuous"), star(202, "continuous"), "201 degrees of freedom"),
        (bodies(500), bodies(501), "501 bodies"),
        (
            text(link("a"), "<x>" * 63 + "</x>" * 63),
            text(link("a"), "<x>" * 64 + "</x>" * 64),
            "65 nested elements",
        ),
        (long(10_000_000), long(10_000_001), "10,000,001 bytes"),
        (two(z=1e6), two(z=1_000_001), "3 finite numbers"),
        (limited(14.9), limited(15.1), "15.1 rad, and 1 more"),
        (limited(721), limited(719), "719 rad, and 1 more"),
        (limited(100, number=1), limited(100), "100 rad"),
        (limited(100, "prismatic"), limited(100), "100 rad"),
        (two(kind="prismatic", axis="0 1.0009 0"), two(kind="prismatic", axis="0 1.0011 0"), "length 1"),
        (two(kind="prismatic", axis="0 0.9991 0"), two(kind="prismatic", axis="0 0.9989 0"), "length 1"),
        (two(axis="0 1.1e-6 0"), two(axis="0 0.9e-6 0"), "length 1"),
        (two(kind="fixed", inside="", axis="0 0 0"), two(axis="0 0 0"), "length 1"),
    ],
    ids=lambda urdf: urdf[-20:],
)
def test_a_urdf_is_refused_beyond_a_bound(inside: str, outside: str, words: str) -> None:
    Robot(urdf=inside, bodies="none")
    with pytest.raises(InputError, match=words):
        Robot(urdf=outside, bodies="none")
