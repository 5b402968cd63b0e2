"""`posekit validate` on people who were measured: what is taken from them, and the sentence that says why most fail."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.body import load_figure
from posekit.formats.held_postures import HeldPostures
from posekit.formats.own import Postures, write_postures
from posekit.skeleton import JOINT
from posekit.validation import said_of

STANDING = load_figure().neutral_points[:14]


def standing(count: int, noise: float = 0.0, size: float = 1.0) -> np.ndarray:
    return size * STANDING + np.random.default_rng(0).normal(0.0, noise, (count, 14, 3))


def judged(run: Any, joints: np.ndarray, *options: str) -> tuple[str, dict[str, Any], int]:
    write_postures("p.json", Postures(joints=joints))
    outcome = run("validate", "p.json", "-o", "r.json", *options)
    return outcome.out, json.loads(Path("r.json").read_text(encoding="utf-8")), outcome.code


def test_lengths_and_noise_are_the_persons_and_said(run: Any) -> None:
    out, report, code = judged(run, standing(100, 0.005, 0.9))
    assert code == 0
    settings = report["settings"]
    assert settings["lengths_from"] == "median"
    assert settings["noise"] == pytest.approx(0.005, rel=0.2)
    assert settings["lengths"]["right_elbow-right_wrist"] == pytest.approx(0.9 * 0.26, abs=0.005)
    assert "judged by lengths as measured," in out
    assert "mm of noise:" in out
    assert "why" not in settings


def test_strict_says_what_to_try_for_another_body(run: Any) -> None:
    out, report, code = judged(run, standing(20, 0.0, 0.8), "--strict")
    assert code == 1
    assert report["settings"]["strict"] is True
    why = report["settings"]["why"]
    assert why in out
    assert why.startswith("20 of 20 postures fail by ")
    assert why.endswith("try --lengths median, the person's own")
    assert judged(run, standing(20, 0.0, 0.8), "--strict", "--lengths", "median")[2] == 0


def test_a_few_postures_tell_no_noise_and_that_is_said(run: Any) -> None:
    out, report, code = judged(run, standing(3, 0.002))
    assert code == 0
    assert report["settings"]["noise"] is None
    assert "noise not known of so few frames: 2 degrees" in out


def test_noise_that_is_given_is_taken(run: Any) -> None:
    out, report, _ = judged(run, standing(3, 0.005), "--noise", "5mm")
    assert report["settings"]["noise"] == 0.005
    assert "5 mm of noise" in out


def test_a_tolerance_that_is_proposed_lets_most_pass(run: Any) -> None:
    joints = standing(40)
    arm = STANDING[JOINT["right_wrist"]] - STANDING[JOINT["right_elbow"]]
    for frame, degrees in enumerate(np.linspace(12.0, 18.0, 40)):
        turn = np.radians(degrees)
        back = np.cos(turn) * arm - np.sin(turn) * np.linalg.norm(arm) * np.eye(3)[0]
        joints[frame, JOINT["right_wrist"]] = STANDING[JOINT["right_elbow"]] + back
    _, report, code = judged(run, joints)
    assert code == 1
    why = report["settings"]["why"]
    assert "40 of 40 postures fail by right_elbow.flexion (joint-range), by 7.1 degrees in the median" in why
    option, degrees = why.split("try ")[1].split(",")[0].split()
    assert report["summary"]["valid"] == 0
    assert judged(run, joints, option, degrees)[1]["summary"]["valid"] >= 38


def test_ranges_of_the_figure_name_those_that_people_pass(run: Any) -> None:
    joints = standing(20)
    joints[:, JOINT["right_wrist"]] += [-0.03, 0.0, 0.002]
    _, report, code = judged(run, joints, "--ranges", "urdf")
    assert code == 1
    assert report["settings"]["why"].endswith("try --ranges anatomical, which real people pass")
    assert judged(run, joints)[2] == 0


def test_a_result_is_judged_by_its_own_lengths_and_a_robot_by_those_that_it_shows(run: Any) -> None:
    assert run("synth", "walker", "-o", "view.json").code == 0
    assert run("recover", "view.json", "-o", "result.json").code == 0
    for options, lengths in (((), "model"), (("--urdf", "human", "--checks", "rigid-parts"), "median")):
        assert run("validate", "result.json", "-o", "r.json", *options).code == 0
        assert json.loads(Path("r.json").read_text(encoding="utf-8"))["settings"]["lengths_from"] == lengths


def test_two_people_of_few_frames_are_judged_each_by_their_lengths() -> None:
    joints = np.concatenate([standing(4), standing(4, 0.0, 0.7)])
    held = HeldPostures(
        postures=Postures(joints=joints),
        frame=np.tile(np.arange(4), 2),
        clip=np.repeat([0, 1], 4),
        time=np.tile(np.arange(4) / 30, 2),
    )
    report = posekit.validate(held)
    assert report.summary == {"valid": 8, "invalid": 0, "undecided": 0}
    assert len(report.settings["people"]) == 2
    (said,) = said_of(report)
    assert "noise not known of so few frames: 2 degrees, 3cm in bones" in said
