"""Where points are seen and how the image moves with them: against the cameras and finite differences."""

from __future__ import annotations

import numpy as np
import pytest

from posekit.cameras import Camera, PinholeCamera, ScaledOrthographicCamera
from posekit.cameras.lee_chen import pinhole
from posekit.errors import InputError
from posekit.refinement import project
from posekit.refinement.optics import optics_of

K = np.array([[1500.0, 3.0, 960.0], [0.0, 1450.0, 540.0], [0.0, 0.0, 1.0]])
CAMERAS: dict[str, Camera] = {
    "pinhole": PinholeCamera(K=K),
    "one a frame": PinholeCamera(
        K=np.stack([K * np.array([[s, s, 1], [1, s, 1], [1, 1, 1]]) for s in (1, 0.9, 1.2, 2)])
    ),
    "distorted": PinholeCamera(K=K, distortion=np.array([-0.2, 0.08, 1e-3, -2e-3, -0.01])),
    "paper": pinhole(0.05),
    "orthographic": ScaledOrthographicCamera(scale=np.array([200.0, 300.0, 100.0, 50.0]), aspect=1.1),
}


def points(rng: np.random.Generator) -> np.ndarray:
    return np.asarray(rng.normal(size=(4, 9, 3)) * 0.5 + np.array([0.0, 0.0, 3.5]))


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())
def test_the_image_is_the_cameras_own_and_its_derivative_that_of_differences(
    camera: Camera, rng: np.random.Generator
) -> None:
    p = points(rng)
    image, jacobian = project(camera, p)
    np.testing.assert_allclose(image, camera.project(p), rtol=1e-13, atol=1e-12)
    step = 1e-6
    for axis in range(3):
        aside = step * np.eye(3)[axis]
        slope = (camera.project(p + aside) - camera.project(p - aside)) / (2 * step)
        np.testing.assert_allclose(jacobian[..., axis], slope, rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())
def test_rays_go_through_the_points_they_are_of(camera: Camera, rng: np.random.Generator) -> None:
    p = points(rng)
    last = np.ascontiguousarray(p.transpose(1, 2, 0))
    optics = optics_of(camera, np.arange(4))
    ray, foot = optics.rays(optics.image(last), last)
    np.testing.assert_allclose(np.linalg.norm(ray, axis=1), 1.0)
    np.testing.assert_allclose(foot, last, atol=1e-9)


def test_a_point_behind_the_camera_is_not_seen() -> None:
    image, _ = project(CAMERAS["pinhole"], np.array([[[0.1, 0.2, -1.0]]]))
    assert np.isnan(image).all()


def test_what_is_no_camera_of_these_is_refused() -> None:
    class Other:
        def project(self, points: np.ndarray) -> np.ndarray:
            return points

        def lift(self, *_: object, **__: object) -> None:
            raise NotImplementedError

    with pytest.raises(InputError, match="PinholeCamera"):
        project(Other(), np.zeros((1, 1, 3)))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="4 frames"):
        optics_of(CAMERAS["one a frame"], np.array([4]))
