"""Verdicts of clips: the spans of frames that checks reject or say nothing about."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.formats.motion.motion_table import recorded_rate
from posekit.formats.own.report_clips import ClipVerdict, Span
from posekit.formats.own.report_columns import PER_DEGREE, VerdictColumns
from posekit.formats.own.report_frames import ReportFrames
from posekit.formats.own.report_schema import VERDICT_NAMES
from posekit.geometry import Array, runs
from posekit.validation.causes import follows

MERGED_SECONDS: Final = 0.1
"""Seconds between two frames of one span at most; what comes back sooner has one cause."""

MERGED_FRAMES: Final = 3
"""The same in frames, where the rate is not known; and the least."""

MOST_SPANS: Final = 100
"""Spans that are listed of a clip: the worst of each check."""

MOST_NAMED_PLACES: Final = 10
"""Places of a span that are named."""

MOST_SPANS_OF_ALL: Final = 20_000
"""Spans that are listed of all clips of a report; each has five at least."""

_INVALID, _UNDECIDED = VERDICT_NAMES.index("invalid"), VERDICT_NAMES.index("undecided")


def clip_verdicts(
    columns: VerdictColumns, frames: ReportFrames, *, of: int | None = None
) -> tuple[ClipVerdict, ...]:
    """Judge clips by their frames.

    Parameters
    ----------
    columns : VerdictColumns
        What was found in each frame.
    frames : ReportFrames
        Which clip and frame each row is. Where several rows are of one frame, clips have no spans.
    of : int, optional
        Of how many clips these are a part: the more, the fewer spans of each are listed.

    Returns
    -------
    tuple of ClipVerdict
        In the order of `frames.clips`.
    """
    most = int(np.clip(MOST_SPANS_OF_ALL // max(of or len(frames.clips), 1), 5, MOST_SPANS))
    firsts = np.searchsorted(columns.posture, np.arange(len(columns) + 1))
    return tuple(
        _verdict(columns, frames, clip, frames.rows(clip), firsts, most) for clip in range(len(frames.clips))
    )


class _Cells(NamedTuple):
    """Violations or silences in a clip: the frame's place in the clip, what rejects it, and its row in the columns."""

    at: NDArray[np.intp]
    what: NDArray[np.intp]
    row: NDArray[np.intp]


def _verdict(
    columns: VerdictColumns,
    frames: ReportFrames,
    clip: int,
    rows: NDArray[np.intp],
    firsts: NDArray[np.intp],
    most: int,
) -> ClipVerdict:
    verdict, time = columns.verdict[rows], frames.time[rows]
    rate = recorded_rate(time)
    gap = max(MERGED_FRAMES, round(MERGED_SECONDS * rate)) if np.isfinite(rate) else MERGED_FRAMES
    found = (
        [
            *_invalid_spans(columns, frames, rows, firsts, gap),
            *_undecided_spans(columns, frames, rows, gap),
        ]
        if frames.in_time
        else []
    )
    bad = np.flatnonzero(verdict)
    counts = np.bincount(verdict, minlength=len(VERDICT_NAMES)).tolist()
    good = longest_run(verdict == 0)
    first = int(rows[bad[0]]) if len(bad) else None
    name = frames.clips[clip]
    known = time[np.isfinite(time)]
    return ClipVerdict(
        file=name.file,
        clip=name.clip,
        verdict="invalid" if counts[_INVALID] else "undecided" if counts[_UNDECIDED] else "valid",
        frames=len(rows),
        invalid=counts[_INVALID],
        undecided=counts[_UNDECIDED],
        spans=_listed(found, most),
        more_spans=max(len(found) - most, 0),
        first_frame=None if first is None else int(frames.frame[first]),
        first_by=() if first is None else tuple(_behind(columns, first, firsts)),
        good=() if good is None else tuple(int(frames.frame[rows[k]]) for k in good),
        seconds=float(np.ptp(known)) if len(known) else None,
    )


def longest_run(good: NDArray[np.bool_]) -> tuple[int, int] | None:
    """Return first and last place of the longest run of True, the first of them; None where there is none."""
    found = runs(good)
    if not found:
        return None
    start, stop = max(found, key=lambda run: run[1] - run[0])
    return start, stop - 1


def _badness(span: Span) -> tuple[bool, float, int]:
    """Order spans: what is rejected first, of those what is farthest beyond its bound."""
    margin, bound = (np.array([np.nan if x is None else x]) for x in (span.margin, span.bound))
    beyond = float(np.nan_to_num(_beyond(margin, bound, span.unit))[0])
    return span.verdict == "undecided", beyond, span.first


def _beyond(margin: Array, bound: Array, unit: str) -> Array:
    """Return margins as they are compared: 10 degrees or centimetres count as much as the bound of another unit."""
    if unit in PER_DEGREE:
        return margin / (10 * PER_DEGREE[unit])
    return margin / np.where(np.abs(bound) > 0, np.abs(bound), 1.0)


def _listed(spans: Sequence[Span], most: int) -> tuple[Span, ...]:
    """Choose spans, of each check as many as there is room for; list causes before what follows, the worst first."""
    ranks: Counter[str] = Counter()
    ranked = []
    for span in sorted(spans, key=_badness):
        ranked.append((ranks[span.check], span))
        ranks[span.check] += 1
    chosen = [span for _, span in sorted(ranked, key=lambda pair: pair[0])[:most]]
    after = follows(chosen).tolist()
    order = sorted(
        range(len(chosen)), key=lambda k: (chosen[k].verdict == "undecided", after[k], _badness(chosen[k]))
    )
    return tuple(chosen[k] for k in order)


def _behind(columns: VerdictColumns, row: int, firsts: NDArray[np.intp]) -> Sequence[str]:
    some = range(int(firsts[row]), int(firsts[row + 1]))
    return [columns.places[int(columns.place[k])].name for k in some] or columns.silent_checks(row)


def _invalid_spans(
    columns: VerdictColumns,
    frames: ReportFrames,
    rows: NDArray[np.intp],
    firsts: NDArray[np.intp],
    gap: int,
) -> Iterator[Span]:
    counts = firsts[rows + 1] - firsts[rows]
    at = np.repeat(np.arange(len(rows)), counts)
    offset = np.arange(len(at)) - np.repeat(np.cumsum(counts) - counts, counts)
    index = firsts[rows[at]] + offset
    checks = np.array([columns.checks.index(place.check) for place in columns.places], dtype=np.intp)
    what = checks[columns.place[index]] if len(checks) else at
    for first, last, cells in _runs(_Cells(at, what, index), gap):
        margin, bound = columns.margin[cells.row], columns.bound[cells.row]
        unit = columns.places[int(columns.place[cells.row[0]])].unit
        order = np.argsort(np.nan_to_num(_beyond(margin, bound, unit)), kind="stable")
        k, worst = int(cells.row[order[0]]), int(order[0])
        place = columns.places[int(columns.place[k])]
        named = dict.fromkeys(columns.place[cells.row[order]].tolist())
        yield Span(
            check=place.check,
            where=place.where,
            unit=place.unit,
            places=tuple(columns.places[one].where for one in named)[:MOST_NAMED_PLACES],
            verdict="invalid",
            first=int(frames.frame[rows[first]]),
            last=int(frames.frame[rows[last]]),
            start=_number(frames.time[rows[first]]),
            end=_number(frames.time[rows[last]]),
            frames=len(np.unique(cells.at)),
            worst_frame=int(frames.frame[rows[cells.at[worst]]]),
            value=_number(columns.value[k]),
            bound=_number(columns.bound[k]),
            margin=_number(columns.margin[k]),
        )


def _undecided_spans(
    columns: VerdictColumns, frames: ReportFrames, rows: NDArray[np.intp], gap: int
) -> Iterator[Span]:
    names = ("joints", *columns.checks)
    silent = np.where(columns.verdict[rows] == _UNDECIDED, columns.silent[rows], 0)
    for bit, name in enumerate(names):
        at = np.flatnonzero(silent >> bit & 1)
        for first, last, cells in _runs(_Cells(at, np.zeros(len(at), dtype=np.intp), at), gap):
            yield Span(
                check=name,
                where="",
                unit="",
                verdict="undecided",
                first=int(frames.frame[rows[first]]),
                last=int(frames.frame[rows[last]]),
                start=_number(frames.time[rows[first]]),
                end=_number(frames.time[rows[last]]),
                frames=len(cells.at),
                worst_frame=int(frames.frame[rows[first]]),
            )


def _runs(cells: _Cells, gap: int) -> Iterator[tuple[int, int, _Cells]]:
    """Cut cells into runs of one cause whose frames are at most `gap` apart: first place, last place, cells."""
    order = np.lexsort((cells.at, cells.what))
    cells = _Cells(*(column[order] for column in cells))
    cuts = np.flatnonzero((np.diff(cells.what) != 0) | (np.diff(cells.at) > gap)) + 1
    for part in np.split(np.arange(len(order)), cuts):
        if len(part):
            yield int(cells.at[part[0]]), int(cells.at[part[-1]]), _Cells(*(column[part] for column in cells))


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
