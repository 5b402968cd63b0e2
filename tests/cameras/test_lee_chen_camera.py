"""The paper's camera against posekit's: the same image, the same points, the same matrices."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.cameras.lee_chen import (
    camera_position,
    image_from_paper,
    pinhole,
    points_from_paper,
    points_to_paper,
    rotation_to_paper,
    transformation_matrix,
)
from posekit.errors import CameraError

numbers = st.floats(-10, 10, allow_subnormal=False)
FAR = np.array([0.0, 0.0, 5.0])
lengths = st.floats(1e-3, 10)


@st.composite
def rotations(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return Q * np.sign(np.linalg.det(Q))


@st.composite
def points(draw):
    return np.array(draw(st.tuples(numbers, numbers, st.floats(0.01, 10))))


@given(points(), lengths)
def test_projects_as_the_paper_says(point, f):
    """x' = f x / (z + f), y' = f y / (z + f): eqs. 6a and 6b, solved for x' and y'."""
    expected = f * point[:2] / (point[2] + f)
    pixel = pinhole(f).project(points_from_paper(point, f)[None])[0]
    np.testing.assert_allclose(image_from_paper(pixel), expected, rtol=1e-14, atol=1e-14)


@given(points(), lengths)
def test_there_and_back(point, f):
    np.testing.assert_allclose(points_to_paper(points_from_paper(point, f), f), point, rtol=0, atol=1e-14)
    np.testing.assert_allclose(points_from_paper(points_to_paper(point, f), f), point, rtol=0, atol=1e-14)
    assert (image_from_paper(image_from_paper(point[:2])) == point[:2]).all()


@given(points(), lengths)
def test_the_image_plane_is_at_depth_f(point, f):
    on_plane = np.array([point[0], point[1], 0.0])
    assert points_from_paper(on_plane, f)[2] == f
    np.testing.assert_allclose(
        image_from_paper(pinhole(f).project(points_from_paper(on_plane, f)[None])[0]), on_plane[:2]
    )


@given(rotations(), points(), lengths, points())
def test_transformation_matrix_projects(R, t, f, point):
    """Eq. (1): (x, y, z, 1) [T] = (X, Y, H)."""
    t = t + np.array([0, 0, 40])
    X, Y, H = np.append(point, 1.0) @ transformation_matrix(R, t, f)
    pixel = image_from_paper(pinhole(f).project((R @ point + t)[None])[0])
    np.testing.assert_allclose([X / H, Y / H], pixel, rtol=1e-12, atol=1e-12)


@given(rotations(), points(), lengths)
def test_transformation_matrix_is_the_one_of_the_paper(R, t, f):
    """[T] in the letters of §2.1: rotation a..r, camera position (x0, y0, z0)."""
    rotation = rotation_to_paper(R)
    place = camera_position(R, t, f)
    expected = np.zeros((4, 3))
    expected[:3] = rotation * [1, 1, -1 / f]
    expected[3] = -place @ rotation * [1, 1, -1 / f] + [0, 0, 1]
    T = transformation_matrix(R, t, f)
    np.testing.assert_allclose(T, expected, rtol=1e-12, atol=1e-12 * max(1, 1 / f))
    # Eq. (5): the camera position from the fourth row.
    from_row = rotation @ [-T[3, 0], -T[3, 1], (T[3, 2] - 1) * f]
    np.testing.assert_allclose(place, from_row, rtol=1e-12, atol=1e-12)


@given(rotations(), points(), lengths)
def test_camera_position_is_the_origin_of_the_image_plane(R, t, f):
    place = camera_position(R, t, f)
    np.testing.assert_allclose(points_to_paper(R @ place + t, f), 0, atol=1e-13)
    centre = -R.T @ t
    assert np.linalg.norm(place - centre) == pytest.approx(f, rel=1e-12, abs=1e-13)


@given(rotations())
def test_rotation_stays_one(R):
    """The paper's [R] is a rotation: right, up and backward are right-handed."""
    rotation = rotation_to_paper(R)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-13)
    assert np.linalg.det(rotation) == pytest.approx(1)


def test_one_f_a_frame_is_the_same_as_frame_by_frame(rng):
    f = rng.uniform(0.01, 1, 3)
    t = rng.normal(size=(3, 3)) + FAR
    R = np.linalg.qr(rng.normal(size=(3, 3, 3)))[0]
    R *= np.sign(np.linalg.det(R))[:, None, None]
    for shape in ((3, 3), (3, 3, 3), (3, 2, 3), (3, 4, 5, 3)):
        place = rng.normal(size=shape) + FAR
        for convert in (points_from_paper, points_to_paper):
            each = np.stack([convert(place[k], f[k]) for k in range(3)])
            np.testing.assert_array_equal(convert(place, f), each)
    for name in (camera_position, transformation_matrix):
        np.testing.assert_allclose(
            name(R, t, f), np.stack([name(R[k], t[k], f[k]) for k in range(3)]), rtol=1e-14
        )
    np.testing.assert_array_equal(rotation_to_paper(R), np.stack([rotation_to_paper(each) for each in R]))
    image = rng.normal(size=(3, 4, 3)) + FAR
    np.testing.assert_allclose(
        pinhole(f).project(image), np.stack([pinhole(f[k]).project(image[k]) for k in range(3)]), rtol=1e-15
    )


@pytest.mark.parametrize("f", [0.0, -0.05, np.nan, np.inf, [0.05, -1.0]])
def test_f_must_be_positive(f):
    with pytest.raises(CameraError, match="f must be positive and finite"):
        pinhole(np.asarray(f))
