"""Tables of text: CSV, TSV, TRC, MOT and the like, split into rows of cells. No column is interpreted here."""

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

#: Rows of names before the numbers: DeepLabCut has 4.
MAX_HEAD_ROWS: Final = 10
#: Largest number of points in a table with one row per point.
MAX_POINTS: Final = 30_000_000
_DECIMAL_COMMA: Final = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
#: Columns of a point by its name and a coordinate or confidence: ``nose_x``, ``nose.score``.
_OF_POINT: Final = re.compile(
    r"(.+?)[\s._-]+(?:([xyz])|visibility|likelihood|confidence|score|presence|conf|c)",
    re.IGNORECASE | re.DOTALL,
)
#: Cells that hold no value, in lower case.
MISSING: Final = frozenset({"", "nan", "-nan", "na", "n/a", "null", "none", "-", "--"})
#: Names of columns of times, and their unit in seconds; None if the steps between the times give the unit.
TIMES: Final = {
    **{"time": 1.0, "times": 1.0, "t": 1.0, "time_s": 1.0, "timestamp_s": 1.0, "timestamp": None},
    **{"timestamps": None, "time_ms": 1e-3, "timestamp_ms": 1e-3, "time_us": 1e-6, "timestamp_us": 1e-6},
}
#: Largest step between two frames, seconds: a larger step of timestamps is in ms, µs or ns.
LARGEST_STEP: Final = 2.0


class Table:
    """Rows of cells.

    Attributes
    ----------
    lines : list of str
        The text's lines, without empty ones.
    numbers_of_lines : list of int
        The number of each line in the file, from 1.
    delimiter : str
        Character between cells; empty for any white space.
    about : dict
        Metadata of a container that has some.
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
        """Rows before the first that holds a number."""
        rows: list[list[str]] = []
        for line in self.lines[:MAX_HEAD_ROWS]:
            cells = self.parted(line)
            if any(not np.isnan(_number(cell)) or cell.casefold() == "nan" for cell in cells):
                break
            rows.append(cells)
        return rows

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the columns: the last row before the numbers; empty without such a row."""
        return tuple(self.head[-1] if self.head else ())

    @cached_property
    def cells(self) -> list[list[str]]:
        """Rows after the names, all of one width.

        Raises
        ------
        InputError
            If a row has another number of cells than the names or the first row.
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
        """Cells by the name of their column; of two columns with one name, the first."""
        columns = zip(*self.cells, strict=True) if self.cells else ([] for _ in self.names)
        named = list(zip(self.names, columns, strict=True))
        return dict(reversed(named))

    @cached_property
    def numbers(self) -> Array:
        """All cells of a table of text as numbers (N, C), NaN for other cells."""
        return numbers([cell for row in self.cells for cell in row]).reshape(len(self.cells), -1)

    def column(self, name: str) -> Array:
        """Return a column as numbers (N,), NaN for other cells."""
        values = np.asarray(self.columns[name])
        known = values.dtype.kind in "iufb"
        return values.astype(np.float64) if known else numbers(self.texts(name))

    def texts(self, name: str) -> list[str]:
        """Return a column as text."""
        return [str(value) for value in self.columns[name]]

    def checked(self, name: str) -> Array:
        """Return a column as numbers (N,), NaN for empty cells; refuse other cells."""
        if not self.lines:
            return self.column(name)
        lines = self.numbers_of_lines[len(self.head) :]
        return checked(self.texts(name), self.source, lambda k: f"line {lines[k]}, {name}")


def parse(data: bytes, source: str) -> Table:
    """Split a table of text into lines and find its delimiter: tab, semicolon, comma, else white space."""
    lines = text(data, source).splitlines()
    pairs = [(number, line) for number, line in enumerate(lines, 1) if line.strip(" ,;\t\r")]
    if not pairs:
        raise refusal(source, "", "no rows", "a table", "check how it was written")
    kept = [line for _, line in pairs]
    sample = kept[: 2 * MAX_HEAD_ROWS]
    delimiter = next((one for one in "\t;," if min(line.count(one) for line in sample[-3:]) > 0), "")
    return Table(kept, delimiter, source, [number for number, _ in pairs])


def numbers(cells: list[str]) -> Array:
    """Turn cells into numbers (N,), NaN for other cells; decimal commas are understood."""
    try:
        return np.array(cells, dtype=np.float64)
    except ValueError:
        return np.array([_number(cell) for cell in cells], dtype=np.float64)


def checked(cells: list[str], source: str, place: Callable[[int], str]) -> Array:
    """Turn cells into numbers (N,), NaN for empty cells; refuse another cell by its place in the file."""
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
    """Return the columns of each point by part: ``x``, ``y``, ``z`` and ``sure``, the confidence."""
    found: dict[str, dict[str, str]] = {}
    for column in names:
        if match := _OF_POINT.fullmatch(column):
            found.setdefault(match[1], {}).setdefault((match[2] or "sure").lower(), column)
    return found


def by_row(keys: NDArray[Any], point: Ints, values: Array, count: int) -> tuple[NDArray[Any], Ints, Array]:
    """Gather a table with one row per point into an array with one row per frame.

    Parameters
    ----------
    keys : array (N, K)
        Numbers of a row's frame, such as the person and the picture.
    point : int array (N,)
        The row's point, below `count`.
    values : array (N, D)
        Its coordinates.

    Returns
    -------
    keys : array (T, K)
        Different keys, ascending.
    first : int array (T,)
        Their first rows.
    points : array (T, count, D)
        NaN where a frame has no row of a point.
    """
    found, first, row = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    if len(found) * count > MAX_POINTS:
        raise ValueError(f"{len(found):,} frames of {count:,} points")
    points = np.full((len(found), count, values.shape[1]), np.nan)
    points[row.reshape(-1), point] = values
    return found, first, points


def seconds(name: str, time: Array) -> Array:
    """Return times (T,) in seconds; the name of their column gives the unit, or, for timestamps, their steps do."""
    unit = TIMES[name.casefold()]
    if unit is None:
        step = float(np.nanmedian(np.abs(np.diff(time)))) if np.isfinite(time).sum() > 1 else 0.0
        unit = 1e-3 ** np.ceil(np.log10(max(step / LARGEST_STEP, 1.0)) / 3)
    return np.asarray(time * unit)


def columns_of_rows(rows: Sequence[Mapping[str, Any]]) -> dict[str, NDArray[Any]]:
    """Return the columns of rows that have the same names."""
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def csv_text(columns: dict[str, Any], delimiter: str = ",") -> str:
    """Write columns of one length as CSV; numbers read back exactly, NaN is an empty cell."""
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
