"""Brown's distortion and its inverse, against each other and against OpenCV's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.cameras import PinholeCamera
from posekit.cameras.pinhole import distort, fold_radius, undistort

LENSES = [
    np.zeros(5),
    np.array([-0.28, 0.07, 0.0002, 0.00002, 0.0]),
    np.array([0.15, -0.1, 0.002, -0.003, 0.05]),
    np.array([-0.4, 0.2, -0.001, 0.001, -0.05]),
]
K = np.array([[1500.0, 0, 960], [0, 1500, 540], [0, 0, 1]])


def disc(rng: np.random.Generator, radius: float, n: int = 500) -> np.ndarray:
    r, angle = radius * np.sqrt(rng.random(n)), rng.uniform(0, 2 * np.pi, n)
    return np.stack([r * np.cos(angle), r * np.sin(angle)], axis=-1)


@pytest.mark.parametrize("lens", LENSES)
def test_undistort_inverts_distort(rng: np.random.Generator, lens: np.ndarray) -> None:
    rays = disc(rng, min(1.0, 0.9 * fold_radius(lens)))
    np.testing.assert_allclose(undistort(distort(rays, lens), lens), rays, rtol=0, atol=1e-12)


@given(
    k1=st.floats(-0.3, 0.3), k2=st.floats(-0.1, 0.1), p1=st.floats(-0.005, 0.005), p2=st.floats(-0.005, 0.005)
)
def test_undistort_inverts_distort_for_any_mild_lens(k1: float, k2: float, p1: float, p2: float) -> None:
    lens = np.array([k1, k2, p1, p2, 0.0])
    rays = disc(np.random.default_rng(0), min(0.8, 0.9 * fold_radius(lens)), 100)
    np.testing.assert_allclose(undistort(distort(rays, lens), lens), rays, rtol=0, atol=1e-11)


def test_no_distortion_changes_nothing(rng: np.random.Generator) -> None:
    rays = disc(rng, 3.0)
    np.testing.assert_array_equal(distort(rays, np.zeros(5)), rays)
    np.testing.assert_array_equal(undistort(rays, np.zeros(5)), rays)


@pytest.mark.parametrize("lens", LENSES)
def test_projection_agrees_with_opencv(rng: np.random.Generator, lens: np.ndarray) -> None:
    cv2 = pytest.importorskip("cv2")
    points = rng.uniform([-1, -1, 3], [1, 1, 6], (300, 3))
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, lens)
    seen = PinholeCamera(K=K, distortion=lens).project(points)
    np.testing.assert_allclose(seen, expected[:, 0], rtol=0, atol=1e-9)


@pytest.mark.parametrize("lens", LENSES)
def test_normalize_agrees_with_opencv(rng: np.random.Generator, lens: np.ndarray) -> None:
    cv2 = pytest.importorskip("cv2")
    pixels = distort(disc(rng, 0.5), lens) * 1500 + [960, 540]
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-15)
    expected = cv2.undistortPoints(pixels[:, None], K, lens, criteria=criteria)
    camera = PinholeCamera(K=K, distortion=lens)
    np.testing.assert_allclose(camera.normalize(pixels), expected[:, 0], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("lens", "radius"),
    [
        (np.zeros(5), np.inf),
        (np.array([0.3, 0.1, 0, 0, 0.02]), np.inf),
        (np.array([-1 / 3, 0, 0, 0, 0]), 1.0),
        (np.array([-0.3, 0, 0, 0, 0]), np.sqrt(1 / 0.9)),
    ],
)
def test_the_fold_is_where_the_distorted_radius_stops_growing(lens: np.ndarray, radius: float) -> None:
    np.testing.assert_allclose(fold_radius(lens), radius, rtol=1e-12)


@pytest.mark.parametrize("lens", [lens for lens in LENSES if np.isfinite(fold_radius(lens))])
def test_the_distorted_radius_grows_up_to_the_fold_and_no_further(lens: np.ndarray) -> None:
    fold = fold_radius(lens)
    radial = lens * [1, 1, 0, 0, 1]
    inside = np.linspace(0, fold, 1000)
    grown = distort(np.stack([inside, np.zeros(1000)], axis=-1), radial)[:, 0]
    assert (np.diff(grown) > 0).all()
    beyond = distort(np.array([[fold * 1.01, 0.0]]), radial)[0, 0]
    assert beyond < grown[-1]


@pytest.mark.parametrize("radius", [0.705, 0.75, 1.0, 1.5, 2.0, 5.0, 1e3, 1e200])
def test_a_pixel_that_no_ray_reaches_has_none(radius: float) -> None:
    # k1 = -0.3 bends every ray inside a radius of 0.7027; at 1.0 the polynomial is met again, on the other side.
    lens = np.array([-0.3, 0, 0, 0, 0])
    assert np.isnan(undistort(np.array([[radius, 0.0]]), lens)).all()


def test_wild_lenses_give_a_ray_that_fits_or_none(rng: np.random.Generator) -> None:
    found = 0
    for _ in range(50):
        lens = rng.uniform(-1, 1, 5) * [1, 1, 0.02, 0.02, 1]
        pixels = rng.uniform(-3, 3, (200, 2))
        rays = undistort(pixels, lens)
        known = np.isfinite(rays).all(axis=1)
        np.testing.assert_array_equal(known, ~np.isnan(rays).any(axis=1))
        np.testing.assert_allclose(distort(rays[known], lens), pixels[known], rtol=0, atol=1e-9)
        assert (np.linalg.norm(rays[known], axis=1) <= fold_radius(lens)).all()
        found += known.sum()
    assert found > 1000


def test_an_unknown_pixel_stays_unknown() -> None:
    assert np.isnan(undistort(np.array([[np.nan, 0.1]]), LENSES[1])).all()
