"""STL: the number of triangles against the size of the file, and every vertex finite."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np

from posekit.safe_io.mesh_numbers import check_finite, finite_numbers
from posekit.safe_io.refusal import refusal

_HEADER: Final = 84
_TRIANGLE: Final = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)")


def count_stl(path: Path, data: bytes) -> int:
    """Look through an STL file and count its triangles.

    A file whose size is that of its declared number of triangles is binary, even where it starts with
    ``solid``; what starts with ``solid`` otherwise is text.
    """
    declared = int.from_bytes(data[80:_HEADER], "little") if len(data) >= _HEADER else -1
    needed = _HEADER + declared * _TRIANGLE.itemsize
    if data.lstrip().startswith(b"solid") and needed != len(data):
        return _count_text(path, data)
    if not 0 < declared or needed > len(data):
        got = f"{max(declared, 0):,} triangles in {len(data):,} bytes"
        expected = f"84 bytes and {_TRIANGLE.itemsize} for each triangle, or text that starts with solid"
        raise refusal(path, "", got, expected, "export the mesh again")
    check_finite(path, "vertices", np.frombuffer(data, _TRIANGLE, declared, _HEADER)["vertices"])
    return declared


def _count_text(path: Path, data: bytes) -> int:
    vertices = _VERTEX.findall(data)
    facets, words = data.count(b"endfacet"), data.count(b"vertex")
    if not facets or len(vertices) != 3 * facets or words != len(vertices):
        got = f"{facets:,} facets and {words:,} vertices, {len(vertices):,} of them with three coordinates"
        raise refusal(path, "", got, "three vertices in each facet", "export the mesh again")
    finite_numbers(path, "vertex", [word for vertex in vertices for word in vertex])
    return facets
