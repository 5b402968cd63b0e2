"""From postures to a report of verdicts."""

from __future__ import annotations

from typing import Any

from posekit.files import Judged, Postures, Report, make_report
from posekit.tree import Findings
from posekit.validators import Judgement, Validator


def validate(
    validator: Validator, postures: Postures, *, settings: dict[str, Any] | None = None, every: bool = False
) -> Report:
    """Judge a file of postures.

    Parameters
    ----------
    validator : Validator
    postures : Postures
    settings : dict, optional
        What decided the verdicts, to be written with them.
    every : bool
        List every finding, not only violations and each check's worst.

    Returns
    -------
    posekit.files.Report
    """
    report = validator.check(postures.joints, postures.head)
    judged = [part for judgement in report.judgements for part in _judged(judgement)]
    return make_report(
        settings={"figure": validator.figure.hash, "checks": list(validator.checks), **(settings or {})},
        verdicts=report.verdicts,
        fk_distance=report.fk_distance,
        judged=judged,
        all_findings=every,
    )


def _judged(judgement: Judgement) -> list[Judged]:
    """Split a validator's findings by unit."""
    parts = []
    for unit in dict.fromkeys(judgement.unit):
        columns = [k for k, own in enumerate(judgement.unit) if own == unit]
        parts.append(
            Judged(
                check=judgement.check,
                unit=unit,
                where=[judgement.where[k] for k in columns],
                findings=Findings(
                    value=judgement.value[:, columns],
                    lower=judgement.lower[:, columns],
                    upper=judgement.upper[:, columns],
                    rejects=judgement.violated[:, columns],
                ),
            )
        )
    return parts
