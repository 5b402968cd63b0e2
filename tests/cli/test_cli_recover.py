"""posekit recover: what it writes is what it prints, options decide, and frames that fail cost themselves."""

import inspect
import json
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytest
import typer

from posekit.body import load_figure
from posekit.cli.groups import with_groups
from posekit.cli.options import options_given
from posekit.formats.own import (
    ScaledOrthographicModel,
    View,
    read_object,
    read_object_view,
    read_result,
    read_view,
    write_view,
)
from posekit.objects import load_object
from posekit.skeleton import JOINTS, PARENTS, TREE_SEGMENTS, segment_name

FIGURE = load_figure()


def test_no_more_branches_are_listed_than_can_be_read_again(
    run, assert_refused, walk: dict[str, Any], write, monkeypatch: pytest.MonkeyPatch
) -> None:
    view = write(walk)
    assert run("recover", view, "-o", "out.json", "--explain").code == 0
    listed = sum(len(frame.pruned or ()) for frame in read_result("out.json").frames)
    assert listed > 100
    for most in (listed, listed - 1):
        monkeypatch.setattr("posekit.cli.asked.MAX_EXPLAINED", most)
        outcome = run("recover", view, "-o", "again.json", "--explain")
        assert outcome.code == (0 if most == listed else 2), outcome.err
        Path("again.json").unlink(missing_ok=True)
    assert_refused(outcome, f"--explain: {listed:,} branches were pruned; expected at most {listed - 1:,}")


def test_json_that_could_not_be_read_again_becomes_npz(
    run, assert_refused, walk: dict[str, Any], write, monkeypatch: pytest.MonkeyPatch
) -> None:
    view = write(walk)
    assert run("recover", view, "-o", "out.npz").code == 0
    expected = read_result("out.npz")
    Path("out.npz").unlink()
    monkeypatch.setattr("posekit.safe_io.writing.MAX_BYTES", 1000)
    outcome = run("recover", view, "-o", "out.json")
    assert outcome.code == 0
    assert "out.json: got more than 0 MB of JSON" in outcome.err and "it is in out.npz" in outcome.err
    assert "posekit view out.npz" in outcome.out
    assert not Path("out.json").exists()
    for one, other in zip(read_result("out.npz").frames, expected.frames, strict=True):
        np.testing.assert_array_equal(one.joints, other.joints)
    # What is there stays.
    assert_refused(run("recover", view, "-o", "out.json"), "out.json: got more than 0 MB of JSON")


@pytest.mark.parametrize("suffix", ["json", "npz"])
def test_recover_writes_what_it_prints(run, walk: dict[str, Any], suffix: str, write) -> None:
    view, target = write(walk), f"out.{suffix}"
    outcome = run("recover", view, "-o", target, "--group", "5cm", "--explain")
    assert (outcome.code, outcome.err) == (0, "")
    result = read_result(target)
    lines = outcome.out.splitlines()
    assert lines[3].split()[:4] == ["frame", "time", "postures", "groups"]
    for k, (line, frame) in enumerate(zip(lines[4:6], result.frames, strict=True)):
        assert int(line.split()[0]) == k
        assert int(line.split()[2]) == len(frame.joints)
        assert frame.groups is not None
        assert int(line.split()[3]) == len(set(frame.groups.tolist()))
        assert line.split()[4] == "exact"
        assert len(frame.joints) + sum(frame.rejected.values()) == 8192
        assert frame.pruned
    assert lines[-5:-3] == [f"written: {target}", "look further:"]
    assert run(*lines[-1].split()[1:]).code == 0  # what it says to type is right: it converts
    assert result.configuration_names == FIGURE.configuration_names
    truth = read_view(view).truth
    for frame, joints in zip(result.frames, truth, strict=True):
        assert np.linalg.norm(frame.joints - joints, axis=-1).max(axis=1).min() < 1e-6
        np.testing.assert_allclose(frame.camera["f"], 0.05, rtol=0, atol=1e-8)


def test_json_and_npz_hold_the_same(run, walk: dict[str, Any], write) -> None:
    for target in ("a.json", "a.npz"):
        assert run("recover", write(walk), "-o", target).code == 0
    one, other = read_result("a.json"), read_result("a.npz")
    assert one.settings == other.settings
    for a, b in zip(one.frames, other.frames, strict=True):
        assert a.branches == b.branches
        np.testing.assert_allclose(a.joints, b.joints, rtol=1e-14)
        np.testing.assert_allclose(a.q, b.q, rtol=1e-14)


def test_the_options_of_recover_decide(run, walk: dict[str, Any], write) -> None:
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


def test_recover_replaces_an_older_result_whole(
    run, walk: dict[str, Any], write, files_here, assert_refused
) -> None:
    Path("r.json").write_text("old", encoding="utf-8")
    assert run("recover", write(walk), "-o", "r.json").code == 0
    assert len(read_result("r.json").frames) == 2
    assert_refused(run("recover", write(walk), "-o", "r.json", "--checks", "nonsense"), "nonsense")
    assert len(read_result("r.json").frames) == 2
    assert files_here() == ["r.json", "view.json"]


def test_a_frame_without_a_neck_is_told_and_the_rest_recovered(run, walk: dict[str, Any], write) -> None:
    document = deepcopy(walk)
    del document["frames"][0]["head_image"]["left_ear"]
    outcome = run("recover", write(document), "-o", "r.json")
    assert outcome.code == 0
    assert "frames[0]: 5 of 6 head points are known" in outcome.out
    assert [len(frame.joints) > 0 for frame in read_result("r.json").frames] == [False, True]


@pytest.mark.parametrize("suffix", ["json", "npz"])
def test_frames_that_cannot_be_recovered_say_why_and_the_others_are_the_same(run, suffix: str, write) -> None:
    assert run("synth", "walker", "-o", "view.json", "--frames", "4").code == 0
    whole = json.loads(Path("view.json").read_text(encoding="utf-8"))
    holes = deepcopy(whole)
    del holes["frames"][1]["image"]["neck"]
    seen = holes["frames"][2]["image"]
    holes["frames"][2]["image"] = {name: seen[name] for name in ("neck", "left_ankle", "right_ankle")}
    outcome = run("recover", write(holes, "holes.json"), "-o", f"some.{suffix}", "--follow", "1")
    assert outcome.code == 0
    assert "frames[1]: the neck, from which the tree grows, is not seen" in outcome.out
    assert (
        "1 of 4 frames not recovered: the neck, from which the tree grows, is not seen (frame 1)"
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
    run, walk: dict[str, Any], monkeypatch: pytest.MonkeyPatch, write
) -> None:
    command = ("recover", write(walk), "-o", "r.json", "--follow", "2")
    assert run(*command).err == ""
    monkeypatch.setattr("posekit.cli.options.on_terminal", lambda: True)
    monkeypatch.setattr("rich.console.Console.is_terminal", property(lambda _: True))
    shown = run(*command)
    assert shown.code == 0
    assert "following" in shown.err
    assert "/2" in shown.err  # frames
    assert "following" not in shown.out


def test_what_is_said_of_single_frames_stays_with_them_where_others_are_left_out(
    run, walk: dict[str, Any], write
) -> None:
    document = deepcopy(walk)
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


def test_a_deviation_that_has_no_effect_is_refused_or_told(run, write, assert_refused) -> None:
    assert run("synth", "walker", "-o", "view.json", "--frames", "1").code == 0
    assert_refused(
        run("recover", "view.json", "-o", "r.json", "--deviation", "2"),
        "--deviation: the view's camera is lee-chen",
    )
    document = {**json.loads(Path("view.json").read_text(encoding="utf-8")), "deviation": 2.0}
    outcome = run("recover", write(document, "says.json"), "-o", "r.json")
    assert outcome.code == 0
    assert "the view's deviation of 2 px has no effect: its camera is lee-chen" in outcome.err
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
def test_options_of_persons_are_refused_with_a_linkage(run, option: tuple[str, ...], assert_refused) -> None:
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
    app(["n", "--right", "x", "--last"], standalone_mode=False)()
    app(["n"], standalone_mode=False)()
    assert got == [
        ("n", Pair(left=1, right="x"), True, ["--right", "--last"]),
        ("n", Pair(left=1, right="r"), False, []),
    ]


def test_commands_share_their_options(run) -> None:
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


def test_joints_that_are_not_seen_are_unknown_in_the_result(run, walk: dict[str, Any], write) -> None:
    document = deepcopy(walk)
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


def test_a_misprinted_eye_is_one_line_of_warning(run, walk: dict[str, Any], write) -> None:
    document = deepcopy(walk)
    document["figure"]["head_points"]["right_eye"][0] = -32.168
    outcome = run("recover", write(document), "-o", "r.json")
    assert outcome.code == 0
    assert outcome.err.startswith("posekit: warning: head point right_eye does not fit the others")
    assert outcome.err.count("\n") == 1
    assert Path("r.json").exists()


def test_an_image_point_beyond_all_reach_warns_of_nothing_else(run, walk: dict[str, Any], write) -> None:
    document = deepcopy(walk)
    document["frames"][0]["image"]["left_elbow"][0] = 1e300
    outcome = run("recover", write(document), "-o", "r.json")
    assert outcome.code == 0
    assert outcome.err.startswith("posekit: warning: 1 of 2 frames have no posture")
    assert outcome.err.count("\n") == 1
    assert "no-solution/left_elbow" in outcome.out


def test_inputs_are_not_written_over(run, walk: dict[str, Any], write) -> None:
    name = write(walk)
    before = Path(name).read_bytes()
    for arguments in (("recover", name, "-o", name), ("validate", name, "-o", name)):
        outcome = run(*arguments)
        assert outcome.code == 2
        assert "written over" in outcome.err
    assert Path(name).read_bytes() == before


def test_an_uncalibrated_view_by_scale_and_flips(run, tmp_path: Path) -> None:
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


def test_synthetic_photographs_have_no_camera_and_are_recovered(run) -> None:
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


def test_another_object_is_drawn_and_recovered(run) -> None:
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
