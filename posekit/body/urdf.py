"""Change segment lengths or joint limits in the text of the figure's URDF."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from copy import deepcopy
from functools import lru_cache
from xml.etree import ElementTree

import numpy as np

from posekit.body.capsules import Capsule
from posekit.body.inertias import inertias
from posekit.body.lengths import hips_points, torso_points
from posekit.errors import FigureError, refusal
from posekit.geometry import Array
from posekit.robots.urdf import parse_xml
from posekit.skeleton import HEAD_POINTS, SIDES

#: For each limb link: name of the link, URDF joint at its end, and the two skeleton joints between which it lies.
LIMB_LINKS = (
    ("upper_arm", "elbow_flexion", "shoulder", "elbow"),
    ("forearm", "wrist_fixed", "elbow", "wrist"),
    ("thigh", "knee_flexion", "hip", "knee"),
    ("shank", "ankle_fixed", "knee", "ankle"),
)


def rewrite(
    text: str, capsules: Sequence[Capsule], lengths: Mapping[str, float], head: Array, *, behind: bool = False
) -> str:
    """Return the figure's URDF text with other capsules, lengths and head points.

    Masses and moments of inertia are computed for a person with the new lengths.

    Parameters
    ----------
    text : str
        The original URDF.
    capsules : sequence of Capsule
        The new capsules.
    lengths : mapping
        All 17 lengths, metres.
    head : array (5, 3)
        The head points in the head link's frame (origin neck, x forward, y left, z up), metres.
    behind : bool
        Whether the shoulders lie behind the line from neck to pelvis.
    """
    robot = deepcopy(_parsed(text))
    torso, hips = torso_points(lengths, behind=behind), hips_points(lengths)
    origins = {f"{name}_fixed": point for name, point in zip(HEAD_POINTS, head, strict=True)}
    origins["pelvis_flexion"] = torso[3]
    for k, side in enumerate(SIDES, 1):
        origins |= {f"{side}_shoulder_flexion": torso[k], f"{side}_hip_flexion": hips[k]}
    lines = {"torso": (torso[0], torso[3]), "hips": (hips[1], hips[2])}
    lines["head"] = np.zeros(3), head.mean(axis=0)
    for side in SIDES:
        for part, joint, start, end in LIMB_LINKS:
            length = lengths[f"{side}_{start}-{side}_{end}"]
            origins[f"{side}_{joint}"] = np.array([0.0, 0.0, -length])
            lines[f"{side}_{part}"] = (np.zeros(3), origins[f"{side}_{joint}"])
    for name, place in origins.items():
        _find(robot, f"joint[@name='{name}']/origin").set("xyz", _numbers(place))
    for capsule in capsules:
        start_point, end_point = lines[capsule.link]
        x, y, z = axis = (end_point - start_point) / np.linalg.norm(end_point - start_point)
        collision = _find(robot, f"link[@name='{capsule.link}']/collision")
        origin, cylinder = _find(collision, "origin"), _find(collision, "geometry/cylinder")
        origin.set("xyz", _numbers(start_point + capsule.center * axis))
        origin.set("rpy", _numbers(np.array([0.0, math.atan2(math.hypot(x, y), z), math.atan2(y, x)])))
        cylinder.set("length", repr(2 * capsule.half_length))
        cylinder.set("radius", repr(capsule.radius))
    for name, (mass, centre, moments) in inertias(lengths).items():
        inertial = robot.find(f"link[@name='{name}']/inertial")
        if inertial is None:  # a user's figure may have no masses
            continue
        _find(inertial, "origin").set("xyz", _numbers(centre))
        _find(inertial, "mass").set("value", repr(float(mass)))
        for axis_name, moment in zip(("ixx", "iyy", "izz"), moments.tolist(), strict=True):
            _find(inertial, "inertia").set(axis_name, repr(moment))
    return _text(robot)


def replace_limits(text: str, limits: Mapping[str, tuple[float, float]]) -> str:
    """Return the figure's URDF text with other limits (radians) of some joints, by URDF joint name."""
    robot = deepcopy(_parsed(text))
    for name, (lower, upper) in limits.items():
        limit = _find(robot, f"joint[@name='{name}']/limit")
        limit.set("lower", repr(float(lower)))
        limit.set("upper", repr(float(upper)))
    return _text(robot)


@lru_cache(maxsize=4)
def _parsed(text: str) -> ElementTree.Element:
    """Parse the URDF of a figure; the result is cached, so callers change only a copy."""
    return parse_xml(text, "stick figure")


def _text(robot: ElementTree.Element) -> str:
    ElementTree.indent(robot)
    header = "<!-- A stick figure written by posekit: metres, radians, x forward, y left, z up. -->"
    return f'<?xml version="1.0"?>\n{header}\n{ElementTree.tostring(robot, encoding="unicode")}\n'


def _find(element: ElementTree.Element, path: str) -> ElementTree.Element:
    found = element.find(path)
    if found is None:
        remedy = "start from posekit's stick figure"
        raise refusal("the URDF", path, "nothing", "the element", remedy, error=FigureError)
    return found


def _numbers(values: Array) -> str:
    return " ".join(repr(float(value) + 0.0) for value in values)
