"""The container of glTF 2.0 in one binary file: a chunk of JSON and a chunk of numbers.

Khronos Group, *glTF 2.0 Specification* (2021): §3.6 binary data, §4 the GLB file. Numbers are little-endian and stand
at multiples of 4 bytes; both chunks are padded to 4 bytes, JSON with blanks, numbers with zeros.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.safe_io import refusal, replacing

FLOAT_TYPE, UINT16_TYPE = 5126, 5123
"""Component types."""
VERTEX_TARGET, INDEX_TARGET = 34962, 34963
"""What a mesh's buffer views are for."""
_TYPES: Final = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
_DTYPES: Final = {FLOAT_TYPE: "<f4", UINT16_TYPE: "<u2"}
MAX_BYTES: Final = 2_000_000_000
"""The format's lengths are 32-bit numbers."""


class GlbFile:
    """A glTF document that grows, and its numbers.

    Attributes
    ----------
    document : dict
        The JSON: ``nodes``, ``meshes``, …; accessors and buffer views are added by `accessor`.
    """

    def __init__(self) -> None:
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "posekit"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
        }
        self._data = bytearray()

    def append(self, kind: str, item: dict[str, Any]) -> int:
        """Append an item to one of the document's lists and return its index."""
        items: list[dict[str, Any]] = self.document.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def accessor(
        self, values: NDArray[Any], kind: int = FLOAT_TYPE, *, target: int | None = None, bounds: bool = False
    ) -> int:
        """Add numbers and return their accessor.

        Parameters
        ----------
        values : array (N,) or (N, 3) or (N, 4)
            The numbers, a row an element.
        kind : int
            `FLOAT_TYPE` or `UINT16_TYPE`.
        target : int, optional
            `VERTEX_TARGET` or `INDEX_TARGET`, for a mesh.
        bounds : bool
            Whether to state the least and the largest: for positions of vertices and times of key frames.
        """
        data = np.ascontiguousarray(values, dtype=_DTYPES[kind])
        view = {"buffer": 0, "byteOffset": len(self._data), "byteLength": data.nbytes}
        if target is not None:
            view["target"] = target
        table = data.reshape(len(data), -1)
        accessor: dict[str, Any] = {
            "bufferView": self.append("bufferViews", view),
            "componentType": kind,
            "count": len(data),
            "type": _TYPES[table.shape[1]],
        }
        if bounds:
            accessor["min"], accessor["max"] = table.min(axis=0).tolist(), table.max(axis=0).tolist()
        self._data += data.tobytes()
        self._data += bytes(-len(self._data) % 4)
        return self.append("accessors", accessor)

    def write(self, path: str | Path) -> None:
        """Write the file, whole or not at all."""
        document = {**self.document, "buffers": [{"byteLength": len(self._data)}]}
        text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode("ascii")
        text += b" " * (-len(text) % 4)
        length = 12 + 8 + len(text) + 8 + len(self._data)
        if length > MAX_BYTES:
            got, limit = f"{length / 1e6:,.0f} MB", f"at most {MAX_BYTES / 1e6:,.0f} MB"
            raise refusal(path, "", got, limit, "write fewer frames")
        with replacing(path) as file:
            file.write(struct.pack("<4sII", b"glTF", 2, length))
            file.write(struct.pack("<I4s", len(text), b"JSON") + text)
            file.write(struct.pack("<I4s", len(self._data), b"BIN\0"))
            file.write(self._data)
