"""Check a URDF text, of any robot, before a native library reads it.

Pinocchio's reader drops a collision body or an inertia that it does not understand with a line on stderr, takes
radii below zero, limits in the wrong order and axes of no length, and overflows its stack on a long chain.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final
from xml.etree import ElementTree

from posekit.robots.declared import check_bodies
from posekit.robots.urdf_joints import check_joints
from posekit.robots.urdf_numbers import check_numbers
from posekit.robots.urdf_tree import check_tree
from posekit.safe_io import cut, parse_xml, read_text, refusal, shown
from posekit.safe_io.xml_file import MAX_BYTES

MAX_LINKS: Final = 1000
"""The largest published robots have some 150."""
URDF_VERSIONS: Final = ("1.0", "1.1", "1.2")


def read_urdf(path: str | Path) -> str:
    """Read a URDF or SRDF file as text: UTF-8, at most 10 MB, without a byte order mark."""
    return read_text(
        path, limit=MAX_BYTES, too_large="name a robot's URDF: those that are published have 0.3 MB"
    )


def check_urdf(text: str, source: str) -> ElementTree.Element:
    """Parse a URDF and check all that a model is made of.

    Links and joints are one tree of at most 1000 links, 250 levels and 200 degrees of freedom, with names that
    are there once; joints are of known types, with limits in order and axes that have a direction; numbers are
    finite, sizes positive, masses not negative; collision bodies are spelled so that Pinocchio reads them.

    Parameters
    ----------
    text : str
        The URDF.
    source : str
        What to call it in errors.

    Returns
    -------
    Element
        The root; its numbers are separated by single blanks.

    Raises
    ------
    InputError
        With the place that is wrong.
    """
    return check_robot(parse_xml(text, source), source)


def check_robot(robot: ElementTree.Element, source: str) -> ElementTree.Element:
    """Check a URDF that was parsed: see `check_urdf`."""
    if robot.tag != "robot":
        got = f"the root element is <{cut(robot.tag)}>"
        raise refusal(source, "", got, "<robot>", "name a URDF")
    links = len(robot.findall("link"))
    if not 0 < links <= MAX_LINKS:
        raise refusal(source, "", f"{links:,} links", f"at most {MAX_LINKS}, and one at least", "simplify it")
    if not robot.get("name"):
        raise refusal(source, "<robot>", "no name", 'a name, as <robot name="mine">', "add it")
    version = robot.get("version", "1.0")
    if version not in URDF_VERSIONS:
        raise refusal(source, "<robot version=…>", shown(version), " or ".join(URDF_VERSIONS), "correct it")
    check_tree(robot, source)
    check_numbers(robot, source)
    check_joints(robot, source)
    check_bodies(robot, source)
    return robot
