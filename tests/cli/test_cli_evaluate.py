"""`posekit evaluate`: motion of several formats, views, reports, charts, bad input."""

import builtins
import csv
import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.body import load_figure
from posekit.evaluate.comparison import compare
from posekit.formats.motion import Motion, write_motion
from posekit.formats.own import OpenCVModel, write_view
from posekit.skeleton import JOINTS
from posekit.synthesis import Walker, random_views, seq1
from posekit.views.builtin import view_of

FIGURE = load_figure()
FRAMES = 12
QUICK = ("--noise", "0,2", "--yaw-step", "90", "--heights", "1.5m", "--frames-per-clip", "3")


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def run(run: Callable[..., Any]) -> Callable[..., Any]:
    """Return a way to run the command in this process, in a folder of its own."""
    return partial(run, "evaluate")


def joints() -> np.ndarray:
    """Return the walker's joints (F, 14, 3), y up, metres."""
    walker, time = Walker(), np.arange(FRAMES) / 30
    points = FIGURE.forward_kinematics(walker.configurations(walker.phase(time)))
    return np.asarray(points[:, :14] + walker.travel(time)[:, None])


def save(path: str, **changed: Any) -> None:
    content = {
        "joints": joints(),
        "joint_names": np.array(JOINTS),
        "clip": np.zeros(FRAMES, dtype=int),
        "clip_names": np.array(["walk"]),
        "clip_action": np.array(["walking"]),
        "clip_fps": np.array([30.0]),
        "up": np.array("+y"),
    }
    np.savez(path, **{**content, **changed})


def test_reports_and_charts_are_written(run) -> None:
    pytest.importorskip("matplotlib")
    save("walk.npz")
    outcome = run("walk.npz", "-o", "report.json", "-o", "report.csv", *QUICK, "--plots")
    assert (outcome.code, outcome.err) == (0, "")
    assert "18 views of walk.npz, 3 yaws x 1 height, ranges anatomical" in outcome.out
    assert "| walking | 9 " in outcome.out
    report = json.loads(Path("report.json").read_text())
    assert report["schema"] == "posekit.evaluation/1"
    assert report["settings"]["noise_px"] == [0.0, 2.0]
    assert report["by_noise"][0]["retained_branch"] == 1.0
    assert report["all"]["violations"]["lengths"] == report["all"]["violations"]["ranges"] == 0
    with Path("report.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(report["conditions"]) == 6
    assert {row["yaw"] for row in rows} == {"0.0", "90.0", "180.0"}
    for name in ("yaw", "survivors", "correct-poses", "reliability"):
        assert Path(f"report-{name}.png").read_bytes().startswith(b"\x89PNG")
        assert f"report-{name}.png" in outcome.out


def test_motion_of_other_formats_is_the_same(run) -> None:
    save("walk.npz")
    motion = Motion(names=JOINTS, points=joints(), time=np.arange(FRAMES) / 30, rate=30.0, up="+y")
    write_motion("walk.trc", motion)
    write_motion("walk.csv", motion)
    told = {}
    for name in ("walk.npz", "walk.trc", "walk.csv"):
        # The text files round: so all are judged with the tolerance of what was measured.
        assert run(name, "-o", "r.json", *QUICK, "--noise", "0", "--rigid-tolerance", "3cm").code == 0
        told[name] = json.loads(Path("r.json").read_text())["all"]
    for one in told.values():
        assert one["retained_branch"] == 1.0
        assert one["error_mm"]["mpjpe"]["best"]["mean"] < 1
        assert one["survivors"]["mean"] == pytest.approx(told["walk.npz"]["survivors"]["mean"], rel=0.1)


def test_views_with_truth_are_taken_as_they_are(run) -> None:
    write_view("seq1.json", view_of(seq1()))
    outcome = run("seq1.json", "-o", "r.md")
    assert (outcome.code, outcome.err) == (0, "")
    assert "5 views of seq1.json" in outcome.out
    assert Path("r.md").read_text().splitlines()[0] in outcome.out
    write_view("random.json", view_of(random_views(FIGURE, 4, np.random.default_rng(0))))
    assert run("random.json", "-o", "r.json", "--noise", "0,1", "--root", "given").code == 0
    report = json.loads(Path("r.json").read_text())
    assert report["frames"] == 8
    assert [row["yaw"] for row in report["conditions"]] == [None, None]


def test_the_seed_decides(run) -> None:
    save("walk.npz")
    told = []
    for seed in ("1", "1", "2"):
        assert run("walk.npz", "-o", "r.json", *QUICK, "--seed", seed).code == 0
        told.append(json.loads(Path("r.json").read_text())["by_noise"][1])
    assert told[0] == told[1] != told[2]


def test_sequences_are_followed(run) -> None:
    save("walk.npz")
    options = ("--noise", "0", "--yaw-step", "90", "--heights", "1.5m", "--sequences")
    done = run("walk.npz", "-o", "r.json", "-o", "r.csv", *options)
    assert done.code == 0, done.err
    assert "MPJPE path" in done.out
    told = json.loads(Path("r.json").read_text())
    assert told["settings"]["sequences"] == "by_path"
    assert told["settings"]["frames_per_clip"] == 60
    errors = told["all"]["error_mm"]["mpjpe"]
    assert errors["best"]["mean"] <= errors["path"]["mean"] < errors["random"]["mean"]
    with Path("r.csv").open() as file:
        assert {"bridged", "limbs_right.path"} <= set(next(csv.reader(file)))


def test_frames_in_a_row_and_placed_necks(run) -> None:
    save("walk.npz")
    assert run("walk.npz", "-o", "r.json", *QUICK, "--consecutive", "--noise", "0").code == 0
    assert json.loads(Path("r.json").read_text())["settings"]["consecutive"] is True
    placed = ("--root", "auto", "--yaw-step", "180", "--noise", "1", "--length-deviation", "0")
    assert run("walk.npz", "-o", "r.json", *QUICK, *placed).code == 0
    report = json.loads(Path("r.json").read_text())
    assert report["settings"]["root"] == "auto"
    assert report["all"]["retained_within_35mm"] > 0


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (("--noise", "x"), ("--noise", "0,1,2")),
        (("--noise", "nan"), ("--noise", "finite")),
        (("--noise", "-1"), ("--noise", ">= 0")),
        (("--noise", ","), ("--noise", "one or more")),
        (("--yaw-step", "0"), ("--yaw-step", "1 to 180")),
        (("--yaw-step", "nan"), ("--yaw-step",)),
        (("--heights", "9m"), ("--heights: 9 m", "--distance")),
        (("--heights", "9"), ("--heights",)),
        (("--heights", ","), ("--heights", "one or more")),
        (("--distance", "0m"), ("distance",)),
        (("--f", "nan"), ("--f: nan",)),
        (("--f", "90000"), ("leaves every picture",)),
        (("--size", "9"), ("--size", "1920x1080")),
        (("--size", "0x9"), ("--size: '0x9'", "1920x1080")),
        (("--frames-per-clip", "0"), ("--frames-per-clip",)),
        (("--clips", "swim"), ("--clips", "walk")),
        (("--actions", "swimming"), ("--actions", "walking")),
        (("--root", "search"), ("--root", "given or auto")),
        (("--checks", "gravity"), ("gravity", "rigid-parts")),
        (("--ranges", "nowhere"), ("--ranges", "table1")),
        (("--rules", "9"), ("--rules", "9")),
        (("--rigid-tolerance", "3"), ("--rigid-tolerance", "unit")),
        (("--jobs", "0"), ("--jobs",)),
        (("--up", "up"), ("--up", "+x")),
        (("--skeleton", "nobody"), ("nobody",)),
        (("--format", "nothing"), ("--format", "trc")),
        (("-o", "report.txt"), ("report.txt", ".csv")),
        (("-o", "nowhere/report.json"), ("nowhere",)),
        (("-o", "walk.npz"), ("walk.npz", "written over")),
        (("-o", "report.json"), ("report.json", "written over")),
    ],
)
def test_bad_options_are_one_line(
    run, options: tuple[str, ...], parts: tuple[str, ...], assert_refused
) -> None:
    save("walk.npz")
    before = sorted(Path().iterdir())
    assert_refused(run("walk.npz", "-o", "report.json", *options), *parts)
    assert sorted(Path().iterdir()) == before


def test_bad_files_are_one_line(run, assert_refused) -> None:
    assert_refused(run("nothing.npz", "-o", "r.json"), "nothing.npz")
    Path("cut.npz").write_bytes(b"PK\x03\x04 and no more")
    assert_refused(run("cut.npz", "-o", "r.json"), "cut.npz")
    Path("key.json").write_text('{"annotations": [], "images": [], "categories": []}')
    assert_refused(run("key.json", "-o", "r.json"), "key.json")
    save("nan.npz", joints=np.full((FRAMES, 14, 3), np.nan))
    assert_refused(run("nan.npz", "-o", "r.json"), "nan.npz")
    unknown = joints()
    unknown[:, 4] = np.nan
    save("hipless.npz", joints=unknown)
    assert_refused(run("hipless.npz", "-o", "r.json"), "hipless.npz", "no frame has all 14 joints")
    view = view_of(seq1())
    write_view("seen.json", view)
    for options in (("--heights", "1m"), ("--consecutive",), ("--clips", "a")):
        assert_refused(run("seen.json", "-o", "r.json", *options), options[0], "leave the option out")
    assert_refused(run("seen.json", "-o", "r.json", "--noise", "1"), "lee-chen")
    document = json.loads(Path("seen.json").read_text())
    for frame in document["frames"]:
        del frame["truth"]
    Path("blind.json").write_text(json.dumps(document))
    assert_refused(run("blind.json", "-o", "r.json"), "blind.json", "no frame has a truth")
    assert not Path("r.json").exists()


def test_charts_say_what_they_need(run, monkeypatch: pytest.MonkeyPatch, assert_refused) -> None:
    save("walk.npz")
    real = builtins.__import__

    def without(name: str, *rest: Any, **more: Any) -> Any:
        if name.startswith("matplotlib"):
            raise ImportError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    assert_refused(run("walk.npz", "-o", "r.json", *QUICK, "--plots"), "matplotlib", "posekit[pictures]")
    assert not Path("r.json").exists()


def test_help_names_the_options(run) -> None:
    outcome = run("--help")
    assert outcome.code == 0
    for option in ("--yaw-step", "--heights", "--noise", "--frames-per-clip", "--plots", "--jobs"):
        assert option in outcome.out


def test_a_result_is_held_against_its_truth(command: Callable[..., Any], tmp_path: Path) -> None:
    """It says what `recover --truth` says; motion is the truth where the result's camera has a place in its world."""
    view, result = tmp_path / "view.json", tmp_path / "result.npz"
    save("walk.npz")
    assert command("synth", "mocap", "walk.npz", "-o", view, "--frames", "3", "--noise", "2").code == 0
    assert command("recover", view, "-o", result).code == 0
    done = command("evaluate", result, "--truth", view)
    assert done.code == 0, done.err
    expected = compare(posekit.read_result(result), posekit.read_view(view).truth)
    assert done.out.splitlines() == list(expected.lines)
    assert "against the truth, 3 of 3 frames" in done.out
    # By motion in any axes: they are laid by the image, as recover --truth does.
    save("turned.npz", joints=joints()[..., [2, 0, 1]])
    for motion, axes in (("walk.npz", "(x, y, z)"), ("turned.npz", "(y, z, x)")):
        said, *table = command("evaluate", result, "--truth", motion).out.splitlines()
        assert said.startswith(f"truth {motion}: its axes {axes} are the camera's world; it is seen ")
        assert table == list(expected.lines)
    np.testing.assert_array_less(expected.best, expected.middle + 1e-12)
    for words, said in (
        ((result,), "-o: no report"),
        ((view, "--truth", view), "expected a result"),
        ((result, "--truth", view, "--jobs", "2"), "--jobs: means nothing beside --truth"),
        ((result, "--truth", result), "truth"),
    ):
        done = command("evaluate", *words)
        assert done.code == 2 and said in done.err and done.err.count("\n") == 1, done.err


def test_a_view_of_motion_capture_says_where_its_camera_stands(
    command: Callable[..., Any], tmp_path: Path
) -> None:
    """The truth, brought into the world, is the motion; what is recovered stands there without a view."""
    save("walk.npz")
    assert command("synth", "mocap", "walk.npz", "-o", "view.json", "--frames", "3", "--dt", "0.1").code == 0
    view = posekit.read_view("view.json")
    camera = view.camera
    assert isinstance(camera, OpenCVModel) and camera.R is not None and camera.t is not None
    assert camera.up == "+y"
    world = (view.truth - camera.t) @ camera.R
    steps = np.linalg.norm(joints()[None] - world[:, None], axis=-1).max(axis=-1)
    np.testing.assert_allclose(steps.min(axis=1), 0.0, atol=1e-9)
    assert command("recover", "view.json", "-o", "result.npz").code == 0
    assert "where +y is up" in command("convert", "result.npz", "out.trc").out


def test_pictures_from_the_middle_of_a_clip_are_held_against_their_own_frames(
    command: Callable[..., Any], tmp_path: Path
) -> None:
    late = joints()
    late[:4] = np.nan
    save("late.npz", joints=late)
    words = ("--frames", "3", "--dt", "0.1", "--camera", "4,1,1.5")
    assert command("synth", "mocap", "late.npz", "-o", "view.json", *words).code == 0
    np.testing.assert_allclose(posekit.read_view("view.json").time, np.array([4, 7, 10]) / 30)
    assert command("recover", "view.json", "-o", "result.npz").code == 0
    by_view, by_motion = (
        command("evaluate", "result.npz", "--truth", truth).out for truth in ("view.json", "late.npz")
    )
    assert by_view == by_motion.partition("\n")[2] != ""
    # The same pictures, counted from their first: their seconds are as good.
    since = posekit.read_result("result.npz")
    frames = [replace(one, time=one.time - since.frames[0].time) for one in since.frames]
    posekit.write_result("since.npz", replace(since, frames=frames))
    save("first.npz", joints=late[4:], clip=np.zeros(FRAMES - 4, dtype=int))
    for name in ("since.npz", "result.npz"):
        assert command("evaluate", name, "--truth", "first.npz").out.partition("\n")[2] == by_view


def test_pictures_whose_rate_was_assumed_are_held_against_as_many_frames(
    command: Callable[..., Any], tmp_path: Path
) -> None:
    save("walk.npz")
    assert command("synth", "mocap", "walk.npz", "-o", "view.json", "--frames", "3", "--dt", "0.1").code == 0
    assert command("recover", "view.json", "-o", "result.npz").code == 0
    result = posekit.read_result("result.npz")
    # Every third frame is a picture: by number where the motion has these alone, by second where it is twice as slow.
    save("third.npz", joints=joints()[::3], clip=np.zeros(len(joints()[::3]), dtype=int))
    frames = [replace(one, time=2.0 * k / 30) for k, one in enumerate(result.frames)]
    posekit.write_result("slow.npz", replace(result, frames=frames))
    said, *table = command("evaluate", "slow.npz", "--truth", "third.npz").out.splitlines()
    assert said.endswith("; picture k is its frame k: at their seconds it is farther off")
    assert table == command("evaluate", "result.npz", "--truth", "view.json").out.splitlines()


def test_a_followed_result_says_how_far_its_path_is_off(command: Callable[..., Any], tmp_path: Path) -> None:
    save("walk.npz")
    words = ("--frames", "3", "--dt", "0.1", "--noise", "1")
    assert command("synth", "mocap", "walk.npz", "-o", "view.json", *words).code == 0
    truth = posekit.read_view("view.json").truth
    said = command("recover", "view.json", "-o", "result.npz", "--follow", "1", "--truth", "walk.npz").out
    out = command("evaluate", "result.npz", "--truth", "view.json").out
    assert out in said
    assert "| best of N | first-ranked | path " in " ".join(out.split())
    paths = posekit.read_result("result.npz").paths
    assert paths is not None
    away = np.nanmedian(1000 * np.linalg.norm(paths.joints[0] - truth, axis=-1).mean(axis=1))
    assert f"{away:.0f} / " in next(line for line in out.splitlines() if "where it is" in line).split("|")[4]
