"""Reports as CSV: one row a posture."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator
from typing import Final

from posekit.formats.own.report_columns import VerdictColumns

CSV_HEAD: Final = (
    "posture",
    "verdict",
    "worst_margin",
    "unit",
    "check",
    "where",
    "fk_distance",
    "violations",
    "undecided_by",
)
"""The columns: `violations` are ``check/where=margin unit``, by semicolons."""


def csv_lines(columns: VerdictColumns) -> Iterator[str]:
    """Yield the lines (RFC 4180): a head, then every posture, counted from 0; what is not known is empty.

    Parameters
    ----------
    columns : VerdictColumns
        The verdicts, one a posture.
    """
    yield ",".join(CSV_HEAD)
    for row in columns.rows():
        place, margin = (None, math.nan) if row.worst is None else row.worst
        violations = "; ".join(f"{at.name}={by:.6g} {at.unit}" for at, by in row.violations)
        yield _line(
            str(row.posture),
            row.verdict,
            _number(margin),
            "" if place is None else place.unit,
            "" if place is None else place.check,
            "" if place is None else place.where,
            _number(row.fk_distance),
            violations,
            "; ".join(row.undecided_by),
        )


def _line(*cells: str) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow(cells)
    return text.getvalue()


def _number(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else ""
