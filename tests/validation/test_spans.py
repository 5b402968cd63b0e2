"""Verdicts of clips: every frame that is not valid lies in its clip's spans, and spans say what the columns say."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.formats.own.report_columns import ReportPlace, VerdictColumns
from posekit.formats.own.report_frames import ClipName, ReportFrames
from posekit.validation.spans import MOST_SPANS, clip_verdicts, longest_run

PLACES = (
    ReportPlace("speed", "neck", "m/s"),
    ReportPlace("speed", "pelvis", "m/s"),
    ReportPlace("joint_range", "right_knee.flexion", "deg"),
)
CHECKS = ("speed", "joint_range")
BOUND = 10.0


def columns_with(violated, silent=None) -> VerdictColumns:
    """Return columns of frames in which these places (N, 3) are violated, each by its own amount."""
    count = len(violated)
    silent = np.zeros(count, dtype=np.int16) if silent is None else silent
    posture, place = np.nonzero(violated)
    margin = -1.0 - posture - 0.1 * place
    unknown = np.full(count, np.nan)
    return VerdictColumns(
        places=PLACES,
        verdict=np.where(violated.any(axis=1), 1, np.where(silent > 0, 2, 0)).astype(np.int8),
        fk_distance=unknown,
        worst_place=np.full(count, -1, dtype=np.int32),
        worst_margin=unknown,
        worst_value=unknown,
        worst_bound=unknown,
        posture=posture,
        place=place.astype(np.int32),
        margin=margin,
        value=BOUND - margin,
        bound=np.full(len(margin), BOUND),
        silent=silent.astype(np.int16),
        checks=CHECKS,
    )


def frames_of_clips(clip, rate=30.0) -> ReportFrames:
    clip = np.asarray(clip, dtype=np.intp)
    frame = np.array([np.count_nonzero(clip[:k] == clip[k]) for k in range(len(clip))], dtype=np.intp)
    return ReportFrames(
        clips=[ClipName("a.npz", str(k)) for k in range(clip.max(initial=0) + 1)],
        clip=clip,
        frame=frame,
        time=frame / rate,
    )


some_frames = st.lists(
    st.tuples(st.booleans(), st.booleans(), st.booleans(), st.sampled_from([0, 0, 1, 2, 6])),
    min_size=1,
    max_size=40,
)


@given(cells=some_frames, cut=st.integers(1, 39), rate=st.sampled_from([10.0, 30.0, 120.0, np.nan]))
@settings(max_examples=150, deadline=None)
def test_every_violation_lies_in_exactly_one_span_of_its_check(cells, cut, rate):
    violated = np.array([cell[:3] for cell in cells])
    silent = np.array([cell[3] for cell in cells])
    clip = (np.arange(len(cells)) >= min(cut, len(cells) - 1)).astype(int)
    columns, frames = columns_with(violated, silent), frames_of_clips(clip, rate)
    verdicts = clip_verdicts(columns, frames)
    assert len(verdicts) == len(frames.clips)
    for k, verdict in enumerate(verdicts):
        rows = frames.rows(k)
        for check, unit, places in (("speed", "m/s", [0, 1]), ("joint_range", "deg", [2])):
            mine = [span for span in verdict.spans if (span.check, span.verdict) == (check, "invalid")]
            at = np.flatnonzero(violated[rows][:, places].any(axis=1))
            assert all(sum(span.first <= frame <= span.last for span in mine) == 1 for frame in at)
            for span in mine:
                inside = at[(at >= span.first) & (at <= span.last)]
                assert (inside[0], inside[-1], len(inside)) == (span.first, span.last, span.frames)
                assert span.worst_frame == inside[-1]  # the later, the farther outside, as made here
                assert (span.bound, span.unit) == (BOUND, unit)
                assert span.bound is not None and span.margin is not None
                assert span.value == pytest.approx(span.bound - span.margin)
                named = {PLACES[place].where for place in places if violated[rows[inside], place].any()}
                assert set(span.places) == named
                assert span.where == span.places[0]
        undecided = np.flatnonzero(columns.verdict[rows] == 2)
        covered = [span for span in verdict.spans if span.verdict == "undecided"]
        assert all(any(span.first <= frame <= span.last for span in covered) for frame in undecided)
        assert verdict.invalid == np.count_nonzero(violated[rows].any(axis=1))
        assert verdict.undecided == len(undecided)
        expected = "invalid" if verdict.invalid else "undecided" if verdict.undecided else "valid"
        assert verdict.verdict == expected
        assert (verdict.first_frame is None) == (verdict.verdict == "valid")
        if verdict.first_frame is not None:
            assert verdict.first_frame == np.flatnonzero(columns.verdict[rows])[0]
            assert verdict.first_by


@given(good=st.lists(st.booleans(), max_size=60))
def test_the_longest_run_is_as_long_as_any_and_has_nothing_bad(good):
    good = np.array(good, dtype=bool)
    run = longest_run(good)
    runs = [len(part) for part in "".join("g" if one else "b" for one in good).split("b")]
    assert (0 if run is None else run[1] - run[0] + 1) == max(runs)
    if run is not None:
        assert good[run[0] : run[1] + 1].all()


def test_neighbours_of_one_cause_are_one_span_and_those_far_apart_are_two():
    violated = np.zeros((60, 3), dtype=bool)
    violated[[5, 8, 30, 34], 0] = True
    (verdict,) = clip_verdicts(columns_with(violated), frames_of_clips(np.zeros(60)))
    assert sorted((span.first, span.last, span.frames) for span in verdict.spans) == [
        (5, 8, 2),
        (30, 30, 1),
        (34, 34, 1),
    ]
    assert verdict.good == (35, 59)
    assert verdict.first_by == ("speed/neck",)
    (faster,) = clip_verdicts(columns_with(violated), frames_of_clips(np.zeros(60), rate=120.0))
    assert len(faster.spans) == 2  # a tenth of a second is twelve frames


def test_spans_are_bounded_and_the_worst_come_first():
    violated = np.zeros((2000, 3), dtype=bool)
    violated[::10, 0] = True
    (verdict,) = clip_verdicts(columns_with(violated), frames_of_clips(np.zeros(2000)))
    assert (len(verdict.spans), verdict.more_spans) == (MOST_SPANS, 200 - MOST_SPANS)
    margins = [span.margin for span in verdict.spans if span.margin is not None]
    assert margins == sorted(margins)
    assert verdict.spans[0].worst_frame == 1990


def test_no_check_crowds_out_another():
    violated = np.zeros((2000, 3), dtype=bool)
    violated[::10, 0] = True
    violated[5, 2] = True
    (verdict,) = clip_verdicts(columns_with(violated), frames_of_clips(np.zeros(2000)))
    assert {span.check for span in verdict.spans} == set(CHECKS)
