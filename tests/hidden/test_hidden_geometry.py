"""What hidden joints are sampled with: even lattices, rays of any camera, the closing of the hips, choices by group."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.body import load_figure
from posekit.cameras import Camera, PinholeCamera, ScaledOrthographicCamera
from posekit.geometry import frame_along, rotation_about, rotation_between, unit
from posekit.hidden.grouped_rows import box, distinct, largest, mean, pairs
from posekit.hidden.hip_closure import closing_angles
from posekit.hidden.lattices import rotation_spacing, rotations, sphere_spacing, zone
from posekit.hidden.rays import find_rays
from posekit.skeleton import JOINT, JOINTS
from posekit.synthesis import random_views

FIGURE = load_figure()


@pytest.mark.parametrize(("low", "high"), [(-1.0, 1.0), (0.9, 1.0), (-0.2, 0.3), (0.9999, 1.0)])
def test_a_zone_is_covered_evenly(low: float, high: float) -> None:
    n = 2000
    points = zone(n, np.array([low]), np.array([high]))[0]
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1.0, rtol=0, atol=1e-12)
    assert ((points[:, 0] >= low) & (points[:, 0] <= high)).all()
    # Any part that halves or quarters the area has its share of the points.
    assert np.mean(points[:, 0] > (low + high) / 2) == pytest.approx(0.5, abs=1e-3)
    for turn in np.linspace(0, 2 * np.pi, 7):
        side = points[:, 1] * np.cos(turn) + points[:, 2] * np.sin(turn) > 0
        assert np.mean(side) == pytest.approx(0.5, abs=0.01)
        assert np.mean(side & (points[:, 0] > (low + high) / 2)) == pytest.approx(0.25, abs=0.01)


def test_neighbours_of_a_zone_are_as_far_apart_as_is_said() -> None:
    n = 400
    whole = zone(n, np.array([-1.0]), np.array([1.0]))[0]
    angle = np.arccos(np.clip(whole @ whole.T - 2.0 * np.eye(n), -1, 1))
    nearest = angle.min(axis=1)
    assert (nearest > 0.6 * sphere_spacing(n)).all()
    assert (nearest < 1.3 * sphere_spacing(n)).all()
    anywhere = unit(np.random.default_rng(0).standard_normal((5000, 3)))
    farthest = np.arccos(np.clip(anywhere @ whole.T, -1, 1)).min(axis=1).max()
    assert farthest < 1.1 * sphere_spacing(n)


def test_rotations_are_everywhere() -> None:
    n = 4000
    R = rotations(n)
    np.testing.assert_allclose(
        R @ np.swapaxes(R, 1, 2), np.broadcast_to(np.eye(3), R.shape), rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(R), 1.0, rtol=0, atol=1e-12)
    rng = np.random.default_rng(0)
    Q = rotation_about(unit(rng.standard_normal((500, 3))), rng.uniform(0, np.pi, 500))
    trace = np.einsum("nij,mij->nm", Q, R).max(axis=1)
    assert np.arccos(np.clip((trace - 1) / 2, -1, 1)).max() < 1.1 * rotation_spacing(n)


@settings(deadline=None, derandomize=True)
@given(st.lists(st.floats(-1, 1), min_size=6, max_size=6))
def test_frames_and_shortest_rotations(numbers: list[float]) -> None:
    a, b = np.array(numbers[:3]), np.array(numbers[3:])
    if min(np.linalg.norm(a), np.linalg.norm(b)) < 1e-3:
        return
    a, b = unit(a), unit(b)
    B = frame_along(a)
    np.testing.assert_allclose(B.T @ B, np.eye(3), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(B[:, 0], a)
    R = rotation_between(a, b)
    np.testing.assert_allclose(R.T @ R, np.eye(3), rtol=0, atol=1e-9)
    np.testing.assert_allclose(R @ a, b, rtol=0, atol=1e-9)
    np.testing.assert_allclose(rotation_between(a, -a) @ a, -a, rtol=0, atol=1e-12)


SCENE = random_views(FIGURE, 5, np.random.default_rng(1), ranges="urdf")
PINHOLE = SCENE.camera
LENS = PinholeCamera(K=PINHOLE.K, distortion=np.array([-0.2, 0.05, 0.001, -0.001, 0.0]))
EACH = PinholeCamera(K=np.stack([PINHOLE.K * [[k], [k], [1.0]] for k in (1.0, 1.1, 0.9, 1.2, 0.8)]))


@pytest.mark.parametrize(
    "camera",
    [
        PINHOLE,
        LENS,
        EACH,
        ScaledOrthographicCamera(scale=300.0),
        ScaledOrthographicCamera(scale=np.arange(1.0, 6.0)),
    ],
)
def test_rays_lift_as_their_camera_does(camera: Camera) -> None:
    rng = np.random.default_rng(2)
    joints = SCENE.joints_cam
    image = camera.project(joints).copy()
    image[:, 3] = np.nan
    rays = find_rays(camera, joints[:, 0], image, reach=5.0)
    start = joints + 0.2 * rng.standard_normal(joints.shape)
    start[0, :, 2] = 0.02  # so near that the nearer end is behind a pinhole
    lengths = rng.uniform(0.1, 0.5, 14)
    expected = camera.lift(start, image, lengths, tolerance=1e-3)
    some = 0
    for frame in range(5):
        for joint in range(14):
            got = rays.lift(joint, np.array([frame]), start[frame, joint][None], lengths[joint], 1e-3)
            np.testing.assert_array_equal(got.valid[0], expected.valid[frame, joint])
            if joint == 3:
                assert not got.valid.any()
                continue
            np.testing.assert_allclose(got.excess[0], expected.excess[frame, joint], rtol=0, atol=1e-9)
            np.testing.assert_allclose(got.points[0], expected.points[frame, joint], rtol=0, atol=1e-6)
            some += int(got.valid.any())
    assert some > 20


def test_the_hips_close_at_the_angles_found() -> None:
    neck, pelvis = SCENE.joints_cam[:, 0], SCENE.joints_cam[:, JOINT["pelvis"]]
    axis = unit(SCENE.joints_cam[:, JOINT["right_shoulder"]] - neck)
    rays = find_rays(PINHOLE, neck, SCENE.image, reach=5.0)
    rng = np.random.default_rng(3)
    turn = rng.uniform(0, 2 * np.pi, 5)
    offset = np.einsum("nij,nj->ni", rotation_about(axis, -turn), pelvis - neck)
    which, angle = closing_angles(FIGURE, rays, np.arange(5), neck, axis, offset, 120)
    place = neck[which] + np.einsum("nij,nj->ni", rotation_about(axis[which], angle), offset[which])
    right, left = (
        rays.lift(JOINT[f"{side}_hip"], which, place, FIGURE.lengths[f"pelvis-{side}_hip"], 1e-9)
        for side in ("right", "left")
    )
    gap = np.linalg.norm(right.points[:, :, None] - left.points[:, None], axis=-1)
    assert (np.abs(gap - FIGURE.lengths["right_hip-left_hip"]).min(axis=(1, 2)) < 1e-9).all()
    # The true turn is among them.
    for circle in range(5):
        apart = np.mod(angle[which == circle] - turn[circle] + np.pi, 2 * np.pi) - np.pi
        assert np.abs(apart).min() < 1e-6


@settings(deadline=None, derandomize=True)
@given(st.lists(st.integers(0, 4), max_size=30), st.integers(0, 99))
def test_choices_by_group_are_those_of_a_loop(groups: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, group = 6, np.sort(np.array(groups, dtype=np.intp))
    points, value = rng.standard_normal((len(group), 3)), rng.integers(0, 5, len(group)).astype(float)
    label = rng.integers(-1, 4, len(group))
    lower, upper = box(group, n, points)
    row, most = largest(group, n, value)
    middle, count = mean(group, n, points), distinct(group, n, label)
    for k in range(n):
        mine = np.flatnonzero(group == k)
        assert count[k] == len(set(label[mine].tolist()) - {-1})
        if not len(mine):
            assert row[k] == -1
            assert np.isnan([lower[k], upper[k], middle[k]]).all()
            continue
        assert row[k] == mine[value[mine].argmax()]
        assert most[k] == value[mine].max()
        np.testing.assert_array_equal(lower[k], points[mine].min(axis=0))
        np.testing.assert_array_equal(upper[k], points[mine].max(axis=0))
        np.testing.assert_allclose(middle[k], points[mine].mean(axis=0), rtol=0, atol=1e-12)
    key = rng.integers(0, n, 7)
    which, rows = pairs(group, key, n)
    expected = [(i, r) for i, one in enumerate(key) for r in np.flatnonzero(group == one)]
    assert list(zip(which.tolist(), rows.tolist(), strict=True)) == expected


def test_all_joints_have_a_ray_when_all_are_seen() -> None:
    rays = find_rays(PINHOLE, SCENE.joints_cam[:, 0], SCENE.image, reach=5.0)
    assert rays.direction.shape == (5, len(JOINTS), 3)
    foot, height = rays.foot(JOINT["left_ankle"], np.arange(5), SCENE.joints_cam[:, JOINT["left_ankle"]])
    np.testing.assert_allclose(height, 0.0, rtol=0, atol=1e-9)
    np.testing.assert_allclose(foot, SCENE.joints_cam[:, JOINT["left_ankle"]], rtol=0, atol=1e-9)
