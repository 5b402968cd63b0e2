"""The pinhole camera: projection and its inverse, frames with their own intrinsics, what is refused."""

import numpy as np
import pytest

from posekit.cameras import PinholeCamera
from posekit.errors import CameraError

K = np.array([[1500.0, 3.0, 960.0], [0.0, 1400.0, 540.0], [0.0, 0.0, 1.0]])
DISTORTION = np.array([-0.2, 0.05, 0.001, -0.002, 0.01])


def points_in_front(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    points = rng.uniform(-1, 1, (*shape, 3))
    points[..., 2] = rng.uniform(1, 8, shape)
    return points


def test_projection_is_the_matrix_product(rng: np.random.Generator) -> None:
    points = points_in_front(rng, (200,))
    homogeneous = points @ K.T
    np.testing.assert_allclose(
        PinholeCamera(K=K).project(points), homogeneous[:, :2] / homogeneous[:, 2:], rtol=1e-14
    )


def test_projection_agrees_with_opencv(rng: np.random.Generator) -> None:
    cv2 = pytest.importorskip("cv2")
    points = points_in_front(rng, (200,))
    without_skew = K * [[1, 0, 1], [1, 1, 1], [1, 1, 1]]
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), without_skew, None)
    seen = PinholeCamera(K=without_skew).project(points)
    np.testing.assert_allclose(seen, expected[:, 0], rtol=0, atol=1e-9)


@pytest.mark.parametrize("distortion", [None, DISTORTION])
@pytest.mark.parametrize("shape", [(1,), (7,), (3, 5), (3, 2, 4)])
def test_normalize_inverts_projection(
    rng: np.random.Generator, shape: tuple[int, ...], distortion: np.ndarray | None
) -> None:
    points = points_in_front(rng, shape) * [0.3, 0.3, 1]
    camera = PinholeCamera(K=K, distortion=distortion)
    normalized = camera.normalize(camera.project(points))
    np.testing.assert_allclose(normalized, points[..., :2] / points[..., 2:], rtol=0, atol=1e-12)


@pytest.mark.parametrize("shape", [(4,), (4, 6), (4, 2, 3)])
def test_intrinsics_per_frame_are_cameras_one_by_one(
    rng: np.random.Generator, shape: tuple[int, ...]
) -> None:
    many = K + np.zeros((4, 3, 3))
    many[:, 0, 0] += [0, 10, 200, -300]
    many[:, 1, 2] += [1, 2, 3, 4]
    points = points_in_front(rng, shape)
    together = PinholeCamera(K=many, distortion=DISTORTION).project(points)
    for frame in range(4):
        alone = PinholeCamera(K=many[frame], distortion=DISTORTION).project(points[frame : frame + 1])
        np.testing.assert_array_equal(together[frame : frame + 1], alone)
    back = PinholeCamera(K=many).normalize(PinholeCamera(K=many).project(points))
    np.testing.assert_allclose(back, points[..., :2] / points[..., 2:], rtol=0, atol=1e-12)


@pytest.mark.parametrize("depth", [0.0, -1.0, -0.0, np.nan])
def test_a_point_that_is_not_in_front_is_not_seen(depth: float) -> None:
    seen = PinholeCamera(K=K).project(np.array([[0.1, 0.2, depth], [0.1, 0.2, 2.0]]))
    assert np.isnan(seen[0]).all()
    assert np.isfinite(seen[1]).all()


def test_points_on_one_ray_are_seen_at_one_pixel(rng: np.random.Generator) -> None:
    camera = PinholeCamera(K=K, distortion=DISTORTION)
    points = points_in_front(rng, (50,)) * [0.3, 0.3, 1]
    np.testing.assert_allclose(camera.project(points * 3.7), camera.project(points), rtol=0, atol=1e-9)


def test_the_camera_keeps_its_own_read_only_copy() -> None:
    mine, coefficients = K.copy(), DISTORTION.copy()
    camera = PinholeCamera(K=mine, distortion=coefficients)
    mine[0, 0] = coefficients[0] = 7.0
    assert camera.K[0, 0] == K[0, 0]
    assert camera.distortion is not None
    assert camera.distortion[0] == DISTORTION[0]
    for array in (camera.K, camera.distortion):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0


@pytest.mark.parametrize(
    ("wrong", "names"),
    [
        (np.eye(2), "shape"),
        (np.zeros((2, 2, 3, 3)), "shape"),
        (np.full((3, 3), np.nan), "finite"),
        (np.diag([1.0, np.inf, 1.0]), "finite"),
        (np.diag([0.0, 1.0, 1.0]), "focal lengths must be positive"),
        (np.diag([1.0, -5.0, 1.0]), "focal lengths must be positive"),
        (np.diag([1.0, 1.0, 2.0]), "upper triangular"),
        (np.array([[1, 0, 0], [1, 1, 0], [0, 0, 1]]), "upper triangular"),
        (np.array([[1, 0, 0], [0, 1, 0], [1e-3, 0, 1]]), "upper triangular"),
    ],
)
def test_impossible_intrinsics_are_refused(wrong: np.ndarray, names: str) -> None:
    with pytest.raises(CameraError, match=names) as error:
        PinholeCamera(K=wrong)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "wrong",
    [
        np.zeros(4),
        np.zeros(8),
        np.array([0, 0, np.nan, 0, 0]),
        np.zeros((1, 5)),
        np.array([0, 0, 0, 0, -2e9]),
    ],
)
def test_impossible_distortion_is_refused(wrong: np.ndarray) -> None:
    with pytest.raises(CameraError, match="five numbers") as error:
        PinholeCamera(K=K, distortion=wrong)
    assert "\n" not in str(error.value)
