"""The postures that a report lists one by one, with what is behind their verdicts."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own import JudgedCheck
from posekit.formats.own.report import Finding, PostureReport, Worst
from posekit.formats.own.report_columns import ReportPlace, VerdictColumns
from posekit.formats.own.report_making import make_report
from posekit.formats.own.report_schema import VERDICT_NAMES
from posekit.tree import Findings
from posekit.validation.validate_columns import lower_margin
from posekit.validators import Judgement
from posekit.validators import Report as Verdicts
from posekit.validators.robot import Contacts


def list_postures(
    verdicts: Verdicts,
    contacts: Contacts | None,
    columns: VerdictColumns,
    places: list[ReportPlace],
    rows: NDArray[Any],
    *,
    every: bool,
    first: int | None,
) -> list[PostureReport]:
    """List some postures of a batch with their findings.

    Parameters
    ----------
    verdicts : posekit.validators.Report
        What the validator said of them.
    contacts : Contacts, optional
        The pairs of bodies, where the check of collisions names none.
    columns : VerdictColumns
        The batch's.
    places : list of ReportPlace
        What the columns' places are.
    rows : int array
        Which postures of the batch.
    every : bool
        List every finding, not only violations and each check's worst.
    first : int, optional
        The number of the batch's first posture, where not all of the file are listed and each has its number.
    """
    judged = [
        part
        for judgement in verdicts.judgements
        if not judgement.by_pairs or contacts is None
        for part in _judged(judgement, rows)
    ]
    made = make_report(
        settings={},
        verdicts=[VERDICT_NAMES[verdict] for verdict in columns.verdict[rows]],
        fk_distance=verdicts.fk_distance[rows],
        judged=judged,
        all_findings=every,
    )
    touching = _touching(verdicts, contacts, rows)
    robot = bool(verdicts.points)
    listed = []
    for row, posture in zip(rows.tolist(), made.postures, strict=True):
        place = int(columns.worst_place[row])
        worst = None
        if place >= 0:
            at = places[place]
            worst = Worst(
                check=at.check,
                where=at.where,
                unit=at.unit,
                **{
                    name: float(getattr(columns, f"worst_{name}")[row])
                    for name in ("margin", "value", "bound")
                },
            )
        residual = dict(zip(verdicts.points, verdicts.residual[row].tolist(), strict=True)) if robot else None
        listed.append(
            PostureReport(
                verdict=posture.verdict,
                fk_distance=posture.fk_distance,
                findings=(*posture.findings, *touching.get(row, ())),
                index=None if first is None else first + row,
                worst=worst,
                undecided_by=tuple(columns.silent_checks(row)) if posture.verdict == "undecided" else None,
                residual=None
                if residual is None
                else {k: v if np.isfinite(v) else None for k, v in residual.items()},
            )
        )
    return listed


def _touching(verdicts: Verdicts, contacts: Contacts | None, rows: NDArray[Any]) -> dict[int, list[Finding]]:
    """List the pairs that collide, or are nearest, as findings of their postures."""
    findings: dict[int, list[Finding]] = {}
    if contacts is None:
        return findings
    judgement = next(one for one in verdicts.judgements if one.by_pairs)
    lower = lower_margin(judgement)
    wanted = set(rows.tolist())
    for row, pair, distance, bad in zip(
        contacts.posture.tolist(),
        contacts.pair.tolist(),
        contacts.distance.tolist(),
        contacts.violated.tolist(),
        strict=True,
    ):
        if row in wanted:
            findings.setdefault(row, []).append(
                Finding(
                    check=judgement.check,
                    where=contacts.names[pair],
                    value=distance,
                    lower=lower,
                    upper=None,
                    margin=distance - lower,
                    unit="m",
                    verdict="invalid" if bad else "valid",
                )
            )
    return findings


def _judged(judgement: Judgement, rows: NDArray[Any]) -> list[JudgedCheck]:
    """Split a validator's findings by unit."""
    parts = []
    for unit in dict.fromkeys(judgement.unit):
        columns = [k for k, own in enumerate(judgement.unit) if own == unit]
        at = rows[:, None], np.array(columns)
        parts.append(
            JudgedCheck(
                check=judgement.check,
                unit=unit,
                where=[judgement.where[k] for k in columns],
                findings=Findings(
                    value=judgement.value[at],
                    lower=judgement.lower[at],
                    upper=judgement.upper[at],
                    rejects=judgement.violated[at],
                ),
                undecided=np.isnan(judgement.margin[at]),
                over_time=judgement.over_time,
            )
        )
    return parts
