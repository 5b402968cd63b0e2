"""Tables of a robot's configurations over time: every layout gives the same q, and Pinocchio's places of its joints."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from posekit.errors import InputError
from posekit.formats.format import Content
from posekit.formats.held import HeldPostures
from posekit.formats.held_postures import configurations_of, held_postures
from posekit.formats.recognising import recognise
from posekit.geometry import Array
from posekit.robots.body_point import frame_index
from posekit.skeleton import FEET_POINTS, JOINT
from posekit.validation.robot_motion import moves_of, placed
from posekit.validators import Validator

FRAMES, RATE = 20, 30.0


@cache
def g1() -> Validator:
    return Validator("g1", checks=["joint-range"])


def joints() -> tuple[str, ...]:
    return g1().configuration_names[7:]


def q() -> Array:
    """Walk while turning by two rad: a place, a quaternion x, y, z, w, and 29 joints (T, 36)."""
    angles = np.random.default_rng(3).uniform(-0.2, 0.2, (FRAMES, 29))
    yaw = np.linspace(0.2, 2.2, FRAMES)
    zero = np.zeros(FRAMES)
    place = np.stack([np.linspace(0, 1, FRAMES), zero, zero + 0.79], axis=1)
    turn = np.stack([zero, zero, np.sin(yaw / 2), np.cos(yaw / 2)], axis=1)
    return np.concatenate([place, turn, angles], axis=1)


def wxyz() -> Array:
    return q()[:, [6, 3, 4, 5]]


def held(path: Path, rate: float | None = None) -> HeldPostures:
    found = recognise(path)
    assert found.holds is Content.CONFIGURATIONS
    return placed(g1(), configurations_of(path, found, rate))


def bodies(values: Array) -> Array:
    return np.stack([values, values + 0.1], axis=1)


NPZ_LAYOUTS: dict[str, dict[str, Any]] = {
    "gmr": {"fps": RATE, "root_pos": q()[:, :3], "root_rot": q()[:, 3:7], "dof_pos": q()[:, 7:]},
    "w first": {"fps": RATE, "root_pos": q()[:, :3], "root_rot": wxyz(), "dof_pos": q()[:, 7:]},
    "phuma": {"fps": RATE, "root_trans": q()[:, :3], "root_ori": q()[:, 3:7], "dof_pos": q()[:, 7:]},
    "float32": {
        "fps": np.array([RATE]),
        "root_pos": q()[:, :3].astype("f4"),
        "root_rot_wxyz": wxyz().astype("f4"),
        "dof_pos": q()[:, 7:].astype("f4"),
    },
    "named": {
        "time": np.arange(FRAMES) / RATE,
        "root_pos": q()[:, :3],
        "root_quat_xyzw": q()[:, 3:7],
        "dof": q()[:, :6:-1],
        "dof_names": np.array([name.removesuffix("_joint") for name in joints()[::-1]]),
    },
    "isaac lab": {
        "fps": int(RATE),
        "body_positions": bodies(q()[:, :3]),
        "body_rotations": bodies(wxyz()),
        "body_names": np.array(["pelvis", "torso_link"]),
        "dof_positions": q()[:, 7:],
        "dof_names": np.array(joints()),
    },
    "mujoco": {"fps": RATE, "qpos": np.concatenate([q()[:, :3], wxyz(), q()[:, 7:]], axis=1)},
    "ours": {"rate": RATE, "q": q(), "configuration_names": np.array(g1().configuration_names)},
}


@pytest.mark.parametrize("layout", NPZ_LAYOUTS)
def test_every_layout_gives_the_same_configurations_and_times(tmp_path: Path, layout: str) -> None:
    np.savez(tmp_path / "a.npz", **NPZ_LAYOUTS[layout])
    found = held(tmp_path / "a.npz")
    np.testing.assert_allclose(found.q, q(), atol=1e-6)
    np.testing.assert_allclose(found.time, np.arange(FRAMES) / RATE, atol=1e-12)
    assert found.up == "+z" and found.in_time


def table(names: list[str], values: Array) -> str:
    return "\n".join([",".join(names), *(",".join(map(repr, row)) for row in values.tolist())]) + "\n"


CSV_TABLES = {
    "lafan1": "\n".join(",".join(map(repr, row)) for row in q().tolist()),
    "named": table(
        ["time", "x", "y", "z", "qx", "qy", "qz", "qw", *joints()],
        np.concatenate([np.arange(FRAMES)[:, None] / RATE, q()], axis=1),
    ),
    "w first": table(
        [
            "Frame",
            *(f"root_pos_{axis}" for axis in "xyz"),
            *(f"root_rot_{axis}" for axis in "wxyz"),
            *(f"dof_{name}(rad)" for name in joints()),
        ],
        np.concatenate([np.arange(FRAMES)[:, None], q()[:, :3], wxyz(), q()[:, 7:]], axis=1),
    ),
}


@pytest.mark.parametrize("name", CSV_TABLES)
def test_tables_with_and_without_names_are_read(tmp_path: Path, name: str) -> None:
    (tmp_path / "a.csv").write_text(CSV_TABLES[name], encoding="utf-8")
    np.testing.assert_allclose(held(tmp_path / "a.csv").q, q(), atol=1e-12)
    if name != "named":
        found = held(tmp_path / "a.csv")
        assert np.isnan(found.time).all() and any("--rate" in said for said in found.said)
        assert held(tmp_path / "a.csv", rate=50.0).time[1] == 0.02


def test_joints_and_soles_are_where_pinocchio_has_their_frames(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **NPZ_LAYOUTS["gmr"])
    found = held(tmp_path / "a.npz")
    robot = g1().robot
    assert robot is not None
    model, data = robot.model, robot.model.createData()
    frames = frame_index(model)
    for frame in (0, 7, 19):
        pin.framesForwardKinematics(model, data, q()[frame])
        for joint, link in (("left_knee", "left_knee_link"), ("right_wrist", "right_wrist_pitch_link")):
            place = data.oMf[frames[link]].translation
            np.testing.assert_allclose(found.postures.joints[frame, JOINT[joint]], place, atol=1e-9)
        for point, away in zip(FEET_POINTS, found.feet[frame], strict=True):
            foot = data.oMf[frames[f"{point.partition('_')[0]}_ankle_roll_link"]]
            ahead, _, below = foot.actInv(away)
            assert (ahead > 0) == point.endswith("toe") and below < 0


def test_velocities_are_what_leads_to_each_frame(tmp_path: Path) -> None:
    robot = g1().robot
    assert robot is not None
    time = np.arange(FRAMES) / RATE
    time[5] = time[4]
    moves = moves_of(robot.model, q(), time, robot.joint_names)
    assert np.isnan(moves["velocity"][[0, 5]]).all() and np.isfinite(moves["velocity"][6]).all()
    stepped = pin.integrate(robot.model, q()[6], moves["velocity"][7] / RATE)
    np.testing.assert_allclose(stepped, q()[7], atol=1e-9)
    at = moves["velocity_names"].index("left_knee_joint")
    assert moves["velocity_limits"][at] == robot.model.velocityLimit[at]


def changed(layout: str, **arrays: Any) -> dict[str, Any]:
    merged = {**NPZ_LAYOUTS[layout], **arrays}
    return {name: value for name, value in merged.items() if value is not None}


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        (
            changed("gmr", root_rot=np.full((FRAMES, 4), 0.5)),
            "order is not said.*name the array root_rot_xyzw",
        ),
        (changed("gmr", root_rot=3 * q()[:, 3:7]), "a quaternion of length 3"),
        (changed("gmr", root_rot=q()[:, 3:6]), r"root_rot: got float64 of shape \(20, 3\)"),
        (changed("gmr", root_pos=None), "root_pos: got nothing"),
        (changed("gmr", root_trans=q()[:, :3]), "two of one thing"),
        (changed("gmr", dof_pos=q()[:, 9:]), "34 variables; expected 36"),
        (changed("gmr", dof_pos=np.full((FRAMES, 29), np.inf)), "joints: got inf; expected finite numbers"),
        (changed("gmr", dof_pos=np.array([{}] * FRAMES, dtype=object)), "pickles are not read"),
        (changed("gmr", dof_names=np.array(["a"] * 29)), "joint names: got"),
        (changed("gmr", dof_names=np.array([f"j{k}" for k in range(29)])), 'got "j0"; expected a variable'),
        (changed("isaac lab", dof_names=None), "in the order of a simulator"),
        (changed("mujoco", qpos=np.zeros((3, 5))), "qpos: got 5 numbers"),
    ],
)
def test_what_is_no_table_of_the_robot_is_refused_in_one_line(
    tmp_path: Path, arrays: dict[str, Any], words: str
) -> None:
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(InputError, match=words) as refused:
        held(tmp_path / "a.npz")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("rate", [0.0, -30.0, np.nan, None])
def test_a_rate_that_is_none_is_no_time(tmp_path: Path, rate: float | None) -> None:
    np.savez(tmp_path / "a.npz", **changed("gmr", fps=rate))
    assert np.isnan(held(tmp_path / "a.npz").time).all()


def test_angles_in_degrees_are_refused(tmp_path: Path) -> None:
    names = ["Frame", *(f"root_translate{a}" for a in "XYZ"), *(f"root_rotate{a}" for a in "XYZ")]
    text = table([*names, *(f"{name}_dof" for name in joints())], np.zeros((3, 36)))
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"root_rotateX.*angles in degrees"):
        held(tmp_path / "a.csv")


@pytest.mark.parametrize("cut", [1, 30, 300, 3000])
def test_a_file_that_is_cut_off_is_refused_in_one_line(tmp_path: Path, cut: int) -> None:
    np.savez(tmp_path / "a.npz", **NPZ_LAYOUTS["gmr"])
    (tmp_path / "a.csv").write_text(CSV_TABLES["lafan1"][:-cut] + ",x", encoding="utf-8")
    for suffix in ("npz", "csv"):
        path = tmp_path / f"a.{suffix}"
        if suffix == "npz":
            path.write_bytes(path.read_bytes()[:-cut])
        with pytest.raises(InputError) as refused:
            held_postures(path, recognise(path))
        assert "\n" not in str(refused.value)
