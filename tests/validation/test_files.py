"""Any number of files in one report: what is judged alone is judged so among others, and broken ones are named."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.batch import validate_archive
from posekit.batch.run import Workers
from posekit.errors import InputError
from posekit.formats.held import HeldPostures
from posekit.formats.own import NamedConfigurations, Postures, read_report
from posekit.formats.own.report import columns_of
from posekit.samples import write_samples
from posekit.skeleton import JOINT, JOINTS
from posekit.validation import (
    AskedValidation,
    ReportBuilder,
    StatedMotion,
    WantedDetail,
    files_of,
    validate_files,
)
from posekit.validation.reading import ReadPostures
from posekit.validators import Validator

FIGURE = posekit.load_figure()
FRAMES = 12


def walk(k: int, frames: int = FRAMES) -> np.ndarray:
    """Return somebody who goes forward and nods; the wrist of every third is a metre away in one frame."""
    joints = np.repeat(FIGURE.neutral_points[None, :14], frames, axis=0)
    joints = joints + np.linspace(0.0, 0.2, frames)[:, None, None] * [1.0, 0.0, 0.0]
    joints[:, JOINT["right_wrist"]] += np.linspace(0.0, 0.001, frames)[:, None] * (1 + k % 5)
    if k % 3 == 0:
        joints[frames // 2, JOINT["left_wrist"]] += 1.0
    return joints


def save(path: Path, joints: np.ndarray, clip: np.ndarray | None = None) -> Path:
    """Write a file of motion."""
    path.parent.mkdir(exist_ok=True, parents=True)
    which = np.zeros(len(joints), dtype=np.int64) if clip is None else clip
    rates = np.full(int(which.max(initial=0)) + 1, 30.0)
    np.savez(path, joints=joints, joint_names=np.array(JOINTS), clip=which, clip_fps=rates, up=np.array("+z"))
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder of eight clips, two of them deeper."""
    for k in range(8):
        save(tmp_path / "clips" / ("more" if k > 5 else "") / f"walk{k}.npz", walk(k))
    return tmp_path / "clips"


# --- what is meant ---------------------------------------------------------------------------------------


def test_folders_patterns_and_names_mean_each_file_once(folder: Path) -> None:
    every = files_of([folder])
    assert [path.name for path in every] == [f"walk{k}.npz" for k in (6, 7, 0, 1, 2, 3, 4, 5)]
    assert files_of([folder, folder / "walk0.npz", folder, folder / "*.npz"]) == every
    assert set(files_of([folder / "**" / "*.npz"])) == set(every)


def test_hidden_files_others_and_the_report_are_no_input(folder: Path) -> None:
    every = files_of([folder])
    for name in (".hidden.npz", "README.md", "report.csv"):
        (folder / name).write_text("?", encoding="utf-8")
    assert files_of([folder], folder / "report.csv") == every


# --- laws of judging many --------------------------------------------------------------------------------


def test_files_are_judged_together_as_each_alone(folder: Path) -> None:
    paths = files_of([folder])
    asked = AskedValidation(changes={"ground": 0.0})
    together = validate_files(paths, asked)
    alone = [validate_files([path], asked) for path in paths]
    assert together.columns is not None
    assert together.columns.letters == "".join(one.columns.letters for one in alone if one.columns)
    assert together.clips == tuple(clip for one in alone for clip in one.clips or ())
    assert [one.verdict for one in together.postures] == [
        one.verdict for report in alone for one in report.postures
    ]
    assert [len(one.findings) for one in together.postures] == [
        len(one.findings) for report in alone for one in report.postures
    ]
    assert together.settings["files"] == len(paths)
    assert {one.clip for one in together.postures} == set(range(len(paths)))


def test_frames_of_clips_may_be_mixed_in_a_file() -> None:
    joints = np.concatenate([walk(0), walk(1)])
    clip = np.repeat([0, 1], FRAMES)
    frame = np.tile(np.arange(FRAMES), 2)
    held = HeldPostures(
        postures=Postures(joints=joints), frame=frame, clip=clip, time=frame / 30.0, up="+z", clips=("a", "b")
    )
    order = np.argsort(frame, kind="stable")  # a, b, a, b, …
    mixed = replace(
        held,
        postures=Postures(joints=joints[order]),
        frame=frame[order],
        clip=clip[order],
        time=frame[order] / 30,
    )
    apart, together = posekit.validate(held), posekit.validate(mixed)
    assert apart.columns is not None and together.columns is not None
    np.testing.assert_array_equal(together.columns.verdict, apart.columns.verdict[order])
    assert together.clips == apart.clips
    assert [len(one.findings) for one in together.postures] == [
        len(apart.postures[k].findings) for k in order.tolist()
    ]


def test_more_than_are_listed_are_the_first_that_are_not_valid(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = validate_files(files_of([folder]), AskedValidation())
    monkeypatch.setattr("posekit.validation.judging.MAX_LISTED", 2)
    short = validate_files(files_of([folder]), AskedValidation())
    bad = [k for k, one in enumerate(whole.postures) if one.verdict != "valid"]
    assert len(bad) > 2
    assert [one.index for one in short.postures] == bad[:2]
    assert short.verdicts is not None and short.summary == whole.summary


def test_an_array_with_a_rate_is_motion_and_without_one_postures() -> None:
    motion = posekit.validate(walk(0), rate=30, up="+z", ground=0.0)
    assert motion.clips is not None and motion.clips[0].frames == FRAMES
    assert "speed" in motion.settings["checks"]
    postures = posekit.validate(walk(0))
    assert postures.clips is None and "speed" not in postures.settings["checks"]


def test_results_are_judged_by_their_own_figure_among_others(folder: Path) -> None:
    view = posekit.builtin_view("seq1")
    result = posekit.result_of(posekit.recover(view))
    posekit.write_result(folder / "result.json", result)
    report = posekit.validate(folder)
    assert report.settings["urdf"] == "as recovered"
    assert report.columns is not None and report.frames is not None
    of_result = [clip.file.endswith("result.json") for clip in report.clips or ()].index(True)
    assert (report.columns.verdict[report.frames.rows(of_result)] == 0).all()


# --- bad input -------------------------------------------------------------------------------------------


@pytest.fixture
def run(command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., Any]:
    """Return a way to run `posekit validate` in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: command("validate", *arguments)


def test_broken_files_are_named_and_the_rest_is_judged_and_written(run, folder: Path) -> None:
    for name, text in (("a.npz", "junk"), ("b.bvh", "HIERARCHY\n"), ("c.json", "{")):
        (folder / name).write_text(text, encoding="utf-8")
    outcome = run("clips", "-o", "clips/report.json")
    assert outcome.code == 2
    lines = outcome.err.splitlines()
    assert len(lines) == 3 and all(line.startswith("posekit: error: clips/") for line in lines)
    report = read_report(folder / "report.json")
    assert len(report) == 8 * FRAMES and len(report.refused) == 3
    assert run("clips", "-o", "clips/report.json").code == 2  # the report in the folder is no input


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (("nothing",), ("nothing", "no such file or folder")),
        (("empty",), ("empty", "no file", ".bvh")),
        (("*.bvh",), ("*.bvh", "no file of such a name")),
        (("broken",), ("none of 2 files", "broken/")),
        (("one.npz", "--rate", "0"), ("--rate: 0",)),
        (("one.npz", "--rate", "-30"), ("--rate: -30",)),
        (("one.npz", "--rate", "nan"), ("--rate: nan",)),
        (("one.npz", "--unit", "furlong"), ("--unit: 'furlong'", "mm")),
        (("one.npz", "--up", "north"), ("--up: 'north'", "+z")),
        (("one.npz", "--profile", "none"), ("--profile none",)),
        (("one.npz", "-o", "one.npz"), ("one.npz",)),
        (("one.npz", "-o", "new", "--keep", "kept"), ("-o new", "--keep")),
        (("far.npz",), ("far.npz", "within 1e+09 m")),
    ],
)
def test_what_is_impossible_is_one_line_and_writes_nothing(
    run, tmp_path: Path, arguments: tuple[str, ...], parts: tuple[str, ...]
) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "broken").mkdir()
    for name in ("a.npz", "b.c3d"):
        (tmp_path / "broken" / name).write_text("junk", encoding="utf-8")
    save(tmp_path / "one.npz", walk(1))
    np.savez(tmp_path / "far.npz", joints=np.full((3, 14, 3), 1e12), schema="posekit.postures/1")
    before = sorted(tmp_path.rglob("*"))
    outcome = run(*arguments)
    assert (outcome.code, outcome.out) == (2, ""), outcome
    assert outcome.err.count("\n") == 1
    for part in parts:
        assert part in outcome.err
    assert sorted(tmp_path.rglob("*")) == before


def test_clips_of_one_frame_without_a_rate_and_hardly_known_are_judged(run, tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    save(tmp_path / "a" / "one.npz", walk(1, frames=1))
    hardly = walk(1, frames=5)
    hardly[:, 5:] = np.nan
    save(tmp_path / "a" / "unknown.npz", hardly)
    np.savez(tmp_path / "a" / "zero.npz", joints=walk(1), joint_names=np.array(JOINTS), rate=np.array(0.0))
    outcome = run("a")
    assert (outcome.code, outcome.err) == (1, ""), outcome
    assert "18 postures: 13 valid, 0 invalid, 5 undecided" in outcome.out
    assert "the frame rate is not known (--rate)" in outcome.out


def test_settings_that_are_impossible_are_refused_whatever_the_files_hold(folder: Path) -> None:
    with pytest.raises(InputError, match="walking-on-air"):
        posekit.validate(folder, checks=("walking-on-air",))


# --- archives --------------------------------------------------------------------------------------------


def test_a_row_without_numbers_is_undecided_and_its_report_is_read(run, tmp_path: Path) -> None:
    """There are more checks over time than a short number has bits."""
    write_samples(tmp_path)
    with np.load(tmp_path / "robot.npz") as held:
        robot = {name: held[name] for name in held.files}
    for name in ("root_pos", "root_quat_xyzw", "dof_pos"):
        robot[name] = robot[name][:12]
    robot["dof_pos"][6, 3] = np.nan
    np.savez(tmp_path / "gap.npz", **robot)
    run("gap.npz", "--urdf", "g1", "-o", "gap.json")
    written = json.loads((tmp_path / "gap.json").read_text(encoding="utf-8"))
    report = read_report(tmp_path / "gap.json")
    assert len(report.checks or ()) > 15
    assert sorted(columns_of(report).silent_checks(6)) == sorted(written["postures"][6]["undecided_by"])


def test_an_archive_that_cannot_be_judged_leaves_no_folder(run, folder: Path, tmp_path: Path) -> None:
    outcome = run("clips", "-o", "out", "--urdf", "g1", "--package-dir", "nowhere", "--jobs", "1")
    assert outcome.code == 2 and outcome.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_an_archive_of_broken_files_alone_leaves_no_folder(run, tmp_path: Path) -> None:
    for name in ("a.npz", "b.npz"):
        (tmp_path / name).write_text("junk", encoding="utf-8")
    outcome = run("a.npz", "b.npz", "-o", "out", "--jobs", "1")
    assert outcome.code == 2 and outcome.err.count("\n") == 1 and "none of 2 files" in outcome.err
    assert not (tmp_path / "out").exists()


def test_an_archive_goes_on_where_it_was(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("posekit.batch.verdicts.PART_FILES", 3)
    (folder / "broken.npz").write_text("junk", encoding="utf-8")
    files, asked = files_of([folder]), AskedValidation()
    first = validate_archive(files, tmp_path / "out", asked, Workers(jobs=1))
    whole = validate_files(files, asked)
    assert (first.parts, first.skipped) == (3, 0)
    assert first.frames == whole.summary
    assert len(first.refused) == 1
    written = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").iterdir()}
    next(iter((tmp_path / "out").glob("*.json"))).unlink()
    again = validate_archive(files, tmp_path / "out", asked, Workers(jobs=1))
    assert (again.parts, again.skipped, again.frames) == (3, 2, first.frames)
    assert set(written) == set((tmp_path / "out").iterdir())


def test_memory_does_not_grow_with_clips() -> None:
    """What is kept of a clip that passes is a few numbers a frame."""
    built = ReportBuilder(WantedDetail(detail="margins", files=40))
    judge = Validator(ground=0.0)
    frame = np.arange(FRAMES)
    for k in range(40):
        held = HeldPostures(
            postures=Postures(joints=walk(1)), frame=frame, clip=0 * frame, time=frame / 30.0, up="+z"
        )
        built.add(judge, held, file=f"walk{k}")
    report = built.report()
    columns = report.columns
    assert columns is not None
    kept = sum(value.nbytes for value in vars(columns).values() if isinstance(value, np.ndarray))
    assert kept < 100 * len(report)
    assert len(report.postures) == 0


def test_the_way_up_that_is_stated_counts_beside_settings() -> None:
    """Settings of one's own do not turn over what `balance` asks of a robot."""
    asked = AskedValidation(settings=posekit.ValidateSettings(), stated=StatedMotion(up="+y"))
    read = ReadPostures(NamedConfigurations(q=np.zeros((1, FIGURE.model.nq)), names=None, source="standing"))
    assert asked.validator(read).settings.up == (0.0, 1.0, 0.0)


def test_a_way_up_that_is_stated_against_the_body_is_said() -> None:
    said = "+y is up as was stated, though bodies stand along +z"
    assert said in posekit.validate(walk(0), rate=30, up="+y").settings["recognised"]
    assert said not in posekit.validate(walk(0), rate=30, up="+z").settings.get("recognised", [])
