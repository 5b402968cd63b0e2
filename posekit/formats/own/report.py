"""A report of validation: a verdict for each posture and the findings behind it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from posekit.display.pictured import Pictured
from posekit.display.plural import plural
from posekit.display.short_repr import ShortRepr
from posekit.display.stick_drawing import shares_drawing
from posekit.formats.own.report_clips import ClipVerdict, Still
from posekit.formats.own.report_columns import CheckCount, ReportPlace, VerdictColumns, joined
from posekit.formats.own.report_frames import ReportFrames
from posekit.formats.own.report_schema import VERDICT_NAMES, Verdict

VERDICT_COLOURS: Final = {"valid": "#009e73", "invalid": "#d55e00", "undecided": "#b0b0b0"}
"""Which the colour-blind tell apart (Okabe & Ito 2008)."""


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
class PostureReport(ShortRepr):
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
class ValidationReport(Pictured):
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
    repair : sequence of mapping
        Of each clip that was repaired, what was changed and what is left: `posekit.remedy.Repaired.as_dict`, with its
        ``file``, its ``clip`` and the file that was ``written``.
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
    repair: Sequence[Mapping[str, Any]] = ()

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

    def _facts(self) -> list[str]:
        clips = [plural(len(self.clips), "clip")] if self.clips else []
        refused = [f"{plural(len(self.refused), 'file')} refused"] if self.refused else []
        counts = [f"{count} {verdict}" for verdict, count in self.summary.items()]
        return [plural(len(self), "posture"), *counts, *clips, *refused]

    def _drawing(self) -> str:
        return shares_drawing([(name, count, VERDICT_COLOURS[name]) for name, count in self.summary.items()])


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
    unsaid = [name for posture in report.postures for name in posture.undecided_by or () if name != "joints"]
    checks = list(dict.fromkeys([*(place.check for place in places), *unsaid]))
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
        silent=np.array([_silent(posture, checks) for posture in report.postures], dtype=np.int64),
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
