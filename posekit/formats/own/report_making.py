"""Reports of what checks found, in the order in which they are asked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.report import Finding, PostureReport, ValidationReport
from posekit.formats.own.report_columns import known_number
from posekit.formats.own.report_schema import VERDICT_NAMES
from posekit.geometry import Array
from posekit.safe_io.refusal import refusal, shown
from posekit.tree.check import Findings


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
            PostureReport(verdict=verdict, fk_distance=known_number(distance), findings=tuple(findings))  # type: ignore[arg-type]
            for verdict, distance, findings in zip(verdicts, distances, rows, strict=True)
        ),
    )


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
    postures, places = np.nonzero(listed)
    verdicts = np.where(violated, "invalid", np.where(undecided, "undecided", "valid"))[listed]
    numbers = (value, lower, upper, np.where(undecided, np.nan, margin))
    columns = (_known_numbers(column[listed]) for column in numbers)
    for posture, place, verdict, *found_numbers in zip(
        postures.tolist(), places.tolist(), verdicts.tolist(), *columns, strict=True
    ):
        number, low, high, inside = found_numbers
        rows[posture].append(
            Finding(
                check=check.check,
                where=check.where[place],
                value=number,
                lower=low,
                upper=high,
                margin=inside,
                unit=check.unit,
                verdict=verdict,
            )
        )


def _known_numbers(column: Array) -> list[float | None]:
    """Return numbers (N,) as `known_number` does each."""
    return [number if math.isfinite(number) else None for number in column.astype(np.float64).tolist()]
