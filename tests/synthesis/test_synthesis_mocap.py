"""Views of motion capture, from a small NPZ that the test writes: laws, units, names, and bad files."""

import zipfile

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.skeleton import JOINTS, SEGMENTS, segment_name
from posekit.synthesis import (
    CameraSphere,
    clip_lengths,
    mocap_scene,
    mocap_scenes,
    random_postures,
    read_capture,
)

FIGURE = load_figure()
SHORT = tuple(name.replace("right_", "r_").replace("left_", "l_") for name in JOINTS)
RATES = (30.0, 60.0)
ORDER = [3, 0, *range(13, 3, -1), 1, 2]


def arrays(frames=(12, 20)):
    """Write two clips of random postures, y up, in a column order of their own, a toe among them."""
    q = random_postures(FIGURE, sum(frames), np.random.default_rng(4))
    points = FIGURE.forward_kinematics(q)[:, :14] @ np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]).T
    points += [3.0, 0.9, -2.0]
    toe = np.full((sum(frames), 1, 3), np.nan)
    return {
        "joints": np.concatenate([points[:, ORDER], toe], axis=1).astype(np.float32),
        "joint_names": np.array([SHORT[k] for k in ORDER] + ["r_toe"]),
        "clip": np.repeat([0, 1], frames).astype(np.int16),
        "clip_names": np.array(["walk/one", "run/two"]),
        "clip_action": np.array(["walking", "running"]),
        "clip_fps": np.array(RATES),
        "up": np.array("+y"),
        "unit": np.array("m"),
    }


@pytest.fixture
def save(tmp_path):
    def write(**changed):
        path = tmp_path / "clip.npz"
        content = {key: value for key, value in {**arrays(), **changed}.items() if value is not None}
        np.savez(path, **content)
        return path

    return write


def world(scene):
    return np.einsum("fji,fpj->fpi", scene.R_cam_world, scene.joints_cam - scene.t_cam_world[:, None])


def test_names_units_and_clips_are_read(save):
    capture = read_capture(save())
    given = arrays()
    for name in JOINTS:
        column = ORDER.index(JOINTS.index(name))
        np.testing.assert_array_equal(capture.points[:, JOINTS.index(name)], given["joints"][:, column])
    assert np.isnan(capture.points[:, 14:]).all()
    assert (capture.names, capture.actions) == (("walk/one", "run/two"), ("walking", "running"))
    np.testing.assert_array_equal(capture.fps, RATES)
    in_mm = read_capture(save(joints=given["joints"] * np.float32(1000), unit=np.array("mm")))
    np.testing.assert_allclose(in_mm.points[:, :14], capture.points[:, :14], rtol=1e-6)
    long = np.array([name.replace("r_", "right_").replace("l_", "left_") for name in SHORT])
    renamed = read_capture(save(joint_names=np.append(long[ORDER], "r_toe")))
    np.testing.assert_array_equal(renamed.points, capture.points)


def test_optional_keys_may_be_absent(save):
    capture = read_capture(
        save(clip=None, clip_names=None, clip_action=None, up=None, unit=None, clip_fps=np.array(25.0))
    )
    assert capture.names == ("0",)
    assert len(mocap_scene(capture, "0", np.random.default_rng(0))) == 32


def test_head_points_are_taken_where_they_are(save):
    given = arrays()
    nose = given["joints"][:, :1] + np.float32(0.1)
    capture = read_capture(
        save(
            joints=np.concatenate([given["joints"], nose], axis=1),
            joint_names=np.append(given["joint_names"], "nose"),
        )
    )
    scene = mocap_scene(capture, "walk/one", np.random.default_rng(0))
    assert np.isfinite(scene.head_image[:, 0]).all()
    assert np.isnan(scene.head_image[:, 1:]).all()
    np.testing.assert_array_equal(scene.root, scene.joints_cam[:, 0])


def test_views_project_and_keep_the_captures_distances(save):
    capture = read_capture(save())
    for scene in (
        mocap_scene(capture, "run/two", np.random.default_rng(0)),
        *mocap_scenes(capture, 10, np.random.default_rng(0)),
    ):
        np.testing.assert_array_equal(scene.image, scene.camera.project(scene.joints_cam))
        assert (scene.image >= 0).all()
        assert scene.size is not None
        assert (scene.image <= scene.size).all()
        for a, b in SEGMENTS:
            length = np.linalg.norm(scene.joints_cam[:, a] - scene.joints_cam[:, b], axis=-1)
            expected = FIGURE.lengths[segment_name((a, b))]
            np.testing.assert_allclose(length, expected, rtol=0, atol=2e-6)  # float32 files
            assert scene.figure.lengths[segment_name((a, b))] == pytest.approx(expected, abs=2e-6)
        np.testing.assert_array_equal(scene.root, scene.joints_cam[:, 0])
        assert np.isnan(scene.q).all()


def test_lengths_are_medians_over_the_chosen_frames(save):
    given = arrays((5, 20))
    elbow = list(given["joint_names"]).index("r_elbow")
    joints = given["joints"].astype(np.float64)
    wrist = list(given["joint_names"]).index("r_wrist")
    forearm = joints[:, wrist] - joints[:, elbow]
    stretch = np.concatenate([[1.0, 1.1, 1.2, 1.3, 1.4], np.ones(20)])
    joints[:, wrist] = joints[:, elbow] + stretch[:, None] * forearm
    capture = read_capture(save(**{**given, "joints": joints}))
    assert clip_lengths(capture.points[:5])["right_elbow-right_wrist"] == pytest.approx(0.26 * 1.2, abs=1e-6)
    scene = mocap_scene(capture, "walk/one", np.random.default_rng(0))
    assert scene.figure.lengths["right_elbow-right_wrist"] == pytest.approx(0.26 * 1.2, abs=1e-6)


def test_frames_are_chosen_by_time_or_evenly(save):
    capture = read_capture(save())
    rng = np.random.default_rng(0)
    stepped = mocap_scene(capture, "run/two", rng, frames=3, dt=0.1)
    np.testing.assert_allclose(stepped.time, [0, 0.1, 0.2], rtol=0, atol=1e-12)
    np.testing.assert_allclose(world(stepped), capture.points[[12, 18, 24], :14], rtol=0, atol=1e-12)
    even = mocap_scene(capture, "run/two", rng, frames=3)
    np.testing.assert_allclose(world(even), capture.points[[12, 22, 31], :14], rtol=0, atol=1e-12)
    assert len(mocap_scene(capture, "run/two", rng, frames=1)) == 1
    assert len(mocap_scene(capture, "run/two", rng, frames=999)) == 20


def test_frames_without_a_neck_are_passed_over(save):
    given = arrays()
    given["joints"][[0, 5], 1] = np.nan
    given["joints"][3, 4] = np.nan
    capture = read_capture(save(**given))
    scene = mocap_scene(capture, "walk/one", np.random.default_rng(0))
    assert len(scene) == 10
    assert np.isnan(scene.image[2]).any(axis=-1).sum() == 1
    views = mocap_scenes(capture, 29, np.random.default_rng(0))
    assert [len(view) for view in views] == [9, 20]
    assert not any(np.isnan(view.image).any() for view in views)


def test_a_given_camera_is_kept_and_looks_upright(save):
    capture = read_capture(save())
    scene = mocap_scene(capture, "walk/one", np.random.default_rng(0), position=(3.0, 1.5, 3.0))
    place = -np.einsum("fji,fj->fi", scene.R_cam_world, scene.t_cam_world)
    np.testing.assert_allclose(place, np.broadcast_to([3.0, 1.5, 3.0], place.shape), rtol=0, atol=1e-12)
    assert (scene.R_cam_world[:, 1, 1] < -0.9).all()


def test_views_are_shared_out_evenly_with_their_actions(save):
    capture = read_capture(save())
    views = mocap_scenes(capture, 9, np.random.default_rng(0))
    assert [(len(view), set(view.labels)) for view in views] == [(5, {"walking"}), (4, {"running"})]
    assert [len(view) for view in mocap_scenes(capture, 30, np.random.default_rng(0))] == [12, 18]
    assert len(mocap_scenes(capture, 1, np.random.default_rng(0))) == 1
    again = mocap_scenes(capture, 9, np.random.default_rng(0))
    for a, b in zip(views, again, strict=True):
        np.testing.assert_array_equal(a.image, b.image)
    cameras = views[0].R_cam_world
    assert len(np.unique(cameras.reshape(len(cameras), -1).round(6), axis=0)) == len(cameras)


def bad(key, change):
    return lambda given: {key: change(given[key])}


def with_infinity(joints):
    joints = joints.copy()
    joints[3, 2, 1] = np.inf
    return joints


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda _: {"joints": None}, "joints: got nothing"),
        (lambda _: {"joint_names": None}, "joint_names: got nothing"),
        (lambda _: {"clip_fps": None}, "clip_fps: got nothing"),
        (bad("joints", lambda joints: joints[0]), r"joints: got float32 of shape \(15, 3\)"),
        (bad("joints", lambda joints: np.zeros(joints.shape, dtype=int)), "joints: got int64"),
        (bad("joints", lambda joints: joints[:0]), "joints: got float32 of shape"),
        (bad("joints", with_infinity), r"frame 3: l_ankle: got .*inf.*; expected three finite numbers"),
        (bad("joints", lambda joints: joints.astype(object)), "pickles are not read"),
        (bad("joint_names", lambda names: names[:-1]), "joint_names: got 14 names"),
        (bad("joint_names", lambda names: np.char.replace(names, "r_knee", "r_kneecap")), "no right_knee"),
        (bad("joint_names", lambda names: np.arange(len(names))), "joint_names: got int64"),
        (bad("clip", lambda clip: clip[:-1]), "clip: got int16"),
        (bad("clip", lambda clip: clip + 1), "clip: got clips 1 to 2"),
        (bad("clip", lambda clip: clip.astype(float)), "clip: got float64"),
        (bad("clip_names", lambda names: names[[0, 0]]), "clip_names: got a name twice"),
        (bad("clip_action", lambda names: names[:1]), "clip_action: got 1 for 2"),
        (bad("clip_fps", lambda fps: fps * 0), "clip_fps: got"),
        (bad("clip_fps", lambda fps: fps * np.nan), "clip_fps: got"),
        (bad("clip_fps", lambda fps: np.append(fps, 3)), "clip_fps: got float64 of shape"),
        (lambda _: {"up": np.array("north")}, "up: got 'north'; expected one of"),
        (lambda _: {"unit": np.array("inch")}, "unit: got 'inch'; expected one of m, cm, mm"),
    ],
)
def test_bad_keys_are_refused_in_one_line(save, change, words):
    path = save(**change(arrays()))
    with pytest.raises(InputError, match=words) as refused:
        read_capture(path)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("kind", ["missing", "folder", "text", "cut", "damaged", "bomb", "empty"])
def test_bad_files_are_refused_in_one_line(save, tmp_path, kind):
    path = save()
    content = path.read_bytes()
    if kind == "missing":
        path.unlink()
    elif kind == "folder":
        path = tmp_path
    elif kind == "text":
        path.write_text("joints: 3\n")
    elif kind == "cut":
        path.write_bytes(content[: len(content) // 2])
    elif kind == "damaged":
        middle = content.index(b"NUMPY") + 200
        path.write_bytes(content[:middle] + b"\xff" * 64 + content[middle + 64 :])
    elif kind == "empty":
        with zipfile.ZipFile(path, "w"):
            pass
    else:
        header = (
            b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (10000000000000,), }"
        )
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("joints.npy", header.ljust(127) + b"\n")
    with pytest.raises(InputError) as refused:
        read_capture(path)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_file_that_unpacks_to_too_much_is_refused(save, monkeypatch):
    monkeypatch.setattr("posekit.synthesis.capture_file.MAX_BYTES", 1000)
    with pytest.raises(InputError, match="expected at most 0 MB; split it"):
        read_capture(save())


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"clip": "walk/on"}, r"'walk/on' is not among its 2; such as walk/one"),
        ({"frames": 0}, "one or more"),
        ({"dt": 0.0}, "dt is 0"),
        ({"dt": np.nan}, "dt is nan"),
        ({"position": (1.0, 2.0)}, "three finite numbers"),
        ({"position": (3.2, 1.0, -2.0)}, "leaves the picture"),
        ({"sphere": CameraSphere(distance=(0.2, 0.3))}, "does not fit"),
    ],
)
def test_impossible_views_are_refused_in_one_line(save, options, words):
    capture = read_capture(save())
    with pytest.raises(InputError, match=words) as refused:
        mocap_scene(capture, options.pop("clip", "walk/one"), np.random.default_rng(0), **options)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("n", [0, -3, 33])
def test_more_views_than_frames_are_refused(save, n):
    with pytest.raises(InputError, match="expected 1 to 32"):
        mocap_scenes(read_capture(save()), n, np.random.default_rng(0))


def test_a_clip_without_necks_is_refused(save):
    given = arrays()
    given["joints"][:12] = np.nan
    capture = read_capture(save(**given))
    with pytest.raises(InputError, match="no frame with a neck"):
        mocap_scene(capture, "walk/one", np.random.default_rng(0))
    assert [view.labels[0] for view in mocap_scenes(capture, 5, np.random.default_rng(0))] == ["running"]
