"""What a report derives from its table, counted again finding by finding."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import posekit
from posekit.validators import Report
from posekit.validators.report import clip_rows, joined, quantity

CHECKS = {"joint-range": "deg", "collision": "m", "sliding": "m/s", "swap": "1", "own": "W"}
PLACES = ("right_knee.flexion", "left_foot", "torso-head", "body")
SLIGHT = {"deg": 5.0, "m": 0.01, "m/s": 0.05}
"""Excess of severity 1, by unit; of other units a tenth of the bound."""


def random_report(seed: int, counts: tuple[int, ...] = (60, 40, 1, 90), rate: float = 30.0) -> Report:
    """Return a report of clips with runs of findings by several checks, and some undecided frames."""
    rng, rows = np.random.default_rng(seed), sum(counts)
    found = []
    for check in range(len(CHECKS)):
        for _ in range(4):
            start, length = rng.integers(rows), rng.integers(1, 8)
            for row in range(start, min(start + length, rows)):
                for place in rng.choice(len(PLACES), rng.integers(1, 3), replace=False):
                    bound, beyond = rng.uniform(1, 2), rng.uniform(0.01, 1)
                    if rng.random() < 0.5:
                        found.append((row, check, place, bound + beyond, -np.inf, bound, -beyond))
                    else:
                        found.append((row, check, place, -bound - beyond, -bound, bound, -beyond))
    found.sort(key=lambda one: one[:3])
    names = ("row", "check", "place", "value", "lower", "upper", "margin")
    columns = dict(zip(names, np.array(found).T, strict=True))
    silent = np.zeros((rows, len(CHECKS)), dtype=np.bool_)
    silent[rng.integers(rows, size=6), rng.integers(len(CHECKS), size=6)] = True
    incomplete = np.zeros(rows, dtype=np.bool_)
    incomplete[rng.integers(rows, size=4)] = True
    frame = np.concatenate([np.arange(count) for count in counts])
    margins = rng.uniform(0.1, 1, (rows, len(CHECKS)))
    margins[columns["row"].astype(int), columns["check"].astype(int)] = -0.1
    return Report(
        clip=np.repeat(np.arange(len(counts)), counts),
        frame=frame,
        time=frame / rate,
        files=tuple(f"{seed}{k}.npz" for k in range(len(counts))),
        names=("",) * len(counts),
        checks=tuple(CHECKS),
        units=tuple(CHECKS.values()),
        places=PLACES,
        findings={name: columns[name].astype(int if k < 3 else float) for k, name in enumerate(names)},
        margins=np.where(silent, np.nan, margins),
        silent=silent,
        incomplete=incomplete,
        notes=("Ground estimated at 0.10 m.", f"note {seed}"),
    )


REPORTS = [random_report(seed) for seed in range(4)]


@pytest.mark.parametrize("report", REPORTS)
def test_decisions_of_clips_follow_their_frames(report: Report) -> None:
    verdicts = np.array(report.verdicts)
    for k, clip in enumerate(report.clips):
        mine = verdicts[report.clip == k].tolist()
        assert (clip.file, clip.frames) == (report.files[k], len(mine))
        assert clip.invalid == mine.count("invalid") and clip.undecided == mine.count("undecided")
        best: tuple[int, int] | None = None
        for first in range(len(mine)):
            for last in range(first, len(mine)):
                longer = best is None or last - first > best[1] - best[0]
                if set(mine[first : last + 1]) == {"valid"} and longer:
                    best = (first, last)
        assert clip.good == best
        assert (clip.decision == "keep") is (set(mine) == {"valid"})
        rejecting = [span for span in clip.spans if span.verdict == "invalid"]
        assert bool(rejecting) is bool(clip.invalid)
        assert clip.severity == max((span.severity for span in rejecting), default=0.0)
        assert clip.reason == (
            rejecting[0].check if rejecting else "unknown joints" if clip.undecided else ""
        )


@pytest.mark.parametrize("report", REPORTS)
def test_causes_come_before_what_they_break_near_them(report: Report) -> None:
    """Exchanged sides break other checks within half a second; otherwise the most severe span comes first."""
    for clip in report.clips:
        rejecting = [span for span in clip.spans if span.verdict == "invalid"]
        causes = [span for span in rejecting if span.check == "swap"]
        follows = [
            span.check != "swap"
            and any(c.first - 15 <= span.last and span.first - 15 <= c.last for c in causes)
            for span in rejecting
        ]
        assert follows == sorted(follows)
        for part in (False, True):
            severities = [one.severity for one, late in zip(rejecting, follows, strict=True) if late is part]
            assert severities == sorted(severities, reverse=True)


@pytest.mark.parametrize("report", REPORTS)
def test_spans_hold_every_finding_once(report: Report) -> None:
    table = report.to_pandas()
    for clip in report.clips:
        own = table[(table["clip"] == clip.title) & (table.verdict == "invalid")]
        for check, found in own.groupby("check"):
            spans = sorted(
                (s.first, s.last, s) for s in clip.spans if s.check == check and s.verdict == "invalid"
            )
            for first, last, span in spans:
                inside = found[(found.frame >= first) & (found.frame <= last)]
                frames = sorted(set(inside.frame))
                worst = inside.loc[inside.margin.idxmin()]
                assert (frames[0], frames[-1], len(frames)) == (first, last, span.frames)
                assert np.diff(frames).max(initial=0) <= 3  # a tenth of a second at 30 Hz
                assert (span.worst_frame, span.place) == (worst.frame, worst.place)
                assert (span.value, span.margin) == (worst.value, worst.margin)
                assert span.bound == (worst.lower if worst.value < worst.lower else worst.upper)
                assert set(span.places) == set(inside.place)
                slight = SLIGHT.get(span.unit, abs(span.bound) / 10)
                assert span.severity == pytest.approx(-span.margin / slight)
                assert (span.start, span.end) == pytest.approx((first / 30, last / 30))
            for (_, last, _), (first, _, _) in pairwise(spans):
                assert first - last > 3
            assert sum(span.frames for _, _, span in spans) == len(set(found.frame))


@pytest.mark.parametrize(("rate", "spans"), [(20.0, 1), (30.0, 2), (50.0, 1), (100.0, 1)])
def test_findings_a_tenth_of_a_second_apart_are_one_span(rate: float, spans: int) -> None:
    """Three frames are one gap at any rate; more only within a tenth of a second."""
    report = random_report(0, (60,), rate)
    rows = np.array([10, 10 + (4 if rate == 30 else 3 if rate == 20 else round(rate / 10))])
    columns = {name: np.array([1.0, 1.0]) for name in ("value", "lower", "upper", "margin")}
    columns |= {"row": rows, "check": np.array([0, 0]), "place": np.array([0, 0])}
    found = Report(**{**vars_of(report), "findings": columns})
    assert sum(span.verdict == "invalid" for span in found.spans) == spans


def vars_of(report: Report) -> dict[str, object]:
    return {name: getattr(report, name) for name in report.__dataclass_fields__}


@pytest.mark.parametrize("report", REPORTS)
def test_counts_by_check_are_those_of_the_table(report: Report) -> None:
    table = report.to_pandas()
    for name, counts in report.by_check().items():
        mine = table[table.check == name]
        invalid = mine[mine.verdict == "invalid"]
        assert counts["frames"] == len(invalid[["clip", "frame"]].drop_duplicates())
        assert counts["clips"] == invalid["clip"].nunique()
        assert counts["undecided"] == int((mine.verdict == "undecided").sum())
        worst = invalid.loc[invalid.margin.idxmin()]
        place = "" if worst.place == counts["place"] else f"{worst.place} "
        assert (counts["worst"], counts["frame"]) == (place + quantity(worst.value, worst.unit), worst.frame)
        often = invalid.place.value_counts()
        assert often[counts["place"]] == often.max()
    text = report.summary()
    assert all(name in text for name in CHECKS)
    assert f"({report.by_check()['swap']['frames'] / len(report):.1%})" in text


def test_joined_reports_hold_the_findings_of_all() -> None:
    both = joined(REPORTS, refused=("x.bvh: cannot be read",))
    assert len(both) == sum(map(len, REPORTS))
    assert both.verdicts == [verdict for one in REPORTS for verdict in one.verdicts]
    for name, column in both.table().items():
        parts = np.concatenate([one.table()[name] for one in REPORTS])
        np.testing.assert_array_equal(column, parts)
    assert [clip.severity for clip in both.clips] == [clip.severity for one in REPORTS for clip in one.clips]
    assert both.decision.endswith("1 unreadable") and f"of {len(both.clips) + 1} clips" in both.decision
    assert [note for note in both.notes if note.startswith("note")] == [f"note {k}" for k in range(4)]
    assert sum("in 4 clips" in note for note in both.notes) == 1


def test_a_check_that_one_clip_was_asked_is_not_among_those_left_out() -> None:
    joints = np.repeat(posekit.load_figure().neutral_points[None, :14], 30, axis=0)
    timed, still = posekit.validate(joints, rate=30, up="+z"), posekit.validate(joints[:1])
    assert "floating" in timed.checks and "floating" in still.not_asked | {"floating": ""}
    both = joined([posekit.validate(joints, rate=30), timed])
    assert not set(both.not_asked) & set(both.checks)
    alone = joined([posekit.validate(joints, rate=30), posekit.validate(joints, rate=30)])
    assert "floating" in alone.not_asked and "--up" in alone.not_asked["floating"]


def test_the_table_of_clips_has_the_longest_valid_run() -> None:
    for report in REPORTS:
        for row, clip in zip(clip_rows(report), report.clips, strict=True):
            good = (-1, -1) if clip.good is None else clip.good
            assert (row["first_good"], row["last_good"]) == good
            assert (row["frames"], row["invalid"]) == (clip.frames, clip.invalid)
            assert row["decision"] == clip.decision and row["severity"] == round(clip.severity, 3)
