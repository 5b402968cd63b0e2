"""The bodies that a URDF declares: what is to be loaded, to be counted against what was."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, Literal
from xml.etree import ElementTree

from posekit.robots.urdf_numbers import numbers
from posekit.safe_io import refusal, shown

SIZE_ATTRIBUTES: Final[dict[str, tuple[str, ...]]] = {
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "mesh": (),
}
"""The attributes of each shape that are to be positive."""
MAX_BODIES: Final = 500
"""Of each kind that is loaded: Pinocchio takes n^3 for n of them; published robots have at most 112."""
BodyKind = Literal["collision", "visual"]
_ALL: Final = {1: "it positive", 2: "both positive", 3: "all positive"}


@dataclass(frozen=True, kw_only=True)
class DeclaredBody:
    """A collision or visual body as the text declares it.

    Parameters
    ----------
    link : str
        The link that carries it.
    shape : {"box", "sphere", "cylinder", "capsule", "mesh"}
        A cylinder that ``collision_checking`` names as a capsule is a capsule.
    element : Element
        The shape's own element.
    """

    link: str
    shape: str
    element: ElementTree.Element


def declared_bodies(robot: ElementTree.Element, kind: BodyKind = "collision") -> Iterator[DeclaredBody]:
    """List the bodies of a URDF, in the order of the text."""
    for link in robot.findall("link"):
        capsules = {capsule.get("name") for capsule in link.findall("collision_checking/capsule")}
        for body in link.findall(kind):
            for element in body.findall("geometry/*"):
                is_capsule = (
                    element.tag == "cylinder" and kind == "collision" and body.get("name") in capsules
                )
                shape = "capsule" if is_capsule else element.tag
                yield DeclaredBody(link=link.get("name", ""), shape=shape, element=element)


def check_bodies(robot: ElementTree.Element, source: str) -> None:
    """Refuse collision bodies that Pinocchio would drop without an exception, or that have no size.

    A ``<capsule>`` is read under ``<robot version="1.1">`` and later alone. A visual body without a shape takes
    the collision bodies of its link with it.
    """
    for link in robot.findall("link"):
        place = f"link {link.get('name')!r}"
        if len(link.findall("inertial")) > 1:
            raise refusal(source, place, "two <inertial>", "one", "remove the other")
        for named in link.findall("collision_checking/*"):
            if not named.get("name"):
                expected = "the name of a collision body"
                raise refusal(source, f"{place}: <collision_checking>", "no name", expected, "add it")
        for kind in ("collision", "visual"):
            for body in link.findall(kind):
                _check_body(body, kind, place, source)
    check_count(robot, source, "collision")
    for declared in declared_bodies(robot):
        _check_shape(declared, f"link {declared.link!r}", source)
        if declared.element.tag == "capsule" and robot.get("version", "1.0") == "1.0":
            remedy = (
                'write <robot version="1.1">, or a cylinder of that name and length with <collision_checking>'
                '<capsule name="…"/></collision_checking>'
            )
            got = "a <capsule>, which readers of URDF 1.0 drop"
            raise refusal(source, f"link {declared.link!r}", got, "one that is read", remedy)


def check_count(robot: ElementTree.Element, source: str, kind: BodyKind) -> None:
    """Refuse more bodies than `MAX_BODIES`."""
    count = sum(1 for _ in declared_bodies(robot, kind))
    if count > MAX_BODIES:
        raise refusal(source, "", f"{count:,} {kind} bodies", f"at most {MAX_BODIES}", "simplify it")


def _check_body(body: ElementTree.Element, kind: str, place: str, source: str) -> None:
    shapes = body.findall("geometry/*")
    if len(shapes) != 1 or len(body.findall("geometry")) != 1:
        got = f"a {kind} body with {len(shapes)} shapes"
        raise refusal(
            source, place, got, f"one of {', '.join(SIZE_ATTRIBUTES)}", "make each a body of its own"
        )
    if len(body.findall("origin")) > 1:
        raise refusal(source, place, "two <origin>", "one", "remove the other")
    if any("name" not in material.attrib for material in body.findall("material")):
        raise refusal(source, place, "a material without a name", "one with a name", "add it")
    if shapes[0].tag == "mesh" and not shapes[0].get("filename"):
        raise refusal(source, place, "a mesh without a file name", '<mesh filename="…"/>', "add it")


def _check_shape(declared: DeclaredBody, place: str, source: str) -> None:
    element, tag = declared.element, declared.element.tag
    if tag not in SIZE_ATTRIBUTES:
        got = f"a collision body <{shown(tag)[1:-1]}>"
        raise refusal(source, place, got, f"one of {', '.join(SIZE_ATTRIBUTES)}", "replace it")
    if tag == "mesh":
        if 0.0 in (scale := numbers(element, "scale", "1 1 1")):
            raise refusal(source, place, f"a mesh of scale {scale}", "none of them zero", "correct it")
        return
    missing = [name for name in SIZE_ATTRIBUTES[tag] if name not in element.attrib]
    if missing:
        raise refusal(source, place, f"a {tag} without {' and '.join(missing)}", f"a {tag} with it", "add it")
    sizes = [(name, size) for name in SIZE_ATTRIBUTES[tag] for size in numbers(element, name, "")]
    if min(size for _, size in sizes) <= 0:
        got = f"a {tag} with " + ", ".join(f"{name} {size:g}" for name, size in sizes)
        raise refusal(source, place, got, _ALL[len(sizes)], "correct it")
