"""The camera from the head's points: exact recovery, noise, misfits and frames without a pose."""

import warnings

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posekit.cameras import LeeChenCamera, PinholeCamera
from posekit.cameras.head import TABLE_A2, HeadPoints, HeadWarning, calibrate, dlt, solve_pose
from posekit.errors import HeadError

K = np.array([[1000.0, 2.0, 640.0], [0.0, 1050.0, 360.0], [0.0, 0.0, 1.0]])
PINHOLE = PinholeCamera(K=K, distortion=[-0.2, 0.05, 0.001, 0.002, 0.01])
TILTED = PinholeCamera(
    K=K, distortion=[0.1, -0.2, 0.001, 0.002, 0.03, 0.05, -0.1, 0.02, 0.01, 0.02, 0, 0, 0.02, -0.03]
)
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
    pose = solve_pose(TABLE_A2, camera.project(points), camera).require()
    np.testing.assert_allclose(pose.R_cam_head, R, atol=1e-7)
    np.testing.assert_allclose(pose.t_cam_head, t, atol=1e-6)
    np.testing.assert_allclose(pose.point("nose"), points[:, 1], atol=1e-6)
    assert pose.misfit == (None,) * 40


@pytest.mark.parametrize("head", [TABLE_A2, EIGHT], ids=["six", "eight"])
def test_exact_points_give_f_too(head):
    R, t, points = scene(head)
    image = LeeChenCamera(f=0.05).project(points)
    pose = calibrate(head, image)
    np.testing.assert_allclose(pose.f[pose.found], 0.05, rtol=1e-5)
    assert pose.found.mean() > 0.9
    linear = dlt(head, image)
    np.testing.assert_allclose(linear.f, 0.05, rtol=1e-6)
    np.testing.assert_allclose(linear.R, R, atol=1e-7)
    np.testing.assert_allclose(linear.t, t, atol=1e-6)


def test_noise_is_fitted_better_than_by_linear_equations_and_f_has_its_deviation():
    _, _, points = scene(EIGHT, 300)
    rng = np.random.default_rng(1)
    image = 1000 * points[..., :2] / points[..., 2:] + rng.normal(0, 0.3, (300, 8, 2))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", HeadWarning)
        pose = calibrate(EIGHT, image)
    linear = dlt(EIGHT, image)
    rows = pose.found & linear.in_front
    error = [np.median(np.abs(np.log(f[rows] / 1000))) for f in (pose.f, linear.f)]
    assert error[0] < error[1]
    z = (1 / pose.f[rows] - 1e-3) / (pose.f_deviation[rows] / pose.f[rows] ** 2)  # 1 / f is nearly linear
    assert 0.6 < np.sqrt(np.mean(np.clip(z, -5, 5) ** 2)) < 1.5


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
    assert pose.rms_without[0] < 1 < pose.rms[0]


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
        (lambda: HeadPoints(names=("a",) * 6, points=TABLE_A2.points), "twice"),
        (lambda: TABLE_A2.with_points({"nose": TABLE_A2.points[0]}), "coincide"),
        (lambda: HeadPoints(names=TABLE_A2.names, points=TABLE_A2.points * [1, 1, 0]), "coincide|plane"),
        (lambda: TABLE_A2.with_points({"chin": [0, 1]}), "chin"),
        (lambda: TABLE_A2.index("noze"), "did you mean nose"),
        (lambda: calibrate(TABLE_A2, np.ones((5, 2))), r"\(6, 2\)"),
        (lambda: calibrate(TABLE_A2, np.ones((6, 2))), "one line"),
        (lambda: calibrate(TABLE_A2, np.full((6, 2), np.inf)), "infinite"),
        (lambda: calibrate(TABLE_A2, np.ones((3, 6, 2)), f=[1.0, 2.0]), "one a frame"),
        (lambda: calibrate(TABLE_A2, TABLE_A2.points[:, [2, 1]] * [-1, -1]), "f"),
    ],
)
def test_impossible_heads_are_refused(act, says):
    with pytest.raises(HeadError, match=says):
        act()
