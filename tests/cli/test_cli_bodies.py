"""Bodies that nobody measured exactly: what commands say of lengths that do not close, and of shoulders' sides."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from posekit.body import load_figure
from posekit.formats.own import Postures, read_result, read_view, write_postures, write_view
from posekit.skeleton import JOINT

FIGURE = load_figure()
WIDER = {"right_shoulder-left_shoulder": 41.1}
"""Centimetres: a millimetre more than the built-in torso closes with."""


def test_recover_changes_lengths_that_do_not_close_and_says_so(run, walk: dict[str, Any], write) -> None:
    view = write({**walk, "figure": {"lengths": WIDER}})
    outcome = run("recover", view, "-o", "out.json")
    assert outcome.code == 0
    lines = [line for line in outcome.err.splitlines() if "do not close" in line]
    assert len(lines) == 1
    assert lines[0].startswith(
        "posekit: warning: lengths do not close and were changed to the nearest body's: "
    )
    assert "right_shoulder-left_shoulder" in lines[0]
    settings = read_result("out.json").settings
    moved = settings["moved_lengths"]
    assert -0.0012 < moved["right_shoulder-left_shoulder"] < 0
    assert settings["lengths"]["right_shoulder-left_shoulder"] < 0.411
    assert run("validate", "out.json", "--fail-over", "0").code == 0


def test_recover_says_nothing_of_lengths_that_close(run, walk: dict[str, Any], write) -> None:
    outcome = run("recover", write(walk), "-o", "out.json")
    assert "close" not in outcome.err
    settings = read_result("out.json").settings
    assert settings["moved_lengths"] == {}
    assert settings["shoulders"] == "front"


def test_a_view_says_on_which_side_the_shoulders_lie(run, walk: dict[str, Any], write) -> None:
    figure = {"lengths": {"neck-pelvis": 46.0}}
    for said, side in ((None, "undecided"), ("front", "front"), ("behind", "behind")):
        document = {**walk, "figure": figure | ({"shoulders": said} if said else {})}
        outcome = run("recover", write({**document, "length_deviation": 0}), "-o", "out.json")
        assert outcome.code == 0, outcome
        result = read_result("out.json")
        assert result.settings["shoulders"] == side
        assert (result.settings["shoulder_offset"] < 0) == (said == "behind")
        view = read_view("view.json")
        write_view("again.json", view)
        assert read_view("again.json").shoulders == said
    assert run("recover", write({**walk, "figure": {"shoulders": "left"}}), "-o", "out.json").code == 2


def test_mirror_images_of_torsos_are_not_certified(run) -> None:
    standing = FIGURE.neutral_points[None, :14]
    mirrored = standing * [-1, 1, 1]  # of a posture that is its own mirror image but for the torso
    for points, code in ((standing, 0), (mirrored, 1)):
        write_postures("p.json", Postures(joints=points))
        options = ("--rigid-tolerance", "1mm", "--checks", "rigid-parts", "--strict")
        assert run("validate", "p.json", *options).code == code
    outcome = run("validate", "p.json", "--checks", "rigid-parts", "--strict", "-o", "report.json")
    assert "rigid-parts/torso 1" in outcome.out
    assert json.loads(Path("report.json").read_text(encoding="utf-8"))["settings"]["shoulders"] == "front"


def test_a_skeleton_with_the_pelvis_between_its_hips_goes_through_every_command(run) -> None:
    names = [name.replace("right_", "r_").replace("left_", "l_") for name in JOINT]
    points = np.repeat(FIGURE.neutral_points[None, :14], 6, axis=0)
    points += 0.001 * np.random.default_rng(0).normal(size=points.shape)
    points[:, JOINT["pelvis"]] = (points[:, JOINT["right_hip"]] + points[:, JOINT["left_hip"]]) / 2
    np.savez(
        "capture.npz",
        joints=points,
        joint_names=np.array(names),
        up=np.array("+z"),
        clip=np.zeros(6, dtype=int),
        clip_names=np.array(["standing"]),
        clip_fps=np.array([30.0]),
    )
    for command in (
        ("synth", "mocap", "capture.npz", "-o", "view.json", "--frames", "3", "--dt", "0.03"),
        ("recover", "view.json", "-o", "out.json", "--write-urdf", "body.urdf"),
        ("validate", "out.json"),
        ("validate", "capture.npz", "--lengths", "median", "--angle-tolerance", "2"),
        ("validate", "capture.npz", "--urdf", "human", "--checks", "collision"),
        ("convert", "out.json", "out.bvh"),
    ):
        outcome = run(*command)
        assert outcome.code == 0, (command, outcome)
    assert load_figure("body.urdf").pelvis_between_hips
    assert sum(len(frame.joints) for frame in read_result("out.json").frames) > 0
