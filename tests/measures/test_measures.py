"""Measures: their laws, SciPy and brute force as oracles, and what is left out or undefined."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from posekit.errors import InputError
from posekit.measures import (
    POSTURE_ANGLES,
    adjacent_segments,
    align,
    angle_disparity,
    best_of,
    joint_angles,
    mpjpe,
    pa_mpjpe,
    rms_distance,
)
from posekit.measures.distances import Aligned
from posekit.skeleton import HIPS, JOINT, JOINTS, TORSO, TREE_SEGMENTS

SEEDS = st.integers(0, 10**6)
ALIGNED: tuple[Aligned, ...] = ("similarity", "rigid", "none")


def pair(seed: int, points: int = 14, frames: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Draw postures and others near them, turned, moved and scaled."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(frames, points, 3))
    y = moved(x, rng) + rng.normal(size=x.shape) * 0.2
    return x, y


def moved(x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Apply a random similarity to postures, one to each."""
    R = Rotation.random(len(x), random_state=rng).as_matrix()
    c = rng.uniform(0.2, 5, (len(x), 1, 1))
    return np.asarray(c * np.einsum("nij,npj->npi", R, x) + rng.normal(size=(len(x), 1, 3)) * 3)


# --- alignment ------------------------------------------------------------------------------------------


@given(SEEDS, st.integers(3, 20))
def test_a_similarity_is_found_again(seed, points):
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(4, points, 3))
    y = moved(x, rng)
    found = align(x, y)
    np.testing.assert_allclose(found.apply(x), y, rtol=0, atol=1e-9)
    assert found.unique.all()
    np.testing.assert_array_equal(found.used, points)
    rigid = align(x, y / found.scale[:, None, None], scale=False)
    np.testing.assert_allclose(rigid.rotation, found.rotation, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(rigid.scale, 1.0)


@given(SEEDS, st.integers(3, 14))
def test_the_rotation_is_proper_and_scipys(seed, points):
    x, y = pair(seed, points)
    found = align(x, y)
    np.testing.assert_allclose(
        found.rotation @ np.swapaxes(found.rotation, 1, 2), np.tile(np.eye(3), (3, 1, 1)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(found.rotation), 1, atol=1e-12)
    for k in range(len(x)):
        a, b = x[k] - x[k].mean(axis=0), y[k] - y[k].mean(axis=0)
        best, _ = Rotation.align_vectors(b, a)
        np.testing.assert_allclose(best.as_matrix() @ a.T, found.rotation[k] @ a.T, rtol=0, atol=1e-6)


@pytest.mark.parametrize("scale", [True, False])
@pytest.mark.parametrize("mirrored", [False, True])
def test_no_other_similarity_is_better(scale, mirrored):
    """A general optimiser over all seven numbers, from the solution and from elsewhere, finds nothing lower."""
    x, y = (each[0] for each in pair(3, 6))
    y = y * ([-1, 1, 1] if mirrored else 1)
    found = align(x, y, scale=scale)

    def cost(p: np.ndarray) -> float:
        c = np.exp(p[6]) if scale else 1.0
        moved_x = c * Rotation.from_rotvec(p[:3]).apply(x) + p[3:6]
        return float(((y - moved_x) ** 2).sum())

    ours = float(((y - found.apply(x)) ** 2).sum())
    rng = np.random.default_rng(0)
    lowest = min(
        minimize(cost, np.concatenate([rng.normal(size=3) * 2, y.mean(axis=0), [0.0]])).fun for _ in range(12)
    )
    assert ours == pytest.approx(lowest, rel=1e-6)


def test_a_mirror_image_is_not_reflected_back():
    x = np.random.default_rng(0).normal(size=(14, 3))
    mirror = x * [1, 1, -1]
    found = align(x, mirror)
    assert np.linalg.det(found.rotation) == pytest.approx(1)
    assert rms_distance(x, mirror).value > 0.1


def test_batches_are_their_postures_one_at_a_time():
    x, y = pair(5, 14, 6)
    x[2, 4] = np.nan
    for measure in (rms_distance, mpjpe, pa_mpjpe):
        together = measure(x, y)
        for k in range(len(x)):
            alone = measure(x[k], y[k])
            assert alone.value == pytest.approx(together.value[k], rel=1e-12)
            assert alone.left_out == together.left_out[k]
    many = rms_distance(x.reshape(2, 3, 14, 3), y[0])
    assert many.value.shape == (2, 3)
    assert many.value[1, 0] == pytest.approx(float(rms_distance(x[3], y[0]).value), rel=1e-12)


# --- distances ------------------------------------------------------------------------------------------


@given(SEEDS)
def test_similarity_rms_does_not_see_a_similarity_of_what_is_measured(seed):
    x, y = pair(seed)
    other = moved(x, np.random.default_rng(seed + 1))
    np.testing.assert_allclose(rms_distance(other, y).value, rms_distance(x, y).value, rtol=1e-8)
    np.testing.assert_allclose(pa_mpjpe(other, y).value, pa_mpjpe(x, y).value, rtol=1e-8)
    # The target's own scale is the measure's unit.
    np.testing.assert_allclose(rms_distance(x, 3 * y).value, 3 * rms_distance(x, y).value, rtol=1e-9)


@given(SEEDS)
def test_alignment_only_helps_and_means_are_below_rms(seed):
    x, y = pair(seed)
    similar, rigid, plain = (rms_distance(x, y, aligned=how).value for how in ALIGNED)
    assert (similar <= rigid + 1e-12).all()
    assert (rigid <= plain + 1e-12).all()
    assert (pa_mpjpe(x, y).value <= similar + 1e-12).all()
    assert (mpjpe(x, y).value <= plain + 1e-12).all()


@given(SEEDS)
def test_symmetry_where_it_holds(seed):
    x, y = pair(seed)
    for how in ALIGNED[1:]:
        np.testing.assert_allclose(
            rms_distance(x, y, aligned=how).value, rms_distance(y, x, aligned=how).value, rtol=1e-9
        )
    np.testing.assert_array_equal(mpjpe(x, y).value, mpjpe(y, x).value)
    np.testing.assert_array_equal(angle_disparity(x, y).degrees, angle_disparity(y, x).degrees)
    # After a similarity each is measured in its target's size: relative to it the two agree.
    size = [
        np.sqrt(((each - each.mean(axis=1, keepdims=True)) ** 2).sum(axis=2).mean(axis=1)) for each in (x, y)
    ]
    np.testing.assert_allclose(
        rms_distance(x, y).value / size[1], rms_distance(y, x).value / size[0], rtol=1e-8
    )


def test_equal_postures_are_no_distance_apart():
    x, _ = pair(0)
    for how in ALIGNED:
        np.testing.assert_allclose(rms_distance(x, x, aligned=how).value, 0, atol=1e-14)
    for measure in (mpjpe, pa_mpjpe):
        np.testing.assert_allclose(measure(x, x).value, 0, atol=1e-14)
    assert (angle_disparity(x, x).degrees == 0).all()


def test_distances_of_a_square():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    lifted = square.copy()
    lifted[0, 2] = 2.0
    assert mpjpe(lifted, square).value == pytest.approx(0.5)
    assert rms_distance(lifted, square, aligned="none").value == pytest.approx(1.0)
    assert mpjpe(square + 5, square, root=2).value == 0
    assert mpjpe(lifted, square, root=0).value == pytest.approx(1.5)


@given(SEEDS, st.integers(0, 9))
def test_unknown_points_are_left_out_and_counted(seed, missing):
    x, y = pair(seed, 14, 1)
    rng = np.random.default_rng(seed)
    gone = rng.permutation(14)[:missing]
    holed_x, holed_y = x.copy(), y.copy()
    holed_x[:, gone[::2]] = np.nan
    holed_y[:, gone[1::2], rng.integers(0, 3)] = np.nan
    kept = np.setdiff1d(np.arange(14), gone)
    for measure in (rms_distance, mpjpe, pa_mpjpe):
        some = measure(holed_x, holed_y)
        np.testing.assert_allclose(some.value, measure(x[:, kept], y[:, kept]).value, rtol=1e-9)
        assert some.left_out.tolist() == [missing]
    found = align(holed_x, holed_y)
    assert found.used.tolist() == [14 - missing]
    assert found.left_out.tolist() == [missing]


# --- degenerate sets ------------------------------------------------------------------------------------


@pytest.mark.parametrize("points", [0, 1, 2])
def test_fewer_than_three_points_measure_nothing_after_alignment(points):
    x, y = np.full((14, 3), np.nan), np.random.default_rng(0).normal(size=(14, 3))
    x[:points] = np.random.default_rng(1).normal(size=(points, 3))
    for how in ("similarity", "rigid"):
        assert np.isnan(rms_distance(x, y, aligned=how).value)
    assert np.isnan(pa_mpjpe(x, y).value)
    assert np.isnan(align(x, y).apply(y)).all()
    assert not align(x, y).unique
    assert np.isnan(mpjpe(x, y).value) == (points == 0)


@pytest.mark.parametrize("which", [0, 1])
def test_points_in_one_place_align_with_nothing(which):
    sets = [np.random.default_rng(0).normal(size=(5, 3)), np.tile([0.1, 0.2, 0.3], (5, 1))]
    x, y = sets[which], sets[1 - which]
    assert np.isnan(rms_distance(x, y).value)
    assert np.isnan(align(x, y).scale)


def test_collinear_points_have_a_residual_but_no_one_rotation():
    rng = np.random.default_rng(0)
    line = np.outer(rng.normal(size=6), [0.6, 0.8, 0.0])
    other = moved(line[None], rng)[0]
    found = align(line, other)
    assert not found.unique
    np.testing.assert_allclose(found.apply(line), other, rtol=0, atol=1e-12)
    assert np.linalg.det(found.rotation) == pytest.approx(1)
    bent = rng.normal(size=(6, 3))
    assert not align(line, bent).unique
    turned = line @ Rotation.from_rotvec([0.0, 0.0, 1.0]).as_matrix().T
    assert rms_distance(line, bent).value == pytest.approx(float(rms_distance(turned, bent).value))


def test_planar_points_have_one_rotation():
    x, y = pair(0, 6, 1)
    assert align(x * [1, 1, 0], y).unique.all()
    # A regular tetrahedron's mirror image lies as near in several ways.
    corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    assert not align(corners, -corners).unique


# --- angles ---------------------------------------------------------------------------------------------


def test_the_default_angles_are_those_between_segments_that_move():
    every = adjacent_segments(TREE_SEGMENTS)
    rigid = [{JOINT[name] for name in part} for part in (TORSO, HIPS)]
    moving = {(min(a, c), b, max(a, c)) for a, b, c in every if not any({a, b, c} <= part for part in rigid)}
    assert {(min(a, c), b, max(a, c)) for a, b, c in POSTURE_ANGLES} == moving
    assert len(POSTURE_ANGLES) == len(moving) == 10
    assert [JOINTS[b] for _, b, _ in POSTURE_ANGLES[4:6]] == ["right_elbow", "left_elbow"]


def test_adjacent_segments_of_a_chain_and_a_star():
    assert adjacent_segments([(0, 1), (1, 2), (2, 3)]) == ((0, 1, 2), (1, 2, 3))
    assert adjacent_segments([(0, 1), (0, 2), (0, 3)]) == ((1, 0, 2), (1, 0, 3), (2, 0, 3))
    assert adjacent_segments([(0, 1), (1, 0)]) == ()
    assert adjacent_segments([]) == ()


def test_angles_of_a_bent_arm():
    arm = np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0]])
    assert joint_angles(arm, [(0, 1, 2)]) == pytest.approx(90)
    straight = np.array([[0.0, 0, 0], [2, 0, 0], [5, 0, 0]])
    assert joint_angles(straight, [(0, 1, 2)]) == pytest.approx(180)
    assert joint_angles(straight, [(1, 0, 2)]) == pytest.approx(0)
    assert angle_disparity(arm, straight, [(0, 1, 2)]).degrees == pytest.approx(90)


def test_small_bends_keep_their_digits():
    bend = 1e-7
    arm = np.array([[0.0, 0, 0], [1, 0, 0], [1 + np.cos(bend), np.sin(bend), 0]])
    assert 180 - joint_angles(arm, [(0, 1, 2)])[0] == pytest.approx(np.degrees(bend), rel=1e-6)


@given(SEEDS)
def test_angles_do_not_see_similarities_or_mirrors(seed):
    x, _ = pair(seed)
    rng = np.random.default_rng(seed)
    np.testing.assert_allclose(joint_angles(moved(x, rng)), joint_angles(x), rtol=0, atol=1e-7)
    np.testing.assert_allclose(joint_angles(x * [1, 1, -1]), joint_angles(x), rtol=0, atol=1e-9)
    assert (angle_disparity(x, x[::-1]).degrees <= 180).all()


def test_angles_of_unknown_points_and_of_no_segment_are_left_out():
    x, y = pair(0, 14, 2)
    x[0, JOINT["right_wrist"]] = np.nan
    y[1, JOINT["left_knee"]] = y[1, JOINT["left_hip"]]
    found = angle_disparity(x, y)
    assert found.left_out.tolist() == [1, 2]
    assert np.isnan(found.degrees[0]).nonzero()[0].tolist() == [POSTURE_ANGLES.index((1, 6, 8))]


# --- best of N ------------------------------------------------------------------------------------------


def test_the_best_carries_its_n():
    best = best_of([3.0, 1.0, np.nan, 1.0])
    assert (best.error, best.index, best.n, best.unmeasured) == (1.0, 1, 4, 1)
    assert str(best) == "1 (best of 4)"


@given(st.lists(st.floats(0, 1e6), min_size=1, max_size=30), st.floats(0, 1e6))
def test_more_answers_are_never_worse(errors, another):
    best = best_of(errors)
    assert best.error == min(errors)
    assert errors[best.index] == best.error
    assert best_of([*errors, another]).error <= best.error


@pytest.mark.parametrize(
    ("errors", "said"), [([], "best of 0"), ([np.nan, np.nan], "all are NaN"), (1.0, r"expected \(N,\)")]
)
def test_none_to_choose_from_is_refused(errors, said):
    with pytest.raises(InputError, match=said) as refused:
        best_of(errors)
    assert "\n" not in str(refused.value)


# --- bad input ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("x", "y", "said"),
    [
        (np.zeros(3), np.zeros((4, 3)), r"points has shape \(3,\)"),
        (np.zeros((4, 3)), np.zeros((4, 2)), r"target has shape \(4, 2\)"),
        (np.zeros((5, 3)), np.zeros((4, 3)), "5 points and target 4"),
        (np.full((4, 3), np.inf), np.zeros((4, 3)), "infinite"),
        (np.zeros((2, 4, 3)), np.zeros((3, 4, 3)), "do not broadcast"),
    ],
)
@pytest.mark.parametrize("measure", [align, rms_distance, mpjpe, pa_mpjpe, angle_disparity])
def test_points_that_do_not_go_together_are_refused(measure, x, y, said):
    with pytest.raises(InputError, match=said) as refused:
        measure(x, y)
    assert "\n" not in str(refused.value)


def test_impossible_choices_are_refused():
    x = np.zeros((4, 3))
    with pytest.raises(InputError, match="expected similarity, rigid or none"):
        rms_distance(x, x, aligned="affine")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="expected True"):
        align(x, x, scale="rigid")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="one of 4 points"):
        mpjpe(x, x, root=4)
    for triple in ((0, 1, 4), (0, 1, 0), (-1, 0, 1), (0, 1)):
        with pytest.raises(InputError, match="three different points"):
            joint_angles(x, [triple])  # type: ignore[list-item]
    with pytest.raises(InputError, match="does not join two points"):
        adjacent_segments([(1, 1)])
