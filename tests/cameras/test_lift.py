"""The lift: where the end of a segment can be. Both papers' ambiguity, and its edges."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.cameras import Lift, PinholeCamera
from posekit.cameras.camera import COINCIDENT_METRES, meet_sphere

CAMERA = PinholeCamera(K=np.array([[1500.0, 0, 960], [0, 1500, 540], [0, 0, 1]]))
AHEAD = np.array([[0.0, 0.0, 1.0]])


def lift(start: list[float], pixel: list[float], length: float, tolerance: float = 0.0) -> Lift:
    return CAMERA.lift(np.array([start]), np.array([pixel]), np.array(length), tolerance=tolerance)


def quadratic(start: np.ndarray, ray: np.ndarray, length: float) -> list[float]:
    """Depths of the ends by Lee & Chen's own equation (7), a quadratic in k."""
    a, b, c = ray @ ray, -2 * ray @ start, start @ start - length**2
    root = np.sqrt(b * b - 4 * a * c)
    return [(-b - root) / (2 * a), (-b + root) / (2 * a)]


def random_segments(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    start = rng.uniform(-1, 1, (n, 3)) + np.array([0, 0, 4])
    length = rng.uniform(0.1, 0.6, n)
    direction = rng.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return start, start + length[:, None] * direction, length


def test_every_lifted_point_reprojects_and_keeps_the_length(rng: np.random.Generator) -> None:
    start, end, length = random_segments(rng, 2000)
    pixel = CAMERA.project(end)
    lifted = CAMERA.lift(start, pixel, length, tolerance=0.0)
    assert lifted.valid.all(axis=1).mean() > 0.99
    for k in (0, 1):
        points, valid = lifted.points[:, k], lifted.valid[:, k]
        seen = CAMERA.project(points[valid])
        np.testing.assert_allclose((seen - pixel[valid]) / 1500, 0, rtol=0, atol=1e-12)
        kept = np.linalg.norm(points - start, axis=1)[valid]
        np.testing.assert_allclose(kept, length[valid], rtol=0, atol=1e-12)


def test_the_true_end_is_among_the_two(rng: np.random.Generator) -> None:
    start, end, length = random_segments(rng, 2000)
    lifted = CAMERA.lift(start, CAMERA.project(end), length, tolerance=1e-9)
    gap = np.linalg.norm(lifted.points - end[:, None], axis=-1)
    gap[~lifted.valid] = np.inf
    # Near a tangent ray the depth is only known to the root of the rounding.
    assert gap.min(axis=1).max() < 2 * COINCIDENT_METRES


def test_the_ends_are_the_roots_of_the_papers_quadratic(rng: np.random.Generator) -> None:
    start, end, length = random_segments(rng, 200)
    lifted = CAMERA.lift(start, CAMERA.project(end), length, tolerance=0.0)
    for k in np.flatnonzero(lifted.valid.all(axis=1)):
        ray = np.array([*(end[k, :2] / end[k, 2]), 1.0])
        near, far = quadratic(start[k], ray, float(length[k]))
        np.testing.assert_allclose(lifted.points[k, :, 2], [near, far], rtol=0, atol=1e-7)


def test_near_comes_before_far(rng: np.random.Generator) -> None:
    start, end, length = random_segments(rng, 500)
    lifted = CAMERA.lift(start, CAMERA.project(end), length, tolerance=0.0)
    assert (lifted.points[:, 0, 2] <= lifted.points[:, 1, 2]).all()


def test_a_ray_that_touches_the_sphere_has_one_end() -> None:
    # The ray at atan(0.3 / 0.4) from the axis is tangent to the sphere of radius 3 about (0, 0, 5).
    lifted = lift([0, 0, 5], [960 + 1500 * 0.75, 540], 3.0, tolerance=1e-12)
    np.testing.assert_array_equal(lifted.valid, [[True, False]])
    np.testing.assert_allclose(lifted.points[0, 0], [2.4, 0, 3.2], rtol=0, atol=1e-12)
    assert abs(lifted.excess[0]) < 1e-12


@pytest.mark.parametrize(("half", "solutions"), [(0.5 * COINCIDENT_METRES, 1), (2 * COINCIDENT_METRES, 2)])
def test_ends_too_near_to_tell_apart_count_as_one(half: float, solutions: int) -> None:
    start = np.array([[0.0, 0.25, 0.0]])
    length = np.array([np.hypot(0.25, half)])
    # Origin beside the start, so that no digits are lost to the camera's distance.
    lifted = meet_sphere(np.array([0.0, 0, -1]), AHEAD, start, length, tolerance=0.0)
    assert lifted.valid.sum() == solutions
    assert lifted.valid[0, 0]
    lengths = np.linalg.norm(lifted.points - start[:, None], axis=-1)[lifted.valid]
    np.testing.assert_allclose(lengths, length[0], rtol=0, atol=1e-12)


def test_a_segment_along_its_ray_ends_before_and_behind_its_start() -> None:
    lifted = lift([0.4, 0.2, 4.0], [960 + 150, 540 + 75], 0.3)
    direction = np.array([0.4, 0.2, 4.0]) / np.linalg.norm([0.4, 0.2, 4.0])
    start = np.array([0.4, 0.2, 4.0])
    expected = [start - 0.3 * direction, start + 0.3 * direction]
    np.testing.assert_allclose(lifted.points[0], expected, rtol=0, atol=1e-14)
    np.testing.assert_allclose(lifted.excess, -0.3, rtol=0, atol=1e-14)
    assert lifted.valid.all()


def test_from_the_optical_centre_only_the_far_end_is_seen() -> None:
    lifted = lift([0, 0, 0], [1100, 700], 0.3)
    np.testing.assert_array_equal(lifted.valid, [[False, True]])
    np.testing.assert_allclose(np.linalg.norm(lifted.points[0, 1]), 0.3, rtol=0, atol=1e-15)


def test_an_end_behind_the_camera_is_no_solution() -> None:
    lifted = lift([0.0, 0.0, 0.2], [960, 540], 0.5)
    np.testing.assert_array_equal(lifted.valid, [[False, True]])
    np.testing.assert_allclose(lifted.points[0, 1], [0, 0, 0.7], rtol=0, atol=1e-15)
    assert not lift([0.0, 0.0, -2.0], [960, 540], 0.5).valid.any()
    tangent_behind = meet_sphere(
        np.zeros(3), AHEAD, np.array([[0.5, 0, -2]]), np.array([0.5]), tolerance=1e-3
    )
    assert not tangent_behind.valid.any()


@pytest.mark.parametrize(("tolerance", "found"), [(0.0, False), (0.0009, False), (0.0011, True), (1.0, True)])
def test_a_segment_too_short_is_tangent_within_the_tolerance(tolerance: float, found: bool) -> None:
    start, length = np.array([[0.301, 0, 4.0]]), np.array([0.3])
    lifted = meet_sphere(np.zeros(3), AHEAD, start, length, tolerance=tolerance)
    np.testing.assert_allclose(lifted.excess, 0.001, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(lifted.valid, [[found, False]])
    np.testing.assert_allclose(lifted.points[0, 0], [0, 0, 4], rtol=0, atol=1e-15)


def test_a_negative_tolerance_is_none() -> None:
    start, end = np.array([[0.0, 0, 4]]), np.array([[0.1, 0.1, 4.1]])
    length = np.linalg.norm(end - start, axis=1)
    lifted = CAMERA.lift(start, CAMERA.project(end), length, tolerance=-1.0)
    assert lifted.valid.all()


@given(
    seed=st.integers(0, 2**31),
    tolerances=st.tuples(st.floats(0, 0.5), st.floats(0, 0.5)).map(sorted),
)
def test_a_looser_tolerance_never_loses_solutions(seed: int, tolerances: list[float]) -> None:
    rng = np.random.default_rng(seed)
    start = rng.uniform(-1, 1, (50, 3)) + np.array([0, 0, 1])
    pixel = rng.uniform([0, 0], [1920, 1080], (50, 2))
    length = rng.uniform(0.01, 2, 50)
    strict, loose = (CAMERA.lift(start, pixel, length, tolerance=tolerance) for tolerance in tolerances)
    assert (loose.valid | ~strict.valid).all()
    np.testing.assert_array_equal(strict.points, loose.points)
    np.testing.assert_array_equal(strict.excess, loose.excess)


@given(seed=st.integers(0, 2**31), tolerance=st.floats(0, 0.1))
def test_the_number_of_solutions_follows_from_the_excess(seed: int, tolerance: float) -> None:
    rng = np.random.default_rng(seed)
    start = rng.uniform(-1, 1, (50, 3)) + np.array([0, 0, 6])
    length = rng.uniform(0.01, 2, 50)
    lifted = CAMERA.lift(start, rng.uniform([0, 0], [1920, 1080], (50, 2)), length, tolerance=tolerance)
    count = lifted.valid.sum(axis=1)
    clear = np.abs(lifted.excess) > 1e-9
    np.testing.assert_array_equal(count == 2, (lifted.excess < 0) & clear)
    np.testing.assert_array_equal(
        (count == 1)[clear], ((lifted.excess > 0) & (lifted.excess <= tolerance))[clear]
    )
    np.testing.assert_array_equal(count == 0, lifted.excess > tolerance)


@pytest.mark.parametrize("unknown", ["start", "pixel"])
def test_what_is_unknown_has_no_solution(unknown: str) -> None:
    nan = float("nan")
    lifted = lift(
        [nan, 0, 4] if unknown == "start" else [0, 0, 4], [960, nan if unknown == "pixel" else 540], 0.3
    )
    assert not lifted.valid.any()
    assert np.isnan(lifted.points).any(axis=-1).all()
    assert np.isnan(lifted.excess).all()


def test_a_distorted_pixel_that_no_ray_reaches_has_no_solution() -> None:
    camera = PinholeCamera(K=np.eye(3), distortion=np.array([-0.3, 0, 0, 0, 0]))
    lifted = camera.lift(np.array([[0.0, 0, 4]]), np.array([[1.5, 0.0]]), np.array(9.0), tolerance=1.0)
    assert not lifted.valid.any()


def test_a_batch_is_its_elements(rng: np.random.Generator) -> None:
    start, end, length = random_segments(rng, 24)
    shaped = CAMERA.lift(
        start.reshape(4, 6, 3), CAMERA.project(end).reshape(4, 6, 2), length.reshape(4, 6), tolerance=0.0
    )
    for k in range(24):
        alone = CAMERA.lift(
            start[k : k + 1], CAMERA.project(end[k : k + 1]), length[k : k + 1], tolerance=0.0
        )
        np.testing.assert_array_equal(shaped.points.reshape(24, 2, 3)[k], alone.points[0])
        np.testing.assert_array_equal(shaped.valid.reshape(24, 2)[k], alone.valid[0])
