"""Laws of vectors, quaternions, rotations, rigid fits and distances, against SciPy and brute force."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import posekit.geometry as g
from posekit.errors import InputError, refusal, shown
from posekit.geometry.least_squares import into_bounds

N = 200


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def rotations(rng, count=N):
    return Rotation.random(count, random_state=rng)


def test_quaternions_are_scipys(rng):
    a = rotations(rng)
    v = rng.normal(size=(N, 3))
    np.testing.assert_allclose(g.rotation_from_quaternion(a.as_quat()), a.as_matrix(), atol=1e-14)
    np.testing.assert_allclose(g.quaternion_rotate(a.as_quat(), v), a.apply(v), atol=1e-14)
    np.testing.assert_allclose(g.quaternion_log(a.as_quat()), a.as_rotvec(), atol=1e-12)
    np.testing.assert_allclose(g.shorter_quaternion(a.as_quat()), a.as_quat(canonical=True), atol=1e-14)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-7, 0.5, np.pi - 1e-9, np.pi])
def test_rotation_vectors_go_there_and_back(rng, angle):
    axis = g.unit(rng.normal(size=(N, 3)))
    R = g.rotation_from_vector(angle * axis)
    np.testing.assert_allclose(R, g.rotation_about(axis, np.full(N, angle)), atol=1e-14)
    np.testing.assert_allclose(g.rotation_from_vector(g.vector_from_rotation(R)), R, atol=1e-8)
    np.testing.assert_allclose(np.linalg.norm(g.vector_from_rotation(R), axis=1), angle, atol=1e-8)


def test_frames_and_shortest_rotations(rng):
    a, b = g.unit(rng.normal(size=(2, N, 3)))
    b[:5], b[5:10] = -a[:5], a[5:10]
    np.testing.assert_allclose(np.einsum("nij,nj->ni", g.rotation_between(a, b), a), b, atol=1e-14)
    frame = g.frame_along(a)
    np.testing.assert_allclose(frame[..., 0], a)
    np.testing.assert_allclose(np.linalg.det(frame), 1.0)
    for axis, name in enumerate("xyz"):
        angle = rng.normal(size=N)
        np.testing.assert_allclose(
            g.coordinate_rotation(axis, angle),
            Rotation.from_euler(name, angle[:, None]).as_matrix(),
            atol=1e-15,
        )


def test_a_zero_vector_has_no_direction_and_nan_propagates():
    assert np.isnan(g.unit(np.zeros(3))).all()
    assert np.isnan(g.best_rotation(np.full((3, 3), np.nan))[0]).all()
    assert np.isnan(g.cross(np.array([np.nan, 0, 0]), np.ones(3)))[1:].all()


@pytest.mark.parametrize("scale", [True, False])
def test_alignment_recovers_a_similarity_and_beats_its_neighbours(rng, scale):
    x = rng.normal(size=(N, 9, 3))
    R, c, t = (
        rotations(rng).as_matrix(),
        rng.uniform(0.5, 2, N) if scale else np.ones(N),
        rng.normal(size=(N, 3)),
    )
    y = c[:, None, None] * np.einsum("nij,npj->npi", R, x) + t[:, None]
    y[:, 0] = np.nan  # an unknown point is left out
    found = g.align(x, y, scale=scale)
    np.testing.assert_allclose(found.rotation, R, atol=1e-12)
    np.testing.assert_allclose(found.scale, c, atol=1e-12)
    np.testing.assert_allclose(found.translation, t, atol=1e-11)
    noisy = y + rng.normal(0, 0.1, y.shape)
    best = g.align(x, noisy, scale=scale)
    turned = best._replace(rotation=best.rotation @ g.rotation_from_vector(rng.normal(0, 0.01, (N, 3))))
    assert (
        g.rms_distance(best.apply(x), noisy, aligned=False)
        <= g.rms_distance(turned.apply(x), noisy, aligned=False)
    ).all()


def test_alignment_is_never_a_reflection_and_needs_three_points(rng):
    x = rng.normal(size=(9, 3))
    mirrored = x * [1, 1, -1]
    assert np.linalg.det(g.align(x, mirrored).rotation) == pytest.approx(1)
    assert g.pa_mpjpe(x, mirrored) > 0.1
    x[2:] = np.nan
    assert np.isnan(g.pa_mpjpe(x, mirrored))


def test_distances_are_means_over_known_points():
    x = np.zeros((4, 3))
    y = np.array([[3, 4, 0], [0, 0, 0], [0, 0, 1], [np.nan] * 3])
    assert g.mpjpe(x, y) == pytest.approx(2.0)
    assert g.rms_distance(x, y, aligned=False) == pytest.approx(np.sqrt(26 / 3))


def test_runs_and_turns():
    assert g.runs(np.array([True, True, False, True])) == [(0, 2), (3, 4)]
    assert g.runs(np.zeros(3, dtype=bool)) == []
    angles = np.linspace(-20, 20, 401)
    near = g.turned_near(angles, 1.0)
    assert (abs(near - 1.0) <= np.pi + 1e-12).all()
    np.testing.assert_allclose(np.exp(1j * near), np.exp(1j * angles), atol=1e-12)


@pytest.mark.parametrize("unit", g.PER_METRE)
def test_units_go_there_and_back(unit):
    values = np.array([0.1, 1.75, 3.0])
    np.testing.assert_array_equal(g.to_metres(g.from_metres(values, unit), unit), values)
    assert np.isnan(g.to_metres([None], unit)).all()


def test_a_refusal_is_one_line_that_names_everything():
    error = refusal("a\nb.json", "f", shown("x" * 1000), "a number", "give it")
    assert isinstance(error, InputError)
    assert "\n" not in str(error)
    assert str(error).startswith("a\\nb.json: f: got")
    assert str(error).endswith("expected a number; give it")
    assert len(str(error)) < 300


@pytest.mark.parametrize("strength", [0.5, 30.0])
def test_smoothing_is_the_least_squares_of_whittaker(rng, strength):
    """Values and their third differences, weighted; frames that are not loose are constants of the problem."""
    values = rng.normal(size=(12, 3, 2))
    loose = rng.uniform(size=(12, 3)) < 0.6
    loose[:, 0], loose[:, 1] = True, False
    found = g.smoothed(values, loose, strength)
    np.testing.assert_array_equal(found[~loose], values[~loose])
    third = np.diff(np.eye(12), n=3, axis=0)
    for k in range(3):
        free = loose[:, k]
        A = np.concatenate([np.eye(12)[free], np.sqrt(strength) * third])
        b = np.concatenate([values[free, k], np.zeros((len(third), 2))])
        expected = np.linalg.lstsq(A[:, free], b - A[:, ~free] @ values[~free, k], rcond=None)[0]
        np.testing.assert_allclose(found[free, k], expected, atol=1e-6)
    parabola = np.arange(12.0)[:, None, None] ** 2 * np.ones((1, 3, 2))
    np.testing.assert_allclose(g.smoothed(parabola, loose, strength), parabola, atol=1e-6)
    np.testing.assert_array_equal(g.smoothed(values[:3], loose[:3], strength), values[:3])


def test_the_shortest_steps_into_bounds_are_projections(rng):
    """States on the wrong side of planes go to their edge, perpendicularly; free entries alone move."""
    normals = np.linalg.qr(rng.normal(size=(3, 3)))[0][:2]
    state = 0.05 * rng.normal(size=(40, 3))

    def margins(one):
        return one @ normals.T + 0.01

    found = into_bounds(state, np.add, 3, range(3), margins)
    wanted = state - np.minimum(margins(state), 0.0) @ normals
    np.testing.assert_allclose(found, wanted, atol=1e-4)
    inside = (margins(state) >= 0).all(axis=1)
    assert inside.any() and not inside.all()
    np.testing.assert_array_equal(found[inside], state[inside])
    level = into_bounds(state, np.add, 3, [0, 2], margins)
    np.testing.assert_array_equal(level[:, 1], state[:, 1])
    assert (margins(level) > -1e-4).all()
