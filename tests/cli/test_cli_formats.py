"""Bad files and options through the command line: one line that names what, where and the remedy; nothing is left."""

from __future__ import annotations

import importlib.metadata
import json
import os
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.cameras import PinholeCamera
from posekit.cameras.calibrated import CalibratedCamera
from posekit.formats import own as files
from posekit.formats.cameras import write_cameras
from posekit.formats.keypoints import KeyPoints
from posekit.formats.motion import Motion, read_motion, write_motion
from posekit.formats.own import OpenCVModel, View
from posekit.geometry import Array
from posekit.recovery.conductor import recover
from posekit.recovery.result import result_of
from posekit.skeleton import JOINTS
from posekit.synthesis import Walker, walker_scene
from tests.detector_files import view_keypoints, write_keypoints

SIZE = (1920, 1080)
K = np.array([[1400.0, 0, 960], [0, 1400.0, 540], [0, 0, 1]])
Run = Callable[..., Any]


def walk(frames: int = 3) -> View:
    scene = walker_scene(Walker(), camera=(3, 0.3, 3), frames=frames, dt=0.1, carried=False)
    pinhole = PinholeCamera(K=K)
    return View(
        camera=OpenCVModel(K=K, size=SIZE, R=scene.R_cam_world[0], t=scene.t_cam_world[0]),
        time=scene.time,
        image=pinhole.project(scene.joints_cam),
        head_image=pinhole.project(scene.head_cam),
        truth=scene.joints_cam,
    )


def motion_of(points: Array, **others: Any) -> Motion:
    fields: dict[str, Any] = {
        "names": JOINTS,
        "points": points,
        "time": np.arange(len(points)) / 10,
        "rate": 10.0,
    }
    return Motion(**{**fields, **others})


@pytest.fixture(scope="module")
def there(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write one good file of each kind."""
    folder = tmp_path_factory.mktemp("there")
    view = walk()
    seen = view_keypoints(view, "openpose")
    write_keypoints(folder / "pictures", seen, "openpose-body_25b")
    write_keypoints(folder / "coco.json", view_keypoints(view, "coco-results"), "coco-results")
    write_keypoints(folder / "mmpose.json", seen, "mmpose")
    nameless = replace(seen, size=np.full((3, 2), [1920.0, 1080.0]))
    write_keypoints(folder / "landmarks.json", nameless, "mediapipe")
    document = json.loads((folder / "landmarks.json").read_text())
    for frame in document["frames"]:
        del frame["image_width"], frame["image_height"]
    (folder / "landmarks.json").write_text(json.dumps(document))
    files.write_view(folder / "view.json", view)
    recovery = recover(view)
    files.write_result(folder / "result.npz", result_of(recovery, unit="m"))
    one = CalibratedCamera(name="left", K=K, size=SIZE)
    write_cameras(folder / "two.toml", {"left": one, "right": replace(one, name="right")})
    write_cameras(folder / "camera.toml", {"left": one})
    write_cameras(folder / "small.toml", {"left": replace(one, size=(640, 480))})
    tiny = CalibratedCamera(name="left", K=K / [[1000.0], [1000.0], [1.0]], size=SIZE)
    write_cameras(folder / "metres.toml", {"left": tiny})
    up = view.truth * [1.0, -1.0, -1.0]
    write_motion(folder / "walk.trc", motion_of(up, up="+y"))
    write_motion(folder / "walk.npz", motion_of(up, up="+y"))
    write_motion(folder / "millimetres.csv", motion_of(1000 * up))
    twice = np.concatenate([up, up])
    clips = motion_of(
        twice, time=np.tile(np.arange(3) / 10, 2), clip=np.repeat([0, 1], 3), clips=("slow", "fast"), up="+y"
    )
    write_motion(folder / "clips.npz", clips)
    return folder


def refused(command: Run, out: Path, *arguments: object, after: tuple[str, ...] = ()) -> str:
    """Run a command that must fail, and return its one line."""
    before = sorted(out.parent.iterdir()) if out.parent.exists() else []
    done = command(*arguments)
    assert done.code == 2, done.out + done.err
    lines = done.err.splitlines()
    assert len(lines) == 1 + len(after), done.err
    line = lines[-1]
    assert line.startswith("posekit: error: ")
    assert "Traceback" not in done.err
    assert len(line) < 700
    assert sorted(out.parent.iterdir()) == before
    assert not out.exists()
    return str(line)


def from_file(there: Path, text: str) -> str:
    """Put the folder of good files where a test says @."""
    return text.replace("@", f"{there}/")


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        ("convert @nothing.json OUT.json", ["nothing.json", "No such file", "check the name"]),
        ("convert @nothing OUT.json", ["nothing", "No such file"]),
        ("convert @nothing.trc OUT.csv", ["nothing.trc", "No such file"]),
        ("convert /dev/zero OUT.csv", ["/dev/zero", "a pipe or a device"]),
        ("convert @pictures OUT.trc", ["ends in .trc", "not yet in space", "recover the view"]),
        ("convert @pictures OUT.bvh --to bvh", ["not yet in space", "recover the view"]),
        ("convert @pictures OUT", ["ends in nothing", "--to view", "not yet in space"]),
        ("convert @pictures OUT.json --to postues", ["--to", "did you mean postures"]),
        ("convert @pictures OUT.json --format coco", ["annotations", "check that it is COCO's"]),
        ("convert @pictures OUT.json --format opnpose", ["--format", "did you mean openpose"]),
        ("convert @coco.json OUT.json --to view --format alphapose-halpe_26", ["26", "17"]),
        ("convert @coco.json OUT.json --to view --skeleton halpe_26", ["26", "17", "skeleton"]),
        ("convert @pictures OUT.json --skeleton nothing", ["nothing"]),
        ("convert @pictures OUT.json --posture all", ["--posture", "says nothing of key points"]),
        ("convert @result.npz OUT.csv --stature 1.8m", ["--stature", "says nothing of a result"]),
        ("convert @result.npz OUT.xyz", ["ends in .xyz", ".trc, .c3d"]),
        ("convert @result.npz OUT.trc --to tcr", ["--to", "did you mean trc"]),
        ("convert @result.npz OUT.json --to coco", ["--to: got coco, which detectors write", "view, postures, trc"]),
        ("convert @result.npz OUT.json --to view", ["view, of a result"]),
        ("convert @result.npz OUT.trc --posture all", ["--posture: all", "one posture a frame", "csv, npz"]),
        ("convert @result.npz OUT.json --posture all", ["--posture: all", "one posture a frame", "csv, npz"]),
        ("convert @result.npz OUT.csv --posture -1", ["--posture", "'-1'", "a number from 0"]),
        ("convert @result.npz OUT.csv --posture best", ["--posture", "likeliest, path, all, or a number"]),
        ("convert @result.npz OUT.csv --up up", ["--up", "+x, -x, +y, -y, +z, -z"]),
        ("convert @result.npz OUT.trc --up +z", ["--up", "every file of trc"]),
        ("convert @result.npz OUT.mot --up z", ["--up", "+x, -x, +y"]),
        ("convert @walk.trc OUT.csv --input-up y", ["--input-up", "+x, -x, +y"]),
        ("convert @walk.trc OUT.csv --unit feet", ["--unit", "feet"]),
        ("convert @millimetres.csv OUT.trc", ["unit", "0.1 to 20 m"]),
        ("convert @walk.trc OUT.csv --clip slow", ["clips", "slow"]),
        ("convert @walk.trc OUT.json --to view", ["view, of motion"]),
        ("convert @clips.npz OUT.trc", ["2 clips (slow, fast)", "--clip"]),
        ("convert @clips.npz OUT.bvh --clip quick", ["clips", "quick", "slow, fast"]),
        ("convert @two.toml OUT.yml", ["2 cameras", "one a YAML"]),
        ("convert @two.toml OUT.json", [".json", ".toml, .yaml"]),
        ("convert @view.json OUT.json --camera @camera.toml", ["--camera", "says nothing of a view"]),
        ("convert @view.json OUT.json --stature 1.8m", ["--stature", "says nothing of a view"]),
        ("recover @pictures -o OUT.npz --camera @two.toml", ["--camera", "2 cameras (left, right)", ":left"]),
        ("recover @pictures -o OUT.npz --camera @two.toml:middle", ["--camera", '"middle"', "left, right"]),
        ("recover @pictures -o OUT.npz --camera @small.toml", ["--camera", "640x480", "lie outside"]),
        ("recover @pictures -o OUT.npz --camera @camera.toml --size 1280x720", ["1920x1080", "1280x720"]),
        ("recover @pictures -o OUT.npz --camera @metres.toml", ["--camera", "1.4 pixels", "K in pixels"]),
        ("recover @pictures -o OUT.npz --camera @nothing.toml", ["nothing.toml", "No such file"]),
        ("recover @pictures -o OUT.npz --camera @walk.trc", ["walk.trc"]),
        ("recover @pictures -o OUT.npz --camera @camera.toml --fov 60", ["--fov", "--camera is given too"]),
        ("recover @pictures -o OUT.npz --fov 60", ["--fov", "--size WIDTHxHEIGHT"]),
        ("recover @pictures -o OUT.npz --fov 60 --size 1920", ["--size", "as 1920x1080"]),
        ("recover @pictures -o OUT.npz --fov 60 --size 0x5", ["--size", "as 1920x1080"]),
        ("recover @pictures -o OUT.npz --fov 60 --size 64x48", ["--size", "64x48", "lie outside"]),
        ("recover @landmarks.json -o OUT.npz", ["fractions of the picture", "--size WIDTHxHEIGHT"]),
        ("recover @landmarks.json -o OUT.npz --fov 60", ["fractions of the picture", "--size WIDTHxHEIGHT"]),
        ("recover @pictures -o OUT.npz --person 4", ["--person", '"4"', "posekit inspect"]),
        ("recover @pictures -o OUT.npz --person tallest", ["--person", "largest, first, surest, all"]),
        ("recover @pictures -o OUT.npz --fps 0", ["--fps"]),
        ("recover @pictures -o OUT.npz --fps nan", ["--fps"]),
        ("recover @pictures -o OUT.npz --stature 180", ["--stature", "add cm, m or mm"]),
        ("recover @pictures -o OUT.npz --stature 180m", ["stature", "180 m", "another unit"]),
        ("recover @pictures -o OUT.npz --stature 1.8m --lengths @l.json --calibrate @walk.trc", ["--calibrate"]),
        ("recover @pictures -o OUT.npz --calibrate @view.json", ["--calibrate", "is a view"]),
        ("recover @pictures -o OUT.npz --calibrate @pictures", ["--calibrate", "--stature"]),
        ("recover @pictures -o OUT.npz --proportions vitruvius --stature 1.8m", ["vitruvius"]),
        ("recover @pictures -o OUT.npz --root feet", ["--root", "auto, head, torso, search"]),
        ("recover @pictures -o OUT.npz --truth @walk.trc", ["--truth", "R and t"]),
        ("recover @walk.trc -o OUT.npz", ["motion", "a view or key points"]),
        ("recover @camera.toml -o OUT.npz", ["cameras", "a view or key points"]),
        ("recover @view.json -o OUT.npz --person 1", ["--person", "is a view"]),
        ("recover @pictures -o OUT.txt", [".txt", ".json", ".npz"]),
    ],
)  # fmt: skip
def test_what_cannot_be_done_is_said_in_one_line(
    arguments: str, parts: list[str], there: Path, command: Run, tmp_path: Path
) -> None:
    words = [word.replace("OUT", str(tmp_path / "out")) for word in from_file(there, arguments).split()]
    out = Path(next(word for word in words if word.startswith(str(tmp_path))))
    line = refused(command, out, *words)
    for part in parts:
        assert part in line, line


def bad(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text)
    return folder / name


CUT = '{"version": 1.3, "people": [{"pose_keypoints_2d": [1, 2, 0.5,'


@pytest.mark.parametrize(
    "name", ["cut.json", "cut.trc", "cut.csv", "cut.bvh", "cut.toml", "cut.npz", "cut.c3d"]
)
def test_a_file_that_is_cut_off_says_where(name: str, there: Path, command: Run, tmp_path: Path) -> None:
    if name == "cut.json":
        path = bad(tmp_path, name, CUT)
        expected = f"line 1 column {len(CUT) + 1}: got the end of the file"
    elif name == "cut.trc":
        text = (there / "walk.trc").read_text()
        path, expected = bad(tmp_path, name, text[:-200]), "cut.trc: line"
    elif name == "cut.csv":
        path, expected = bad(tmp_path, name, "time,neck_x,neck_y,neck_z\n0,1,2,3\n0.1,1,2"), "cut.csv: "
    elif name == "cut.bvh":
        path, expected = bad(tmp_path, name, "HIERARCHY\nROOT Hips\n{\n OFFSET 0 0"), "cut.bvh: "
    elif name == "cut.toml":
        path, expected = bad(tmp_path, name, "[cam]\nmatrix = [[1, 2"), "cut.toml: "
    else:
        path = tmp_path / name
        path.write_bytes((there / "walk.npz").read_bytes()[:700])
        expected = f"{name}: "
    line = refused(command, tmp_path / "out.json", "inspect", path)
    assert expected in line
    assert refused(command, tmp_path / "out.csv", "convert", path, tmp_path / "out.csv")


@pytest.mark.parametrize("suffix", [".json", ".csv", ".trc", ".bvh", ".npz", ".toml", ".parquet", ".c3d", ""])
def test_a_file_of_two_gigabytes_is_refused_at_once(suffix: str, command: Run, tmp_path: Path) -> None:
    path = tmp_path / f"sparse{suffix}"
    with path.open("wb") as file:
        os.truncate(file.fileno(), 2 << 30)
    line = refused(command, tmp_path / "out.csv", "convert", path, tmp_path / "out.csv")
    assert "sparse" in line
    if suffix in (".json", ".csv", ".trc", ".bvh", ".toml"):
        assert "2,147.5 MB" in line


def picture(people: list[Array]) -> str:
    rows = [{"pose_keypoints_2d": np.round(points, 3).ravel().tolist()} for points in people]
    return json.dumps({"version": 1.3, "people": rows})


def triples(keypoints: KeyPoints) -> Array:
    return np.concatenate([keypoints.points, np.full((*keypoints.points.shape[:2], 1), 0.8)], axis=2)


def test_pictures_with_different_numbers_of_people_are_read(command: Run, tmp_path: Path) -> None:
    rows = triples(view_keypoints(walk(4), "openpose-body_25b"))
    rows = np.nan_to_num(rows * np.isfinite(rows[..., :1]))
    folder = tmp_path / "mixed"
    folder.mkdir()
    for k, others in enumerate((0, 2, 0, 3)):
        beside = [rows[k] * [0.3, 0.3, 0.5] + [200 * n, 0, 0] for n in range(others)]
        (folder / f"cam_{k:04d}_keypoints.json").write_text(picture([rows[k], *beside]))
    told = command("inspect", folder, "--format", "openpose-body_25b")
    assert "key points (openpose-body_25b)" in told.out
    assert told.code == 0, told.err
    assert "4 pictures of unknown size, 9 detections, 1 to 4 a picture" in told.out
    done = command("convert", folder, tmp_path / "v.json", "--format", "openpose-body_25b")
    assert done.code == 0, done.err
    view = files.read_view(tmp_path / "v.json")
    limbs = [k for k, name in enumerate(JOINTS) if name not in ("neck", "pelvis")]
    np.testing.assert_allclose(view.image[:, limbs], walk(4).image[:, limbs], rtol=0, atol=1e-3)


def test_pictures_are_put_in_the_order_of_their_numbers(command: Run, tmp_path: Path) -> None:
    rows = triples(view_keypoints(walk(12), "openpose-body_25b"))
    rows = np.nan_to_num(rows * np.isfinite(rows[..., :1]))
    (tmp_path / "k").mkdir()
    for k in np.random.default_rng(2).permutation(12).tolist():
        (tmp_path / "k" / f"cam_{k}_keypoints.json").write_text(picture([rows[k]]))
    done = command("convert", tmp_path / "k", tmp_path / "v.json", "--format", "openpose-body_25b")
    assert done.code == 0, done.err
    wrist = JOINTS.index("left_wrist")
    found = files.read_view(tmp_path / "v.json").image[:, wrist]
    np.testing.assert_allclose(found, walk(12).image[:, wrist], rtol=0, atol=1e-3)


def test_motion_whose_frames_are_out_of_order_is_refused(there: Path, command: Run, tmp_path: Path) -> None:
    lines = (there / "walk.trc").read_text().splitlines(keepends=True)
    path = tmp_path / "order.trc"
    path.write_text("".join([*lines[:-2], lines[-1], lines[-2]]))
    line = refused(command, tmp_path / "out.csv", "convert", path, tmp_path / "out.csv")
    assert "order.trc" in line
    assert "sort the rows" in line


def test_a_file_of_several_formats_names_them(command: Run, tmp_path: Path) -> None:
    nameless = tmp_path / "nameless.json"
    write_keypoints(nameless, view_keypoints(walk(), "coco-results-body_25"), "coco-results")
    line = refused(command, tmp_path / "out.csv", "inspect", nameless)
    assert "body_25 or body_25b" in line
    assert "--skeleton body_25" in line
    assert command("inspect", nameless, "--skeleton", "body_25").code == 0
    both = bad(tmp_path, "both.csv", "time,nose_x,nose_y,nose_z,left_shoulder_x,left_shoulder_y,left_shoulder_z,"
               "left_eye_inner_x,left_eye_inner_y,left_eye_inner_z,right_shoulder_x,right_shoulder_y,right_shoulder_z"
               "\n" + ",".join(["0"] * 13) + "\n")  # fmt: skip
    line = refused(command, tmp_path / "out.csv", "inspect", both)
    assert "mediapipe or csv" in line
    assert "--format" in line


def test_nobody_in_the_pictures(command: Run, tmp_path: Path) -> None:
    (tmp_path / "k").mkdir()
    for k in range(3):
        (tmp_path / "k" / f"{k}.json").write_text(picture([]))
    told = command("inspect", tmp_path / "k")
    assert told.code == 0, told.err
    assert "3 pictures of unknown size, 0 detections, 0 to 0 a picture" in told.out
    for arguments in (
        ("recover", tmp_path / "k", "-o", tmp_path / "r.npz"),
        ("convert", tmp_path / "k", tmp_path / "v.json"),
    ):
        line = refused(command, Path(arguments[-1]), *arguments)
        assert "nobody was detected in 3 pictures" in line


def test_lengths_in_another_unit_are_refused(there: Path, command: Run, tmp_path: Path) -> None:
    document = {"schema": "posekit.lengths/1", "unit": "m", "lengths": {"right_hip-right_knee": 43.0}}
    path = bad(tmp_path, "lengths.json", json.dumps(document))
    out = tmp_path / "r.npz"
    line = refused(command, out, "recover", there / "pictures", "-o", out, "--lengths", path)
    assert "43 m" in line
    assert "unit" in line


@pytest.mark.parametrize(
    ("module", "extra", "arguments"),
    [
        ("ezc3d", "c3d", "convert @result.npz OUT.c3d"),
        ("pyarrow", "parquet", "convert @result.npz OUT.parquet"),
        ("pyarrow", "parquet", "convert @result.npz OUT.parquet --posture all"),
        ("pyarrow", "parquet", "convert @walk.parquet OUT.csv"),
        ("pyarrow", "parquet", "batch @view.json -o OUT"),
        ("cv2", "opencv", "recover @pictures -o OUT.npz --camera @fisheye.toml"),
    ],
)
def test_a_missing_package_is_named_with_its_command(
    module: str,
    extra: str,
    arguments: str,
    there: Path,
    command: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    view = walk()
    write_motion(there / "walk.parquet", motion_of(view.truth, up="-y"))
    fisheye = CalibratedCamera(name="left", K=K, size=SIZE, fisheye=True, distortion=np.array([0.1, 0, 0, 0]))
    write_cameras(there / "fisheye.toml", {"left": fisheye})
    for name in [name for name in sys.modules if name.partition(".")[0] == module]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    installed = importlib.metadata.version

    def version(name: str) -> str:
        if name == module:
            raise importlib.metadata.PackageNotFoundError(name)
        return installed(name)

    monkeypatch.setattr("posekit.batch.recipe.version", version)
    words = [word.replace("OUT", str(tmp_path / "out")) for word in from_file(there, arguments).split()]
    out = Path(next(word for word in words if word.startswith(str(tmp_path))))
    line = refused(command, out, *words)
    assert f"pip install 'posekit[{extra}]'" in line


def test_files_that_are_read_are_not_written_over(there: Path, command: Run, tmp_path: Path) -> None:
    lengths = bad(tmp_path, "lengths.json", "{}")
    for options in (
        ("convert", there / "view.json", there / "view.json"),
        ("convert", there / "result.npz", there / "view.json", "--view", there / "view.json"),
        (
            "convert",
            there / "pictures",
            there / "two.toml",
            "--to",
            "view",
            "--camera",
            f"{there}/two.toml:left",
        ),
        ("convert", there / "pictures", lengths, "--lengths", lengths),
        (
            "convert",
            there / "pictures",
            there / "walk.trc",
            "--to",
            "view",
            "--calibrate",
            there / "walk.trc",
        ),
    ):
        before = Path(options[2]).read_bytes()
        done = command(*options)
        assert done.code == 2
        assert "would be written over" in done.err
        assert Path(options[2]).read_bytes() == before
    inside = there / "pictures" / "view.json"
    line = refused(command, inside, "convert", there / "pictures", inside)
    assert "a place among the files that are read" in line


@pytest.mark.parametrize("name", ["walk.trc", "coco.json", "view.json", "result.npz", "camera.toml"])
def test_a_folder_where_a_file_is_written_is_refused(
    name: str, there: Path, command: Run, tmp_path: Path
) -> None:
    target = tmp_path / ("out.toml" if name == "camera.toml" else "out.json")
    target.mkdir()
    done = command("convert", there / name, target)
    assert done.code == 2
    assert len(done.err.splitlines()) == 1
    assert list(target.iterdir()) == []
    assert [path.name for path in tmp_path.iterdir()] == [target.name]


@pytest.mark.parametrize("option", ["--camera", "--lengths", "--calibrate", "--truth", "--skeleton"])
def test_a_folder_where_a_file_is_read_is_refused(
    option: str, there: Path, command: Run, tmp_path: Path
) -> None:
    (tmp_path / "folder").mkdir()
    out = tmp_path / "r.npz"
    options = [] if option == "--camera" else ["--camera", there / "camera.toml"]
    refused(command, out, "recover", there / "pictures", "-o", out, option, tmp_path / "folder", *options)


def test_a_folder_without_key_points_says_what_it_is(there: Path, command: Run, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    assert "a folder without JSON files" in refused(command, tmp_path / "o", "inspect", tmp_path / "empty")
    (tmp_path / "outer" / "cam1").mkdir(parents=True)
    bad(tmp_path / "outer" / "cam1", "a.json", picture([]))
    assert "give cam1" in refused(command, tmp_path / "o", "inspect", tmp_path / "outer")
    (tmp_path / "other").mkdir()
    bad(tmp_path / "other", "a.json", '{"a": 1}')
    assert "first file, a.json, is an object" in refused(
        command, tmp_path / "o", "inspect", tmp_path / "other"
    )
    bad(tmp_path / "other", "b.json", "[]")
    for name in ("a.json", "b.json"):
        assert "of no known format" in refused(command, tmp_path / "o", "inspect", tmp_path / "other" / name)


def test_inspect_says_what_is_in_every_kind_of_file(there: Path, command: Run, tmp_path: Path) -> None:
    assert command("convert", there / "result.npz", tmp_path / "person").code == 0
    for name in ("a.mot", "a.glb", "a.bvh", "a.csv"):
        assert command("convert", there / "result.npz", tmp_path / name).code == 0
    expected = {
        there / "pictures": ["key points (openpose)", "3 pictures", "body_25b", "| left_wrist ", "100 %"],
        there / "coco.json": ["key points (coco-results)", "coco_17"],
        there / "mmpose.json": ["key points (mmpose)"],
        there / "landmarks.json": ["key points (mediapipe)", "--size WIDTHxHEIGHT makes them pixels"],
        there / "view.json": ["a view (posekit.view/1)", "3 frames, camera opencv", "truth in 3"],
        there / "result.npz": ["a result (posekit.result/2)", "3 frames"],
        there / "walk.trc": ["motion (trc)", "3 frames at 10 a second", "+y up", "missing joints: none"],
        there / "clips.npz": ["6 frames in 2 clips at 10 a second (0.40 s)"],
        there / "two.toml": ["cameras", "left: calibrated", "right: calibrated"],
        tmp_path / "person": ["motion (urdf)", "+z up"],
        tmp_path / "person" / "configurations.npz": ["3 configurations of x, y, z"],
        tmp_path / "a.mot": ["motion (mot)", "19 points, +z up"],
        tmp_path / "a.glb": ["motion (glb)", "+y up"],
        tmp_path / "a.bvh": ["motion (bvh)", "+y up"],
        tmp_path / "a.csv": ["motion (csv)", "+y is up by where heads and ankles are"],
    }
    for path, parts in expected.items():
        done = command("inspect", path)
        assert done.code == 0, done.err
        assert done.err == ""
        for part in parts:
            assert part in done.out, (path, part, done.out)


def test_a_table_of_survivors_says_that_it_holds_no_tolerances(
    there: Path, command: Run, tmp_path: Path
) -> None:
    assert command("convert", there / "result.npz", tmp_path / "all.csv", "--posture", "all").code == 0
    assert (
        "says no tolerances; judge the result that it is of" in command("validate", tmp_path / "all.csv").out
    )
    assert "tolerances;" not in command("validate", there / "result.npz").out


def test_a_rate_that_no_file_says_is_stated_or_told(there: Path, command: Run, tmp_path: Path) -> None:
    rows = [f"{k},{j},{j % 5},{j / 10},{k / 9}" for k in range(3) for j in range(33)]
    head = "sync_index,point_id,x_coord,y_coord,z_coord"
    points = bad(tmp_path, "xyz_HOLISTIC.csv", "\n".join([head, *rows]))
    out = tmp_path / "a.trc"
    assert "posekit convert FILE OUT.trc --fps RATE" in refused(command, out, "convert", points, out)
    assert command("convert", points, out, "--fps", "24", "--input-up", "+y").code == 0
    np.testing.assert_allclose(read_motion(out).time, np.arange(3) / 24, atol=1e-6)
    again = tmp_path / "b.trc"
    assert "says 24 frames a second itself" in refused(command, again, "convert", out, again, "--fps", "30")
    words = ("recover", there / "pictures", "-o", tmp_path / "r.npz", "--camera", there / "camera.toml")
    assert "frame rate: not known, 30 a second is assumed (--fps)" in command(*words).out
    assert "frame rate" not in command(*words, "--fps", "10").out


def test_points_of_different_people_are_not_told_as_one_persons(command: Run, tmp_path: Path) -> None:
    pictures = [{"id": k, "file_name": f"{k}.jpg", "width": 640, "height": 480 + k} for k in range(2)]
    points = [number for j in range(17) for number in (20.0 * j, 10.0 * j, 2)]
    people = [{"id": k, "image_id": k, "category_id": 1, "keypoints": points} for k in range(2)]
    category = {"id": 1, "name": "person"}
    coco = {"images": pictures, "annotations": people, "categories": [category]}
    done = command("inspect", bad(tmp_path, "coco.json", json.dumps(coco)))
    assert done.code == 0, done.err
    assert "the largest in each picture:" in done.out
    assert "person 0 (" not in done.out


@pytest.mark.parametrize("name", ["csv", "npz", "parquet"])
def test_clips_go_into_tables_together(name: str, there: Path, command: Run, tmp_path: Path) -> None:
    done = command("convert", there / "clips.npz", tmp_path / f"clips.{name}")
    assert done.code == 0, done.err
    assert "6 frames in 2 clips of 14 points" in done.out
    told = command("inspect", tmp_path / f"clips.{name}")
    assert "6 frames in 2 clips" in told.out
    one = command("convert", tmp_path / f"clips.{name}", tmp_path / "fast.trc", "--clip", "fast")
    assert one.code == 0, one.err
    assert "3 frames of 14 points" in one.out


@pytest.mark.parametrize("kind", ["json", "npz", "colmap", "view"])
def test_cameras_are_known_in_whatever_file(kind: str, there: Path, command: Run, tmp_path: Path) -> None:
    path = tmp_path / f"camera.{kind}"
    if kind == "json":
        bad(tmp_path, path.name, json.dumps({"camera_matrix": K.tolist(), "dist_coeffs": [0.0] * 5}))
    elif kind == "npz":
        np.savez(path, mtx=K, dist=np.zeros(5))
    elif kind == "colmap":
        path.mkdir()
        bad(path, "cameras.txt", "1 PINHOLE 1920 1080 1400 1400 960.5 540.5\n")
    else:
        path = there / "camera.toml"
    told = command("inspect", path)
    assert told.code == 0, told.err
    assert "cameras" in told.out
    assert "f 1400.0 x 1400.0 px" in told.out
    done = command("convert", there / "pictures", tmp_path / "v.json", "--camera", path)
    assert done.code == 0, done.err
    model = files.read_view(tmp_path / "v.json").camera
    assert isinstance(model, OpenCVModel)
    np.testing.assert_allclose(model.K, K, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["convert", "inspect", "recover"])
def test_help_stays_readable(name: str, command: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    done = command(name, "--help")
    assert done.code == 0
    lines = done.out.splitlines()
    assert lines[0].strip() == "" or lines[0].startswith("Usage")
    assert max(map(len, lines)) <= 100
    assert len(lines) < 160
    assert any(f"  posekit {name} " in line for line in lines)
    options = [line.split()[0] for line in lines if line.startswith("  --")]
    assert len(set(options)) == len(options)
    for number, line in enumerate(lines):
        if line.startswith("  --"):
            said = line.split("  ")[2:] or lines[number + 1].strip()
            assert said, line
