"""Arrays of points: each shape and each name that files give them is read alike."""

from __future__ import annotations

import io
import pickle
import sys
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest

import posekit
from posekit.skeleton import HEAD_POINTS, JOINTS, POINTS
from tests.test_formats_motion import RATE, cloud_of, walking

SHAPES: dict[str, Callable[[Any], Any]] = {
    "one person first": lambda cloud: cloud[None],
    "one person second": lambda cloud: cloud[:, None],
    "rows of numbers": lambda cloud: cloud.reshape(len(cloud), -1),
    "sure points": lambda cloud: np.concatenate([cloud, np.full((*cloud.shape[:2], 1), 0.01)], axis=2),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("layout", ["h36m_17", "smpl_22"])
def test_shapes_of_an_array_of_points_are_read_alike(shape: str, layout: str, tmp_path: Path) -> None:
    cloud, _ = cloud_of(layout)
    for name, array in (("plain", cloud), ("shaped", SHAPES[shape](cloud))):
        np.savez(tmp_path / name, joints=array, fps=RATE)
    plain, shaped = (posekit.open(tmp_path / f"{name}.npz") for name in ("plain", "shaped"))
    assert shaped.layout == plain.layout == layout and shaped.rate == pytest.approx(RATE)
    np.testing.assert_array_equal(shaped.joints, plain.joints)


def test_a_point_without_confidence_is_unknown(tmp_path: Path) -> None:
    cloud, _ = cloud_of("smpl_22")
    confidence = np.full((*cloud.shape[:2], 1), 0.5)
    confidence[3, 4] = 0.0
    np.savez(tmp_path / "a.npz", joints=np.concatenate([cloud, confidence], axis=2), fps=RATE)
    unknown = np.isnan(posekit.open(tmp_path / "a.npz").figure_joints).any(axis=2)
    assert np.argwhere(unknown).tolist() == [[3, JOINTS.index("left_knee")]]


def test_one_posture_is_an_array_of_points(tmp_path: Path) -> None:
    cloud, motion = cloud_of("h36m_17")
    np.save(tmp_path / "one.npy", cloud[5])
    one = posekit.open(tmp_path / "one.npy", up="+z")
    assert len(one) == 1 and one.layout == "h36m_17"
    np.testing.assert_allclose(
        one.points(["left_wrist", "right_ankle"]), motion.points(["left_wrist", "right_ankle"])[5:6]
    )


@pytest.mark.parametrize("named", [False, True])
def test_head_points_may_be_an_array_of_their_own(named: bool, tmp_path: Path) -> None:
    points = np.asarray(walking().points(POINTS))
    names = {"joint_names": np.array(JOINTS)} if named else {}
    np.savez(tmp_path / "a.npz", joints=points[:, :14], head=points[:, 14:], fps=RATE, up="+z", **names)
    found = posekit.open(tmp_path / "a.npz")
    assert found.joint_names == (*JOINTS, *HEAD_POINTS)
    np.testing.assert_array_equal(found.joints, points)


@pytest.mark.parametrize(("asked", "used"), [("", "coco_17"), ("h36m_17", "h36m_17")])
def test_a_file_may_name_its_layout_and_an_argument_overrides_it(
    asked: str, used: str, tmp_path: Path
) -> None:
    cloud, _ = cloud_of(used)
    np.savez(tmp_path / "a.npz", joints=cloud, layout="coco_17", fps=RATE)
    assert posekit.open(tmp_path / "a.npz", layout=asked).layout == used


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"joint_names": np.array(JOINTS[:13])}, "joint_names: got 13 names; expected 14, one per point"),
        (
            {"clip": np.zeros(3, dtype=int)},
            r"clip: got int64 \(3,\); expected 24 whole numbers from 0, below 24",
        ),
        ({"clip": np.full(24, 24)}, "clip: got int64"),
        ({"clip": np.full(24, -1)}, "clip: got int64"),
        ({"frame": np.full(24, 0.5)}, r"frame: got float64 \(24,\)"),
        ({"time": np.arange(23.0)}, "time: got 23 numbers; expected 24"),
        ({"unit": np.array("yard")}, "unit: got .?yard"),
        ({"up": np.array("w")}, "up: got .?w"),
    ],
)
def test_arrays_that_contradict_the_points_are_refused(
    change: dict[str, Any], line: str, tmp_path: Path
) -> None:
    joints = np.asarray(walking().figure_joints)
    np.savez(tmp_path / "a.npz", **{"joints": joints, "fps": RATE, **change})
    with pytest.raises(posekit.InputError, match=line):
        posekit.open(tmp_path / "a.npz")


def test_the_last_clip_and_the_first_are_numbers_of_clips(tmp_path: Path) -> None:
    joints = np.asarray(walking().figure_joints)
    clip = np.repeat([0, 1], 12)
    np.savez(tmp_path / "a.npz", joints=joints, clip=clip, clip_names=np.array(["a", "b"]), fps=RATE)
    found = posekit.open(tmp_path / "a.npz")
    assert found.clip.tolist() == clip.tolist() and found.clips == ("a", "b")
    np.savez(tmp_path / "a.npz", joints=joints, clip=clip + 1, clip_names=np.array(["a", "b"]), fps=RATE)
    with pytest.raises(posekit.InputError, match="below 2"):
        posekit.open(tmp_path / "a.npz")


class JoblibPickler(pickle._Pickler):  # type: ignore[name-defined]
    """Write an array as a wrapper, padding to 16 bytes if aligned, and its bytes (joblib/numpy_pickle.py)."""

    def __init__(self, file: Any, order: Any, aligned: bool) -> None:
        super().__init__(file, protocol=3)
        self.file, self.order, self.aligned = file, order, aligned

    def save(self, thing: Any, *options: Any) -> None:
        if not isinstance(thing, np.ndarray):
            super().save(thing, *options)  # type: ignore[misc]
            return
        wrapper = sys.modules["joblib.numpy_pickle"].NumpyArrayWrapper()
        vars(wrapper).update(subclass=np.ndarray, shape=thing.shape, order=self.order, dtype=thing.dtype)
        vars(wrapper).update(numpy_array_alignment_bytes=16 if self.aligned else None)
        super().save(wrapper)  # type: ignore[misc]
        if self.aligned:
            padding = 16 - (self.file.tell() + 1) % 16
            self.file.write(bytes([padding]) + padding * b"\xff")
        self.file.write(thing.tobytes(self.order))


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("aligned", [False, True])
@pytest.mark.parametrize("packed", [False, True])
def test_arrays_of_joblib_are_read(order: str, aligned: bool, packed: bool, tmp_path: Path) -> None:
    motion = walking()
    modules = {name: type(sys)(name) for name in ("joblib", "joblib.numpy_pickle")}
    wrapper = type("NumpyArrayWrapper", (), {"__module__": "joblib.numpy_pickle"})
    vars(modules["joblib.numpy_pickle"])["NumpyArrayWrapper"] = wrapper
    file = io.BytesIO()
    with mock.patch.dict(sys.modules, modules):
        clip = {"joint_names": list(POINTS), "joints": motion.points(POINTS), "fps": RATE}
        JoblibPickler(file, order, aligned).dump(clip)
    data = zlib.compress(file.getvalue()) if packed else file.getvalue()
    (tmp_path / "clip.pkl").write_bytes(data)
    found = posekit.open(tmp_path / "clip.pkl")
    assert found.rate == pytest.approx(RATE)
    np.testing.assert_array_equal(found.points(POINTS), motion.points(POINTS))


@pytest.mark.parametrize("protocol", [0, 1, 2, 4])
@pytest.mark.parametrize("wrapped", ["array", "list of one", "object array", "dict of dict"])
def test_protocols_and_wrappings_of_pickles_read_alike(protocol: int, wrapped: str, tmp_path: Path) -> None:
    clip: Any = {"joint_names": list(POINTS), "joints": walking().points(POINTS), "fps": RATE}
    if wrapped == "array":
        clip = {**clip, "joint_names": np.array(POINTS), "fps": np.array(RATE, dtype=object)}
    elif wrapped == "list of one":
        clip = [clip]
    elif wrapped == "object array":
        clip = np.array(clip, dtype=object)
    else:
        clip = {"a clip": clip}
    (tmp_path / "clip.pkl").write_bytes(pickle.dumps(clip, protocol=protocol))
    found = posekit.open(tmp_path / "clip.pkl")
    assert found.rate == pytest.approx(RATE)
    np.testing.assert_array_equal(found.points(POINTS), walking().points(POINTS))


@pytest.mark.parametrize("rooted", [False, True])
def test_joints_of_a_robot_may_begin_with_its_root(rooted: bool, tmp_path: Path) -> None:
    """As MuJoCo's qpos does, with w first in the quaternion."""
    robot = posekit.load_robot("g1", bodies="none")
    names = robot.configuration_names[7:]
    q = np.tile(robot.neutral, (6, 1))
    q[:, :3] = [[0.1 * k, 0.0, 0.8] for k in range(6)]
    q[:, 7:] += np.random.default_rng(0).uniform(-0.2, 0.2, (6, len(names)))
    root = {} if rooted else {"root_pos": q[:, :3], "root_rot": q[:, 3:7]}
    joints = q[:, [0, 1, 2, 6, 3, 4, 5, *range(7, q.shape[1])]] if rooted else q[:, 7:]
    np.savez(tmp_path / "a.npz", dof_pos=joints, dof_names=np.array(names), fps=RATE, **root)
    found = posekit.open(tmp_path / "a.npz", urdf="g1")
    order = [found.q_names.index(name) for name in robot.configuration_names]
    np.testing.assert_allclose(found.q[:, order], q, atol=1e-12)
