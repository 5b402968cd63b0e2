"""`posekit validate` on clips: reports that agree, what is kept, pictures, how much may fail."""

import csv
import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.formats.own import read_report, schema
from posekit.skeleton import JOINTS

CLIPS = ("=walk", "still|<b>", "jumps")
FRAMES = 40
JUMP = 25
OPTIONS = ("--checks", "joint-range,speed", "--up", "+z")


@pytest.fixture
def run(run):
    """Return a way to run the command in this process, in a folder of its own."""
    return partial(run, "validate")


def write_clips(path: str = "clips.npz", second: str = CLIPS[1], jump: int = 2) -> np.ndarray:
    """Write three clips of somebody who glides while standing; the third, or another, jumps by two metres."""
    joints = np.repeat(load_figure().neutral_points[None, :14], len(CLIPS) * FRAMES, axis=0)
    clip = np.repeat(np.arange(len(CLIPS)), FRAMES)
    joints[:, :, 0] += (np.arange(len(clip)) % FRAMES)[:, None] * 0.01
    joints[jump * FRAMES + JUMP : (jump + 1) * FRAMES, :, 1] += 2.0
    np.savez(
        path, joints=joints, joint_names=np.array(JOINTS), clip=clip, clip_names=np.array([CLIPS[0], second, CLIPS[2]]),
        clip_fps=np.full(3, 30.0), up=np.array("+z"),
    )  # fmt: skip
    return joints


def test_all_reports_say_the_same_of_every_frame(run):
    write_clips()
    for suffix in ("json", "csv", "parquet", "md"):
        assert run("clips.npz", *OPTIONS, "-o", f"r.{suffix}").code == 1
    report = read_report("r.json")
    with Path("r.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    parquet = pytest.importorskip("pyarrow.parquet").read_table("r.parquet").to_pylist()
    assert len(report.postures) == len(rows) == len(parquet) == len(CLIPS) * FRAMES
    assert report.clips is not None
    for posture, row, cells in zip(report.postures, rows, parquet, strict=True):
        assert posture.verdict == row["verdict"] == cells["verdict"]
        assert posture.clip is not None and posture.worst is not None
        name = report.clips[posture.clip].clip
        assert (cells["file"], cells["clip"]) == ("clips.npz", name)
        assert row["clip"] == (f"'{name}" if name.startswith("=") else name)
        assert posture.frame == int(row["frame"]) == cells["frame"]
        assert posture.time == cells["time"] == pytest.approx(float(row["time"]), abs=1e-7)
        assert (
            (posture.worst.check, posture.worst.where)
            == (row["check"], row["where"])
            == (cells["check"], cells["where"])
        )
        for ours, theirs in (("value", "value"), ("bound", "bound"), ("margin", "worst_margin")):
            assert getattr(posture.worst, ours) == pytest.approx(cells[theirs])
            assert float(row[theirs]) == pytest.approx(cells[theirs], rel=1e-5, abs=1e-9)
    text = Path("r.md").read_text(encoding="utf-8")
    assert "3 clips: 2 valid, 1 invalid, 0 undecided" in text
    assert "clips.npz: jumps" in text
    document = json.loads(Path("r.json").read_text(encoding="utf-8"))
    validator = pytest.importorskip("jsonschema").Draft202012Validator(schema("report"))
    assert not list(validator.iter_errors(document))


def test_markdown_has_no_markup_from_files(run):
    write_clips(second="a|b\\|<b>[x](javascript:1)`*", jump=1)
    run("clips.npz", *OPTIONS, "-o", "r.md")
    text = Path("r.md").read_text(encoding="utf-8")
    (line,) = (line for line in text.splitlines() if line.startswith("| clips.npz"))
    assert line.count("|") == 7
    assert not set(line[2:-2].replace(" | ", "")) & set("<>[]`*\\|")


def test_a_jump_is_a_span_of_its_clip_alone(run):
    write_clips()
    run("clips.npz", *OPTIONS, "-o", "r.json")
    walk, still, jumps = read_report("r.json").clips or ()
    assert (walk.verdict, walk.spans, walk.good, walk.rejected_share) == ("valid", (), (0, FRAMES - 1), 0.0)
    assert still.verdict == "valid"
    assert jumps.verdict == "invalid"
    assert jumps.first_frame is not None and abs(jumps.first_frame - JUMP) <= 2
    assert {span.check for span in jumps.spans} == {"speed"}
    assert all(JUMP - 2 <= span.first <= span.last <= JUMP + 2 for span in jumps.spans)
    value, bound = jumps.spans[0].value, jumps.spans[0].bound
    assert value is not None and bound is not None and value > bound
    assert jumps.seconds == pytest.approx((FRAMES - 1) / 30)


def test_a_report_without_clips_is_read_as_before(run):
    write_clips()
    run("clips.npz", *OPTIONS, "-o", "r.json")
    document = json.loads(Path("r.json").read_text(encoding="utf-8"))
    del document["clips"]
    for posture in document["postures"]:
        for name in ("clip", "frame", "time"):
            posture.pop(name)
    Path("old.json").write_text(json.dumps(document), encoding="utf-8")
    assert read_report("old.json").clips is None


# --- what is kept ---------------------------------------------------------------------------------------


def test_clips_that_pass_are_kept_and_pass_again(run):
    joints = write_clips()
    outcome = run("clips.npz", *OPTIONS, "--keep", "kept")
    assert outcome.code == 1
    assert "written: kept, 2 of 3 clips kept" in outcome.out
    with np.load("kept/clips.npz") as kept:
        np.testing.assert_array_equal(kept["joints"], joints[: 2 * FRAMES])
    assert run("kept/clips.npz", *OPTIONS).code == 0
    with Path("kept/posekit-manifest.csv").open(encoding="utf-8", newline="") as file:
        manifest = {row["clip"]: row for row in csv.DictReader(file)}
    assert set(manifest) == {"'=walk", *CLIPS[1:]}
    assert (manifest["jumps"]["written"], manifest["jumps"]["first"]) == ("", "")
    assert manifest["jumps"]["why"].startswith("speed/")
    assert (manifest["'=walk"]["written"], manifest["'=walk"]["last"]) == ("clips.npz", str(FRAMES - 1))


def test_the_longest_good_span_is_kept_and_passes(run):
    joints = write_clips()
    assert run("clips.npz", *OPTIONS, "--keep", "kept", "--keep-spans", "0.5").code == 1
    assert run("kept/clips.npz", *OPTIONS).code == 0
    with np.load("kept/clips.npz") as kept:
        left = len(kept["joints"]) - 2 * FRAMES
        assert abs(left - JUMP) <= 2
        np.testing.assert_array_equal(kept["joints"][2 * FRAMES :], joints[2 * FRAMES : 2 * FRAMES + left])
    run("clips.npz", *OPTIONS, "--keep", "fewer", "--keep-spans", "5")
    with np.load("fewer/clips.npz") as kept:
        assert len(kept["joints"]) == 2 * FRAMES


def test_a_file_that_passes_whole_is_copied_to_the_byte(run):
    write_clips()
    run("clips.npz", *OPTIONS, "--keep", "kept")
    assert run("kept/clips.npz", *OPTIONS, "--keep", "again").code == 0
    assert Path("again/clips.npz").read_bytes() == Path("kept/clips.npz").read_bytes()


def test_a_folder_that_holds_something_is_not_written_to(run, files_here):
    write_clips()
    Path("kept").mkdir()
    Path("kept/mine.txt").write_text("mine")
    before = files_here()
    outcome = run("clips.npz", *OPTIONS, "--keep", "kept")
    assert outcome.code == 2
    assert "a folder that is new or empty" in outcome.err
    assert run("clips.npz", *OPTIONS, "--keep", ".").code == 2
    assert run("clips.npz", *OPTIONS, "--keep-spans", "1").code == 2
    assert files_here() == before


# --- pictures and pages ---------------------------------------------------------------------------------


def test_timelines_are_pictures_of_the_worst_clips_or_a_folder(run):
    write_clips()
    assert run("clips.npz", *OPTIONS, "--timeline", "t.png").code == 1
    assert Path("t.png").read_bytes().startswith(b"\x89PNG")
    run("clips.npz", *OPTIONS, "--timeline", "pictures")
    names = sorted(path.name for path in Path("pictures").iterdir())
    assert names == ["000_clips_jumps.png", "001_clips__walk.png", "002_clips_still__b_.png"]


def test_the_page_is_a_report_or_beside_one(run):
    write_clips()
    assert run("clips.npz", *OPTIONS, "-o", "r.html").code == 1
    run("clips.npz", *OPTIONS, "-o", "r.csv", "--page", "page.html")
    page = Path("page.html").read_text(encoding="utf-8")
    assert "jumps" in page
    assert "<b>" not in page
    assert "clip_counts" in Path("r.html").read_text(encoding="utf-8")
    assert run("clips.npz", *OPTIONS, "-o", "page.html", "--page", "page.html").code == 2


# --- how much may fail ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("allowed", "code"),
    [("1 clips", 0), ("0clips", 1), ("34% clips", 0), ("33%clips", 1), ("2%", 0), ("2", 0), ("0", 1)],
)
def test_frames_or_clips_may_fail(run, allowed, code):
    write_clips()
    assert run("clips.npz", *OPTIONS, "--fail-over", allowed).code == code


@pytest.mark.parametrize("allowed", ["clips", "-1 clips", "101% clips", "1.5 clips", "1 clip", "%"])
def test_what_is_no_number_of_clips_is_refused(run, allowed):
    write_clips()
    assert run("clips.npz", *OPTIONS, "--fail-over", allowed).code == 2


def test_postures_without_time_have_no_clips(run):
    np.savez("p.npz", joints=np.repeat(load_figure().neutral_points[None, :14], 3, axis=0))
    for option in (("--keep", "kept"), ("--timeline", "t.png"), ("--fail-over", "1 clips")):
        outcome = run("p.npz", *option)
        assert outcome.code == 2, option
        assert "no frames in time" in outcome.err
    assert run("p.npz", "-o", "r.html").code == 0
