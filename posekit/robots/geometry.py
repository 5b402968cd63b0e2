"""Collision bodies as Pinocchio and coal load them, counted against those that the text declares."""

from __future__ import annotations

from collections import Counter
from typing import Literal
from xml.etree import ElementTree

import pinocchio as pin

from posekit.robots.declared import declared_bodies
from posekit.safe_io import cut, refusal


def build_geometry(
    model: pin.Model,
    robot: ElementTree.Element,
    source: str,
    kind: Literal["collision", "visual"] = "collision",
) -> pin.GeometryModel:
    """Load the bodies of a checked URDF whose meshes are resolved.

    Raises
    ------
    InputError
        Where Pinocchio or coal cannot load them, or the collision bodies loaded are not those declared, by link,
        number and type.
    """
    text = ElementTree.tostring(robot, encoding="unicode")
    wanted = pin.GeometryType.COLLISION if kind == "collision" else pin.GeometryType.VISUAL
    try:
        geometry = pin.buildGeomFromUrdfString(model, text, wanted)
    except (ValueError, RuntimeError) as error:
        got = f"a {kind} body that coal cannot load: {_reason(error)}"
        raise refusal(source, "", got, "a mesh with triangles", "export the mesh again") from error
    if kind == "collision":
        _check_loaded(model, geometry, robot, source)
    return geometry


def link_of(model: pin.Model, body: pin.GeometryObject) -> str:
    """Return the link that carries a body."""
    return str(model.frames[body.parentFrame].name)


def shape_of(body: pin.GeometryObject) -> str:
    """Return a body's shape as URDF calls it."""
    kind = type(body.geometry).__name__
    return "mesh" if kind.startswith(("BVHModel", "Convex")) else kind.lower()


def _reason(error: Exception) -> str:
    """Take from coal's several lines what it says, and the file's name without its folder."""
    _, _, message = str(error).rpartition("message: ")
    first, *rest = [line for line in message.splitlines() if not line.startswith("Hint")] or [""]
    return ", ".join(cut(line) for line in (first.rpartition("/")[2], *rest[:1]))


def _check_loaded(
    model: pin.Model, geometry: pin.GeometryModel, robot: ElementTree.Element, source: str
) -> None:
    declared = Counter((body.link, body.shape) for body in declared_bodies(robot))
    loaded = Counter((link_of(model, body), shape_of(body)) for body in geometry.geometryObjects)
    if declared != loaded:
        link, shape = next(iter((declared - loaded) or (loaded - declared)))
        got = f"{loaded[link, shape]} of {declared[link, shape]} {shape} bodies loaded"
        remedy = "check how it is spelled and what its mesh holds"
        raise refusal(source, f"link {link!r}", got, "every declared body", remedy)
