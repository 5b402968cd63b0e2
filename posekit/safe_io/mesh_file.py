"""Meshes: STL, OBJ and COLLADA, looked through before a native library reads them.

The library behind coal goes by a file's content where its suffix does not fit, allocates what a header
declares, and takes NaN with a warning on stderr. Here a file must be what its suffix says, its counts must be
those of its content, and its numbers finite.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

from posekit.safe_io.mesh_dae import count_dae
from posekit.safe_io.mesh_numbers import MAX_TRIANGLES
from posekit.safe_io.mesh_obj import count_obj
from posekit.safe_io.mesh_stl import count_stl
from posekit.safe_io.refusal import cut, refusal
from posekit.safe_io.regular_file import read_bytes

MAX_BYTES: Final = 64_000_000
"""The largest mesh; those of the published robots stay below 29 MB."""

MESH_FORMATS: Final[Mapping[str, Callable[[Path, bytes], int]]] = MappingProxyType(
    {".stl": count_stl, ".obj": count_obj, ".dae": count_dae}
)
"""For each suffix, what looks through a file's bytes and counts its faces."""


def check_mesh(path: str | Path, *, limit: int = MAX_BYTES) -> int:
    """Look through a mesh file.

    Parameters
    ----------
    path : path
        A regular file that ends in ``.stl``, ``.obj`` or ``.dae``, in any case.
    limit : int
        Bytes that it may have.

    Returns
    -------
    int
        How many faces it declares, at most 5e5.

    Raises
    ------
    InputError
        Where it cannot be read, is too large, is not what its suffix says, declares more than it holds, or
        holds a number that is not finite.
    """
    path = Path(path)
    count = MESH_FORMATS.get(path.suffix.lower())
    if count is None:
        got, known = f'the suffix "{cut(path.suffix)}"', ", ".join(MESH_FORMATS)
        raise refusal(path, "", got, f"a mesh: {known}", "convert it")
    faces = count(path, read_bytes(path, limit=limit, too_large="simplify the mesh"))
    if faces > MAX_TRIANGLES:
        raise refusal(path, "", f"{faces:,} faces", f"at most {MAX_TRIANGLES:,}", "simplify the mesh")
    return faces
