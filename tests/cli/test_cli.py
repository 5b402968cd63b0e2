"""The command line: what each command does, and one clear line for whatever is wrong."""

import importlib
import inspect
import json
import os
import subprocess
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest
import typer

from posekit.body import load_figure
from posekit.cameras.head import HeadPoints
from posekit.cli.groups import with_groups
from posekit.cli.options import examples, numbers, options_given, rule_numbers, signed_length, split
from posekit.errors import InputError
from posekit.formats.own import (
    ScaledOrthographicModel,
    View,
    read_object,
    read_object_view,
    read_postures,
    read_report,
    read_result,
    read_view,
    write_view,
)
from posekit.objects import load_object
from posekit.skeleton import HEAD_POINTS, JOINTS, PARENTS, POINTS, TREE_SEGMENTS, segment_name
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


class Outcome(NamedTuple):
    code: int
    out: str
    err: str


Run = Callable[..., Outcome]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Run:
    """Return a way to run the command line in this process, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    main = importlib.import_module("posekit.cli").main

    def run(*arguments: str) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["posekit", *arguments])
        with warnings.catch_warnings():  # main prints warnings its own way; put pytest's back afterwards
            warnings.simplefilter("default")
            capsys.readouterr()
            with pytest.raises(SystemExit) as caught:
                main()
        text = capsys.readouterr()
        code = caught.value.code
        return Outcome(code if isinstance(code, int) else 0, text.out, text.err)

    return run


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return the document of a view of the walker, two frames."""
    path = tmp_path_factory.mktemp("walk") / "walk.json"
    command = ["synth", "walker", "-o", str(path), "--frames", "2", "--velocity", "0.7", "--phase", "0.11"]
    finished = posekit(*command)
    assert finished.code == 0, finished.err
    return json.loads(path.read_text(encoding="utf-8"))  # type: ignore[no-any-return]


def posekit(*arguments: str, **environment: str) -> Outcome:
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
    return Outcome(finished.returncode, finished.stdout, finished.stderr)


def write(document: Any, path: str = "view.json") -> str:
    Path(path).write_text(document if isinstance(document, str) else json.dumps(document), encoding="utf-8")
    return path


def copy(document: dict[str, Any]) -> dict[str, Any]:
    return json.loads(json.dumps(document))  # type: ignore[no-any-return]


def files_here() -> list[str]:
    return sorted(str(path) for path in Path().rglob("*"))


def assert_refused(outcome: Outcome, *parts: str) -> None:
    """Check the one line: its prefix, what it tells, and that there is nothing else."""
    assert outcome.code == 2, outcome
    assert outcome.out == ""
    assert outcome.err.startswith("posekit: error: ")
    assert outcome.err.endswith("\n")
    assert outcome.err.count("\n") == 1
    assert outcome.err[:-1].isprintable()
    for part in parts:
        assert part in outcome.err


# --- help, version, completion --------------------------------------------------------------------------


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_help_ends_with_examples_one_a_line(run: Run, command: tuple[str, ...]) -> None:
    outcome = run(*command, "--help")
    assert outcome.code == 0
    assert outcome.err == ""
    lines = outcome.out.rstrip().splitlines()
    start = next(k for k, line in enumerate(lines) if line.strip() in ("Example:", "Examples:"))
    shown = [line.strip() for line in lines[start + 1 :]]
    assert shown
    assert all(line.startswith("posekit ") and " ".join(command) in line for line in shown)
    assert not any("--------" in line for line in lines)


def test_without_arguments_help_is_printed(run: Run) -> None:
    assert run() == run("--help")


def test_the_version_is_the_packages(run: Run) -> None:
    import posekit as package

    assert run("--version") == Outcome(0, f"posekit {package.__version__}\n", "")


def test_the_command_runs_in_a_process_of_its_own(tmp_path: Path) -> None:
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


# --- synth ----------------------------------------------------------------------------------------------


def test_synth_walker_writes_a_view_of_1985(run: Run) -> None:
    outcome = run("synth", "walker", "-o", "w.json", "--camera", "300,0,300", "--frames", "3", "--dt", "0.1")
    assert outcome == Outcome(0, "written: w.json (3 frames)\n", "")
    view = read_view("w.json")
    assert view.unit == "cm"
    assert view.time.tolist() == pytest.approx([0.0, 0.1, 0.2])
    assert np.isfinite(view.truth).all()
    assert run("recover", "w.json", "-o", "r.json").code == 0
    np.testing.assert_allclose(
        read_result("r.json").frames[0].camera["position"], [3, 0, 3], rtol=0, atol=1e-8
    )


def test_synth_random_is_the_same_for_the_same_seed(run: Run) -> None:
    for name, seed, noise in (("a", 7, 0), ("b", 7, 0), ("c", 8, 0), ("d", 7, 2)):
        command = ("synth", "random", "-o", f"{name}.json", "--frames", "4", "--seed", str(seed))
        assert run(*command, "--noise", str(noise)).code == 0
    a, b, c, d = (Path(f"{name}.json").read_bytes() for name in "abcd")
    assert a == b
    assert len({a, c, d}) == 3
    clean, noisy = read_view("a.json"), read_view("d.json")
    assert np.array_equal(clean.truth, noisy.truth)
    assert 0.5 < np.std(noisy.image - clean.image) < 4


def test_synth_random_keeps_its_distance(run: Run) -> None:
    assert run("synth", "random", "-o", "far.json", "--frames", "20", "--distance", "7,8").code == 0
    depth = read_view("far.json").truth[..., 2]
    assert 6 < depth.min()
    assert depth.max() < 9


def test_synth_mocap_takes_lengths_from_the_clip(run: Run) -> None:
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
    assert outcome == Outcome(0, "written: m.json (4 frames)\n", "")
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


# --- recover --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["json", "npz"])
def test_recover_writes_what_it_prints(run: Run, walk: dict[str, Any], suffix: str) -> None:
    view, target = write(walk), f"out.{suffix}"
    outcome = run("recover", view, "-o", target, "--group", "5cm", "--explain")
    assert (outcome.code, outcome.err) == (0, "")
    result = read_result(target)
    lines = outcome.out.splitlines()
    assert lines[0].split()[:4] == ["frame", "time", "postures", "groups"]
    for line, frame in zip(lines[1:3], result.frames, strict=True):
        assert int(line.split()[2]) == len(frame.joints)
        assert frame.groups is not None
        assert int(line.split()[3]) == len(set(frame.groups.tolist()))
        assert line.split()[4] == "exact"
        assert len(frame.joints) + sum(frame.rejected.values()) == 8192
        assert frame.pruned
    assert lines[-1] == f"written: {target}"
    assert result.configuration_names == FIGURE.configuration_names
    truth = read_view(view).truth
    for frame, joints in zip(result.frames, truth, strict=True):
        assert np.linalg.norm(frame.joints - joints, axis=-1).max(axis=1).min() < 1e-6
        np.testing.assert_allclose(frame.camera["f"], 0.05, rtol=0, atol=1e-8)


def test_json_and_npz_hold_the_same(run: Run, walk: dict[str, Any]) -> None:
    for target in ("a.json", "a.npz"):
        assert run("recover", write(walk), "-o", target).code == 0
    one, other = read_result("a.json"), read_result("a.npz")
    assert one.settings == other.settings
    for a, b in zip(one.frames, other.frames, strict=True):
        assert a.branches == b.branches
        np.testing.assert_allclose(a.joints, b.joints, rtol=1e-14)
        np.testing.assert_allclose(a.q, b.q, rtol=1e-14)


def test_the_options_of_recover_decide(run: Run, walk: dict[str, Any]) -> None:
    view = write(walk)

    def survivors(*options: str) -> int:
        outcome = run("recover", view, "-o", "r.npz", *options)
        assert outcome.code == 0, outcome.err
        return sum(len(frame.joints) for frame in read_result("r.npz").frames)

    free = survivors()
    walking = "rigid-parts,joint-range,collision,walking"
    assert survivors("--checks", "rigid-parts,joint-range") >= free
    assert survivors("--checks", walking, "--rules", "1,2,3,4,5") < free
    assert survivors("--checks", walking, "--rules", "1") <= free
    assert survivors("--contact-margin", "-3cm") >= free >= survivors("--contact-margin", "3cm")
    assert survivors("--rigid-tolerance", "2cm", "--tangent-tolerance", "5mm") >= free
    assert survivors("--ranges", "table1") > 0
    write(
        'schema = "posekit.ranges/1"\nkind = "configuration"\n[left_knee]\nflexion = [0.0, 1.0]\n',
        "stiff.toml",
    )
    assert survivors("--ranges", "stiff.toml") < free


def test_recover_replaces_an_older_result_whole(run: Run, walk: dict[str, Any]) -> None:
    Path("r.json").write_text("old", encoding="utf-8")
    assert run("recover", write(walk), "-o", "r.json").code == 0
    assert len(read_result("r.json").frames) == 2
    assert_refused(run("recover", write(walk), "-o", "r.json", "--checks", "nonsense"), "nonsense")
    assert len(read_result("r.json").frames) == 2
    assert files_here() == ["r.json", "view.json"]


def test_a_frame_without_a_neck_is_told_and_the_rest_recovered(run: Run, walk: dict[str, Any]) -> None:
    document = copy(walk)
    del document["frames"][0]["head_image"]["left_ear"]
    outcome = run("recover", write(document), "-o", "r.json")
    assert outcome.code == 0
    assert "frames[0]: 5 of 6 head points are known" in outcome.out
    assert [len(frame.joints) > 0 for frame in read_result("r.json").frames] == [False, True]


@pytest.mark.parametrize("suffix", ["json", "npz"])
def test_frames_that_cannot_be_recovered_say_why_and_the_others_are_the_same(run: Run, suffix: str) -> None:
    assert run("synth", "walker", "-o", "view.json", "--frames", "4").code == 0
    whole = json.loads(Path("view.json").read_text(encoding="utf-8"))
    holes = copy(whole)
    del holes["frames"][1]["image"]["neck"]
    seen = holes["frames"][2]["image"]
    holes["frames"][2]["image"] = {name: seen[name] for name in ("neck", "left_ankle", "right_ankle")}
    outcome = run("recover", write(holes, "holes.json"), "-o", f"some.{suffix}", "--follow", "1")
    assert outcome.code == 0
    assert "frames[1]: the neck, from which the tree grows, is not seen" in outcome.out
    assert (
        "1 of 4 frames not recovered: the neck, from which the tree grows, is not seen (frame 2)"
        in outcome.err
    )
    assert run("recover", "view.json", "-o", f"all.{suffix}").code == 0
    one, other = read_result(f"some.{suffix}"), read_result(f"all.{suffix}")
    assert [len(frame.joints) > 0 for frame in one.frames] == [True, False, False, True]
    assert [frame.time for frame in one.frames] == [frame.time for frame in other.frames]
    for k in (0, 3):
        np.testing.assert_array_equal(one.frames[k].joints, other.frames[k].joints)
        np.testing.assert_array_equal(one.frames[k].q, other.frames[k].q)
        assert one.frames[k].rejected == other.frames[k].rejected
        np.testing.assert_array_equal(one.frames[k].camera["position"], other.frames[k].camera["position"])
    assert [one.frames[k].rejected for k in (1, 2)] == [{"neck/not_seen": 8192}, {"trunk/not_seen": 8192}]
    assert one.settings["judged"] == ["exact", None, None, "exact"]
    assert sorted(one.settings["unrecovered"].values()) == [[1], [2]]
    assert one.paths is not None
    assert (one.paths.survivor[0] >= 0).tolist() == [True, False, False, True]


def test_following_shows_how_far_it_is_on_a_terminal_alone(
    run: Run, walk: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    command = ("recover", write(walk), "-o", "r.json", "--follow", "2")
    assert run(*command).err == ""
    monkeypatch.setattr("rich.console.Console.is_terminal", property(lambda _: True))
    shown = run(*command)
    assert shown.code == 0
    assert "following" in shown.err
    assert "/4" in shown.err  # two searches through two frames
    assert "following" not in shown.out


def test_what_is_said_of_single_frames_stays_with_them_where_others_are_left_out(
    run: Run, walk: dict[str, Any]
) -> None:
    document = copy(walk)
    document["frames"] = [walk["frames"][0], *walk["frames"]]
    document["frames"][0] = {**walk["frames"][0], "image": {"left_elbow": [0.0, 0.0]}}
    for k in (1, 2):
        document["frames"][k] = {**document["frames"][k], "time": float(k)}
    assert run("recover", write(document), "-o", "free.json", "--checks", "rigid-parts").code == 0
    given: list[dict[str, str]] = [{}]
    for frame in read_result("free.json").frames[1:]:
        rising = frame.joints[:, list(range(6, 14)), 2] - frame.joints[:, [1, 2, 6, 7, 4, 5, 10, 11], 2]
        both = np.flatnonzero((rising > 0).any(axis=0) & (rising < 0).any(axis=0))
        child = 6 + int(both[len(given) - 1])  # of each frame another segment that may point both ways
        given.append({segment_name((PARENTS[child], child)): JOINTS[child]})
    assert given[1].keys() != given[2].keys()
    flips = write({"schema": "posekit.nearer/1", "frames": given}, "flips.json")
    assert run("recover", "view.json", "-o", "r.json", "--checks", "rigid-parts", "--nearer", flips).code == 0
    for k, frame in enumerate(read_result("r.json").frames[1:], 1):
        ((segment, end),) = given[k].items()
        ends = frame.joints[:, [JOINTS.index(name) for name in segment.split("-")], 2]
        assert len(ends)
        assert (np.ptp(ends, axis=1) > 0).all()
        assert (ends.argmin(axis=1) == segment.split("-").index(end)).all()
    # A warning about the last frame names it by its number in the file.
    document["camera"] = {"model": "lee-chen", "f": 5.0}
    neck = document["frames"][2]["truth"]["neck"]
    document["frames"][2]["root"] = [neck[0] + 2.0, neck[1], neck[2]]
    assert "frames[2].root is 2" in run("recover", write(document), "-o", "r.json").err


@pytest.mark.parametrize("camera", ["lee-chen", "scaled-orthographic"])
def test_a_deviation_that_has_no_effect_is_refused_or_told(run: Run, camera: str) -> None:
    made = ("walker",) if camera == "lee-chen" else ("random", "--uncalibrated")
    assert run("synth", *made, "-o", "view.json", "--frames", "1").code == 0
    assert_refused(
        run("recover", "view.json", "-o", "r.json", "--deviation", "2"),
        f"--deviation: the view's camera is {camera}",
    )
    document = {**json.loads(Path("view.json").read_text(encoding="utf-8")), "deviation": 2.0}
    outcome = run("recover", write(document, "says.json"), "-o", "r.json")
    assert outcome.code == 0
    assert f"the view's deviation of 2 px has no effect: its camera is {camera}" in outcome.err
    assert "noise" in read_result("r.json").settings
    assert read_result("r.json").settings["noise"] is None


@pytest.mark.parametrize(
    "option",
    [
        ("--root", "search"),
        ("--deviation", "2"),
        ("--no-infer",),
        ("--person", "1"),
        ("--checks", "collision"),
    ],
)
def test_options_of_persons_are_refused_with_a_linkage(run: Run, option: tuple[str, ...]) -> None:
    refused = run("recover", "view.json", "-o", "r.json", "--linkage", "panda", *option)
    assert_refused(refused, f"{option[0]} is for persons; leave it out with --linkage")


def test_groups_of_options_stand_where_they_are_taken() -> None:
    """A command with groups has the very options, defaults and order of one that lists them."""

    @dataclass(frozen=True, kw_only=True)
    class Pair:
        left: Annotated[int, typer.Option("--left")] = 1
        right: Annotated[str, typer.Option("--right")] = "r"

    got: list[Any] = []

    def command(
        ctx: typer.Context, *, name: str, pair: Pair, last: Annotated[bool, typer.Option("--last")] = False
    ) -> None:
        got.append((name, pair, last, options_given(ctx)))

    command.__annotations__ = {
        "ctx": typer.Context,
        "name": str,
        "pair": Pair,
        "last": Annotated[bool, typer.Option("--last")],
    }
    app = typer.Typer(add_completion=False)
    made = with_groups(command)
    app.command()(made)
    assert list(inspect.signature(made).parameters) == ["ctx", "name", "left", "right", "last"]
    app(["n", "--right", "x", "--last"], standalone_mode=False)
    app(["n"], standalone_mode=False)
    assert got == [
        ("n", Pair(left=1, right="x"), True, ["--right", "--last"]),
        ("n", Pair(left=1, right="r"), False, []),
    ]


def test_commands_share_their_options(run: Run) -> None:
    """What is in a group is in every command that takes it, with the same default."""
    options = {}
    for name in ("recover", "batch", "evaluate", "convert"):
        told = run(name, "--help").out
        options[name] = {word.strip(",") for word in told.split() if word.startswith("--")}
    judging = {"--checks", "--ranges", "--rules", "--walkers", "--rigid-tolerance", "--angle-tolerance"}
    reading = {
        "--format",
        "--skeleton",
        "--person",
        "--camera",
        "--fps",
        "--min-confidence",
        "--stature",
        "--calibrate",
    }
    noise = {"--root", "--deviation", "--refine", "--length-deviation", "--infer"}
    for name, groups in {
        "recover": judging | reading | noise,
        "batch": judging | reading | noise,
        "evaluate": judging,
        "convert": reading,
    }.items():
        assert groups <= options[name], name


def test_joints_that_are_not_seen_are_unknown_in_the_result(run: Run, walk: dict[str, Any]) -> None:
    document = copy(walk)
    for frame in document["frames"]:
        del frame["image"]["right_shoulder"]
    for target in ("r.json", "r.npz"):
        assert run("recover", write(document), "-o", target, "--no-infer").code == 0
        joints = read_result(target).frames[0].joints
        assert np.isnan(joints[:, [1, 6, 8]]).all()
        assert np.isfinite(joints[:, [0, 2, 3, 4, 5, 7, 9, 10, 11, 12, 13]]).all()
    assert run("recover", write(document), "-o", "inferred.json").code == 0
    frame = read_result("inferred.json").frames[0]
    assert frame.inferred is not None
    assert all(
        {"right_shoulder", "right_elbow", "right_wrist"} == set(joints) for joints in frame.inferred if joints
    )


def test_a_misprinted_eye_is_one_line_of_warning(run: Run, walk: dict[str, Any]) -> None:
    document = copy(walk)
    document["figure"]["head_points"]["right_eye"][0] = -32.168
    outcome = run("recover", write(document), "-o", "r.json")
    assert outcome.code == 0
    assert outcome.err.startswith("posekit: warning: head point right_eye does not fit the others")
    assert outcome.err.count("\n") == 1
    assert Path("r.json").exists()


def test_an_image_point_beyond_all_reach_warns_of_nothing_else(run: Run, walk: dict[str, Any]) -> None:
    document = copy(walk)
    document["frames"][0]["image"]["left_elbow"][0] = 1e300
    outcome = run("recover", write(document), "-o", "r.json")
    assert outcome.code == 0
    assert outcome.err.startswith("posekit: warning: 1 of 2 frames have no posture")
    assert outcome.err.count("\n") == 1
    assert "no_solution/left_elbow" in outcome.out


def test_inputs_are_not_written_over(run: Run, walk: dict[str, Any]) -> None:
    name = write(walk)
    before = Path(name).read_bytes()
    for arguments in (("recover", name, "-o", name), ("validate", name, "-o", name)):
        outcome = run(*arguments)
        assert outcome.code == 2
        assert "written over" in outcome.err
    assert Path(name).read_bytes() == before


# --- validate -------------------------------------------------------------------------------------------


def test_validate_exits_0_where_all_are_valid(run: Run, walk: dict[str, Any]) -> None:
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


def test_validate_exits_1_where_some_are_not(run: Run) -> None:
    np.savez("p.npz", joints=some_postures())
    outcome = run("validate", "p.npz", "-o", "report.json")
    assert (outcome.code, outcome.err) == (1, "")
    assert outcome.out.splitlines()[0] == "3 postures: 1 valid, 1 invalid, 1 undecided"
    assert "joint_range/pelvis.flexion" in outcome.out
    report = read_report("report.json")
    assert [posture.verdict for posture in report.postures] == ["valid", "invalid", "undecided"]
    bad = [one for one in report.postures[1].findings if one.verdict == "invalid"]
    assert any(one.where == "pelvis.flexion" and one.unit == "deg" for one in bad)
    assert report.settings["checks"] == ["rigid-parts", "joint-range", "collision"]


def test_undecided_alone_is_not_all_valid(run: Run) -> None:
    np.savez("p.npz", joints=np.full((2, 14, 3), np.nan))
    outcome = run("validate", "p.npz", "-o", "report.json")
    assert outcome.code == 1
    assert outcome.out.startswith("2 postures: 0 valid, 0 invalid, 2 undecided")


def test_the_options_of_validate_decide(run: Run) -> None:
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


def test_validate_judges_by_a_figure_from_a_file(run: Run) -> None:
    short = FIGURE.scaled({f"{side}_hip-{side}_knee": 0.30 for side in ("right", "left")})
    short.write("short.urdf")
    np.savez("p.npz", joints=short.neutral_points[None, :14])
    assert run("validate", "p.npz", "-o", "r.json", "--urdf", "short.urdf").code == 0
    assert run("validate", "p.npz", "-o", "r.json", "--urdf", "stick_figure").code == 1


def test_postures_with_heads_are_judged_with_them(run: Run) -> None:
    np.savez("p.npz", joints=FIGURE.neutral_points[None], joint_names=np.array(POINTS))
    assert run("validate", "p.npz", "-o", "r.json", "--all").code == 0
    found = json.loads(Path("r.json").read_text(encoding="utf-8"))["postures"][0]["findings"]
    assert any(one["where"].startswith("neck.") and one["verdict"] == "valid" for one in found)


def test_a_result_is_validated_as_it_was_recovered(run: Run) -> None:
    """With its own figure, and the tolerance of angles that its frames were judged with."""
    assert run("synth", "random", "-o", "view.json", "--frames", "10", "--noise", "0.5").code == 0
    document = json.loads(Path("view.json").read_text(encoding="utf-8"))
    document["figure"] = {"lengths": {"right_hip-right_knee": 0.385}}
    Path("view.json").write_text(json.dumps(document), encoding="utf-8")
    assert run("recover", "view.json", "-o", "result.json").code == 0
    assert run("validate", "result.json", "-o", "report.json").code == 0


# --- reproduce and demo ---------------------------------------------------------------------------------


def test_reproduce_writes_the_tables(run: Run) -> None:
    outcome = run("reproduce", "lee-chen", "-o", "deep/tables")
    assert (outcome.code, outcome.err) == (0, "")
    figures = ("image.png", "levels.png", "projections.png", "tree.png", "scene.png", "page.html")
    expected = {f"lee-chen.{name}.{figure}" for name in ("seq1", "seq2") for figure in figures}
    written = {path.name for path in Path("deep/tables").iterdir()}
    assert written == expected | {"lee-chen.json", "lee-chen.md"}
    assert "# Lee & Chen 1985, reproduced" in outcome.out
    assert outcome.out.rstrip().endswith("written: deep/tables/lee-chen.md, deep/tables/lee-chen.json")


def test_demo_does_all_of_it(run: Run) -> None:
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


# --- bad input ------------------------------------------------------------------------------------------


def edited(walk: dict[str, Any], *keys: Any, value: Any) -> dict[str, Any]:
    """Return the document with one entry set."""
    document = copy(walk)
    node = document
    for key in keys[:-1]:
        node = node[key]
    node[keys[-1]] = value
    return document


BAD_VIEWS: dict[str, tuple[Callable[[dict[str, Any]], Any], tuple[str, ...]]] = {
    "malformed JSON": (lambda d: json.dumps(d)[:-9], ("view.json: line 1 column", "expected JSON")),
    "NaN": (
        lambda d: edited(d, "frames", 1, "image", "left_elbow", 0, value=float("nan")),
        ("view.json: frames[1].image.left_elbow[0]: got NaN", "finite number"),
    ),
    "Infinity": (
        lambda d: edited(d, "frames", 0, "truth", "pelvis", 2, value=float("-inf")),
        ("view.json: frames[0].truth.pelvis[2]: got -Infinity", "finite number"),
    ),
    "no neck in any frame": (
        lambda d: {
            **copy(d),
            "frames": [
                {**frame, "image": {name: at for name, at in frame["image"].items() if name != "neck"}}
                for frame in d["frames"]
            ],
        },
        ("view.json: frames[0].image.neck: got nothing", "the tree grows from it"),
    ),
    "a neck is missing, and a joint is unknown elsewhere": (
        lambda d: {
            **copy(d),
            "frames": [
                {**d["frames"][0], "image": {"left_elbow": d["frames"][0]["image"]["left_elbow"]}},
                {**d["frames"][1], "image": {**d["frames"][1]["image"], "left_elbo": [0, 0]}},
            ],
        },
        ("view.json: frames[1].image.left_elbo", "did you mean left_elbow"),
    ),
    "a neck is missing, and a root is wrong elsewhere": (
        lambda d: {
            **copy(d),
            "camera": {"model": "lee-chen", "f": 5.0},
            "frames": [
                {"time": 0.0, "image": {"left_elbow": d["frames"][0]["image"]["left_elbow"]}},
                {**d["frames"][1], "root": [0.0, 0.0, -500.0]},
            ],
        },
        ("view.json: frames[1].root: [0.0, 0.0, -5.0] m is behind the camera",),
    ),
    "nothing hangs on the neck": (
        lambda d: {
            **copy(d),
            "frames": [
                {**frame, "image": {name: frame["image"][name] for name in ("neck", "left_wrist")}}
                for frame in d["frames"]
            ],
        },
        ("view.json: frames[0]: none of right_shoulder, left_shoulder, pelvis is seen",),
    ),
    "unknown joint": (
        lambda d: edited(d, "frames", 0, "image", "left_elbo", value=[0, 0]),
        ("view.json: frames[0].image.left_elbo", "did you mean left_elbow"),
    ),
    "unknown segment": (
        lambda d: edited(d, "figure", "lengths", value={"pelvis-neck": 50}),
        ("view.json: figure.lengths", "did you mean neck-pelvis"),
    ),
    "zero length": (
        lambda d: edited(d, "figure", "lengths", value={"neck-pelvis": 0}),
        ("view.json: figure.lengths.neck-pelvis: got 0", "greater than 0"),
    ),
    "negative length": (
        lambda d: edited(d, "figure", "lengths", value={"neck-pelvis": -50.2}),
        ("view.json: figure.lengths.neck-pelvis: got -50.2", "greater than 0"),
    ),
    "torso triangle": (
        lambda d: edited(d, "figure", "lengths", value={"neck-pelvis": 200}),
        (
            "view.json: figure.lengths: the triangle neck, right_shoulder, pelvis does not close",
            "2, 0.205 and 0.502 m",
        ),
    ),
    "torso too wide": (
        lambda d: edited(d, "figure", "lengths", value={"right_shoulder-left_shoulder": 100}),
        ("view.json: figure.lengths: right_shoulder-left_shoulder is 1 m", "must lie between"),
    ),
    "hips triangle": (
        lambda d: edited(d, "figure", "lengths", value={"right_hip-left_hip": 60}),
        ("view.json: figure.lengths: the triangle right_hip, pelvis, left_hip does not close",),
    ),
    "zero f": (lambda d: edited(d, "camera", "f", value=0), ("view.json: camera.f: got 0", "greater than 0")),
    "negative f": (
        lambda d: edited(d, "camera", "f", value=-5.0),
        ("view.json: camera.f: got -5", "greater than 0"),
    ),
    "segment too short": (
        lambda d: edited(d, "figure", "lengths", value={"right_elbow-right_wrist": 5.0}),
        (
            "view.json: frames[0]: the segment right_elbow-right_wrist is at least ",
            " cm too short for its image",
        ),
    ),
    "nesting bomb": (lambda _: "[" * 100_000, ("view.json: got 100,000 nested levels", "at most 64")),
    "unknown camera": (
        lambda d: edited(d, "camera", value={"model": "fisheye"}),
        ("view.json: camera", "lee-chen"),
    ),
    "another schema": (
        lambda d: edited(d, "schema", value="posekit.view/9"),
        ("view.json: schema", "posekit.view/1"),
    ),
    "unknown unit": (lambda d: edited(d, "unit", value="inch"), ("view.json: unit", "cm")),
    "no frames": (lambda d: edited(d, "frames", value=[]), ("view.json: frames",)),
    "not an object": (lambda _: "[1, 2, 3]", ("view.json",)),
    "coplanar head": (
        lambda d: edited(
            d,
            *("figure", "head_points"),
            value={name: [-34.0, y, z] for name, (_, y, z) in d["figure"]["head_points"].items()},
        ),
        ("view.json: ", "plane"),
    ),
    "coincident head points": (
        lambda d: edited(
            d, "figure", "head_points", "left_eye", value=d["figure"]["head_points"]["right_eye"]
        ),
        ("view.json: head points right_eye and left_eye coincide", "0 m apart"),
    ),
    "too few head points": (
        lambda d: {
            **copy(d),
            "frames": [
                {**frame, "head_image": {k: p for k, p in frame["head_image"].items() if k != "nose"}}
                for frame in d["frames"]
            ],
        },
        ("view.json: frames[0]: 5 of 6 head points are known", "missing: nose"),
    ),
    "no head and no root": (
        lambda d: {
            **copy(d),
            "camera": {"model": "lee-chen", "f": 5.0},
            "frames": [
                {"time": frame["time"], "image": {"neck": frame["image"]["neck"]}} for frame in d["frames"]
            ],
        },
        ("view.json: frames[0]: nothing bounds how far away the neck is", "or give root"),
    ),
}


@pytest.mark.parametrize("case", BAD_VIEWS)
def test_a_bad_view_is_refused_in_one_line_and_nothing_is_written(
    run: Run, walk: dict[str, Any], case: str
) -> None:
    make, parts = BAD_VIEWS[case]
    view = write(make(walk))
    assert_refused(run("recover", view, "-o", "result.json"), *parts)
    assert files_here() == ["view.json"]


@pytest.mark.parametrize("f", [5.0, None])
def test_a_head_behind_the_camera_is_refused(run: Run, walk: dict[str, Any], f: float | None) -> None:
    """Its image is made as the formula x' = f x / (z + f) would make it behind the lens."""
    document = copy(walk)
    document["camera"]["f"] = f
    names = ("neck", *HEAD_POINTS)
    head = HeadPoints.from_mapping({name: document["figure"]["head_points"][name] for name in names}).points
    for frame in document["frames"]:
        # SEQ1's camera, moved along its axis through the head to 1 m behind it: x' = -5 z / depth, y' = 5 y / depth.
        depth = -140.0 - head[:, 0]
        assert (depth < 0).all()
        image = 5.0 * np.stack([-head[:, 2], head[:, 1]], axis=-1) / depth[:, None]
        frame["image"]["neck"] = image[0].tolist()
        frame["head_image"] = dict(zip(HEAD_POINTS, image[1:].tolist(), strict=True))
    outcome = run("recover", write(document), "-o", "result.json")
    assert_refused(outcome, "view.json: frames[0]: ", "behind the camera")
    assert files_here() == ["view.json"]


def test_more_than_100_megabytes_are_refused_unread(run: Run) -> None:
    with Path("big.json").open("wb") as file:
        file.truncate(500_000_001)  # sparse: it takes no room
    assert_refused(
        run("recover", "big.json", "-o", "r.json"), "big.json: got 500.0 MB; expected at most 500 MB"
    )
    assert_refused(
        run("validate", "big.json", "-o", "r.json"), "big.json: got 500.0 MB; expected at most 100 MB"
    )
    assert files_here() == ["big.json"]


def test_a_nesting_bomb_is_refused_by_validate_too(run: Run) -> None:
    write('{"a":' * 50_000, "bomb.json")
    assert_refused(run("validate", "bomb.json", "-o", "r.json"), "bomb.json: got 50,000 nested levels")
    assert files_here() == ["bomb.json"]


@pytest.mark.parametrize(
    ("target", "parts"),
    [
        ("nowhere/r.json", ("nowhere/r.json: got a directory that does not exist",)),
        ("folder.json", ("folder.json: got a directory", "the name of a file")),
        ("r.txt", ('r.txt: got the suffix ".txt"', ".json or .npz")),
        ("/proc/r.json", ("/proc/r.json", "can be written")),
        ("/dev/null", ("/dev/null",)),
    ],
)
def test_a_target_that_cannot_be_written_is_refused(
    run: Run, walk: dict[str, Any], target: str, parts: tuple[str, ...]
) -> None:
    view = write(walk)
    Path("folder.json").mkdir()
    assert_refused(run("recover", view, "-o", target), *parts)
    assert files_here() == ["folder.json", "view.json"]


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (
            ("--checks", "rigid-parts,colision"),
            ("--checks: 'colision' is not a check", "rigid-parts, joint-range"),
        ),
        (("--ranges", "tabel1"), ("--ranges tabel1: no such table or file", "urdf, table1")),
        (("--rules", "7"), ("--rules: 7 is not a rule", "1, 2, 3, 4, 5")),
        (("--rules", "1,two"), ("--rules: '1,two'", "numbers from 1 to 5")),
        (("--group", "5inch"), ('--group: got "5inch"', "cm, m or mm")),
        (("--group", "5"), ('--group: got "5"', "5cm")),
        (("--group", "-5cm"), ('--group: got "-5cm"', "zero or more")),
        (("--rigid-tolerance", "wide"), ('--rigid-tolerance: got "wide"',)),
        (("--tangent-tolerance", "nan"), ('--tangent-tolerance: got "nan"',)),
        (("--contact-margin", "1 foot"), ('--contact-margin: got "1 foot"',)),
        (("--frobnicate",), ("No such option: --frobnicate", "posekit recover --help")),
    ],
)
def test_a_bad_option_of_recover_is_refused(
    run: Run, walk: dict[str, Any], options: tuple[str, ...], parts: tuple[str, ...]
) -> None:
    assert_refused(run("recover", write(walk), "-o", "r.json", *options), *parts)
    assert files_here() == ["view.json"]


@pytest.mark.parametrize(
    ("command", "parts"),
    [
        (("recover",), ("Missing argument",)),
        (("recover", "view.json"), ("Missing option", "--output", "posekit recover --help")),
        (("recover", "none.json", "-o", "r.json"), ("none.json: got No such file",)),
        (("frobnicate",), ("No such command 'frobnicate'", "posekit --help")),
        (("synth",), ("Missing command",)),
        (("synth", "walker", "-o", "x.json", "--camera", "1,2"), ("--camera: '1,2'", "3 numbers")),
        (("synth", "walker", "-o", "x.json", "--camera", "nan,0,0"), ("--camera: 'nan,0,0'", "3 numbers")),
        (("synth", "walker", "-o", "x.json", "--camera", "0,0,0"), ("camera",)),
        (("synth", "walker", "-o", "x.json", "--camera", "-400,0,0", "--frames", "0"), ("--frames",)),
        (("synth", "walker", "-o", "x.json", "--dt", "0"), ("dt is 0 s",)),
        (("synth", "walker", "-o", "x.json", "--velocity", "9"), ("velocity is 9", "0.5 to 1.3")),
        (("synth", "walker", "-o", "x.json", "--noise", "-1"), ("--noise",)),
        (("synth", "random", "-o", "x.json", "--noise", "inf"), ("noise is inf",)),
        (("synth", "random", "-o", "x.json", "--seed", "-1"), ("--seed",)),
        (("synth", "random", "-o", "x.json", "--distance", "3"), ("--distance: '3'", "2 numbers")),
        (("synth", "random", "-o", "x.json", "--distance", "6,2"), ("camera distances are 6 to 2 m",)),
        (("synth", "random", "-o", "nowhere/x.json"), ("nowhere/x.json",)),
        (("synth", "mocap", "none.npz", "-o", "x.json"), ("none.npz: got No such file",)),
        (
            ("synth", "mocap", "view.json", "-o", "x.json"),
            ("view.json: format: got a file of no format of motion",),
        ),
        (("reproduce", "gavrila", "-o", "x"), ("'gavrila'", "lee-chen, taylor")),
        (("reproduce", "lee-chen", "-o", "view.json"), ("view.json", "folder")),
        (("demo", "-o", "view.json/x"), ("view.json/x", "folder")),
        (("validate", "view.json", "-o", "x.json"), ("view.json: schema", "posekit.postures/1")),
    ],
)
def test_a_bad_command_is_refused(
    run: Run, walk: dict[str, Any], command: tuple[str, ...], parts: tuple[str, ...]
) -> None:
    write(walk)
    assert_refused(run(*command), *parts)
    assert files_here() == ["view.json"]


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (("--checks", "bones"), ("--checks: 'bones' is not a check",)),
        (("--checks", ","), ("--checks: none is given", "nothing would be judged")),
        (("--rules", "0"), ("--rules: 0 is not a rule",)),
        (("--ranges", "tabel1"), ("--ranges tabel1",)),
        (("--urdf", "nobody.urdf"), ("nobody.urdf",)),
        (("--urdf", "p.npz"), ("p.npz",)),
        (("--rigid-tolerance", "3"), ('--rigid-tolerance: got "3"', "3cm")),
        (("--contact-margin", "--3cm"), ("--contact-margin",)),
    ],
)
def test_a_bad_option_of_validate_is_refused(
    run: Run, options: tuple[str, ...], parts: tuple[str, ...]
) -> None:
    np.savez("p.npz", joints=FIGURE.neutral_points[None, :14])
    assert_refused(run("validate", "p.npz", "-o", "r.json", *options), *parts)
    assert files_here() == ["p.npz"]


@pytest.mark.parametrize(
    ("joints", "parts"),
    [
        (np.full((1, 14, 3), np.inf), ("p.npz: joints[0, 0, 0]: got an infinite number",)),
        (np.full((1, 14, 3), 1e200), ("p.npz: postures: a coordinate is 1e+200 m",)),
        (np.zeros((1, 13, 3)), ("p.npz: joints",)),
        (np.zeros((14, 3)), ("p.npz: joints",)),
        (np.array([["neck"]]), ("p.npz: joints",)),
    ],
)
def test_bad_postures_are_refused(run: Run, joints: np.ndarray, parts: tuple[str, ...]) -> None:
    np.savez("p.npz", joints=joints)
    assert_refused(run("validate", "p.npz", "-o", "r.json"), *parts)
    assert files_here() == ["p.npz"]


def test_a_report_that_is_no_json_is_refused(run: Run) -> None:
    np.savez("p.npz", joints=FIGURE.neutral_points[None, :14])
    assert_refused(run("validate", "p.npz", "-o", "r.txt"), 'r.txt: got the suffix ".txt"; expected .json')
    assert files_here() == ["p.npz"]


def test_an_interrupt_leaves_nothing_behind(
    run: Run, walk: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    view = write(walk)

    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(importlib.import_module("posekit.recovery"), "recover", interrupted)
    outcome = run("recover", view, "-o", "r.json")
    assert (outcome.code, outcome.out) == (130, "")
    assert outcome.err in ("", "posekit: error: interrupted\n")
    assert files_here() == ["view.json"]


# --- how options are read -------------------------------------------------------------------------------


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


def test_an_uncalibrated_view_by_scale_and_flips(run: Run, tmp_path: Path) -> None:
    joints = load_figure().neutral_points[:14] @ [[0.6, 0, 0.8], [-0.8, 0, 0.6], [0, -1, 0]]
    camera = ScaledOrthographicModel(scale=None)
    write_view("view.json", View(camera=camera, time=np.zeros(1), image=400 * joints[None, :, :2], unit="cm"))
    near = {
        segment_name((a, b)): JOINTS[a if joints[a, 2] < joints[b, 2] else b]
        for a, b in TREE_SEGMENTS
        if abs(joints[a, 2] - joints[b, 2]) > 0.01
    }
    Path("near.json").write_text(
        json.dumps({"schema": "posekit.nearer/1", "frames": [near]}), encoding="utf-8"
    )
    done = run("recover", "view.json", "-o", "out.json", "--scale", "4.0", "--nearer", "near.json")
    assert done.code == 0, done.err
    assert "scale by value: 400 to 400 pixels a metre" in done.out
    frame = read_result("out.json").frames[0]
    np.testing.assert_allclose(frame.joints[0], joints, atol=1e-6)
    failed = run("recover", "view.json", "-o", "no.json", "--scale", "1")
    assert failed.code == 2
    assert failed.err.startswith("posekit: error: view.json: frames[0]: --scale: 1 pixels a cm is below ")
    assert failed.err.count("\n") == 1
    assert not Path("no.json").exists()


def test_synthetic_photographs_have_no_camera_and_are_recovered(run: Run) -> None:
    assert (
        run("synth", "random", "-o", "photo.json", "--frames", "4", "--uncalibrated", "--seed", "3").code == 0
    )
    view = read_view("photo.json")
    assert isinstance(view.camera, ScaledOrthographicModel)
    assert np.isfinite(view.truth).all()
    assert np.isnan(view.root).all()
    done = run("recover", "photo.json", "-o", "photo.npz")
    assert done.code == 0, done.err
    assert "scale by min" in done.out


def test_another_object_is_drawn_and_recovered(run: Run) -> None:
    assert run("synth", "object", "panda", "-o", "panda.json", "--frames", "2", "--seed", "1").code == 0
    done = run("recover", "panda.json", "-o", "found.json", "--linkage", "panda", "--scale", "closure")
    assert done.code == 0, done.err
    view = read_object_view("panda.json", load_object("panda").linkage)
    found = read_object("found.json")
    for frame, truth in zip(found.frames, view.truth, strict=True):
        goal = truth - truth[:1] * [0, 0, 1]
        assert np.linalg.norm(frame.points - goal, axis=-1).max(axis=1).min() < 1e-6
    for arguments, words in (
        (("--linkage", "pandda"), "pandda"),
        (("--linkage", "panda", "--scale", "0.001"), "needs"),
        (("--linkage", "panda", "--group", "5cm"), "--group is for persons"),
    ):
        failed = run("recover", "panda.json", "-o", "no.json", *arguments)
        assert failed.code == 2
        assert words in failed.err
        assert failed.err.count("\n") == 1
        assert not Path("no.json").exists()
