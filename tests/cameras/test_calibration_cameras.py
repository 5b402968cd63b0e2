"""Cameras in memory: what describes one, guesses, rotations, and which one is chosen."""

import math
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.cameras.calibrated import CalibratedCamera, choose_camera, needs_undistortion, pinhole_of
from posekit.cameras.guesses import camera_from_focal35, camera_from_fov
from posekit.cameras.rotation import rotation_from_rounded, rotation_from_wxyz
from posekit.errors import CameraError, InputError
from posekit.geometry import rotation_from_vector, vector_from_rotation

K = np.array([[1000.0, 0.0, 320.0], [0.0, 1010.0, 240.0], [0.0, 0.0, 1.0]])
ANGLES = st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3)


def camera(**more: object) -> CalibratedCamera:
    return CalibratedCamera(name="left", K=K, **more)  # type: ignore[arg-type]


@settings(deadline=None)
@given(ANGLES)
def test_rotation_vectors_are_opencvs(vector: list[float]) -> None:
    R = rotation_from_vector(np.array(vector))
    np.testing.assert_allclose(R, cv2.Rodrigues(np.array(vector))[0], atol=1e-12)


@settings(deadline=None)
@given(ANGLES, st.sampled_from([1.0, 1e-3, 1e-9, 0.0]))
def test_rotation_vectors_round_trip(vector: list[float], size: float) -> None:
    R = rotation_from_vector(size * np.array(vector))
    back = vector_from_rotation(R)
    np.testing.assert_allclose(rotation_from_vector(back), R, atol=1e-12)
    assert np.linalg.norm(back) <= math.pi + 1e-12


@pytest.mark.parametrize("axis", [*np.eye(3).tolist(), [1.0, 1.0, 0.0], [-1.0, 2.0, 3.0]])
def test_half_a_turn_round_trips(axis: list[float]) -> None:
    R = rotation_from_vector(math.pi * np.array(axis) / np.linalg.norm(axis))
    np.testing.assert_allclose(rotation_from_vector(vector_from_rotation(R)), R, atol=1e-12)


@settings(deadline=None)
@given(ANGLES)
def test_quaternions_are_hamiltons(vector: list[float]) -> None:
    angle = float(np.linalg.norm(vector))
    axis = np.array(vector) / angle if angle else np.array([1.0, 0.0, 0.0])
    q = np.array([math.cos(angle / 2), *(math.sin(angle / 2) * axis)])
    np.testing.assert_allclose(rotation_from_wxyz(q), rotation_from_vector(np.array(vector)), atol=1e-12)


@pytest.mark.parametrize("length", [0.9991, 1.0, 1.0009])
def test_a_quaternion_that_is_rounded_turns_and_does_not_stretch(length: float) -> None:
    q = np.array([0.5, -0.5, 0.1, 0.7])
    q /= np.linalg.norm(q)
    np.testing.assert_allclose(rotation_from_wxyz(length * q), rotation_from_wxyz(q), atol=1e-12)


def test_a_rounded_rotation_becomes_exact() -> None:
    R = rotation_from_vector(np.array([0.3, -0.2, 0.9]))
    exact = rotation_from_rounded(R.round(4))
    np.testing.assert_allclose(exact @ exact.T, np.eye(3), atol=1e-14)
    assert np.abs(exact - R).max() < 1e-4


@pytest.mark.parametrize(
    ("matrix", "says"),
    [
        (np.diag([1.0, 1.0, -1.0]), "mirrors"),
        (2 * np.eye(3), "off the identity"),
        (np.full((3, 3), np.nan), "finite"),
        (np.full((3, 3), 1e200), "off the identity"),
        (np.eye(2), "3x3"),
    ],
)
def test_what_is_no_rotation_is_refused(matrix: np.ndarray, says: str) -> None:
    with pytest.raises(CameraError, match=says):
        camera(R=matrix)


@pytest.mark.parametrize("q", [[0.0, 0.0, 0.0, 0.0], [2.0, 0.0, 0.0, 0.0], [np.nan, 0.0, 0.0, 1.0]])
def test_a_quaternion_of_another_length_is_refused(q: list[float]) -> None:
    with pytest.raises(CameraError, match="length 1"):
        rotation_from_wxyz(np.array(q))


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"distortion": [1.0, 2.0]}, "2 coefficients"),
        ({"distortion": [1.0] * 6}, "6 coefficients"),
        ({"distortion": [np.nan] * 5}, "0 of them numbers of"),
        ({"distortion": [1e308, 0, 0, 0, 0]}, r"4 of them numbers of 1e\+09"),
        ({"distortion": [0.1] * 5, "fisheye": True}, "fisheye"),
        ({"size": (0, 480)}, "size"),
        ({"size": (640.5, 480)}, "size"),
        ({"t": [1.0, np.inf, 0.0]}, "three finite"),
        ({"up": "z"}, "up"),
        ({"deviation": 1.5}, "fraction"),
        ({"deviation": math.nan}, "fraction"),
    ],
)
def test_impossible_parameters_are_refused(more: dict[str, object], says: str) -> None:
    with pytest.raises(CameraError, match=says) as refused:
        camera(**more)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("entry", [(0, 0), (1, 1)])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_intrinsics_of_no_camera_are_refused(entry: tuple[int, int], value: float) -> None:
    wrong = K.copy()
    wrong[entry] = value
    with pytest.raises(CameraError, match="left"):
        CalibratedCamera(name="left", K=wrong)


def test_arrays_cannot_be_changed() -> None:
    one = camera(distortion=[0.1] * 5, R=np.eye(3), t=[1.0, 2.0, 3.0])
    for array in (one.K, one.distortion, one.R, one.t):
        assert array is not None
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


def test_the_position_is_where_the_camera_frame_begins() -> None:
    R = rotation_from_vector(np.array([0.1, 0.7, -0.4]))
    one = camera(R=R, t=[1.0, 2.0, 3.0])
    assert one.position is not None
    np.testing.assert_allclose(R @ one.position + [1.0, 2.0, 3.0], 0, atol=1e-14)
    assert camera(R=R).position is None


@pytest.mark.parametrize(
    ("distortion", "fisheye", "needs"),
    [
        ([], False, False),
        ([0.1] * 4, False, False),
        ([0.1] * 5, False, False),
        ([0.1] * 5 + [0.0] * 3, False, False),
        ([0.1] * 8, False, True),
        ([0.0] * 12 + [0.1, 0.0], False, True),
        ([], True, True),
        ([0.0] * 4, True, True),
    ],
)
def test_undistortion_is_needed_beyond_browns_five(
    distortion: list[float], fisheye: bool, needs: bool
) -> None:
    assert needs_undistortion(camera(distortion=distortion, fisheye=fisheye)) is needs


def test_the_pinhole_projects_as_opencv_does(rng: np.random.Generator) -> None:
    distortion = [-0.2, 0.05, 0.001, -0.002]
    points = rng.uniform([-1, -1, 3], [1, 1, 6], (50, 3))
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, np.array(distortion))[0][:, 0]
    np.testing.assert_allclose(pinhole_of(camera(distortion=distortion)).project(points), expected, atol=1e-9)
    assert pinhole_of(camera(distortion=[0.1] * 8)).distortion is None
    assert pinhole_of(camera(distortion=[0.0] * 5)).distortion is None


@pytest.mark.parametrize(
    ("axis", "extent"), [("diagonal", 800.0), ("horizontal", 640.0), ("vertical", 480.0)]
)
def test_an_angle_of_view_spans_its_extent(axis: str, extent: float) -> None:
    one = camera_from_fov((640, 480), 70.0, axis)  # type: ignore[arg-type]
    assert 2 * math.degrees(math.atan(extent / 2 / one.K[0, 0])) == pytest.approx(70.0)
    assert one.K[0, 2] == 319.5 and one.K[1, 2] == 239.5
    assert one.guessed and "guess" in one.how
    assert one.name == "camera"


def test_a_focal_length_on_film_gives_the_films_angles() -> None:
    one = camera_from_focal35((3600, 2400), 50.0)
    # 36 x 24 mm is 3600 x 2400 pixels: a hundredth of a millimetre each.
    assert one.K[0, 0] == pytest.approx(5000.0)
    # By the diagonal: at 4:3 it is neither the width's nor the height's equivalent.
    assert camera_from_focal35((4000, 3000), 50.0).K[0, 0] == pytest.approx(5000 * 50 / math.hypot(36, 24))


@pytest.mark.parametrize("degrees", [0.0, 180.0, -5.0, math.nan, math.inf])
def test_no_such_angle(degrees: float) -> None:
    with pytest.raises(CameraError, match="degrees"):
        camera_from_fov((640, 480), degrees)


def test_bad_guesses_are_refused() -> None:
    with pytest.raises(CameraError, match="across"):
        camera_from_fov((640, 480), 60.0, "width")  # type: ignore[arg-type]
    for mm in (0.0, math.nan, -3.0):
        with pytest.raises(CameraError, match="mm"):
            camera_from_focal35((640, 480), mm)


@pytest.mark.parametrize(
    "size", [(640, 0), (0, 480), (-1, 480), (10**6 + 1, 480), (640,), (640, 480, 3), (640.0, 480), ()]
)
def test_a_size_of_no_picture_is_refused(size: Any) -> None:
    for guess in (lambda: camera_from_fov(size, 60.0), lambda: camera_from_focal35(size, 50.0)):
        with pytest.raises(CameraError, match=r"whole numbers above 0; got \("):
            guess()


@pytest.mark.parametrize("size", [(1, 10**6), (10**6, 1)])
def test_a_size_of_the_smallest_and_the_largest_picture_is_taken(size: tuple[int, int]) -> None:
    for one in (camera_from_fov(size, 179.0), camera_from_focal35(size, 1e4)):
        assert one.size == size and one.deviation == 0.05 and "within 5 %" in one.how
    with pytest.raises(CameraError, match="expected 0 to 10,000 mm"):
        camera_from_focal35(size, math.nextafter(1e4, math.inf))


def test_one_camera_is_chosen_and_several_are_named() -> None:
    one = camera()
    assert choose_camera({"left": one}) is one
    both = {"left": one, "right": one}
    assert choose_camera(both, "right") is one
    with pytest.raises(InputError, match=r'2 cameras.*"left", "right"'):
        choose_camera(both)
    with pytest.raises(InputError, match=r'"middle".*"left", "right"'):
        choose_camera(both, "middle")
    many = {f"cam{k}": one for k in range(500)}
    with pytest.raises(InputError, match="and 492 more"):
        choose_camera(many)
    with pytest.raises(InputError, match="cam0") as refused:
        choose_camera(many, "cam_0")
    assert len(str(refused.value)) < 500


def test_whole_numbers_become_floating_ones() -> None:
    whole = np.array([[1000, 0, 640], [0, 1000, 360], [0, 0, 1]])
    assert CalibratedCamera(name="left", K=whole).K.dtype == np.float64
