"""Scale a robot to the segment lengths of a person by moving the origins of its URDF joints."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import TYPE_CHECKING, Final
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from posekit.errors import refusal
from posekit.geometry import Array, align, known_median, rotation_between
from posekit.robots.bodies import first_link
from posekit.robots.urdf import SIZES, Element, numbers
from posekit.skeleton import HIPS, JOINT, JOINTS, LIMB_SEGMENTS, SEGMENTS, TORSO

if TYPE_CHECKING:
    from posekit.robots.robot import Robot

#: Plausible ratios of a person's segment length to the robot's (dimensionless); beyond them the unit is wrong.
RATIO: Final = (0.05, 20.0)
#: Distance below which two points coincide, metres.
SAME: Final = 1e-9


def scaled(robot: Robot, joints: ArrayLike) -> Robot:
    """Return the robot with the median segment lengths of postures.

    Limb segments have the person's lengths in every configuration. Distances between joints of the torso, and between
    joints of the hips, equal the person's at the neutral configuration. Bodies scale with their segments; hands, feet
    and head keep their size.

    Parameters
    ----------
    robot : Robot
        A humanoid. Other robots are returned unchanged.
    joints : array (N, 14, 3) or (14, 3)
        Metres; NaN is unknown. Segments that are unknown in all postures keep the robot's length.

    Returns
    -------
    Robot
        A robot of the same name whose URDF has other joint origins and body sizes.

    Raises
    ------
    InputError
        If a segment of the person is more than 20 times longer or shorter than the robot's.
    """
    given = np.asarray(joints, dtype=np.float64).reshape(-1, *np.shape(joints)[-2:])[:, : len(JOINTS)]
    model, tree, data = robot.model, copy.deepcopy(robot.tree), robot.model.createData()
    wanted = _wanted(robot.points(pin.neutral(model))[0], given, robot.source)
    links = {link.get("name", ""): link for link in tree.findall("link")}
    joint_of = {end.get("link", ""): one for one in tree.findall("joint") for end in one.findall("child")}
    above = {link: end.get("link", "") for link, one in joint_of.items() for end in one.findall("parent")}
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    place = {link: data.oMf[model.getFrameId(link, pin.FrameType.BODY)] for link in links}
    # New origins (3,), metres, of the root and of links in scaled chains, at neutral. Their rotations do not change.
    origin = {link: place[link].translation for link in links.keys() - joint_of.keys()}
    grown = set[str]()
    for name in ("pelvis", *JOINTS):
        if name not in robot.joint_map or not np.isfinite(wanted[JOINT[name]]).all():
            continue
        site = robot.joint_map[name]
        last = base = model.frames[first_link(model, site.joint)].name
        end, path = wanted[JOINT[name]] - place[last].rotation @ np.array(site.offset), list[str]()
        while base not in origin:
            path.append(base)
            base = above[base]
        old, new = place[last].translation - place[base].translation, end - origin[base]
        size, length, stretch = float(np.linalg.norm(old)), float(np.linalg.norm(new)), np.eye(3)
        if min(size, length) > SAME:
            stretch = length / size * rotation_between(old / size, new / length)
        for link in path:
            # Links with the same origin move together, such as the two clavicles of a robot.
            for other in (one for one in above if above[one] == above[link]):
                offset = place[other].translation - place[last].translation
                if np.allclose(place[other].translation, place[link].translation, atol=SAME):
                    origin[other] = end + stretch @ offset
            if above[link] in joint_of and above[link] not in grown:
                grown.add(above[link])
                _grow(links[above[link]], float(np.linalg.norm(stretch[0])))
    for link in origin.keys() & joint_of.keys():
        if joint_of[link].find("origin") is None:
            ElementTree.SubElement(joint_of[link], "origin")
        offset = place[above[link]].rotation.T @ (origin[link] - origin[above[link]])
        _set(joint_of[link].findall("origin")[0], "xyz", offset)
    return replace(robot, urdf=ElementTree.tostring(tree, encoding="unicode"))


def _grow(link: Element, ratio: float) -> None:
    """Scale the bodies and the centre of mass of a link."""
    for origin in link.findall("*/origin"):
        _set(origin, "xyz", ratio * np.array(numbers(origin, "xyz", "0 0 0")))
    for shape in link.findall("*/geometry/*"):
        for attribute in SIZES[shape.tag] or ("scale",):
            _set(shape, attribute, ratio * np.array(numbers(shape, attribute, "1 1 1")))


def _set(element: Element, attribute: str, values: Array) -> None:
    element.set(attribute, " ".join(repr(float(value)) for value in values))


def segment_lengths(joints: Array) -> Array:
    """Return the median length of each segment of `posekit.skeleton.SEGMENTS` (17,), metres; NaN if unknown."""
    gaps = np.linalg.norm(joints[:, [a for a, _ in SEGMENTS]] - joints[:, [b for _, b in SEGMENTS]], axis=2)
    return np.array([known_median(one) for one in gaps.T])


def _wanted(own: Array, joints: Array, source: str) -> Array:
    """Return the robot's joint positions (14, 3), metres, at neutral with the segment lengths of postures.

    Torso and hips have the median shape of the postures in which all their joints are known, aligned with the robot's
    joints. Limb segments keep the directions of the robot's segments.
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
