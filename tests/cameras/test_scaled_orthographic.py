"""The scaled orthographic camera: projection, the lift by foreshortening, and its edge at the bound of the scale."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.cameras import Lift, ScaledOrthographicCamera
from posekit.cameras.camera import COINCIDENT_METRES
from posekit.errors import CameraError

CAMERA = ScaledOrthographicCamera(scale=200.0)


def lift(start: list[float], pixel: list[float], length: float, tolerance: float = 0.0) -> Lift:
    return CAMERA.lift(np.array([start]), np.array([pixel]), np.array(length), tolerance=tolerance)


def random_segments(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    start = rng.uniform(-1, 1, (n, 3))
    length = rng.uniform(0.1, 0.6, n)
    direction = rng.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return start, start + length[:, None] * direction, length


def test_it_drops_the_depth_and_scales() -> None:
    np.testing.assert_array_equal(CAMERA.project(np.array([[0.3, -0.2, 7.0]])), [[60.0, -40.0]])


def test_an_image_of_wide_pixels_has_fewer_of_them() -> None:
    camera = ScaledOrthographicCamera(scale=200.0, aspect=2.0)
    np.testing.assert_array_equal(camera.project(np.array([[0.3, -0.2, 7.0]])), [[30.0, -40.0]])
    np.testing.assert_allclose(camera.unproject(np.array([[30.0, -40.0]])), [[0.3, -0.2]], rtol=0, atol=1e-16)


@pytest.mark.parametrize("aspect", [1.0, 0.5, 1.25])
def test_unproject_inverts_project(rng: np.random.Generator, aspect: float) -> None:
    points = rng.normal(size=(50, 7, 3))
    camera = ScaledOrthographicCamera(scale=rng.uniform(10, 1000, 50), aspect=aspect)
    np.testing.assert_allclose(camera.unproject(camera.project(points)), points[..., :2], rtol=0, atol=1e-14)


def test_each_frame_has_its_own_scale() -> None:
    camera = ScaledOrthographicCamera(scale=np.array([100.0, 300.0]))
    points = np.broadcast_to([0.1, 0.2, 5.0], (2, 4, 3))
    assert camera.project(points)[:, 0].tolist() == [[10.0, 20.0], [30.0, 60.0]]
    pixel = np.broadcast_to([30.0, 60.0], (2, 4, 2))
    lifted = camera.lift(np.zeros((2, 4, 3)), pixel, np.array(0.5), tolerance=0.0)
    assert (lifted.valid.sum(axis=-1) == [[0] * 4, [2] * 4]).all()


@pytest.mark.parametrize("aspect", [1.0, 0.5, 1.25])
def test_every_lifted_point_reprojects_and_keeps_the_length(rng: np.random.Generator, aspect: float) -> None:
    camera = ScaledOrthographicCamera(scale=321.0, aspect=aspect)
    start, end, length = random_segments(rng, 2000)
    pixel = camera.project(end)
    lifted = camera.lift(start, pixel, length, tolerance=0.0)
    assert lifted.valid.all(axis=1).mean() > 0.99
    for k in (0, 1):
        points = lifted.points[:, k]
        np.testing.assert_allclose(camera.project(points), pixel, rtol=0, atol=1e-10)
        kept = np.linalg.norm(points - start, axis=1)
        np.testing.assert_allclose(kept, length, rtol=0, atol=1e-12)


def test_the_true_end_is_among_the_two(rng: np.random.Generator) -> None:
    start, end, length = random_segments(rng, 2000)
    lifted = CAMERA.lift(start, CAMERA.project(end), length, tolerance=0.0)
    gap = np.linalg.norm(lifted.points - end[:, None], axis=-1)
    gap[~lifted.valid] = np.inf
    assert gap.min(axis=1).max() < 2 * COINCIDENT_METRES


def test_near_and_far_are_mirror_images_in_the_plane_of_the_start(rng: np.random.Generator) -> None:
    start, end, length = random_segments(rng, 500)
    lifted = CAMERA.lift(start, CAMERA.project(end), length, tolerance=0.0)
    depth = lifted.points[..., 2] - start[:, None, 2]
    assert (depth[:, 0] <= 0).all()
    np.testing.assert_allclose(depth.sum(axis=1), 0.0, rtol=0, atol=1e-15)


def test_the_foreshortening_of_a_three_four_five_triangle() -> None:
    # 0.3 m across, seen as 60 pixels; 0.5 m long: 0.4 m of depth (Taylor 2000, eq. 2).
    lifted = lift([0.1, 0.1, 2.0], [80.0, 20.0], 0.5)
    np.testing.assert_allclose(lifted.points[0], [[0.4, 0.1, 1.6], [0.4, 0.1, 2.4]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(lifted.excess, -0.2, rtol=0, atol=1e-15)


def test_nothing_is_behind_this_camera() -> None:
    assert lift([0.1, 0.1, -20.0], [80.0, 20.0], 0.5).valid.all()


def test_a_segment_that_shows_its_length_has_one_end() -> None:
    lifted = lift([0.0, 0.0, 1.0], [100.0, 0.0], 0.5)
    np.testing.assert_array_equal(lifted.valid, [[True, False]])
    np.testing.assert_array_equal(lifted.points[0, 0], [0.5, 0.0, 1.0])


@pytest.mark.parametrize("length", [0.25, 20.0])
@pytest.mark.parametrize(("half", "solutions"), [(0.5 * COINCIDENT_METRES, 1), (2 * COINCIDENT_METRES, 2)])
def test_ends_too_near_to_tell_apart_count_as_one(length: float, half: float, solutions: int) -> None:
    # Relative lengths may be large, and so is then what rounding leaves of the depth.
    half *= max(1.0, length)
    apart = np.sqrt(length**2 - half**2)
    lifted = CAMERA.lift(
        np.zeros((1, 3)), np.array([[200.0 * apart, 0.0]]), np.array([length]), tolerance=0.0
    )
    assert lifted.valid.sum() == solutions
    assert lifted.valid[0, 0]


@given(
    seed=st.integers(0, 2**31),
    offset=st.sampled_from([0.0, 100.0, 1e4, 1e6]),
    size=st.sampled_from([0.3, 20.0, 1e3]),
)
def test_at_the_bound_the_segment_that_sets_it_has_exactly_one_end(
    seed: int, offset: float, size: float
) -> None:
    rng = np.random.default_rng(seed)
    image = rng.uniform(0, 600, (100, 2, 2)) + offset
    length = rng.uniform(0.1, 1, 100) * size
    camera = ScaledOrthographicCamera(scale=np.linalg.norm(image[:, 1] - image[:, 0], axis=1) / length)
    start = np.concatenate([camera.unproject(image)[:, 0], np.zeros((100, 1))], axis=1)
    lifted = camera.lift(start, image[:, 1], length, tolerance=0.0)
    assert lifted.valid[:, 0].all()
    assert not lifted.valid[:, 1].any()


@pytest.mark.parametrize(("tolerance", "found"), [(0.0, False), (0.0009, False), (0.0011, True), (1.0, True)])
def test_a_segment_too_short_is_tangent_within_the_tolerance(tolerance: float, found: bool) -> None:
    lifted = lift([0.0, 0.0, 4.0], [60.2, 0.0], 0.3, tolerance)
    np.testing.assert_allclose(lifted.excess, 0.001, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(lifted.valid, [[found, False]])
    np.testing.assert_allclose(lifted.points[0, 0], [0.301, 0, 4], rtol=0, atol=1e-15)


def test_a_negative_tolerance_is_none(rng: np.random.Generator) -> None:
    start, end, length = random_segments(rng, 20)
    assert CAMERA.lift(start, CAMERA.project(end), length, tolerance=-1.0).valid.all()


@pytest.mark.parametrize("unknown", ["start", "pixel"])
def test_what_is_not_known_has_no_solution(unknown: str) -> None:
    start = [np.nan] * 3 if unknown == "start" else [0.0, 0.0, 0.0]
    pixel = [np.nan, 1.0] if unknown == "pixel" else [1.0, 1.0]
    assert not lift(start, pixel, 0.5, tolerance=1.0).valid.any()


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf, [1.0, 0.0], [[1.0]]])
def test_an_impossible_scale_is_refused(scale: object) -> None:
    with pytest.raises(CameraError, match="scale must be finite and positive"):
        ScaledOrthographicCamera(scale=np.array(scale))


@pytest.mark.parametrize("aspect", [0.0, -1.0, np.nan, np.inf])
def test_an_impossible_aspect_ratio_is_refused(aspect: float) -> None:
    with pytest.raises(CameraError, match="aspect must be finite and positive"):
        ScaledOrthographicCamera(scale=1.0, aspect=aspect)


def test_its_scale_cannot_be_changed() -> None:
    scale = np.array([100.0, 200.0])
    camera = ScaledOrthographicCamera(scale=scale)
    scale[0] = -1.0
    assert np.asarray(camera.scale)[0] == 100.0
    with pytest.raises(ValueError, match="read-only"):
        np.asarray(camera.scale)[0] = 1.0
