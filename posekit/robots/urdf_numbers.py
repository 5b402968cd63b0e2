"""Numbers of a URDF: as many as the attribute takes, finite, and of a size that a body can have."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Final
from xml.etree import ElementTree

from posekit.safe_io import cut, refusal

NUMBERS_OF_ATTRIBUTE: Final[dict[str, dict[str, int]]] = {
    "origin": {"xyz": 3, "rpy": 3},
    "axis": {"xyz": 3},
    "limit": {"lower": 1, "upper": 1, "effort": 1, "velocity": 1},
    "mimic": {"multiplier": 1, "offset": 1},
    "dynamics": {"damping": 1, "friction": 1},
    "mass": {"value": 1},
    "inertia": {"ixx": 1, "ixy": 1, "ixz": 1, "iyy": 1, "iyz": 1, "izz": 1},
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "mesh": {"scale": 3},
    "color": {"rgba": 4},
    "safety_controller": {"soft_lower_limit": 1, "soft_upper_limit": 1, "k_position": 1, "k_velocity": 1},
}
"""How many numbers each attribute of an element holds."""
FINITE_ATTRIBUTES: Final = frozenset(("xyz", "rpy", "size", "radius", "length", "scale"))
MAX_NUMBER: Final = 1e6
"""Lengths (m) and angles beyond this overflow in products."""

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)


def check_numbers(robot: ElementTree.Element, source: str) -> None:
    """Check the numbers of all links and joints, and separate them by single blanks.

    Raises
    ------
    InputError
        Where there is another number of them, one is no decimal number, or one is not finite.
    """
    for place, element in _elements(robot):
        if "quat_xyzw" in element.attrib:
            got = f"{place} <{element.tag} quat_xyzw=…>"
            raise refusal(source, "", got, "rpy", "write the rotation as rpy: readers differ on quat_xyzw")
        for attribute, count in NUMBERS_OF_ATTRIBUTE[element.tag].items():
            if attribute in element.attrib:
                where = f"{place}: <{element.tag} {attribute}=…>"
                words = element.attrib[attribute].split()
                _check(words, count, attribute in FINITE_ATTRIBUTES, where, source)
                element.set(attribute, " ".join(words))
    for link in robot.findall("link"):
        for inertial in link.findall("inertial"):
            _check_inertial(inertial, f"link {link.get('name')!r}", source)


def numbers(element: ElementTree.Element, attribute: str, default: str) -> list[float]:
    """Return the numbers of an attribute that was checked."""
    return [float(word) for word in element.get(attribute, default).split()]


def _elements(robot: ElementTree.Element) -> Iterator[tuple[str, ElementTree.Element]]:
    for part in robot:
        if part.tag in ("link", "joint"):
            place = f"{part.tag} {part.get('name')!r}"
            yield from ((place, element) for element in part.iter() if element.tag in NUMBERS_OF_ATTRIBUTE)


def _check(words: list[str], count: int, is_length: bool, where: str, source: str) -> None:
    got = cut(repr(" ".join(words)))
    expected = f"{count} finite number{'s' if count > 1 else ''}"
    for word in words:
        if not _NUMBER.fullmatch(word) and word.lower().lstrip("+-") not in ("nan", "inf", "infinity"):
            raise refusal(source, where, f"{got}, which is not a number", expected, "correct it")
    values = [float(word) for word in words]
    if len(values) != count or not all(map(math.isfinite, values)):
        raise refusal(source, where, got, expected, "correct it")
    if is_length and max(map(abs, values)) > MAX_NUMBER:
        raise refusal(source, where, got, f"at most {MAX_NUMBER:,.0f}", "write metres and radians")


def _check_inertial(inertial: ElementTree.Element, place: str, source: str) -> None:
    """Refuse what Pinocchio would take for no mass at all."""
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or "value" not in mass.attrib:
        raise refusal(source, place, "an inertial without a mass", '<mass value="…"/>', "add it")
    if inertia is None or any(name not in inertia.attrib for name in NUMBERS_OF_ATTRIBUTE["inertia"]):
        expected = f"<inertia> with {', '.join(NUMBERS_OF_ATTRIBUTE['inertia'])}"
        raise refusal(source, place, "an inertial without its six moments", expected, "add them")
    if float(mass.attrib["value"]) < 0:
        raise refusal(source, place, f"a mass of {mass.attrib['value']} kg", "none below zero", "correct it")
