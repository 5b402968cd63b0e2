"""Write and read ``posekit.report/1``: a verdict for each posture and the findings behind it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from posekit.files.npz import suffix
from posekit.files.reading import read_json
from posekit.files.report_schema import SCHEMA, ReportFile, Verdict
from posekit.files.validation import validated
from posekit.files.writing import check_target, json_pieces, write_text
from posekit.intake.refusal import refusal, shown
from posekit.tree.check import Findings

NUMBERS = ("value", "lower", "upper", "margin")
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)


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
    """

    verdict: Verdict
    fk_distance: float | None
    findings: Sequence[Finding]


@dataclass(frozen=True, kw_only=True)
class Report:
    """The verdicts on a file of postures.

    Parameters
    ----------
    settings : mapping
        Everything that decided the verdicts, of plain values.
    postures : sequence of PostureReport
        In the file's order.
    """

    settings: Mapping[str, Any]
    postures: Sequence[PostureReport]

    @property
    def summary(self) -> dict[str, int]:
        """How many postures have each verdict."""
        counts = Counter(posture.verdict for posture in self.postures)
        return {verdict: counts[verdict] for verdict in VERDICTS}


@dataclass(frozen=True, kw_only=True, eq=False)
class Judged:
    """What one check found in N postures at its K places.

    Parameters
    ----------
    check, unit : str
        The check's name and the unit of its values.
    where : sequence of K str
        Its places.
    findings : Findings
        Value (N, K), bounds and tolerance.
    """

    check: str
    unit: str
    where: Sequence[str]
    findings: Findings


def make_report(
    *,
    settings: Mapping[str, Any],
    verdicts: Sequence[str],
    fk_distance: NDArray[np.float64],
    judged: Sequence[Judged],
    all_findings: bool = False,
) -> Report:
    """Make a report of what the checks found.

    Parameters
    ----------
    settings : mapping
        Everything that decided the verdicts, of plain values.
    verdicts : sequence of N str
        ``valid``, ``invalid`` or ``undecided``.
    fk_distance : array (N,)
        Metres; NaN where there is no configuration.
    judged : sequence of Judged
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
        if verdict not in VERDICTS:
            raise refusal("report", "verdicts", shown(verdict), " or ".join(VERDICTS), "correct it")
    for check in judged:
        if len(check.findings.value) != len(rows):
            counts = f"{len(check.findings.value)} postures"
            raise refusal("report", check.check, counts, f"{len(rows)}, one a verdict", "judge all postures")
        _list_findings(rows, check, all_findings)
    distances = np.broadcast_to(fk_distance, len(rows)).tolist()
    return Report(
        settings=settings,
        postures=tuple(
            PostureReport(verdict=verdict, fk_distance=_number(distance), findings=tuple(findings))  # type: ignore[arg-type]
            for verdict, distance, findings in zip(verdicts, distances, rows, strict=True)
        ),
    )


def check_report_path(path: str | Path) -> None:
    """Refuse a report's name before the work that it is for is done."""
    suffix(path, ".json")
    check_target(path)


def write_report(path: str | Path, report: Report) -> None:
    """Write a report as ``.json``, whole or not at all.

    Raises
    ------
    InputError
        Where the name does not end in .json or the file cannot be written.
    """
    suffix(path, ".json")
    head = {"schema": SCHEMA, "settings": dict(report.settings), "summary": report.summary}
    write_text(path, json_pieces(head, "postures", _fields(report)))


def read_report(path: str | Path) -> Report:
    """Read a report.

    Raises
    ------
    InputError
        Where the file breaks the schema ``posekit.report/1``.
    """
    suffix(path, ".json")
    file = validated(ReportFile, read_json(path), path)
    names = [field.name for field in fields(Finding)]
    return Report(
        settings=file.settings,
        postures=tuple(
            PostureReport(
                verdict=posture.verdict,
                fk_distance=posture.fk_distance,
                findings=tuple(
                    Finding(**{name: getattr(finding, name) for name in names})
                    for finding in posture.findings
                ),
            )
            for posture in file.postures
        ),
    )


def _list_findings(rows: list[list[Finding]], check: Judged, every: bool) -> None:
    """Add a check's findings to the postures that they were found in."""
    found = check.findings
    value = np.asarray(found.value)
    if value.size == 0:
        return
    lower, upper = np.broadcast_to(found.lower, value.shape), np.broadcast_to(found.upper, value.shape)
    margin, violated, undecided = found.margin, found.violated, found.undecided
    listed = np.ones(value.shape, dtype=bool)
    if not every:
        worst = np.where(undecided, np.inf, margin).argmin(axis=1)
        listed = violated.copy()
        listed[np.arange(len(value)), worst] = True
    for posture, place in np.argwhere(listed).tolist():
        at = posture, place
        rows[posture].append(
            Finding(
                check=check.check,
                where=check.where[place],
                value=_number(value[at]),
                lower=_number(lower[at]),
                upper=_number(upper[at]),
                margin=_number(margin[at]),
                unit=check.unit,
                verdict="invalid" if violated[at] else "undecided" if undecided[at] else "valid",
            )
        )


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _finding(finding: Finding) -> dict[str, Any]:
    return {name: _number(value) if name in NUMBERS else value for name, value in vars(finding).items()}


def _fields(report: Report) -> Iterator[dict[str, Any]]:
    for posture in report.postures:
        yield {
            "verdict": posture.verdict,
            "fk_distance": _number(posture.fk_distance),
            "findings": [_finding(finding) for finding in posture.findings],
        }
