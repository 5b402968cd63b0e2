"""From postures to a report of verdicts."""

from __future__ import annotations

from typing import Any

from posekit.figure import Figure, load_figure
from posekit.files import Judged, Postures, Report, Result, make_report
from posekit.pipeline.tolerance import EXACT, MEASURED
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


def recovered_with(result: Result) -> tuple[Figure, float]:
    """Return the figure of a result, and the angle tolerance (degrees) that its frames were judged with.

    Both are in its settings; a result without them is taken as the built-in figure's, and exact.
    """
    figure, settings = load_figure(), result.settings
    lengths = settings.get("lengths")
    if isinstance(lengths, dict) and settings.get("figure") != figure.hash:
        figure = figure.scaled({str(name): float(length) for name, length in lengths.items()})
    judged = settings.get("judged")
    kinds = set(judged) if isinstance(judged, list) else set()
    tolerances = [EXACT.angle]
    if "measured" in kinds:
        tolerances.append(MEASURED.angle)
    given = settings.get("tolerance")
    if "given" in kinds and isinstance(given, dict):
        tolerances.append(float(given.get("angle", EXACT.angle)))
    return figure, max(tolerances)


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
