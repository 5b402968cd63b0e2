"""The walker: periodic, symmetric, legal at every phase, and seen as the paper prints it."""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.cameras import lee_chen
from posekit.cameras.head.points import TABLE_A2
from posekit.errors import InputError, PosekitError
from posekit.skeleton import JOINT, POINTS, SEGMENTS, segment_name
from posekit.synthesis import SyntheticScene, Walker, seq1, seq2, walker_scene

FIGURE = load_figure()
PHASES = np.arange(0, 1, 1 / 100)
VELOCITIES = (0.5, 0.75, 1.0, 1.3)
SWAP = [
    POINTS.index(name.replace("right", "LEFT").replace("left", "right").replace("LEFT", "left"))
    for name in POINTS
]


def points_of(velocity, phases=PHASES):
    return FIGURE.forward_kinematics(Walker(velocity=velocity).configurations(phases))


@pytest.mark.parametrize("velocity", VELOCITIES)
def test_walker_is_periodic(velocity):
    now, later = points_of(velocity), points_of(velocity, PHASES + 7)
    np.testing.assert_allclose(now, later, rtol=0, atol=1e-12)


@pytest.mark.parametrize("velocity", VELOCITIES)
def test_half_a_cycle_later_the_walker_is_its_mirror_image(velocity):
    mirrored = points_of(velocity, PHASES + 0.5)[:, SWAP] * [1, 1, -1]
    np.testing.assert_allclose(points_of(velocity), mirrored, rtol=0, atol=1e-12)


@pytest.mark.parametrize("velocity", VELOCITIES)
def test_walker_is_inside_every_limit_and_free_of_collision(velocity):
    q = Walker(velocity=velocity).configurations(PHASES)
    angles = q[:, FIGURE.angle_index]
    assert (angles >= FIGURE.limits.lower).all()
    assert (angles <= FIGURE.limits.upper).all()
    data, geometry_data = FIGURE.model.createData(), FIGURE.geometry.createData()
    for row in q:
        assert not pin.computeCollisions(FIGURE.model, data, FIGURE.geometry, geometry_data, row, True)


@pytest.mark.parametrize("velocity", VELOCITIES)
def test_head_rests_where_table_a2_has_it(velocity):
    head = points_of(velocity)[:, [0, *range(14, 19)]]
    np.testing.assert_allclose(head, np.broadcast_to(TABLE_A2.points, head.shape), rtol=0, atol=1e-12)


@pytest.mark.parametrize("scene", [seq1(), seq2(), seq1(velocity=0.6, phase0=0.3)])
def test_scene_keeps_lengths_and_projects(scene):
    for a, b in SEGMENTS:
        length = np.linalg.norm(scene.joints_cam[:, a] - scene.joints_cam[:, b], axis=-1)
        np.testing.assert_allclose(length, FIGURE.lengths[segment_name((a, b))], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(scene.image, scene.camera.project(scene.joints_cam))
    points = FIGURE.forward_kinematics(scene.q)
    np.testing.assert_allclose(points[:, :14], scene.joints_cam, rtol=0, atol=1e-12)
    np.testing.assert_allclose(points[:, 14:], scene.head_cam, rtol=0, atol=1e-12)
    np.testing.assert_allclose(scene.time, [0, 0.2, 0.4, 0.6, 0.8], rtol=0, atol=1e-15)


def test_seq1_sees_the_head_as_table_a2_prints_it():
    scene = seq1()
    image = np.concatenate([scene.image[:, :1], scene.head_image], axis=1)
    paper = 100 * lee_chen.image_from_paper(image)
    printed = np.array(
        [
            [-0.00024, 0.59320],
            [-0.00025, 0.70944],
            [-0.06329, 0.74631],
            [0.06280, 0.74631],
            [-0.09680, 0.68273],
            [0.09631, 0.68273],
        ]
    )
    assert scene.lee_chen_f == 0.05
    # The print is 0.00025 cm off to the side, all along; heights agree in every printed digit.
    error = np.abs(paper - printed)
    assert error[..., 1].max() <= 5e-6
    assert error[..., 0].max() <= 2.6e-4


@pytest.mark.parametrize(("scene", "where"), [(seq1(), [4, 0, 0]), (seq2(), [3, 0, 3])])
def test_camera_stands_where_the_paper_has_it_and_looks_at_the_axis(scene, where):
    R, t = scene.R_cam_world, scene.t_cam_world
    image_plane = lee_chen.camera_position(R, t, np.full(5, scene.lee_chen_f))
    np.testing.assert_allclose(image_plane, np.broadcast_to(where, (5, 3)), rtol=0, atol=1e-12)
    axis = np.einsum("fij,fj->fi", R, np.zeros((5, 3))) + t
    np.testing.assert_allclose(axis[:, :2], 0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(R[:, 1], np.broadcast_to([0, -1, 0], (5, 3)), rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(axis, axis=1), np.linalg.norm(where) + 0.05, rtol=0, atol=1e-12)


def test_seq2_sees_the_right_side_nearer():
    depth = seq2().joints_cam[..., 2]
    assert (depth[:, JOINT["right_hip"]] < depth[:, JOINT["left_hip"]]).all()


def test_walker_crosses_the_ground_at_its_velocity_where_it_is_not_carried():
    walker = Walker(velocity=0.8)
    cycle = walker.gait.cycle_duration
    travel = walker.travel(np.array([0.0, cycle, 2 * cycle]), 0.3)
    assert walker.leg_length == pytest.approx(0.75)
    way = walker.gait.cycle_length * walker.leg_length
    expected = way * np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    np.testing.assert_allclose(travel, expected, rtol=0, atol=1e-12)
    free = walker_scene(walker, camera=(8, 0, 0), phase0=0.3, frames=4, carried=False)
    carried = walker_scene(walker, camera=(8, 0, 0), phase0=0.3, frames=4)
    moved = carried.joints_cam[:, 0, 2] - free.joints_cam[:, 0, 2]
    np.testing.assert_allclose(moved, walker.travel(free.time, 0.3)[:, 0], rtol=0, atol=1e-12)


@pytest.mark.parametrize("lean", [-4.0, 6.0])
def test_a_lean_turns_the_torso_alone_about_the_level_axis(lean):
    """Against the gait's own lean, measured in the points: hips, legs and head keep their directions."""
    upright, leaning = (
        FIGURE.forward_kinematics(Walker(velocity=0.8, lean=float(np.radians(by))).configurations(PHASES))
        for by in (0.0, lean)
    )

    def back(points):
        return points[:, JOINT["neck"]] - points[:, JOINT["pelvis"]]

    cosine = (back(upright) * back(leaning)).sum(axis=1) / np.linalg.norm(back(upright), axis=1) ** 2
    # Heading differs from straight ahead by the counter-torsion, about which the lean turns with it.
    np.testing.assert_allclose(np.degrees(np.arccos(cosine)), abs(lean), rtol=0, atol=1e-6)
    assert (np.sign(back(leaning)[:, 0] - back(upright)[:, 0]) == np.sign(lean)).all()
    for a, b in (("pelvis", "right_hip"), ("left_hip", "left_knee"), ("right_knee", "right_ankle")):
        before, after = (points[:, JOINT[b]] - points[:, JOINT[a]] for points in (upright, leaning))
        np.testing.assert_allclose(before, after, rtol=0, atol=1e-12)
    np.testing.assert_allclose(upright[:, 14:], leaning[:, 14:], rtol=0, atol=1e-12)


@pytest.mark.parametrize("lean", [0.6, -0.6, np.nan, np.inf])
def test_walkers_that_fall_over_are_refused(lean):
    with pytest.raises(InputError, match=r"leans by .* degrees; expected -30 to 30"):
        Walker(lean=lean)


def test_other_people_walk_too():
    figure = FIGURE.from_stature(1.6)
    scene = walker_scene(Walker(figure=figure, velocity=0.9), frames=3, dt=0.1)
    for a, b in SEGMENTS:
        length = np.linalg.norm(scene.joints_cam[:, a] - scene.joints_cam[:, b], axis=-1)
        np.testing.assert_allclose(length, figure.lengths[segment_name((a, b))], rtol=0, atol=1e-12)


def test_noise_is_as_asked_and_never_touches_the_truth():
    scene = walker_scene(Walker(), frames=300)
    noisy = scene.with_noise(1e-4, np.random.default_rng(3))
    error = np.concatenate([noisy.image - scene.image, noisy.head_image - scene.head_image], axis=1)
    assert error.std() == pytest.approx(1e-4, rel=0.03)
    assert abs(error.mean()) < 4e-4 / np.sqrt(error.size)
    for name in ("joints_cam", "head_cam", "q", "time"):
        np.testing.assert_array_equal(getattr(noisy, name), getattr(scene, name))
    again = scene.with_noise(1e-4, np.random.default_rng(3))
    np.testing.assert_array_equal(again.image, noisy.image)
    np.testing.assert_array_equal(scene.with_noise(0, np.random.default_rng(3)).image, scene.image)


def test_frames_can_be_selected():
    part = seq1().select([0, 2, 4])
    np.testing.assert_array_equal(part.image, seq1().image[[0, 2, 4]])
    np.testing.assert_array_equal(part.time, seq1().time[[0, 2, 4]])
    assert len(seq1().select(seq1().time > 0.3)) == 3
    assert np.isnan(seq1().root).all()


def test_scene_is_read_only():
    scene = seq1()
    with pytest.raises(ValueError, match="read-only"):
        scene.image[0, 0, 0] = 1.0


@pytest.mark.parametrize(
    "options",
    [
        {"frames": 0},
        {"dt": 0.0},
        {"dt": np.nan},
        {"phase0": np.inf},
        {"camera": (0, 0, 0)},
        {"camera": (4, 0)},
        {"camera": (np.nan, 0, 0)},
        {"f": 0.0},
        {"frames": 60, "carried": False},
    ],
)
def test_impossible_walks_are_refused_in_one_line(options):
    with pytest.raises(PosekitError) as refused:
        walker_scene(Walker(), **options)
    assert "\n" not in str(refused.value)


def test_impossible_scenes_are_refused():
    scene = seq1()
    good: dict[str, Any] = {"figure": FIGURE, "camera": scene.camera, "joints_cam": scene.joints_cam}
    behind = scene.joints_cam.copy()
    behind[2, 9, 2] = -1.0
    for bad, words in (
        ({"joints_cam": behind}, "left_wrist of frame 2"),
        ({"joints_cam": np.empty((0, 14, 3))}, "without frames"),
        ({"image": np.zeros((5, 13, 2))}, "image has shape"),
        ({"labels": ("walking",)}, "1 labels"),
    ):
        with pytest.raises(InputError, match=words):
            SyntheticScene(**{**good, **bad})
    with pytest.raises(InputError, match="noise"):
        scene.with_noise(-1, np.random.default_rng(0))
    with pytest.raises(InputError, match="phases"):
        Walker().configurations([np.nan])
