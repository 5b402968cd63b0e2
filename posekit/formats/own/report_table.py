"""Reports as tables: what the terminal shows, and a Markdown file."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from posekit.display.check_words import check_words
from posekit.display.plural import plural
from posekit.formats.markdown import no_markup, table_lines
from posekit.formats.own.report_clips import ClipVerdict, Span
from posekit.formats.own.report_columns import CheckCount, PlaceValue, VerdictColumns, measured
from posekit.formats.own.report_frames import ClipName, ReportFrames
from posekit.formats.own.report_repair import REPAIR_HEAD, repair_rows
from posekit.formats.own.report_schema import VERDICT_NAMES
from posekit.safe_io import one_line

MAX_NAMED_PLACES: Final = 3
"""Places of a check that the table names."""

MAX_SHOWN_POSTURES: Final = 100
"""Postures that are not valid, in a Markdown file."""

MAX_SHOWN_CLIPS: Final = 100
"""Clips that are not valid, in a Markdown file."""

MAX_TERMINAL_CLIPS: Final = 5
"""Clips that are not valid, on the terminal."""

MANY_QUIET_CHECKS: Final = 6
"""So many checks that found nothing are named in one line in a terminal."""

MAX_SETTING_CHARACTERS: Final = 200
"""Characters of a setting that are shown."""


def summary_table(
    columns: VerdictColumns, frames: ReportFrames | None = None, *, markdown: bool = False
) -> list[str]:
    """Count the verdicts, and for each check what it rejects, where most, and the worst posture (from 0).

    Parameters
    ----------
    columns : VerdictColumns
        The verdicts, one a posture.
    frames : ReportFrames, optional
        Which frame each posture is, where they are motion.
    markdown : bool
        Whether names are escaped for Markdown, or for a terminal, where many checks that found nothing share a line.
    """
    counts = ", ".join(f"{count} {verdict}" for verdict, count in columns.summary.items())
    lines = [f"{plural(len(columns), 'posture')}: {counts}", ""]
    head = ("check", "rejected", "undecided", "most often", "worst")
    total = max(len(columns), 1)
    by_check = columns.by_check()
    quiet = [check for check, count in by_check.items() if not count.rejected and not count.undecided]
    if markdown or len(quiet) < MANY_QUIET_CHECKS:
        quiet = []
    rows = [
        (
            check_words(check),
            f"{count.rejected} ({count.rejected / total:.1%})",
            count.undecided,
            _most(check, count),
            _worst(count, frames),
        )
        for check, count in by_check.items()
        if check not in quiet
    ]
    table = _table(head, rows, markdown) if rows else []
    missing = int(np.count_nonzero(columns.silent & 1))
    if missing:
        table += [""] * markdown
        table.append(f"joints are missing in {plural(missing, 'posture')}: undecided, where nothing is found")
    return lines + table + ([f"nothing found by {', '.join(map(check_words, quiet))}"] if quiet else [])


def markdown_lines(
    columns: VerdictColumns,
    settings: Mapping[str, Any],
    frames: ReportFrames | None = None,
    clips: Sequence[ClipVerdict] | None = None,
    refused: Sequence[str] = (),
) -> list[str]:
    """Write a report as Markdown: summary, clips with the worst first, settings, the first postures not valid.

    Parameters
    ----------
    columns : VerdictColumns
        The verdicts, one a posture.
    settings : mapping
        What decided them.
    frames : ReportFrames, optional
        Which frame each posture is.
    clips : sequence of ClipVerdict, optional
        The verdicts on clips.
    refused : sequence of str
        Files that could not be judged.
    """
    lines = ["# Validation", "", *summary_table(columns, frames, markdown=True)]
    if refused:
        lines += ["", "## Files that could not be judged", ""]
        lines += [f"- {no_markup(line)}" for line in refused[:MAX_SHOWN_CLIPS]]
    if clips:
        lines += ["", "## Clips", "", *clip_table(clips)]
    lines += ["", "## Settings", ""]
    lines += [f"- {no_markup(name)}: {no_markup(_shown(value))}" for name, value in settings.items()]
    lines += ["", "## Postures that are not valid", ""]
    bad = np.flatnonzero(columns.verdict)
    if not len(bad):
        return [*lines, "None."]
    if len(bad) > MAX_SHOWN_POSTURES:
        lines += [f"The first {MAX_SHOWN_POSTURES} of {len(bad)}.", ""]
    rows = [
        (
            row.posture,
            *(() if frames is None else _of_frame(frames, row.posture)),
            row.verdict,
            "" if row.worst is None else _at(row.worst),
            "; ".join(map(_at, row.violations))
            or f"undecided: {', '.join(map(check_words, row.undecided_by))}",
        )
        for row in columns.rows(bad[:MAX_SHOWN_POSTURES].tolist())
    ]
    where = () if frames is None else ("clip", "frame", "time, s")
    return lines + _table(("posture", *where, "verdict", "worst", "why"), rows)


def repair_lines(repair: Sequence[Mapping[str, Any]]) -> list[str]:
    """Write what a repair changed, and what is left, as a part of a Markdown file; nothing where nothing was repaired.

    Parameters
    ----------
    repair : sequence of mapping
        As `posekit.formats.own.ValidationReport` has them.
    """
    return ["", "## Repair", "", *_table(REPAIR_HEAD, repair_rows(repair))] if repair else []


def clip_table(clips: Sequence[ClipVerdict], most: int = MAX_SHOWN_CLIPS) -> list[str]:
    """List clips in Markdown, the worst first, with the span behind each that is farthest beyond its bound.

    Parameters
    ----------
    clips : sequence of ClipVerdict
        The verdicts on clips.
    most : int
        How many are shown.
    """
    counts = Counter(clip.verdict for clip in clips)
    told = ", ".join(f"{counts[name]} {name}" for name in VERDICT_NAMES)
    lines = [f"{plural(len(clips), 'clip')}: {told}", ""]
    bad = worst_first(clips)
    if not bad:
        return lines[:1]
    if len(bad) > most:
        lines += [f"The worst {most} of {len(bad)} that are not valid.", ""]
    head = ("clip", "verdict", "not valid", "first", "worst", "longest good span")
    return lines + _table(head, [_of_clip(clip) for clip in bad[:most]])


def clip_lines(clips: Sequence[ClipVerdict], most: int = MAX_TERMINAL_CLIPS) -> list[str]:
    """Count the clips, and name the worst of those that are not valid, a line each.

    Parameters
    ----------
    clips : sequence of ClipVerdict
        The verdicts on clips.
    most : int
        How many are named.
    """
    bad = worst_first(clips)
    lines = clip_table(clips)[:1]
    for clip in bad[:most]:
        name, verdict, share, *_, worst, good = map(str, _of_clip(clip))
        lines.append(one_line(f"  {name}: {verdict}, {share} not valid; {worst}; longest good span {good}"))
    return [*lines, f"  and {len(bad) - most} more"] if len(bad) > most else lines


def worst_first(clips: Sequence[ClipVerdict]) -> list[ClipVerdict]:
    """Return the clips that are not valid: invalid ones first, by their share of frames that are not valid."""
    return sorted((clip for clip in clips if clip.verdict != "valid"), key=ClipVerdict.rank)


def _of_clip(clip: ClipVerdict) -> tuple[object, ...]:
    return (
        ClipName(clip.file, clip.clip).name or "0",
        clip.verdict,
        f"{clip.invalid + clip.undecided} of {clip.frames} ({clip.rejected_share:.1%})",
        f"frame {clip.first_frame}: {', '.join(map(check_words, clip.first_by[:MAX_NAMED_PLACES]))}",
        said_of_span(clip.spans[0]) if clip.spans else "",
        f"{clip.good[0]} to {clip.good[1]}" if clip.good else "none",
    )


def said_of_span(span: Span) -> str:
    """Word a span: ``speed/right_wrist, frames 10 to 14 (0.33 to 0.47 s), worst 21.3 m/s in 12 (bound 15)``."""
    time = "" if span.start is None else f" ({span.start:.2f} s)"
    if span.start is not None and span.end is not None and span.last > span.first:
        time = f" ({span.start:.2f} to {span.end:.2f} s)"
    frames = f"frames {span.first} to {span.last}" if span.last > span.first else f"frame {span.first}"
    more = f" and {len(span.places) - 1} more" if len(span.places) > 1 else ""
    said = f"{check_words(span.name)}{more}, {frames}{time}"
    if span.value is None:
        return said if span.verdict == "invalid" else f"{said}, undecided"
    bound = "" if span.bound is None else f" (bound {span.bound:.4g})"
    return f"{said}, worst {measured(span.value, span.unit)} in {span.worst_frame}{bound}"


def _of_frame(frames: ReportFrames, posture: int) -> tuple[object, ...]:
    time = float(frames.time[posture])
    name = frames.clips[int(frames.clip[posture])].name
    return name, int(frames.frame[posture]), f"{time:.3f}" if math.isfinite(time) else ""


def _most(check: str, count: CheckCount) -> str:
    places = list(count.places.items())
    named = ", ".join(f"{check_words(check)}/{where} {number}" for where, number in places[:MAX_NAMED_PLACES])
    return named + (f", and {len(places) - MAX_NAMED_PLACES} more" if len(places) > MAX_NAMED_PLACES else "")


def _worst(count: CheckCount, frames: ReportFrames | None) -> str:
    if count.worst is None:
        return ""
    index, judged = count.worst
    where = f"posture {index}"
    if frames is not None and frames.in_time:
        clip, frame, _ = _of_frame(frames, index)
        where = f"frame {frame}{f' of {clip}' if len(frames.clips) > 1 else ''}"
    return f"{where}: {_found(judged.place.where, judged)}"


def _at(judged: PlaceValue) -> str:
    """Word what was found: ``speed/right_wrist 21.3 m/s (bound 15)``."""
    return _found(check_words(judged.place.name), judged)


def _found(name: str, judged: PlaceValue) -> str:
    if math.isnan(judged.value):
        return f"{name} {measured(-judged.margin, judged.place.unit, 3)} beyond its bound"
    return f"{name} {measured(judged.value, judged.place.unit)} (bound {judged.bound:.4g})"


def _shown(value: object) -> str:
    text = ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
    return text if len(text) <= MAX_SETTING_CHARACTERS else f"{text[: MAX_SETTING_CHARACTERS - 1]}…"


def _table(head: Sequence[str], rows: Iterable[Sequence[object]], markdown: bool = True) -> list[str]:
    """Lay out a table for a file that is rendered, or for a terminal, without the empty line after it."""
    return (table_lines(head, rows, spelled=no_markup) if markdown else table_lines(head, rows))[:-1]
