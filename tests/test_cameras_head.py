"""The camera from the head's points: exact recovery, noise, misfits and frames without a pose."""

import warnings

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posekit.cameras import LeeChenCamera, PinholeCamera
from posekit.cameras.head import TABLE_A2, HeadPoints, HeadWarning, solve_pose
from posekit.errors import HeadError

K = np.array([[1000.0, 2.0, 640.0], [0.0, 1050.0, 360.0], [0.0, 0.0, 1.0]])
PINHOLE = PinholeCamera(K=K, distortion=[-0.2, 0.05, 0.001, 0.002, 0.01])
TILTED = PinholeCamera(
    K=K, distortion=[0.1, -0.2, 0.001, 0.002, 0.03, 0.05, -0.1, 0.02, 0.01, 0.02, 0, 0, 0.02, -0.03]
)
UNKNOWN = LeeChenCamera(f=None)
EIGHT = TABLE_A2.with_points({"chin": [-0.292, 0.55, 0.0], "crown": [-0.34, 0.74, 0.0]})


def scene(head=TABLE_A2, frames=40, seed=0, depth=(1.5, 5)):
    rng = np.random.default_rng(seed)
    R = Rotation.random(frames, random_state=rng).as_matrix()
    t = np.stack([*rng.normal(0, 0.2, (2, frames)), rng.uniform(*depth, frames)], axis=1)
    return R, t, head.points @ np.swapaxes(R, 1, 2) + t[:, None]


@pytest.mark.parametrize(
    "camera", [PINHOLE, TILTED, LeeChenCamera(f=0.05)], ids=["brown", "tilted", "lee-chen"]
)
def test_exact_points_give_the_pose(camera):
    R, t, points = scene()
    pose = solve_pose(TABLE_A2, camera.project(points), camera)
    assert pose.found.all()
    np.testing.assert_allclose(pose.R_cam_head, R, atol=1e-7)
    np.testing.assert_allclose(pose.t_cam_head, t, atol=1e-6)
    np.testing.assert_allclose(pose.point("nose"), points[:, 1], atol=1e-6)
    assert pose.misfit == (None,) * 40


@pytest.mark.parametrize("head", [TABLE_A2, EIGHT], ids=["six", "eight"])
def test_exact_points_give_f_too(head):
    R, t, points = scene(head)
    image = LeeChenCamera(f=0.05).project(points)
    pose = solve_pose(head, image, UNKNOWN)
    np.testing.assert_allclose(pose.f[pose.found], 0.05, rtol=1e-5)
    assert pose.found.mean() > 0.9
    np.testing.assert_allclose(pose.R_cam_head[pose.found], R[pose.found], atol=1e-6)
    np.testing.assert_allclose(pose.t_cam_head[pose.found], t[pose.found], rtol=1e-4, atol=1e-6)


def linear_f(head, image):
    """Return f by the linear equations of Lee & Chen 1985 (eqs. 2-3), points and image normalised."""
    space = np.column_stack(
        [(head.points - head.points.mean(axis=0)) / head.points.std(), np.ones(len(image))]
    )
    middle, size = image.mean(axis=0), image.std()
    u, v = ((image - middle) / size).T[..., None]
    zero = np.zeros_like(space)
    rows = np.concatenate([np.hstack([space, zero, -u * space]), np.hstack([zero, space, -v * space])])
    P = np.linalg.svd(rows)[2][-1].reshape(3, 4)
    P[:2] = size * P[:2] + middle[:, None] * P[2]
    return np.sqrt((P[:2, :3] ** 2).sum() / 2) / np.linalg.norm(P[2, :3])


def test_noise_is_fitted_better_than_by_linear_equations():
    _, _, points = scene(EIGHT, 300)
    rng = np.random.default_rng(1)
    image = 1000 * points[..., :2] / points[..., 2:] + rng.normal(0, 0.3, (300, 8, 2))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", HeadWarning)
        pose = solve_pose(EIGHT, image, UNKNOWN)
    linear = np.array([linear_f(EIGHT, one) for one in image])
    assert pose.found.mean() > 0.9
    error = [np.median(np.abs(np.log(f[pose.found] / 1000))) for f in (pose.f, linear)]
    assert error[0] < error[1]


def test_a_head_near_the_camera_is_placed_and_one_far_away_leaves_f_open():
    _, t, points = scene(EIGHT, 40, depth=(0.4, 1.0))
    pose = solve_pose(EIGHT, LeeChenCamera(f=0.05).project(points), UNKNOWN)
    assert (np.linalg.norm(pose.t_cam_head - t, axis=1) < 1e-4).mean() > 0.9
    far = 1000 * points[..., :2] / 1e9
    assert not solve_pose(EIGHT, far, UNKNOWN).found.any()


def test_frames_are_independent_and_unseen_points_are_left_out():
    _, _, points = scene(EIGHT)
    image = PINHOLE.project(points) + np.random.default_rng(2).normal(0, 0.5, (40, 8, 2))
    image[3, 2] = np.nan
    image[4, :3] = np.nan
    pose = solve_pose(EIGHT, image, PINHOLE)
    assert pose.found[3]
    assert np.isnan(pose.residuals[3, 2])
    assert not pose.found[4]
    assert "5 of 8 head points" in pose.reasons[4]
    for k in (0, 3):
        alone = solve_pose(EIGHT, image[k], PINHOLE)
        np.testing.assert_allclose(alone.t_cam_head[0], pose.t_cam_head[k], atol=1e-9)


def test_a_misplaced_point_is_named():
    _, _, points = scene(EIGHT, 1)
    image = PINHOLE.project(points)[0] + np.random.default_rng(3).normal(0, 0.3, (8, 2))
    image[4] += [25.0, -10.0]
    with pytest.warns(HeadWarning, match="right_ear does not fit"):
        pose = solve_pose(EIGHT, image, PINHOLE)
    assert pose.misfit == ("right_ear",)
    assert pose.residuals[0, 4] > pose.rms[0] > 1


def test_a_mirrored_image_is_recognised():
    _, _, points = scene(EIGHT, depth=(1, 2))
    mirrored = PINHOLE.project(points) * [-1, 1] + [2 * K[0, 2], 0]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", HeadWarning)
        pose = solve_pose(EIGHT, mirrored + np.random.default_rng(4).normal(0, 0.1, mirrored.shape), PINHOLE)
    said = np.array(["behind the camera" in reason for reason in pose.reasons])
    assert said.mean() > 0.9
    assert np.isnan(pose.f[said]).all()


@pytest.mark.parametrize(
    ("act", "says"),
    [
        (lambda: HeadPoints(names=TABLE_A2.names, points=TABLE_A2.points * [1, 1, 0]), "plane"),
        (lambda: solve_pose(TABLE_A2, np.ones((5, 2)), UNKNOWN), r"\(6, 2\)"),
        (lambda: solve_pose(TABLE_A2, np.ones((6, 2)), UNKNOWN), "one line"),
        (lambda: solve_pose(TABLE_A2, np.full((6, 2), np.inf), UNKNOWN), "infinite"),
        (lambda: solve_pose(TABLE_A2, np.ones((3, 6, 2)), LeeChenCamera(f=[1.0, 2.0])), "one a frame"),
        (lambda: solve_pose(TABLE_A2, TABLE_A2.points[:, [2, 1]] * [-1, -1], UNKNOWN), "f"),
    ],
)
def test_impossible_heads_are_refused(act, says):
    with pytest.raises(HeadError, match=says):
        act()
