"""The meshes of a robot: found, looked through, and written into the text that Pinocchio reads."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from pathlib import Path
from typing import Final, Literal
from xml.etree import ElementTree

from posekit.robots.declared import declared_bodies
from posekit.robots.mesh_path import resolve_mesh
from posekit.safe_io import check_mesh, refusal

MAX_MESHES_BYTES: Final = 100_000_000
"""Of all meshes of one robot together: about two million triangles of STL."""


def with_resolved_meshes(
    robot: ElementTree.Element,
    package_dirs: Sequence[Path],
    source: str,
    kind: Literal["collision", "visual"] = "collision",
) -> ElementTree.Element:
    """Return a copy of a URDF whose meshes of this kind are named by the files that were looked through.

    Pinocchio then opens those files and no others, whatever its own rules for package names are.

    Raises
    ------
    InputError
        Where a mesh lies outside of `package_dirs`, is not there, is too large, or is not what its suffix says.
    """
    robot = copy.deepcopy(robot)
    sizes: dict[Path, int] = {}
    for body in declared_bodies(robot, kind):
        if body.shape == "mesh":
            name = body.element.get("filename", "")
            path = resolve_mesh(name, package_dirs, source, f"link {body.link!r}")
            if path not in sizes:
                sizes[path] = check_mesh(path)
            body.element.set("filename", str(path))
    if sum(sizes.values()) > MAX_MESHES_BYTES:
        got = f"meshes of {sum(sizes.values()) / 1e6:,.1f} MB"
        raise refusal(source, "", got, f"at most {MAX_MESHES_BYTES / 1e6:,.0f} MB", "simplify the meshes")
    return robot
