"""Poses of rigid parts: against OpenCV, against noise, and the two that a flat part has."""

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.body.lengths import torso_points
from posekit.cameras import PinholeCamera
from posekit.cameras.neck.pose import PartPoses, poses
from posekit.skeleton import JOINT, TORSO
from posekit.synthesis import SyntheticScene, random_views

FIGURE = load_figure()
TORSO_POINTS = torso_points(FIGURE.lengths)
TORSO_JOINTS = [JOINT[name] for name in TORSO]
HEAD = np.ascontiguousarray(FIGURE.head_points[1:])
VIEWS = random_views(FIGURE, 200, np.random.default_rng(12))
PARTS = {
    "torso": (TORSO_POINTS, lambda scene: scene.image[:, TORSO_JOINTS]),
    "head": (HEAD, lambda scene: scene.head_image),
    "eyes and ears": (HEAD[1:], lambda scene: scene.head_image[:, 1:]),
    "one ear hidden": (HEAD[:4], lambda scene: scene.head_image[:, :4]),
}


def placed(part: str, scene: SyntheticScene, deviation: float = 1.0) -> PartPoses:
    points, image = PARTS[part][0], PARTS[part][1](scene)
    return poses(scene.camera, points, image, np.full(image.shape[:2], deviation), np.zeros(len(points)))


@pytest.mark.parametrize("part", PARTS)
def test_exact_points_give_the_exact_neck(part: str) -> None:
    found = placed(part, VIEWS)
    away = np.linalg.norm(found.origin[:, 0] - VIEWS.joints_cam[:, 0], axis=-1)
    assert away.max() < 1e-5
    assert found.rms[:, 0].max() < 1e-6
    assert (found.cost[:, :-1] <= found.cost[:, 1:]).all()
    np.testing.assert_allclose(
        found.R[:, 0] @ np.swapaxes(found.R[:, 0], -1, -2), np.tile(np.eye(3), (200, 1, 1)), atol=1e-12
    )
    assert (np.linalg.det(found.R[:, 0]) > 0).all()


@pytest.mark.parametrize("noise", [0.0, 1.0, 5.0, 15.0])
@pytest.mark.parametrize("part", PARTS)
def test_no_residual_is_larger_than_opencvs(part: str, noise: float) -> None:
    cv2 = pytest.importorskip("cv2")
    scene = VIEWS.with_noise(noise, np.random.default_rng(13)) if noise else VIEWS
    points, image = np.ascontiguousarray(PARTS[part][0]), PARTS[part][1](scene)
    found, compared = placed(part, scene), 0
    flags = [cv2.SOLVEPNP_SQPNP] + ([cv2.SOLVEPNP_IPPE] if part == "eyes and ears" else [])
    for frame in range(len(scene)):
        # SQPNP refuses points that lie together in the image.
        seen = np.ascontiguousarray(image[frame])
        assert len(seen) >= 4
        assert np.isfinite(seen).all()
        if np.ptp(seen, axis=0).min() < 3:
            continue
        for flag in flags:
            good, turn, move = cv2.solvePnP(points, seen, scene.camera.K, None, flags=flag)
            if not good or not np.isfinite(move).all():
                continue
            cam = points @ cv2.Rodrigues(turn)[0].T + move.reshape(3)
            if (cam[:, 2] <= 0).any():
                continue  # its best is behind the camera
            rms = np.sqrt(((scene.camera.project(cam) - seen) ** 2).sum() / len(seen))
            assert found.rms[frame, 0] <= rms * (1 + 1e-6) + 1e-6
            compared += 1
    assert compared > 0.8 * len(scene)


def test_every_minimum_is_one_of_its_own_reprojection_error() -> None:
    """Move each pose a little in each of its six directions: the error grows."""
    scene = VIEWS.with_noise(3.0, np.random.default_rng(14))
    found = placed("torso", scene)
    image = scene.image[:, TORSO_JOINTS]
    assert (found.found.sum(axis=1) == 2).mean() > 0.8  # towards the camera, and away from it
    frames, number = np.nonzero(found.found)
    R, origin, cost = found.R[frames, number], found.origin[frames, number], found.cost[frames, number]
    for axis in range(6):
        for sign in (-1, 1):
            step = np.zeros(6)
            step[axis] = sign * 1e-4
            x, y, z = step[:3]
            turn = np.eye(3) + np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            cam = TORSO_POINTS @ np.swapaxes(turn @ R, -1, -2) + (origin + step[3:])[:, None]
            moved = ((scene.camera.project(cam) - image[frames]) ** 2).sum(axis=(1, 2))
            assert (moved >= cost - 2e-6 * (1 + cost)).all()


def test_the_covariance_is_that_of_small_noise() -> None:
    for frame in (0, 7, 31):
        told = placed("torso", VIEWS.select([frame]), 0.05).covariance[0, 0]
        noisy = VIEWS.select(np.full(3000, frame)).with_noise(0.05, np.random.default_rng(15))
        measured = np.cov(placed("torso", noisy).origin[:, 0], rowvar=False)
        np.testing.assert_allclose(np.sqrt(np.diag(measured) / np.diag(told)), 1, atol=0.08)


@pytest.mark.parametrize("noise", [1.0, 5.0])
def test_the_depth_is_within_two_deviations_of_one_of_the_minima(noise: float) -> None:
    scene = VIEWS.with_noise(noise, np.random.default_rng(16))
    found = placed("torso", scene, noise)
    depth = np.linalg.norm(scene.joints_cam[:, 0], axis=1)
    ray = scene.joints_cam[:, 0] / depth[:, None]
    away = np.abs(np.einsum("fki,fi->fk", found.origin, ray) - depth[:, None])
    within = (away < 2 * found.deviation(ray)).any(axis=1)
    assert 0.90 < within.mean() < 1.0


def test_a_point_with_a_large_deviation_hardly_counts() -> None:
    scene = VIEWS.select(range(20))
    image = scene.head_image.copy()
    image[:, 0] += 25.0
    deviation = np.ones((20, 5))
    bad = poses(scene.camera, HEAD, image, deviation, np.zeros(5))
    offset = np.zeros(5)
    offset[0] = 1e4
    for good in (
        poses(scene.camera, HEAD, image, np.where(np.arange(5) == 0, 1e6, deviation), np.zeros(5)),
        poses(scene.camera, HEAD, image, deviation, offset),
    ):
        away = np.linalg.norm(good.origin[:, :2] - scene.joints_cam[:, :1], axis=-1).min(axis=1)
        assert away.max() < 1e-3
    assert np.median(np.linalg.norm(bad.origin[:, 0] - scene.joints_cam[:, 0], axis=-1)) > 0.1


def test_three_points_give_no_pose_and_nothing_breaks() -> None:
    scene = VIEWS.select(range(6))
    image = scene.head_image.copy()
    image[0, :2] = np.nan  # three are left
    image[1] = np.nan
    image[2] = 700.0  # all in one place
    image[3] = np.arange(10.0).reshape(5, 2)  # on a line
    image[4] *= 1e6
    found = poses(scene.camera, HEAD, image, np.ones((6, 5)), np.zeros(5))
    assert not found.found[:2].any()
    assert found.found[5].any()
    for values in (found.R, found.origin, found.rms):
        shape = found.found.shape + (1,) * (values.ndim - 2)
        assert (np.isfinite(values) == found.found.reshape(shape)).all()
    assert found.freedom.tolist()[:2] == [0, 0]
    nothing = poses(scene.camera, HEAD, image[:2], np.ones((2, 5)), np.zeros(5))
    assert not nothing.found.any()


def test_a_k_for_each_frame_and_a_distortion() -> None:
    scene = VIEWS.select(range(10))
    K = np.repeat(scene.camera.K[None], 10, axis=0)
    K[:, 0, 0] *= np.linspace(0.8, 1.2, 10)
    lens = PinholeCamera(K=K, distortion=np.array([-0.1, 0.02, 1e-4, -2e-4, 0.0]))
    image = lens.project(scene.joints_cam)[:, TORSO_JOINTS]
    found = poses(lens, TORSO_POINTS, image, np.ones((10, 4)), np.zeros(4))
    assert np.linalg.norm(found.origin[:, 0] - scene.joints_cam[:, 0], axis=-1).max() < 1e-5
