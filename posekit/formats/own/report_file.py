"""Write and read ``posekit.report/1``, and write reports for people and for tables."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

from posekit.formats.own.npz import suffix
from posekit.formats.own.report import Finding, PostureReport, ValidationReport, Worst, columns_of
from posekit.formats.own.report_clips import clip_document, clip_of_document
from posekit.formats.own.report_columns import CheckCount, known_number
from posekit.formats.own.report_rows import csv_lines, write_report_table
from posekit.formats.own.report_schema import REPORT_SCHEMA, CheckFields, PostureFields, ReportFile
from posekit.formats.own.report_table import markdown_lines, repair_lines
from posekit.safe_io.json_file import read_json
from posekit.safe_io.writing import check_target, json_pieces, write_lines, write_text
from posekit.tables.file_model import validated

FINDING_NUMBERS: Final = ("value", "lower", "upper", "margin")

MOST_PLACES: Final = 500
"""Places of one check that the summary of a JSON file counts, the most frequent first."""

REPORT_SUFFIXES: Final = (".json", ".md", ".csv", ".parquet")


def check_report_path(path: str | Path) -> None:
    """Refuse a report's name before the work that it is for is done."""
    suffix(path, *REPORT_SUFFIXES)
    check_target(path)


def write_report(path: str | Path, report: ValidationReport) -> None:
    """Write a report, whole or not at all: ``.json``, ``.md``, or a row a posture in ``.csv`` or ``.parquet``.

    Raises
    ------
    InputError
        Where the name ends otherwise, pyarrow is needed and not installed, or the file cannot be written.
    """
    kind = suffix(path, *REPORT_SUFFIXES)
    if kind == ".json":
        write_text(path, json_pieces(_head(report), "postures", _fields(report)))
        return
    columns = columns_of(report)
    if kind == ".parquet":
        write_report_table(path, columns, report.frames)
    elif kind == ".csv":
        write_lines(path, csv_lines(columns, report.frames))
    else:
        lines = markdown_lines(columns, report.settings, report.frames, report.clips, report.refused)
        write_lines(path, [*lines, *repair_lines(report.repair)])


def read_report(path: str | Path) -> ValidationReport:
    """Read a report's JSON.

    Raises
    ------
    InputError
        Where the file breaks the schema ``posekit.report/1``.
    """
    suffix(path, ".json")
    file = validated(ReportFile, read_json(path), path)
    return ValidationReport(
        settings=file.settings,
        postures=tuple(_posture(posture) for posture in file.postures),
        checks=None if file.checks is None else {name: _count(check) for name, check in file.checks.items()},
        listed=file.listed,
        refused=tuple(file.refused),
        verdicts=file.verdicts,
        clips=tuple(clip_of_document(clip) for clip in file.clips) or None,
        repair=tuple(one.model_dump() for one in file.repair),
    )


def _head(report: ValidationReport) -> dict[str, Any]:
    head: dict[str, Any] = {
        "schema": REPORT_SCHEMA,
        "settings": dict(report.settings),
        "summary": report.summary,
    }
    if report.checks is not None:
        head["checks"] = {
            name: {
                "rejected": count.rejected,
                "undecided": count.undecided,
                "places": dict(list(count.places.items())[:MOST_PLACES]),
            }
            for name, count in report.checks.items()
        }
    if report.listed is not None:
        head["listed"] = report.listed
    if report.verdicts is not None:
        head["verdicts"] = report.verdicts
    if report.refused:
        head["refused"] = list(report.refused)
    if report.clips:
        head["clips"] = [clip_document(clip) for clip in report.clips]
    if report.repair:
        head["repair"] = [dict(one) for one in report.repair]
    return head


def _posture(posture: PostureFields) -> PostureReport:
    names = [entry.name for entry in fields(Finding)]
    worst = posture.worst
    return PostureReport(
        verdict=posture.verdict,
        fk_distance=posture.fk_distance,
        findings=tuple(
            Finding(**{name: getattr(finding, name) for name in names}) for finding in posture.findings
        ),
        index=posture.index,
        worst=None
        if worst is None
        else Worst(**{entry.name: getattr(worst, entry.name) for entry in fields(Worst)}),
        residual=posture.residual,
        undecided_by=None if posture.undecided_by is None else tuple(posture.undecided_by),
        clip=posture.clip,
        frame=posture.frame,
        time=posture.time,
    )


def _count(check: CheckFields) -> CheckCount:
    return CheckCount(rejected=check.rejected, undecided=check.undecided, places=check.places, worst=None)


def _finding(finding: Finding) -> dict[str, Any]:
    return {
        name: known_number(value) if name in FINDING_NUMBERS else value
        for name, value in vars(finding).items()
    }


def _fields(report: ValidationReport) -> Iterator[dict[str, Any]]:
    for posture in report.postures:
        entry: dict[str, Any] = {} if posture.index is None else {"index": posture.index}
        entry |= {
            name: getattr(posture, name)
            for name in ("clip", "frame", "time")
            if getattr(posture, name) is not None
        }
        entry |= {"verdict": posture.verdict, "fk_distance": known_number(posture.fk_distance)}
        if posture.worst is not None:
            entry["worst"] = {
                name: value
                for name, value in vars(posture.worst).items()
                if isinstance(value, str) or known_number(value) is not None
            }
        if posture.residual is not None:
            entry["residual"] = {name: known_number(value) for name, value in posture.residual.items()}
        if posture.undecided_by is not None:
            entry["undecided_by"] = list(posture.undecided_by)
        yield entry | {"findings": [_finding(finding) for finding in posture.findings]}
