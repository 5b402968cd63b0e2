"""URDF and SRDF texts: parsed once, checked, and reduced to the elements that a model is made of.

Pinocchio's reader drops bodies that it does not understand, accepts reversed limits and axes of zero length, and
overflows its stack on long chains. Here each of these faults raises an `InputError` whose one-line message names the
faulty element.
"""

from __future__ import annotations

import copy
import math
import re
import sys
from collections import Counter
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

import defusedxml
import defusedxml.ElementTree

from posekit.errors import cut, nearest, one_line, refusal, shown

Element = ElementTree.Element

#: Largest size of a URDF or SRDF, bytes. Published files have at most 0.3 MB.
MAX_BYTES: Final = 10_000_000
#: Largest depth of nested elements. Native readers are recursive.
MAX_NESTING: Final = 64
#: Largest number of links from the root to a leaf. Pinocchio's reader overflows its stack at about 5000.
MAX_CHAIN: Final = 250
#: Largest accepted counts. The largest published robots have about 150 links and 112 bodies. The memory of Pinocchio's
#: data grows with the cube of the degrees of freedom: 0.3 GB at 200.
MOST: Final = {"links": 1000, "bodies": 500, "degrees of freedom": 200}
#: Largest coordinate, metres or radians; products of larger numbers overflow.
MAX_NUMBER: Final = 1e6
#: Range of limits of revolute joints (rad) that are probably degrees if at least two joints have such a limit.
#:
#: Published robots have limits of at most 10 rad, and 1e16 rad for rotors without limits.
DEGREES: Final = (15.0, 720.0)

#: Degrees of freedom of each joint type.
FREEDOM: Final = {"fixed": 0, "revolute": 1, "continuous": 1, "prismatic": 1, "planar": 3, "floating": 6}
#: Shapes, and the attributes of each that must be positive.
SIZES: Final[dict[str, tuple[str, ...]]] = {
    **{"box": ("size",), "sphere": ("radius",), "mesh": ()},
    **dict.fromkeys(("cylinder", "capsule"), ("radius", "length")),
}
#: Attributes with three numbers, and with one.
_TRIPLES: Final = ("xyz", "rpy", "size", "scale")
_SINGLES: Final = (
    "lower",
    "upper",
    "effort",
    "velocity",
    "multiplier",
    "offset",
    "value",
    "radius",
    "length",
)
#: Elements whose numbers are coordinates or sizes, and all elements with numbers.
_PLACED: Final = ("origin", "axis", *SIZES)
_NUMERIC: Final = ("limit", "mimic", "mass", *_PLACED)
#: Children of links and joints that the model is built from. Other children, such as elements of simulators, are
#: removed.
_KEPT: Final = {
    "link": ("inertial", "collision", "visual", "collision_checking"),
    "joint": ("origin", "parent", "child", "axis", "limit", "mimic"),
}
_NUMBER: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)

#: A function that raises a refusal unless a condition is true: condition, place, got, expected, remedy.
Need = Callable[[object, str, str, str, str], None]


def need(source: str | Path, ok: object, place: str, got: str, expected: str, remedy: str) -> None:
    """Raise an `InputError` unless `ok` is true; the other parameters are parts of its message."""
    if not ok:
        raise refusal(source, place, got, expected, remedy)


def parse_xml(text: str, source: str | Path) -> Element:
    """Parse XML of bounded size and depth, without DOCTYPE and entities.

    Raises
    ------
    InputError
        If the text is malformed (the message gives line and column), declares a DOCTYPE or an entity, or is too large
        or too deeply nested.
    """
    check = partial(need, source)
    check(len(text) <= MAX_BYTES, "", f"{len(text):,} bytes", f"at most {MAX_BYTES:,}", "simplify the file")
    try:
        root: Element = defusedxml.ElementTree.fromstring(text, forbid_dtd=True)
    except defusedxml.DefusedXmlException:
        raise refusal(source, "", "a DOCTYPE or entities", "XML without them", "remove them") from None
    except (ElementTree.ParseError, ValueError) as error:
        got = f"no well-formed XML ({cut(one_line(str(error)))})"
        raise refusal(source, "", got, "XML in UTF-8", "correct the file there") from None
    level, depth = [root], 0
    while level:
        level, depth = [child for parent in level for child in parent], depth + 1
    check(depth <= MAX_NESTING, "", f"{depth} nested elements", f"at most {MAX_NESTING}", "simplify the file")
    return root


def check_urdf(text: str, source: str) -> Element:
    """Parse a URDF and check the links and joints that the model is built from.

    Parameters
    ----------
    text : str
        The URDF.
    source : str
        Name of the URDF in error messages.

    Returns
    -------
    Element
        The element ``<robot>`` with only checked links, joints and materials. Pinocchio reads these elements instead of
        the text.

    Raises
    ------
    InputError
        If links and joints are not one tree of at most 1000 links; a name is repeated; a number is missing, not
        finite, or too large; limits are reversed, absent or in degrees; a body has no size.
    """
    robot, check = parse_xml(text, source), partial(need, source)
    check(robot.tag == "robot", "", f"the root element <{cut(robot.tag)}>", "<robot>", "name a URDF")
    for part in list(robot):
        if part.tag not in (*_KEPT, "material"):
            robot.remove(part)
        for child in list(part):
            if part.tag in _KEPT and child.tag not in _KEPT[part.tag]:
                part.remove(child)
    links, joints = robot.findall("link"), robot.findall("joint")
    freedom = sum(FREEDOM.get(joint.get("type", ""), 0) for joint in joints)
    counts = len(links), len(robot.findall("link/collision")), freedom
    for count, (what, most) in zip(counts, MOST.items(), strict=True):
        check(count <= most, "", f"{count:,} {what}", f"at most {most:,}", "simplify the robot")
    _check_tree(robot, check)
    for part in (*joints, *links):
        _check_numbers(part, f"{part.tag} {part.get('name')!r}", check)
    _check_joints({joint.get("name", ""): joint for joint in joints}, check)
    materials = {material.get("name") for material in robot.findall("material")}
    for link in links:
        _check_link(link, check)
        for visual in link.findall("visual"):
            for material in visual.findall("material"):
                if not material.get("name") or not (len(material) or material.get("name") in materials):
                    visual.remove(material)  # Pinocchio would refuse the whole robot
    robot.set("name", robot.get("name") or "robot")
    robot.set("version", "1.1")  # Pinocchio ignores capsules in URDF 1.0
    return robot


def text_with(robot: Element, *kinds: str) -> str:
    """Write a checked URDF with only bodies of the given kinds (collision, visual)."""
    robot = copy.deepcopy(robot)
    for link in robot.findall("link"):
        for body in (*link.findall("collision"), *link.findall("visual")):
            if body.tag not in kinds:
                link.remove(body)
    return ElementTree.tostring(robot, encoding="unicode")


def numbers(element: Element, attribute: str, default: str = "") -> list[float]:
    """Return the numbers in a checked attribute of an XML element."""
    return [float(word) for word in element.get(attribute, default).split()]


def _check_tree(robot: Element, check: Need) -> None:
    """Refuse repeated and unprintable names, and links and joints that are not one tree."""
    for kind in _KEPT:
        for name, times in Counter(part.get("name", "") for part in robot.findall(kind)).items():
            got = f"{kind} {shown(name)} {times} times"
            check(times == 1, "", got, "each name once", "rename or remove the others")
            good = name and name.isprintable()
            check(good, "", f"a {kind} named {shown(name)}", "a printable name", "rename it")
    known = {link.get("name", "") for link in robot.findall("link")}
    parents: dict[str, str] = {}
    for joint in robot.findall("joint"):
        place = f"joint {joint.get('name')!r}"
        ends = [element.get("link", "") for tag in ("parent", "child") for element in joint.findall(tag)]
        ok = len(ends) == 2 and known.issuperset(ends)
        check(ok, place, f"the links {shown(ends)}", "a parent and a child of this file", "correct the names")
        got = f"link {ends[1]!r}, which already hangs on another joint"
        check(ends[1] not in parents, place, got, "a tree", "remove one of the joints")
        parents[ends[1]] = ends[0]
    roots = sorted(known - parents.keys())
    got = f"{len(roots)} links that hang on no joint ({', '.join(roots[:5]) or 'none, or a cycle'})"
    check(len(roots) == 1, "", got, "one root link", "join the parts to one tree")
    for link in parents:
        chain = [link]
        while chain[-1] in parents and len(chain) <= MAX_CHAIN:
            chain.append(parents[chain[-1]])
        got = f"link {link!r} at the end of a cycle or of more than {MAX_CHAIN} links"
        check(len(chain) <= MAX_CHAIN, "", got, "a tree", "remove the cycle, or merge fixed links")


def _check_numbers(part: Element, place: str, check: Need) -> None:
    """Refuse values of joints and links that are not numbers. Visual bodies are not checked: they are only drawn."""
    for element in (one for child in part if child.tag != "visual" for one in child.iter()):
        check("quat_xyzw" not in element.attrib, place, "a rotation as quat_xyzw", "rpy", "write it as rpy")
        for attribute, text in element.items():
            if element.tag in _NUMERIC and attribute in (*_TRIPLES, *_SINGLES):
                words, count = text.split(), 3 if attribute in _TRIPLES else 1
                good = len(words) == count and all(map(_NUMBER.fullmatch, words))
                most = MAX_NUMBER if element.tag in _PLACED else sys.float_info.max
                good = good and all(abs(float(word)) <= most for word in words)
                expected = f"{count} finite numbers" if count > 1 else "a finite number"
                remedy = "expand the xacro first" if "${" in text else "write it in metres and radians"
                check(good, f"{place}: <{element.tag} {attribute}=…>", shown(text), expected, remedy)
                element.set(attribute, " ".join(words))


def _check_joints(joints: Mapping[str, Element], check: Need) -> None:
    """Refuse joints with a wrong type, limit, axis or ``<mimic>``, and limits in degrees."""
    large: dict[str, float] = {}
    for name, joint in joints.items():
        place, kind, limit = f"joint {name!r}", joint.get("type", ""), joint.find("limit")
        check(kind in FREEDOM, place, f"the type {shown(kind)}", f"one of {', '.join(FREEDOM)}", "correct it")
        if limit is None:
            remedy = 'add <limit lower="…" upper="…" effort="…" velocity="…"/>, or make it continuous'
            check(kind not in ("revolute", "prismatic"), place, "no <limit>", "limits in rad or m", remedy)
        else:
            missing = [key for key in ("effort", "velocity") if key not in limit.attrib]
            check(
                not missing, f"{place}: <limit>", f"no {' and no '.join(missing)}", "both numbers", "add them"
            )
            lower, upper = (numbers(limit, end, "0")[0] for end in ("lower", "upper"))
            got = f"lower limit {lower:g} above upper limit {upper:g}"
            check(lower <= upper, place, got, "lower <= upper", "exchange them")
            if kind == "revolute" and DEGREES[0] < max(-lower, upper) < DEGREES[1]:
                large[name] = max(-lower, upper)
        for axis in joint.findall("axis"):
            length = math.hypot(*numbers(axis, "xyz", "1 0 0"))
            without_axis = kind in ("fixed", "floating")
            good = abs(length - 1) < 1e-3 if kind == "prismatic" else length > 1e-6 or without_axis
            check(good, place, f"an axis of length {length:g}", "length 1", "correct it")
        target, followed = name, set[str]()
        while (mimic := joints[target].find("mimic")) is not None:
            followed.add(target)
            target = mimic.get("joint", "")
            good = target in joints and FREEDOM.get(joints[target].get("type", "")) == 1
            check(good, place, f"a mimic of {shown(target)}", "a moving joint", nearest(target, joints))
            check(target not in followed, place, "a mimic of itself", "a mimic of another joint", "remove it")
    if len(large) > 1:
        name, value = max(large.items(), key=lambda item: item[1])
        got = f"a limit of {value:g} rad, and {len(large) - 1} more beyond {DEGREES[0]:g} rad"
        remedy = f"if they are degrees, write radians ({value:g} degrees are {math.radians(value):.4g} rad)"
        check(False, f"joint {name!r}", got, "limits in radians", remedy)


def _check_link(link: Element, check: Need) -> None:
    """Refuse a link's collision bodies that do not have exactly one shape of positive size."""
    for body in link.findall("collision"):
        place, found = f"link {link.get('name')!r}: <collision>", body.findall("geometry/*")
        got = f"{', '.join(cut(one.tag) for one in found[:4]) or 'no shape'}"
        ok = len(found) == 1 == len(body.findall("geometry")) and found[0].tag in SIZES
        check(ok, place, got, f"one of {', '.join(SIZES)}", "give each shape a body of its own")
        shape = found[0]
        for attribute in SIZES[shape.tag]:
            got = f"a {shape.tag} with {attribute} {shown(shape.get(attribute))}"
            least = min(numbers(shape, attribute), default=0)
            check(least > 0, place, got, f"a positive {attribute}", "correct it")
        flat = shape.tag == "mesh" and 0.0 in numbers(shape, "scale", "1 1 1")
        check(not flat, place, "a mesh of scale 0", "another scale", "correct it")
