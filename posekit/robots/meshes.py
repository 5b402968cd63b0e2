"""The meshes of a robot: found, looked through, and written into the text that Pinocchio reads."""

from __future__ import annotations

import copy
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

from posekit.robots.declared import BodyKind, declared_bodies
from posekit.robots.mesh_path import resolve_mesh
from posekit.safe_io import check_mesh, cut, refusal, replacing
from posekit.safe_io.writing import make_folder

MAX_MESHES_BYTES: Final = 100_000_000
"""Of all meshes of one robot together: about two million triangles of STL."""


def with_resolved_meshes(
    robot: ElementTree.Element,
    package_dirs: Sequence[Path],
    source: str,
    kind: BodyKind = "collision",
    copies: Mapping[str, Path] | None = None,
) -> ElementTree.Element:
    """Return a copy of a URDF whose meshes of this kind are named by the files that were looked through.

    Pinocchio then opens those files and no others, whatever its own rules for package names are. Where there are
    `copies` of them, see `private_copies`, it opens those.

    Raises
    ------
    InputError
        Where a mesh lies outside of `package_dirs`, is not there, is too large, or is not what its suffix says.
    """
    robot = copy.deepcopy(robot)
    if copies is None:
        copies = {name: path for name, path, _ in _looked_through(robot, package_dirs, source, kind)}
    for body in declared_bodies(robot, kind):
        if body.shape == "mesh":
            body.element.set("filename", str(copies[body.element.get("filename", "")]))
    return robot


@contextmanager
def private_copies(
    robot: ElementTree.Element, package_dirs: Sequence[Path], source: str, kinds: Sequence[BodyKind]
) -> Iterator[dict[str, Path]]:
    """Copy meshes, as they are looked through, to where nobody exchanges them between one look and the next.

    Yields
    ------
    dict
        The copies, by the names in the URDF; they are there until the block ends.
    """
    if not any(body.shape == "mesh" for kind in kinds for body in declared_bodies(robot, kind)):
        yield {}
        return
    try:
        private = tempfile.TemporaryDirectory(prefix="posekit-")
    except OSError as error:
        got = f"no temporary folder for copies of its meshes: {cut(error.strerror or str(error))}"
        raise refusal(source, "", got, "one that can be written", "make space, or set TMPDIR") from None
    with private as folder:
        copies: dict[str, Path] = {}
        for kind in kinds:
            for name, path, data in _looked_through(robot, package_dirs, source, kind):
                if name not in copies:
                    # Of the same name as the file: coal goes by the suffix, and says it.
                    copies[name] = Path(folder) / str(len(copies)) / path.name
                    make_folder(copies[name].parent)
                    with replacing(copies[name]) as file:
                        file.write(data)
        yield copies


def _looked_through(
    robot: ElementTree.Element, package_dirs: Sequence[Path], source: str, kind: BodyKind
) -> Iterator[tuple[str, Path, bytes]]:
    """Find and check each mesh once, and yield the name that it has in the URDF, its file and its content."""
    links: dict[str, str] = {}
    for body in declared_bodies(robot, kind):
        if body.shape == "mesh":
            links.setdefault(body.element.get("filename", ""), body.link)
    sizes: dict[Path, int] = {}
    for name, link in links.items():
        path = resolve_mesh(name, package_dirs, source, f"link {link!r}")
        data = check_mesh(path)
        sizes[path] = len(data)
        if sum(sizes.values()) > MAX_MESHES_BYTES:
            got = f"meshes of {sum(sizes.values()) / 1e6:,.1f} MB"
            raise refusal(source, "", got, f"at most {MAX_MESHES_BYTES / 1e6:,.0f} MB", "simplify the meshes")
        yield name, path, data
