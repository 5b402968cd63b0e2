"""Cameras in files: one calibration in every spelling, units told by sizes, and damage refused."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.cameras import PinholeCamera
from posekit.errors import InputError
from posekit.geometry import rotation_from_vector

K = [[910.5, 0.0, 640.25], [0.0, 905.0, 359.5], [0.0, 0.0, 1.0]]
DIST = [-0.25, 0.08, 0.001, -0.0005, 0.01]
RVEC = [1.2, 0.4, -0.3]
R = rotation_from_vector(np.array(RVEC))
T = [0.1, -0.2, 3.5]


def numbers(values: Any) -> str:
    return ", ".join(repr(float(one)) for one in np.ravel(values))


OPENCV = f"""%YAML:1.0
---
calibration_time: "Thu 01 Jan 2026: 12:00" # a comment
image_width: 1280
image_height: 720
flags: 0
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ {numbers(K[0])},
       {numbers(K[1:])} ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ {numbers(DIST)} ]
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ {numbers(R)} ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ {numbers(T)} ]
extrinsic_parameters: [ 1, 2., .5e-1, 3.e+2 ]
"""
ROS = f"""# camera_info
image_width: 1280
image_height: 720
camera_name: narrow
distortion_model: plumb_bob
camera_matrix: {{rows: 3, cols: 3, data: [{numbers(K)}]}}
distortion_coefficients:
  rows: 1
  cols: 5
  data: [{numbers(DIST)}]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
list:
- one
- two: 2
  three: 'iii'
"""
XML = f"""<?xml version="1.0"?>
<opencv_storage>
<camera_matrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt><data>
  {numbers(K).replace(",", "")}</data></camera_matrix>
<distortion_coefficients type_id="opencv-matrix"><rows>5</rows><cols>1</cols><dt>d</dt><data>
  {numbers(DIST).replace(",", "")}</data></distortion_coefficients>
<rvec type_id="opencv-matrix"><rows>3</rows><cols>1</cols><dt>d</dt><data>{numbers(RVEC).replace(",", "")}</data></rvec>
<tvec type_id="opencv-matrix"><rows>3</rows><cols>1</cols><dt>d</dt><data>{numbers(T).replace(",", "")}</data></tvec>
<image_size>1280 720</image_size>
</opencv_storage>
"""
TOML = f"""[cam_01]
name = "left"
size = [ 1280.0, 720.0]
matrix = {K}
distortions = {DIST}
rotation = {RVEC}
translation = {T}
fisheye = false
[metadata]
adjusted = false
"""
JSON = {
    "cameras": [
        {
            "id": "left",
            "K": K,
            "dist": [DIST],
            "R": R.tolist(),
            "t": [[one] for one in T],
            "image_size": [1280, 720],
        }
    ]
}
STEREO = {"K_left": K, "D_left": DIST, "R_left": R.tolist(), "T_left": T, "K_right": K, "size": [1280, 720]}
NO_POSE = ("ros.yaml",)


def write_files(folder: Path) -> None:
    texts = {"opencv.yml": OPENCV, "ros.yaml": ROS, "opencv.xml": XML, "pose2sim.toml": TOML}
    texts |= {"list.json": json.dumps(JSON), "stereo.json": json.dumps(STEREO)}
    for name, text in texts.items():
        (folder / name).write_text(text)
    np.savez(
        folder / "arrays.npz", mtx=np.array(K), dist=np.array([DIST]), rvec=RVEC, tvec=T, size=[1280, 720]
    )


@pytest.mark.parametrize(
    "name",
    ["opencv.yml", "ros.yaml", "opencv.xml", "pose2sim.toml", "list.json", "stereo.json", "arrays.npz"],
)
def test_every_spelling_is_the_same_camera(name: str, tmp_path: Path) -> None:
    write_files(tmp_path)
    cameras = posekit.open(tmp_path / name)
    camera = next(iter(cameras.values()))
    assert camera.K.tolist() == K and camera.distortion.tolist() == DIST and camera.size == (1280, 720)
    if name in NO_POSE:
        assert camera.R is None and camera.t is None
    else:
        assert camera.R == pytest.approx(R, abs=1e-12) and camera.t.tolist() == T
    assert camera.up == ("+z" if name == "pose2sim.toml" else "")
    assert list(cameras) == {
        "stereo.json": ["left", "right"],
        "list.json": ["left"],
        "pose2sim.toml": ["left"],
        "ros.yaml": ["narrow"],
    }.get(name, [name.partition(".")[0]])


@pytest.mark.parametrize(
    ("scale", "unit", "up"),
    [(1.0, None, None), (1000.0, "mm", None), (100.0, "cm", "+y"), (39.37007874015748, "in", None)],
)
def test_the_unit_and_the_up_axis_are_given(
    scale: float, unit: str | None, up: str | None, tmp_path: Path
) -> None:
    text = TOML.replace(str(T), str([scale * one for one in T]))
    (tmp_path / "c.toml").write_text(text)
    camera = posekit.open(tmp_path / "c.toml", unit=unit, up=up)["left"]
    assert camera.t == pytest.approx(T, rel=1e-12)
    assert camera.up == (up or "+z")


def test_millimetres_are_told_by_their_size(tmp_path: Path) -> None:
    (tmp_path / "mm.toml").write_text(TOML.replace(str(T), str([1000 * one for one in T])))
    with pytest.warns(UserWarning, match="translations are read as millimetres"):
        assert posekit.open(tmp_path / "mm.toml")["left"].t == pytest.approx(T)
    (tmp_path / "cm.toml").write_text(TOML.replace(str(T), str([100 * one for one in T])))
    with pytest.raises(InputError, match=r"a camera 351 from the origin.*--unit cm or mm"):
        posekit.open(tmp_path / "cm.toml")


@pytest.mark.parametrize(("far", "unit"), [(99.0, 1.0), (101.0, None), (999.0, None), (1001.0, 1e-3)])
def test_the_unit_of_a_camera_is_told_up_to_100_and_from_1000(
    far: float, unit: float | None, tmp_path: Path
) -> None:
    t = [0.6 * far, 0.0, 0.8 * far]
    (tmp_path / "c.toml").write_text(TOML.replace(str(T), str(t)))
    if unit is None:
        with pytest.raises(InputError, match=f"a camera {far:.0f} from the origin"):
            posekit.open(tmp_path / "c.toml")
        return
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        camera = posekit.open(tmp_path / "c.toml")["left"]
    assert camera.t == pytest.approx([unit * one for one in t]) and len(told) == (unit < 1)


@pytest.mark.parametrize("turn", [0, 1, 2, 3])
def test_quarter_turns_of_the_pictures_tell_which_way_is_up(turn: int, tmp_path: Path) -> None:
    """Caliscope's rotation_count: a camera on its side sees the world's up axis across the picture."""
    level = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    rotation = np.linalg.matrix_power(quarter, -turn) @ level
    text = f"[cam_0]\nport = 0\nsize = [1280, 720]\nrotation_count = {turn}\nmatrix = {K}\ndistortions = {DIST}\n"
    text += f"translation = {T}\nrotation = {rotation.tolist()}\n"
    (tmp_path / "config.toml").write_text(text)
    assert posekit.open(tmp_path / "config.toml")["cam_0"].up == "+z"


@pytest.mark.parametrize("ending", [".toml", ".json"])
def test_cameras_are_read_as_they_were_written(ending: str, tmp_path: Path) -> None:
    written = {
        "left": PinholeCamera(K=K, distortion=DIST, R=R, t=T, size=(1280, 720), up="-y", name="left"),
        "wide": PinholeCamera(
            K=K,
            distortion=[0.1, 0, 0, 0],
            fisheye=True,
            R=R,
            t=T,
            up="-y",
            name="wide",
            how="a guess",
            deviation=0.05,
        ),
    }
    posekit.save(written, tmp_path / f"cameras{ending}")
    found = posekit.open(tmp_path / f"cameras{ending}")
    assert list(found) == list(written)
    for name, camera in written.items():
        for field in ("K", "distortion", "t"):
            assert getattr(found[name], field).tolist() == getattr(camera, field).tolist()
        assert found[name].R == pytest.approx(camera.R, abs=1e-12)
        for field in ("fisheye", "size", "up", "name", "how", "deviation"):
            assert getattr(found[name], field) == getattr(camera, field)


@pytest.mark.parametrize("count", [2, 4, 5, 8, 12, 14])
def test_all_counts_of_coefficients_are_read(count: int, tmp_path: Path) -> None:
    given = [0.1, -0.05, 1e-3, 1e-3, 0.01, 0.02, 0.01, 0.001, 1e-4, 1e-4, 1e-4, 1e-4, 0.01, 0.01][:count]
    (tmp_path / "c.toml").write_text(TOML.replace(str(DIST), str(given)))
    found = posekit.open(tmp_path / "c.toml")["left"].distortion.tolist()
    assert found[:count] == given and not any(found[count:])


@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        ("pose2sim.toml", "910.5", "'wide'", "no 3x3 matrix of intrinsics among cam_01, metadata"),
        ("pose2sim.toml", "fisheye = false", "fisheye = 3", "left.fisheye: got 3; expected true or false"),
        ("pose2sim.toml", str(DIST), "[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]", "6 coefficients"),
        ("pose2sim.toml", str(RVEC), "[1.0, 2.0]", None),
        ("pose2sim.toml", "1280.0", "1280.5", "left.size"),
        (
            "opencv.yml",
            "rows: 5",
            "rows: 4",
            "distortion: got 5 numbers; expected as many as rows and cols say",
        ),
        ("opencv.yml", "flags: 0", "flags: *anchor", "line 6"),
        ("opencv.yml", "flags: 0", "flags: [1, 2", "line 6"),
        ("opencv.yml", "flags: 0", "image_width: 3", "line 6"),
        ("ros.yaml", "plumb_bob", "ds", 'distortion_model: got "ds"'),
        (
            "opencv.xml",
            "<opencv_storage>",
            "<!DOCTYPE a [<!ENTITY b 'c'>]>\n<opencv_storage>",
            "without a document type",
        ),
        ("opencv.xml", "</opencv_storage>", "", "no plain XML"),
        ("list.json", '": [{', '": [{"id": "left", "K": [[1,0,0],[0,1,0],[0,0,1]]}, {', '"left" twice'),
    ],
)
def test_damaged_calibrations_are_refused(
    name: str, old: str, new: str, said: str | None, tmp_path: Path
) -> None:
    write_files(tmp_path)
    path = tmp_path / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    if said is None:  # a rotation of two numbers: the pose is not known
        assert posekit.open(path)["left"].R is None
        return
    with pytest.raises(InputError) as error:
        posekit.open(path)
    assert (
        said in str(error.value) and str(error.value).startswith(str(path)) and "\n" not in str(error.value)
    )
