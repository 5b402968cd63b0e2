"""Open regular files alone, with a bound on their size: no directory, pipe or device, none that grows."""

from __future__ import annotations

import gzip
import io
import os
import stat
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from itertools import islice
from pathlib import Path
from typing import BinaryIO

from posekit.errors import InputError
from posekit.safe_io.refusal import cut, refusal

PACKED_SUFFIX = ".json.gz"
"""How the names of JSON files end that are packed by gzip."""
MAX_UNPACKED = 100_000_000
"""Bytes that may be packed in one."""
MAX_NEIGHBOURS = 2000
"""Names of a folder among which a misspelt one is sought."""
_OPEN_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0)
"""Opening a pipe would wait for its other end: one that took the file's place after the first look must not."""


def read_bytes(path: str | Path, *, limit: int, too_large: str = "split it") -> bytes:
    """Read a regular file of at most `limit` bytes, which is checked before a byte is read.

    Parameters
    ----------
    path : path
        The file; symbolic links are followed.
    limit : int
        Bytes.
    too_large : str
        What to do about a file that is larger.

    Returns
    -------
    bytes
        The file; of one whose name ends in ``.json.gz`` what is packed in it, of at most `limit` bytes as well, and
        of `MAX_UNPACKED`.

    Raises
    ------
    InputError
        Where it is missing, not readable, no regular file, empty or larger, or damaged where it is packed.
    """
    with open_file(path, limit=limit, too_large=too_large) as file:
        try:
            data = file.read(limit + 1)
        except OSError as error:
            raise unreadable(path, error) from None
    if len(data) > limit:
        raise _too_large(path, len(data), limit, too_large)
    return _unpacked(path, data, min(limit, MAX_UNPACKED), too_large) if is_packed(path) else data


def is_packed(path: str | Path) -> bool:
    """Tell by a file's name whether it is JSON that is packed by gzip."""
    return Path(path).name.lower().endswith(PACKED_SUFFIX)


def plain_suffix(path: str | Path) -> str:
    """Return the ending of a file's name in lower case; of packed JSON ``.json``."""
    return ".json" if is_packed(path) else Path(path).suffix.lower()


def _unpacked(path: str | Path, data: bytes, limit: int, too_large: str) -> bytes:
    """Unpack no more than is allowed: a thousand bytes may hold a million."""
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as file:
            plain = file.read(limit + 1)
    except (OSError, EOFError, zlib.error):
        expected = "JSON that is packed by gzip"
        raise refusal(path, "", "a damaged file, or none of gzip", expected, "pack it again") from None
    if len(plain) > limit:
        raise refusal(path, "", f"more than {limit:,} bytes unpacked", f"at most {limit:,}", too_large)
    if not plain:
        raise refusal(path, "", "nothing that is packed", "JSON", "pack it again")
    return plain


@contextmanager
def open_file(path: str | Path, *, limit: int, too_large: str = "split it") -> Iterator[BinaryIO]:
    """Open a regular file of at most `limit` bytes for reading; see `read_bytes`."""
    check_file(path, limit=limit, too_large=too_large)
    try:
        handle = os.open(path, _OPEN_FLAGS)
    except (OSError, ValueError) as error:
        raise unreadable(path, error) from None
    with os.fdopen(handle, "rb") as file:
        # Asked again of the open file: another one may have taken the name since the first look.
        _check_status(path, os.fstat(handle), limit, too_large)
        yield file


def check_file(path: str | Path, *, limit: int, too_large: str = "split it") -> None:
    """Refuse a path that is missing, no regular file, empty, or larger than `limit` bytes."""
    try:
        status = Path(path).stat()
    except (OSError, ValueError) as error:
        raise unreadable(path, error) from None
    _check_status(path, status, limit, too_large)


def unreadable(path: str | Path, error: Exception) -> InputError:
    """Word the operating system's refusal to give a file."""
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    if isinstance(error, FileNotFoundError) and (near := _neighbours(Path(path))):
        return refusal(path, "", cut(reason), "the name of a file that is there", near)
    return refusal(path, "", cut(reason), "a readable file", "check the name and the permissions")


def _neighbours(path: Path) -> str:
    """Suggest files of nearly that name beside it; empty where there is none."""
    try:
        with os.scandir(path.parent) as entries:
            names = [entry.name for entry in islice(entries, MAX_NEIGHBOURS)]
    except (OSError, ValueError):
        return ""
    near = get_close_matches(path.name, names, n=2)
    return f"did you mean {' or '.join(str(path.with_name(name)) for name in near)}?" if near else ""


def _check_status(path: str | Path, status: os.stat_result, limit: int, too_large: str) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise refusal(path, "", "a directory", "a file", "name one file in it")
    if not stat.S_ISREG(status.st_mode):
        raise refusal(path, "", "a pipe or a device", "a regular file", "save its content to a file first")
    if status.st_size == 0:
        raise refusal(path, "", "an empty file", "a file with content", "check how it was written")
    if status.st_size > limit:
        raise _too_large(path, status.st_size, limit, too_large)


def _too_large(path: str | Path, size: int, limit: int, remedy: str) -> InputError:
    return refusal(path, "", f"{size / 1e6:,.1f} MB", f"at most {limit / 1e6:,.0f} MB", remedy)
