"""Write NPZ archives: the same arrays always give the same bytes. They are read by `posekit.safe_io`."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import IO, Any, BinaryIO, Final

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from posekit.safe_io.refusal import cut, nearest, refusal
from posekit.safe_io.regular_file import plain_suffix

_CHUNK: Final = 1 << 22
COMPRESSION_LEVEL: Final = 3
"""Of zlib: half the time of the usual 6, for files that are a fifth larger."""
COMPACT_LEVEL: Final = 9
"""Of what took longer to make than to write."""
_EPOCH: Final = (1980, 1, 1, 0, 0, 0)
"""The date of every member, so that the same content gives the same bytes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Ragged:
    """Rows of different lengths, stored as one array padded to the longest.

    Parameters
    ----------
    rows : sequence of F arrays (n_i, ...)
        All of one dtype and one shape after the first axis.
    fill : scalar
        What the padding holds.
    """

    rows: Sequence[NDArray[Any]]
    fill: Any

    @cached_property
    def counts(self) -> NDArray[np.intp]:
        """How long each row is (F,)."""
        return np.array([len(row) for row in self.rows], dtype=np.intp)

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the padded array."""
        return (len(self.rows), int(self.counts.max()), *self.rows[0].shape[1:])

    def padded(self) -> Iterator[NDArray[Any]]:
        """Yield the padded array in blocks of rows: of some megabytes, however much padding there is."""
        dtype = np.result_type(*self.rows)
        longest, tail = self.shape[1], self.shape[2:]
        step = max(1, _CHUNK // max(1, longest * math.prod(tail) * dtype.itemsize))
        for start in range(0, len(self.rows), step):
            rows = self.rows[start : start + step]
            block = np.full((len(rows), longest, *tail), self.fill, dtype=dtype)
            held = np.arange(longest) < self.counts[start : start + step, None]
            block[held] = np.concatenate(rows)
            yield block


def write_npz(
    file: BinaryIO, arrays: Mapping[str, NDArray[Any] | Ragged], *, level: int = COMPRESSION_LEVEL
) -> None:
    """Write arrays as a compressed NPZ, at a level of zlib; the same arrays always give the same bytes."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=level) as archive:
        for name, array in arrays.items():
            member = zipfile.ZipInfo(f"{name}.npy", _EPOCH)
            member.compress_type = zipfile.ZIP_DEFLATED
            member._compresslevel = level  # type: ignore[attr-defined]  # no argument of open() says it
            # The size is not known beforehand, and padding may take it past 4 GB.
            with archive.open(member, "w", force_zip64=True) as out:
                _write(out, array)


def _write(out: IO[bytes], array: NDArray[Any] | Ragged) -> None:
    if isinstance(array, Ragged):
        dtype, shape, pieces = np.result_type(*array.rows), array.shape, array.padded()
    else:
        dtype, shape, pieces = array.dtype, array.shape, iter([array])
    header = {"descr": npy.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
    npy.write_array_header_1_0(out, header)
    for piece in pieces:
        data = np.ascontiguousarray(piece, dtype=dtype).reshape(-1).view(np.uint8).data
        for start in range(0, len(data), _CHUNK):
            out.write(data[start : start + _CHUNK])


def suffix(path: str | Path, *accepted: str) -> str:
    """Return a path's suffix, which decides its format, or refuse it."""
    found = plain_suffix(path)
    if found not in accepted:
        remedy = nearest(found, accepted) if found else f"add {' or '.join(accepted)} to the name"
        raise refusal(path, "", f'the suffix "{cut(found)}"', " or ".join(accepted), remedy)
    return found
