"""What is in a GLB: its JSON and its numbers, every index and every length checked before it is used.

Khronos Group, *glTF 2.0 Specification* (2021): §3.6 binary data, §4 the GLB file.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.errors import InputError
from posekit.formats.motion.glb_file import FLOAT_TYPE
from posekit.geometry import Array
from posekit.safe_io import parse_json, read_bytes, refusal, shown

MAX_GLB_BYTES: Final = 500_000_000
ELEMENT_WIDTHS: Final[Mapping[str, int]] = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
"""Numbers in an element, by the type of an accessor."""


@dataclass(frozen=True, kw_only=True)
class GlbContent:
    """A GLB, opened.

    Parameters
    ----------
    path : Path
        Where it is from.
    document : dict
        Its JSON.
    data : bytes
        Its binary chunk; empty where it has none.
    """

    path: Path
    document: dict[str, Any]
    data: bytes

    def items(self, kind: str) -> list[dict[str, Any]]:
        """Return one of the document's lists of objects; empty where it has none.

        Parameters
        ----------
        kind : str
            Its name, as ``nodes``.

        Raises
        ------
        InputError
            Where it is no list of objects.
        """
        found = self.document.get(kind, [])
        if not isinstance(found, list) or not all(isinstance(one, dict) for one in found):
            raise self.damaged(kind, shown(found), "a list of objects")
        return found

    def item(self, kind: str, index: object, where: str) -> dict[str, Any]:
        """Return the item that an index names.

        Parameters
        ----------
        kind : str
            The list, as ``accessors``.
        index : object
            What the document has for an index.
        where : str
            Where the index stands, for the message.

        Raises
        ------
        InputError
            Where there is no such item.
        """
        items = self.items(kind)
        if type(index) is not int or not 0 <= index < len(items):
            raise self.damaged(where, shown(index), f"the number of one of {len(items)} {kind}")
        return items[index]

    def floats(self, index: object, where: str) -> Array:
        """Return the numbers of an accessor (N, width), which are 32-bit floats without gaps.

        Parameters
        ----------
        index : object
            The accessor's number.
        where : str
            Where that number stands, for the message.

        Raises
        ------
        InputError
            Where there is no such accessor, its numbers are of another kind, lie outside the file, or are infinite.
        """
        accessor = self.item("accessors", index, where)
        view = self.item("bufferViews", accessor.get("bufferView"), f"{where}: bufferView")
        width = ELEMENT_WIDTHS.get(str(accessor.get("type")))
        plain = accessor.get("componentType") == FLOAT_TYPE and "sparse" not in accessor
        if width is None or not plain or view.get("byteStride", 4 * width) != 4 * width:
            raise self.damaged(where, "numbers of another kind", "32-bit floats without gaps")
        starts: tuple[Any, ...] = (
            view.get("byteOffset", 0),
            accessor.get("byteOffset", 0),
            accessor.get("count"),
        )
        if not all(type(one) is int and 0 <= one < MAX_GLB_BYTES for one in starts):
            raise self.damaged(where, shown(list(starts)), "offsets and a count from 0")
        start, count = starts[0] + starts[1], starts[2]
        if start + 4 * width * count > len(self.data):
            raise self.damaged(where, f"{4 * width * count} bytes from {start}", f"at most {len(self.data)}")
        values = np.frombuffer(self.data, "<f4", width * count, start).astype(np.float64)
        if not np.isfinite(values).all():
            raise self.damaged(where, "a number that is none", "finite numbers")
        return values.reshape(count, width)

    def damaged(self, where: str, got: str, expected: str) -> InputError:
        """Word a refusal of something in the file."""
        return refusal(self.path, where, got, expected, "write the file again")


def open_glb(path: Path) -> GlbContent:
    """Open a GLB.

    Parameters
    ----------
    path : Path
        A file of at most `MAX_GLB_BYTES`.

    Raises
    ------
    InputError
        Where it cannot be read, is no GLB of version 2, is cut off, or its JSON is damaged.
    """
    data = read_bytes(path, limit=MAX_GLB_BYTES, too_large="write fewer frames")
    if len(data) < 20 or data[:4] != b"glTF":
        raise refusal(path, "", "no GLB", "glTF 2.0 in one binary file", "check the format")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2 or length != len(data):
        got = f"version {version}, {length} bytes, and the file has {len(data)}"
        raise refusal(
            path, "", got, "version 2, and as many bytes as it says", "the file is cut off, or damaged"
        )
    chunks: dict[bytes, bytes] = {}
    start = 12
    while start + 8 <= len(data):
        size, kind = struct.unpack_from("<I4s", data, start)
        if start + 8 + size > len(data):
            raise refusal(path, "", f"a chunk of {size} bytes", "one inside the file", "write the file again")
        chunks.setdefault(kind, data[start + 8 : start + 8 + size])
        start += 8 + size
    document = parse_json(path, chunks.get(b"JSON", b"").rstrip(b" "))
    if not isinstance(document, dict):
        raise refusal(path, "", shown(document), "a glTF document", "write the file again")
    return GlbContent(path=path, document=document, data=chunks.get(b"BIN\0", b""))
