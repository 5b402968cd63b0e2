"""Bring what was written into a form that can be compared: parsed, without where and when it was made."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

HEX_DIGEST = re.compile(r"\b[0-9a-f]{64}\b|\b[0-9a-f]{16}\b")
VOLATILE_TEXT: tuple[tuple[re.Pattern[str], str], ...] = (
    (HEX_DIGEST, "<digest>"),  # of settings, versions and contents, which are compared themselves
    (re.compile(r"\b\d+(\.\d+)? ?(s|ms|min)\b(?! of)"), "<time>"),
    (re.compile(r"\b\d+(\.\d+)? [KMG]i?B\b"), "<memory>"),
)
TEXT_SUFFIXES = {".md", ".txt", ".log"}
TOKEN_SUFFIXES = {".trc", ".bvh", ".mot", ".urdf", ".srdf", ".xml"}
GLTF_TYPES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}


def files_of(folder: Path, places: dict[str, str]) -> dict[str, Any]:
    """Return every file below a folder by its path, in canonical form; what is hidden is the program's own affair.

    Parameters
    ----------
    folder : Path
        A case's own folder.
    places : dict of str to str
        Absolute paths, and what to call them.
    """
    found = {}
    for path in sorted(folder.rglob("*")):
        inner = path.relative_to(folder)
        if path.is_file() and not any(part.startswith(".") for part in inner.parts):
            found[HEX_DIGEST.sub("<digest>", inner.as_posix())] = file_of(path, places)
    return found


def file_of(path: Path, places: dict[str, str]) -> dict[str, Any]:
    """Return one file in canonical form: its kind, and its content."""
    kind = path.suffix
    readers: dict[str, Callable[[Path], Any]] = {
        ".json": lambda path: json.loads(path.read_text()),
        ".npz": _arrays,
        ".parquet": _parquet,
        ".csv": _table,
        ".glb": _gltf,
    }
    if kind in readers:
        return {"kind": kind[1:], "content": named(readers[kind](path), places)}
    if kind in TOKEN_SUFFIXES:
        return {"kind": "tokens", "content": named(re.split(r'[\s"<>]+', path.read_text()), places)}
    if kind in TEXT_SUFFIXES:
        return {"kind": "text", "content": text_of(path.read_text(), places)}
    content = path.read_bytes()
    return {
        "kind": "picture",
        "content": {"bytes": len(content), "digest": hashlib.sha256(content).hexdigest()},
    }


def text_of(text: str, places: dict[str, str]) -> str:
    """Return a text without where and when it was made."""
    for place, name in places.items():
        text = text.replace(place, name)
    for pattern, name in VOLATILE_TEXT:
        text = pattern.sub(name, text)
    return text


def named(content: Any, places: dict[str, str]) -> Any:
    """Return content with its paths renamed, and the JSON that its strings hold parsed."""
    if isinstance(content, dict):
        return {key: named(value, places) for key, value in content.items()}
    if isinstance(content, list):
        return [named(value, places) for value in content]
    if not isinstance(content, str):
        return content
    if content[:1] in {"{", "["}:
        try:
            return named(json.loads(content), places)
        except ValueError:
            pass
    for place, name in places.items():
        content = content.replace(place, name)
    return content


def _values(array: Any) -> dict[str, Any]:
    return {"dtype": str(array.dtype), "shape": list(array.shape), "values": array.ravel().tolist()}


def _arrays(path: Path) -> dict[str, Any]:
    with np.load(path, allow_pickle=False) as archive:
        return {name: _values(archive[name]) for name in archive.files}


def _parquet(path: Path) -> dict[str, Any]:
    from pyarrow import parquet

    table = parquet.read_table(path)
    noted = {
        key.decode(): value.decode()
        for key, value in (table.schema.metadata or {}).items()
        if key != b"ARROW:schema"
    }
    types = {name: str(kind) for name, kind in zip(table.schema.names, table.schema.types, strict=True)}
    return {"metadata": noted, "types": types, "columns": table.to_pydict()}


def _table(path: Path) -> dict[str, Any]:
    header, *rows = list(csv.reader(io.StringIO(path.read_text())))
    columns = {
        name: [_cell(row[k]) if k < len(row) else None for row in rows] for k, name in enumerate(header)
    }
    return {"columns": columns, "rows": len(rows)}


def _cell(text: str) -> int | float | str:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _gltf(path: Path) -> dict[str, Any]:
    """Return the JSON of a binary glTF, and the numbers of its accessors."""
    content = path.read_bytes()
    length = struct.unpack_from("<I", content, 12)[0]
    scene, binary = json.loads(content[20 : 20 + length]), content[28 + length :]
    numbers = []
    for accessor in scene["accessors"]:
        view = scene["bufferViews"][accessor["bufferView"]]
        kind = np.dtype(GLTF_TYPES[accessor["componentType"]])
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        numbers.append(_values(np.frombuffer(binary, kind, accessor["count"] * width, start)))
    return {"scene": scene, "accessors": numbers}
