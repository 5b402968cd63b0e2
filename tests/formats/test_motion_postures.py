"""From names to joints: every map, what is derived against the figure, which way is up, and captures of any format."""

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.formats.motion import (
    UP_DIRECTIONS,
    Motion,
    guess_up,
    postures_of,
    read_motion,
    with_up,
    write_motion,
)
from posekit.formats.motion.postures import layout_of
from posekit.formats.skeleton_maps import LANDMARK_ORDER, SkeletonMap, load_skeleton_map, skeleton_map_names
from posekit.recovery.taylor_figure.completion import Completion
from posekit.skeleton import JOINT, JOINTS, POINTS
from posekit.synthesis import mocap_scene, random_postures, read_capture

FIGURE = load_figure()
OURS = ("posekit", "cmu_mocap", "pose2sim", "joint_centres", "plug_in_gait", "motionbuilder")


def points(n=30, seed=0, upright=True):
    """Place the figure's 19 points in random legal postures, z up."""
    q = random_postures(FIGURE, n, np.random.default_rng(seed))
    if upright:
        q[:, 3:7] = [0, 0, 0, 1]
    return FIGURE.forward_kinematics(q)


def landmarks_of(body):
    found = np.full((len(body), len(LANDMARK_ORDER), 3), np.nan)
    found[:, : len(POINTS)] = body
    for k, joint in ((-2, "shoulder"), (-1, "hip")):
        found[:, k] = (body[:, JOINT[f"right_{joint}"]] + body[:, JOINT[f"left_{joint}"]]) / 2
    return found


def motion_by(layout, body, **changed):
    """Write postures down under a map's names."""
    names = tuple(parts[0] for parts in layout.landmarks.values() if len(parts) == 1)
    columns = [
        LANDMARK_ORDER.index(landmark) for landmark, parts in layout.landmarks.items() if len(parts) == 1
    ]
    fields = {"names": names, "points": landmarks_of(body)[:, columns], "time": np.arange(len(body)) / 30}
    return Motion(**{**fields, "rate": 30.0, **changed})


@pytest.mark.parametrize("name", skeleton_map_names())
def test_every_map_gives_its_joints_back(name):
    layout, body = load_skeleton_map(name), points()
    found = postures_of(motion_by(layout, body), layout)
    for k, joint in enumerate(JOINTS):
        if joint in layout.landmarks:
            np.testing.assert_array_equal(found.joints[:, k], body[:, k])
    assert set(found.derived) == {"pelvis", "neck"} - set(layout.landmarks)
    assert np.isfinite(found.joints).all()
    for k, point in enumerate(POINTS[len(JOINTS) :]):
        assert np.isfinite(found.head[:, k]).all() == (point in layout.landmarks)


@pytest.mark.parametrize("name", OURS)
def test_a_map_is_found_by_its_own_names(name):
    layout = load_skeleton_map(name)
    named = [part for parts in layout.landmarks.values() for part in parts]
    assert layout_of(named).name == name
    assert layout_of([*named, "toe", "T10"]).name == name


def test_names_are_compared_to_the_letter_before_they_are_compared_freely():
    sides = [
        f"{side}{joint}" for joint in ("Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle") for side in "RL"
    ]
    assert layout_of([*sides, "Neck", "Nose", "Head"]).name == "pose2sim"
    underscored = [f"{name[0].lower()}_{name[1:].lower()}" for name in sides]
    assert layout_of([*underscored, "neck", "pelvis"]).name == "cmu_mocap"
    prefixed = [f"Subject1:{name}" for name in sides]
    assert layout_of(prefixed).name in {"pose2sim", "cmu_mocap"}


def test_a_detectors_own_point_set_is_read_by_its_own_map():
    halpe = load_skeleton_map("halpe_26")
    found = postures_of(motion_by(halpe, points(), names=halpe.points, points=np.zeros((30, 26, 3)) + 1.0))
    assert found.layout.name == "halpe_26"
    assert found.derived == ("pelvis", "neck")


def test_neck_and_pelvis_are_placed_as_the_figures_torso_says():
    body = points(200)
    layout = load_skeleton_map("joint_centres")
    found = postures_of(motion_by(layout, body), layout, FIGURE)
    names = (*(name for name in JOINTS if name not in ("neck", "pelvis")), "mid_shoulders", "mid_hips")
    columns = [LANDMARK_ORDER.index(name) for name in names]
    expected = Completion(figure=FIGURE, points=names).complete(landmarks_of(body)[:, columns])
    np.testing.assert_allclose(found.joints, expected, rtol=0, atol=1e-12)
    straight = np.zeros((1, FIGURE.model.nq))
    straight[:, 6] = 1.0
    neutral = FIGURE.forward_kinematics(straight)
    placed = postures_of(motion_by(layout, neutral), layout, FIGURE).joints[0]
    apart = np.linalg.norm(placed - neutral[0, : len(JOINTS)], axis=-1)
    assert apart.max() < 0.04  # the torso's shoulders stand 3.7 cm before the line from neck to pelvis


@pytest.mark.parametrize("scale", [0.5, 1.3])
def test_what_is_derived_grows_with_the_person_and_moves_with_them(scale):
    layout, body = load_skeleton_map("plug_in_gait"), points(5)
    small = postures_of(motion_by(layout, body), layout).joints
    R = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    moved = scale * body @ R.T + [1.0, 2.0, 3.0]
    large = postures_of(motion_by(layout, moved), layout).joints
    np.testing.assert_allclose(large, scale * small @ R.T + [1.0, 2.0, 3.0], rtol=0, atol=1e-12)
    mirrored = postures_of(motion_by(layout, body * [1, -1, 1]), layout).joints
    assert np.linalg.norm(mirrored[:, 0] - small[:, 0] * [1, -1, 1], axis=-1).max() > 0.05


def test_a_missing_joint_stays_missing_and_so_does_what_hangs_on_it():
    layout, body = load_skeleton_map("pose2sim"), points(3)
    body[1, JOINT["right_hip"]] = np.nan
    body[2, JOINT["left_elbow"]] = np.nan
    found = postures_of(motion_by(layout, body))
    unknown = np.isnan(found.joints[..., 0])
    assert [JOINTS[k] for k in np.flatnonzero(unknown[1])] == ["neck", "pelvis", "right_hip"]
    assert [JOINTS[k] for k in np.flatnonzero(unknown[2])] == ["left_elbow"]


@pytest.mark.parametrize("up", list(UP_DIRECTIONS))
def test_up_is_where_necks_are_above_ankles(up):
    body = points(40)
    turned = with_up(motion_by(load_skeleton_map("posekit"), body, up="+z"), up)
    assert guess_up(postures_of(turned).joints) == up


def test_nobody_who_stands_is_no_guess():
    joints = points(1)[:, : len(JOINTS)]
    lying = joints.copy()
    lying[..., [0, 2]] = (joints[..., [2, 0]] + joints[..., [0, 2]] * [1, -1]) / np.sqrt(2)
    lying[..., 1] += lying[..., 2]
    with pytest.raises(InputError, match="state it: \\+x, -x"):
        guess_up(lying)
    with pytest.raises(InputError, match="state it"):
        guess_up(np.full((4, 14, 3), np.nan))


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (("a", "b"), "names of one of the maps"),
        (("RSHO", "LSHO", "RELB", "RASI"), "names of one of the maps"),
        (
            tuple(name.replace("right_knee", "right_kneecap") for name in JOINTS),
            "no right_knee by the map .*did you mean right_kneecap",
        ),
    ],
)
def test_names_of_no_map_are_refused_in_one_line(names, words):
    one = Motion(names=names, points=np.zeros((2, len(names), 3)), time=np.arange(2.0), rate=1)
    with pytest.raises(InputError, match=words) as refused:
        postures_of(one)
    assert "\n" not in str(refused.value)
    other = SkeletonMap(name="mine", points=(), landmarks={"neck": ("C7",)})
    with pytest.raises(InputError, match="no point of the map mine"):
        postures_of(one, other)


@pytest.mark.parametrize("suffix", ["trc", "c3d", "csv", "npz", "parquet"])
@pytest.mark.parametrize("name", ["posekit", "pose2sim"])
def test_a_capture_comes_from_any_format(tmp_path, suffix, name):
    body = points(12)
    one = motion_by(load_skeleton_map(name), body, up="+z")
    path = tmp_path / f"walk.{suffix}"
    write_motion(path, one)
    capture = read_capture(path)
    turned = with_up(one, "+y") if suffix == "trc" else one
    np.testing.assert_allclose(capture.points[:, :14], postures_of(turned).joints, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(capture.up, UP_DIRECTIONS["+y" if suffix == "trc" else "+z"])
    assert capture.up_from == ("guessed" if suffix == "csv" else "file")
    assert capture.derived == (() if name == "posekit" else ("pelvis", "neck"))
    assert capture.fps == pytest.approx([30.0], rel=1e-9)
    scene = mocap_scene(capture, capture.names[0], np.random.default_rng(0), frames=4)
    assert len(scene) == 4
    assert read_capture(path, up="-x").up_from == "stated"


def test_a_capture_of_the_wrong_unit_says_so(tmp_path):
    one = motion_by(load_skeleton_map("posekit"), 1000 * points(3))
    write_motion(tmp_path / "a.csv", one)
    with pytest.raises(InputError, match="state the unit"):
        read_capture(tmp_path / "a.csv")
    capture = read_capture(tmp_path / "a.csv", unit="mm")
    np.testing.assert_allclose(capture.points[:, :14], points(3)[:, :14], rtol=0, atol=1e-12)
    assert read_motion(tmp_path / "a.csv", unit="mm").names == one.names
