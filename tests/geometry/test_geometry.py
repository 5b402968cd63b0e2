"""Laws of vectors, quaternions, rotations and rigid fits, with SciPy's rotations as the oracle."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posekit.compiled.rigid_kernels import frame_of, square
from posekit.compiled.rigid_kernels import unit as scalar_unit
from posekit.geometry import (
    best_rotation,
    centred_covariance,
    coordinate_rotation,
    cross,
    cross_matrix,
    dot,
    fit_rotation,
    frame_along,
    other_branch,
    other_hinge,
    perpendicular,
    quaternion_conjugate,
    quaternion_exp,
    quaternion_from_rotation,
    quaternion_log,
    quaternion_product,
    quaternion_rotate,
    relative_rotation,
    rotate_back,
    rotation_about,
    rotation_between,
    rotation_from_quaternion,
    rotation_from_vector,
    runs,
    shorter_quaternion,
    turned_near,
    unit,
    vector_from_rotation,
)
from posekit.geometry.batch_last import matrix_product, matrix_vector, step_rotation

EPSILON = 1e-14
SMALL_ANGLES = (0.0, 1e-300, 1e-160, 1e-17, 1e-9, 1e-5)
LARGE_ANGLES = (0.5, np.pi / 2, 3.0, np.pi - 1e-9, np.pi)


@pytest.fixture
def turns(rng: np.random.Generator):
    """Rotation vectors of all lengths to pi, those at which a formula could divide by zero among them."""
    axes = unit(rng.normal(size=(len(SMALL_ANGLES + LARGE_ANGLES), 20, 3)))
    axes[:, :3] = np.eye(3)
    return (axes * np.array(SMALL_ANGLES + LARGE_ANGLES)[:, None, None]).reshape(-1, 3)


def near(found, expected, within=EPSILON):
    np.testing.assert_allclose(found, expected, rtol=0, atol=within)


@pytest.mark.parametrize("count", [1, 2, 7, 1000])
def test_products_are_the_same_bits_with_the_batch_first_or_last_and_alone(rng, count):
    a, b = rng.normal(size=(2, count, 3))
    last = [np.ascontiguousarray(each.T) for each in (a, b)]
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))
    np.testing.assert_array_equal(cross(*last, axis=-2).T, cross(a, b))
    near(dot(*last, axis=-2), dot(a, b))
    near(unit(last[0], axis=-2).T, unit(a))
    near(perpendicular(*last, axis=-2).T, perpendicular(a, b), 1e-13)
    A, B = rng.normal(size=(2, 3, 3, count))
    for k in range(min(count, 5)):
        one = slice(k, k + 1)
        np.testing.assert_array_equal(
            dot(last[0][:, one], last[1][:, one], axis=-2), dot(*last, axis=-2)[one]
        )
        np.testing.assert_array_equal(
            matrix_vector(A[..., one], last[0][:, one]), matrix_vector(A, last[0])[:, one]
        )
        np.testing.assert_array_equal(
            matrix_product(A[..., one], B[..., one]), matrix_product(A, B)[..., one]
        )
    near(matrix_vector(A, last[0]), np.einsum("ijn,jn->in", A, last[0]))
    near(matrix_product(A, B), np.moveaxis(np.moveaxis(A, -1, 0) @ np.moveaxis(B, -1, 0), 0, -1))


def test_cross_products_broadcast(rng):
    a, b = rng.normal(size=(4, 1, 3)), rng.normal(size=(5, 3))
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))
    near(cross_matrix(a) @ b[0], np.cross(a, b[0]))


def test_what_has_no_direction_or_is_not_known_is_nan():
    vectors = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 4.0], [np.nan, 1.0, 0.0]])
    expected = np.array([[np.nan] * 3, [0.6, 0.0, 0.8], [np.nan] * 3])
    np.testing.assert_array_equal(unit(vectors), expected)
    np.testing.assert_array_equal(unit(vectors.T, axis=-2).T, expected)


def test_what_is_perpendicular_and_along_add_up(rng):
    v, a = rng.normal(size=(50, 3)), unit(rng.normal(size=(50, 3)))
    across = perpendicular(v, a)
    near(dot(across, a), 0.0)
    near(across + dot(v, a)[:, None] * a, v)


def test_rotations_from_vectors_are_scipys(turns):
    expected = Rotation.from_rotvec(turns).as_matrix()
    near(rotation_from_vector(turns), expected)
    near(rotation_from_quaternion(quaternion_exp(turns)), expected)
    near(rotation_from_quaternion(quaternion_exp(turns).T, axis=0), np.moveaxis(expected, 0, -1))
    angle = np.linalg.norm(turns, axis=-1)
    moved = angle > 1e-100
    near(rotation_about(turns[moved] / angle[moved, None], angle[moved]), expected[moved])


def test_vectors_come_back_from_rotations(turns):
    for back in (vector_from_rotation(rotation_from_vector(turns)), quaternion_log(quaternion_exp(turns))):
        same = np.linalg.norm(back - turns, axis=-1)
        opposite = np.linalg.norm(back + turns, axis=-1)  # half a turn is the same about either direction
        half = np.linalg.norm(turns, axis=-1) > np.pi - 1e-7
        near(np.where(half, np.minimum(same, opposite), same), 0.0, 4e-15)


def test_quaternions_of_rotations_are_scipys(turns):
    R = rotation_from_vector(turns)
    q = quaternion_from_rotation(R)
    expected = Rotation.from_matrix(R).as_quat()
    near(np.abs(dot(q, expected)), 1.0)
    assert (q[:, 3] >= 0).all()
    largest = quaternion_from_rotation(R, shorter=False)
    assert (np.take_along_axis(largest, np.abs(largest).argmax(axis=-1)[:, None], axis=-1) > 0).all()
    np.testing.assert_array_equal(shorter_quaternion(largest), q)


def test_quaternions_multiply_as_rotations_do(rng):
    a, b = unit(rng.normal(size=(2, 40, 4)))
    v = rng.normal(size=(40, 3))
    A, B = rotation_from_quaternion(a), rotation_from_quaternion(b)
    near(rotation_from_quaternion(quaternion_product(a, b)), A @ B)
    near(quaternion_rotate(a, v), np.einsum("nij,nj->ni", A, v))
    near(rotation_from_quaternion(quaternion_conjugate(a)), np.swapaxes(A, -1, -2))
    near(rotate_back(A, v), quaternion_rotate(quaternion_conjugate(a), v))
    near(relative_rotation(A, B), np.swapaxes(A, -1, -2) @ B)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_rotations_about_coordinate_axes_are_those_about_their_unit_vectors(axis):
    angle = np.linspace(-7.0, 7.0, 29)
    near(coordinate_rotation(axis, angle), rotation_about(np.tile(np.eye(3)[axis], (29, 1)), angle))


def test_frames_and_shortest_rotations_of_directions(rng):
    start = np.concatenate([np.eye(3), -np.eye(3), unit(rng.normal(size=(30, 3)))])
    frame = frame_along(start)
    near(frame[..., 0], start)
    near(np.swapaxes(frame, -1, -2) @ frame, np.broadcast_to(np.eye(3), frame.shape))
    near(np.linalg.det(frame), 1.0)
    for end in (start, -start, np.roll(start, 1, axis=0)):
        R = rotation_between(start, end)
        near(np.einsum("nij,nj->ni", R, start), end, 1e-15 * 10)
        angle = np.linalg.norm(vector_from_rotation(R), axis=-1)
        near(angle, np.arctan2(np.linalg.norm(np.cross(start, end), axis=-1), dot(start, end)), 1e-7)


def test_the_step_of_a_search_is_the_rotation_to_third_order(rng):
    turn = rng.normal(size=(3, 30))
    turn *= 1e-3 / np.linalg.norm(turn, axis=0)
    near(np.moveaxis(step_rotation(turn), -1, 0), rotation_from_vector(turn.T), 1e-9 / 12 * 1.01)
    R = np.moveaxis(step_rotation(1e3 * turn), -1, 0)
    near(R @ np.swapaxes(R, -1, -2), np.broadcast_to(np.eye(3), R.shape))


def test_the_best_rotation_is_scipys_and_never_mirrors(rng):
    R = Rotation.random(20, random_state=rng.integers(2**31)).as_matrix()
    offsets = rng.normal(size=(5, 3))
    turned = np.einsum("nij,pj->npi", R, offsets)
    near(fit_rotation(offsets, turned), R)
    noisy = turned + 0.1 * rng.normal(size=turned.shape)
    for found, target in zip(fit_rotation(offsets, noisy), noisy, strict=True):
        near(found, Rotation.align_vectors(target, offsets)[0].as_matrix(), 1e-9)
    mirrored, values = best_rotation(np.diag([3.0, 2.0, -1.0])[None])
    near(mirrored[0], np.eye(3))
    near(values[0], [3.0, 2.0, -1.0])
    noisy[3, 1, 0] = np.nan
    found = fit_rotation(offsets, noisy)
    assert np.isnan(found[3]).all()
    assert np.isfinite(np.delete(found, 3, axis=0)).all()


def test_covariances_leave_out_what_has_no_weight(rng):
    x, y = rng.normal(size=(2, 6, 5, 3))
    weights = rng.uniform(0.5, 2.0, size=(6, 5))
    weights[:, 4] = 0.0
    all_five, four = centred_covariance(x, y, weights), centred_covariance(x[:, :4], y[:, :4], weights[:, :4])
    near(all_five.covariance, four.covariance)
    near(all_five.mean_y, four.mean_y)
    near(np.einsum("nk,nki->ni", weights, all_five.x), 0.0)
    near(centred_covariance(x, y, np.zeros((6, 5))).covariance, 0.0)


def test_the_scalar_forms_of_compiled_loops_are_these(rng):
    for v, other in rng.normal(size=(200, 2, 3)):
        a = unit(other)
        near(scalar_unit(*v), unit(v), 1e-15)
        left = unit(perpendicular(v, a))
        near(square(*v, *a), left)
        frame = np.stack([cross(a, left), left, -a], axis=-1)
        near(np.reshape(frame_of(*left, *a), (3, 3)), frame)


@pytest.mark.parametrize("half_turn", [np.pi, 180.0])
def test_other_writings_of_a_limb_place_it_alike(rng, half_turn):
    angles = rng.uniform(-half_turn, half_turn, size=(30, 4))

    def placed(each):
        a, b, c, e = np.moveaxis(each * np.pi / half_turn, -1, 0)
        ball = coordinate_rotation(1, a) @ coordinate_rotation(0, b) @ coordinate_rotation(2, c)
        return ball[..., 2], (ball @ coordinate_rotation(1, e))[..., 2]

    for other in (
        other_branch(angles, half_turn=half_turn),
        other_hinge(angles, half_turn=half_turn),
        other_hinge(other_branch(angles, half_turn=half_turn), half_turn=half_turn),
    ):
        for found, expected in zip(placed(other), placed(angles), strict=True):
            near(found, expected)
    near(other_branch(angles[:, :2], half_turn=half_turn), other_branch(angles, half_turn=half_turn)[:, :2])
    twice = other_branch(other_branch(angles, half_turn=half_turn), half_turn=half_turn)
    near(turned_near(twice - angles, 0.0, half_turn=half_turn), 0.0, 1e-12)


def test_angles_are_turned_to_within_half_a_turn_of_a_middle(rng):
    angles, middle = rng.uniform(-20, 20, size=(2, 100))
    found = turned_near(angles, middle)
    assert (np.abs(found - middle) <= np.pi).all()
    near((found - angles) / (2 * np.pi), np.round((found - angles) / (2 * np.pi)), 1e-12)
    assert turned_near(np.array(540.0), 0.0, half_turn=180.0) == -180.0


@pytest.mark.parametrize("seed", range(5))
def test_runs_are_all_that_is_true_and_do_not_touch(seed: int) -> None:
    """Runs, laid down again, give the array they are of; between two of them something is false."""
    which = np.random.default_rng(seed).random(seed * 7) < 0.5
    found, again = runs(which), np.zeros(len(which), dtype=np.bool_)
    for start, stop in found:
        assert start < stop
        again[start:stop] = True
    assert (again == which).all()
    assert all(stop < start for (_, stop), (start, _) in pairwise(found))
