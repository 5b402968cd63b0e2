"""A result as Parquet: its survivors as a table, a row a body, with the whole result packed in the file's metadata.

Under the key ``posekit.result/2`` stand the bytes of the result's NPZ in base64, since metadata is text. They are what
is read as a result; the table is for pandas and its like, and is not looked at.
"""

from __future__ import annotations

import base64
import binascii
import io
from pathlib import Path
from typing import Final

from posekit.errors import TooLargeError
from posekit.formats.motion.parquet import opened
from posekit.formats.motion.survivors import SurvivorTable
from posekit.formats.motion.survivors_files import write_survivor_pieces
from posekit.formats.own.result import RESULT_SCHEMA, Result
from posekit.formats.own.result_npz import MAX_PADDED, pack_result, result_in
from posekit.safe_io.npz_file import archive_in
from posekit.safe_io.refusal import refusal

MAX_PACKED: Final = 75_000_000
"""Bytes of an NPZ whose 100 MB of base64 pyarrow and pandas still read: more is too long a text to them."""


def write_result_parquet(path: str | Path, result: Result, table: SurvivorTable) -> None:
    """Write a result with the table of its survivors, whole or not at all.

    Parameters
    ----------
    path : path
        The file to write.
    result : Result
        What is packed.
    table : SurvivorTable
        Its survivors.

    Raises
    ------
    InputError
        Where pyarrow is not installed, or the file cannot be written, or would be larger than can be read again.
    """
    packed = io.BytesIO()
    pack_result(packed, result)
    size = packed.tell()
    if size > MAX_PACKED:
        got = f"a result of {size / 1e6:,.0f} MB"
        expected = f"at most {MAX_PACKED / 1e6:,.0f} MB in a Parquet file"
        raise TooLargeError(str(refusal(path, "", got, expected, "name it .npz")))
    told = {RESULT_SCHEMA: base64.b64encode(packed.getbuffer()).decode("ascii")}
    write_survivor_pieces(path, (table,), told)


def read_result_parquet(path: str | Path) -> Result:
    """Read the result that is packed in a Parquet file; see `posekit.formats.own.read_result`."""
    told = _packed(path)
    if told is None:
        expected = f"a result under {RESULT_SCHEMA}, as posekit recover writes it"
        raise refusal(path, "metadata", "none of a result", expected, "name the result that the table is of")
    try:
        packed = base64.b64decode(told, validate=True)
    except binascii.Error as error:
        raise refusal(path, RESULT_SCHEMA, str(error), "an NPZ in base64", "write it again") from None
    with archive_in(path, io.BytesIO(packed), limit=MAX_PADDED) as archive:
        return result_in(archive)


def packed_schema(path: Path) -> str:
    """Return the schema of the result that is packed in a Parquet file; empty where there is none."""
    return "" if _packed(path) is None else RESULT_SCHEMA


def _packed(path: str | Path) -> bytes | None:
    with opened(path) as file:
        found: bytes | None = (file.metadata.metadata or {}).get(RESULT_SCHEMA.encode())
    return found
