"""Reports as tables: one row a posture, the same columns as CSV and as Parquet."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any, Final, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.report_columns import PlaceValue, VerdictColumns, measured
from posekit.formats.own.report_frames import ReportFrames

ROWS_AT_ONCE: Final = 10_000
"""Rows of a Parquet file that are held as text at a time."""

FORMULA_STARTS: Final = ("=", "+", "-", "@", "\t", "\r")
"""What a spreadsheet takes for a formula, at the start of a text."""


class ReportRow(NamedTuple):
    """One posture: what is not known is NaN or empty.

    `frame` is counted from 0 in its clip, `posture` over all; `value`, `bound` and `worst_margin` are in `unit`, of the
    place with the least margin; `violations` are ``check/where=value unit (bound)``, by semicolons.
    """

    file: str
    clip: str
    frame: int
    time: float
    posture: int
    verdict: str
    check: str
    where: str
    value: float
    bound: float
    worst_margin: float
    unit: str
    fk_distance: float
    violations: str
    undecided_by: str


def report_rows(columns: VerdictColumns, frames: ReportFrames | None) -> Iterator[ReportRow]:
    """Go through the postures of a report.

    Parameters
    ----------
    columns : VerdictColumns
        The verdicts, one a posture.
    frames : ReportFrames, optional
        Which frame each is; without, frames are postures.
    """
    for row in columns.rows():
        k, worst = row.posture, row.worst
        name = ("", "") if frames is None else frames.clips[int(frames.clip[k])]
        yield ReportRow(
            *name,
            k if frames is None else int(frames.frame[k]),
            math.nan if frames is None else float(frames.time[k]),
            k,
            row.verdict,
            "" if worst is None else worst.place.check,
            "" if worst is None else worst.place.where,
            *((math.nan,) * 3 if worst is None else (worst.value, worst.bound, worst.margin)),
            "" if worst is None else worst.place.unit,
            row.fk_distance,
            "; ".join(map(_violation, row.violations)),
            "; ".join(row.undecided_by),
        )


def csv_lines(columns: VerdictColumns, frames: ReportFrames | None = None) -> Iterator[str]:
    """Yield the lines (RFC 4180): a head, then every posture; what is not known is empty."""
    yield ",".join(ReportRow._fields)
    for row in report_rows(columns, frames):
        yield csv_line(row)


def csv_line(cells: Iterable[object]) -> str:
    """Spell one line: numbers shortly, NaN and None empty, and texts so that a spreadsheet takes none for a formula."""
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow([_cell(value) for value in cells])
    return text.getvalue()


def write_report_table(path: str | Path, columns: VerdictColumns, frames: ReportFrames | None = None) -> None:
    """Write a report as Parquet, whole or not at all.

    Raises
    ------
    InputError
        Where pyarrow is not installed, or the file cannot be written.
    """
    from posekit.formats.motion.parquet import write_tables

    write_tables(path, ((table, {}) for table in _tables(report_rows(columns, frames))))


def _tables(rows: Iterator[ReportRow]) -> Iterator[dict[str, NDArray[Any]]]:
    first = True
    while (some := list(islice(rows, ROWS_AT_ONCE))) or first:  # a report of nothing is a table without rows
        columns = zip(*some, strict=True) if some else [()] * len(ReportRow._fields)
        kinds = get_type_hints(ReportRow).values()
        yield {
            name: np.array(values, dtype=kind)
            for name, values, kind in zip(ReportRow._fields, columns, kinds, strict=True)
        }
        first = False


def _violation(judged: PlaceValue) -> str:
    at = judged.place
    found = f"{at.name}={measured(judged.value, at.unit, 6)}"
    return f"{found} ({judged.bound:.6g})" if math.isfinite(judged.bound) else found


def _cell(value: object) -> object:
    if isinstance(value, str):
        return f"'{value}" if value.startswith(FORMULA_STARTS) else value
    if isinstance(value, float):
        return f"{value:.9g}" if math.isfinite(value) else ""
    return value
