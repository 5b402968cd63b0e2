"""Text tables, such as CSV, TSV, TRC and MOT, split into rows of cells. Columns are interpreted by other modules."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import refusal, shown
from posekit.files import text
from posekit.geometry import Array, Ints

#: Largest number of header rows before the numbers; DeepLabCut has 4.
MAX_HEAD_ROWS: Final = 10
#: Largest number of points in a table with one row per point.
MAX_POINTS: Final = 30_000_000
_DECIMAL_COMMA: Final = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
#: Pattern of a column's name that consists of a point and a coordinate or confidence: ``nose_x``, ``nose.score``.
_OF_POINT: Final = re.compile(
    r"(.+?)[\s._-]+(?:([xyz])|visibility|likelihood|confidence|score|presence|conf|c)",
    re.IGNORECASE | re.DOTALL,
)
#: Texts of empty cells, in lower case.
MISSING: Final = frozenset({"", "nan", "-nan", "na", "n/a", "null", "none", "-", "--"})
#: Names of columns of times, and their unit in seconds; None if the unit is found from the time steps.
TIMES: Final = {
    **{"time": 1.0, "times": 1.0, "t": 1.0, "time_s": 1.0, "timestamp_s": 1.0, "timestamp": None},
    **{"timestamps": None, "time_ms": 1e-3, "timestamp_ms": 1e-3, "time_us": 1e-6, "timestamp_us": 1e-6},
}
#: Largest time step between frames, seconds; larger steps of timestamps are in ms, µs or ns.
LARGEST_STEP: Final = 2.0


class Table:
    """A text table: rows of cells.

    Attributes
    ----------
    lines : list of str
        Lines of the text, without empty lines.
    numbers_of_lines : list of int
        Number of each line in the file, from 1.
    delimiter : str
        Character between cells; empty for any white space.
    about : dict
        Metadata of the file; empty for text files.
    """

    def __init__(self, lines: list[str], delimiter: str, source: str, numbers: Sequence[int] = ()) -> None:
        self.lines, self.delimiter, self.source = lines, delimiter, source
        self.numbers_of_lines = list(numbers or range(1, len(lines) + 1))
        self.about: dict[str, str] = {}

    @classmethod
    def of_columns(cls, columns: dict[str, Any], about: dict[str, str], source: str) -> Table:
        """Make a table from arrays by column name, such as the columns of a Parquet file."""
        table = cls([], ",", source)
        table.about, table.columns, table.names = about, columns, tuple(columns)
        return table

    def parted(self, line: str) -> list[str]:
        """Split a line into cells without surrounding spaces and quotes."""
        if not self.delimiter:
            return line.split()
        if '"' in line:
            try:
                return [cell.strip() for cell in next(csv.reader([line], delimiter=self.delimiter), [])]
            except csv.Error:
                pass
        return [cell.strip() for cell in line.split(self.delimiter)]

    @cached_property
    def head(self) -> list[list[str]]:
        """Rows before the first row that contains a number."""
        rows: list[list[str]] = []
        for line in self.lines[:MAX_HEAD_ROWS]:
            cells = self.parted(line)
            if any(not np.isnan(_number(cell)) or cell.casefold() == "nan" for cell in cells):
                break
            rows.append(cells)
        return rows

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the columns, from the last row before the numbers; empty without such a row."""
        return tuple(self.head[-1] if self.head else ())

    @cached_property
    def cells(self) -> list[list[str]]:
        """Rows after the names, all with the same number of cells.

        Raises
        ------
        InputError
            If the number of cells in a row differs from the names or the first row.
        """
        start = len(self.head)
        rows = [self.parted(line) for line in self.lines[start:]]
        width = len(self.names) or (len(rows[0]) if rows else 0)
        for k, row in enumerate(rows):
            if len(row) == width + 1 and not row[-1]:
                row.pop()  # a delimiter at the end of the line
            if len(row) != width:
                where = f"line {self.numbers_of_lines[start + k]}"
                raise refusal(self.source, where, f"{len(row)} cells", f"{width}", "complete the row")
        return rows

    @cached_property
    def columns(self) -> dict[str, Any]:
        """Cells by the name of their column; if two columns have the same name, those of the first."""
        columns = zip(*self.cells, strict=True) if self.cells else ([] for _ in self.names)
        named = list(zip(self.names, columns, strict=True))
        return dict(reversed(named))

    @cached_property
    def numbers(self) -> Array:
        """All cells as numbers (N, C); NaN for cells without a number."""
        return numbers([cell for row in self.cells for cell in row]).reshape(len(self.cells), -1)

    def column(self, name: str) -> Array:
        """Return a column as numbers (N,); NaN for cells without a number."""
        values = np.asarray(self.columns[name])
        known = values.dtype.kind in "iufb"
        return values.astype(np.float64) if known else numbers(self.texts(name))

    def texts(self, name: str) -> list[str]:
        """Return a column as text."""
        return [str(value) for value in self.columns[name]]

    def checked(self, name: str) -> Array:
        """Return a column as numbers (N,); NaN for empty cells. Refuse cells with other text."""
        if not self.lines:
            return self.column(name)
        lines = self.numbers_of_lines[len(self.head) :]
        return checked(self.texts(name), self.source, lambda k: f"line {lines[k]}, {name}")


def parse(data: bytes, source: str) -> Table:
    """Split a text table into lines, and find its delimiter: tab, semicolon, comma, or else white space."""
    lines = text(data, source).splitlines()
    pairs = [(number, line) for number, line in enumerate(lines, 1) if line.strip(" ,;\t\r")]
    if not pairs:
        raise refusal(source, "", "no rows", "a table", "check how it was written")
    kept = [line for _, line in pairs]
    sample = kept[: 2 * MAX_HEAD_ROWS]
    delimiter = next((one for one in "\t;," if min(line.count(one) for line in sample[-3:]) > 0), "")
    return Table(kept, delimiter, source, [number for number, _ in pairs])


def numbers(cells: list[str]) -> Array:
    """Convert cells to numbers (N,); NaN for cells without a number. Decimal commas are accepted."""
    try:
        return np.array(cells, dtype=np.float64)
    except ValueError:
        return np.array([_number(cell) for cell in cells], dtype=np.float64)


def checked(cells: list[str], source: str, place: Callable[[int], str]) -> Array:
    """Convert cells to numbers (N,); NaN for empty cells. Refuse cells with other text; the message says where."""
    values = numbers(cells)
    for k in np.flatnonzero(~np.isfinite(values)).tolist():
        if cells[k].casefold() not in MISSING:
            raise refusal(source, place(k), shown(cells[k]), "a number, or nothing", "correct the cell")
    return values


def _number(cell: str) -> float:
    if cell.casefold() in MISSING or "_" in cell:  # float() reads 1_000 as a thousand
        return np.nan
    try:
        return float(cell)
    except ValueError:
        return float(cell.replace(",", ".")) if _DECIMAL_COMMA.fullmatch(cell) else np.nan


def columns_of_points(names: Sequence[str]) -> dict[str, dict[str, str]]:
    """Group the names of columns by point, and by ``x``, ``y``, ``z`` or ``sure`` (confidence)."""
    found: dict[str, dict[str, str]] = {}
    for column in names:
        if match := _OF_POINT.fullmatch(column):
            found.setdefault(match[1], {}).setdefault((match[2] or "sure").lower(), column)
    return found


def by_row(keys: NDArray[Any], point: Ints, values: Array, count: int) -> tuple[NDArray[Any], Ints, Array]:
    """Convert a table with one row per point to an array with one row per frame.

    Parameters
    ----------
    keys : array (N, K)
        Numbers that identify the frame of each row, such as person and picture.
    point : int array (N,)
        Index of the point of each row, below `count`.
    values : array (N, D)
        Coordinates of each row's point.

    Returns
    -------
    keys : array (T, K)
        Distinct keys, ascending.
    first : int array (T,)
        First row of each key.
    points : array (T, count, D)
        Coordinates; NaN if a frame has no row for a point.
    """
    found, first, row = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    if len(found) * count > MAX_POINTS:
        raise ValueError(f"{len(found):,} frames of {count:,} points")
    points = np.full((len(found), count, values.shape[1]), np.nan)
    points[row.reshape(-1), point] = values
    return found, first, points


def seconds(name: str, time: Array) -> Array:
    """Convert times (T,) to seconds; the unit follows from the column's name or, for timestamps, from their steps."""
    unit = TIMES[name.casefold()]
    if unit is None:
        step = float(np.nanmedian(np.abs(np.diff(time)))) if np.isfinite(time).sum() > 1 else 0.0
        unit = 1e-3 ** np.ceil(np.log10(max(step / LARGEST_STEP, 1.0)) / 3)
    return np.asarray(time * unit)


def columns_of_rows(rows: Sequence[Mapping[str, Any]]) -> dict[str, NDArray[Any]]:
    """Convert a list of rows with the same keys to columns by key."""
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def csv_text(columns: dict[str, Any], delimiter: str = ",") -> str:
    """Return columns of equal length as CSV text; numbers are exact when read back, NaN is an empty cell."""
    cells = []
    for values in map(np.asarray, columns.values()):
        if values.dtype.kind == "f":
            cells.append(["" if np.isnan(value) else repr(value) for value in values.tolist()])
        else:
            cells.append(["" if value is None else str(value) for value in values.tolist()])
    lines = io.StringIO()
    writer = csv.writer(lines, delimiter=delimiter, lineterminator="\n")
    writer.writerow(list(columns))
    writer.writerows(zip(*cells, strict=True))
    return lines.getvalue()
