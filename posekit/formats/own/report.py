"""Write and read ``posekit.report/1``: a verdict for each posture and the findings behind it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.npz import suffix
from posekit.formats.own.report_clips import ClipVerdict, Still, clip_document, clip_of_document
from posekit.formats.own.report_columns import CheckCount, ReportPlace, VerdictColumns, joined
from posekit.formats.own.report_frames import ReportFrames
from posekit.formats.own.report_rows import csv_lines, write_report_table
from posekit.formats.own.report_schema import (
    REPORT_SCHEMA,
    VERDICT_NAMES,
    CheckFields,
    PostureFields,
    ReportFile,
    Verdict,
)
from posekit.formats.own.report_table import markdown_lines
from posekit.safe_io.json_file import read_json
from posekit.safe_io.refusal import refusal, shown
from posekit.safe_io.writing import check_target, json_pieces, write_lines, write_text
from posekit.tables.file_model import validated
from posekit.tree.check import Findings

FINDING_NUMBERS = ("value", "lower", "upper", "margin")
MOST_PLACES = 500
"""Places of one check that the summary of a JSON file counts, the most frequent first."""

REPORT_SUFFIXES = (".json", ".md", ".csv", ".parquet")


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One judged quantity, as a report lists it; None for NaN and for a bound that is not there.

    Parameters
    ----------
    check, where, unit : str
        The validator, the place it judged, and the unit of the numbers.
    value, lower, upper, margin : float or None
        What was found, its bounds, and the distance to the nearer one (negative outside).
    verdict : str
        ``valid``, ``invalid`` or ``undecided``.
    """

    check: str
    where: str
    value: float | None
    lower: float | None
    upper: float | None
    margin: float | None
    unit: str
    verdict: Verdict


@dataclass(frozen=True, kw_only=True)
class Worst:
    """The place with the least margin of a posture: that margin, what was found there, and the nearer bound."""

    check: str
    where: str
    margin: float
    unit: str
    value: float | None = None
    bound: float | None = None


@dataclass(frozen=True, kw_only=True)
class PostureReport:
    """The verdict on one posture.

    Parameters
    ----------
    verdict : str
        ``valid``, ``invalid`` or ``undecided``.
    fk_distance : float or None
        Metres from the posture to the forward kinematics of its configuration.
    findings : sequence of Finding
        What is behind the verdict.
    index : int, optional
        Which posture of the file, from 0, where not all are listed.
    worst : Worst, optional
        The place with the least margin; a centimetre counts as one degree.
    residual : mapping, optional
        Metres that each joint of a robot's fit is off, None where it is unknown.
    undecided_by : sequence of str, optional
        Of an undecided posture, the checks that say nothing, and ``joints`` where some are unknown.
    clip, frame : int, optional
        Which clip of the report it is of, and its frame in it, from 0.
    time : float, optional
        Seconds.
    """

    verdict: Verdict
    fk_distance: float | None
    findings: Sequence[Finding]
    index: int | None = None
    worst: Worst | None = None
    residual: Mapping[str, float | None] | None = None
    undecided_by: Sequence[str] | None = None
    clip: int | None = None
    frame: int | None = None
    time: float | None = None


@dataclass(frozen=True, kw_only=True)
class ValidationReport:
    """The verdicts on a file of postures.

    Parameters
    ----------
    settings : mapping
        Everything that decided the verdicts, of plain values.
    postures : sequence of PostureReport
        In the file's order; all of them, or those that are listed.
    checks : mapping, optional
        By check: postures that it rejects and leaves undecided, and violations by place.
    listed : str, optional
        Which postures are listed, where not all are.
    verdicts : str, optional
        The first letter of every posture's verdict, where not all are listed.
    columns : VerdictColumns, optional
        All verdicts and violations, for tables and CSV; not in the JSON file.
    frames : ReportFrames, optional
        Which frame each posture is; not in the JSON file, whose postures say it.
    clips : sequence of ClipVerdict, optional
        The verdicts on clips, of frames in time.
    stills : sequence of sequences of Still
        Of each clip, frames that can be drawn; not in the JSON file.
    refused : sequence of str
        Of several files those that could not be judged, each with why in a line.
    """

    settings: Mapping[str, Any]
    postures: Sequence[PostureReport]
    checks: Mapping[str, CheckCount] | None = field(default=None, compare=False)
    listed: str | None = None
    verdicts: str | None = None
    columns: VerdictColumns | None = field(default=None, compare=False, repr=False)
    frames: ReportFrames | None = field(default=None, compare=False, repr=False)
    clips: Sequence[ClipVerdict] | None = None
    stills: Sequence[Sequence[Still]] = field(default=(), compare=False, repr=False)
    refused: Sequence[str] = ()

    def __len__(self) -> int:
        """Count the postures that were judged."""
        return len(self.postures) if self.verdicts is None else len(self.verdicts)

    @property
    def summary(self) -> dict[str, int]:
        """How many postures have each verdict."""
        if self.verdicts is not None:
            return {verdict: self.verdicts.count(verdict[0]) for verdict in VERDICT_NAMES}
        counts = Counter(posture.verdict for posture in self.postures)
        return {verdict: counts[verdict] for verdict in VERDICT_NAMES}


@dataclass(frozen=True, kw_only=True, eq=False)
class JudgedCheck:
    """What one check found in N postures at its K places.

    Parameters
    ----------
    check, unit : str
        The check's name and the unit of its values.
    where : sequence of K str
        Its places.
    findings : Findings
        Value (N, K), bounds and tolerance.
    undecided : bool array (N, K), optional
        Where nothing is said though there is a value.
    over_time : bool
        Whether it is a check over time: where it says nothing of a frame, nothing is listed.
    """

    check: str
    unit: str
    where: Sequence[str]
    findings: Findings
    undecided: NDArray[np.bool_] | None = None
    over_time: bool = False


def make_report(
    *,
    settings: Mapping[str, Any],
    verdicts: Sequence[str],
    fk_distance: NDArray[np.float64],
    judged: Sequence[JudgedCheck],
    all_findings: bool = False,
) -> ValidationReport:
    """Make a report of what the checks found.

    Parameters
    ----------
    settings : mapping
        Everything that decided the verdicts, of plain values.
    verdicts : sequence of N str
        ``valid``, ``invalid`` or ``undecided``.
    fk_distance : array (N,)
        Metres; NaN where there is no configuration.
    judged : sequence of JudgedCheck
        The checks that were applied.
    all_findings : bool
        List every finding; else those that are violated, and for each check the one with the least margin
        (an undecided one where the check decided nothing).

    Returns
    -------
    Report

    Raises
    ------
    InputError
        Where a verdict is none of the three, or the numbers of postures differ.
    """
    rows: list[list[Finding]] = [[] for _ in verdicts]
    for verdict in verdicts:
        if verdict not in VERDICT_NAMES:
            raise refusal("report", "verdicts", shown(verdict), " or ".join(VERDICT_NAMES), "correct it")
    for check in judged:
        if len(check.findings.value) != len(rows):
            counts = f"{len(check.findings.value)} postures"
            raise refusal("report", check.check, counts, f"{len(rows)}, one a verdict", "judge all postures")
        _list_findings(rows, check, all_findings)
    distances = np.broadcast_to(fk_distance, len(rows)).tolist()
    return ValidationReport(
        settings=settings,
        postures=tuple(
            PostureReport(verdict=verdict, fk_distance=_number(distance), findings=tuple(findings))  # type: ignore[arg-type]
            for verdict, distance, findings in zip(verdicts, distances, rows, strict=True)
        ),
    )


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
        write_lines(
            path, markdown_lines(columns, report.settings, report.frames, report.clips, report.refused)
        )


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
    )


def columns_of(report: ValidationReport) -> VerdictColumns:
    """Return a report's columns; of one without, what its listed postures tell."""
    if report.columns is not None:
        return report.columns
    places: dict[ReportPlace, int] = {}
    violations: list[tuple[int, int, float, float, float]] = []
    worst: list[tuple[int, float, float, float]] = []
    for k, posture in enumerate(report.postures):
        for finding in posture.findings:
            place = places.setdefault(ReportPlace(finding.check, finding.where, finding.unit), len(places))
            if finding.verdict == "invalid":
                violations.append((k, place, *_nearer(finding)))
        least = posture.worst
        at = None if least is None else ReportPlace(least.check, least.where, least.unit)
        worst.append(
            (-1, math.nan, math.nan, math.nan)
            if at is None or least is None
            else (places.setdefault(at, len(places)), _known(least.value), _known(least.bound), least.margin)
        )
    least_numbers = np.array([numbers for _, *numbers in worst]).reshape(-1, 3).T
    outside = np.array([numbers for _, _, *numbers in violations]).reshape(-1, 3).T
    checks = list(dict.fromkeys(place.check for place in places))
    part = VerdictColumns(
        places=tuple(places),
        verdict=np.array(
            [VERDICT_NAMES.index(posture.verdict) for posture in report.postures], dtype=np.int8
        ),
        fk_distance=np.array(
            [math.nan if posture.fk_distance is None else posture.fk_distance for posture in report.postures]
        ),
        worst_place=np.array([place for place, *_ in worst], dtype=np.int32),
        worst_value=least_numbers[0],
        worst_bound=least_numbers[1],
        worst_margin=least_numbers[2],
        posture=np.array([k for k, *_ in violations], dtype=np.int64),
        place=np.array([place for _, place, *_ in violations], dtype=np.int32),
        value=outside[0],
        bound=outside[1],
        margin=outside[2],
        silent=np.array([_silent(posture, checks) for posture in report.postures], dtype=np.int16),
        checks=checks,
    )
    return joined([part], part.places, checks)


def _nearer(finding: Finding) -> tuple[float, float, float]:
    """Return what was found, the bound that it is nearest to, and the margin; NaN for what is not known."""
    value, margin = _known(finding.value), _known(finding.margin)
    bounds = [bound for bound in (finding.lower, finding.upper) if bound is not None]
    bound = (
        min(bounds, key=lambda one: abs(value - one)) if bounds and finding.value is not None else math.nan
    )
    return value, bound, margin


def _known(value: float | None) -> float:
    return math.nan if value is None else value


def _silent(posture: PostureReport, checks: Sequence[str]) -> int:
    """Spell what is undecided about a posture as `VerdictColumns` has it."""
    names = ("joints", *checks)
    return sum(1 << names.index(name) for name in posture.undecided_by or () if name in names)


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


def _list_findings(rows: list[list[Finding]], check: JudgedCheck, every: bool) -> None:
    """Add a check's findings to the postures that they were found in."""
    found = check.findings
    value = np.asarray(found.value)
    if value.size == 0:
        return
    lower, upper = np.broadcast_to(found.lower, value.shape), np.broadcast_to(found.upper, value.shape)
    margin, violated, undecided = found.margin, found.violated, found.undecided
    if check.undecided is not None:
        undecided = undecided | check.undecided
    listed = np.ones(value.shape, dtype=bool)
    if not every:
        worst = np.where(undecided, np.inf, margin).argmin(axis=1)
        listed = violated.copy()
        listed[np.arange(len(value)), worst] = True
    if check.over_time:
        listed &= ~undecided
    for posture, place in np.argwhere(listed).tolist():
        at = posture, place
        rows[posture].append(
            Finding(
                check=check.check,
                where=check.where[place],
                value=_number(value[at]),
                lower=_number(lower[at]),
                upper=_number(upper[at]),
                margin=None if undecided[at] else _number(margin[at]),
                unit=check.unit,
                verdict="invalid" if violated[at] else "undecided" if undecided[at] else "valid",
            )
        )


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _finding(finding: Finding) -> dict[str, Any]:
    return {
        name: _number(value) if name in FINDING_NUMBERS else value for name, value in vars(finding).items()
    }


def _fields(report: ValidationReport) -> Iterator[dict[str, Any]]:
    for posture in report.postures:
        entry: dict[str, Any] = {} if posture.index is None else {"index": posture.index}
        entry |= {
            name: getattr(posture, name)
            for name in ("clip", "frame", "time")
            if getattr(posture, name) is not None
        }
        entry |= {"verdict": posture.verdict, "fk_distance": _number(posture.fk_distance)}
        if posture.worst is not None:
            entry["worst"] = {
                name: value
                for name, value in vars(posture.worst).items()
                if isinstance(value, str) or _number(value) is not None
            }
        if posture.residual is not None:
            entry["residual"] = {name: _number(value) for name, value in posture.residual.items()}
        if posture.undecided_by is not None:
            entry["undecided_by"] = list(posture.undecided_by)
        yield entry | {"findings": [_finding(finding) for finding in posture.findings]}
