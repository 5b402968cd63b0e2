"""The numbers in a table of text, row by row: what TRC and MOT share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from posekit.geometry import Array
from posekit.safe_io import refusal, shown

_CHUNK: Final = 4096
"""Rows that are held as text at a time."""


def numbers_of(
    path: str | Path,
    lines: Sequence[tuple[int, str]],
    cells_of: Callable[[int, str], list[str]],
    width: int,
    expected: str,
) -> Array:
    """Turn lines into rows of numbers.

    Parameters
    ----------
    path : path
        The file, for errors.
    lines : sequence of (int, str)
        Each with its number in the file.
    cells_of : callable
        Parts a line, by its number and itself, into cells.
    width : int
        How many cells a row has.
    expected : str
        The same in words, for errors.

    Returns
    -------
    array (T, width)
        NaN for ``nan`` and for an empty cell.

    Raises
    ------
    InputError
        Where there is no line, one has another width, or a cell is no finite number.
    """
    if not lines:
        raise refusal(path, "", "no frames", "a row a frame", "check how it was written")
    chunks = []
    for start in range(0, len(lines), _CHUNK):
        chunk = lines[start : start + _CHUNK]
        rows = [cells_of(number, line) for number, line in chunk]
        for (number, _), row in zip(chunk, rows, strict=True):
            if len(row) != width:
                raise refusal(path, f"line {number}", f"{len(row)} columns", expected, "complete the row")
        chunks.append(_numbers(path, chunk, rows))
    return np.concatenate(chunks)


def _numbers(path: str | Path, lines: Sequence[tuple[int, str]], rows: Sequence[Sequence[str]]) -> Array:
    if not any("_" in line for _, line in lines):  # float() reads 1_000 as a thousand
        try:
            values = np.array([[float(cell or "nan") for cell in row] for row in rows])
            if not np.isinf(values).any():
                return values
        except ValueError:
            pass  # white space, or something to name
    return np.array(
        [
            [_number(path, number, column, cell.strip()) for column, cell in enumerate(row, 1)]
            for (number, _), row in zip(lines, rows, strict=True)
        ]
    )


def _number(path: str | Path, line: int, column: int, cell: str) -> float:
    try:
        value = float(cell or "nan")
    except ValueError:
        value = np.inf
    if np.isinf(value) or "_" in cell:
        expected = "a finite number, or nothing where it is missing"
        raise refusal(path, f"line {line}, column {column}", shown(cell), expected)
    return value
