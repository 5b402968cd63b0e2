"""`posekit validate --repair`: files repaired in their own format."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.formats.motion import Motion, read_motion, write_motion
from posekit.formats.own import read_postures, write_postures
from posekit.formats.own.postures_q import read_configurations, write_configurations
from posekit.geometry import Array
from posekit.skeleton import JOINT, JOINTS
from posekit.validators import Validator

FRAMES = 40


def swaying(first: int, last: int) -> Array:
    """Return frames (40, 14, 3) of a standing body that sways, legs exchanged from one frame to another."""
    joints = np.repeat(load_figure().neutral_points[None, : len(JOINTS)], FRAMES, axis=0)
    phase = np.linspace(0, 4, FRAMES)
    joints = joints + 0.05 * np.stack([np.sin(phase), np.cos(phase), np.zeros(FRAMES)], axis=-1)[:, None]
    legs = [JOINT[f"{side}_{part}"] for side in ("right", "left") for part in ("hip", "knee", "ankle")]
    joints[first : last + 1, legs] = joints[first : last + 1][:, legs[3:] + legs[:3]]
    return joints


def motion(joints: Array, clips: int = 1) -> Motion:
    """Return it as a motion, z up, cut into clips."""
    time = np.arange(FRAMES) / 30
    return Motion(
        names=JOINTS,
        points=joints,
        time=time,
        rate=30.0,
        up="+z",
        clip=np.arange(FRAMES) * clips // FRAMES,
        clips=tuple(f"clip{k}" for k in range(clips)),
    )


@pytest.fixture
def repaired(run: Callable[..., Any]) -> Callable[..., str]:
    """Return a way to run `posekit validate --repair` on what is not valid: what it says."""

    def validate(*arguments: object) -> str:
        done = run("validate", *arguments)
        judged = re.findall(r"judged again, (\d+) of (\d+) frames", done.out)
        assert done.code == int(any(valid != frames for valid, frames in judged)), done.err
        return str(done.out)

    return validate


@pytest.mark.parametrize("suffix", ["trc", "csv", "npz"])
def test_motion_is_repaired_in_its_own_format(
    repaired: Callable[..., str], run: Callable[..., Any], tmp_path: Path, suffix: str
) -> None:
    """Legs are exchanged back, and the file written passes."""
    given, out = tmp_path / f"given.{suffix}", tmp_path / f"out.{suffix}"
    write_motion(given, motion(swaying(12, 30)), suffix)
    said = repaired(given, "--repair", out, "--up", "+y" if suffix == "trc" else "+z")
    assert "exchanged" in said and "in frames 12 to 30" in said and f"written: {out}" in said
    written = read_motion(out)
    order = [written.names.index(name) for name in JOINTS]
    assert Validator().check(written.points[:, order]).valid.all()
    done = run("validate", out)
    assert done.code == 0, done.out


def test_a_folder_has_a_file_of_each_clip(repaired: Callable[..., str], tmp_path: Path) -> None:
    """Files of several clips that one file cannot carry go to a folder."""
    given, out = tmp_path / "given.npz", tmp_path / "out"
    write_motion(given, motion(swaying(5, 14), clips=2), "npz")
    said = repaired(given, "--repair", out)
    assert sorted(path.name for path in out.iterdir()) == ["clip0.npz", "clip1.npz"]
    assert "1 of 2 clips changed" in said


def test_several_clips_are_refused_by_a_format_of_one(run: Callable[..., Any], tmp_path: Path) -> None:
    """The error names a folder as the remedy, and nothing is written."""
    given, out = tmp_path / "given.npz", tmp_path / "out.trc"
    write_motion(given, motion(swaying(5, 14), clips=2), "npz")
    done = run("validate", given, "--repair", out)
    assert done.code == 2 and "folder" in done.err and not out.exists()


def test_files_of_one_name_are_all_kept(repaired: Callable[..., str], tmp_path: Path) -> None:
    """What is in different folders, or differs in the suffix, has a folder of its own."""
    out, given = tmp_path / "out", []
    for name in ("a/walk.npz", "b/walk.npz", "b/walk.csv"):
        given.append(tmp_path / name)
        given[-1].parent.mkdir(exist_ok=True)
        write_motion(given[-1], motion(swaying(12, 30)), given[-1].suffix[1:])
    repaired(*given, "--repair", out, "--up", "+z")
    assert len([path for path in out.rglob("*") if path.is_file()]) == len(given)


@pytest.mark.parametrize("target", ["given.npz", ".", "report.json"])
def test_nothing_is_written_over(run: Callable[..., Any], tmp_path: Path, target: str) -> None:
    """What is read, and the report, stay: the command refuses before it judges."""
    given = tmp_path / "given.npz"
    write_motion(given, motion(swaying(12, 30)), "npz")
    before = given.read_bytes()
    done = run("validate", given, "-o", tmp_path / "report.json", "--repair", tmp_path / target)
    assert done.code == 2 and "another name" in done.err
    assert given.read_bytes() == before and not (tmp_path / "report.json").exists()


def test_a_folder_of_verdicts_takes_no_repair(run: Callable[..., Any], tmp_path: Path) -> None:
    """An option that would do nothing is refused."""
    given = tmp_path / "given.npz"
    write_motion(given, motion(swaying(12, 30)), "npz")
    done = run("validate", given, "-o", tmp_path / "verdicts", "--repair", tmp_path / "out")
    assert done.code == 2 and "--repair" in done.err and not (tmp_path / "out").exists()


def test_postures_are_repaired_as_postures(repaired: Callable[..., str], tmp_path: Path) -> None:
    """A file of single postures stays one."""
    given, out = tmp_path / "given.json", tmp_path / "out.json"
    joints = load_figure().neutral_points[None, : len(JOINTS)].copy()
    joints[0, JOINT["right_ankle"]] += [0.3, 0.0, 0.2]
    joints[0, JOINT["right_knee"]] += [-0.1, 0.0, 0.0]
    write_postures(given, joints)
    assert "right_ankle turned" in repaired(given, "--repair", out, "--strict")
    assert Validator(strict=True).check(read_postures(out).joints).valid.all()


def test_configurations_are_repaired_as_configurations(repaired: Callable[..., str], tmp_path: Path) -> None:
    """A robot's joint beyond its limit comes to it."""
    given, out, panda = tmp_path / "given.json", tmp_path / "out.json", Validator("panda")
    names = panda.configuration_names
    q = np.zeros((1, len(names)))
    q[0, names.index("qw")], q[0, names.index("panda_joint4")] = 1.0, 0.5
    write_configurations(given, q, names)
    said = repaired(given, "--urdf", "panda", "--repair", out)
    assert "repaired: given.json: 1 of 1 frame changed; panda_joint4 turned" in said
    assert f"written: {out}; judged again, 1 of 1 frames are valid" in said
    assert panda.check(q=read_configurations(out).in_order_of(names)).valid.all()
