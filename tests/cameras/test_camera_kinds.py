"""Functions of cameras, heads and necks are given and return what their annotations say, to the dtype."""

from __future__ import annotations

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.cameras import PinholeCamera, ScaledOrthographicCamera
from posekit.cameras.calibrated import CalibratedCamera
from posekit.cameras.head import TABLE_A2, calibrate, dlt, solve_pose
from posekit.cameras.lens import fold_radius, project, ray_radius
from posekit.cameras.neck import place
from posekit.cameras.undistortion import undistorted
from posekit.synthesis import random_views
from tests.annotated import watched

VIEWS = random_views(load_figure(), 6, np.random.default_rng(41))
K = np.array([[900.0, 2.0, 640.0], [0.0, 920.0, 360.0], [0.0, 0.0, 1.0]])


def of_whole_pixels() -> tuple[np.ndarray, np.ndarray]:
    """Return image points, and of the head, as a detector rounds them."""
    return np.rint(VIEWS.image).astype(int), np.rint(VIEWS.head_image).astype(int)


@pytest.mark.parametrize("method", ["auto", "head", "torso", "search"])
@pytest.mark.parametrize("hidden", [False, True])
def test_placing_a_neck_is_what_annotations_say(method: str, hidden: bool) -> None:
    image, head = (each.astype(float) for each in of_whole_pixels())
    if hidden:
        image[0], head[1], image[2, 2], head[3, 1] = np.nan, np.nan, np.nan, np.nan
    with watched("posekit.cameras") as wrong:
        place(VIEWS.camera, VIEWS.figure, image, head, method=method)
        place(VIEWS.camera, VIEWS.figure, image[:0], head[:0], method=method)
    assert wrong == set()


@pytest.mark.parametrize("known", [False, True])
def test_poses_of_heads_are_what_annotations_say(known: bool) -> None:
    image, head = of_whole_pixels()
    points = np.concatenate([image[:, :1], head], axis=1)
    assert points.shape[1] == len(TABLE_A2.names)
    with watched("posekit.cameras") as wrong:
        for seen in (points, np.where(np.arange(6)[:, None] == 2, np.nan, points), points[:0]):
            if known:
                solve_pose(TABLE_A2, seen, VIEWS.camera)
            else:
                calibrate(TABLE_A2, seen)
                dlt(TABLE_A2, seen)
    assert wrong == set()


@pytest.mark.parametrize("fisheye", [False, True])
def test_lenses_are_what_annotations_say(fisheye: bool) -> None:
    camera = CalibratedCamera(
        name="lens", K=K, size=(1280, 720), distortion=np.array([0.05, -0.01, 0.004, -0.001]), fisheye=fisheye
    )
    points = np.array([[0.1, 0.2, 1.0], [0.0, 0.0, 2.0], [np.nan, 0.0, 1.0]])
    pixels = np.array([[640, 360], [700, 300], [0, 0]])
    with watched("posekit.cameras") as wrong:
        seen = project(camera, points)
        of_floats = undistorted(pixels.astype(float), camera)
        ray_radius(camera, seen)
        fold_radius(camera)
    assert wrong == set()
    np.testing.assert_array_equal(undistorted(pixels, camera), of_floats)


@pytest.mark.parametrize(
    "camera",
    [
        PinholeCamera(K=K),
        PinholeCamera(K=np.tile(K, (6, 1, 1))),
        PinholeCamera(K=K, distortion=np.array([0.1, -0.05, 0.002, 0.001, 0.01])),
        ScaledOrthographicCamera(scale=300.0),
        ScaledOrthographicCamera(scale=np.full(6, 300.0)),
    ],
    ids=["pinhole", "each its own", "lens", "orthographic", "scales"],
)
def test_projecting_and_lifting_are_what_annotations_say(
    camera: PinholeCamera | ScaledOrthographicCamera,
) -> None:
    joints = VIEWS.joints_cam
    with watched("posekit.cameras") as wrong:
        image = camera.project(joints)
        for some in (slice(0, 1), slice(1, 1)):
            lift = camera.lift(joints[:, some], image[:, some], np.array(0.3), tolerance=0.0)
            assert lift.points.shape == (6, some.stop - some.start, 2, 3)
    assert wrong == set()
