"""The frames that are shown beside spans: those of the worst clips, upright, with the frame before."""

import numpy as np
import pytest

from posekit.formats.held_postures import HeldPostures
from posekit.formats.motion import UP_DIRECTIONS
from posekit.formats.own import Postures
from posekit.formats.own.report_clips import ClipVerdict, Span, Still
from posekit.formats.own.report_schema import Verdict
from posekit.validation.stills import MOST_STILLS, stills_of, worst_stills


def a_span(frame: int) -> Span:
    return Span(
        check="speed",
        where="neck",
        unit="m/s",
        verdict="invalid",
        first=frame,
        last=frame,
        frames=1,
        worst_frame=frame,
    )


def a_clip(*frames: int, bad: int = 1, verdict: Verdict = "invalid") -> ClipVerdict:
    spans = [a_span(frame) for frame in frames]
    return ClipVerdict(file="a", clip="", verdict=verdict, frames=20, invalid=bad, undecided=0, spans=spans)


@pytest.mark.parametrize("up", UP_DIRECTIONS)
def test_frames_stand_upright_in_their_own_middle_and_keep_their_shape(rng, up):
    joints = rng.normal(size=(20, 14, 3))
    joints[5] = np.nan
    held = HeldPostures(
        postures=Postures(joints=joints),
        frame=np.arange(20),
        clip=np.zeros(20, dtype=np.intp),
        time=np.arange(20.0),
        up=up,
    )
    (stills,) = stills_of([a_clip(7, 5, 0, 7)], held)
    assert [still.frame for still in stills] == [7, 0]  # nothing is known of frame 5
    first, start = stills
    assert start.before is None
    heights = joints[7] @ UP_DIRECTIONS[up]
    np.testing.assert_allclose(first.points[:, 2], heights - heights.mean(), atol=1e-6)
    np.testing.assert_allclose(first.points.mean(axis=0), 0, atol=1e-6)
    assert first.before is not None
    for a, b in ((first.points, first.points), (first.points, first.before)):
        ours = np.linalg.norm(a[:, None] - b[None], axis=-1)
        other = joints[7] if b is a else joints[6]
        np.testing.assert_allclose(ours, np.linalg.norm(joints[7][:, None] - other[None], axis=-1), atol=1e-5)


def test_few_frames_of_a_clip_are_kept(rng):
    held = HeldPostures(
        postures=Postures(joints=rng.normal(size=(20, 14, 3))),
        frame=np.arange(20),
        clip=np.zeros(20, dtype=np.intp),
        time=np.arange(20.0),
    )
    assert len(stills_of([a_clip(*range(15))], held)[0]) == MOST_STILLS


def test_the_worst_clips_keep_their_frames():
    some = (Still(frame=0, points=np.zeros((14, 3), dtype=np.float32), before=None),)
    clips = [a_clip(0, bad=k) for k in (3, 9, 5, 7)] + [a_clip(0, bad=20, verdict="undecided")]
    kept = worst_stills(clips, [some] * 5, most=2)
    assert [bool(one) for one in kept] == [False, True, False, True, False]
