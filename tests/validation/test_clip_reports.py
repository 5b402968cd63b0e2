"""The whole way: what the columns of a real report say, its clips' spans say too, and what is cut out passes."""

import numpy as np
import pytest

import posekit
from posekit.formats.motion import Motion, write_motion
from posekit.formats.own import ValidationReport
from posekit.skeleton import JOINT, JOINTS
from posekit.validation.keep import keep_clips

FRAMES, CLIPS = 60, 3


@pytest.fixture(scope="module")
def motion() -> Motion:
    """Return three clips of somebody who sways; the second jumps twice, bends a knee forward and loses a wrist."""
    standing = posekit.load_figure().neutral_points[:14]
    time = np.arange(FRAMES) / 30
    sway = (0.01 * np.sin(time) + 0.003 * time**2)[:, None, None] * np.array([1.0, 0.3, 0.0])
    points = np.repeat((standing + sway)[None], CLIPS, axis=0)
    points[1, 20:22, :, 1] += 0.8
    points[1, 35:40, JOINT["right_ankle"]] += [0.3, 0.0, 0.1]
    points[1, 50:55, JOINT["left_wrist"]] = np.nan
    return Motion(
        names=JOINTS,
        points=points.reshape(-1, 14, 3),
        time=np.tile(time, CLIPS),
        rate=30.0,
        up="+z",
        clip=np.repeat(np.arange(CLIPS), FRAMES),
        clips=("first", "second", "third"),
    )


@pytest.fixture(scope="module")
def report(motion: Motion, tmp_path_factory: pytest.TempPathFactory) -> ValidationReport:
    path = tmp_path_factory.mktemp("clips") / "clips.npz"
    write_motion(path, motion)
    return posekit.validate(path)


def test_every_rejected_frame_lies_in_one_span_of_each_check_that_rejects_it(report):
    assert [clip.verdict for clip in report.clips] == ["valid", "invalid", "valid"]
    for row in report.columns.rows():
        clip, frame = report.clips[report.frames.clip[row.posture]], report.frames.frame[row.posture]
        over = [span for span in clip.spans if span.first <= frame <= span.last]
        for check in {one.place.check for one in row.violations}:
            (span,) = (span for span in over if span.check == check and span.verdict == "invalid")
            assert {one.place.where for one in row.violations if one.place.check == check} <= set(span.places)
        if row.verdict == "undecided":
            assert {span.check for span in over if span.verdict == "undecided"} == set(row.undecided_by)


def test_spans_are_what_the_columns_have_and_no_more(report):
    rows = list(report.columns.rows())
    for k, clip in enumerate(report.clips):
        of_clip = [rows[row] for row in report.frames.rows(k)]
        for span in clip.spans:
            found = [
                one
                for row in of_clip[span.first : span.last + 1]
                for one in row.violations
                if one.place.check == span.check
            ]
            if span.verdict == "invalid":
                assert span.margin in [one.margin for one in found if one.place.where == span.where]
                (worst,) = (
                    one
                    for one in of_clip[span.worst_frame].violations
                    if (one.place.check, one.place.where) == (span.check, span.where)
                )
                assert (span.value, span.bound, span.unit) == (worst.value, worst.bound, worst.place.unit)
        first, last = clip.good
        assert all(row.verdict == "valid" for row in of_clip[first : last + 1])
        assert clip.valid == sum(row.verdict == "valid" for row in of_clip)


@pytest.mark.parametrize("suffix", ["npz", "csv", "parquet"])
def test_what_is_cut_out_passes(motion, tmp_path, suffix):
    path = tmp_path / f"clips.{suffix}"
    write_motion(path, motion)
    judged = posekit.validate(path, up="+z")
    assert judged.clips is not None and judged.frames is not None
    keep_clips(tmp_path / "kept", judged.clips, judged.frames, spans=0.3)
    again = posekit.validate(tmp_path / "kept" / path.name, up="+z")
    assert again.clips is not None
    assert [clip.verdict for clip in again.clips] == ["valid"] * CLIPS
    assert [clip.frames for clip in again.clips] == [clip.good[1] - clip.good[0] + 1 for clip in judged.clips]
    assert [clip.clip for clip in again.clips] == ["first", "second", "third"]
