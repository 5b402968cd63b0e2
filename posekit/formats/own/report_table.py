"""Reports as tables: what the terminal shows, and a Markdown file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from posekit.formats.own.report_columns import CheckCount, ReportPlace, VerdictColumns

MAX_NAMED_PLACES: Final = 3
"""Places of a check that the table names."""

MAX_SHOWN_POSTURES: Final = 100
"""Postures that are not valid, in a Markdown file."""

MAX_SETTING_CHARACTERS: Final = 200
"""Characters of a setting that are shown."""


def summary_table(columns: VerdictColumns) -> list[str]:
    """Count the verdicts, and for each check what it rejects, where most, and the worst posture (from 0).

    Parameters
    ----------
    columns : VerdictColumns
        The verdicts, one a posture.
    """
    counts = ", ".join(f"{count} {verdict}" for verdict, count in columns.summary.items())
    lines = [f"{len(columns)} postures: {counts}", ""]
    head = ("check", "rejected", "undecided", "most often", "worst")
    total = max(len(columns), 1)
    rows = [
        (
            check,
            f"{count.rejected} ({count.rejected / total:.1%})",
            count.undecided,
            _most(check, count),
            _worst(count),
        )
        for check, count in columns.by_check().items()
    ]
    return lines + _table(head, rows)


def markdown_lines(columns: VerdictColumns, settings: Mapping[str, Any]) -> list[str]:
    """Write a report as Markdown: the summary, the settings, and the first postures that are not valid."""
    lines = ["# Validation", "", *summary_table(columns), "", "## Settings", ""]
    lines += [f"- {_cell(name)}: {_cell(_shown(value))}" for name, value in settings.items()]
    bad = [row for row in columns.rows() if row.verdict != "valid"]
    lines += ["", "## Postures that are not valid", ""]
    if not bad:
        return [*lines, "None."]
    if len(bad) > MAX_SHOWN_POSTURES:
        lines += [f"The first {MAX_SHOWN_POSTURES} of {len(bad)}.", ""]
    rows = [
        (
            row.posture,
            row.verdict,
            "" if row.worst is None else _at(*row.worst),
            "; ".join(_at(place, margin) for place, margin in row.violations)
            or f"undecided: {', '.join(row.undecided_by)}",
        )
        for row in bad[:MAX_SHOWN_POSTURES]
    ]
    return lines + _table(("posture", "verdict", "least margin", "why"), rows)


def _most(check: str, count: CheckCount) -> str:
    places = list(count.places.items())
    named = ", ".join(f"{check}/{where} {number}" for where, number in places[:MAX_NAMED_PLACES])
    return named + (f", and {len(places) - MAX_NAMED_PLACES} more" if len(places) > MAX_NAMED_PLACES else "")


def _worst(count: CheckCount) -> str:
    if count.worst is None:
        return ""
    index, place, margin = count.worst
    return f"posture {index}: {place.where} {margin:.3g} {place.unit}"


def _at(place: ReportPlace, margin: float) -> str:
    return f"{place.name} {margin:.3g} {place.unit}"


def _shown(value: object) -> str:
    text = ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
    return text if len(text) <= MAX_SETTING_CHARACTERS else f"{text[: MAX_SETTING_CHARACTERS - 1]}…"


def _table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    cells = [[_cell(str(cell)) for cell in row] for row in rows]
    widths = [max(len(row[k]) for row in [list(head), *cells]) for k in range(len(head))]

    def line(row: Sequence[str]) -> str:
        return f"| {' | '.join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))} |"

    return [line(head), f"|{'|'.join('-' * (width + 2) for width in widths)}|", *map(line, cells)]


def _cell(text: str) -> str:
    """Keep a name from a file inside its cell."""
    printable = "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text)
    return printable.replace("|", "\\|")
