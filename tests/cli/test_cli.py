"""The command line: help and completion, and what each command does."""

import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.cli.options import examples, numbers, rule_numbers, signed_length, split
from posekit.errors import InputError
from posekit.formats.own import (
    read_postures,
    read_report,
    read_result,
    read_view,
)
from posekit.papers import lee_chen_tables34
from posekit.skeleton import JOINTS, POINTS
from posekit.synthesis import random_postures

FIGURE = load_figure()
COMMANDS = (
    (),
    ("recover",),
    ("validate",),
    ("synth",),
    ("synth", "walker"),
    ("synth", "random"),
    ("synth", "mocap"),
    ("reproduce",),
    ("demo",),
)


def posekit(*arguments: str, **environment: str) -> SimpleNamespace:
    """Run the command line as users do: in a process of its own."""
    code = "import sys; from posekit.cli import main; sys.argv[0] = 'posekit'; main()"
    finished = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        env={**os.environ, **environment},
    )
    return SimpleNamespace(code=finished.returncode, out=finished.stdout, err=finished.stderr)


# --- help, version, completion ------------------------------------------------------------------------


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_help_ends_with_examples_one_a_line(run, words: tuple[str, ...]) -> None:
    outcome = run(*words, "--help")
    assert outcome.code == 0
    assert outcome.err == ""
    lines = outcome.out.rstrip().splitlines()
    start = next(k for k, line in enumerate(lines) if line.strip() in ("Example:", "Examples:"))
    shown = [line.strip() for line in lines[start + 1 :]]
    assert shown
    assert all(line.startswith("posekit ") and " ".join(words) in line for line in shown)
    assert not any("--------" in line for line in lines)


def test_without_arguments_help_is_printed(run) -> None:
    assert run() == run("--help")


def test_the_version_is_the_packages(run) -> None:
    import posekit as package

    assert run("--version") == (0, f"posekit {package.__version__}\n", "")


def test_the_command_runs_in_a_process_of_its_own(tmp_path: Path, assert_refused) -> None:
    assert posekit("--version").out.startswith("posekit ")
    target = tmp_path / "result.json"
    outcome = posekit("recover", str(tmp_path / "none.json"), "-o", str(target))
    assert_refused(outcome, "none.json", "No such file")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shell_completion_scripts(shell: str) -> None:
    outcome = posekit(_POSEKIT_COMPLETE=f"source_{shell}")
    assert outcome.code == 0
    assert "_POSEKIT_COMPLETE" in outcome.out
    assert outcome.err == ""


def test_shell_completion_completes() -> None:
    outcome = posekit(_POSEKIT_COMPLETE="complete_bash", COMP_WORDS="posekit rec", COMP_CWORD="1")
    assert outcome.out.split() == ["recover"]


def test_help_loads_none_of_the_libraries() -> None:
    code = (
        "import sys; from posekit.cli import main; sys.argv = ['posekit', '--help']\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'pinocchio', 'coal', 'pydantic', 'meshcat', 'yourdfpy'} & set(sys.modules)\n"
        "print('loaded:', sorted(heavy))"
    )
    finished = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert finished.stdout.endswith("loaded: []\n")


# --- synth --------------------------------------------------------------------------------------------


def test_synth_walker_writes_a_view_of_1985(run) -> None:
    outcome = run("synth", "walker", "-o", "w.json", "--camera", "300,0,300", "--frames", "3", "--dt", "0.1")
    assert outcome == (0, "written: w.json (3 frames)\n", "")
    view = read_view("w.json")
    assert view.unit == "cm"
    assert view.time.tolist() == pytest.approx([0.0, 0.1, 0.2])
    assert np.isfinite(view.truth).all()
    assert run("recover", "w.json", "-o", "r.json").code == 0
    np.testing.assert_allclose(
        read_result("r.json").frames[0].camera["position"], [3, 0, 3], rtol=0, atol=1e-8
    )


def test_synth_random_is_the_same_for_the_same_seed(run) -> None:
    for name, seed, noise in (("a", 7, 0), ("b", 7, 0), ("c", 8, 0), ("d", 7, 2)):
        command = ("synth", "random", "-o", f"{name}.json", "--frames", "4", "--seed", str(seed))
        assert run(*command, "--noise", str(noise)).code == 0
    a, b, c, d = (Path(f"{name}.json").read_bytes() for name in "abcd")
    assert a == b
    assert len({a, c, d}) == 3
    clean, noisy = read_view("a.json"), read_view("d.json")
    assert np.array_equal(clean.truth, noisy.truth)
    assert 0.5 < np.std(noisy.image - clean.image) < 4


def test_synth_random_keeps_its_distance(run) -> None:
    assert run("synth", "random", "-o", "far.json", "--frames", "20", "--distance", "7,8").code == 0
    depth = read_view("far.json").truth[..., 2]
    assert 6 < depth.min()
    assert depth.max() < 9


def test_synth_mocap_takes_lengths_from_the_clip(run, assert_refused) -> None:
    person = FIGURE.scaled({"right_hip-right_knee": 0.33, "left_hip-left_knee": 0.33})
    points = person.forward_kinematics(random_postures(person, 12, np.random.default_rng(4)))
    points = points[..., [1, 2, 0]]  # the file's world has y up
    names = [name.replace("right_", "r_").replace("left_", "l_") for name in JOINTS]
    np.savez(
        "clips.npz",
        joints=points[:, : len(JOINTS)].astype(np.float32),
        joint_names=np.array(names),
        clip=np.repeat([0, 1], 6),
        clip_names=np.array(["stand", "walk"]),
        clip_action=np.array(["standing", "walking"]),
        clip_fps=np.array([30.0, 30.0]),
        up=np.array("+y"),
        unit=np.array("m"),
    )
    outcome = run(
        "synth", "mocap", "clips.npz", "-o", "m.json", "--clip", "walk", "--frames", "4", "--dt", "0.0333"
    )
    assert outcome == (0, "written: m.json (4 frames)\n", "")
    assert (
        run("synth", "mocap", "clips.npz", "-o", "all.json", "--frames", "6").out
        == "written: all.json (6 frames)\n"
    )
    fewer = run("synth", "mocap", "clips.npz", "-o", "few.json", "--frames", "6", "--dt", "0.0667")
    assert fewer.out.startswith("3 of 6 frames: the clip has no more")
    view = read_view("m.json")
    assert view.lengths["right_hip-right_knee"] == pytest.approx(0.33, abs=1e-6)
    assert np.isfinite(view.root).all()
    assert run("recover", "m.json", "-o", "r.npz", "--rigid-tolerance", "1mm").code == 0
    for frame, truth in zip(read_result("r.npz").frames, view.truth, strict=True):
        assert np.linalg.norm(frame.joints - truth, axis=-1).max(axis=1).min() < 1e-3
    placed = run("synth", "mocap", "clips.npz", "-o", "p.json", "--camera", "5,1,0", "--seed", "1")
    assert placed.code == 0
    assert_refused(run("synth", "mocap", "clips.npz", "-o", "x.json", "--clip", "wlak"), "wlak", "walk")
    assert not Path("x.json").exists()


# --- validate -----------------------------------------------------------------------------------------


def test_validate_exits_0_where_all_are_valid(run, walk: dict[str, Any], write) -> None:
    assert run("recover", write(walk), "-o", "r.npz").code == 0
    outcome = run("validate", "r.npz", "-o", "report.json")
    assert (outcome.code, outcome.err) == (0, "")
    count = len(read_postures("r.npz").joints)
    assert outcome.out.splitlines()[0] == f"{count} postures: {count} valid, 0 invalid, 0 undecided"
    report = read_report("report.json")
    assert report.summary == {"valid": count, "invalid": 0, "undecided": 0}


def some_postures() -> np.ndarray:
    """Return a legal posture, one bent too far, and one with an unknown wrist."""
    joints = np.repeat(FIGURE.neutral_points[None, :14], 3, axis=0)
    q = np.zeros((1, FIGURE.model.nq))
    q[0, 6], q[0, FIGURE.configuration_names.index("pelvis_flexion")] = 1.0, np.radians(100)
    joints[1] = FIGURE.forward_kinematics(q)[0, :14]
    joints[2, JOINTS.index("left_wrist")] = np.nan
    return joints


def test_validate_exits_1_where_some_are_not(run) -> None:
    np.savez("p.npz", joints=some_postures())
    outcome = run("validate", "p.npz", "-o", "report.json")
    assert (outcome.code, outcome.err) == (1, "")
    assert outcome.out.splitlines()[0] == "3 postures: 1 valid, 1 invalid, 1 undecided"
    assert "joint-range/pelvis.flexion" in outcome.out
    report = read_report("report.json")
    assert [posture.verdict for posture in report.postures] == ["valid", "invalid", "undecided"]
    bad = [one for one in report.postures[1].findings if one.verdict == "invalid"]
    assert any(one.where == "pelvis.flexion" and one.unit == "deg" for one in bad)
    assert report.settings["checks"] == ["rigid-parts", "joint-range", "collision"]


def test_undecided_alone_is_not_all_valid(run) -> None:
    np.savez("p.npz", joints=np.full((2, 14, 3), np.nan))
    outcome = run("validate", "p.npz", "-o", "report.json")
    assert outcome.code == 1
    assert outcome.out.startswith("2 postures: 0 valid, 0 invalid, 2 undecided")


def test_the_options_of_validate_decide(run, write) -> None:
    np.savez("p.npz", joints=some_postures()[1:2])
    write(
        'schema = "posekit.ranges/1"\nkind = "configuration"\n[pelvis]\nflexion = [0.0, 120.0]\n', "wide.toml"
    )
    assert run("validate", "p.npz", "-o", "r.json", "--checks", "joint-range").code == 1
    assert (
        run("validate", "p.npz", "-o", "r.json", "--checks", "joint-range", "--ranges", "wide.toml").code == 0
    )
    assert run("validate", "p.npz", "-o", "r.json", "--checks", "rigid-parts").code == 0
    few = json.loads(Path("r.json").read_text(encoding="utf-8"))
    assert run("validate", "p.npz", "-o", "all.json", "--checks", "rigid-parts", "--all").code == 0
    every = json.loads(Path("all.json").read_text(encoding="utf-8"))
    assert len(every["postures"][0]["findings"]) > len(few["postures"][0]["findings"])
    assert every["settings"]["checks"] == ["rigid-parts"]


def test_validate_judges_by_a_figure_from_a_file(run, write) -> None:
    short = FIGURE.scaled({f"{side}_hip-{side}_knee": 0.30 for side in ("right", "left")})
    short.write("short.urdf")
    np.savez("p.npz", joints=short.neutral_points[None, :14])
    assert run("validate", "p.npz", "-o", "r.json", "--urdf", "short.urdf").code == 0
    assert run("validate", "p.npz", "-o", "r.json", "--urdf", "stick_figure", "--strict").code == 1


def test_postures_with_heads_are_judged_with_them(run) -> None:
    np.savez("p.npz", joints=FIGURE.neutral_points[None], joint_names=np.array(POINTS))
    assert run("validate", "p.npz", "-o", "r.json", "--all").code == 0
    found = json.loads(Path("r.json").read_text(encoding="utf-8"))["postures"][0]["findings"]
    assert any(one["where"].startswith("neck.") and one["verdict"] == "valid" for one in found)


def test_a_result_is_validated_as_it_was_recovered(run) -> None:
    """With its own figure, and the tolerance of angles that its frames were judged with."""
    assert run("synth", "random", "-o", "view.json", "--frames", "10", "--noise", "0.5").code == 0
    document = json.loads(Path("view.json").read_text(encoding="utf-8"))
    document["figure"] = {"lengths": {"right_hip-right_knee": 0.385}}
    Path("view.json").write_text(json.dumps(document), encoding="utf-8")
    assert run("recover", "view.json", "-o", "result.json").code == 0
    assert run("validate", "result.json", "-o", "report.json").code == 0


# --- reproduce and demo -------------------------------------------------------------------------------


def test_reproduce_writes_the_tables(run) -> None:
    outcome = run("reproduce", "lee-chen", "-o", "deep/tables")
    assert (outcome.code, outcome.err) == (0, "")
    figures = (
        "image.png",
        "levels.png",
        "projections.png",
        "superposed.png",
        "tree.png",
        "scene.png",
        "page.html",
    )
    expected = {f"lee-chen.{name}.{figure}" for name in ("seq1", "seq2") for figure in figures}
    written = {path.name for path in Path("deep/tables").iterdir()}
    assert written == expected | {"lee-chen.json", "lee-chen.md"}
    assert "# Lee & Chen 1985, reproduced" in outcome.out
    assert outcome.out.rstrip().endswith("written: deep/tables/lee-chen.md, deep/tables/lee-chen.json")


def test_reproduce_all_writes_one_page_over_both_papers(run, monkeypatch) -> None:
    grid = lee_chen_tables34.WalkGrid(velocities=(0.9,), leans=(0.0,), phases=2)
    monkeypatch.setitem(lee_chen_tables34.WALK_GRIDS, "fine", grid)
    outcome = run("reproduce", "all", "-o", "tables", "--no-pictures", "--effort", "fine")
    assert (outcome.code, outcome.err) == (0, "")
    reports = {f"{name}.{ending}" for name in ("lee-chen", "taylor", "papers") for ending in ("md", "json")}
    assert {path.name for path in Path("tables").iterdir()} == reports | {"papers.html"}
    assert json.loads(Path("tables/lee-chen.json").read_text(encoding="utf-8"))["settings"]["phases"] == 2
    assert outcome.out.rstrip().endswith("tables/papers.json")


def test_demo_does_all_of_it(run) -> None:
    outcome = run("demo", "-o", "results", "--no-pictures")
    assert (outcome.code, outcome.err) == (0, "")
    names = sorted(path.name for path in Path("results").iterdir())
    for view in ("seq1", "seq2", "seq1-walking", "random"):
        assert {f"{view}.view.json", f"{view}.result.json"} <= set(names)
        assert len(read_view(f"results/{view}.view.json")) == len(
            read_result(f"results/{view}.result.json").frames
        )
    assert {"demo.md", "lee-chen.md", "lee-chen.json", "seq1.report.json"} <= set(names)
    rows = [line for line in outcome.out.splitlines() if line.startswith("| ")]
    assert len(rows) == 5
    for row in rows[1:]:
        found = row.split("|")[6].strip()
        assert found.split(" of ")[0] == found.split(" of ")[1]
    assert not [name for name in names if name.startswith(".")]


# --- how options are read -----------------------------------------------------------------------------


def test_lists_lose_their_blanks() -> None:
    assert split(" rigid-parts, ,collision,") == ("rigid-parts", "collision")
    assert rule_numbers("1, 3") == (1, 3)
    assert rule_numbers("") == ()
    assert numbers("1, 2.5,-3e2", 3, "--camera") == (1.0, 2.5, -300.0)


@pytest.mark.parametrize("text", ["", "1", "1,2,3,4", "1,b,3", "1,inf,3", "1,nan,3"])
def test_numbers_are_counted_and_finite(text: str) -> None:
    with pytest.raises(InputError, match="--camera"):
        numbers(text, 3, "--camera")


def test_a_length_may_have_a_sign() -> None:
    assert signed_length("-1cm", "--contact-margin") == -0.01
    assert signed_length("2mm", "--contact-margin") == 0.002
    with pytest.raises(InputError, match="--contact-margin"):
        signed_length("--1cm", "--contact-margin")


def test_examples_are_laid_out_for_click() -> None:
    assert examples("posekit demo") == "\b\nExample:\n  posekit demo"
    assert examples("a", "b") == "\b\nExamples:\n  a\n  b"
