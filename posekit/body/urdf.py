"""Reading, checking and rewriting the figure's URDF text."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from posekit.body.capsules import Capsule
from posekit.body.inertias import inertias
from posekit.body.lengths import hips_points, torso_points
from posekit.errors import FigureError, InputError
from posekit.geometry import Array
from posekit.robots.urdf import check_urdf, read_urdf
from posekit.safe_io import write_text
from posekit.skeleton import HEAD_POINTS, SIDES

LIMB_SEGMENTS = (
    ("upper_arm", "elbow_flexion", "shoulder", "elbow"),
    ("forearm", "wrist_fixed", "elbow", "wrist"),
    ("thigh", "knee_flexion", "hip", "knee"),
    ("shank", "ankle_fixed", "knee", "ankle"),
)
"""Link, the joint at its end, and the two joints of the skeleton between which it lies."""


def read_text(path: Path) -> str:
    """Read a URDF or SRDF file as text, with a limit on its size."""
    with as_figure_error():
        return read_urdf(path)


def write_texts(path: Path, urdf: str, srdf: str) -> None:
    """Write a URDF, and its SRDF beside it: each whole or not at all, and no new SRDF alone."""
    beside = path.with_suffix(".srdf")
    new = not beside.exists()
    with as_figure_error():
        write_text(beside, [srdf])
    try:
        with as_figure_error():
            write_text(path, [urdf])
    except FigureError:
        if new:
            beside.unlink(missing_ok=True)
        raise


def parse(text: str, source: str) -> ElementTree.Element:
    """Parse the figure's URDF: what is checked of any robot's, and no meshes.

    Raises
    ------
    FigureError
        With the place that is wrong. Pinocchio would accept or silently drop most of these.
    """
    with as_figure_error():
        robot = check_urdf(text, source)
    if robot.find(".//collision//mesh") is not None:
        raise FigureError(
            f"{source}: a collision body is a mesh; expected capsules (Pinocchio would load any file)"
        )
    return robot


@contextmanager
def as_figure_error() -> Iterator[None]:
    """Call what is wrong with any robot's file an error of the figure."""
    try:
        yield
    except InputError as error:
        raise FigureError(str(error)) from error


def rewrite(
    text: str,
    capsules: Sequence[Capsule],
    old: Array,
    lengths: Mapping[str, float],
    head: Array,
    *,
    behind: bool = False,
) -> str:
    """Write the figure's URDF with other lengths and another head; capsules grow with their part.

    A capsule keeps its place on its link's line, its length in proportion to that line. Its radius grows with
    the same ratio, the torso's with the width of the shoulders. Masses and moments are those of a person of these
    lengths.

    Parameters
    ----------
    text : str
        The URDF to start from.
    capsules : sequence of Capsule
        Its capsules.
    old : array (19, 3)
        Its points at the neutral configuration, metres.
    lengths : mapping
        All 17 lengths, metres.
    head : array (5, 3)
        The head's points in the head link's frame (x forward, y left, z up, origin the neck), metres.
    behind : bool
        Whether the shoulders lie behind the line from neck to pelvis.

    Returns
    -------
    str
        URDF text.
    """
    robot = deepcopy(_parsed(text))
    torso, hips = torso_points(lengths, behind=behind), hips_points(lengths)
    origins = {
        "right_shoulder_flexion": torso[1],
        "left_shoulder_flexion": torso[2],
        "pelvis_flexion": torso[3],
        "right_hip_flexion": hips[1],
        "left_hip_flexion": hips[2],
        **{f"{name}_fixed": point for name, point in zip(HEAD_POINTS, head, strict=True)},
    }
    lines = {
        "torso": (torso[0], torso[3]),
        "hips": (hips[1], hips[2]),
        "head": (np.zeros(3), head.mean(axis=0)),
    }
    for side in SIDES:
        for part, joint, start, end in LIMB_SEGMENTS:
            length = lengths[f"{side}_{start}-{side}_{end}"]
            origins[f"{side}_{joint}"] = np.array([0.0, 0.0, -length])
            lines[f"{side}_{part}"] = (np.zeros(3), origins[f"{side}_{joint}"])
    for name, place in origins.items():
        _find(robot, f"joint[@name='{name}']/origin").set("xyz", _numbers(place))
    shoulders = float(np.linalg.norm(torso[1] - torso[2]) / np.linalg.norm(old[1] - old[2]))
    for capsule in capsules:
        start_point, end_point = lines[capsule.link]
        line = end_point - start_point
        length = float(np.linalg.norm(line))
        old_start, old_end = (old[list(points)].mean(axis=0) for points in (capsule.start, capsule.end))
        ratio = length / float(np.linalg.norm(old_end - old_start))
        x, y, z = axis = line / length
        collision = _find(robot, f"link[@name='{capsule.link}']/collision")
        origin, cylinder = _find(collision, "origin"), _find(collision, "geometry/cylinder")
        origin.set("xyz", _numbers(start_point + capsule.center * ratio * axis))
        origin.set("rpy", _numbers(np.array([0.0, math.atan2(math.hypot(x, y), z), math.atan2(y, x)])))
        cylinder.set("length", repr(2 * capsule.half_length * ratio))
        cylinder.set("radius", repr(capsule.radius * (shoulders if capsule.link == "torso" else ratio)))
    for name, (mass, centre, moments) in inertias(lengths).items():
        inertial = robot.find(f"link[@name='{name}']/inertial")
        if inertial is None:  # a figure of one's own may do without masses
            continue
        _find(inertial, "origin").set("xyz", _numbers(centre))
        _find(inertial, "mass").set("value", repr(float(mass)))
        for axis_name, moment in zip(("ixx", "iyy", "izz"), moments.tolist(), strict=True):
            _find(inertial, "inertia").set(axis_name, repr(moment))
    return _text(robot)


def replace_limits(text: str, limits: Mapping[str, tuple[float, float]]) -> str:
    """Write the figure's URDF with other limits (radians) on some joints."""
    robot = deepcopy(_parsed(text))
    for name, (lower, upper) in limits.items():
        limit = _find(robot, f"joint[@name='{name}']/limit")
        limit.set("lower", repr(float(lower)))
        limit.set("upper", repr(float(upper)))
    return _text(robot)


@lru_cache(maxsize=4)
def _parsed(text: str) -> ElementTree.Element:
    """Parse the URDF of a figure of which many others are made: whoever changes the tree changes a copy."""
    return parse(text, "stick figure")


def _text(robot: ElementTree.Element) -> str:
    ElementTree.indent(robot)
    header = "<!-- A stick figure written by posekit: metres, radians, x forward, y left, z up. -->"
    return f'<?xml version="1.0"?>\n{header}\n{ElementTree.tostring(robot, encoding="unicode")}\n'


def _find(element: ElementTree.Element, path: str) -> ElementTree.Element:
    found = element.find(path)
    if found is None:
        raise FigureError(f"the URDF has no {path}; start from posekit's stick figure")
    return found


def _numbers(values: Array) -> str:
    return " ".join(repr(float(value) + 0.0) for value in values)
