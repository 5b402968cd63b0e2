"""Collision and visual bodies of a robot. Meshes are read only from the robot's package directories."""

from __future__ import annotations

import copy
import re
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Final, Literal

import coal
import numpy as np
import pinocchio as pin

from posekit.errors import cut, refusal, shown
from posekit.robots.urdf import MAX_NUMBER, Element, need, parse_xml, text_with

Kind = Literal["collision", "visual"]

#: Largest total size of a robot's mesh files, bytes: about two million triangles of STL.
MAX_MESHES_BYTES: Final = 100_000_000
#: Largest length of a line of an OBJ file, bytes. The time to triangulate a polygon grows with the square of its
#: corners.
MAX_LINE: Final = 65_536
#: Size of the header of a binary STL file, which ends with the number of triangles, and size of one triangle, bytes.
STL_HEADER, STL_TRIANGLE = 84, 50


def build_bodies(
    model: pin.Model, robot: Element, package_dirs: Sequence[Path], source: str, kind: Kind
) -> pin.GeometryModel:
    """Load the collision or the visual bodies of a checked URDF.

    Parameters
    ----------
    model : pinocchio.Model
        Built from the same URDF.
    robot : Element
        The checked URDF.
    package_dirs : sequence of Path
        The only directories from which meshes are read.
    source : str
        Name of the URDF in error messages.
    kind : {"collision", "visual"}
        The bodies to load.

    Raises
    ------
    InputError
        If a mesh is outside `package_dirs`, missing, too large or damaged.
    """
    resolved, sizes = copy.deepcopy(robot), dict[Path, int]()
    for link in resolved.findall("link"):
        for mesh in link.findall(f"{kind}/geometry/mesh"):
            path = resolve_mesh(mesh.get("filename", ""), package_dirs, source, f"link {link.get('name')!r}")
            if path not in sizes:
                sizes[path] = _check_mesh_file(path)
            mesh.set("filename", str(path))
    total, most = sum(sizes.values()) / 1e6, MAX_MESHES_BYTES / 1e6
    need(source, total <= most, "", f"meshes of {total:,.0f} MB", f"at most {most:,.0f} MB", "simplify them")
    form = pin.GeometryType.COLLISION if kind == "collision" else pin.GeometryType.VISUAL
    try:
        geometry = pin.buildGeomFromUrdfString(model, text_with(resolved, kind), form)
    except (ValueError, RuntimeError) as error:
        message = str(error).rpartition("message: ")[2].strip().splitlines()[0]
        got = f"a {kind} body that cannot be loaded ({cut(message.rpartition('/')[2])})"
        raise refusal(source, "", got, "a shape, or a mesh of triangles", "correct it") from None
    for body in geometry.geometryObjects:
        mesh, place = body.geometry, f"link {link_of(model, body)!r}"
        if isinstance(mesh, coal.BVHModelBase):
            # coal accepts NaN silently.
            ok = mesh.num_tris > 0 and (np.abs(mesh.vertices()) <= MAX_NUMBER).all()
            got, expected = "a mesh without triangles, or with NaN", f"coordinates up to {MAX_NUMBER:g} m"
            need(source, ok, place, got, expected, "export it again")
    return geometry


def resolve_mesh(name: str, package_dirs: Sequence[Path], source: str, place: str) -> Path:
    """Find a mesh inside the package directories.

    Parameters
    ----------
    name : str
        The mesh's name in the URDF: ``package://PACKAGE/…``, ``file:///…``, or an absolute or relative path. PACKAGE is
        the name of a package directory or of a folder inside one.
    package_dirs : sequence of Path
        The only directories from which meshes are read.
    source, place : str
        The file and the link, for error messages.

    Returns
    -------
    Path
        The file. Symbolic links are resolved.

    Raises
    ------
    InputError
        If the resolved path is no file inside a package directory.
    """
    scheme, mark, rest = name.partition("://")
    field, known = f"{place}: mesh {shown(name)}", scheme in ("package", "file") or not mark
    expected = "package://, file:// or a path"
    need(source, known, field, f"{cut(scheme)}://", expected, "copy it beside the URDF")
    package, _, inner = (rest if mark else name).partition("/")
    homes = [folder / inner for folder in package_dirs if mark and inner and folder.name == package]
    with suppress(OSError):  # raised if the name is too long
        for path in (*homes, *(folder / (rest if mark else name) for folder in package_dirs)):
            found = path.resolve()
            if found.is_file() and any(found.is_relative_to(folder.resolve()) for folder in package_dirs):
                return found
    remedy = 'name the directory of the package (package_dirs), or load with bodies="capsules" or "none"'
    expected = "a file inside the robot's package directories"
    raise refusal(source, field, "no such file there", expected, remedy)


def _check_mesh_file(path: Path) -> int:
    """Check a mesh file and return its size, bytes."""
    check, suffix, size = partial(need, path), path.suffix.lower(), path.stat().st_size
    ok = suffix in (".stl", ".obj", ".dae") and 0 < size <= MAX_MESHES_BYTES
    expected = f"a mesh (.stl, .obj, .dae) of at most {MAX_MESHES_BYTES / 1e6:.0f} MB"
    check(ok, "", f"{size:,} bytes with suffix {shown(suffix)}", expected, "convert or simplify it")
    data = path.read_bytes()
    if suffix == ".stl" and not data.lstrip().startswith(b"solid"):
        declared = int.from_bytes(data[80:STL_HEADER], "little")
        ok = STL_HEADER + declared * STL_TRIANGLE <= size and declared > 0
        got = f"{declared:,} triangles in {size:,} bytes"
        check(ok, "", got, "an STL file", "export the mesh again")
    if suffix == ".dae":
        tags = [part.tag for part in parse_xml(data.decode("utf-8", "replace"), path).iter()]
        nested = any(tag.endswith("instance_node") for tag in tags)
        check(not nested, "", "nodes that place other nodes", "a mesh", "export it with its nodes resolved")
    if suffix == ".obj":
        longest = max(map(len, data.splitlines()), default=0)
        check(longest <= MAX_LINE, "", f"a line of {longest:,} bytes", f"up to {MAX_LINE:,}", "use triangles")
    # The native reader opens the material library of an `mtllib` line, even if the file is not an OBJ file.
    for library in re.findall(rb"^[ \t]*mtllib[ \t]*(.*?)\s*$", data, re.MULTILINE):
        plain = re.fullmatch(rb"(\./)?\w[\w. -]*", library)
        check(plain, "", f"the library {shown(repr(library))}", "a file beside the mesh", "remove the line")
    return size


def link_of(model: pin.Model, body: pin.GeometryObject) -> str:
    """Return the name of the link that carries a body."""
    return str(model.frames[body.parentFrame].name)


def first_link(model: pin.Model, joint: int) -> int:
    """Return the frame index of the first link that moves with a joint."""
    frames = enumerate(model.frames)
    return next(k for k, one in frames if one.parentJoint == joint and one.type == pin.FrameType.BODY)
