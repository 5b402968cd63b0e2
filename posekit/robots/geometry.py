"""Collision bodies as Pinocchio and coal load them, counted against those that the text declares."""

from __future__ import annotations

from collections import Counter
from typing import Final
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin

from posekit.robots.declared import BodyKind, check_count, declared_bodies
from posekit.safe_io import cut, refusal

MAX_TRIANGLES: Final = 500_000
"""Faces of one mesh: a tree of boxes over so many takes seconds; published robots have at most 350,000."""
FARTHEST_VERTEX: Final = 1e6
"""Coordinates beyond this, in whatever unit, describe no body part; coal takes NaN without a word."""


def build_geometry(
    model: pin.Model,
    robot: ElementTree.Element,
    source: str,
    kind: BodyKind = "collision",
) -> pin.GeometryModel:
    """Load the bodies of a checked URDF whose meshes are resolved.

    Raises
    ------
    InputError
        Where there are too many, Pinocchio or coal cannot load them, or the collision bodies loaded are not those
        declared, by link, number and type.
    """
    check_count(robot, source, kind)
    text = ElementTree.tostring(robot, encoding="unicode")
    wanted = pin.GeometryType.COLLISION if kind == "collision" else pin.GeometryType.VISUAL
    try:
        geometry = pin.buildGeomFromUrdfString(model, text, wanted)
    except (ValueError, RuntimeError) as error:
        got = f"a {kind} body that coal cannot load: {_reason(error)}"
        raise refusal(source, "", got, "a mesh with triangles", "export the mesh again") from error
    _check_meshes(model, geometry, source)
    if kind == "collision":
        _check_loaded(model, geometry, robot, source)
    return geometry


def _check_meshes(model: pin.Model, geometry: pin.GeometryModel, source: str) -> None:
    """Refuse what the native reader took: too many triangles, or vertices that are no place on a body."""
    seen: set[int] = set()
    for body in geometry.geometryObjects:
        mesh = body.geometry
        if not isinstance(mesh, coal.BVHModelBase) or mesh.id() in seen:
            continue
        seen.add(mesh.id())
        where = f"link {link_of(model, body)!r}"
        if mesh.num_tris > MAX_TRIANGLES:
            got = f"{mesh.num_tris:,} faces"
            raise refusal(source, where, got, f"at most {MAX_TRIANGLES:,}", "simplify the mesh")
        vertices = np.asarray(mesh.vertices())
        wrong = ~(np.abs(vertices) <= FARTHEST_VERTEX)
        if wrong.any():
            got = f"a vertex at {vertices[wrong][0]:g}"
            expected = f"finite coordinates, at most {FARTHEST_VERTEX:,.0f} in size"
            raise refusal(source, where, got, expected, "export the mesh again")


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
