"""What the names inside a file say: its schema, the columns of a table, the intrinsics of a camera."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Final

from posekit.formats.keypoints import Given
from posekit.formats.motion.motion_checks import sniffed
from posekit.formats.motion.parquet import opened
from posekit.formats.motion.survivors import COORDINATES, KEYS
from posekit.formats.own.npz import open_npz
from posekit.formats.own.result_npz import MAX_PADDED
from posekit.safe_io import open_file, read_toml

LARGEST: Final = 1 << 62
"""Bytes: how large a file may be is for its reader to say."""
FIRST: Final = 100_000
"""Bytes of a table in which its first line is looked for."""


def schema(given: Given) -> str:
    """Return the schema that a file names; empty where it names none."""
    path, suffix = given.path, given.suffix
    if suffix == ".npz" and zipfile.is_zipfile(path):
        with open_npz(path, limit=MAX_PADDED) as archive:
            return str(archive.array("schema", "U", ())) if "schema" in archive.names else ""
    if suffix == ".toml":
        return str(read_toml(path, limit=10_000_000).get("schema", ""))
    if suffix == ".json":
        return str(given.document.get("schema", "")) if isinstance(given.document, dict) else ""
    return ""


def is_camera_npz(path: Path) -> bool:
    """Tell whether NumPy's arrays are a camera's: they have intrinsics, and no joints."""
    if path.suffix.lower() != ".npz" or not zipfile.is_zipfile(path):
        return False
    with open_npz(path, limit=MAX_PADDED) as archive:
        return "joints" not in archive.names and any(map(_is_intrinsics, archive.names))


def is_survivors(path: Path) -> bool:
    """Tell whether a table has all the columns of a table of survivors."""
    suffix = path.suffix.lower()
    if suffix == ".csv":
        names = first_line(path)
    elif suffix in (".parquet", ".pq") and sniffed(path).startswith(b"PAR1"):
        with opened(path) as file:
            names = set(file.schema_arrow.names)
    else:
        return False
    return {*KEYS, *COORDINATES} <= names


def first_line(path: Path) -> set[str]:
    """Return the names in the first line of a table."""
    with open_file(path, limit=LARGEST) as file:
        first = file.read(FIRST).partition(b"\n")[0].decode("utf-8", "replace").lstrip("\ufeff")
    return {name.strip().strip('"') for name in first.replace(";", ",").replace("\t", ",").split(",")}


def is_in_space(columns: set[str]) -> bool:
    """Tell whether a table of points is of points in space: z is there, and nothing that only detectors write.

    Landmarks of MediaPipe in a table have the same names as other points, and a z too.
    """
    words = {name.strip().casefold() for name in columns}
    deep = any(name == "z" or name.endswith("_z") for name in words)
    detected = ("visibility", "presence", "confidence", "score", "likelihood", "eye_inner", "foot_index")
    return deep and not any(part in name for name in words for part in detected)


def has_matrix(document: object) -> bool:
    """Tell whether a JSON document has intrinsics, in itself or one level below."""
    inner = list(document.values()) if isinstance(document, dict) else document
    below = [one for one in inner if isinstance(one, dict)] if isinstance(inner, list) else []
    top = [document] if isinstance(document, dict) else []
    return any(_is_intrinsics(str(name)) for one in [*top, *below] for name in one)


def _is_intrinsics(name: str) -> bool:
    """Tell whether a name is a camera matrix's: `K`, `camera_matrix`, `intrinsics`, and so on."""
    name = name.casefold()
    return name in ("k", "mtx", "m") or "matrix" in name or "intrinsic" in name
