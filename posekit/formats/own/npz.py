"""Write NPZ archives: the same arrays always give the same bytes. They are read by `posekit.safe_io`."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, BinaryIO, Final

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from posekit.safe_io.npz_file import MAX_ARRAYS, Archive, not_finite, open_npz
from posekit.safe_io.refusal import cut, nearest, refusal

__all__ = ["MAX_ARRAYS", "Archive", "Ragged", "not_finite", "open_npz", "suffix", "write_npz"]

_CHUNK: Final = 1 << 22
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


def write_npz(file: BinaryIO, arrays: Mapping[str, NDArray[Any] | Ragged]) -> None:
    """Write arrays as a compressed NPZ; the same arrays always give the same bytes."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in arrays.items():
            member = zipfile.ZipInfo(f"{name}.npy", _EPOCH)
            member.compress_type = zipfile.ZIP_DEFLATED
            with archive.open(member, "w", force_zip64=True) as out:
                _write(out, array)


def _write(out: IO[bytes], array: NDArray[Any] | Ragged) -> None:
    if isinstance(array, Ragged):
        dtype = np.result_type(*array.rows)
        longest = max(len(row) for row in array.rows)
        shape = (len(array.rows), longest, *array.rows[0].shape[1:])
        padding = np.full(shape[1:], array.fill, dtype=dtype)
        pieces = [piece for row in array.rows for piece in (row, padding[len(row) :])]
    else:
        dtype, shape, pieces = array.dtype, array.shape, [array]
    header = {"descr": npy.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
    npy.write_array_header_1_0(out, header)
    for piece in pieces:
        data = np.ascontiguousarray(piece, dtype=dtype).tobytes()
        for start in range(0, len(data), _CHUNK):
            out.write(data[start : start + _CHUNK])


def suffix(path: str | Path, *accepted: str) -> str:
    """Return a path's suffix, which decides its format, or refuse it."""
    found = Path(path).suffix.lower()
    if found not in accepted:
        remedy = nearest(found, accepted) if found else f"add {' or '.join(accepted)} to the name"
        raise refusal(path, "", f'the suffix "{cut(found)}"', " or ".join(accepted), remedy)
    return found
