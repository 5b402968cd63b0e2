"""Laws of recovering from key points: whatever is missing, swapped or said by an option."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import posekit
from posekit.body.anthropometry import lengths_from_proportions
from posekit.cameras import PinholeCamera
from posekit.cameras.calibrated import CalibratedCamera
from posekit.errors import InputError, PosekitError
from posekit.formats import own as files
from posekit.formats.cameras import write_cameras
from posekit.formats.keypoints import KeyPoints, swap
from posekit.formats.motion import Motion, write_motion
from posekit.formats.own import OpenCVModel, ScaledOrthographicModel, View
from posekit.formats.skeleton_maps import load_skeleton_map
from posekit.geometry import Array
from posekit.skeleton import HEAD_POINTS, JOINT, JOINTS
from posekit.synthesis import Walker, walker_scene
from posekit.views.person import DEFAULT_PROPORTIONS, middle_neck
from posekit.views.person_view import person_view
from tests.detector_files import view_keypoints, write_keypoints

FIGURE = posekit.load_figure()
PERSON = FIGURE.scaled(middle_neck(FIGURE.lengths))
COCO = load_skeleton_map("coco_17").points
SIZE = (1920, 1080)
K = np.array([[1400.0, 0, 960], [0, 1400.0, 540], [0, 0, 1]])
CAMERA = OpenCVModel(K=K, size=SIZE)
UNCALIBRATED = ScaledOrthographicModel(scale=None)
ON_THE_RAY: Final = 1e-6
"""Pixels: every joint that was seen stands on its ray, however wide lengths and angles are tolerated."""


def walk(frames: int = 2, camera: tuple[float, float, float] = (3.0, 0.3, 3.0), dt: float = 0.2) -> View:
    """Return a walker and the truth, seen by a camera that looks at them from the side and ahead."""
    scene = walker_scene(Walker(), camera=camera, frames=frames, dt=dt, carried=False)
    pinhole = PinholeCamera(K=K)
    R, t = scene.R_cam_world[0], scene.t_cam_world[0]
    return View(
        camera=OpenCVModel(K=K, size=SIZE, R=R, t=t),
        time=scene.time,
        image=pinhole.project(scene.joints_cam),
        head_image=pinhole.project(scene.head_cam),
        truth=scene.joints_cam,
    )


def seen(view: View, name: str = "coco-results") -> KeyPoints:
    found = view_keypoints(view, name)
    return replace(found, confidence=np.where(np.isnan(found.points[..., 0]), np.nan, 0.9))


def moved(keypoints: KeyPoints, points: Array, **others: Any) -> KeyPoints:
    lost = np.isnan(points[..., 0])
    return replace(
        keypoints, points=points, confidence=np.where(lost, np.nan, keypoints.confidence), **others
    )


WALK = walk()
SEEN = seen(WALK)


@settings(max_examples=40)
@given(
    missing=st.lists(st.sets(st.sampled_from(range(len(COCO)))), min_size=2, max_size=2),
    noise=st.sampled_from([0.0, 0.0, 3.0]),
    calibrated=st.booleans(),
)
def test_any_missing_points_give_postures_on_the_others_rays_or_a_reason(
    missing: list[set[int]], noise: float, calibrated: bool
) -> None:
    points = SEEN.points + noise * np.random.default_rng(1).standard_normal(SEEN.points.shape)
    for row, lost in enumerate(missing):
        points[row, sorted(lost)] = np.nan
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            view = person_view(moved(SEEN, points), CAMERA if calibrated else UNCALIBRATED, PERSON)
        recovery = posekit.recover(view, infer=False, refine=False)
    except PosekitError as error:
        assert "\n" not in str(error)
        assert len(str(error)) < 300
        return
    assert len(recovery.frames) == len(view)
    for k, frame in enumerate(recovery.frames):
        if not len(frame):
            assert frame.reason or sum(frame.rejected.values()) > 0
            assert "\n" not in frame.reason
            continue
        joints = frame.joints
        unseen = np.isnan(view.image[k, :, 0])
        assert np.isnan(joints[:, unseen]).all()
        if calibrated:
            assert (joints[:, ~np.isnan(joints[0, :, 0]), 2] > 0).all()
            off = PinholeCamera(K=K).project(joints) - view.image[k]
        else:
            assert frame.scales is not None
            off = joints[..., :2] * frame.scales[:, None, None] - view.image[k]
            off -= np.nanmean(off, axis=1, keepdims=True)  # where it stands across the view is not known
        known = np.isfinite(off[..., 0])
        assert known.any(axis=1).all()
        assert np.abs(off[known]).max() < ON_THE_RAY


@pytest.mark.parametrize(
    ("lost", "calibrated"),
    [
        (("left_wrist",), False),
        (("left_elbow", "left_wrist"), False),
        (("left_knee", "left_ankle", "right_wrist"), False),
        (("left_hip",), False),
        (("nose", "left_ear"), True),
        (("right_knee", "right_ankle", "left_knee", "left_ankle", "left_hip", "right_hip"), False),
    ],
)
def test_joints_that_were_not_seen_are_inferred_and_the_others_stay(
    lost: tuple[str, ...], calibrated: bool
) -> None:
    points = SEEN.points[:1].copy()
    points[:, [COCO.index(name) for name in lost]] = np.nan
    one = walk(1)
    view = person_view(moved(seen(one), points), CAMERA if calibrated else UNCALIBRATED, PERSON)
    alone = posekit.recover(view, infer=False, refine=False).frames[0]
    frame = posekit.recover(view, refine=False).frames[0]
    assert 0 < len(frame) <= len(alone)
    unseen = set(np.flatnonzero(np.isnan(view.image[0, :, 0])).tolist())
    if not unseen:
        np.testing.assert_array_equal(frame.joints, alone.joints)
        return
    rest = np.flatnonzero(np.isfinite(alone.joints).all(axis=(0, 2)))
    assert not unseen & set(rest.tolist())
    apart = np.abs(frame.joints[:, None][:, :, rest] - alone.joints[None][:, :, rest]).max(axis=(2, 3))
    assert (apart.min(axis=1) == 0).all()
    assert frame.inferred is not None
    # What hangs on a joint that was not seen has no place of its own either.
    assert all(not {JOINT[name] for name in one} & set(rest.tolist()) for one in frame.inferred)


def folder_of(path: Path, keypoints: KeyPoints, name: str = "openpose-body_25b") -> Path:
    write_keypoints(path, keypoints, name)
    return path


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a folder of two people: one who walks, and a smaller one beside, whose arms hang, in the first two of 3."""
    near, far = seen(walk(3)), seen(walk(3))
    beside = far.points * 0.4 + np.array([1200.0, 300.0])
    rows = [0, 1, 0, 1, 0]
    frame = np.array([0, 0, 1, 1, 2])
    both = np.stack([(near.points, beside)[who][k] for who, k in zip(rows, frame.tolist(), strict=True)])
    sure = np.stack(
        [(near.confidence, far.confidence * 0.5)[who][k] for who, k in zip(rows, frame, strict=True)]
    )
    return folder_of(
        tmp_path_factory.mktemp("people") / "pictures",
        replace(
            near,
            frame=frame,
            points=both,
            confidence=sure,
            person=np.array(rows),
            occluded=np.zeros(sure.shape, dtype=bool),
            score=np.full(5, np.nan),
        ),
    )


@pytest.fixture(scope="module")
def calibration(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("camera") / "calibration.toml"
    model = WALK.camera
    assert isinstance(model, OpenCVModel)
    write_cameras(path, {"side": CalibratedCamera(name="side", K=K, size=SIZE, R=model.R, t=model.t)})
    return path


Run = Callable[..., Any]


def view_from(command: Run, path: Path, folder: Path, *options: object) -> View:
    done = command("convert", path, folder / "view.json", "--to", "view", *options)
    assert done.code == 0, done.err
    return files.read_view(folder / "view.json")


def test_people_are_chosen_by_number_and_by_rule(
    people: Path, calibration: Path, command: Run, tmp_path: Path
) -> None:
    listed = command("inspect", people)
    assert "3 pictures of unknown size, 5 detections, 1 to 2 a picture" in listed.out
    shoulder = JOINT["left_shoulder"]
    x = {
        who: view_from(command, people, tmp_path, "--camera", calibration, "--person", who).image[
            0, shoulder, 0
        ]
        for who in ("0", "1", "largest", "first", "surest")
    }
    assert x["0"] == x["largest"] == x["first"] == x["surest"]
    assert x["1"] == pytest.approx(0.4 * x["0"] + 1200)
    missing = command("recover", people, "-o", tmp_path / "r.npz", "--camera", calibration, "--person", "2")
    assert missing.code == 2
    assert "(0, 1)" in missing.err
    assert not (tmp_path / "r.npz").exists()


def test_all_people_have_files_of_their_own(
    people: Path, calibration: Path, command: Run, tmp_path: Path
) -> None:
    done = command("recover", people, "-o", tmp_path / "r.json", "--person", "all")
    assert done.code == 0, done.err
    counts = [len(files.read_result(tmp_path / f"r.person{k}.json").frames) for k in (0, 1)]
    assert counts == [3, 3]  # pictures, in one of which the second is not
    assert "1 of 3 frames not recovered: none of neck, right_shoulder, left_shoulder, pelvis" in done.err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["r.person0.json", "r.person1.json"]
    assert done.out.count("written: ") == 2
    assert (
        command("convert", people, tmp_path / "v.json", "--camera", calibration, "--person", "all").code == 0
    )
    assert (tmp_path / "v.person1.json").exists()


def test_somebody_without_shoulders_does_not_stop_the_others(
    calibration: Path, command: Run, tmp_path: Path
) -> None:
    keypoints = seen(walk(1))
    half = keypoints.points + np.array([500.0, 0.0])
    half[:, [COCO.index("left_shoulder")]] = np.nan
    both = np.concatenate([keypoints.points, half])
    two = replace(
        keypoints,
        frame=np.array([0, 0]),
        points=both,
        confidence=np.where(np.isnan(both[..., 0]), np.nan, 0.9),
        person=np.array([0, 1]),
        occluded=np.zeros(both.shape[:2], dtype=bool),
        score=np.full(2, np.nan),
    )
    path = folder_of(tmp_path / "two", two)
    done = command("recover", path, "-o", tmp_path / "r.npz", "--camera", calibration, "--person", "all")
    assert done.code == 0, done.err
    assert "person 1 is left out" in done.err
    lone = command("recover", path, "-o", tmp_path / "r1.npz", "--camera", calibration, "--person", "1")
    assert lone.code == 2
    assert "both shoulders" in lone.err
    assert not (tmp_path / "r1.npz").exists()


@pytest.mark.parametrize("camera", [(4.0, 0.2, 0.5), (3.0, 0.3, 3.0), (-3.5, 0.5, 1.5), (0.5, 0.2, 4.0)])
def test_swapped_sides_are_noticed_while_somebody_walks(
    camera: tuple[float, float, float], command: Run, tmp_path: Path
) -> None:
    """From ahead, ahead and beside, behind and beside, and beside; the face is seen where it would be."""
    keypoints = seen(walk(14, camera, 0.1))
    right = folder_of(tmp_path / "right", keypoints)
    wrong = folder_of(tmp_path / "wrong", swap(keypoints))
    assert "look swapped" not in command("inspect", right).out
    assert "look swapped" in command("inspect", wrong).out
    assert "look swapped" not in command("inspect", wrong, "--swap-sides").out
    put_right = command("convert", wrong, tmp_path / "v.json", "--swap-sides")
    assert "look swapped" not in put_right.err
    exact = files.read_view(tmp_path / "v.json").image[:, JOINT["left_knee"]]
    np.testing.assert_allclose(exact, walk(14, camera, 0.1).image[:, JOINT["left_knee"]], rtol=0, atol=1e-9)
    noticed = command("convert", wrong, tmp_path / "w.json")
    assert noticed.code == 0
    assert "look swapped" in noticed.err
    assert "--swap-sides" in noticed.err
    undone = command("convert", right, tmp_path / "u.json", "--swap-sides")
    assert "as --swap-sides has them; leave it out" in undone.err


def test_recover_warns_of_swapped_sides(command: Run, tmp_path: Path) -> None:
    keypoints = seen(walk(14, dt=0.1))
    done = command("recover", folder_of(tmp_path / "wrong", swap(keypoints)), "-o", tmp_path / "r.npz")
    assert done.code == 0, done.err
    assert "look swapped" in done.err


def test_unsure_points_count_as_not_seen(calibration: Path, command: Run, tmp_path: Path) -> None:
    keypoints = seen(WALK)
    sure = keypoints.confidence.copy()
    sure[:, COCO.index("left_wrist")] = 0.2
    path = folder_of(tmp_path / "k", replace(keypoints, confidence=sure))
    everything = view_from(command, path, tmp_path, "--camera", calibration)
    assert np.isfinite(everything.image).all()
    some = view_from(command, path, tmp_path, "--camera", calibration, "--min-confidence", 0.3)
    assert np.argwhere(np.isnan(some.image[..., 0]))[:, 1].tolist() == [JOINT["left_wrist"]] * 2
    nobody = command("convert", path, tmp_path / "n.json", "--camera", calibration, "--min-confidence", 0.95)
    assert nobody.code == 2
    assert "smaller --min-confidence" in nobody.err
    assert not (tmp_path / "n.json").exists()


def test_a_size_makes_pixels_of_fractions(calibration: Path, command: Run, tmp_path: Path) -> None:
    path = tmp_path / "landmarks.json"
    write_keypoints(path, replace(seen(WALK), size=np.full((2, 2), np.array(SIZE, dtype=float))), "mediapipe")
    document = json.loads(path.read_text())
    for frame in document["frames"]:
        del frame["image_width"], frame["image_height"]
    path.write_text(json.dumps(document))
    refused = command("recover", path, "-o", tmp_path / "r.npz", "--camera", calibration)
    assert refused.code == 2
    assert "give --size WIDTHxHEIGHT" in refused.err
    view = view_from(command, path, tmp_path, "--camera", calibration, "--size", "1920x1080")
    limbs = [k for k, name in enumerate(JOINTS) if name not in ("neck", "pelvis")]
    np.testing.assert_allclose(view.image[:, limbs], WALK.image[:, limbs], rtol=0, atol=1e-9)
    other = command("convert", path, tmp_path / "o.json", "--camera", calibration, "--size", "1280x720")
    assert other.code == 2
    assert "is calibrated for 1920x1080 pixels" in other.err
    turned = command("convert", path, tmp_path / "o.json", "--camera", calibration, "--size", "1080x1920")
    assert turned.code == 2 and "width and height are exchanged" in turned.err
    assert "exchanged" not in other.err


def test_a_rate_gives_times(calibration: Path, command: Run, tmp_path: Path) -> None:
    path = folder_of(tmp_path / "k", seen(walk(3)))
    for rate, expected in ((50, 1 / 50), (None, 1 / 30)):
        options = [] if rate is None else ["--fps", rate]
        view = view_from(command, path, tmp_path, "--camera", calibration, *options)
        np.testing.assert_allclose(np.diff(view.time), expected, rtol=0, atol=1e-12)


def test_lengths_come_from_a_stature_a_file_or_a_recording(
    calibration: Path, command: Run, tmp_path: Path
) -> None:
    path = folder_of(tmp_path / "k", seen(WALK))
    options = ("--camera", calibration)
    built_in = view_from(command, path, tmp_path, *options)
    assert built_in.lengths["right_hip-right_knee"] == pytest.approx(FIGURE.lengths["right_hip-right_knee"])
    tall = view_from(command, path, tmp_path, *options, "--stature", "190cm")
    expected = lengths_from_proportions(DEFAULT_PROPORTIONS, 1.9).lengths
    assert tall.lengths["right_hip-right_knee"] == pytest.approx(expected["right_hip-right_knee"])
    winter = view_from(command, path, tmp_path, *options, "--stature", "1.9m", "--proportions", "winter")
    other = lengths_from_proportions("winter", 1.9).lengths
    assert winter.lengths["left_knee-left_ankle"] == pytest.approx(other["left_knee-left_ankle"])
    write_motion(tmp_path / "truth.trc", in_world(WALK))
    recorded = view_from(command, path, tmp_path, *options, "--calibrate", tmp_path / "truth.trc")
    for limb in ("left_elbow-left_wrist", "right_hip-right_knee", "right_hip-left_hip"):
        assert recorded.lengths[limb] == pytest.approx(FIGURE.lengths[limb], abs=1e-6)
    pictures = command("convert", path, tmp_path / "p.json", *options, "--calibrate", path)
    assert pictures.code == 2
    assert "give --stature" in pictures.err
    guessed = view_from(command, path, tmp_path, *options, "--calibrate", path, "--stature", "1.75m")
    assert 0.3 < guessed.lengths["right_hip-right_knee"] < 0.55
    for view in (built_in, tall, winter, recorded, guessed):
        half = view.lengths["right_shoulder-left_shoulder"] / 2
        assert view.lengths["neck-right_shoulder"] == pytest.approx(
            half
        )  # COCO's neck is between the shoulders


def in_world(view: View) -> Motion:
    model = view.camera
    assert isinstance(model, OpenCVModel)
    assert model.R is not None
    assert model.t is not None
    return Motion(
        names=JOINTS,
        points=(view.truth - model.t) @ model.R,
        time=view.time,
        rate=1 / float(view.time[1] - view.time[0]),
        up="+y",
    )


def test_a_field_of_view_or_a_focal_length_makes_a_camera(command: Run, tmp_path: Path) -> None:
    path = folder_of(tmp_path / "k", seen(WALK))
    options = ("--size", "1920x1080")
    cases = (
        ("--fov", 68.9, 960 / np.tan(np.radians(68.9 / 2))),
        ("--focal35", 28, np.hypot(1920, 1080) * 28 / np.hypot(36, 24)),
    )
    for option, value, f in cases:
        view = view_from(command, path, tmp_path, option, value, *options)
        assert isinstance(view.camera, OpenCVModel)
        np.testing.assert_allclose(np.diag(view.camera.K), [f, f, 1.0], rtol=1e-9, atol=0)
        assert view.camera.R is None
    for bad in (("--fov", 190), ("--fov", "nan"), ("--focal35", -28)):
        refused = command("convert", path, tmp_path / "n.json", *bad, *options)
        assert refused.code == 2
        assert refused.err.startswith(f"posekit: error: {bad[0]}: ")


def test_without_any_camera_the_view_is_scaled_orthographic(command: Run, tmp_path: Path) -> None:
    path = folder_of(tmp_path / "k", seen(WALK))
    done = command("recover", path, "-o", tmp_path / "r.json", "--stature", "1.75m")
    assert done.code == 0, done.err
    assert "no camera: scaled orthographic" in done.out
    frames = files.read_result(tmp_path / "r.json").frames
    assert all(len(frame.joints) for frame in frames)
    assert isinstance(view_from(command, path, tmp_path).camera, ScaledOrthographicModel)
    refused = command("recover", path, "-o", tmp_path / "x.json", "--root", "torso")
    assert refused.code == 2
    assert "camera is not known" in refused.err


@pytest.mark.parametrize("method", ["head", "torso", "search"])
def test_the_neck_is_placed_as_it_is_asked(
    method: str, calibration: Path, command: Run, tmp_path: Path
) -> None:
    keypoints = seen(WALK)
    path = folder_of(tmp_path / "k", keypoints)
    done = command("recover", path, "-o", tmp_path / "r.npz", "--camera", calibration, "--root", method)
    assert done.code == 0, done.err
    for k, frame in enumerate(files.read_result(tmp_path / "r.npz").frames):
        assert frame.root is not None
        assert frame.root.method in (method, "search")  # where a method fails, the depth is searched
        depths = frame.joints[:, 0, 2]
        true = WALK.truth[k, 0, 2]
        assert depths.min() - 0.15 < true < depths.max() + 0.15


def test_less_certain_points_allow_more(calibration: Path, command: Run, tmp_path: Path) -> None:
    path = folder_of(tmp_path / "k", seen(walk(1)))
    counts = []
    for deviation in (1, 3, 9):
        out = tmp_path / "r.npz"
        options = ("--camera", calibration, "--deviation", deviation, "--no-refine")
        done = command("recover", path, "-o", out, *options)
        assert done.code == 0, done.err
        counts.append(len(files.read_result(out).frames[0].joints))
    assert 0 < counts[0] <= counts[1] <= counts[2]
    assert view_from(command, path, tmp_path, "--camera", calibration, "--deviation", 3).deviation == 3


@pytest.mark.parametrize("turned", [False, True])
def test_survivors_are_compared_with_a_truth_in_other_axes(
    turned: bool, calibration: Path, command: Run, tmp_path: Path
) -> None:
    view = walk(2, dt=0.1)
    path = folder_of(tmp_path / "k", seen(view))
    motion = in_world(view)
    if turned:
        motion = replace(motion, points=motion.points[..., [2, 0, 1]], up="+z")
    write_motion(tmp_path / "truth.npz", motion)
    done = command(
        "recover",
        path,
        "-o",
        tmp_path / "r.npz",
        "--camera",
        calibration,
        "--truth",
        tmp_path / "truth.npz",
        "--length-deviation",
        "0",
    )
    assert done.code == 0, done.err
    assert "2 of 2 frames; its axes" in done.out
    assert "misses the key points by 0.0 px" in done.out
    rows = {
        line.split("|")[1].strip(): [float(cell.split("/")[0]) for cell in line.split("|")[2:5]]
        for line in done.out.splitlines()
        if line.startswith("| ") and "/" in line and "survivors" not in line
    }
    assert len(rows) == 3
    for best, first, middle in rows.values():
        assert best <= min(first, middle)
    assert rows["moved to the true middle"][0] < 25


def test_a_truth_of_somebody_else_is_refused_and_nothing_written(
    people: Path, calibration: Path, command: Run, tmp_path: Path
) -> None:
    write_motion(tmp_path / "truth.npz", in_world(walk(3)))
    options = ("--camera", calibration, "--truth", tmp_path / "truth.npz", "--fps", 5)
    out = tmp_path / "r.npz"
    refused = command("recover", people, "-o", out, *options, "--person", 1)
    assert refused.code == 2
    assert "misses the key points" in refused.err
    assert not out.exists()
    every = command(
        "recover", people, "-o", out, *options, "--person", "all", "--root", "torso", "--deviation", 0.5
    )
    assert every.code == 0, every.err
    assert "person 1 has no truth" in every.err
    assert "no frame has both survivors and a truth" in every.out


def test_head_points_reach_the_view(command: Run, tmp_path: Path) -> None:
    view = view_from(command, folder_of(tmp_path / "k", seen(WALK)), tmp_path)
    np.testing.assert_allclose(view.head_image, WALK.head_image, rtol=0, atol=1e-9)
    assert view.head_image.shape[1] == len(HEAD_POINTS)


def test_a_reason_is_one_line() -> None:
    nothing = moved(SEEN, np.full_like(SEEN.points, np.nan))
    with pytest.raises(InputError, match="both shoulders"):
        person_view(nothing, CAMERA, PERSON)
