"""Meshes: STL, OBJ and COLLADA, looked at before a native library opens them.

What is inside is for that library to read, in a child process with bounds on memory and time where the model is a
stranger's (`posekit.robots.untrusted`), and what it made of it is checked there (`posekit.robots.geometry`). Here
stands what a child does not show: that a file is of bounded size, and names no other that the library would open.
"""

from __future__ import annotations

import re
import stat
from pathlib import Path
from typing import Final

from posekit.safe_io.collada_file import check_collada
from posekit.safe_io.refusal import cut, refusal, shown
from posekit.safe_io.regular_file import read_bytes

MAX_BYTES: Final = 64_000_000
"""The largest mesh; those of the published robots stay below 29 MB."""
MAX_MATERIAL_BYTES: Final = 10_000_000
"""The largest library of materials beside an OBJ file."""
MAX_LINE_BYTES: Final = 65_536
"""Of an OBJ file: a face of so many corners that its line is longer takes the square of their number to triangulate."""
MESH_SUFFIXES: Final = (".stl", ".obj", ".dae")
STL_HEADER_BYTES: Final = 84
STL_TRIANGLE_BYTES: Final = 50

_MATERIALS = re.compile(rb"^[ \t]*mtllib([^\r\n]*)", re.MULTILINE)
_LINE_ENDS = re.compile(rb"[\r\n]+")


def check_mesh(path: str | Path, *, limit: int = MAX_BYTES) -> bytes:
    """Look at a mesh file.

    Parameters
    ----------
    path : path
        A regular file that ends in ``.stl``, ``.obj`` or ``.dae``, in any case.
    limit : int
        Bytes that it may have.

    Returns
    -------
    bytes
        The file: what was looked at.

    Raises
    ------
    InputError
        Where it cannot be read, is too large, is not what its suffix says, or names a file elsewhere.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in MESH_SUFFIXES:
        got, known = f'the suffix "{cut(path.suffix)}"', ", ".join(MESH_SUFFIXES)
        raise refusal(path, "", got, f"a mesh: {known}", "convert it")
    data = read_bytes(path, limit=limit, too_large="simplify the mesh")
    if suffix == ".stl":
        _check_stl(path, data)
    elif suffix == ".dae":
        check_collada(path, data)
    elif suffix == ".obj" and max(map(len, _LINE_ENDS.split(data))) > MAX_LINE_BYTES:
        expected = f"at most {MAX_LINE_BYTES:,} bytes"
        raise refusal(path, "", "a line that is longer", expected, "triangulate its faces")
    # The library goes by a file's content where its suffix does not fit: any file may be an OBJ.
    for line in _MATERIALS.finditer(data):
        _check_material(path, line[1])
    return data


def _check_stl(path: Path, data: bytes) -> None:
    """Hold the number of triangles against the size of the file: the library allocates what the header declares."""
    declared = int.from_bytes(data[80:STL_HEADER_BYTES], "little") if len(data) >= STL_HEADER_BYTES else 0
    fits = 0 < declared <= (len(data) - STL_HEADER_BYTES) // STL_TRIANGLE_BYTES
    if not fits and not data.lstrip().startswith(b"solid"):
        got = f"{declared:,} triangles in {len(data):,} bytes"
        expected = (
            f"{STL_HEADER_BYTES} bytes and {STL_TRIANGLE_BYTES} a triangle, or text that starts with solid"
        )
        raise refusal(path, "", got, expected, "export the mesh again")


def _check_material(path: Path, named: bytes) -> None:
    """Refuse a material library elsewhere: the native reader would open whatever it names."""
    name = named.strip().decode("utf-8", "replace").removeprefix("./")
    plain = name not in ("", "..") and not set("/\\") & set(name) and name.isprintable()
    if not plain or not _harmless(path.parent / name):
        expected = f"the name of a file beside the mesh, of at most {MAX_MATERIAL_BYTES / 1e6:.0f} MB"
        raise refusal(path, "", f"mtllib {shown(name)}", expected, "remove the line")


def _harmless(target: Path) -> bool:
    try:
        status = target.lstat()
    except FileNotFoundError:
        return True
    except OSError:
        return False
    return stat.S_ISREG(status.st_mode) and status.st_size <= MAX_MATERIAL_BYTES
