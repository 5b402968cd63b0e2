"""What is in an evaluation, and in a report of validation."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from posekit.display.check_words import check_words
from posekit.display.plural import plural
from posekit.formats.own.report import ValidationReport, columns_of
from posekit.formats.own.report_table import clip_lines, summary_table
from posekit.inspection.telling import cut_long, settings_line
from posekit.safe_io import refusal

MAX_COUNT_BELIEVED: Final = 2**53
"""Views are fewer."""


def report_lines(report: ValidationReport) -> list[str]:
    """Describe verdicts, what checks reject, and settings."""
    clips = clip_lines(report.clips) if report.clips else []
    if report.checks is None or report.listed is None:
        return [*summary_table(columns_of(report), report.frames), *clips, settings_line(report.settings)]
    counts = ", ".join(f"{count} {verdict}" for verdict, count in report.summary.items())
    return [
        f"{plural(len(report), 'posture')}: {counts}; listed are {report.listed}",
        *(
            f"{check_words(check)}: {one.rejected} rejected, {one.undecided} undecided"
            for check, one in report.checks.items()
        ),
        *clips,
        settings_line(report.settings),
    ]


def evaluation_lines(path: Path, document: Any) -> list[str]:
    """Describe how many views were evaluated, and by noise how good their survivors are.

    Raises
    ------
    InputError
        Where the document is not one that `posekit evaluate` writes.
    """
    try:
        settings, noises = dict(document["settings"]), list(document["by_noise"])
        lines = [f"{plural(_count(document['frames']), 'view')} of {cut_long(str(settings['source']))}"]
        lines += [f"left out: {cut_long(str(one))}" for one in list(document["left_out"])[:3]]
        for one in noises:
            survivors, errors = one["survivors"], one["error_mm"]["mpjpe"]
            told = (
                plural(_count(one["frames"]), "view"),
                f"truth within 10 mm in {_share(one['retained_within_10mm'])}",
                f"its branch in {_share(one['retained_branch'])}",
                f"survivors median {_number(survivors['median'])}, 95 % {_number(survivors['p95'])}",
                f"none in {_count(one['frames_without_survivor']):,}",
                f"MPJPE best {_number(errors['best']['mean'])} mm, first {_number(errors['first']['mean'])} mm",
            )
            lines.append(f"added noise {float(one['noise']):g} px: {', '.join(told)}")
        if settings.get("sequences"):
            lines.append(
                f"followed: the survivors of a path were chosen {cut_long(str(settings['sequences']))}"
            )
        return [*lines, settings_line(settings)]
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError):
        raise refusal(
            path, "", "a damaged evaluation", "what posekit evaluate wrote", "evaluate again"
        ) from None


def _count(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < MAX_COUNT_BELIEVED:
        raise ValueError("no count")
    return value


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.1%}"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}".removesuffix(".0")
