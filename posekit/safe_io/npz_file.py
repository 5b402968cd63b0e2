"""Read NPZ archives without pickles, in pieces, and with bounds that are checked beforehand.

`numpy.load` allocates what an array's header declares, and a zip of a few kilobytes can declare terabytes.
Here the declared sizes are compared with the archive's directory and with a limit first.
"""

from __future__ import annotations

import math
import struct
import sys
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tokenize import TokenError
from typing import IO, Any, BinaryIO, Final

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.safe_io.refusal import cut, refusal, shown
from posekit.safe_io.regular_file import open_file, unreadable
from posekit.safe_io.zip_directory import directory_size

MAX_ARRAYS: Final = 1_000_000_000
"""Bytes of memory that the arrays of one archive may take."""
MAX_MEMBERS: Final = 10_000
"""Arrays of one archive: far more than any file of posekit has."""

MAX_DIRECTORY: Final = 10_000_000
"""Bytes of an archive's directory: that of 10,000 members with names of ordinary length is 1 MB."""
_CHUNK: Final = 1 << 22
"""Bytes of padding that are read, and dropped, at a time."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Archive:
    """An open NPZ, its declared sizes checked; made by `open_npz`."""

    path: str | Path
    zip: zipfile.ZipFile

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of its arrays."""
        return tuple(name.removesuffix(".npy") for name in self.zip.namelist())

    def check_held(self, limit: int, *, but: tuple[str, ...] = ()) -> None:
        """Refuse more bytes than this, unpacked, in the arrays whose names do not start with `but`."""
        declared = sum(
            member.file_size for member in self.zip.infolist() if not member.filename.startswith(but or "\0")
        )
        if declared > limit:
            raise _too_large(self.path, declared, limit)

    def lacks(self, name: str) -> InputError:
        """Return the refusal of an archive without an array that it should have."""
        remedy = f"add it; there is {', '.join(self.names)[:200]}"
        return refusal(self.path, name, "nothing", f"the array {name}", remedy)

    def array(self, name: str, kinds: str, shape: tuple[int | None, ...] | None) -> NDArray[Any]:
        """Read an array.

        Parameters
        ----------
        name : str
            Its name in the archive.
        kinds : str
            NumPy's letters of the dtypes that are accepted, ``"fiu"``.
        shape : tuple of int or None
            The shape that is expected, None where any extent is accepted; None for any shape.
        """
        with self._member(name, kinds, shape) as (file, found, dtype, fortran):
            data = _read(file, math.prod(found) * dtype.itemsize)
        return _values(self.path, name, data, dtype).reshape(found, order="F" if fortran else "C")

    def ragged(
        self, name: str, kinds: str, counts: NDArray[np.int64], tail: tuple[int | None, ...]
    ) -> list[Any]:
        """Read the first ``counts[i]`` entries of each row of a padded array ``(F, Nmax, *tail)``.

        The padding is passed over in pieces and never held.
        """
        rows = []
        with self._member(name, kinds, (len(counts), None, *tail)) as (file, found, dtype, fortran):
            if fortran or (len(counts) and counts.max() > found[1]):
                raise refusal(
                    self.path,
                    name,
                    f"shape {found}{' in Fortran order' if fortran else ''}",
                    f"({len(counts)}, {int(counts.max(initial=0))} or more, …) in C order",
                    "write the file again",
                )
            width = math.prod(found[2:]) * dtype.itemsize
            for count in counts.tolist():
                data = _read(file, count * width)
                rows.append(_values(self.path, name, data, dtype).reshape(count, *found[2:]))
                _skip(file, (found[1] - count) * width)
        return rows

    @contextmanager
    def _member(
        self, name: str, kinds: str, shape: tuple[int | None, ...] | None
    ) -> Iterator[tuple[IO[bytes], tuple[int, ...], np.dtype[Any], bool]]:
        """Open an array whose header says what is expected, at its data."""
        if name not in self.names:
            raise self.lacks(name)
        member = self.zip.getinfo(f"{name}.npy")
        with self.zip.open(member) as file:
            found, fortran, dtype = _header(self.path, name, file)
            length = math.prod(found) * dtype.itemsize
            if dtype.hasobject or dtype.kind not in kinds or dtype.itemsize == 0:
                raise refusal(
                    self.path,
                    name,
                    f"dtype {dtype}",
                    _KINDS[kinds],
                    "save it again as such; pickles are not read",
                )
            # The header must declare just what the member holds, else `_read` would allocate what is not there.
            if length != member.file_size - file.tell() or min(found, default=0) < 0:
                raise refusal(
                    self.path,
                    name,
                    f"{member.file_size - file.tell():,} bytes",
                    f"{length:,} for shape {found}",
                    "write the file again: it is damaged",
                )
            if shape is not None and (
                len(found) != len(shape)
                or any(want not in (None, have) for want, have in zip(shape, found, strict=True))
            ):
                wanted = f"({', '.join('any' if extent is None else str(extent) for extent in shape)})"
                raise refusal(self.path, name, f"shape {found}", f"shape {wanted}", "reshape it")
            yield file, found, dtype, fortran


_KINDS: Final = {
    "f": "floating-point numbers",
    "iuf": "numbers",
    "iu": "whole numbers",
    "U": "text (a unicode array)",
    "iufU": "numbers or text",
}


@contextmanager
def open_npz(path: str | Path, *, limit: int = MAX_ARRAYS) -> Iterator[Archive]:
    """Open an NPZ for reading.

    Parameters
    ----------
    path : path
        A zip archive of ``.npy`` members.
    limit : int
        Bytes that all members may declare together, uncompressed.

    Raises
    ------
    InputError
        Where it is no such archive, or damaged (also while it is read), or declares more than `limit`.
    """
    with open_file(path, limit=limit) as file, archive_in(path, file, limit=limit) as archive:
        yield archive


@contextmanager
def archive_in(path: str | Path, file: BinaryIO, *, limit: int) -> Iterator[Archive]:
    """Open an NPZ that an open file is, as `open_npz` does; errors call it by the path."""
    try:
        declared = directory_size(file)
        if declared > MAX_DIRECTORY:
            got = f"a directory of {declared / 1e6:,.0f} MB"
            raise refusal(path, "", got, f"at most {MAX_DIRECTORY / 1e6:,.0f} MB", "split it")
        archive = zipfile.ZipFile(file)
    except (zipfile.BadZipFile, ValueError, OverflowError, NotImplementedError, struct.error) as error:
        raise _damaged(path, error) from None
    except OSError as error:
        raise unreadable(path, error) from None
    try:
        with archive:
            _check_directory(path, archive, limit)
            yield Archive(path=path, zip=archive)
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        NotImplementedError,
        RuntimeError,
        struct.error,
    ) as error:
        raise _damaged(path, error) from None
    except OSError as error:
        raise unreadable(path, error) from None


def read_npy(path: str | Path, kinds: str, *, limit: int = MAX_ARRAYS) -> NDArray[Any]:
    """Read the one array of an NPY.

    Parameters
    ----------
    path : path
        A ``.npy`` file.
    kinds : str
        NumPy's letters of the dtypes that are accepted, ``"iuf"``.
    limit : int
        Bytes that it may have.

    Raises
    ------
    InputError
        Where it is no such file, or holds pickles, or another number of bytes than it declares.
    """
    with open_file(path, limit=limit) as file:
        shape, fortran, dtype = _header(path, "", file)
        if dtype.hasobject or dtype.kind not in kinds or dtype.itemsize == 0:
            remedy = "save it again as such; pickles are not read"
            raise refusal(path, "", f"dtype {dtype}", _KINDS[kinds], remedy)
        data = file.read(limit + 1)
    length = math.prod(shape) * dtype.itemsize
    if len(data) != length or min(shape, default=0) < 0:
        remedy = "write the file again: it is damaged"
        raise refusal(path, "", f"{len(data):,} bytes", f"{length:,} for shape {shape}", remedy)
    return _values(path, "", data, dtype).reshape(shape, order="F" if fortran else "C")


def _check_directory(path: str | Path, archive: zipfile.ZipFile, limit: int) -> None:
    members = archive.infolist()
    if len(members) > MAX_MEMBERS:
        raise refusal(path, "", f"{len(members):,} members", f"at most {MAX_MEMBERS:,}", "split it")
    for member in members:
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            method = f"compression method {member.compress_type}"
            raise refusal(path, "", method, "none, or deflate", "save it with numpy.savez_compressed")
        if not member.filename.endswith(".npy"):
            raise refusal(
                path,
                "",
                f"a member {shown(member.filename)}",
                "arrays (.npy) alone",
                "save it with numpy.savez",
            )
    # `zipfile` gives the last of two members of one name, other readers the first: a file must not mean two things.
    if len({member.filename for member in members}) != len(members):
        raise refusal(path, "", "two arrays of one name", "each name once", "save it with numpy.savez")
    declared = sum(member.file_size for member in members)
    if declared > limit:
        raise _too_large(path, declared, limit)


def _damaged(path: str | Path, error: Exception) -> InputError:
    return refusal(path, "", cut(str(error)), "an undamaged .npz archive", "write it again")


def _too_large(path: str | Path, declared: int, limit: int) -> InputError:
    got = f"{declared / 1e6:,.0f} MB of arrays when unpacked"
    return refusal(path, "", got, f"at most {limit / 1e6:,.0f} MB", "split it")


def _header(path: str | Path, name: str, file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    try:
        version = npy.read_magic(file)
        if version == (1, 0):
            return npy.read_array_header_1_0(file)
        if version == (2, 0):
            return npy.read_array_header_2_0(file)
    except (ValueError, TypeError, SyntaxError, KeyError, MemoryError, RecursionError, TokenError) as error:
        reason = cut(str(error))
        raise refusal(
            path, name, reason, "an array as numpy.save writes it", "write the file again"
        ) from None
    raise refusal(path, name, f"npy format {version}", "npy format 1.0 or 2.0", "save it with numpy.savez")


def _values(path: str | Path, name: str, data: bytes, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Take bytes as an array; text must be text."""
    if dtype.kind == "U" and (np.frombuffer(data, dtype.byteorder + "u4") > sys.maxunicode).any():
        raise refusal(
            path, name, "bytes that are no characters", "text", "write the file again: it is damaged"
        )
    return np.frombuffer(data, dtype)


def _read(file: IO[bytes], count: int) -> bytes:
    """Read so many bytes: a zip member may give fewer at a time."""
    data = file.read(count) if count else b""
    if len(data) != count:
        raise EOFError("an array ends early")
    return data


def _skip(file: IO[bytes], count: int) -> None:
    while count:
        piece = len(_read(file, min(count, _CHUNK)))
        count -= piece


def not_finite(path: str | Path, name: str, values: NDArray[Any]) -> InputError:
    """Word where an array holds an infinite number."""
    where = ", ".join(str(int(index)) for index in np.argwhere(np.isinf(values))[0])
    return refusal(path, f"{name}[{where}]", "an infinite number", "finite numbers or NaN", "correct it")
