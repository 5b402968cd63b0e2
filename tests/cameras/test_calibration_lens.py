"""Lenses: the models against OpenCV's own projection, and their inverse."""

import sys

import cv2
import numpy as np
import pytest

from posekit.cameras.calibrated import CalibratedCamera
from posekit.cameras.lens import fold_radius, project
from posekit.cameras.undistortion import undistorted
from posekit.errors import InputError

K = np.array([[900.0, 0.0, 640.0], [0.0, 920.0, 360.0], [0.0, 0.0, 1.0]])
LENSES = {
    "four": [-0.25, 0.08, 0.001, -0.002],
    "five": [-0.25, 0.08, 0.001, -0.002, -0.01],
    "rational": [0.8, -0.3, 0.0005, 0.0002, 0.01, 1.1, -0.2, 0.02],
    "thin prism": [-0.2, 0.05, 0.001, 0.001, 0.0, 0.0, 0.0, 0.0, 0.002, -0.001, 0.003, 0.0005],
    "tilted": [-0.2, 0.05, 0.001, 0.001, 0.0, 0.1, 0.02, 0.0, 0.002, -0.001, 0.003, 0.0005, 0.03, -0.05],
}
FISHEYE = [0.05, -0.01, 0.004, -0.001]


def lens(distortion: list[float], *, fisheye: bool = False, skew: float = 0.0) -> CalibratedCamera:
    skewed = K.copy()
    skewed[0, 1] = skew
    return CalibratedCamera(name="lens", K=skewed, distortion=np.array(distortion), fisheye=fisheye)


def cloud(rng: np.random.Generator, spread: float = 0.6) -> np.ndarray:
    directions = rng.uniform(-spread, spread, (400, 2))
    return np.concatenate([directions, np.ones((400, 1))], axis=1) * rng.uniform(1, 8, (400, 1))


def opencv(camera: CalibratedCamera, points: np.ndarray) -> np.ndarray:
    if camera.fisheye:
        k = np.zeros(4)
        k[: len(camera.distortion)] = camera.distortion
        image = cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), camera.K.copy(), k)[0]
        return np.asarray(image)[:, 0]
    image = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.K.copy(), camera.distortion.copy())[0]
    return np.asarray(image)[:, 0]


CAMERAS = [lens(values) for values in LENSES.values()] + [lens(FISHEYE, fisheye=True), lens([], fisheye=True)]


@pytest.mark.parametrize("camera", CAMERAS, ids=[*LENSES, "fisheye", "fisheye without coefficients"])
def test_projection_is_opencvs(camera: CalibratedCamera, rng: np.random.Generator) -> None:
    points = cloud(rng)
    np.testing.assert_allclose(project(camera, points), opencv(camera, points), atol=1e-8)


@pytest.mark.parametrize("camera", CAMERAS, ids=[*LENSES, "fisheye", "fisheye without coefficients"])
def test_undistorted_points_are_an_ideal_cameras(camera: CalibratedCamera, rng: np.random.Generator) -> None:
    points = cloud(rng)
    ideal = points @ camera.K.T
    np.testing.assert_allclose(
        undistorted(opencv(camera, points), camera), ideal[:, :2] / ideal[:, 2:], atol=1e-5
    )


def test_whole_pixels_are_pixels() -> None:
    camera = lens(LENSES["rational"])
    pixels = np.array([[300, 200], [320, 241]])
    np.testing.assert_array_equal(undistorted(pixels, camera), undistorted(pixels.astype(np.float64), camera))


def test_skew_is_kept(rng: np.random.Generator) -> None:
    camera = lens(LENSES["rational"], skew=7.0)
    points = cloud(rng)
    ideal = points @ camera.K.T
    np.testing.assert_allclose(
        undistorted(project(camera, points), camera), ideal[:, :2] / ideal[:, 2:], atol=1e-5
    )


def test_missing_points_stay_missing(rng: np.random.Generator) -> None:
    camera = lens(LENSES["rational"])
    pixels = project(camera, cloud(rng)).reshape(20, 20, 2)
    pixels[3, 4] = np.nan
    pixels[5, 6, 0] = np.nan
    pixels[7, 8] = np.inf
    ideal = undistorted(pixels, camera)
    lost = np.isnan(ideal).any(axis=-1)
    assert ideal.shape == pixels.shape
    assert sorted(map(tuple, np.argwhere(lost).tolist())) == [(3, 4), (5, 6), (7, 8)]
    assert undistorted(np.empty((0, 2)), camera).shape == (0, 2)
    assert np.isnan(undistorted(np.full((3, 2), np.nan), camera)).all()


@pytest.mark.parametrize(
    ("distortion", "fisheye", "outside"),
    [
        ([-0.4, 0.0, 0.0, 0.0, 0.0, 0.001, 0.0, 0.0], False, 1.3),
        ([-0.25, 0.0, 0.0, 0.0], True, 1.45),
    ],
)
def test_pixels_beyond_the_lens_are_nan(distortion: list[float], fisheye: bool, outside: float) -> None:
    camera = lens(distortion, fisheye=fisheye)
    fold = fold_radius(camera)
    assert fold < outside
    reached = np.tan(np.linspace(0.0, 0.98 * fold, 50)) if fisheye else np.linspace(0.0, 0.98 * fold, 50)
    inside = np.stack([reached, np.zeros(50), np.ones(50)], axis=-1)
    ideal = undistorted(project(camera, inside), camera)
    np.testing.assert_allclose(ideal[:, 0], 900 * reached + 640, rtol=1e-6)
    beyond = np.tan(1.01 * fold) if fisheye else 1.01 * fold
    assert np.isnan(project(camera, np.array([beyond, 0.0, 1.0]))).all()
    far = project(camera, inside)[-1] + [400.0, 0.0]
    assert np.isnan(undistorted(far, camera)).all()


def test_the_fold_is_where_the_slope_vanishes() -> None:
    k = np.array([-0.3, 0.02, 0.0, 0.0, 0.001, 0.05, 0.01, 0.0])
    camera = lens(k.tolist())
    r = np.linspace(0, 3, 300_001)
    image = r * (1 + k[0] * r**2 + k[1] * r**4 + k[4] * r**6) / (1 + k[5] * r**2 + k[6] * r**4 + k[7] * r**6)
    assert fold_radius(camera) == pytest.approx(r[np.argmax(np.diff(image) < 0)], abs=2e-5)
    assert fold_radius(lens([0.1, 0.0, 0.0, 0.0])) == np.inf


def test_points_behind_are_nan() -> None:
    assert np.isnan(project(lens(LENSES["five"]), np.array([[0.1, 0.1, -1.0], [0.0, 0.0, 0.0]]))).all()


def test_another_shape_is_refused() -> None:
    with pytest.raises(InputError, match="expected"):
        undistorted(np.zeros((4, 3)), lens(LENSES["rational"]))


def test_without_opencv_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(InputError, match=r"pip install 'posekit\[opencv\]'"):
        undistorted(np.zeros((1, 2)), lens(LENSES["rational"]))
    # What needs no OpenCV works without it.
    assert undistorted(np.array([[1.0, 2.0]]), lens([])).tolist() == [[1.0, 2.0]]
