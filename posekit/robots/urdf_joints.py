"""Joints of a URDF: known types, limits in order, axes with a direction, mimics of joints that exist."""

from __future__ import annotations

import math
from typing import Final
from xml.etree import ElementTree

from posekit.errors import InputError
from posekit.robots.urdf_numbers import numbers
from posekit.safe_io import nearest, one_line, refusal, shown

JOINT_TYPES: Final = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
JOINT_FREEDOM: Final = {"revolute": 1, "continuous": 1, "prismatic": 1, "planar": 3, "floating": 6}
"""Degrees of freedom by type of joint."""
MAX_FREEDOM: Final = 200
"""What Pinocchio keeps beside a model grows as its cube: 0.3 GB here. The largest published robots have some 100."""
ELEMENTS_ONCE: Final = ("origin", "axis", "limit", "mimic", "parent", "child")
SHORTEST_AXIS: Final = 1e-6
UNIT_AXIS: Final = 1e-3
"""How far from 1 the length of a slide's axis may be: readers differ on whether it scales the way."""


def check_joints(robot: ElementTree.Element, source: str) -> None:
    """Refuse joints that Pinocchio would read in part, or otherwise than they are meant."""
    joints = {joint.get("name", ""): joint for joint in robot.findall("joint")}
    for name, joint in joints.items():
        place = f"joint {name!r}"
        kind = joint.get("type", "")
        if kind not in JOINT_TYPES:
            raise refusal(
                source, place, f"the type {shown(kind)}", f"one of {', '.join(JOINT_TYPES)}", "correct it"
            )
        for tag in ELEMENTS_ONCE:
            if len(joint.findall(tag)) > 1:
                raise refusal(
                    source, place, f"two <{tag}>", "one", "remove the other: readers differ on which"
                )
        if any("k_velocity" not in safety.attrib for safety in joint.findall("safety_controller")):
            raise refusal(source, f"{place}: <safety_controller>", "no k_velocity", "a number", "add it")
        _check_limit(joint, kind, place, source)
        if kind in ("revolute", "continuous", "prismatic", "planar"):
            _check_axis(joint, kind, place, source)
    freedom = sum(JOINT_FREEDOM.get(joint.get("type", ""), 0) for joint in joints.values())
    if freedom > MAX_FREEDOM:
        got = f"joints with {freedom:,} degrees of freedom"
        raise refusal(source, "", got, f"at most {MAX_FREEDOM}", "fix those that are not needed")
    mimics = {
        name: mimic.get("joint", "")
        for name, joint in joints.items()
        if (mimic := joint.find("mimic")) is not None
    }
    for name, target in mimics.items():
        if target not in joints:
            raise refusal(
                source, f"joint {name!r}", f"a mimic of {shown(target)}", "a joint", nearest(target, joints)
            )
        followed = {name}
        while target in mimics and target not in followed:
            followed.add(target)
            target = mimics[target]  # noqa: PLW2901
        if target in followed:
            raise refusal(source, f"joint {name!r}", "a mimic of itself", "a mimic of another", "remove it")


def _check_limit(joint: ElementTree.Element, kind: str, place: str, source: str) -> None:
    limit = joint.find("limit")
    if limit is None:
        if kind in ("revolute", "prismatic"):
            remedy = 'add <limit lower="…" upper="…" effort="…" velocity="…"/>, or make it continuous'
            raise refusal(source, place, "no limit", "limits (rad or m)", remedy)
        return
    missing = [name for name in ("effort", "velocity") if name not in limit.attrib]
    if missing:
        raise refusal(source, f"{place}: <limit>", f"no {' and no '.join(missing)}", "both", "add them")
    lower, upper = limit.get("lower", "0"), limit.get("upper", "0")
    if float(lower) > float(upper):
        text = f"{source}: {place} has lower limit {lower} above its upper {upper}; swap them"
        raise InputError(one_line(text))


def _check_axis(joint: ElementTree.Element, kind: str, place: str, source: str) -> None:
    axis = joint.find("axis")
    if axis is None:
        return  # x, says the format
    length = math.hypot(*numbers(axis, "xyz", "1 0 0"))
    if length < SHORTEST_AXIS:
        raise refusal(source, place, f"an axis of length {length:g}", "a direction", "correct <axis xyz=…>")
    if kind == "prismatic" and abs(length - 1) > UNIT_AXIS:
        raise refusal(source, place, f"an axis of length {length:g}", "length 1", "divide it by its length")
