"""Camera files: every format against an independent writer or reader, round trips, and files that are damaged."""

import json
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.cameras.calibrated import CalibratedCamera
from posekit.cameras.lens import project
from posekit.errors import InputError
from posekit.formats.cameras import read_cameras, write_cameras
from posekit.geometry import rotation_from_vector
from posekit.safe_io.yaml_file import parse_yaml

K = np.array([[1010.25, 0.0, 640.5], [0.0, 1012.75, 360.25], [0.0, 0.0, 1.0]])
DIST = np.array([-0.21, 0.05, 0.001, -0.002, 0.01])
VECTOR = np.array([1.6882754799999993, 1.04832205, -0.41955852])
T = np.array([0.3211, 0.9563, 2.8907])

POSE2SIM = """
[cam_01]
name = "left"
size = [ 1088.0, 1920.0]
matrix = [ [ 1681.24, 0.0, 532.97], [ 0.0, 1681.07, 948.13], [ 0.0, 0.0, 1.0]]
distortions = [ -0.0007, 0.0021, 9.5e-06, 1.07e-05]
rotation = [ 1.688, 1.048, -0.419]
translation = [ 0.32, 0.95, 2.89]
fisheye = false

[cam_02]
name = "right"
size = [ 1088.0, 1920.0]
matrix = [ [ 1673.72, 0.0, 534.49], [ 0.0, 1673.79, 963.22], [ 0.0, 0.0, 1.0]]
distortions = [ -0.0007, 0.0021, 1.5e-05, 4.5e-06]
rotation = [ 1.349, 1.596, -1.198]
translation = [ -0.11, 0.77, 3.06]
fisheye = false

[metadata]
adjusted = false
error = 0.0
"""

ROS = """
image_width: 800   # pixels
image_height: 600
camera_name: head
camera_matrix:
  rows: 3
  cols: 3
  data: [538.63, 0, 457.698, 0, 539.723, 297.003,
         0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.30678, 0.0825017, 0.0028784, -0.00015829, 0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [538.63, 0, 457.698, 0, 0, 539.723, 297.003, 0, 0, 0, 1, 0]
"""

ONE = '{"name": "a", "K": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}'

CAMERAS_TXT = """# Camera list with one line of data per camera:
#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]
# Number of cameras: 3
1 SIMPLE_PINHOLE 3072 2304 2559.81 1536 1152
2 PINHOLE 3072 2304 2560.56 2561.5 1536 1152
3 SIMPLE_RADIAL 3072 2304 2559.69 1536 1152 -0.0218531
"""


def save(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def a_camera(name: str = "left", **more: object) -> CalibratedCamera:
    parameters = {
        "K": K,
        "distortion": DIST,
        "size": (1280, 720),
        "R": rotation_from_vector(VECTOR),
        "t": T,
    } | more
    return CalibratedCamera(name=name, **parameters)  # type: ignore[arg-type]


def same(a: CalibratedCamera, b: CalibratedCamera) -> None:
    assert (a.name, a.fisheye, a.size, a.up, a.how, a.deviation) == (
        b.name,
        b.fisheye,
        b.size,
        b.up,
        b.how,
        b.deviation,
    )
    np.testing.assert_array_equal(a.K, b.K)
    np.testing.assert_array_equal(a.distortion, b.distortion)
    assert (a.R is None, a.t is None) == (b.R is None, b.t is None)
    if a.R is not None and b.R is not None and a.t is not None and b.t is not None:
        np.testing.assert_allclose(a.R, b.R, atol=1e-14)
        np.testing.assert_array_equal(a.t, b.t)


# OpenCV


@pytest.mark.parametrize("ending", ["yml", "yaml", "xml", "json"])
def test_what_opencv_writes_is_read(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"camera.{ending}"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("calibration_time", 'Thu 07 Nov 2019 05:21:22 PM CST: "new"')
    storage.write("image_width", 1280)
    storage.write("image_height", 720)
    storage.write("camera_matrix", K)
    storage.write("distortion_coefficients", DIST[:, None])
    storage.write("avg_reprojection_error", 0.47)
    storage.write("R", rotation_from_vector(VECTOR))
    storage.write("T", T[:, None])
    storage.release()
    (camera,) = read_cameras(path).values()
    same(camera, a_camera("camera"))


def test_opencv_opens_what_is_written(tmp_path: Path) -> None:
    path = tmp_path / "left.yml"
    write_cameras(path, {"left": a_camera()})
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    np.testing.assert_array_equal(storage.getNode("camera_matrix").mat(), K)
    np.testing.assert_array_equal(storage.getNode("distortion_coefficients").mat()[:, 0], DIST)
    np.testing.assert_array_equal(storage.getNode("T").mat()[:, 0], T)
    assert storage.getNode("image_width").real() == 1280
    same(read_cameras(path)["left"], a_camera())


def test_ros_has_a_name_and_no_pose(tmp_path: Path) -> None:
    camera = read_cameras(save(tmp_path, "x.yaml", ROS))["head"]
    assert camera.size == (800, 600) and camera.R is None
    assert camera.K[0].tolist() == [538.63, 0.0, 457.698]
    assert camera.distortion.tolist() == [-0.30678, 0.0825017, 0.0028784, -0.00015829, 0.0]


def test_a_rectification_is_no_pose(tmp_path: Path) -> None:
    text = json.dumps(
        {"K": K.tolist(), "D": DIST.tolist(), "R": np.eye(3).tolist(), "P": np.eye(4)[:3].tolist()}
    )
    (camera,) = read_cameras(save(tmp_path, "x.json", text)).values()
    assert camera.R is None and camera.t is None


def test_fisheye_is_told_apart(tmp_path: Path) -> None:
    fields = {"K": K.tolist(), "D": [0.1, 0.0, 0.0, 0.0]}
    for more, expected in (
        ({}, False),
        ({"fisheye_model": 1}, True),
        ({"fisheye": False}, False),
        ({"distortion_model": "equidistant"}, True),
        ({"distortion_model": "plumb_bob"}, False),
    ):
        (camera,) = read_cameras(save(tmp_path, "x.json", json.dumps(fields | more))).values()
        assert camera.fisheye is expected


@pytest.mark.parametrize(
    "fields",
    [
        {
            "K_left": K.tolist(),
            "dist_left": DIST.tolist(),
            "K_right": K.tolist(),
            "dist_right": DIST.tolist(),
        },
        {
            "left": {"K": K.tolist(), "dist": DIST.tolist()},
            "right": {"mtx": K.tolist(), "dist": DIST.tolist()},
        },
        {"cameras": [{"name": n, "K": K.tolist(), "distCoef": DIST.tolist()} for n in ("left", "right")]},
    ],
)
def test_files_of_several_cameras(fields: dict[str, object], tmp_path: Path) -> None:
    cameras = read_cameras(save(tmp_path, "x.json", json.dumps(fields)))
    assert list(cameras) == ["left", "right"]
    for name, camera in cameras.items():
        same(camera, a_camera(name, size=None, R=None, t=None))


def test_stereo_matrices_have_numbers(tmp_path: Path) -> None:
    fields = {
        "M1": K.tolist(),
        "D1": DIST.tolist(),
        "M2": (K * [[2], [2], [1]]).tolist(),
        "D2": DIST.tolist(),
    }
    cameras = read_cameras(save(tmp_path, "x.json", json.dumps(fields)))
    assert list(cameras) == ["1", "2"] and cameras["2"].K[0, 0] == 2 * K[0, 0]


def test_npz(tmp_path: Path) -> None:
    path = tmp_path / "calib.npz"
    np.savez(path, mtx=K, dist=DIST[None], rvec=VECTOR[:, None], tvec=1000 * T, size=[1280, 720])
    camera = read_cameras(path, unit="mm")["calib"]
    assert camera.t is not None
    np.testing.assert_allclose(camera.t, T)
    same(camera, a_camera("calib", t=camera.t))


def test_a_view_of_our_own(tmp_path: Path) -> None:
    view = {
        "schema": "posekit.view/1",
        "unit": "cm",
        "camera": {
            "model": "opencv",
            "K": K.tolist(),
            "R": np.eye(3).tolist(),
            "t": [1, 2, 300],
            "size": [1280, 720],
        },
        "frames": [],
    }
    camera = read_cameras(save(tmp_path, "walk.json", json.dumps(view)))["walk"]
    assert camera.t is not None and camera.t.tolist() == [0.01, 0.02, 3.0]
    view["camera"] = {"model": "scaled-orthographic", "scale": None}
    with pytest.raises(InputError, match=r"camera\.model"):
        read_cameras(save(tmp_path, "walk.json", json.dumps(view)))


# Pose2Sim and Anipose


def test_pose2sim(tmp_path: Path) -> None:
    cameras = read_cameras(save(tmp_path, "Calib.toml", POSE2SIM))
    assert list(cameras) == ["left", "right"]
    left = cameras["left"]
    assert left.size == (1088, 1920) and left.up == "+z" and left.how == "calibrated"
    assert left.R is not None
    np.testing.assert_allclose(left.R, cv2.Rodrigues(np.array([1.688, 1.048, -0.419]))[0], atol=1e-12)


def test_caliscope_has_a_matrix(tmp_path: Path) -> None:
    R = rotation_from_vector(np.array([1.688, 1.048, -0.419]))
    text = POSE2SIM.replace("[ 1.688, 1.048, -0.419]", json.dumps(R.round(12).tolist()))
    camera = read_cameras(save(tmp_path, "config.toml", text))["left"]
    assert camera.R is not None
    np.testing.assert_allclose(camera.R, R, rtol=0, atol=1e-9)
    mirrored = POSE2SIM.replace("[ 1.688, 1.048, -0.419]", json.dumps((-R).tolist()))
    with pytest.raises(InputError, match=r"cam_01.rotation: .*mirrors"):
        read_cameras(save(tmp_path, "mirrored.toml", mirrored))


@pytest.mark.parametrize("up", ["+x", "-x", "+y", "-y", "+z", "-z"])
def test_the_world_is_up_where_turned_pictures_are(up: str, tmp_path: Path) -> None:
    """Cameras that stand level, on either side and on their head: pictures are upright after their quarter turns."""
    down = (-1.0 if up[0] == "+" else 1.0) * np.eye(3)["xyz".index(up[1])]
    level = np.stack([side := np.roll(np.abs(down), 1), down, np.cross(side, down)])  # right, down, forward
    tables = []
    for count in (-1, 0, 1, 2):
        c, s = np.round([np.cos(count * np.pi / 2), np.sin(count * np.pi / 2)])
        R = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ level
        tables.append(
            f"[cam_{count % 4}]\nrotation_count = {count}\nmatrix = [[900, 0, 640], [0, 900, 360], [0, 0, 1]]\n"
            f"rotation = {json.dumps(R.tolist())}\ntranslation = [0.0, 0.0, 3.0]\n"
        )
    cameras = read_cameras(save(tmp_path, "config.toml", "".join(tables)))
    assert {camera.up for camera in cameras.values()} == {up}
    without = read_cameras(save(tmp_path, "less.toml", "".join(tables).replace("rotation_count = 2\n", "")))
    assert {camera.up for camera in without.values()} == {""}


def test_anipose_says_no_up_and_has_the_boards_unit(tmp_path: Path) -> None:
    text = POSE2SIM.replace("fisheye = false\n", "").replace("[ 0.32, 0.95, 2.89]", "[ 320.0, 950.0, 2890.0]")
    path = save(tmp_path, "calibration.toml", text)
    with pytest.raises(InputError, match=r"cam_01.translation.*2,890.*unit"):
        read_cameras(path)
    for camera in (read_cameras(path, "anipose")["left"], read_cameras(path, unit="mm")["left"]):
        assert camera.t is not None
        np.testing.assert_allclose(camera.t, [0.32, 0.95, 2.89])
        assert camera.up == ""
    assert read_cameras(path, unit=1.0)["left"].t is not None


@settings(deadline=None)
@given(
    st.lists(st.floats(-3, 3), min_size=3, max_size=3),
    st.lists(st.floats(-50, 50), min_size=3, max_size=3),
    st.sampled_from([0, 4, 5, 8, 12, 14]),
    st.booleans(),
    st.sampled_from(["", "+z", "-y"]),
    st.text(min_size=1, max_size=12),
)
def test_pose2sim_round_trips(
    tmp_path_factory: pytest.TempPathFactory,
    vector: list[float],
    t: list[float],
    count: int,
    guessed: bool,
    up: str,
    name: str,
) -> None:
    path = tmp_path_factory.getbasetemp() / "round.toml"
    guess = {"how": f"a guess: {name}", "deviation": 0.05} if guessed else {}
    cameras = {
        name: a_camera(
            name,
            R=rotation_from_vector(np.array(vector)),
            t=t,
            distortion=np.full(count, 0.01),
            up=up,
            **guess,
        ),
        f"{name}2": a_camera(f"{name}2", up=up, R=None, t=None, size=None, fisheye=True, distortion=[]),
    }
    if not name.isprintable():
        with pytest.raises(InputError, match="do not print"):
            write_cameras(path, cameras)
        return
    write_cameras(path, cameras)
    assert "[metadata]" in path.read_text()
    back = read_cameras(path)
    assert list(back) == list(cameras)
    for one, camera in cameras.items():
        same(back[one], camera)


def test_what_is_written_has_pose2sims_keys(tmp_path: Path) -> None:
    path = tmp_path / "Calib.toml"
    write_cameras(path, {"left": a_camera(up="+z")})
    table = tomllib.loads(path.read_text())
    assert set(table["cam_01"]) == {
        "name",
        "size",
        "matrix",
        "distortions",
        "rotation",
        "translation",
        "fisheye",
    }
    assert table["metadata"] == {"adjusted": False, "error": 0.0}
    np.testing.assert_allclose(table["cam_01"]["rotation"], VECTOR, atol=1e-12)


def test_two_worlds_do_not_go_into_one_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="point up"):
        write_cameras(tmp_path / "x.toml", {"a": a_camera("a", up="+z"), "b": a_camera("b", up="+y")})


# COLMAP


def test_colmap_cameras(tmp_path: Path) -> None:
    cameras = read_cameras(save(tmp_path, "cameras.txt", CAMERAS_TXT))
    assert list(cameras) == ["1", "2", "3"]
    # The middle of the first pixel is (0.5, 0.5) there and (0, 0) here.
    assert cameras["1"].K.tolist() == [[2559.81, 0, 1535.5], [0, 2559.81, 1151.5], [0, 0, 1]]
    assert cameras["2"].K[1, 1] == 2561.5 and not len(cameras["2"].distortion)
    assert cameras["3"].distortion.tolist() == [-0.0218531, 0, 0, 0, 0]
    assert cameras["1"].R is None and cameras["1"].size == (3072, 2304)


@pytest.mark.parametrize(
    ("model", "parameters", "order", "fisheye"),
    [
        ("RADIAL", "900 640 360 0.1 -0.02", [0.1, -0.02, 0, 0, 0], False),
        ("OPENCV", "900 901 640 360 0.1 -0.02 0.003 0.004", [0.1, -0.02, 0.003, 0.004, 0], False),
        (
            "FULL_OPENCV",
            "900 901 640 360 0.1 -0.02 0.003 0.004 0.05 0.06 0.07 0.08",
            [0.1, -0.02, 0.003, 0.004, 0.05, 0.06, 0.07, 0.08],
            False,
        ),
        ("OPENCV_FISHEYE", "900 901 640 360 0.1 -0.02 0.003 0.004", [0.1, -0.02, 0.003, 0.004], True),
    ],
)
def test_colmap_models(
    model: str, parameters: str, order: list[float], fisheye: bool, tmp_path: Path
) -> None:
    camera = read_cameras(save(tmp_path, "cameras.txt", f"7 {model} 1280 720 {parameters}\n"))["7"]
    assert camera.distortion.tolist() == order and camera.fisheye is fisheye


def test_colmap_pictures_have_poses_but_no_metres(tmp_path: Path) -> None:
    save(tmp_path, "cameras.txt", CAMERAS_TXT)
    images = save(
        tmp_path,
        "images.txt",
        "# two lines a picture\n"
        "1 0.851773 0.0165051 0.503764 -0.142941 -0.737434 1.02973 3.74354 1 P1 180141.JPG\n"
        "2362.39 248.498 58396 1784.7 268.254 59027\n"
        "2 0.851773 0.0165051 0.503764 -0.142941 -0.737434 1.02973 3.74354 3 b.JPG\n"
        "\n",
    )
    cameras = read_cameras(images)
    assert list(cameras) == ["P1 180141.JPG", "b.JPG"] == list(read_cameras(tmp_path))
    first = cameras["P1 180141.JPG"]
    assert first.t is None and first.R is not None and first.position is None
    np.testing.assert_allclose(first.R @ first.R.T, np.eye(3), atol=1e-12)
    assert cameras["b.JPG"].K[0, 0] == 2559.69
    scaled = read_cameras(images, unit=2.5)["b.JPG"]
    assert scaled.t is not None
    np.testing.assert_allclose(scaled.t, 2.5 * np.array([-0.737434, 1.02973, 3.74354]))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("1 FOV 10 10 1 2 3 4 5", "image_undistorter"),
        ("1 PINHOL 10 10 1 2 3 4", "PINHOLE"),
        ("1 PINHOLE 10 10 1 2 3", "4 for PINHOLE"),
        ("1 PINHOLE 10 10 1 2 3 nan", "finite"),
        ("1 PINHOLE 10 10 1 2 3 1_0", "finite"),
        ("1 PINHOLE 10 10 0 2 3 4", "focal"),
        ("1 PINHOLE 1.5 10 1 2 3 4", "whole"),
        ("1 PINHOLE 10 10 1 2 3 4\n1 PINHOLE 10 10 1 2 3 4", "twice"),
        ("# nothing", "no camera"),
        ("1 PINHOLE", 'got "1 PINHOLE"; expected CAMERA_ID'),
        ("fx=900", "as in COLMAP's cameras.txt; correct the file, or name a calibration in TOML"),
    ],
)
def test_damaged_colmap_cameras(text: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=says):
        read_cameras(save(tmp_path, "cameras.txt", text))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("1 1 0 0 0 0 0 0 9 a.jpg\n\n", "camera 9"),
        ("1 0 0 0 0 0 0 0 1 a.jpg\n\n", "length 1"),
        ("1 1 0 0 0 0 0 inf 1 a.jpg\n\n", "finite"),
        ("1 1 0 0 0 0 0 0 1 a.jpg\n\n2 1 0 0 0 0 0 0 1 a.jpg\n\n", "twice"),
        ("1 1 0 0", "4 words"),
        ("#", "no picture"),
    ],
)
def test_damaged_colmap_pictures(text: str, says: str, tmp_path: Path) -> None:
    save(tmp_path, "cameras.txt", CAMERAS_TXT)
    with pytest.raises(InputError, match=says):
        read_cameras(save(tmp_path, "images.txt", text))


# Damaged files


K_ROW = "K: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.yml", "%YAML:1.0\n---\nimage_width: 3\n", "no 3x3 matrix"),
        ("a.yml", "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   data: [ 1, 0, 0, 0, 1", "did not find"),
        ("a.yml", "K: [1, 0, 0, 0, -1, 0, 0, 0, 1]", "focal"),
        ("a.yml", "K: [.Nan, 0, 0, 0, 1, 0, 0, 0, 1]", "not finite"),
        ("a.yml", "K: {rows: 1000000000, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}", "rows, cols and data"),
        ("a.yml", "K: {rows: 3, cols: 4, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}", "9 numbers for 3 rows"),
        ("a.yml", "K: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nD: [a, b]", "numbers"),
        ("a.yml", "K: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nD: [1, 2, 3, 4, 5, 6]", "6 coefficients"),
        ("a.yml", "K: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nR: [1, 0, 0]\nT: [1, 2]", "2 numbers"),
        ("a.yml", "K: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nfisheye: maybe", "0 or 1"),
        ("a.yml", "K: [1, 0, 0, 0, 1, 0, 0, 0, 1]\ndistortion_model: omnidir", "undistort"),
        ("a.yml", "K: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nk: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nK: 3", "twice"),
        ("a.yml", f"{K_ROW}image_width: 640\nimage_heigth: 480\n", "image_heigth: got a field.*image_height"),
        ("a.yml", f"{K_ROW}image_widht: 640\nimage_heigth: 480\n", "image_widht: got a field.*image_width"),
        ("a.yml", f"{K_ROW}image_width: 640\n", "640 and nothing; expected width and height"),
        ("a.yml", f"{K_ROW}image_width: 640\nimage_height: -480\n", "640 and -480; expected width and height"),
        ("a.yml", f"{K_ROW}image_width: 640\nimage_height: 480.5\n", "480.5; expected width and height"),
        ("a.yml", f"{K_ROW}distortion_model: plumb_bob\ndistortion_coeficients: [1, 0, 0, 0]\n", "not read"),
        ("a.toml", POSE2SIM.replace("size =", "sise ="), "sise: got a field that is not read; expected size"),
        ("a.toml", POSE2SIM.replace("distortions", "distortion"), "not read; expected distortions"),
        ("a.yml", "a: &x 1\nb: *x\n", "an anchor or an alias"),
        ("a.yml", "- 1\n- 2\n", "no 3x3 matrix"),
        ("a.yml", "just words", "named fields"),
        ("a.yml", "\n\n# nothing\n", "comments"),
        ("a.yml", "a: 1\na: 2\n", "line 2: got \"a\" twice"),
        ("a.yml", "a: 1\n---\nb: 2\n", "2 documents"),
        ("a.yml", "[1, 2]: 3\n", "as a key"),
        ("a.yml", "a: !!python/object/apply:os.system [ls]\n", "no 3x3 matrix"),
        ("a.yml", "a: \x07\n", "does not print"),
        ("a.yml", "a: " + "[" * 40 + "]" * 40, "nested"),
        ("a.yml", "".join(f"{' ' * k}a:\n" for k in range(40)), "nested"),
        ("a.xml", "<?xml version='1.0'?><other/>", "opencv_storage"),
        ("a.xml", "<!DOCTYPE x [<!ENTITY a 'b'>]><opencv_storage/>", "DOCTYPE"),
        ("a.xml", "<opencv_storage><camera_matrix>", "XML"),
        ("a.json", "[1, 2]", "no 3x3 matrix"),
        ("a.json", "{", "JSON"),
        ("a.json", f'{{"cameras": [{ONE}, {ONE}]}}', "twice"),
        ("a.toml", "x = 1", "no camera"),
        ("a.toml", POSE2SIM.replace('"right"', '"left"'), "twice"),
        ("a.toml", POSE2SIM.replace("fisheye = false", "fisheye = 0"), "true or false"),
        ("a.toml", POSE2SIM.replace("[ 1.688, 1.048, -0.419]", "[1.0, 2.0]"), "2 numbers"),
        ("a.toml", POSE2SIM.replace("[ 1.688, 1.048, -0.419]", "[1.0, 2.0, nan]"), "finite"),
        ("a.toml", POSE2SIM.replace("rotation = [ 1.688, 1.048, -0.419]\n", ""), "give both"),
        ("a.toml", POSE2SIM.replace("[ 1088.0, 1920.0]", "[ 1088.5, 1920.0]"), "pixels"),
        ("a.toml", POSE2SIM.replace("1681.24, 0.0, 532.97", "-1681.24, 0.0, 532.97"), "focal"),
        ("a.toml", POSE2SIM.replace("matrix = [ [ 1681.24, 0.0, 532.97],", "matrix = [ "), "shape"),
        ("a.bin", "x", "ending"),
    ],
)  # fmt: skip
def test_damaged_files_are_refused_on_one_line(name: str, text: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=says) as refused:
        read_cameras(save(tmp_path, name, text))
    assert "\n" not in str(refused.value) and len(str(refused.value)) < 700


def test_missing_files_formats_and_units(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        read_cameras(tmp_path / "none.toml")
    with pytest.raises(InputError, match="opencv"):
        read_cameras(tmp_path / "none.toml", "opencvv")
    for unit in ("inch", 0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match="unit"):
            read_cameras(tmp_path / "none.toml", unit=unit)
    with pytest.raises(InputError, match="ending"):
        write_cameras(tmp_path / "x.csv", {"left": a_camera()})
    with pytest.raises(InputError, match="no camera"):
        write_cameras(tmp_path / "x.toml", {})
    with pytest.raises(InputError, match="2 cameras"):
        write_cameras(tmp_path / "x.yml", {"a": a_camera(), "b": a_camera()})
    with pytest.raises(InputError, match="quote"):
        write_cameras(tmp_path / "x.yml", {"a": a_camera('a"')})


def test_a_truncated_file_is_read_or_refused(tmp_path: Path) -> None:
    write_cameras(tmp_path / "whole.yml", {"left": a_camera()})
    whole = (tmp_path / "whole.yml").read_text()
    for length in range(1, len(whole), 7):
        try:
            read_cameras(save(tmp_path, "cut.yml", whole[:length]))
        except InputError as error:
            assert "\n" not in str(error)


@settings(deadline=None, max_examples=300)
@given(st.text(alphabet="ab:-[]{},#'\"! \n\t0123.eE%&*|", max_size=60))
def test_any_text_is_parsed_or_refused(text: str) -> None:
    try:
        parse_yaml(text, "text")
    except InputError as error:
        assert "\n" not in str(error)


def test_long_lines_take_no_time() -> None:
    for text in ("a" + " " * 2_000_000 + "b", "a: " + "[" * 1_000_000, "k" * 2_000_000, "'" * 999_999):
        try:
            parse_yaml(text, "text")
        except InputError as error:
            assert len(str(error)) < 400


def test_yaml_of_the_usual_kind() -> None:
    text = (
        '%YAML:1.0\n---\nname: "a # b"\nlist:\n   - 1\n   - { x: 2., y: [ 3, -.5e+1 ] }\n'
        "   -\n     z: ~\nempty:\nlast: .Inf # c\n"
    )
    assert parse_yaml(text, "x") == {
        "name": "a # b",
        "list": [1, {"x": 2.0, "y": [3, -5.0]}, {"z": None}],
        "empty": None,
        "last": float("inf"),
    }


def test_project_agrees_with_opencv_for_a_posed_camera(tmp_path: Path, rng: np.random.Generator) -> None:
    camera = read_cameras(save(tmp_path, "Calib.toml", POSE2SIM))["right"]
    assert camera.R is not None and camera.t is not None
    world = rng.uniform(-0.5, 0.5, (30, 3))
    expected = cv2.projectPoints(
        world, np.array([1.349, 1.596, -1.198]), camera.t.copy(), camera.K.copy(), camera.distortion.copy()
    )[0][:, 0]
    np.testing.assert_allclose(project(camera, world @ camera.R.T + camera.t), expected, atol=1e-8)


def test_a_word_means_what_opencv_and_ros_mean_by_it() -> None:
    text = "a: 1e-05\nb: 1:30\nc: 012\nd: yes\ne: 2020-01-02\nf: '3'\ng: -.5\nh: 1_000\n"
    assert parse_yaml(text, "x") == {
        **{"a": 1e-05, "b": "1:30", "c": 12, "d": "yes", "e": "2020-01-02"},
        **{"f": "3", "g": -0.5, "h": "1_000"},
    }


def test_bombs_are_refused_at_once() -> None:
    unfolding = "a: &a [x]\n" + "".join(
        f"{b}: &{b} [*{a}, *{a}, *{a}]\n" for a, b in zip("abcdef", "bcdefg", strict=True)
    )
    for text in (unfolding, "- " * 100_000, "[" * 1_000_000, "{a: " * 1_000_000, "? " * 100_000):
        with pytest.raises(InputError) as refused:
            parse_yaml(text, "text")
        assert "\n" not in str(refused.value)
