"""`Report`: a table of findings, from which it computes verdicts, spans, decisions about clips and summaries."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import pairwise
from os import PathLike
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.files import DATA
from posekit.geometry import Array, Record, locked, runs

if TYPE_CHECKING:
    import pandas

#: Largest distance between a cause and its effect, frames: the window over which `jitter` measures trembling.
NEAR_FRAMES: Final = 15

#: Longest gap inside one span, seconds. It is at least the number of frames that follows, also if the rate is unknown.
MERGED_SECONDS, MERGED_FRAMES = 0.1, 3

#: Excess over a bound with severity 1, by unit: 1 cm as the softness of flesh, 5 degrees as the standard deviation of
#: joint ranges between people, 0.05 m/s as the sway of measured feet. For other units it is a tenth of the bound.
SLIGHT: Final = {"m": 0.01, "deg": 5.0, "m/s": 0.05}

#: Largest share of frames that two or more checks reject in a repairable clip. For defects planted in up to 95 % of
#: the frames of 10 recordings the share is up to 0.16, with one exception in 200 (0.95). For random points, all of
#: which a repair would replace, it is 0.7 or more.
MOST_TWICE_WRONG: Final = 0.5

#: Advice for findings of a check that has no advice in ``urdf/checks.toml``.
USUAL_REMEDY: Final = "leave such frames out with --keep-spans, or use --repair"

#: Columns of the findings with real numbers.
NUMBERS: Final = ("value", "lower", "upper", "margin")

Columns = Mapping[str, NDArray[Any]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Span:
    """Neighbouring frames of one clip that one check rejects, or in which it is undecided.

    Parameters
    ----------
    check, place, unit : str
        Name of the check, name of the worst joint or pair, and unit of the numbers.
    verdict : str
        ``invalid`` or ``undecided``.
    first, last : int
        First and last frame, both included.
    frames : int
        Number of rejected or undecided frames.
    worst_frame : int
        Frame with the smallest margin.
    start, end : float
        Times of the first and the last frame, seconds; NaN if unknown.
    value, bound, margin : float
        Value in the worst frame, the violated bound, and their difference, which is negative.
    severity : float
        Excess over the bound, as a multiple of `SLIGHT`: 1 cm, 5 degrees, 0.05 m/s, or a tenth of the bound.
    places : sequence of str
        Names of all rejected joints or pairs, the worst first.
    """

    check: str
    place: str
    unit: str
    verdict: str
    first: int
    last: int
    frames: int
    worst_frame: int
    start: float
    end: float
    value: float
    bound: float
    margin: float
    severity: float
    places: Sequence[str] = ()

    def __str__(self) -> str:
        where = f"{self.check} {self.place}".rstrip()
        at = f"frame {self.first}" if self.first == self.last else f"frames {self.first} to {self.last}"
        if self.verdict == "undecided":
            return f"{where}: undecided in {at}"
        worst = f"{quantity(self.value, self.unit)} in frame {self.worst_frame}"
        bound = "" if np.isnan(self.bound) else f", the bound is {quantity(self.bound, self.unit)}"
        return f"{where}: {at}; {worst}{bound}"


@dataclass(frozen=True, kw_only=True, eq=False)
class ClipDecision:
    """The decision about one clip.

    Parameters
    ----------
    file, name : str
        File of the clip, and the clip's name in the file; empty strings if unknown.
    decision : str
        ``keep``; ``repair?`` if `posekit.repair` can remove all findings, and at most half of the frames have findings
        of two or more checks; otherwise ``drop``.
    reason : str
        Name of the check of the first rejected span in `spans`, or ``unknown joints``; empty for clips to keep.
    frames, invalid, undecided : int
        Numbers of all frames, rejected frames and undecided frames.
    severity : float
        Largest severity of the spans; 0 without rejected frames.
    spans : sequence of Span
        Spans of the clip. Rejected spans are before undecided spans. Among rejected spans, probable effects of another
        span come last; otherwise higher severity is first.
    good : (int, int) or None
        First and last frame of the longest run of valid frames.
    """

    file: str
    name: str
    decision: str
    reason: str
    frames: int
    invalid: int
    undecided: int
    severity: float
    spans: Sequence[Span]
    good: tuple[int, int] | None

    @property
    def title(self) -> str:
        """File and name in one line."""
        return _title(self.file, self.name)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Report(Record):
    """Findings of K checks in N frames of one or more clips.

    Parameters
    ----------
    clip, frame : int array (N,)
        Index of the clip of each frame, and the frame's number in that clip, from 0.
    time : array (N,)
        Time of each frame, seconds; NaN if unknown.
    files, names : sequence of str
        File and name of each clip.
    checks, units : sequence of K str
        Names and units of the applied checks.
    places : sequence of str
        Names of the judged joints, angles, segments and pairs; findings refer to them by index.
    findings : mapping of arrays
        Columns of the violations, sorted by frame: ``row`` (index of the frame, from 0 to N - 1), ``check`` and
        ``place`` (indices), ``value``, ``lower`` and ``upper`` (bounds with tolerance), ``margin`` (negative).
    margins : array (N, K)
        Smallest margin of each check, as a share of its range; negative for violations, NaN if undecided.
    silent : bool array (N, K)
        Whether all values of a check of postures are undecided.
    incomplete : bool array (N,)
        Whether a joint is unknown.
    messages : mapping
        Meaning of the findings of each check, by the check's name.
    not_asked : mapping
        Reason why a check did not run, by the check's name.
    settings : mapping
        Settings and tolerances of the checks.
    notes, warnings, refused : sequence of str
        Remarks about the motion, doubts about its correctness, and error messages of unreadable files.

    Examples
    --------
    >>> import numpy as np, posekit
    >>> standing = posekit.load_figure().neutral_points[None, :14]
    >>> report = posekit.Validator().check(standing)
    >>> report.ok.tolist(), report.decision
    ([True], 'keep 1 of 1 clip')
    """

    clip: NDArray[np.intp]
    frame: NDArray[np.intp]
    time: Array
    files: Sequence[str]
    names: Sequence[str]
    checks: Sequence[str]
    units: Sequence[str]
    places: Sequence[str]
    findings: Columns
    margins: Array
    silent: NDArray[np.bool_]
    incomplete: NDArray[np.bool_]
    messages: Mapping[str, str] = field(default_factory=dict)
    not_asked: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    notes: Sequence[str] = ()
    warnings: Sequence[str] = ()
    refused: Sequence[str] = ()

    def __post_init__(self) -> None:
        for values in (*vars(self).values(), *self.findings.values()):
            if isinstance(values, np.ndarray):
                locked(values)

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.clip)

    def _facts(self) -> list[str]:
        return [f"{len(self)} frames", self.decision, *self.warnings]

    @cached_property
    def invalid(self) -> NDArray[np.bool_]:
        """For each frame (N,), whether a check rejects it."""
        found = np.zeros(len(self), dtype=np.bool_)
        found[self.findings["row"]] = True
        return locked(found)

    @cached_property
    def undecided(self) -> NDArray[np.bool_]:
        """For each frame (N,), whether a joint is unknown or a check is undecided, and no check rejects it."""
        return locked(~self.invalid & (self.incomplete | self.silent.any(axis=1)))

    @cached_property
    def ok(self) -> NDArray[np.bool_]:
        """For each frame (N,), whether it is valid: all joints are known, and no check rejects it or is undecided."""
        return locked(~self.invalid & ~self.undecided)

    @cached_property
    def worst(self) -> Array:
        """Smallest margin of each frame (N,) as a share of the range: negative if rejected, NaN if undecided."""
        least = np.fmin.reduce(self.margins, axis=1, initial=np.nan)
        return locked(np.where(self.undecided, np.nan, least))

    @property
    def verdicts(self) -> list[str]:
        """``valid``, ``invalid`` or ``undecided`` for each frame."""
        words = np.where(self.invalid, "invalid", np.where(self.undecided, "undecided", "valid"))
        return [str(word) for word in words]

    @cached_property
    def _cells(self) -> Columns:
        """Findings, and one row of NaN for each check that is undecided in a frame; sorted by frame and check."""
        rows, which = np.nonzero(self.silent & self.undecided[:, None])
        nothing = {"row": rows, "check": which, "place": np.full(len(rows), -1)}
        unknown = np.full(len(rows), np.nan)
        columns = {
            name: np.concatenate([column, nothing.get(name, unknown)])
            for name, column in self.findings.items()
        }
        order = np.lexsort((columns["check"], columns["row"]))
        return {name: column[order] for name, column in columns.items()}

    def table(self) -> dict[str, NDArray[Any]]:
        """Return the findings as columns.

        Returns
        -------
        dict
            ``clip, frame, time, check, place, value, lower, upper, unit, margin, verdict``. Each violation has one row.
            Each undecided check of a frame has one row whose numbers are NaN.
        """
        cells = self._cells
        undecided = np.isnan(cells["margin"]).astype(np.intp)

        def named(words: Iterable[str], which: NDArray[np.intp]) -> NDArray[Any]:
            return np.array([*words], dtype=object)[which]

        return {
            "clip": named(map(_title, self.files, self.names), self.clip[cells["row"]]),
            "frame": self.frame[cells["row"]],
            "time": self.time[cells["row"]],
            "check": named(self.checks, cells["check"]),
            "place": named([*self.places, ""], cells["place"]),
            **{name: cells[name] for name in ("value", "lower", "upper")},
            "unit": named(self.units, cells["check"]),
            "margin": cells["margin"],
            "verdict": named(("invalid", "undecided"), undecided),
        }

    def to_pandas(self, *, clips: bool = False) -> pandas.DataFrame:
        """Return `table` as a data frame; with `clips`, a row for each clip with its decision."""
        import pandas

        return pandas.DataFrame(clip_rows(self) if clips else self.table())

    def save(self, path: str | PathLike[str], *, clips: bool = False) -> None:
        """Write the report to a ``.json``, ``.csv``, ``.npz``, ``.parquet`` or ``.md`` file.

        With `clips`, ``.csv`` and ``.parquet`` files contain the decision about each clip instead of the findings.
        """
        import posekit

        options: dict[str, Any] = {"clips": True} if clips else {}
        posekit.save(self, path, **options)

    @cached_property
    def clips(self) -> list[ClipDecision]:
        """The decision about each clip."""
        cuts = np.searchsorted(self.clip, np.arange(len(self.files) + 1)).tolist()
        return [self._decided(clip, *ends) for clip, ends in enumerate(pairwise(cuts))]

    @property
    def spans(self) -> list[Span]:
        """All spans, clip by clip."""
        return [span for clip in self.clips for span in clip.spans]

    def _decided(self, clip: int, start: int, stop: int) -> ClipDecision:
        invalid, undecided = (int(one[start:stop].sum()) for one in (self.invalid, self.undecided))
        spans = _in_order(list(self._spans(start, stop)))
        rejecting = [span for span in spans if span.verdict == "invalid"]
        bad = bool(invalid or undecided or start == stop)
        repaired = all("repaired" in _known_checks().get(span.check, ()) for span in rejecting)
        failed = (self.margins[start:stop] < 0).sum(axis=1)
        mendable = rejecting and not undecided and repaired and np.mean(failed > 1) <= MOST_TWICE_WRONG
        good = max(runs(self.ok[start:stop]), key=lambda run: run[1] - run[0], default=None)
        return ClipDecision(
            file=self.files[clip],
            name=self.names[clip],
            decision="repair?" if mendable else "drop" if bad else "keep",
            reason=rejecting[0].check if rejecting else "unknown joints" if bad else "",
            frames=stop - start,
            invalid=invalid,
            undecided=undecided,
            severity=max((span.severity for span in rejecting), default=0.0),
            spans=tuple(spans),
            good=good and (int(self.frame[start + good[0]]), int(self.frame[start + good[1] - 1])),
        )

    def _spans(self, start: int, stop: int) -> Iterator[Span]:
        """Group neighbouring findings, or neighbouring undecided frames, of the same check into spans."""
        step = np.diff(self.time[start:stop])
        step, gap = step[step > 0], MERGED_FRAMES
        if len(step):
            gap = max(gap, round(MERGED_SECONDS / float(np.median(step))))
        first, last = np.searchsorted(self._cells["row"], (start, stop))
        cells = {name: column[first:last] for name, column in self._cells.items()}
        undecided = np.isnan(cells["margin"])
        for silent, check in sorted(set(zip(undecided.tolist(), cells["check"].tolist(), strict=True))):
            mine = np.flatnonzero((cells["check"] == check) & (undecided == silent))
            for part in np.split(mine, np.flatnonzero(np.diff(cells["row"][mine]) > gap) + 1):
                yield self._span(check, {name: column[part] for name, column in cells.items()})

    def _span(self, check: int, cells: Columns) -> Span:
        """Return the span of neighbouring findings of one check."""
        unit, rows = self.units[check], cells["row"]
        order = np.argsort(cells["margin"], kind="stable")
        value, lower, upper, margin = (float(cells[name][order[0]]) for name in NUMBERS)
        bound = lower if value < lower else upper
        slight = SLIGHT.get(unit, max(abs(bound), 1e-9) / 10)
        places = [[*self.places, ""][k] for k in dict.fromkeys(cells["place"][order].tolist())]
        first, last, worst = self.frame[rows[[0, -1, order[0]]]].tolist()
        return Span(
            check=self.checks[check],
            place=places[0],
            unit=unit,
            verdict="undecided" if np.isnan(margin) else "invalid",
            first=first,
            last=last,
            frames=len(np.unique(rows)),
            worst_frame=worst,
            start=float(self.time[rows[0]]),
            end=float(self.time[rows[-1]]),
            value=value,
            bound=bound,
            margin=margin,
            severity=0.0 if np.isnan(margin) else -margin / slight,
            places=tuple(places),
        )

    @cached_property
    def decision(self) -> str:
        """The decision in one line: ``keep 183 of 200 clips; 12 dropped by collision, 4 by teleport``."""
        counts = Counter((clip.decision, clip.reason) for clip in self.clips)
        kept = sum(clip.decision == "keep" for clip in self.clips)
        reasons = [
            words.format(count, reason)
            for decision, words in (("drop", "{} dropped by {}"), ("repair?", "{} repairable ({})"))
            for (decided, reason), count in counts.most_common()
            if decided == decision
        ]
        reasons += [f"{len(self.refused)} unreadable"] * bool(self.refused)
        head = f"keep {kept} of {plural(len(self.clips) + len(self.refused), 'clip')}"
        return f"{head}; {', '.join(reasons)}" if reasons else head

    def by_check(self) -> dict[str, dict[str, Any]]:
        """Return for each check the counts of rejected frames and clips, its most frequent place, and worst finding."""
        counts: dict[str, dict[str, Any]] = {}
        for k, name in enumerate(self.checks):
            found = {column: values[self.findings["check"] == k] for column, values in self.findings.items()}
            rows = np.unique(found["row"])
            clips = len(np.unique(self.clip[rows]))
            undecided = int((self.silent[:, k] & self.undecided).sum())
            counts[name] = {"frames": len(rows), "clips": clips, "undecided": undecided}
            counts[name] |= {"place": "", "worst": "", "frame": -1}
            if len(rows):
                worst = int(np.argmin(found["margin"]))
                often = self.places[int(np.bincount(found["place"]).argmax())]
                its = self.places[int(found["place"][worst])]
                value = quantity(float(found["value"][worst]), self.units[k])
                counts[name] |= {"place": often, "worst": value if its == often else f"{its} {value}"}
                counts[name]["frame"] = int(self.frame[found["row"][worst]])
        return counts

    def summary(self, most: int = 5) -> str:
        """Return the report as text: the decision, a table of checks, the worst clips, warnings and notes.

        Parameters
        ----------
        most : int
            Largest number of listed clips.
        """
        total = max(len(self), 1)
        lines = [self.decision, ""]
        counts = self.by_check()
        rows = [
            (
                name,
                f"{one['frames']} ({one['frames'] / total:.1%})",
                str(one["clips"]),
                str(one["undecided"] or ""),
                one["place"],
                f"{one['worst']} in frame {one['frame']}" if one["frames"] else "",
            )
            for name, one in counts.items()
            if one["frames"] or one["undecided"]
        ]
        if rows:
            lines += _aligned([("check", "frames", "clips", "undecided", "most often", "worst"), *rows])
        quiet = [name for name, one in counts.items() if not one["frames"] and not one["undecided"]]
        lines += [f"nothing found by {', '.join(quiet)}"] if quiet else []
        for reason in dict.fromkeys(self.not_asked.values()):
            names = [name for name, why in self.not_asked.items() if why == reason]
            lines.append(f"not asked: {', '.join(names)}: {reason}")
        if missing := int((self.incomplete & ~self.invalid).sum()):
            lines.append(f"joints are missing in {plural(missing, 'frame')}: undecided")
        often = max(counts, key=lambda name: counts[name]["frames"], default="")
        if often and counts[often]["frames"]:
            step = _known_checks().get(often, {}).get("remedy", USUAL_REMEDY)
            lines.append(f"{often}: {step}")
        bad = sorted((one for one in self.clips if one.decision != "keep"), key=lambda one: -one.severity)
        for clip in bad[:most]:
            shown = [str(span) for span in clip.spans[:3]]
            lines += ["", f"{clip.decision} {clip.title}".rstrip(), *(f"  {one}" for one in shown)]
        lines += [""] if self.notes or self.warnings or self.refused else []
        lines += [f"warning: {one}" for one in self.warnings]
        lines += list(self.notes[:most])
        lines += [f"unreadable: {one}" for one in self.refused[:most]]
        return "\n".join(lines)


def _title(file: str, name: str) -> str:
    return " ".join(part for part in (file, name) if part)


#: Values below this size are rounding errors and are written as 0, in the unit of the check.
NEGLIGIBLE: Final = 1e-6


def quantity(value: float, unit: str) -> str:
    """Write a value with its unit: ``2.6 cm``, ``147°``, ``0.12 m/s``, ``3 frames``."""
    value = 0.0 if abs(value) < NEGLIGIBLE else value
    if unit == "m":
        return f"{100 * value:.3g} cm" if abs(value) < 1 else f"{value:.3g} m"
    return f"{value:.3g}" + {"deg": "°", "1": ""}.get(unit, f" {unit}")


def plural(count: int, noun: str) -> str:
    """Return ``1 frame`` or ``2 frames``."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def joined(reports: Sequence[Report], *, refused: Sequence[str] = ()) -> Report:
    """Concatenate reports; checks with the same name are merged, and so are judged places with the same name."""
    units = {name: unit for one in reports for name, unit in zip(one.checks, one.units, strict=True)}
    check_at = {name: k for k, name in enumerate(units)}
    places = dict.fromkeys(name for one in reports for name in one.places)
    place_at = {name: k for k, name in enumerate(places)}
    parts: list[dict[str, NDArray[Any]]] = []
    count = clips = 0
    for one in reports:
        own = np.array([check_at[name] for name in one.checks], dtype=np.intp)
        at = np.array([place_at[name] for name in one.places], dtype=np.intp)
        margins = np.full((len(one), len(units)), np.nan)
        silent = np.zeros(margins.shape, dtype=np.bool_)
        margins[:, own], silent[:, own] = one.margins, one.silent
        found = one.findings
        moved = {"row": found["row"] + count, "check": own[found["check"]], "place": at[found["place"]]}
        frames = {name: getattr(one, name) for name in ("frame", "time", "incomplete")}
        parts.append(
            {**found, **moved, **frames, "clip": one.clip + clips, "margins": margins, "silent": silent}
        )
        count, clips = count + len(one), clips + len(one.files)
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return Report(
        findings={name: whole.pop(name) for name in reports[0].findings},
        files=tuple(name for one in reports for name in one.files),
        names=tuple(name for one in reports for name in one.names),
        checks=tuple(units),
        units=tuple(units.values()),
        places=tuple(places),
        messages={name: text for one in reports for name, text in one.messages.items()},
        not_asked={name: why for one in reports for name, why in one.not_asked.items() if name not in units},
        settings=reports[0].settings,
        notes=_joined_notes([note for one in reports for note in one.notes]),
        warnings=tuple(dict.fromkeys(note for one in reports for note in one.warnings)),
        refused=tuple(refused),
        **whole,
    )


#: Start of the note about an estimated ground.
GROUND_NOTE: Final = "Ground estimated"


def _joined_notes(notes: Sequence[str]) -> tuple[str, ...]:
    """Return notes without duplicates; one note replaces the notes of several clips about their estimated ground."""
    grounds = sum(note.startswith(GROUND_NOTE) for note in notes)
    others = tuple(dict.fromkeys(note for note in notes if not note.startswith(GROUND_NOTE)))
    one = f"{GROUND_NOTE} in {plural(grounds, 'clip')}, from frames in which the body rests; state it with --ground."
    return (*others, one) if grounds else others


@lru_cache(maxsize=1)
def _known_checks() -> Mapping[str, Mapping[str, Any]]:
    """Read ``urdf/checks.toml``: for each check, its causal rank, whether `posekit.repair` helps, and advice."""
    return tomllib.loads((DATA / "checks.toml").read_text(encoding="utf-8"))


def rank_of(check: str) -> int:
    """Return a check's causal rank: 0 if its findings cause other findings, above 1 if they are effects, else 1."""
    return int(_known_checks().get(check, {}).get("rank", 1))


def _in_order(spans: list[Span]) -> list[Span]:
    """Sort spans: rejected before undecided, then probable effects of nearby spans last, then by severity."""
    ranks = [rank_of(span.check) for span in spans]
    rejected = [span.verdict == "invalid" for span in spans]

    def follows(k: int) -> bool:
        return any(
            ranks[j] < ranks[k]
            and rejected[j]
            and one.first - NEAR_FRAMES <= spans[k].last
            and spans[k].first - NEAR_FRAMES <= one.last
            for j, one in enumerate(spans)
        )

    keys = [(not rejected[k], follows(k), -spans[k].severity, spans[k].first) for k in range(len(spans))]
    return [spans[k] for k in sorted(range(len(spans)), key=keys.__getitem__)]


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    ]


def clip_rows(report: Report) -> list[dict[str, Any]]:
    """Return a table with a row for each clip: file, name, decision, reason, counts, severity, worst span."""
    rows = []
    for clip in report.clips:
        row = {name: getattr(clip, name) for name in ("decision", "reason", "frames", "invalid", "undecided")}
        first, last = clip.good or (-1, -1)
        row |= {"severity": round(clip.severity, 3), "first_good": first, "last_good": last}
        worst = str(clip.spans[0]) if clip.spans else ""
        rows.append({"file": clip.file, "clip": clip.name, **row, "worst": worst})
    return rows
