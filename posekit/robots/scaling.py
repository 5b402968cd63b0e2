"""A robot with the segment lengths of a person: the origins of its URDF joints are moved."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from posekit.errors import refusal
from posekit.geometry import Array, align, known_median, rotation_between
from posekit.robots.urdf import SIZES, Element, numbers
from posekit.skeleton import HIPS, JOINT, JOINTS, LIMB_SEGMENTS, SEGMENTS, TORSO

if TYPE_CHECKING:
    from posekit.robots.robot import Robot

#: Ratios of a person's length to the robot's that are plausible; beyond them the unit is wrong.
RATIO: Final = (0.05, 20.0)
#: Metres within which two places are one.
SAME: Final = 1e-9


def scaled(robot: Robot, joints: ArrayLike) -> Robot:
    """Return the robot with the median segment lengths of postures.

    At the neutral configuration the mapped joints have the person's distances. Limbs have them in every
    configuration. Bodies grow with their segments; hands, feet and head keep their size.

    Parameters
    ----------
    robot : Robot
        With a joint map.
    joints : array (N, 14, 3) or (14, 3)
        Metres; NaN is unknown. Lengths that are never seen stay the robot's.

    Returns
    -------
    Robot
        Made of a URDF with other joint origins; its name is the robot's.

    Raises
    ------
    InputError
        If the robot has no joint map, or a length is beyond 20 times the robot's, up or down.
    """
    given = np.asarray(joints, dtype=np.float64).reshape(-1, *np.shape(joints)[-2:])[:, : len(JOINTS)]
    model, tree, data = robot.model, copy.deepcopy(robot.tree), robot.model.createData()
    wanted = _wanted(robot.points(pin.neutral(model))[0], given, robot.source)
    joints_of = {end.get("link", ""): one for one in tree.findall("joint") for end in one.findall("child")}
    child_of = {joint.get("name", ""): link for link, joint in joints_of.items()}
    links = {link.get("name", ""): link for link in tree.findall("link")}
    root = next(name for name in links if name not in joints_of)
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    frames = enumerate(model.frames)
    place = {str(frame.name): data.oMf[k] for k, frame in frames if frame.type == pin.FrameType.BODY}
    moved, grown = set[str](), set[str]()
    for name in ("pelvis", *JOINTS):
        if name in robot.joint_map and np.isfinite(wanted[JOINT[name]]).all():
            site = robot.joint_map[name]
            link = child_of.get(str(model.names[site.joint]), root)
            end = wanted[JOINT[name]] - place[link].rotation @ np.array(site.offset)
            path = []
            while link in joints_of and link not in moved:
                path.append(link)
                link = _parent(joints_of[link])
            if path:
                moved |= _stretch(joints_of, place, path, end, links, grown)
    return replace(robot, urdf=ElementTree.tostring(tree, encoding="unicode"))


def _stretch(
    joints: Mapping[str, Element],
    place: Mapping[str, pin.SE3],
    path: Sequence[str],
    end: Array,
    links: Mapping[str, Element],
    grown: set[str],
) -> set[str]:
    """Scale and turn the origins of a chain of links, the last one first, so that it ends at a place at neutral.

    Links that carry the chain grow with it, once each. Returns the links whose origins were changed: those of the
    chain, and those that start where one of them did, as the second of two clavicles.
    """
    base = _parent(joints[path[-1]])
    old, new = place[path[0]].translation - place[base].translation, end - _origin(base, joints, place)
    size, length = float(np.linalg.norm(old)), float(np.linalg.norm(new))
    stretched = min(size, length) > SAME
    ratio = length / size if stretched else 1.0
    turn = rotation_between(old / size, new / length) if stretched else np.eye(3)
    changed = set()
    for link in path:
        above, before = _parent(joints[link]), _xyz(joints[link])
        R = place[above].rotation
        after = R.T @ (ratio * turn @ R @ before if stretched or link != path[-1] else new)
        for other, joint in joints.items():
            if _parent(joint) == above and np.allclose(_xyz(joint), before, atol=SAME):
                changed.add(other)
                if joint.find("origin") is None:
                    ElementTree.SubElement(joint, "origin")
                _set(joint.findall("origin")[0], "xyz", after)
        if above in joints and above not in grown:
            grown.add(above)
            _grow(links[above], ratio)
    return changed


def _grow(link: Element, ratio: float) -> None:
    """Scale the bodies and the centre of mass of a link."""
    for origin in link.findall("*/origin"):
        _set(origin, "xyz", ratio * np.array(numbers(origin, "xyz", "0 0 0")))
    for shape in link.findall("*/geometry/*"):
        for attribute in SIZES[shape.tag] or ("scale",):
            _set(shape, attribute, ratio * np.array(numbers(shape, attribute, "1 1 1")))


def _origin(link: str, joints: Mapping[str, Element], place: Mapping[str, pin.SE3]) -> Array:
    """Return the new origin of a link at neutral: rotations there do not change."""
    if link not in joints:
        return np.array(place[link].translation)
    above = _parent(joints[link])
    return np.array(_origin(above, joints, place) + place[above].rotation @ _xyz(joints[link]))


def _parent(joint: Element) -> str:
    return next(parent.get("link", "") for parent in joint.findall("parent"))


def _xyz(joint: Element) -> Array:
    return np.array(next((numbers(one, "xyz", "0 0 0") for one in joint.findall("origin")), [0.0] * 3))


def _set(element: Element, attribute: str, values: Array) -> None:
    element.set(attribute, " ".join(repr(float(value)) for value in values))


def segment_lengths(joints: Array) -> Array:
    """Return the median length of each segment of `posekit.skeleton.SEGMENTS` (17,), metres; NaN if never seen."""
    gaps = np.linalg.norm(joints[:, [a for a, _ in SEGMENTS]] - joints[:, [b for _, b in SEGMENTS]], axis=2)
    return np.array([known_median(one) for one in gaps.T])


def _wanted(own: Array, joints: Array, source: str) -> Array:
    """Return places (14, 3) of the joints at neutral that have the lengths of postures, near the robot's own.

    Torso and hips have the median shape of the postures in which they are whole, laid on the robot's own; limbs keep
    the robot's directions.
    """
    lengths, kept = segment_lengths(joints), segment_lengths(own[None])
    ratio = lengths / kept
    lengths = np.where(np.isfinite(lengths), lengths, kept)
    if (wrong := np.isfinite(ratio) & ((ratio < RATIO[0]) | (ratio > RATIO[1]))).any():
        a, b = SEGMENTS[int(np.argmax(wrong))]
        got = f"{lengths[wrong][0]:g} m from {JOINTS[a]} to {JOINTS[b]}, where the robot has {kept[wrong][0]:g} m"
        raise refusal(source, "lengths", got, "a similar length", "give the joints in metres")
    wanted, pelvis = own.copy(), JOINT["pelvis"]
    for part in (TORSO, HIPS):
        columns = [JOINT[name] for name in part]
        whole = np.isfinite(joints[:, columns]).all(axis=(1, 2))
        if whole.any() and np.isfinite(own[columns]).all():
            shapes = joints[whole][:, columns]
            shape = np.median(align(shapes, own[columns], scale=False).apply(shapes), axis=0)
            wanted[columns] = shape + (own[pelvis] - shape[columns.index(pelvis)])
    for (start, end), length in zip(SEGMENTS, lengths, strict=True):
        if (start, end) in LIMB_SEGMENTS:
            along = own[end] - own[start]
            wanted[end] = wanted[start] + along * length / np.linalg.norm(along)
    return wanted
