"""Files of motion: what is written is read again; each spelling, fault and contradiction that files come with."""

from __future__ import annotations

import gzip
import io
import os
import pickle
import re
import sys
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.formats.bvh import with_values
from posekit.geometry import rotation_about
from posekit.motion import Motion
from posekit.skeleton import FEET_POINTS, HEAD_POINTS, JOINTS, POINTS

RATE = 30.0


def walking(frames: int = 24) -> Any:
    """Return a figure that walks forward and swings its limbs, z up, with configurations."""
    figure = posekit.load_figure()
    names = list(figure.configuration_names)
    q = np.repeat(figure.neutral[None], frames, axis=0)
    phase = 2 * np.pi * np.arange(frames) / 24
    q[:, 0] = 0.03 * np.arange(frames)
    q[:, 2] = 1.45
    for name, size in (
        ("right_hip_flexion", 0.3),
        ("left_hip_flexion", -0.3),
        ("right_shoulder_flexion", -0.3),
    ):
        q[:, names.index(name)] += size * np.sin(phase)
    q[:, names.index("left_elbow_flexion")] += 0.4
    points = figure.forward_kinematics(q)
    time = np.arange(frames) / RATE
    return Motion(joints=points, joint_names=POINTS, q=q, q_names=names, robot="figure", time=time, up="+z")


def gaps(motion: Any) -> Any:
    """Return a motion whose left wrist is unknown in some frames."""
    joints = np.array(motion.joints)
    joints[5:9, JOINTS.index("left_wrist")] = np.nan
    return replace(motion, joints=joints, q=None, q_names=(), robot="")


@pytest.mark.parametrize("missing", [False, True])
@pytest.mark.parametrize(
    ("ending", "error"),
    [
        *((".npz", 0.0), (".csv", 0.0), (".tsv", 0.0), (".parquet", 0.0), (".csv.gz", 0.0), (".json", 1e-12)),
        *((".trc", 5.1e-10), (".trc.gz", 5.1e-10), (".c3d", 1.2e-7), (".bvh", 2e-7)),
    ],
)
def test_what_is_written_is_read_again(tmp_path: Path, ending: str, error: float, missing: bool) -> None:
    if ending == ".bvh":
        missing = False  # BVH cannot hold an unknown joint
    motion = gaps(walking()) if missing else walking()
    file = tmp_path / f"walk{ending}"
    posekit.save(motion, file)
    again = posekit.open(file)
    turned = motion.rotated(again.up) if again.up else motion
    expected, got = turned.points(again.joint_names), again.joints
    assert again.joint_names == motion.joint_names
    assert np.array_equal(np.isnan(got), np.isnan(expected))
    assert np.nanmax(np.abs(got - expected)) <= error
    assert np.abs(again.time - motion.time).max() < 1e-8
    assert not again.warnings


def test_the_stored_configurations_are_the_ones_written_as_bvh(tmp_path: Path) -> None:
    motion = walking()
    names = list(motion.q_names)
    q = np.array(motion.q)
    q[:, names.index("neck_flexion")] = 0.25
    figure = posekit.load_figure()
    motion = replace(motion, q=q, joints=figure.forward_kinematics(q)[:, :14], joint_names=JOINTS)
    posekit.save(motion, tmp_path / "walk.bvh")
    head = posekit.open(tmp_path / "walk.bvh").rotated("+z").points(HEAD_POINTS)
    assert np.abs(head - figure.forward_kinematics(q)[:, 14:]).max() < 2e-7


def test_an_arm_on_a_fixed_base_has_joints_only(tmp_path: Path) -> None:
    q, names = np.random.default_rng(0).uniform(-0.3, 0.3, (5, 9)), tuple(f"joint_{k}" for k in range(9))
    np.savez(tmp_path / "arm.npz", q=q, configuration_names=names)
    arm = posekit.open(tmp_path / "arm.npz")
    assert arm.q_names == names and np.array_equal(arm.q, q)


@pytest.mark.parametrize("ending", [".npz", ".csv", ".tsv", ".parquet"])
def test_a_robots_configurations_are_read_again(tmp_path: Path, ending: str) -> None:
    motion = squatting()
    posekit.save(motion, tmp_path / f"g1{ending}")
    again = posekit.open(tmp_path / f"g1{ending}")
    assert again.robot == "g1" and again.q_names == motion.q_names
    assert np.abs(again.q - motion.q).max() < 1e-15


def squatting(frames: int = 40, yaw: float = 0.0, forward: float = 0.02) -> Any:
    """Return a G1 that walks ahead with bending knees."""
    names = posekit.load_robot("g1", bodies="none").configuration_names
    q = np.zeros((frames, 36))
    q[:, 0] = forward * np.cos(yaw) * np.arange(frames)
    q[:, 1] = forward * np.sin(yaw) * np.arange(frames)
    q[:, 2], q[:, 5], q[:, 6] = 0.78, np.sin(yaw / 2), np.cos(yaw / 2)
    q[:, names.index("left_knee_joint")] = 0.3 + 0.1 * np.sin(np.arange(frames) / 4)
    return Motion(q=q, q_names=names, robot="g1", time=np.arange(frames) / RATE, up="+z")


def test_a_robot_is_written_as_points(tmp_path: Path) -> None:
    motion = squatting()
    posekit.save(motion, tmp_path / "g1.trc")
    points = posekit.open(tmp_path / "g1.trc").rotated("+z").figure_joints
    assert np.abs(points - posekit.load_robot("g1", bodies="none").points(motion.q)).max() < 1e-9


def test_glb_is_gltf_with_one_animation(tmp_path: Path) -> None:
    posekit.save(walking(), tmp_path / "walk.glb")
    data = (tmp_path / "walk.glb").read_bytes()
    assert data[:4] == b"glTF" and int.from_bytes(data[8:12], "little") == len(data)
    assert data.count(b'"interpolation":"LINEAR"') > 10


def test_c3d_is_read_and_written_as_ezc3d_does(tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d")
    motion = gaps(walking())
    posekit.save(motion, tmp_path / "ours.c3d")
    theirs = ezc3d.c3d(str(tmp_path / "ours.c3d"))
    points = np.moveaxis(theirs["data"]["points"][:3], 0, -1).swapaxes(0, 1)
    point = theirs["parameters"]["POINT"]
    assert tuple(point["LABELS"]["value"]) == motion.joint_names and point["RATE"]["value"][0] == RATE
    assert np.allclose(points, motion.joints, atol=1.2e-7, equal_nan=True)
    made = ezc3d.c3d()
    group = made["parameters"]["POINT"]
    group["UNITS"]["value"], group["RATE"]["value"] = ["mm"], [RATE]
    group["LABELS"]["value"] = list(POINTS)
    made["data"]["points"] = np.ones((4, len(POINTS), len(motion)))
    made["data"]["points"][:3] = 1000 * np.moveaxis(walking().joints, -1, 0).swapaxes(1, 2)
    made.write(str(tmp_path / "theirs.c3d"))
    found = posekit.open(tmp_path / "theirs.c3d")
    assert found.unit == "mm" and np.allclose(found.joints, walking().joints, atol=1e-6)


def test_a_table_is_one_line_of_pandas(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    motion = walking()
    for ending, load in ((".csv", pandas.read_csv), (".parquet", pandas.read_parquet)):
        posekit.save(motion, tmp_path / f"walk{ending}")
        frame = load(tmp_path / f"walk{ending}")
        assert np.array_equal(frame[["neck_x", "neck_y", "neck_z"]].to_numpy(), motion.joints[:, 0])


# BVH


def bvh_of(motion: Any, folder: Path) -> str:
    posekit.save(motion, folder / "walk.bvh")
    return (folder / "walk.bvh").read_text()


def test_a_bvh_file_is_written_back_byte_for_byte(tmp_path: Path) -> None:
    text = bvh_of(walking(), tmp_path)
    own = tmp_path / "own.bvh"
    own.write_text(text.replace("JOINT Spine", "JOINT  Spine").replace("\n", "\r\n"), newline="")
    posekit.save(posekit.open(own), tmp_path / "copy.bvh")
    assert (tmp_path / "copy.bvh").read_bytes() == own.read_bytes()


def test_changed_values_leave_the_rest_of_a_bvh_file_alone(tmp_path: Path) -> None:
    bvh_of(walking(), tmp_path)
    document = posekit.open(tmp_path / "walk.bvh").document
    values = np.array(document.values)
    values[3, 7] = 12.5
    lines, changed = document.text.splitlines(), with_values(document, values).text.splitlines()
    different = [k for k, (a, b) in enumerate(zip(lines, changed, strict=True)) if a != b]
    assert len(different) == 1 and "12.500000" in changed[different[0]].split()[7]


def test_a_motion_that_was_changed_is_not_written_as_its_file(tmp_path: Path) -> None:
    bvh_of(walking(), tmp_path)
    motion = posekit.open(tmp_path / "walk.bvh")
    moved = replace(motion, joints=motion.joints + np.array([1.0, 0.0, 0.0]))
    posekit.save(moved, tmp_path / "moved.bvh")
    assert np.abs(posekit.open(tmp_path / "moved.bvh").joints - moved.joints).max() < 1e-6


@pytest.mark.parametrize("unit", ["m", "cm", "mm", "in"])
def test_the_unit_of_bvh_is_told_by_the_body(tmp_path: Path, unit: str) -> None:
    motion = walking()
    posekit.save(motion, tmp_path / "walk.bvh", unit=unit)
    assert np.abs(posekit.open(tmp_path / "walk.bvh").rotated("+z").joints - motion.joints).max() < 1e-5


@pytest.mark.parametrize("every", [False, True])
def test_position_channels_may_stand_in_place_of_offsets(tmp_path: Path, every: bool) -> None:
    text = bvh_of(walking(4), tmp_path)
    plain = posekit.open(tmp_path / "walk.bvh")
    head, rows = text.split("Frame Time: 0.0333333333\n")
    lines = head.split("\n")
    joints = [line.split()[1] for line in lines if "JOINT" in line or "ROOT" in line]
    cells = [row.split() for row in rows.strip().split("\n")]
    for name in reversed(joints[1:] if every else ["RightArm"]):
        at = next(k for k, line in enumerate(lines) if line.split()[-1:] == [name])
        offset = lines[at + 2].split()[1:]
        lines[at + 3] = lines[at + 3].replace("CHANNELS 3 ", "CHANNELS 6 Xposition Yposition Zposition ")
        column = 3 + 3 * joints.index(name)
        cells = [[*row[:column], *offset, *row[column:]] for row in cells]
    rows = "\n".join(" ".join(row) for row in cells)
    (tmp_path / "absolute.bvh").write_text("\n".join(lines) + "Frame Time: 0.0333333333\n" + rows)
    motion = posekit.open(tmp_path / "absolute.bvh")
    assert np.abs(motion.joints - plain.joints).max() < 1e-12
    assert any("replace the offsets" in note for note in motion.notes)
    assert not any("replace the offsets" in note for note in plain.notes)


def test_positions_of_a_root_alone_that_repeat_its_offset_are_not_noted(tmp_path: Path) -> None:
    text = bvh_of(walking(4), tmp_path)
    plain = posekit.open(tmp_path / "walk.bvh")
    place = " ".join(text.strip().split("\n")[-2].split()[:3])
    head, offset, rest = re.split(r"(OFFSET [^\n]*)", text, maxsplit=1)
    assert set(map(float, offset.split()[1:])) == {0.0}
    (tmp_path / "root.bvh").write_text(f"{head}OFFSET {place}{rest}")
    motion = posekit.open(tmp_path / "root.bvh")
    np.testing.assert_allclose(motion.joints, plain.joints, atol=1e-12)
    assert motion.notes == plain.notes


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("MOTION", "MOTON", "no line MOTION"),
        ("Frame Time: 0.0333333333\n", "Frame Time: 0.0333333333\n1.0 2.0\n", "2 values"),
        ("CHANNELS 3 X", "CHANNELS 2 X", "line"),
        ("JOINT LeftArm", "JOINT RightArm", "twice"),
        ("Zrotation", "Wrotation", "channels"),
        ("OFFSET", "OFSET", "OFFSET"),
        ("HIERARCHY", "HIERACHY", "HIERARCHY"),
        *(
            ("Frames: 24", f"Frames: {count}", "positive whole number")
            for count in ("0", "-24", "x", "24.0", "²4")
        ),
        ("\t}\n}\nMOTION", "\t}\nMOTION", "}"),
    ],
)
def test_a_damaged_bvh_file_is_refused_with_the_reason(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    text = bvh_of(walking(), tmp_path)
    assert old in text
    (tmp_path / "bad.bvh").write_text(text.replace(old, new))
    with pytest.raises(posekit.InputError, match=message):
        posekit.open(tmp_path / "bad.bvh")


def test_a_damaged_bvh_file_is_refused_with_its_line(tmp_path: Path) -> None:
    lines = bvh_of(walking(), tmp_path).split("\n")
    lines[-5] = "1.0 2.0"
    (tmp_path / "bad.bvh").write_text("\n".join(lines))
    with pytest.raises(posekit.InputError, match=f"line {len(lines) - 4}: .*2 values"):
        posekit.open(tmp_path / "bad.bvh")


def test_a_bvh_file_with_fewer_frames_than_it_states_says_so(tmp_path: Path) -> None:
    text = bvh_of(walking(), tmp_path)
    (tmp_path / "cut.bvh").write_text(text[: text.rstrip().rfind("\n") + 1])
    motion = posekit.open(tmp_path / "cut.bvh")
    assert len(motion) == 23 and "Frames is 24, but the file has 23" in motion.warnings[0]


def test_a_file_is_known_by_its_start_whatever_its_name(tmp_path: Path) -> None:
    text = bvh_of(walking(), tmp_path)
    (tmp_path / "walk.txt.bak").write_text(text)
    assert len(posekit.open(tmp_path / "walk.txt.bak")) == 24


# TRC and MOT


def trc_of(motion: Any, folder: Path) -> list[str]:
    posekit.save(motion, folder / "walk.trc")
    return (folder / "walk.trc").read_text().split("\n")


SPELLINGS: dict[str, Any] = {
    "CRLF": "\r\n".join,
    "commas": lambda lines: "\n".join(lines).replace("\t", ","),
    "no blank line": lambda lines: "\n".join(lines[:5] + lines[6:]),
    "Times": lambda lines: "\n".join(lines).replace("\tTime\t", "\tTimes\t"),
    "Frame": lambda lines: "\n".join(lines).replace("Frame#", "Frame"),
    "quoted unit": lambda lines: "\n".join(lines).replace("\tm\t", '\t"m"\t'),
    "unit in words": lambda lines: "\n".join(lines).replace("\tm\t", "\tMeters\t"),
    "empty NumMarkers": lambda lines: "\n".join(lines).replace("\t24\t19\t", "\t24\t\t"),
    "decimal commas": lambda lines: "\n".join([*lines[:2], *(line.replace(".", ",") for line in lines[2:])]),
    "names once": lambda lines: "\n".join([*lines[:3], lines[3].replace("\t\t\t", "\t"), *lines[4:]]),
    "spaces": lambda lines: "\n".join(
        [*(" ".join(line.split()) for line in lines[:3]), " ".join(lines[3].split()), *lines[4:]]
    ).replace("\t", " "),
    "prefix": lambda lines: "\n".join([*lines[:3], lines[3].replace("\t\t\t", "\t\t\tS1:"), *lines[4:]]),
    "tabs at the ends": lambda lines: "\n".join(f"{line}\t" for line in lines),
}


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_spellings_of_trc_read_alike(tmp_path: Path, spelling: str) -> None:
    lines = trc_of(walking(), tmp_path)
    plain = posekit.open(tmp_path / "walk.trc")
    (tmp_path / "other.trc").write_text(SPELLINGS[spelling](lines), newline="")
    other = posekit.open(tmp_path / "other.trc")
    assert np.array_equal(other.joints, plain.joints)
    assert np.array_equal(other.time, plain.time)


@pytest.mark.parametrize("cell", ["", "nan", "NaN", "-", "0.000000000"])
def test_missing_cells_are_unknown_joints(tmp_path: Path, cell: str) -> None:
    lines = trc_of(walking(), tmp_path)
    column = 2 + 3 * POINTS.index("left_wrist")
    for row in (9, 12):
        cells = lines[6 + row].split("\t")
        cells[column : column + 3] = [cell] * 3
        lines[6 + row] = "\t".join(cells)
    (tmp_path / "gaps.trc").write_text("\n".join(lines))
    unknown = np.isnan(posekit.open(tmp_path / "gaps.trc").points(["left_wrist"])).all(axis=(1, 2))
    assert np.flatnonzero(unknown).tolist() == [9, 12]


@pytest.mark.parametrize("frames", [slice(0, 5), slice(0, None, 2), slice(7, 8), slice(None)])
def test_a_root_at_the_origin_is_known_and_a_lost_one_is_not(tmp_path: Path, frames: slice) -> None:
    joints = np.array(walking().joints)
    pelvis = JOINTS.index("pelvis")
    centred = joints.copy()
    centred[frames] -= centred[frames, pelvis, None]
    found = posekit.open(npz(tmp_path, centred, up="+z", fps=RATE))
    assert np.array_equal(found.points(POINTS), centred)
    if frames != slice(None):
        joints[frames, pelvis] = 0.0
        lost = np.isnan(posekit.open(npz(tmp_path, joints, up="+z", fps=RATE)).points(["pelvis"])[:, 0, 0])
        assert np.array_equal(np.flatnonzero(lost), np.arange(len(joints))[frames])


def test_times_that_contradict_the_rate_are_said(tmp_path: Path) -> None:
    lines = trc_of(walking(), tmp_path)
    lines[2] = lines[2].replace("30\t30", "100\t100", 1)
    (tmp_path / "wrong.trc").write_text("\n".join(lines))
    motion = posekit.open(tmp_path / "wrong.trc")
    assert motion.rate == pytest.approx(RATE)
    assert any("contradict the file's rate 100" in warning for warning in motion.warnings)
    assert any(
        "contradict --rate" in warning for warning in posekit.open(tmp_path / "walk.trc", rate=60).warnings
    )


def test_times_of_three_decimals_are_taken_for_what_they_round(tmp_path: Path) -> None:
    motion = walking()
    posekit.save(replace(motion, time=np.round(motion.time, 3)), tmp_path / "rounded.trc")
    assert np.abs(posekit.open(tmp_path / "rounded.trc").time - motion.time).max() < 1e-9


def test_a_marker_set_without_joints_is_read_and_said(tmp_path: Path) -> None:
    lines = trc_of(walking(), tmp_path)
    lines[3] = "\t".join(f"M{k}" if k > 1 and cell else cell for k, cell in enumerate(lines[3].split("\t")))
    (tmp_path / "markers.trc").write_text("\n".join(lines))
    motion = posekit.open(tmp_path / "markers.trc")
    assert motion.joint_names == () and "no joints among 19 markers" in motion.warnings[0]


def test_hips_come_from_the_pelvis_markers(tmp_path: Path) -> None:
    """The regression of Bell et al. 1989, computed here for a pelvis 24 cm wide that looks along x."""
    pelvis = {"RASI": (0.1, 1.0, 0.12), "LASI": (0.1, 1.0, -0.12), "SACR": (-0.1, 1.0, 0.0)}
    limbs = {"RSH": (0, 1.4, 0.2), "RELB": (0, 1.1, 0.2), "RWR": (0, 0.9, 0.2), "RLEPI": (0, 0.5, 0.1)}
    limbs |= {"RLMAL": (0, 0.1, 0.1)}
    limbs |= {f"L{name[1:]}": (x, y, -z) for name, (x, y, z) in limbs.items()}
    markers = {**pelvis, **limbs}
    titles = "\t".join(["Frame#", "Time", *(cell for name in markers for cell in (name, "", ""))])
    row = "\t".join(repr(float(value)) for place in markers.values() for value in place)
    head = ["PathFileType\t4\t(X/Y/Z)\tx", "DataRate\tUnits", "100\tm", titles, ""]
    rows = [f"{k + 1}\t{k / 100}\t{row}" for k in range(3)]
    (tmp_path / "lab.trc").write_text("\n".join([*head, *rows]))
    motion = posekit.open(tmp_path / "lab.trc")
    expected = [0.1 - 0.19 * 0.24, 1.0 - 0.30 * 0.24, 0.36 * 0.24]
    assert np.allclose(motion.points(["right_hip"])[0, 0], expected, atol=1e-12)
    assert np.allclose(motion.points(["left_hip"])[0, 0, 2], -expected[2], atol=1e-12)


@pytest.mark.parametrize(("stated", "scale"), [("yes", np.pi / 180), ("no", 1.0)])
def test_opensims_angles_are_read(tmp_path: Path, stated: str, scale: float) -> None:
    head = f"Coordinates\nversion=1\nnRows=2\nnColumns=4\ninDegrees={stated}\nendheader\n"
    rows = "time\tpelvis_tilt\tpelvis_tx\tknee_angle_r\n0.0\t10\t0.5\t-20\n0.01\t11\t0.6\t-21\n"
    (tmp_path / "ik.mot").write_text(head + rows)
    motion = posekit.open(tmp_path / "ik.mot")
    assert any("give a URDF" in note for note in motion.notes)
    assert not any("give a URDF" in note for note in posekit.open(tmp_path / "ik.mot", urdf="human").notes)
    assert motion.q_names == ("pelvis_tilt", "pelvis_tx", "knee_angle_r")
    assert np.allclose(motion.q[1], [11 * scale, 0.6, -21 * scale])


# Arrays, pickles, tables


@pytest.mark.parametrize("key", ["joints", "keypoints_3d", "positions_3d", "poses_3d", "arr_0", "anything"])
@pytest.mark.parametrize("layout", ["h36m_17", "coco_17", "smpl_22", "mediapipe_33", "soma_77", "mhr_70"])
def test_arrays_without_names_are_recognised_by_the_body(tmp_path: Path, key: str, layout: str) -> None:
    cloud, motion = cloud_of(layout)
    np.savez(tmp_path / "cloud.npz", **{key: cloud}, fps=RATE)
    found = posekit.open(tmp_path / "cloud.npz")
    assert found.layout == layout and found.rate == pytest.approx(RATE)
    shared = [name for name in found.joint_names if name in LIMBS]
    assert np.allclose(found.points(shared), motion.points(shared), atol=1e-12) and len(shared) == 12


LIMBS = [name for name in JOINTS if name.startswith(("right", "left"))]


def cloud_of(name: str) -> tuple[Any, Any]:
    """Return the points of a layout (T, P, 3) on a walking figure; points that it does not map lie in the trunk."""
    from posekit.formats.layout import load_layout

    layout, motion = load_layout(name), walking()
    middle = motion.points(["neck", "pelvis"]).mean(axis=1)
    cloud = np.repeat(middle[:, None], len(layout.points), axis=1)
    girdles = {
        f"mid_{part}s": motion.points([f"right_{part}", f"left_{part}"]) for part in ("shoulder", "hip")
    }
    for ours, parts in sorted(layout.sources.items(), key=lambda one: -len(one[1])):
        place = girdles[ours].mean(axis=1) if ours in girdles else motion.points([ours])[:, 0]
        if ours not in FEET_POINTS and len(parts) == 1:
            cloud[:, layout.points.index(parts[0])] = place
    return cloud, motion


def test_an_error_about_a_shape_names_the_remedy(tmp_path: Path) -> None:
    np.save(tmp_path / "flat.npy", np.zeros((10, 17, 2)))
    with pytest.raises(posekit.InputError, match=r"points in pictures: recover them"):
        posekit.open(tmp_path / "flat.npy")
    np.save(tmp_path / "odd.npy", np.random.default_rng(0).normal(size=(10, 21, 3)))
    with pytest.raises(posekit.InputError, match=r"--layout"):
        posekit.open(tmp_path / "odd.npy")


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_points_in_a_picture_have_one_cause(tmp_path: Path, axis: int) -> None:
    cloud = np.random.default_rng(1).normal(size=(20, 33, 3))
    cloud[..., axis] = 0.0
    np.save(tmp_path / "flat.npy", cloud)
    with pytest.raises(posekit.InputError, match=f"{'xyz'[axis]} coordinate: got 0 for every joint"):
        posekit.open(tmp_path / "flat.npy")


@pytest.mark.parametrize("sentinel", [0.0, -1.0, 9999.0])
def test_a_constant_in_some_frames_is_a_missing_joint(tmp_path: Path, sentinel: float) -> None:
    motion = walking()
    joints = np.array(motion.joints)
    joints[4:8, JOINTS.index("right_knee")] = sentinel
    np.savez(tmp_path / "gaps.npz", joints=joints, joint_names=np.array(POINTS), fps=RATE)
    found = posekit.open(tmp_path / "gaps.npz")
    unknown = np.isnan(found.points(["right_knee"]))[:, 0, 0]
    assert np.flatnonzero(unknown).tolist() == [4, 5, 6, 7]
    assert any("right_knee is missing in 4 of 24 frames" in note for note in found.notes)


def test_a_root_at_the_origin_is_not_missing(tmp_path: Path) -> None:
    cloud, _ = cloud_of("h36m_17")
    np.save(tmp_path / "lifted.npy", cloud - cloud[:, :1])
    motion = posekit.open(tmp_path / "lifted.npy", rate=50)
    assert np.isfinite(motion.figure_joints).all() and not motion.in_world


@pytest.mark.parametrize("dump", ["pickle", "object array", "torch"])
def test_pickles_of_arrays_are_read(tmp_path: Path, dump: str) -> None:
    motion = squatting()
    clip = {"fps": 30, "root_pos": motion.q[:, :3], "root_rot": motion.q[:, 3:7], "dof_pos": motion.q[:, 7:]}
    if dump == "pickle":
        file = tmp_path / "clip.pkl"
        file.write_bytes(pickle.dumps({"a_clip": {**clip, "link_body_list": None}}))
    elif dump == "object array":
        file = tmp_path / "clip.npy"
        np.save(file, np.array(clip, dtype=object), allow_pickle=True)
    else:
        file = tmp_path / "clip.pt"
        file.write_bytes(torch_zip(clip))
    found = posekit.open(file)
    assert np.abs(found.q - motion.q).max() < 1e-15 and found.rate == pytest.approx(RATE)


def torch_zip(arrays: dict[str, Any]) -> bytes:
    """Write arrays as `torch.save` does, by the layout of its zip files."""

    class Storage:
        told: Any

    class Pickler(pickle.Pickler):
        def persistent_id(self, thing: Any) -> Any:
            return thing.told if isinstance(thing, Storage) else None

    class Tensor:
        values: Any
        storage: Any

        def __reduce__(self) -> Any:
            shape = self.values.shape
            strides = tuple(step // 8 for step in self.values.strides)
            return rebuild, (self.storage, 0, shape, strides, False, None)

    module = type(sys)("torch")
    inner = type(sys)("torch._utils")
    kind = type("DoubleStorage", (), {"__module__": "torch"})

    def rebuild(*_: Any) -> None:
        """Stand for torch's function of that name."""

    rebuild.__module__, rebuild.__qualname__, rebuild.__name__ = "torch._utils", *["_rebuild_tensor_v2"] * 2
    module.DoubleStorage, inner._rebuild_tensor_v2 = kind, rebuild  # type: ignore[attr-defined]
    stored: dict[str, bytes] = {}
    document: dict[str, Any] = {}
    for key, value in arrays.items():
        document[key] = value
        if isinstance(value, np.ndarray):
            tensor = document[key] = Tensor()
            tensor.values, tensor.storage = np.ascontiguousarray(value), Storage()
            tensor.storage.told = ("storage", kind, str(len(stored)), "cpu", value.size)
            stored[str(len(stored))] = tensor.values.tobytes()
    text, file = io.BytesIO(), io.BytesIO()
    before = {name: sys.modules.get(name) for name in ("torch", "torch._utils")}
    sys.modules |= {"torch": module, "torch._utils": inner}
    try:
        Pickler(text, 2).dump(document)
    finally:
        for name, one in before.items():
            sys.modules.pop(name) if one is None else sys.modules.update({name: one})
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("archive/data.pkl", text.getvalue())
        for name, body in stored.items():
            archive.writestr(f"archive/data/{name}", body)
    return file.getvalue()


class Runs:
    """An object whose pickle runs a function."""

    def __init__(self, function: Any, *arguments: Any) -> None:
        self.call = function, arguments

    def __reduce__(self) -> Any:
        return self.call


@pytest.mark.parametrize("call", [(os.mkdir, "made"), (eval, "1"), (bytes, 10**12), (getattr, "a", "upper")])
@pytest.mark.parametrize("ending", [".pkl", ".npy", ".npz", ".pt"])
def test_no_pickle_runs_code(tmp_path: Path, monkeypatch: Any, call: Any, ending: str) -> None:
    monkeypatch.chdir(tmp_path)
    thing, file = {"joints": [Runs(*call)]}, tmp_path / f"bad{ending}"
    if ending == ".pkl":
        file.write_bytes(pickle.dumps(thing))
    elif ending == ".pt":
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("archive/data.pkl", pickle.dumps(thing))
    else:
        save = np.save if ending == ".npy" else np.savez
        save(file, np.array(thing, dtype=object), allow_pickle=True)
    with pytest.raises(posekit.InputError, match=r"pickle with|damaged"):
        posekit.open(file)
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize("order", ["xyzw", "wxyz"])
@pytest.mark.parametrize("yaw", [0, 30, 120, 150, 165, -170])
def test_the_order_of_a_quaternion_is_found(tmp_path: Path, yaw: float, order: str) -> None:
    motion = squatting(yaw=np.radians(yaw))
    rows = np.array(motion.q)
    if order == "wxyz":
        rows[:, 3:7] = rows[:, [6, 3, 4, 5]]
    np.savetxt(tmp_path / "rows.csv", rows, delimiter=",", fmt="%.12f")
    found = posekit.open(tmp_path / "rows.csv", rate=RATE)
    assert np.abs(found.q - motion.q).max() < 1e-9
    assert any("quaternion is read as" in text for text in (*found.notes, *found.warnings))


TABLES: dict[str, Any] = {
    "spaces": lambda text: text.replace(",", " "),
    "semicolons": lambda text: text.replace(",", ";"),
    "decimal commas": lambda text: text.replace(",", ";").replace(".", ","),
    "index": lambda text: "\n".join(f"{k},{line}" for k, line in enumerate(text.splitlines())),
    "time": lambda text: "\n".join(f"{k / RATE:.6f},{line}" for k, line in enumerate(text.splitlines())),
}


@pytest.mark.parametrize("spelling", TABLES)
def test_spellings_of_a_robots_rows_read_alike(tmp_path: Path, spelling: str) -> None:
    motion = squatting(yaw=0.6)
    text = "\n".join(",".join(f"{value:.9f}" for value in row) for row in motion.q.tolist())
    (tmp_path / "rows.csv").write_text(TABLES[spelling](text))
    assert np.abs(posekit.open(tmp_path / "rows.csv").q - motion.q).max() < 1e-8


@pytest.mark.parametrize(("size", "degrees"), [(6.5, False), (7.5, True), (13.0, True)])
def test_angles_of_more_than_a_turn_are_degrees(tmp_path: Path, size: float, degrees: bool) -> None:
    motion = squatting()
    rows, knee = np.array(motion.q), motion.q_names.index("left_knee_joint")
    rows[:, 7:] = 0.0
    rows[:, knee] = size
    np.savetxt(tmp_path / "rows.csv", rows, delimiter=",")
    found = posekit.open(tmp_path / "rows.csv", rate=RATE)
    np.testing.assert_allclose(found.q[:, knee], np.radians(size) if degrees else size)


def test_joints_that_a_robots_table_lacks_are_neutral_and_said(tmp_path: Path) -> None:
    motion = squatting(yaw=0.6)
    from posekit.formats.layout import load_layout

    used = [motion.q_names.index(name) for name in load_layout("g1_23").fields["joints"]]
    np.savetxt(tmp_path / "g1.csv", motion.q[:, [*range(7), *used]], delimiter=",")
    found = posekit.open(tmp_path / "g1.csv")
    assert found.robot == "g1" and found.q_names == tuple(motion.q_names[k] for k in [*range(7), *used])
    q, notes = posekit.load_robot("g1").q_from_columns(found.q_names, found.q)
    assert np.allclose(q, motion.q)
    assert any("waist_roll_joint" in note and "neutral" in note for note in notes)
    report = posekit.validate(tmp_path / "g1.csv", rate=30)
    assert any("waist_roll_joint" in note for note in report.notes)


def test_bones_seed_is_in_centimetres_and_degrees(tmp_path: Path) -> None:
    names = ["Frame", *(f"root_translate{a}" for a in "XYZ"), *(f"root_rotate{a}" for a in "XYZ")]
    names += ["left_knee_joint_dof", "right_knee_joint_dof"]
    rows: list[list[Any]] = [[k, 10, 0, 79, 0, 0, 90, 30, 0] for k in range(3)]
    text = "\n".join(",".join(map(str, row)) for row in [names, *rows])
    (tmp_path / "seed.csv").write_text(text)
    motion = posekit.open(tmp_path / "seed.csv", rate=120)
    half = np.sqrt(0.5)
    assert np.allclose(motion.q[0, :7], [0.1, 0, 0.79, 0, 0, half, half])
    assert np.allclose(motion.q[:, motion.q_names.index("left_knee_joint")], np.pi / 6)


@pytest.mark.parametrize("depth_first", [False, True])
def test_a_simulators_joints_are_ordered_by_its_bodies(tmp_path: Path, depth_first: bool) -> None:
    from posekit.formats.layout import load_layout

    motion = squatting()
    order = load_layout("g1_29" if depth_first else "g1_29_isaac").fields["joints"]
    bodies = np.repeat(motion.q[:, None, :3], 30, axis=1)
    bodies[:, 1] += [0.0, 0.06, -0.1]
    bodies[:, 2] += [0.0, 0.12, -0.13] if depth_first else [0.0, -0.06, -0.1]
    turns = np.repeat(motion.q[:, None, [6, 3, 4, 5]], 30, axis=1)
    joints = motion.q[:, [motion.q_names.index(name) for name in order]]
    np.savez(tmp_path / "run.npz", fps=[30], joint_pos=joints, body_pos_w=bodies, body_quat_w=turns)
    found = posekit.open(tmp_path / "run.npz")
    assert np.allclose(found.q[:, [found.q_names.index(name) for name in motion.q_names]], motion.q)


def test_a_robot_in_a_world_with_y_up_is_said(tmp_path: Path) -> None:
    motion = squatting()
    q = np.array(motion.q)
    q[:, :3] = q[:, [0, 2, 1]] * [1.0, 1.0, -1.0]
    q[:, 3:7] = [-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
    np.savez(tmp_path / "yup.npz", fps=30, root_pos=q[:, :3], root_rot=q[:, 3:7], dof_pos=q[:, 7:])
    found = posekit.open(tmp_path / "yup.npz")
    assert found.up == "+y" and any("stands along +y" in warning for warning in found.warnings)


def test_smpl_angles_are_placed_with_unchanged_bone_lengths(tmp_path: Path) -> None:
    poses = np.random.default_rng(2).normal(scale=0.4, size=(6, 72))
    poses[:, :3] = 0.0
    trans = np.cumsum(np.full((6, 3), 0.1), axis=0)
    np.savez(tmp_path / "amass.npz", poses=poses, trans=trans, betas=np.zeros(10), mocap_framerate=120.0)
    motion = posekit.open(tmp_path / "amass.npz")
    thigh = np.linalg.norm(np.diff(motion.points(["left_hip", "left_knee"]), axis=1), axis=-1)
    assert motion.layout == "smpl_22" and motion.rate == pytest.approx(120) and np.ptp(thigh) < 1e-12
    knee = motion.points(["left_hip", "left_knee"])[:, 1] - motion.points(["left_hip", "left_knee"])[:, 0]
    turn = np.linalg.norm(poses[:, 3:6], axis=1)
    R = rotation_about(poses[:, 3:6] / turn[:, None], turn)
    assert np.allclose(np.einsum("tji,tj->ti", R, knee), knee[0] @ R[0], atol=1e-12)


@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
def test_the_unit_of_points_is_told_by_the_body(tmp_path: Path, unit: str) -> None:
    motion = walking()
    scale = {"m": 1.0, "cm": 100.0, "mm": 1000.0}[unit]
    np.savez(tmp_path / "x.npz", joints=motion.joints * scale, joint_names=np.array(POINTS), fps=RATE)
    found = posekit.open(tmp_path / "x.npz")
    assert found.unit == unit and np.allclose(found.joints, motion.joints)


def test_a_stated_unit_that_no_body_fits_is_corrected_and_said(tmp_path: Path) -> None:
    motion = walking()
    arrays = {"joints": motion.joints, "joint_names": np.array(POINTS), "unit": "mm", "fps": RATE}
    np.savez(tmp_path / "x.npz", **arrays)
    found = posekit.open(tmp_path / "x.npz")
    assert np.allclose(found.joints, motion.joints) and "in mm, as stated" in found.warnings[0]


@pytest.mark.parametrize("up", ["+x", "-x", "+y", "-y", "+z", "-z"])
def test_the_up_axis_is_told_by_how_bodies_stand(tmp_path: Path, up: str) -> None:
    motion = walking().rotated(up)
    arrays = {"joints": motion.joints, "joint_names": np.array(POINTS), "fps": RATE}
    np.savez(tmp_path / "x.npz", **arrays)
    assert posekit.open(tmp_path / "x.npz").up == up
    np.savez(tmp_path / "stated.npz", **arrays, up="+y")
    stated = posekit.open(tmp_path / "stated.npz")
    assert stated.up == "+y" and bool(stated.warnings) == (up != "+y")
    assert posekit.open(tmp_path / "stated.npz", up=up).up == up
    assert posekit.open(tmp_path / "stated.npz", up=up[1:]).up == f"+{up[1:]}"


@pytest.mark.parametrize(
    "wrong", [{"up": "w"}, {"up": "y+"}, {"unit": "km"}, {"rate": 0.0}, {"rate": np.inf}]
)
def test_wrong_options_are_refused_by_name(tmp_path: Path, wrong: dict[str, Any]) -> None:
    file = npz(tmp_path, walking().joints)
    with pytest.raises(posekit.InputError, match=f"{next(iter(wrong))}: got"):
        posekit.open(file, **wrong)


def test_a_person_on_the_head_is_said_in_formats_with_a_custom(tmp_path: Path) -> None:
    lines = trc_of(replace(walking().rotated("-y"), up=""), tmp_path)
    assert lines
    found = posekit.open(tmp_path / "walk.trc")
    assert found.up == "-y" and any("against +y by convention" in warning for warning in found.warnings)


def test_frames_that_were_left_out_keep_their_place(tmp_path: Path) -> None:
    motion = walking()
    kept = [0, 1, 2, 7, 8]
    names = [f"{name}_{axis}" for name in POINTS for axis in "xyz"]
    rows = [[k + 5, *motion.joints[k].ravel().tolist()] for k in kept]
    text = "\n".join(",".join(map(str, row)) for row in [["fnum", *names], *rows])
    (tmp_path / "anipose.csv").write_text(text)
    found = posekit.open(tmp_path / "anipose.csv", rate=RATE)
    assert found.frame.tolist() == kept and np.allclose(found.time, motion.time[kept])


def test_clips_of_several_rates_keep_their_times(tmp_path: Path) -> None:
    motion = walking()
    clip = np.repeat([0, 1], 12)
    arrays = {
        "joints": motion.joints,
        "joint_names": np.array(POINTS),
        "clip": clip,
        "clip_fps": [30.0, 60.0],
    }
    np.savez(tmp_path / "x.npz", **arrays, clip_names=np.array(["a", "b"]), up="+z")
    found = posekit.open(tmp_path / "x.npz")
    assert [part.rate for _, part in found.recordings()] == pytest.approx([30.0, 60.0])
    assert [name for name, _ in found.recordings()] == ["a", "b"]


@pytest.mark.parametrize("name", ["x.abc", "missing.bvh", "folder.bvh"])
def test_what_is_no_file_of_ours_is_refused_in_one_line(tmp_path: Path, name: str) -> None:
    (tmp_path / "folder.bvh").mkdir()
    (tmp_path / "x.abc").write_text("?")
    with pytest.raises(posekit.InputError) as caught:
        posekit.open(tmp_path / name)
    assert "\n" not in str(caught.value) and name in str(caught.value)


def test_a_gzip_file_that_unpacks_without_end_is_refused(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr("posekit.files.MAX_BYTES", 1_000_000)
    (tmp_path / "big.csv.gz").write_bytes(gzip.compress(b"0" * 5_000_000))
    with pytest.raises(posekit.InputError, match="more than 1,000,000 bytes"):
        posekit.open(tmp_path / "big.csv.gz")


@pytest.mark.parametrize("ending", [".bvh", ".trc", ".csv", ".npz", ".c3d", ".parquet", ".pkl", ".npy"])
def test_damaged_files_raise_nothing_but_our_errors(tmp_path: Path, ending: str) -> None:
    motion, rng = walking(6), np.random.default_rng(3)
    file = tmp_path / f"walk{ending}"
    if ending == ".pkl":
        file.write_bytes(pickle.dumps({"joints": motion.joints, "names": list(POINTS)}))
    elif ending == ".npy":
        np.save(file, motion.joints)
    else:
        posekit.save(motion, file)
    whole = np.frombuffer(file.read_bytes(), dtype=np.uint8)
    for trial in range(60):
        damaged = whole.copy()
        places = rng.integers(0, min(len(whole), 1500) if trial % 2 else len(whole), size=1 + trial % 5)
        damaged[places] = rng.integers(0, 256, size=len(places))
        file.write_bytes(damaged[: rng.integers(1, len(whole)) if trial % 7 == 0 else None].tobytes())
        try:
            posekit.open(file)
        except posekit.PosekitError:
            continue


def npz(folder: Path, joints: Any, **about: Any) -> Path:
    """Write an array file of the figure's 19 points."""
    np.savez(folder / "x.npz", joints=joints, joint_names=np.array(POINTS), **about)
    return folder / "x.npz"


@pytest.mark.parametrize(
    ("size", "stated", "unit", "said"),
    [
        *((size, "", "m", "") for size in (0.21, 1.7, 4.9)),
        *((size, "", "m", "check the unit") for size in (0.19, 5.1, 15.0, 45.0, 90.0, 260.0, 390.0, 2600.0)),
        *((size, "", "in", "lengths are in in") for size in (16.0, 48.0, 67.0, 86.0)),
        *((size, "", "cm", "lengths are in cm") for size in (100.0, 170.0, 240.0)),
        *((size, "", "mm", "lengths are in mm") for size in (410.0, 1700.0, 2450.0)),
        *((170.0, stated, "cm", f"in {stated}, as stated, it would be") for stated in ("m", "mm")),
        *((170.0, stated, stated, "") for stated in ("cm", "in")),
        (25.0, "mm", "in", "in mm, as stated"),
        (8.0, "cm", "cm", "0.08 m tall"),
    ],
)
def test_the_unit_is_that_in_which_a_body_has_its_size(
    tmp_path: Path, size: float, stated: str, unit: str, said: str
) -> None:
    """`size` is the stature by the limbs, in the file's unit; units are those of Drillis & Contini's shares."""
    joints = walking().joints
    shares = {
        ("hip", "knee"): 0.245,
        ("knee", "ankle"): 0.246,
        ("shoulder", "elbow"): 0.186,
        ("elbow", "wrist"): 0.146,
    }
    ends = [[joints[0, JOINTS.index(f"left_{part}")] for part in pair] for pair in shares]
    limbs = [np.linalg.norm(a - b) / share for (a, b), share in zip(ends, shares.values(), strict=True)]
    scale = size / np.median(limbs)
    found = posekit.open(
        npz(tmp_path, joints * scale, **({"unit": stated} if stated else {}), fps=RATE, up="+z")
    )
    metres = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}[unit]
    np.testing.assert_allclose(found.joints, joints * scale * metres, rtol=1e-12)
    assert found.unit == unit
    texts = [text for text in (*found.notes, *found.warnings) if "tall by its limbs" in text]
    assert len(texts) == bool(said) and all(said in text for text in texts)


EVEN = np.arange(24) / RATE
TWICE = np.sort(np.r_[EVEN[:23], EVEN[7]])


@pytest.mark.parametrize(
    ("about", "rate", "time", "said"),
    [
        ({"time": EVEN}, None, EVEN, ""),
        ({"time": EVEN + 5}, None, EVEN + 5, ""),
        ({"time": EVEN, "fps": 32.0}, None, EVEN, ""),
        ({"time": EVEN, "fps": 33.5}, None, EVEN, "contradict the file's rate 33.5"),
        ({"time": EVEN, "fps": 26.5}, None, EVEN, "contradict the file's rate 26.5"),
        ({"time": EVEN}, 28.0, EVEN, ""),
        ({"time": EVEN}, 60.0, EVEN, "contradict --rate 60"),
        ({"time": TWICE}, None, TWICE, "times do not increase at 1 of 23 steps"),
        ({"time": EVEN[::-1].copy(), "fps": 30.0}, None, EVEN, "the rate is used instead"),
        ({"time": EVEN[::-1].copy()}, None, EVEN[::-1], "times do not increase at 23 of 23 steps"),
        ({"time": np.zeros(24)}, 60.0, EVEN / 2, "the rate is used instead"),
        ({"time": np.full(24, np.nan), "fps": 15.0}, None, 2 * EVEN, ""),
        ({"fps": 30.0}, None, EVEN, ""),
        ({"fps": 30.0}, 30.0, EVEN, ""),
        ({"fps": 30.0}, 60.0, EVEN / 2, "--rate 60 is used in place of the file's 30"),
        ({"fps": 0.0}, 60.0, EVEN / 2, ""),
        ({"fps": 0.5}, None, EVEN * 60, ""),
        ({"fps": -30.0}, None, None, "no times and no rate above 0"),
        ({"fps": np.inf}, None, None, "no times and no rate above 0"),
        ({}, None, None, "no times and no rate above 0"),
        ({"fps": 30.0, "frame": np.arange(24) * 2}, None, 2 * EVEN, ""),
        ({"fps": 30.0, "clip": np.repeat([0, 1, 2], 8)}, None, np.tile(EVEN[:8], 3), ""),
        ({"time": np.tile(EVEN[:8], 3), "clip": np.repeat([0, 1, 2], 8)}, None, np.tile(EVEN[:8], 3), ""),
        *(({"time": np.round(EVEN, digits)}, None, EVEN, "rounded to") for digits in (2, 3)),
        *(({"time": np.round(EVEN, digits)}, None, EVEN, "") for digits in (4, 5, 6)),
        ({"time": np.round(EVEN, 7)}, None, np.round(EVEN, 7), ""),
        ({"time": np.round(np.arange(24) / 29.97, 3), "fps": 29.97}, None, np.arange(24) / 29.97, "1/29.97 s"),
        ({"time": np.arange(24) / 25}, None, np.arange(24) / 25, ""),
        ({"time": np.round(EVEN, 3) + 0.002 * (EVEN == EVEN[9])}, None, None, ""),
    ],
)  # fmt: skip
def test_times_are_the_files_or_the_rates_and_contradictions_are_said(
    tmp_path: Path, about: dict[str, Any], rate: float | None, time: Any, said: str
) -> None:
    found = posekit.open(npz(tmp_path, walking().joints, up="+z", **about), rate=rate)
    if time is None and "time" in about:
        time = about["time"]
    if time is None:
        assert np.isnan(found.time).all()
    else:
        np.testing.assert_allclose(found.time, time, atol=1e-12)
    texts = [*found.warnings, *(note for note in found.notes if "time" in note)]
    assert len(texts) == bool(said) and all(said in text for text in texts)


def crawling(forward: float, rises: tuple[float, float] = (0.0, 0.0)) -> Any:
    """Return a person who lies along x, goes `forward` metres along it, and sways along y and z."""
    joints = walking().rotated("+x").joints[:1].repeat(24, axis=0)
    way = np.linspace(0, 1, 24) / 0.9  # percentiles leave out a tenth
    return joints - joints[:, :1] + (way[:, None] * [forward, *rises])[:, None]


@pytest.mark.parametrize(
    ("forward", "rises", "stated", "up", "said"),
    [
        (0.0, (0.0, 0.0), "", "+x", "+x is up, because bodies stand along it"),
        (0.59, (0.0, 0.0), "", "+x", "+x is up, because bodies stand along it"),
        (1.0, (0.16, 0.17), "", "+x", "+x is up, because bodies stand along it"),
        (0.61, (0.3, 0.0), "", "+z", "+z is up by the ground: the height of the lowest joint"),
        (1.0, (0.04, 0.5), "", "+y", "+y is up by the ground"),
        (1.0, (0.21, 0.1), "", "+z", "+z is up by the ground"),
        (1.0, (0.19, 0.1), "", "", "the up axis is unknown"),
        (0.0, (0.0, 0.0), "+z", "+z", "the person is lying in most frames if +z is up"),
        (0.61, (0.0, 0.0), "+z", "+z", ""),
        (0.0, (0.0, 0.0), "-x", "-x", "the person is upside down in most frames if -x is up"),
        (0.0, (0.0, 0.0), "+x", "+x", ""),
    ],
)
def test_the_up_axis_of_a_person_that_lies_is_told_by_the_ground(
    tmp_path: Path, forward: float, rises: tuple[float, float], stated: str, up: str, said: str
) -> None:
    about = {"up": stated} if stated else {}
    found = posekit.open(npz(tmp_path, crawling(forward, rises), **about, fps=RATE))
    texts = [text for text in (*found.notes, *found.warnings) if " up" in text]
    assert len(texts) == bool(said) and all(said in text for text in texts)
    assert found.up == up


@pytest.mark.parametrize(
    ("beside", "in_world"),
    [(0.0, False), (0.9e-4, False), (1.2e-4, True)],
    ids=["exact", "rounded", "moving"],
)
@pytest.mark.parametrize("root", ["pelvis", "hips"])
def test_postures_relative_to_their_hips_are_no_motion_in_the_world(
    tmp_path: Path, root: str, beside: float, in_world: bool
) -> None:
    motion = walking()
    ends = ["right_hip", "left_hip"] if root == "hips" else ["pelvis"]
    joints = motion.joints - motion.points(ends).mean(axis=1, keepdims=True)
    joints += beside * np.linspace(0.5, 1, len(joints))[:, None, None] * [1.0, 0.0, 0.0]
    found = posekit.open(npz(tmp_path, joints, fps=RATE, up="+z"))
    assert found.in_world is in_world
    assert any("relative to its own hips" in note for note in found.notes) is not in_world


MEDIAPIPE: dict[str, tuple[int, int]] = {
    "shoulder": (12, 11),
    "elbow": (14, 13),
    "wrist": (16, 15),
    "hip": (24, 23),
    "knee": (26, 25),
    "ankle": (28, 27),
}
"""Numbers of the right and the left joint among MediaPipe's 33 landmarks."""


def test_a_row_a_landmark_is_read_by_its_number(tmp_path: Path) -> None:
    """Caliscope's triangulated points: rows in any order, frames from any number, landmarks that are no body's."""
    figure, frames = posekit.load_figure(), range(10, 14)
    place = {
        number: JOINTS.index(f"{side}_{joint}")
        for joint, numbers in MEDIAPIPE.items()
        for side, number in zip(("right", "left"), numbers, strict=True)
    }
    lines = ["sync_index,point_id,x_coord,y_coord,z_coord"]
    joints = np.stack([figure.neutral_points[:14] + np.array([0.01 * frame, 0.0, 1.0]) for frame in frames])
    for frame, body in zip(frames, joints, strict=True):
        for number in (700, *reversed(place)):
            x, y, z = body[place.get(number, 0)]
            if (frame, number) != (12, 15):
                lines.append(f"{frame},{number},{x:.6f},{y:.6f},{z:.6f}")
    (tmp_path / "xyz.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    found = posekit.open(tmp_path / "xyz.csv", rate=30)
    expected = np.array(joints)
    expected[2, JOINTS.index("left_wrist")] = np.nan
    known = list(place.values())
    np.testing.assert_allclose(found.figure_joints[:, known], expected[:, known], atol=1e-6)
    (tmp_path / "twice.csv").write_text("\n".join([*lines, lines[-1]]) + "\n", encoding="utf-8")
    with pytest.raises(posekit.InputError, match="twice"):
        posekit.open(tmp_path / "twice.csv", rate=30)


def test_triangulated_points_with_a_score_are_in_space(tmp_path: Path) -> None:
    """Anipose: x, y, z, error, number of cameras and score of each point, millimetres, and the frame's number."""
    motion = walking()
    limbs = [name for name in JOINTS if name not in ("neck", "pelvis")]
    columns: dict[str, Any] = {}
    for name in limbs:
        columns |= {f"{name}_{axis}": motion.points([name])[:, 0, k] * 1000 for k, axis in enumerate("xyz")}
        columns |= {f"{name}_error": 1.5, f"{name}_ncams": 3, f"{name}_score": 0.9}
    rows = [
        ",".join(str(np.broadcast_to(one, len(motion))[k]) for one in columns.values()) + f",{k}"
        for k in range(len(motion))
    ]
    (tmp_path / "anipose.csv").write_text("\n".join([",".join([*columns, "fnum"]), *rows]) + "\n")
    found = posekit.open(tmp_path / "anipose.csv", rate=RATE)
    assert isinstance(found, Motion) and found.unit == "mm" and found.up == "+z"
    np.testing.assert_allclose(found.points(limbs), motion.points(limbs), atol=1e-9)


@pytest.mark.parametrize(
    ("name", "scale"),
    [
        ("time", 1),
        ("timestamp", 1),
        ("Timestamp", 1e3),
        ("timestamp", 1e6),
        ("time_ms", 1e3),
        ("timestamp", 1e9),
    ],
)
def test_times_are_in_the_unit_of_their_name_or_their_steps(tmp_path: Path, name: str, scale: float) -> None:
    motion = walking()
    points = {
        f"{joint}_{axis}": motion.joints[:, k, i]
        for k, joint in enumerate(POINTS)
        for i, axis in enumerate("xyz")
    }
    columns = {name: 1e6 + np.arange(len(motion)) * scale / 25, **points}
    rows = [",".join(repr(float(one[k])) for one in columns.values()) for k in range(len(motion))]
    (tmp_path / "walk.csv").write_text("\n".join([",".join(columns), *rows]) + "\n")
    np.savez(tmp_path / "walk.npz", **{name: columns[name]}, joints=motion.joints, joint_names=POINTS)
    for ending in ("csv", "npz"):
        assert posekit.open(tmp_path / f"walk.{ending}").rate == pytest.approx(25)


@pytest.mark.parametrize(
    ("angles", "place", "more"),
    [
        ("poses", "trans", {}),
        ("pose", "transl", {}),
        ("smpl_poses", "smpl_trans", {"smpl_scaling": np.array([93.0])}),
        ("pose_world", "trans_world", {"pose": np.ones((6, 72)), "trans": np.zeros((6, 3))}),
    ],
)
def test_smpls_angles_are_read_under_their_names(tmp_path: Path, angles: str, place: str, more: Any) -> None:
    """AMASS, AIST++ (whose place has its own unit), WHAM (whose other angles and places are the camera's)."""
    poses, trans = np.zeros((6, 72)), np.cumsum(np.full((6, 3), 0.1), axis=0)
    poses[:, 48] = 0.4
    arrays = {angles: poses, place: trans * more.get("smpl_scaling", 1.0), **more}
    (tmp_path / "smpl.pkl").write_bytes(pickle.dumps({"one": arrays}))
    np.savez(tmp_path / "amass.npz", poses=poses, trans=trans)
    found, amass = (posekit.open(tmp_path / name, rate=30) for name in ("smpl.pkl", "amass.npz"))
    np.testing.assert_allclose(found.joints, amass.joints, atol=1e-12)


def test_matrices_of_cameras_are_no_points(tmp_path: Path) -> None:
    np.savez(tmp_path / "cameras.npz", cam_poses=np.tile(np.eye(4), (30, 1, 1)))
    with pytest.raises(posekit.InputError, match='got the entries "cam_poses"'):
        posekit.open(tmp_path / "cameras.npz")


@pytest.mark.parametrize("head", ["time,{}", "{}"])
def test_joints_without_a_root_are_read_for_a_stated_robot(tmp_path: Path, head: str) -> None:
    names = posekit.load_robot("panda", bodies="none").configuration_names[7:10]
    q = np.random.default_rng(5).uniform(-1, 1, (4, 3)).round(6)
    times = [f"{k / 20}," if "time" in head else "" for k in range(4)]
    rows = [time + ",".join(map(str, row)) for time, row in zip(times, q.tolist(), strict=True)]
    (tmp_path / "joints.csv").write_text("\n".join([head.format(",".join(names)), *rows]) + "\n")
    with pytest.raises(posekit.InputError, match="got the entries"):
        posekit.open(tmp_path / "joints.csv")
    found = posekit.open(tmp_path / "joints.csv", urdf="panda")
    assert (
        found.robot == "panda" and found.q_names == tuple(names) and found.rate in (None, pytest.approx(20))
    )
    np.testing.assert_array_equal(found.q, q)


def test_several_recordings_in_a_pickle_are_counted(tmp_path: Path) -> None:
    one = {"root_pos": np.zeros((3, 3)), "dof_pos": np.zeros((3, 29))}
    (tmp_path / "two.pkl").write_bytes(pickle.dumps({"walk": one, "run": one}))
    with pytest.raises(posekit.InputError, match=r'got 2 recordings, "walk", "run"; .* a file of its own'):
        posekit.open(tmp_path / "two.pkl")
