"""Parquet: the tables of `posekit.formats.motion.motion_table` in columns on disk, by pyarrow.

Long tables are read and written in pieces.

What pandas' ``read_parquet`` gives is the table as it is. Which way is up stands in the file's metadata (``up``).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.formats.motion.motion import UP_DIRECTIONS, Motion
from posekit.formats.motion.motion_format import MotionFormat
from posekit.formats.motion.motion_table import (
    MAX_VALUES,
    Column,
    long_columns,
    motion_of,
    number_columns,
    wide_columns,
)
from posekit.safe_io import cut, extra, one_line, open_file, refusal, replacing

MAX_BYTES: Final = 100_000_000_000
"""The largest file that is read in pieces."""
ROWS_A_PIECE: Final = 65_536
"""Rows of one piece that is written."""


def read_parquet(path: str | Path, unit: str | None = None, *, as_recorded: bool = False) -> Motion:
    """Read points from a Parquet file, long or wide, as a whole.

    Parameters
    ----------
    path : path
        The file to read.
    unit : str, optional
        Of the coordinates; metres if not given.
    as_recorded : bool
        Whether times may be missing, stand still or go back.

    Raises
    ------
    InputError
        Where pyarrow is not installed, the file is damaged or too large for this (see `read_parquet_pieces`), or no
        such table.
    """
    with opened(path) as file:
        columns = columns_of(path, file)
        up = _up(file.schema_arrow)
    return motion_of(columns, str(path), unit, up, as_recorded=as_recorded)


def read_parquet_pieces(path: str | Path, unit: str | None = None) -> Iterator[Motion]:
    """Read points from a Parquet file one row group after the other: the file may be larger than memory.

    Yields
    ------
    Motion
        The frames of one row group; a frame of a long table that two groups share goes with the second.

    Raises
    ------
    InputError
        As `read_parquet`, while it is read.
    """
    with opened(path) as file:
        up = _up(file.schema_arrow)
        held: dict[str, Column] = {}
        rate = None
        for index in range(file.metadata.num_row_groups):
            columns = columns_of(path, file, index)
            columns = (
                {name: np.concatenate([held[name], columns[name]]) for name in columns} if held else columns
            )
            held = {}
            if "name" in columns and "frame" in columns and index + 1 < file.metadata.num_row_groups:
                last = int(np.searchsorted(columns["frame"], columns["frame"][-1]))
                held = {name: values[last:] for name, values in columns.items()}
                columns = {name: values[:last] for name, values in columns.items()}
            if len(next(iter(columns.values()), ())):
                piece = motion_of(columns, str(path), unit, up, rate)
                rate = rate or (piece.rate if len(piece) > 1 else None)
                yield piece


def write_parquet(path: str | Path, motion: Motion, *, long: bool = False) -> None:
    """Write points as Parquet, a row a frame, or a row a frame and point if `long`; whole or not at all."""
    write_parquet_pieces(path, (motion,), long=long)


def write_parquet_pieces(path: str | Path, motions: Iterable[Motion], *, long: bool = False) -> None:
    """Write motions of the same points one after the other into one file, whole or not at all.

    Raises
    ------
    InputError
        Where pyarrow is not installed, a piece has other points or another up, or the file cannot be written.
    """
    tables = (
        (long_columns(piece) if long else wide_columns(piece), {"up": piece.up} if piece.up else {})
        for piece in motions
    )
    write_tables(path, tables)


def write_tables(
    path: str | Path,
    tables: Iterable[tuple[Mapping[str, Column], Mapping[str, str]]],
    told: Mapping[str, str] | None = None,
) -> None:
    """Write tables of the same columns one after the other, each with the schema's metadata.

    What is `told` stands in the file's alone, once: pyarrow writes the schema's a second time.
    """
    pa = extra("pyarrow", "parquet", "writing Parquet")
    pq = extra("pyarrow.parquet", "parquet", "writing Parquet")
    with replacing(path) as file:
        writer = None
        try:
            for columns, metadata in tables:
                arrays = {name: _arrow(pa, name, values) for name, values in columns.items()}
                table = pa.table(arrays).replace_schema_metadata(dict(metadata))
                if writer is None:
                    writer = pq.ParquetWriter(file, table.schema, write_page_checksum=True)
                if table.schema != writer.schema:
                    raise refusal(
                        path, "", "pieces of different columns", "the same in all", "write two files"
                    )
                writer.write_table(table, row_group_size=ROWS_A_PIECE)
            if writer is not None and told:
                writer.add_key_value_metadata(told)
        except (pa.ArrowException, OverflowError) as error:
            raise refusal(
                path, "", f"pyarrow: {cut(one_line(str(error)))}", "a table", "choose another format"
            ) from None
        finally:
            if writer is not None:
                writer.close()


@contextmanager
def opened(path: str | Path, *, limit: int = MAX_BYTES, buffer_bytes: int = 0) -> Iterator[Any]:
    """Open a Parquet file; what pyarrow says about a damaged one, also while it is read, is one line.

    Parameters
    ----------
    path : path
        The file.
    limit : int
        Bytes that it may have.
    buffer_bytes : int
        How much of a row group is read at once; 0 for all of it.
    """
    pa = extra("pyarrow", "parquet", "reading Parquet")
    pq = extra("pyarrow.parquet", "parquet", "reading Parquet")
    with open_file(path, limit=limit) as file:
        try:
            # Reading ahead takes threads, which call Python for the file's bytes: also while the process ends.
            yield pq.ParquetFile(
                file, pre_buffer=False, buffer_size=buffer_bytes, page_checksum_verification=True
            )
        except (pa.ArrowException, OSError, MemoryError, UnicodeDecodeError) as error:
            reason = cut(one_line(str(error)) or type(error).__name__)
            raise refusal(
                path, "", f"pyarrow: {reason}", "an undamaged Parquet file", "write it again"
            ) from None


def columns_of(path: str | Path, file: Any, group: int | None = None) -> dict[str, Column]:
    """Read a table, or one of its row groups, as NumPy's columns: numbers, or else text; null is NaN or empty.

    Parameters
    ----------
    path : path
        What to call it in errors.
    file : pyarrow.parquet.ParquetFile
        As `opened` gives it.
    group : int, optional
        The row group; all of them if not given.

    Raises
    ------
    InputError
        Where it has more numbers than memory is meant for, or a column that a motion needs is no number.
    """
    rows = (file.metadata if group is None else file.metadata.row_group(group)).num_rows
    count = file.metadata.num_columns
    if rows < 1 or rows * count > MAX_VALUES:
        got = f"{rows:,} rows of {count:,} columns"
        remedy = "split it, or write it in smaller row groups"
        raise refusal(path, "", got, f"1 to {MAX_VALUES:,} numbers", remedy)
    groups = range(file.num_row_groups) if group is None else [group]
    table = file.read_row_groups(groups, use_threads=False)
    pa = extra("pyarrow", "parquet", "reading Parquet")
    wanted = number_columns(table.column_names)
    columns: dict[str, Column] = {}
    for name, values in zip(table.column_names, table.columns, strict=True):
        kind = values.type
        if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind):
            columns[name] = np.asarray(values.cast(pa.float64()).to_numpy(), dtype=np.float64)
        elif name in wanted:
            raise refusal(path, cut(one_line(name)), str(kind)[:60], "numbers", "write the column as numbers")
        elif pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_dictionary(kind):
            texts = values.combine_chunks().cast(pa.string()).fill_null("")
            columns[name] = np.array(texts.to_pylist(), dtype=np.str_)
    return columns


def _arrow(pa: Any, name: str, values: Column) -> Any:
    if values.dtype.kind == "U":
        return pa.array(values.tolist(), pa.string()).dictionary_encode()
    return pa.array(values.astype(np.int64) if name in ("frame", "survivor") else values)


def _up(schema: Any) -> str:
    found = (schema.metadata or {}).get(b"up", b"").decode("utf-8", "replace")
    return found if found in UP_DIRECTIONS else ""


PARQUET_FORMAT: Final = MotionFormat(
    name="parquet",
    title="Parquet, a row a frame or a row a point (needs the extra parquet)",
    suffixes=(".parquet", ".pq"),
    read=read_parquet,
    read_recorded=partial(read_parquet, as_recorded=True),
    write_points=write_parquet,
    written_by=("pyarrow.parquet", "parquet", "writing Parquet"),
    looks_like=lambda given: given.start.startswith(b"PAR1"),
)
