"""Laws of files: what a motion is about survives every table and array, and is where the header says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import posekit
from posekit.motion import Motion
from posekit.skeleton import POINTS
from tests.test_formats_motion import walking

TABLES = (".npz", ".csv", ".tsv", ".parquet")


def kinds() -> dict[str, Motion]:
    """Return a motion of each kind, in a world with z up."""
    walk = replace(walking(), q=None, q_names=(), robot="")
    joints, time = np.asarray(walk.joints), np.asarray(walk.time)
    return {
        "one posture": Motion(joints=joints[3:4], joint_names=POINTS, up="+z"),
        "without times": Motion(joints=joints[::6], joint_names=POINTS, up="+z"),
        "later": replace(walk, time=time + 2.5),
        "uneven": walk.take([0, 1, 2, 7, 8]),
        "two clips": replace(
            walk, clip=np.repeat([0, 1], 12), clips=("a", "b"), time=np.tile(time[:12], 2), frame=None
        ),
        "two clips without names": replace(
            walk, clip=np.repeat([0, 1], 12), time=np.tile(time[:12], 2), frame=None
        ),
        "several postures a frame": Motion(
            joints=joints[::4], joint_names=POINTS, frame=[0, 0, 1, 3, 3, 3], up="+z"
        ),
    }


@pytest.mark.parametrize("kind", list(kinds()))
@pytest.mark.parametrize("ending", TABLES)
def test_what_a_motion_is_about_is_read_again(kind: str, ending: str, tmp_path: Path) -> None:
    motion = kinds()[kind]
    posekit.save(motion, tmp_path / f"x{ending}")
    again = posekit.open(tmp_path / f"x{ending}", up=motion.up or None)
    assert again.joint_names == motion.joint_names and again.in_time == motion.in_time
    assert again.up == motion.up and again.unit == "m" and again.in_world == motion.in_world
    np.testing.assert_array_equal(again.joints, motion.joints)
    np.testing.assert_allclose(again.time, motion.time, rtol=1e-12)
    assert [part.rate for _, part in again.recordings()] == [part.rate for _, part in motion.recordings()]
    if kind.startswith("two clips"):
        assert again.clips == (motion.clips or ("0", "1")) and again.clip.tolist() == motion.clip.tolist()
    if kind == "several postures a frame":
        np.testing.assert_array_equal(again.frame, motion.frame)


@pytest.mark.parametrize("kind", list(kinds()))
def test_a_table_has_the_columns_that_its_motion_needs(kind: str, tmp_path: Path) -> None:
    motion = kinds()[kind]
    posekit.save(motion, tmp_path / "x.csv")
    columns = list(pd.read_csv(tmp_path / "x.csv").columns)
    first = {"several postures a frame": ["frame", "time"]}
    if kind.startswith("two clips"):
        first[kind] = ["time", "clip"]
    points = [f"{name}_{axis}" for name in motion.joint_names for axis in "xyz"]
    assert columns == first.get(kind, ["time"]) + points


@pytest.mark.parametrize(("name", "got"), [("right_hand", "got right_hand"), ("neck", "got a name twice")])
def test_names_of_joints_are_known_and_each_given_once(name: str, got: str) -> None:
    joints = np.asarray(walking(2).joints)
    with pytest.raises(posekit.InputError, match=f"joint_names: {got}; expected each once of neck, "):
        Motion(joints=joints, joint_names=(*POINTS[:-1], name))


def test_json_holds_one_recording(tmp_path: Path) -> None:
    joints = np.repeat(posekit.load_figure().neutral_points[None, :14], 4, axis=0)
    two = posekit.Motion(joints=joints, clip=[0, 0, 1, 1], clips=("a", "b"))
    with pytest.raises(posekit.InputError, match="2 recordings"):
        posekit.save(two, tmp_path / "two.json")
    assert not list(tmp_path.iterdir())
