"""CSV: tables of points that pandas reads with `read_csv` as they are; see `posekit.formats.motion.motion_table`.

Metres, seconds, a dot for the decimals, UTF-8, a comma between cells (semicolons and tabs are read too). Numbers are
written so that they read back exactly. The axes' meaning is not in the file.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.distinct import check_distinct
from posekit.formats.given_file import GivenFile
from posekit.formats.motion.motion import Motion
from posekit.formats.motion.motion_format import MotionFormat
from posekit.formats.motion.motion_table import (
    Column,
    is_motion,
    is_triangulated,
    long_columns,
    motion_of,
    number_columns,
    wide_columns,
)
from posekit.formats.motion.robot_columns import has_root_turn
from posekit.safe_io import cut, one_line, read_text, refusal, replacing, shown

MAX_BYTES: Final = 500_000_000
MAX_COLUMNS: Final = 30_010
_CHUNK: Final = 20_000
"""Rows that are held as text at a time."""


def read_csv_motion(path: str | Path, unit: str | None = None, *, as_recorded: bool = False) -> Motion:
    """Read points from a CSV, long or wide.

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
        Where it is no such table, a row is short, a cell no number, or the frames are out of order.
    """
    return motion_of(read_columns(path, number_columns), str(path), unit, as_recorded=as_recorded)


def write_csv_motion(path: str | Path, motion: Motion, *, long: bool = False) -> None:
    """Write points as CSV, a row a frame, or a row a frame and point if `long`; whole or not at all."""
    columns = long_columns(motion) if long else wide_columns(motion)
    if long:
        columns["frame"] = columns["frame"].astype(np.intp)
    write_columns(path, columns)


def read_columns(path: str | Path, numbers: Callable[[Sequence[str]], Collection[str]]) -> dict[str, Column]:
    """Read a CSV's columns: those that `numbers` chooses as such, NaN where a cell is empty; the others as text.

    Raises
    ------
    InputError
        Where a row has another number of cells than the first line, a column comes twice, or a cell is no number.
    """
    document = read_text(path, limit=MAX_BYTES, too_large="split it, or use Parquet")
    lines = csv.reader(io.StringIO(document, newline=""), delimiter=_delimiter(document))
    try:
        names = [name.strip() for name in next(lines, [])]
        _check_names(path, names)
        chosen = numbers(names)
        chunks: list[dict[str, Column]] = []
        count = 0
        while rows := list(islice(lines, _CHUNK)):
            chunks.append(_chunk(path, names, rows, chosen, count))
            count += len(rows)
    except csv.Error as error:
        got = cut(one_line(str(error)))
        raise refusal(path, f"line {lines.line_num}", got, "a table of cells", "correct the quotes") from None
    if not chunks:
        raise refusal(path, "", "no rows", "a row of names, then rows of numbers", "check how it was written")
    return {name: np.concatenate([chunk[name] for chunk in chunks]) for name in names}


def write_columns(path: str | Path, columns: Mapping[str, NDArray[Any]]) -> None:
    """Write columns of numbers and text as CSV, whole or not at all; NaN is an empty cell."""
    with replacing(path) as file:
        for piece in _pieces(columns):
            file.write(piece.encode("utf-8"))


def _pieces(columns: Mapping[str, NDArray[Any]]) -> Iterator[str]:
    yield _line(columns) + "\n"
    count = len(next(iter(columns.values())))
    for start in range(0, count, _CHUNK):
        cells = [_cells(values[start : start + _CHUNK]) for values in columns.values()]
        yield "".join(f"{','.join(row)}\n" for row in zip(*cells, strict=True))


def _cells(values: NDArray[Any]) -> list[str]:
    if values.dtype.kind == "f":
        return ["" if value == "nan" else value for value in map(repr, values.tolist())]
    if values.dtype.kind in "iu":
        return [str(value) for value in values.tolist()]
    return [_line([str(value)]) for value in values.tolist()]


def _line(cells: Any) -> str:
    """Spell a row with quotes where they are needed."""
    line = io.StringIO()
    csv.writer(line, lineterminator="").writerow(list(cells))
    return line.getvalue()


def _delimiter(document: str) -> str:
    first = document[: document.find("\n")] if "\n" in document else document
    return max(",;\t", key=first.count)


def _check_names(path: str | Path, names: Sequence[str]) -> None:
    if not names or len(names) > MAX_COLUMNS:
        raise refusal(
            path, "", f"{len(names):,} columns", f"1 to {MAX_COLUMNS:,}", "check that it is a table"
        )
    check_distinct(path, "columns", names)


def _chunk(
    path: str | Path, names: Sequence[str], rows: list[list[str]], numbers: Collection[str], before: int
) -> dict[str, Column]:
    rows = [row for row in rows if row]
    for k, row in enumerate(rows):
        if len(row) != len(names):
            got = f"{len(row)} cells"
            remedy = "complete the row; the file may be cut off"
            raise refusal(path, f"row {before + k + 1}", got, f"{len(names)}, as in the first line", remedy)
    columns: dict[str, Column] = {}
    for name, cells in zip(names, zip(*rows, strict=True), strict=True):
        if name not in numbers:
            columns[name] = np.array(cells, dtype=np.str_)
            continue
        try:
            columns[name] = np.array([float(cell) if cell else np.nan for cell in cells])
        except ValueError:
            k = next(k for k, cell in enumerate(cells) if cell and not _is_number(cell))
            where = f"row {before + k + 1}, {cut(name)}"
            raise refusal(path, where, shown(cells[k]), "a number, or nothing where it is missing") from None
        if np.isinf(columns[name]).any():
            k = int(np.argmax(np.isinf(columns[name])))
            where = f"row {before + k + 1}, {cut(name)}"
            raise refusal(path, where, shown(cells[k]), "a finite number")
    return columns


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _looks_like(given: GivenFile) -> bool:
    """Look at the names in the first line; of a first line that is long, at the part that was read."""
    first = given.start.partition(b"\n")[0].decode("utf-8", "replace").lstrip("\ufeff")
    names = [name.strip().strip('"') for name in first.split(_delimiter(first))]
    return (is_motion(names) or is_triangulated(names)) and not has_root_turn(names)


CSV_FORMAT: Final = MotionFormat(
    name="csv",
    title="CSV, a row a frame (time, neck_x, …) or a row a point (frame, time, name, x, y, z)",
    suffixes=(".csv",),
    read=read_csv_motion,
    read_recorded=partial(read_csv_motion, as_recorded=True),
    write_points=write_csv_motion,
    looks_like=_looks_like,
)
