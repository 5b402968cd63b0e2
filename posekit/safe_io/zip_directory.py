"""The size of a zip archive's directory, looked up before `zipfile` reads the directory as a whole.

Each of its entries becomes an object ten times its size: a directory of 1 GB would take the machine's memory
before the number of its entries can be asked for. The layout is that of PKWARE's APPNOTE 6.3, sections 4.3.14
to 4.3.16, read as `zipfile` reads it.
"""

from __future__ import annotations

import os
import struct
from typing import BinaryIO, Final

_END: Final = b"PK\x05\x06"
_END_64: Final = b"PK\x06\x06"
_LOCATOR_64: Final = b"PK\x06\x07"
_END_LENGTH, _END_64_LENGTH, _LOCATOR_LENGTH = 22, 56, 20
_LONGEST_COMMENT: Final = 0xFFFF


def directory_size(file: BinaryIO) -> int:
    """Return the declared bytes of an archive's directory, 0 where there is none that `zipfile` would find."""
    size = file.seek(0, os.SEEK_END)
    start = max(0, size - _END_LENGTH - _LONGEST_COMMENT - _END_64_LENGTH - _LOCATOR_LENGTH)
    file.seek(start)
    tail = file.read()
    file.seek(0)
    declared = 0
    place = tail.rfind(_END)
    while place >= 0:  # a comment may hold the mark too: the largest that any of them declares counts
        record = tail[place : place + _END_LENGTH]
        if len(record) == _END_LENGTH:
            declared = max(declared, struct.unpack_from("<I", record, 12)[0], _size_64(tail, place))
        place = tail.rfind(_END, 0, place)
    return declared


def _size_64(tail: bytes, place: int) -> int:
    """Return the size in the 64-bit record before the end record, 0 where there is none."""
    locator = place - _LOCATOR_LENGTH
    record = locator - _END_64_LENGTH
    if record < 0 or tail[locator : locator + 4] != _LOCATOR_64 or tail[record : record + 4] != _END_64:
        return 0
    return int(struct.unpack_from("<Q", tail, record + 40)[0])
