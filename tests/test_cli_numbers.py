"""Numbers that commands print are those of what they read, and options reach the function of the command."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.evaluation import evaluate, evaluate_method
from posekit.motion import Motion
from tests.test_cli import folder, run
from tests.test_formats_motion import squatting, walking

__all__ = ["folder", "run"]  # fixtures


def facts(text: str) -> dict[str, str]:
    """Return the rows of a table of names and values."""
    rows = (line.partition("  ") for line in text.splitlines())
    return {name.strip(): value.strip() for name, _, value in rows}


def inspected(run: Any, path: Path, *options: str) -> dict[str, str]:
    code, out, err = run("inspect", str(path), *options)
    assert code == 0, err
    return facts(out)


def test_inspect_counts_frames_points_and_recordings(run: Any, tmp_path: Path) -> None:
    walk = replace(walking(24), q=None, q_names=(), robot="")
    joints = np.array(walk.joints)
    joints[:6, 8] = np.nan
    posekit.save(replace(walk, joints=joints, time=np.arange(24) / 50 + 2), tmp_path / "a.csv")
    found = inspected(run, tmp_path / "a.csv")
    assert found["kind"] == "motion" and found["frames"] == "24" and found["unit"] == "m"
    assert found["rate"] == "50 a second" and found["time"] == "2 to 2.46 s" and found["up"] == "+z"
    assert found["points"].startswith("19: neck, right_shoulder, ")
    assert "right_wrist (75%), " in found["points"] and found["points"].count("%") == 1
    assert "world" not in found and "robot" not in found
    two = replace(
        walk, clip=np.repeat([0, 1], 12), clips=("a", "b"), frame=None, time=np.tile(np.arange(12) / 30, 2)
    )
    posekit.save(two, tmp_path / "two.npz")
    assert inspected(run, tmp_path / "two.npz")["frames"] == "24 in 2 recordings"
    posekit.save(Motion(joints=joints[6:8], joint_names=walk.joint_names), tmp_path / "few.npz")
    found = inspected(run, tmp_path / "few.npz")
    assert found["rate"] == "not known (--rate)" and "time" not in found
    posekit.save(squatting(10), tmp_path / "g1.npz")
    found = inspected(run, tmp_path / "g1.npz")
    assert found["robot"] == "g1" and found["q"].startswith("36: ") and "points" not in found


def test_inspect_counts_people_and_postures(run: Any, tmp_path: Path) -> None:
    found, seen = inspected(run, Path("keypoints")), posekit.open("keypoints")
    pictures = int(np.max(seen.frame)) + 1
    assert found["people"] == f"{len(seen)} in {len(np.unique(seen.frame))} pictures"
    assert found["pictures"] == f"{pictures}, a film"
    assert found["points"].startswith(f"{len(seen.names)}: {seen.names[0]}, {seen.names[1]}")
    found, view = inspected(run, Path("photo.json")), posekit.open("photo.json")
    assert found["frames"] == str(len(view)) and found["camera"] == repr(view.camera)
    assert found["seen"] == "100% of the joints" and found["given"] == "truth, deviation 2"
    assert inspected(run, Path("walk.json"))["time"] == "0 to 0.8 s"
    result = posekit.recover(posekit.open("walk.json"), follow=2)
    assert result.path is not None
    result.save(tmp_path / "found.npz")
    found = inspected(run, tmp_path / "found.npz")
    assert found["frames"] == "5" and found["postures"] == str(len(result.survivors))
    assert found["paths"] == str(len(result.path)) and found["ranges"] == "anatomical"
    assert found["checks"] == "rigid-parts, joint-range, collision"
    cameras = posekit.open("calibration.toml")
    assert inspected(run, Path("calibration.toml"))["cam_01"] == repr(cameras["cam_01"])


@pytest.mark.parametrize(
    "options", [("--unit", "cm"), ("--up", "-z"), ("--rate", "12.5"), ("--layout", "smpl_22"), ()]
)
def test_options_of_reading_reach_every_command_that_reads(
    run: Any, options: tuple[str, ...], tmp_path: Path
) -> None:
    joints = np.asarray(posekit.open("walk.npz").points(posekit.open("walk.npz").joint_names[:14]))
    more = np.concatenate([joints, joints[:, :8]], axis=1)  # 22 points
    np.save(tmp_path / "x.npy", more if "--layout" in options else joints)
    given: dict[str, Any] = {"layout": "posekit_14"}
    words = list(options) if "--layout" in options else [*options, "--layout", "posekit_14"]
    given |= {words[k].lstrip("-"): words[k + 1] for k in range(0, len(words), 2)}
    expected = posekit.open(tmp_path / "x.npy", **given)
    code, _, err = run("convert", str(tmp_path / "x.npy"), str(tmp_path / "y.npz"), *words)
    assert code == 0, err
    again = posekit.open(tmp_path / "y.npz")
    np.testing.assert_array_equal(again.joints, expected.joints)
    np.testing.assert_array_equal(again.time, expected.time)
    assert again.up == expected.up
    found = inspected(run, tmp_path / "x.npy", *words)
    assert found["up"].startswith(expected.up or "not known") and found["unit"] == expected.unit
    report = posekit.validate(tmp_path / "x.npy", **given)
    code, out, _ = run("validate", str(tmp_path / "x.npy"), *words, "-o", str(tmp_path / "r.json"))
    assert code == int(not report.ok.all()) and report.summary().splitlines()[0] in out
    assert posekit.open(tmp_path / "r.json").ok.tolist() == report.ok.tolist()


def test_evaluate_prints_the_table_of_the_function(run: Any, tmp_path: Path) -> None:
    view = posekit.open("walk.json")
    posekit.recover(view).save(tmp_path / "found.npz")
    words = ("evaluate", str(tmp_path / "found.npz"), "--truth", "walk.json", "-o", str(tmp_path / "e.json"))
    code, out, _ = run(*words)
    assert code == 0 and out.strip() == evaluate(posekit.open(tmp_path / "found.npz"), view).table().strip()
    assert (tmp_path / "e.json").stat().st_size > 100
    code, out, _ = run("evaluate", "walk.npz", "--noise", "0,3", "--views", "2", "--seed", "4")
    function = evaluate_method(
        posekit.open("walk.npz"), posekit.RecoverSettings(), noise=[0, 3], views=2, seed=4
    )
    assert code == 0 and out.strip() == function.table().strip()
