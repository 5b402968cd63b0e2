"""What the page of a report knows: plain values, bounded however many clips there are."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from posekit.body.capsules import CAPSULE_AXES
from posekit.display.check_words import check_words
from posekit.formats.own.report import ValidationReport, columns_of
from posekit.formats.own.report_clips import ClipVerdict, Span, Still
from posekit.formats.own.report_columns import VerdictColumns, measured
from posekit.formats.own.report_frames import ClipName
from posekit.formats.own.report_repair import repair_rows
from posekit.formats.own.report_table import worst_first
from posekit.skeleton import HEAD_POINTS, JOINT, JOINTS, SEGMENTS
from posekit.viewer.plots.stick import side
from posekit.viewer.scene.culprit import culprit

MOST_DETAILED_CLIPS: Final = 200
"""Clips that the page has a timeline and frames of, the worst first."""

MOST_NAMED_CLIPS: Final = 2000
"""Further clips that are not valid and are named."""

MOST_PAGE_SPANS: Final = 100
"""Spans of a clip that the page has, the worst first."""

MOST_REFUSED: Final = 200
"""Files that could not be judged."""

MOST_SETTING_CHARACTERS: Final = 2000
"""Characters of a setting."""

MOST_POSTURES: Final = 500
"""Postures that are not valid and are listed, of a report without clips."""


def page_report(report: ValidationReport, *, title: str) -> dict[str, Any]:
    """Gather what the page shows.

    Parameters
    ----------
    report : ValidationReport
        Of any number of clips.
    title : str
        What stands on top.
    """
    columns = columns_of(report)
    clips = list(report.clips or ())
    index = {id(clip): k for k, clip in enumerate(clips)}
    bad = worst_first(clips)
    counts: Counter[str] = Counter(clip.verdict for clip in clips)
    detailed = bad[:MOST_DETAILED_CLIPS]
    return {
        "title": title,
        "postures": columns.summary,
        "clip_counts": {name: counts[name] for name in columns.summary} if clips else None,
        "checks": _checks(columns, clips),
        "clips": [
            _clip(clip, report.stills[index[id(clip)]] if index[id(clip)] < len(report.stills) else ())
            for clip in detailed
        ],
        "named": [_named(clip) for clip in bad[MOST_DETAILED_CLIPS:][:MOST_NAMED_CLIPS]],
        "unnamed": max(len(bad) - MOST_DETAILED_CLIPS - MOST_NAMED_CLIPS, 0),
        "not_asked": _not_asked(report.settings),
        "refused": list(report.refused[:MOST_REFUSED]),
        "repair": repair_rows(report.repair),
        "rows": [] if clips else _postures(columns),
        "settings": {name: str(value)[:MOST_SETTING_CHARACTERS] for name, value in report.settings.items()},
        "skeleton": {
            "joints": [*JOINTS, *HEAD_POINTS],
            "segments": [[a, b, side((a, b))] for a, b in SEGMENTS],
        },
    }


def _checks(columns: VerdictColumns, clips: Sequence[ClipVerdict]) -> list[dict[str, Any]]:
    of_clips: Mapping[str, set[int]] = defaultdict(set)
    for k, clip in enumerate(clips):
        for span in clip.spans:
            if span.verdict == "invalid":
                of_clips[span.check].add(k)
    return [
        {
            "name": check_words(name),
            "rejected": count.rejected,
            "undecided": count.undecided,
            "clips": len(of_clips[name]),
            "places": list(count.places.items())[:3],
        }
        for name, count in columns.by_check().items()
    ]


def _not_asked(settings: Mapping[str, Any]) -> list[str]:
    """Say for each reason which checks were not asked for it."""
    reasons: dict[str, list[str]] = defaultdict(list)
    given = settings.get("not_asked")
    for check, why in given.items() if isinstance(given, dict) else ():
        for reason in why if isinstance(why, dict) else ():
            reasons[str(reason)].append(str(check))
    return [f"{', '.join(checks)}: {reason}" for reason, checks in reasons.items()]


def _clip(clip: ClipVerdict, stills: Sequence[Still]) -> dict[str, Any]:
    return {
        **_named(clip),
        "seconds": clip.seconds,
        "good": list(clip.good),
        "spans": [_span(span) for span in clip.spans[:MOST_PAGE_SPANS]],
        "more": clip.more_spans + max(len(clip.spans) - MOST_PAGE_SPANS, 0),
        "stills": {
            str(still.frame): [_millimetres(still.points), _millimetres(still.before)] for still in stills
        },
    }


def _named(clip: ClipVerdict) -> dict[str, Any]:
    return {
        "name": ClipName(clip.file, clip.clip).name or "clip 0",
        "verdict": clip.verdict,
        "frames": clip.frames,
        "bad": clip.invalid + clip.undecided,
    }


def _span(span: Span) -> dict[str, Any]:
    rounded = {
        name: None if value is None else float(f"{value:.5g}")
        for name, value in (
            ("value", span.value),
            ("bound", span.bound),
            ("start", span.start),
            ("end", span.end),
        )
    }
    return {
        **{name: getattr(span, name) for name in ("where", "verdict", "first", "last")},
        "check": check_words(span.check),
        "unit": "" if span.unit == "1" else span.unit,
        "worst": span.worst_frame,
        "places": list(span.places),
        "joints": sorted({joint for where in span.places for joint in _joints(f"{span.check}/{where}")}),
        **rounded,
    }


def _joints(reason: str) -> list[int]:
    """Return which joints a finding is about: those that it names, or the ends of the links that it names."""
    found = culprit(reason)
    ends = [point for link in found.links for axis in CAPSULE_AXES[link] for point in axis]
    return [*(JOINT[name] for name in found.joints), *ends]


def _millimetres(points: np.ndarray[Any, Any] | None) -> list[list[int] | None] | None:
    if points is None:
        return None
    return [
        [round(1000 * x) for x in point] if np.isfinite(point).all() else None for point in points.tolist()
    ]


def _postures(columns: VerdictColumns) -> list[dict[str, Any]]:
    return [
        {
            "posture": row.posture,
            "verdict": row.verdict,
            "why": [
                f"{check_words(one.place.name)} {measured(one.value, one.place.unit)} (bound {one.bound:.4g})"
                for one in row.violations
                if math.isfinite(one.value)
            ][:5]
            or [check_words(check) for check in row.undecided_by],
        }
        for row in columns.rows(np.flatnonzero(columns.verdict)[:MOST_POSTURES].tolist())
    ]
