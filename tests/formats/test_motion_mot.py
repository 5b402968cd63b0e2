"""MOT: pandas rebuilds q from the table and Pinocchio places the same joints; angles invert at every attitude."""

import hypothesis.strategies as st
import numpy as np
import pandas as pd
import pinocchio as pin
import pytest
from hypothesis import given, settings
from scipy.spatial.transform import Rotation

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.formats.motion import write_configurations, write_motion
from posekit.formats.motion.mot import quaternions_of, read_mot, write_mot, yaw_pitch_roll
from posekit.formats.motion.motion import Motion
from posekit.skeleton import JOINTS
from posekit.synthesis import random_postures

FIGURE = load_figure().from_stature(1.74)
EDGES = (0.0, 90.0, -90.0, 180.0, 89.9999999, 1e-9)


def configurations(n=20, seed=0):
    rng = np.random.default_rng(seed)
    q = random_postures(FIGURE, n, rng)
    q[:, :3] = rng.normal(size=(n, 3))
    q[:, 3:7] = Rotation.random(n, random_state=seed).as_quat()
    return q, np.arange(n) / 50


def table_of(path):
    lines = path.read_text().splitlines()
    return lines, pd.read_csv(path, sep="\t", skiprows=lines.index("endheader") + 1)


def test_pandas_and_pinocchio_find_the_same_joints(tmp_path):
    q, time = configurations()
    write_configurations(tmp_path / "a.mot", FIGURE, q, time)
    _, table = table_of(tmp_path / "a.mot")
    model = pin.buildModelFromXML(FIGURE.urdf, pin.JointModelFreeFlyer())
    data = model.createData()
    expected = FIGURE.forward_kinematics(q)[:, : len(JOINTS)]
    for k, row in table.iterrows():
        own = pin.neutral(model)
        own[:3] = row[["torso_tx", "torso_ty", "torso_tz"]]
        R = np.eye(3)
        for axis in "zyx":
            R = R @ Rotation.from_euler(axis, row[f"torso_r{axis}"], degrees=True).as_matrix()
        own[3:7] = pin.Quaternion(R).coeffs()
        for name in model.names[2:]:
            own[model.joints[model.getJointId(name)].idx_q] = np.radians(row[name])
        pin.framesForwardKinematics(model, data, own)
        wrist = data.oMf[model.getFrameId("right_wrist")].translation
        np.testing.assert_allclose(wrist, expected[k, JOINTS.index("right_wrist")], rtol=0, atol=1e-6)
        placed = FIGURE.forward_kinematics(own[None])[0, : len(JOINTS)]
        np.testing.assert_allclose(placed, expected[k], rtol=0, atol=1e-6)
    np.testing.assert_allclose(table["time"], time, atol=1e-12)


def test_what_is_written_is_read_again(tmp_path):
    q, time = configurations(50, seed=2)
    q[3, 9:] = np.nan
    q[4] = np.nan
    write_mot(tmp_path / "a.mot", FIGURE, q, time)
    back, seconds = read_mot(tmp_path / "a.mot", FIGURE)
    sign = np.sign(np.sum(q[:, 3:7] * back[:, 3:7], axis=1, keepdims=True))
    back[:, 3:7] *= sign
    np.testing.assert_allclose(back, q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(seconds, time, atol=1e-12)


@given(st.tuples(*[st.one_of(st.sampled_from(EDGES), st.floats(-180, 180))] * 3))
@settings(deadline=None, max_examples=150, derandomize=True)
def test_the_roots_rotation_inverts_everywhere(angles):
    given_rotation = Rotation.from_euler("ZYX", angles, degrees=True)
    found = yaw_pitch_roll(given_rotation.as_quat()[None])
    assert abs(found[0, 1]) <= np.pi / 2 + 1e-12
    again = Rotation.from_euler("ZYX", found[0]).as_matrix()
    np.testing.assert_allclose(again, given_rotation.as_matrix(), rtol=0, atol=3e-8)
    ours = Rotation.from_quat(quaternions_of(found)[0]).as_matrix()
    np.testing.assert_allclose(ours, again, rtol=0, atol=1e-14)


@pytest.mark.parametrize("pitch", [90, -90])
def test_straight_up_or_down_there_is_no_roll(pitch):
    quaternion = Rotation.from_euler("ZYX", [30, pitch, 50], degrees=True).as_quat()
    yaw, found, roll = np.degrees(yaw_pitch_roll(quaternion[None])[0])
    assert (found, roll) == (pytest.approx(pitch, abs=1e-6), pytest.approx(0, abs=1e-6))
    assert yaw == pytest.approx(30 - np.sign(pitch) * 50, abs=1e-5)


def test_a_person_who_turns_round_does_not_jump(tmp_path):
    q, _ = configurations(40)
    yaw = np.linspace(0, 4 * np.pi, 40)
    q[:, 3:7] = np.stack([0 * yaw, 0 * yaw, np.sin(yaw / 2), np.cos(yaw / 2)], axis=1)
    write_mot(tmp_path / "a.mot", FIGURE, q, np.arange(40) / 30)
    _, table = table_of(tmp_path / "a.mot")
    np.testing.assert_allclose(table["torso_rz"], np.degrees(yaw), atol=1e-8)


def test_the_header_is_opensims(tmp_path):
    q, time = configurations(3)
    write_mot(tmp_path / "walk.mot", FIGURE, q, time)
    lines, table = table_of(tmp_path / "walk.mot")
    header = lines[: lines.index("endheader")]
    assert header[:5] == ["walk", "version=1", "nRows=3", f"nColumns={table.shape[1]}", "inDegrees=yes"]
    assert table.shape == (3, 1 + 6 + 22)
    assert {"time", "torso_rz", "right_elbow_flexion", "pelvis_bending"} <= set(table)
    radians = (tmp_path / "walk.mot").read_text().replace("inDegrees=yes", "inDegrees=no")
    (tmp_path / "b.mot").write_text(radians)
    back, _ = read_mot(tmp_path / "b.mot", FIGURE)
    np.testing.assert_allclose(back[:, 7:], np.degrees(q[:, 7:]), atol=1e-8)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.replace("endheader", "end"), "no endheader"),
        (lambda text: text[: text.rindex("\n", 0, -1)], "nrows: got 2"),
        (lambda text: text[:-20], "line 14: got 28 columns|nrows"),
        (lambda text: text.replace("torso_rz\t", "torso_r\t"), r"no torso_rz; .*did you mean torso_r"),
        (lambda text: text.replace("nColumns=29", "nColumns=30"), "ncolumns: got 29"),
        (lambda text: text[: text.rindex("\t")] + "\tx\n", 'got "x"'),
        (lambda text: text[: text.rindex("\t")] + "\tinf\n", 'got "inf"'),
        (lambda text: text.replace("\n0.02\t", "\n0\t"), "times that ascend"),
        (lambda text: text[: text.index("endheader") + 10], "endheader"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path, change, words):
    q, time = configurations(3)
    write_mot(tmp_path / "a.mot", FIGURE, q, time)
    (tmp_path / "a.mot").write_text(change((tmp_path / "a.mot").read_text()))
    with pytest.raises(InputError, match=words) as refused:
        read_mot(tmp_path / "a.mot", FIGURE)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda q, time: (q[:, 1:], time), "q of shape"),
        (lambda q, time: (q, time[1:]), "time of shape"),
        (lambda q, time: (q, time[::-1]), "times that ascend"),
        (lambda q, time: (q * 2, time), "a quaternion of length 2"),
        (lambda q, time: (q + np.inf, time), "infinite"),
        (lambda q, time: (q, time * np.nan), "got nan s; expected finite times"),
        (lambda q, time: (q[:0], time[:0]), "one or more"),
    ],
)
def test_configurations_that_are_none_are_not_written(tmp_path, change, words):
    with pytest.raises(InputError, match=words):
        write_mot(tmp_path / "a.mot", FIGURE, *change(*configurations(3)))
    assert list(tmp_path.iterdir()) == []


def test_points_do_not_go_into_angles_nor_angles_into_points(tmp_path):
    one = Motion(names=("a",), points=np.ones((1, 1, 3)), time=np.zeros(1), rate=1)
    with pytest.raises(
        InputError, match="mot, which carries joint angles; expected trc, c3d, csv, npz, parquet"
    ):
        write_motion(tmp_path / "a.mot", one)
    with pytest.raises(InputError, match="trc, which carries points; expected mot, "):
        write_configurations(tmp_path / "a.trc", FIGURE, *configurations(2))
