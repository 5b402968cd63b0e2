"""Every command runs on the samples, says what it did, and ends with the code that it promises."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.cli.main import COMMANDS, main
from posekit.samples import samples


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made: Path = tmp_path_factory.mktemp("cli")
    samples(made)
    return made


@pytest.fixture
def run(folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Any:
    """Return a function that runs a command in the folder: (exit code, standard output, standard error)."""
    monkeypatch.chdir(folder)

    def command(*words: str, stdin: str = "") -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["posekit", *words])
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(stdin.encode())))
        with pytest.raises(SystemExit) as ended:
            main()
        printed = capfd.readouterr()
        return ended.value.code, printed.out, printed.err  # type: ignore[return-value]

    return command


@pytest.mark.parametrize("name", list(COMMANDS))
def test_help_has_few_options_and_examples(run: Any, name: str) -> None:
    code, out, _ = run(name, "--help")
    assert code == 0
    assert "Usage: " in out
    options = [line for line in out.split("\n") if line.startswith("  -")]
    assert len(options) <= 14
    assert name == "synth" or "Examples:" in out


def test_help_lists_every_command(run: Any) -> None:
    code, out, _ = run("--help")
    assert code == 0
    assert all(f"  {name} " in out for name in COMMANDS)


def test_validate_ends_with_0_if_all_is_valid_1_if_not_and_2_on_bad_input(run: Any, tmp_path: Path) -> None:
    assert run("validate", "walk.npz")[0] == 0
    code, out, _ = run("validate", "jump.bvh", "-o", str(tmp_path / "report.json"))
    assert code == 1
    assert out.startswith("keep 0 of 1 clip")
    report = posekit.open(tmp_path / "report.json")
    assert not report.ok.all()
    assert run("validate", "nothing.bvh")[0] == 2


def test_an_own_check_runs_from_the_current_folder(run: Any, folder: Path) -> None:
    text = """
import numpy as np
import posekit

@posekit.check("wrist-high", unit="m", reads=("joints", "up"))
def wrist_high(body):
    '''A wrist is high.'''
    return posekit.Judgement(places=("right", "left"), value=body.joints[:, 8:10] @ body.up, upper=0.5)
"""
    (folder / "mine.py").write_text(text, encoding="utf-8")
    code, out, err = run("validate", "walk.npz", "--checks", "mine:wrist_high")
    assert code == 1, err
    assert "wrist-high" in out


def test_recover_writes_a_result_that_validates(run: Any, tmp_path: Path) -> None:
    code, out, err = run("recover", "walk.json", "-o", str(tmp_path / "postures.json"), "--explain")
    assert code == 0, err
    assert "postures in 5 frames" in out
    assert "rigid-parts/" in out
    assert run("validate", str(tmp_path / "postures.json"))[0] == 0


def test_settings_come_from_options_set_and_a_file(run: Any, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("ranges = 'table1'\n", encoding="utf-8")
    written = [tmp_path / f"{name}.json" for name in ("option", "set", "file")]
    assert run("recover", "walk.json", "-o", str(written[0]), "--ranges", "table1")[0] == 0
    assert run("recover", "walk.json", "-o", str(written[1]), "--set", "ranges=table1")[0] == 0
    assert (
        run("recover", "walk.json", "-o", str(written[2]), "--settings", str(tmp_path / "mine.toml"))[0] == 0
    )
    found = [posekit.open(path) for path in written]
    assert all(one.settings["ranges"] == "table1" for one in found)
    assert np.array_equal(found[0].survivors.joints, found[1].survivors.joints)


def test_aliases_of_earlier_versions_still_work(run: Any, tmp_path: Path) -> None:
    words = (
        "--camera",
        "calibration.toml:cam_01",
        "--stature",
        "175cm",
        "--fps",
        "10",
        "--skeleton",
        "body_25",
    )
    code, _, err = run("recover", "keypoints", "-o", str(tmp_path / "a.npz"), *words)
    assert code == 0, err


def test_objects_are_recovered_by_their_linkage(run: Any, tmp_path: Path) -> None:
    words = ("--linkage", "panda", "--scale", "closure")
    code, out, err = run("recover", "gripper.json", "-o", str(tmp_path / "gripper.json"), *words)
    assert code == 0, err
    assert "panda" in out
    assert json.loads((tmp_path / "gripper.json").read_text())["schema"] == "posekit.object/1"


@pytest.mark.parametrize(
    "words",
    [
        ("walker", "--frames", "3"),
        ("random", "--frames", "2", "--noise", "2"),
        ("mocap", "walk.npz", "--frames", "4"),
        ("random", "--uncalibrated"),
    ],
)
def test_synth_writes_views_with_truth(run: Any, tmp_path: Path, words: tuple[str, ...]) -> None:
    code, _, err = run("synth", *words, "-o", str(tmp_path / "view.json"))
    assert code == 0, err
    assert np.isfinite(posekit.open(tmp_path / "view.json").truth).all()


def test_synth_object_writes_what_recover_reads(run: Any, tmp_path: Path) -> None:
    assert run("synth", "object", "panda", "-o", str(tmp_path / "panda.json"))[0] == 0
    words = ("--linkage", "panda", "--scale", "500")
    assert run("recover", str(tmp_path / "panda.json"), "-o", str(tmp_path / "found.json"), *words)[0] == 0


def test_evaluate_measures_a_result_against_its_view(run: Any, tmp_path: Path) -> None:
    assert run("recover", "walk.json", "-o", str(tmp_path / "postures.npz"))[0] == 0
    code, out, err = run("evaluate", str(tmp_path / "postures.npz"), "--truth", "walk.json")
    assert code == 0, err
    assert "100.0%" in out


def test_follow_answers_line_by_line(run: Any) -> None:
    image = posekit.open("walk.json").image if Path("walk.json").exists() else np.zeros((1, 14, 2))
    line = json.dumps({"time": 0.0, "points": (np.nan_to_num(image[0]) * 1000 + 500).tolist()})
    code, out, err = run("follow", "--stdin", "--size", "1280x720", "--stature", "175cm", stdin=f"{line}\n")
    assert code == 0, err
    assert json.loads(out.split("\n")[0])


@pytest.mark.parametrize(
    ("file", "facts"),
    [
        ("jump.bvh", "kind motion, layout bvh_posekit, unit cm, frames 90, rate 30 a second, up +y"),
        ("robot.npz", "kind motion, time 0 to 2.96667 s, up +z, robot g1"),
        (
            "keypoints",
            "kind detections, layout body_25, pictures 12, people 12 in 12 pictures, size not known",
        ),
        ("walk.json", "kind view, frames 5, time 0 to 0.8 s, seen 100% of the joints, given truth"),
        ("calibration.toml", "kind cameras"),
    ],
)
def test_inspect_lists_what_was_understood(run: Any, file: str, facts: str) -> None:
    code, out, _ = run("inspect", file)
    rows = dict(line.split(maxsplit=1) for line in out.split("\n") if line)
    assert code == 0 and rows["file"] == file
    for name, fact in (one.split(maxsplit=1) for one in facts.split(", ")):
        assert rows[name].startswith(fact), name


def test_convert_settings_and_samples(run: Any, tmp_path: Path) -> None:
    assert run("convert", "jump.bvh", str(tmp_path / "jump.trc"))[0] == 0
    code, out, _ = run("settings", "recover")
    assert code == 0
    assert "coverage = 0.99" in out
    assert run("samples", str(tmp_path / "again"))[0] == 0


def test_long_work_shows_its_progress(folder: Path) -> None:
    """Loops pass through what shows progress: the outermost one, and all of its items."""
    from posekit.progress import show_with

    seen: list[tuple[str, int]] = []

    def bar(items: Any, label: str) -> Any:
        held = list(items)
        seen.append((label, len(held)))
        yield from held

    show_with(bar)
    try:
        posekit.validate([folder / "jump.bvh", folder / "walk.npz"])
        posekit.recover(posekit.builtin_view("seq1"), follow=1)
    finally:
        show_with(None)
    posekit.validate(folder / "jump.bvh")
    assert seen == [("judging", 2), ("recovering", 1), ("following", 5)]
