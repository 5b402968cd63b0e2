"""The parameters of a C3D file: names in groups, each with a type, dimensions and values, all checked for length."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.safe_io import refusal, shown

MAX_PARAMETERS: Final = 10_000
_SIZES: Final = {-1: 1, 1: 1, 2: 2, 4: 4}
"""Bytes of a value by type: text, byte, 16-bit integer, 32-bit float."""


@dataclass(frozen=True, kw_only=True)
class Processor:
    """How a file's numbers are spelled, by the processor that wrote it: 84 Intel, 85 DEC, 86 MIPS."""

    code: int

    @property
    def order(self) -> str:
        """Byte order as `struct` names it; DEC's integers are Intel's."""
        return ">" if self.code == 86 else "<"

    def integers(self, data: bytes, size: int, sign: str = "i") -> NDArray[Any]:
        """Decode integers of 1, 2 or 4 bytes, signed (``i``) or not (``u``)."""
        return np.frombuffer(data, f"{self.order}{sign}{size}")

    def floats(self, data: bytes) -> NDArray[np.float32]:
        """Decode 32-bit floats; DEC's have their halves exchanged and four times the value."""
        if self.code != 85:
            return np.frombuffer(data, f"{self.order}f4").astype(np.float32)
        words = np.frombuffer(data, "<u2").astype(np.uint32).reshape(-1, 2)
        return (words[:, 0] << 16 | words[:, 1]).view(np.float32) / np.float32(4)


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One parameter: its type (-1 text, 1 byte, 2 integer, 4 float), dimensions and bytes."""

    kind: int
    dimensions: tuple[int, ...]
    data: bytes
    processor: Processor

    @property
    def texts(self) -> list[str]:
        """Its texts, without the blanks at their ends; none where it is of numbers."""
        if self.kind != -1 or not self.data:
            return []
        length = self.dimensions[0] if self.dimensions else 1
        text = self.data.decode("latin-1")
        return [text[start : start + length].strip(" \0") for start in range(0, len(text), length)]

    @property
    def numbers(self) -> NDArray[np.float64]:
        """Its numbers, none where it is text; integers count from 0, as all that posekit reads do."""
        if self.kind == -1:
            return np.empty(0)
        if self.kind == 4:
            return self.processor.floats(self.data).astype(np.float64)
        return self.processor.integers(self.data, self.kind, "u").astype(np.float64)


@dataclass(frozen=True)
class ParameterSection:
    """The section of parameters: from byte `start`, and not beyond `end`, where the frames are."""

    path: str | Path
    data: bytes
    start: int
    end: int
    processor: Processor

    def read(self) -> dict[str, Parameter]:
        """Return the parameters by group and name, ``POINT:FRAMES``.

        Raises
        ------
        InputError
            Where a length leads out of its parameter, or one is in no group.
        """
        groups: dict[int, str] = {}
        found: list[tuple[int, str, Parameter]] = []
        place = self.start + 4
        while place + 2 <= self.end and self.data[place] != 0:
            if len(groups) + len(found) > MAX_PARAMETERS:
                raise self._damaged(place, f"more than {MAX_PARAMETERS:,} parameters")
            length, group = struct.unpack_from("bb", self.data, place)
            after_name = place + 2 + abs(length)
            self._inside(after_name + 2, place, self.end)
            name = self.data[place + 2 : after_name].decode("latin-1").strip().upper()
            (offset,) = struct.unpack_from(f"{self.processor.order}H", self.data, after_name)
            after = after_name + offset if offset else self.end
            self._inside(after, place, self.end)
            if group == 0:
                raise self._damaged(place, "group 0")
            if group < 0:
                groups[-group] = name
            else:
                found.append((group, name, self._parameter(after_name + 2, place, after)))
            if not offset:
                break
            place = max(after, after_name + 2)
        for group, name, _ in found:
            if group not in groups:
                raise self._damaged(self.start, f"{shown(name)} in no group")
        return {f"{groups[group]}:{name}": parameter for group, name, parameter in found}

    def _parameter(self, place: int, start: int, after: int) -> Parameter:
        self._inside(place + 2, start, after)
        kind = struct.unpack_from("b", self.data, place)[0]
        begin = place + 2 + self.data[place + 1]
        if kind not in _SIZES:
            raise self._damaged(start, f"type {kind}")
        self._inside(begin, start, after)
        dimensions = tuple(self.data[place + 2 : begin])
        end = begin + math.prod(dimensions) * _SIZES[kind]
        self._inside(end, start, after)
        return Parameter(
            kind=kind, dimensions=dimensions, data=self.data[begin:end], processor=self.processor
        )

    def _inside(self, place: int, start: int, bound: int) -> None:
        if place > bound:
            raise self._damaged(start, f"a length that ends at byte {place}")

    def _damaged(self, place: int, got: str) -> InputError:
        expected = f"parameters that end by byte {self.end}"
        return refusal(self.path, f"parameters, byte {place}", got, expected, DAMAGED_REMEDY)


DAMAGED_REMEDY: Final = "the file is cut off or damaged: export it again"
