"""Synthetic views: the walker's gait, cameras around a body, noise, motion capture and robots."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure, segment_lengths
from posekit.cameras import PinholeCamera, ScaledOrthographicCamera
from posekit.cameras.head import TABLE_A2
from posekit.errors import InputError
from posekit.geometry import fit_rotation
from posekit.motion import Motion
from posekit.robots import load_robot
from posekit.skeleton import HEAD_POINTS, JOINTS, POINTS
from posekit.synthesis import (
    Walker,
    builtin_view,
    default_camera,
    forget_camera,
    look_at,
    mocap_view,
    mocap_views,
    object_document,
    object_view,
    place_cameras,
    random_configurations,
    random_postures,
    random_views,
    walker_view,
    with_noise,
)

SPEEDS = (0.5, 0.9, 1.3)


def walking(clips: int = 2, frames: int = 40, up: str = "+y") -> Motion:
    """Return a motion of walkers, each clip at its own speed."""
    parts = []
    for clip in range(clips):
        walker = Walker(velocity=SPEEDS[clip])
        time = np.arange(frames) / 30
        q = walker.configurations(walker.phase(time))
        q[:, :3] += walker.travel(time)
        parts.append(walker.figure.forward_kinematics(q))
    return Motion(
        joints=np.concatenate(parts),
        joint_names=POINTS,
        time=np.tile(np.arange(frames) / 30, clips),
        clip=np.repeat(np.arange(clips), frames),
        clips=[f"walk {clip}" for clip in range(clips)],
        up=up,
    )


@pytest.mark.parametrize("velocity", SPEEDS)
def test_gait_is_periodic_and_half_a_cycle_apart(velocity: float) -> None:
    walker = Walker(velocity=velocity)
    phase = np.linspace(0, 1, 101)
    for flexion in walker.flexion(phase).values():
        assert np.allclose(flexion[0], flexion[-1], atol=1e-12)
    later = walker.flexion(phase + 0.5)
    for joint, flexion in walker.flexion(phase).items():
        assert np.allclose(flexion[:, 0], later[joint][:, 1], atol=1e-12)


def test_gait_passes_through_the_printed_points_and_never_overshoots() -> None:
    flexion = {
        name: np.degrees(values[:, 0]) for name, values in Walker().flexion(np.linspace(0, 1, 1001)).items()
    }
    u = 0.5 / 0.8
    assert np.allclose(flexion["hip"][[500, 900]], [-15, 25])
    assert np.allclose(flexion["knee"][[170, 400, 750, 1000]], [3, 3, 70, 3])
    assert np.allclose(flexion["elbow"][[50, 900]], [6 + 8 * u, 8 + 9 * u])
    assert flexion["hip"].min() >= -15 - 1e-9 and flexion["hip"].max() <= 25 + 1e-9
    assert flexion["knee"].min() >= 3 - 1e-9 and flexion["knee"].max() <= 70 + 1e-9


@pytest.mark.parametrize("velocity", SPEEDS)
def test_a_cycle_advances_by_its_length(velocity: float) -> None:
    walker = Walker(velocity=velocity)
    way = walker.travel(np.array([0.0, walker.cycle_duration]))
    assert np.allclose(way[0], 0)
    assert np.allclose(way[1], [1.346 * np.sqrt(velocity) * walker.leg_length, 0, 0], atol=1e-9)


@pytest.mark.parametrize("name", ["seq1", "seq2"])
def test_builtin_views_are_exact_and_their_camera_stands_where_the_paper_says(name: str) -> None:
    view, f = builtin_view(name), 0.05
    depth = view.truth[..., 2:]
    assert np.allclose(view.image, f * view.truth[..., :2] / depth, rtol=0, atol=1e-15)
    lengths = load_figure().lengths
    for segment, length in segment_lengths(view.truth).items():
        assert length == pytest.approx(lengths[segment], abs=1e-9)
    # The head is seen exactly: with its rays, a rigid fit of Table A.2 gives the camera.
    neck, head = view.truth[0, 0], view.head_image[0]
    R = look_at(
        np.array({"seq1": (4.0, 0, 0), "seq2": (3.0, 0, 3.0)}[name]), np.zeros(3), np.array([0, 1.0, 0])
    )
    offsets = TABLE_A2.points[1:] - TABLE_A2.points[0]
    points = neck + offsets @ R.T
    assert np.allclose(head, f * points[:, :2] / points[:, 2:], atol=1e-12)
    centre = TABLE_A2.points[0] - R.T @ neck
    assert np.allclose(centre + f * R[2], {"seq1": (4, 0, 0), "seq2": (3, 0, 3)}[name], atol=1e-9)
    assert fit_rotation(offsets, (points - neck)[None])[0] == pytest.approx(R)


def test_a_camera_that_stands_sees_the_walker_come_nearer() -> None:
    carried, standing = (walker_view(Walker(), frames=3, carried=carried) for carried in (True, False))
    assert np.ptp(carried.truth[:, 0, 2]) < 1e-9
    assert (np.diff(standing.truth[:, 0, 2]) < -0.1).all()


@pytest.mark.parametrize("up", [(0.0, 0.0, 1.0), (0.0, 1.0, 0.0)])
def test_look_at_puts_the_target_on_the_axis_and_up_up(up: tuple[float, float, float]) -> None:
    rng = np.random.default_rng(1)
    position, target = rng.normal(size=(2, 50, 3))
    R = look_at(position, target, np.array(up))
    seen = np.einsum("nij,nj->ni", R, target - position)
    assert np.allclose(seen[:, :2], 0, atol=1e-12) and (seen[:, 2] > 0).all()
    assert np.allclose(np.linalg.det(R), 1)
    turned = R @ np.array(up)
    assert np.allclose(turned[:, 0], 0, atol=1e-12) and (turned[:, 1] < 0).all()
    straight = look_at(np.array(up), np.zeros(3), np.array(up))
    assert np.allclose(straight @ straight.T, np.eye(3))


def test_placed_cameras_have_the_whole_body_in_their_picture() -> None:
    points = load_figure().neutral_points[None].repeat(30, axis=0)
    R, position = place_cameras(points, np.array([0, 0, 1.0]), np.random.default_rng(0))
    camera = default_camera()
    seen = np.einsum("nij,npj->npi", R, points - position[:, None])
    pixels = seen[..., :2] / seen[..., 2:] * 1500 + [960, 540]
    assert camera.size == (1920, 1080)
    assert (pixels >= 0).all() and (pixels <= camera.size).all() and (seen[..., 2] > 0).all()
    away = np.linalg.norm(position - (points.min(axis=1) + points.max(axis=1)) / 2, axis=1)
    assert (away >= 2.5).all() and (away <= 6).all()
    with pytest.raises(InputError, match="outside the picture"):
        place_cameras(points, np.array([0, 0, 1.0]), np.random.default_rng(0), distance=(0.1, 0.2))


@pytest.mark.parametrize("ranges", ["urdf", "anatomical"])
def test_random_postures_are_legal_and_reproducible(ranges: str) -> None:
    figure = load_figure()
    q, again = (random_postures(figure, 25, np.random.default_rng(7), ranges) for _ in range(2))
    assert np.array_equal(q, again)
    assert (q[:, 7:] >= figure.lower[7:] - 1e-12).all() and (q[:, 7:] <= figure.upper[7:] + 1e-12).all()
    data, geometry = figure.model.createData(), pin.GeometryData(figure.geometry)
    assert not any(
        pin.computeCollisions(figure.model, data, figure.geometry, geometry, one, True) for one in q
    )


def test_random_views_are_exact_projections() -> None:
    view = random_views(5, np.random.default_rng(3), ranges="urdf")
    assert isinstance(view.camera, PinholeCamera)
    pixels = view.truth @ view.camera.K.T
    assert np.allclose(view.image, pixels[..., :2] / pixels[..., 2:], atol=1e-9)
    assert np.isnan(view.root).all() and np.isfinite(view.head_image).all()


def test_noise_has_the_stated_deviation_and_leaves_the_truth() -> None:
    view = random_views(40, np.random.default_rng(3), ranges="urdf")
    noisy = with_noise(view, 2.0, np.random.default_rng(4))
    off = np.concatenate([noisy.image - view.image, noisy.head_image - view.head_image], axis=1)
    assert off.std() == pytest.approx(2.0, rel=0.05) and abs(off.mean()) < 0.2
    assert np.array_equal(noisy.truth, view.truth) and noisy.deviation == 2.0
    paper = with_noise(builtin_view("seq1"), 1e-5, np.random.default_rng(4))
    assert paper.deviation is None


def test_a_forgotten_camera_leaves_the_picture() -> None:
    view = random_views(2, np.random.default_rng(3), ranges="urdf")
    photograph = forget_camera(view)
    assert isinstance(photograph.camera, ScaledOrthographicCamera) and photograph.camera.scale is None
    assert np.array_equal(photograph.image, view.image) and np.isnan(photograph.root).all()


def test_a_mocap_view_has_the_camera_in_the_world_and_the_lengths_of_the_clip() -> None:
    motion = walking()
    view = mocap_view(
        motion, np.random.default_rng(0), clip="walk 1", frames=4, dt=0.2, position=(3.0, 1.0, 6.0)
    )
    camera = view.camera
    assert isinstance(camera, PinholeCamera) and camera.R is not None and camera.t is not None
    assert camera.position == pytest.approx([3.0, 1.0, 6.0]) and camera.up == "+y"
    world = motion.points(JOINTS)[40:][[0, 6, 12, 18]]
    assert np.allclose(view.truth, world @ camera.R.T + camera.t, atol=1e-9)
    assert np.allclose(view.time, [0, 0.2, 0.4, 0.6])
    # The walker's body is the built-in one: nothing differs from it.
    assert not view.lengths


def test_mocap_views_share_frames_evenly_over_the_clips() -> None:
    views = mocap_views(walking(3, 30), 8, np.random.default_rng(0))
    assert [len(view) for view in views] == [3, 3, 2]
    short = walking(3, 30).take(np.r_[0:2, 30:90])
    assert [len(view) for view in mocap_views(short, 9, np.random.default_rng(0))] == [2, 4, 3]
    assert [len(view) for view in mocap_views(short, 62, np.random.default_rng(0))] == [2, 30, 30]
    for view in views:
        assert np.isfinite(view.image).all()


def test_missing_heads_give_the_neck_as_root() -> None:
    joints = walking().points(POINTS).copy()
    joints[:, len(JOINTS) :] = np.nan
    motion = Motion(joints=joints, joint_names=POINTS, up="+y")
    view = mocap_view(motion, np.random.default_rng(0), frames=3)
    assert np.array_equal(view.root, view.truth[:, 0])


def test_robots_are_drawn_within_their_limits_and_seen_orthographically() -> None:
    robot = load_robot("panda", bodies="none")
    q = random_configurations(robot, 20, np.random.default_rng(0))
    joints = slice(7, None) if robot.free_flyer else slice(None)
    assert (q[:, joints] >= robot.lower[joints]).all() and (q[:, joints] <= robot.upper[joints]).all()
    names = ("panda_joint3", "panda_joint4", "panda_hand")
    image, truth = object_view(robot, names, 6, np.random.default_rng(1))
    assert np.allclose(image, 500 * truth[..., :2])
    # Two joints on one link keep their distance.
    assert np.ptp(np.linalg.norm(truth[:, 0] - truth[:, 1], axis=-1)) < 1e-9
    document = object_document(names, image, truth)
    assert document["frames"][2]["image"]["panda_joint4"] == image[2, 1].tolist()


MOBILE = """<robot name="mobile"><link name="base"/><link name="a"/><link name="b"/><link name="c"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
<limit lower="2" upper="12" velocity="1" effort="1"/></joint>
<joint name="wheel" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
<joint name="slide" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="2" velocity="1" effort="1"/></joint></robot>"""


def test_joints_of_every_kind_are_drawn_over_their_whole_range(tmp_path: Path) -> None:
    """A range of more than a turn is drawn over the turn nearest to zero."""
    (tmp_path / "mobile.urdf").write_text(MOBILE, encoding="utf-8")
    robot = load_robot(tmp_path / "mobile.urdf")
    q = random_configurations(robot, 2000, np.random.default_rng(0))
    assert robot.checked(q) is not None and (q[:, :3] == 0).all()
    assert np.ptp(q[:, 3:7], axis=0).min() > 1.9
    turn, wheel, slide = q[:, 7], np.arctan2(q[:, 9], q[:, 8]), q[:, 10]
    for values, low, high in ((turn, 2.0, 2.0 + 2 * np.pi), (wheel, -np.pi, np.pi), (slide, -1.0, 2.0)):
        assert low <= values.min() < low + 0.05 and high - 0.05 < values.max() <= high
        assert values.mean() == pytest.approx((low + high) / 2, abs=0.15)


@pytest.mark.parametrize(
    "mistake",
    [
        lambda: Walker(velocity=2.0),
        lambda: Walker(lean=1.0),
        lambda: builtin_view("seq3"),
        lambda: walker_view(Walker(), frames=0),
        lambda: walker_view(Walker(), camera=(1.0, 2.0)),
        lambda: walker_view(Walker(), camera=(-4.0, 0, 0), target=(-8.0, 0, 0)),
        lambda: random_views(0, np.random.default_rng(0), ranges="urdf"),
        lambda: with_noise(builtin_view("seq1"), -1.0, np.random.default_rng(0)),
        lambda: mocap_view(walking(up=""), np.random.default_rng(0)),
        lambda: mocap_view(walking(), np.random.default_rng(0), clip="run"),
        lambda: mocap_view(walking(), np.random.default_rng(0), position=(0.0, 0.0, 0.3)),
        lambda: mocap_views(walking(), 1000, np.random.default_rng(0)),
        lambda: object_view(load_robot("panda", bodies="none"), ["elbow"], 1, np.random.default_rng(0)),
    ],
)
def test_impossible_views_are_refused_in_one_line(mistake: Callable[[], object]) -> None:
    with pytest.raises(InputError) as refused:
        mistake()
    assert "expected" in str(refused.value) and "\n" not in str(refused.value)


def test_head_points_of_a_view_are_those_of_table_a2() -> None:
    view = builtin_view("seq2")
    assert view.head_points is not None
    assert tuple(view.head_points) == ("neck", *HEAD_POINTS) and view.unit == "cm"
    assert np.allclose(view.head_points["neck"], TABLE_A2.points[0])
