"""Wavefront OBJ: vertices finite, faces of vertices that exist, materials beside the file."""

from __future__ import annotations

import stat
from pathlib import Path
from typing import Final

import numpy as np

from posekit.safe_io.mesh_numbers import MAX_POLYGON, finite_numbers, whole_numbers
from posekit.safe_io.refusal import refusal, shown

_MAX_CORNERS: Final = 5_000_000
_MAX_MATERIAL: Final = 10_000_000
_KNOWN: Final = frozenset(b"v vt vn vp f l p o g s mg usemtl mtllib".split())


def count_obj(path: Path, data: bytes) -> int:
    """Look through an OBJ file and count its faces."""
    coordinates: list[bytes] = []
    corners: list[bytes] = []
    vertices = faces = 0
    for number, line in enumerate(data.splitlines(), 1):
        word, *rest = line.split() or (b"#",)
        if word.startswith(b"#"):
            continue
        if word not in _KNOWN:
            raise refusal(
                path,
                f"line {number}",
                shown(word[:20].decode("ascii", "replace")),
                "a line of an OBJ file: v, vn, vt, f, …",
                "export the mesh again",
            )
        if word in (b"v", b"vn", b"vt"):
            least = 2 if word == b"vt" else 3
            if not least <= len(rest) <= 8:
                expected = f"{least} or more"
                raise refusal(path, f"line {number}", f"{len(rest)} coordinates", expected, "export it again")
            coordinates += rest
            vertices += word == b"v"
        elif word == b"f":
            if len(rest) > MAX_POLYGON:
                expected = f"at most {MAX_POLYGON}"
                raise refusal(
                    path, f"line {number}", f"a face of {len(rest):,} corners", expected, "triangulate it"
                )
            corners += [corner.partition(b"/")[0] for corner in rest]
            faces += max(1, len(rest) - 2)
        elif word == b"mtllib":
            _check_material(path, number, line)
    finite_numbers(path, "vertices", coordinates)
    if not faces or len(corners) > _MAX_CORNERS:
        got = f"{faces:,} faces with {len(corners):,} corners"
        raise refusal(
            path, "", got, f"at least one face, at most {_MAX_CORNERS:,} corners", "export it again"
        )
    index = whole_numbers(path, "f", corners)
    if (index == 0).any() or np.abs(index).max() > vertices:
        got = f"the vertex {int(index[np.argmax((index == 0) | (np.abs(index) > vertices))])}"
        raise refusal(path, "f", got, f"one of {vertices:,}, counted from 1", "export the mesh again")
    return faces


def _check_material(path: Path, number: int, line: bytes) -> None:
    """Refuse a material library elsewhere: the native reader would open whatever it names."""
    name = line.strip()[len("mtllib") :].strip().decode("utf-8", "replace").removeprefix("./")
    plain = name not in ("", "..") and not set("/\\") & set(name) and name.isprintable()
    if not plain or not _harmless(path.parent / name):
        expected = f"the name of a file beside the mesh, of at most {_MAX_MATERIAL / 1e6:.0f} MB"
        raise refusal(path, f"line {number}", f"mtllib {shown(name)}", expected, "remove the line")


def _harmless(target: Path) -> bool:
    try:
        status = target.lstat()
    except FileNotFoundError:
        return True
    except OSError:
        return False
    return stat.S_ISREG(status.st_mode) and status.st_size <= _MAX_MATERIAL
