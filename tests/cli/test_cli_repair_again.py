"""What a repair says of the file that it wrote is what a fresh validation of it says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.body import load_figure
from posekit.formats.motion import Motion, read_motion, write_motion
from posekit.formats.own import Postures, read_report, write_postures
from posekit.skeleton import FEET_POINTS, JOINT, JOINTS, POINTS
from posekit.validators import Validator

FRAMES = 60


def noisy_motion(drift: float) -> Motion:
    """Return a standing body measured with noise, whose forearm lengthens by a share of itself in a third of it."""
    rng = np.random.default_rng(3)
    joints = np.repeat(load_figure().neutral_points[None, : len(JOINTS)], FRAMES, axis=0)
    joints = joints + rng.normal(0, 0.002, joints.shape)
    elbow, wrist = JOINT["left_elbow"], JOINT["left_wrist"]
    joints[20:40, wrist] += drift * (joints[20:40, wrist] - joints[20:40, elbow])
    return Motion(names=JOINTS, points=joints, time=np.arange(FRAMES) / 30, rate=30.0, up="+z")


@pytest.mark.parametrize("suffix", ["npz", "bvh"])
@pytest.mark.parametrize("drift", [0.3, 1.0])
def test_what_is_said_of_the_written_file_is_what_a_fresh_validation_says(
    run: Callable[..., Any], tmp_path: Path, suffix: str, drift: float
) -> None:
    """Lengths and noise are measured anew: no frame is called valid that the next validation rejects."""
    given, out = tmp_path / "given.npz", tmp_path / f"out.{suffix}"
    write_motion(given, noisy_motion(drift), "npz")
    said = run("validate", given, "--repair", out).out
    fresh = posekit.validate(out)
    assert f"judged again, {fresh.summary['valid']} of {len(fresh)} frames are valid" in said
    assert ("left: " in said) == bool(fresh.summary["invalid"])


@pytest.mark.parametrize("suffix", ["json", "md", "html"])
def test_the_report_has_the_record(run: Callable[..., Any], tmp_path: Path, suffix: str) -> None:
    """What was changed in the file is in the report of the same run, and JSON is read back as it was."""
    given, out, report = tmp_path / "given.npz", tmp_path / "out.npz", tmp_path / f"report.{suffix}"
    write_motion(given, noisy_motion(0.3), "npz")
    code = run("validate", given, "--repair", out, "-o", report).code
    assert code == int(posekit.validate(out).summary["valid"] < FRAMES)
    text = report.read_text()
    assert "left_wrist" in text and "lengthened" in text and "valid" in text
    if suffix == "json":
        (record,) = read_report(report).repair
        assert (record["file"], record["written"], record["frames"]) == (str(given), str(out), FRAMES)
        assert record["valid"] == posekit.validate(out).summary["valid"]
        assert "lengthened" in {span["remedy"] for span in record["spans"]}


@pytest.mark.parametrize(
    "asked",
    [
        ("--urdf", "human", "--repair", "out.npz"),
        ("--jobs", "1"),
        ("--all",),
        ("--all", "-o", "report.csv"),
        ("--distances", "-o", "report.json"),
        ("--urdf", "human", "--no-distances"),
        ("--all", "-o", "verdicts"),
    ],
    ids=" ".join,
)
def test_what_would_do_nothing_is_refused_before_the_work(
    run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, asked: tuple[str, ...]
) -> None:
    """The error is a line that names the option, and nothing is written."""
    monkeypatch.chdir(tmp_path)
    write_motion("given.npz", noisy_motion(0.3), "npz")
    done = run("validate", "given.npz", *asked)
    assert done.code == 2 and done.err.count("\n") == 1
    named = "--distances" if "--no-distances" in asked else "--repair" if "--repair" in asked else asked[0]
    assert named in done.err
    assert [path.name for path in tmp_path.iterdir()] == ["given.npz"]


@pytest.mark.parametrize("suffix", ["npz", "csv", "trc"])
def test_all_points_are_kept(run: Callable[..., Any], tmp_path: Path, suffix: str) -> None:
    """A repaired file has the head, toes and heels of the file, where they were on the body."""
    given, out = tmp_path / f"given.{suffix}", tmp_path / f"out.{suffix}"
    motion = noisy_motion(0.3)
    head = load_figure().neutral_points[None, len(JOINTS) :] + np.zeros((FRAMES, 1, 1))
    foot_ankles = [JOINT[f"{name.split('_')[0]}_ankle"] for name in FEET_POINTS]
    feet = (
        motion.points[:, foot_ankles]
        + np.where(["toe" in name for name in FEET_POINTS], 0.15, -0.05)[:, None] * np.eye(3)[0]
    )
    marks = (*POINTS, *FEET_POINTS)
    points = np.concatenate([motion.points, head, feet], axis=1)
    write_motion(given, replace(motion, names=marks, points=points), suffix)
    stated = ("--up", "+z") if suffix == "trc" else ()
    run("validate", given, "--repair", out, *stated)
    written = read_motion(out)
    assert set(written.names) == set(marks)
    repaired = written.points[:, [written.names.index(name) for name in marks]]
    assert np.isfinite(repaired).all()
    apart = [np.linalg.norm(one[:, 19:] - one[:, foot_ankles], axis=-1) for one in (points, repaired)]
    np.testing.assert_allclose(apart[1], apart[0], rtol=0, atol=1e-3)


def test_one_posture_that_passes_strictly_passes_when_it_is_judged_again(
    run: Callable[..., Any], tmp_path: Path
) -> None:
    """Knees that are straight by six degrees more are within their range, and no sign of exchanged sides."""
    figure = load_figure()
    q = np.zeros((1, figure.model.nq))
    q[:, 6] = 1.0
    angles = np.zeros(22)
    angles[[9, 13]], angles[[14, 18]], angles[[17, 21]] = 0.3, 0.2, -0.1
    angles[[6, 7, 8, 10, 11, 12]] = 0.35, 0.25, 0.1, -0.2, 0.3, 0.15
    q[:, figure.angle_index] = angles
    joints = figure.forward_kinematics(q)[:, : len(JOINTS)]
    assert Validator(strict=True).check(joints).valid.all()
    given, out = tmp_path / "given.json", tmp_path / "out.json"
    write_postures(given, Postures(joints=joints))
    assert "judged again, 1 of 1 frames are valid" in run("validate", given, "--strict", "--repair", out).out
    assert "swap: it needs two frames" in run("validate", out, "--strict").out
