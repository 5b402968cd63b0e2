"""Laws of answers: what regions, depths and representatives hold, whatever the bodies are."""

from __future__ import annotations

import numpy as np
import pytest

from posekit.answers import ANSWER_SEGMENTS, Answer, ListedBodies, answers_of
from posekit.answers.answer import DISTINCT_METRES, REPRESENTED_PROBABILITY
from posekit.answers.depth_order import LEVEL_METRES
from posekit.answers.regions import even_normal
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.skeleton import JOINT

DEVIATION = 0.01


def bodies(rng: np.random.Generator, count: int, places: int = 3) -> tuple[Array, Array, Array]:
    """Return bodies about a few postures, their probabilities and covariances."""
    centres = rng.normal(loc=(0.0, 0.0, 4.0), scale=0.3, size=(places, 14, 3))
    joints = centres[rng.integers(0, places, count)] + rng.normal(scale=0.004, size=(count, 14, 3))
    probability = rng.dirichlet(np.ones(count))
    root = rng.normal(scale=DEVIATION, size=(count, 14, 3, 3))
    return joints, probability, root @ root.transpose(0, 1, 3, 2) + np.eye(3) * 0.005**2


def answer(joints: Array, probability: Array, uncertainty: Array | float = 0.0) -> Answer:
    return answers_of([ListedBodies(joints=joints, probability=probability, uncertainty=uncertainty)])[0]


def drawn(rng: np.random.Generator, given: tuple[Array, Array, Array], count: int) -> Array:
    """Draw postures of a mixture, joint by joint."""
    joints, probability, covariance = given
    body = rng.choice(len(joints), p=probability, size=(count, 14))
    spread = np.linalg.cholesky(covariance)[body, np.arange(14)]
    return np.asarray(
        joints[body, np.arange(14)] + np.einsum("njab,njb->nja", spread, rng.normal(size=(count, 14, 3)))
    )


@pytest.mark.parametrize("places", [1, 2, 5])
def test_regions_hold_95_percent_of_the_mixture(rng, places):
    given = bodies(rng, 40, places)
    held = answer(*given).regions.holds(drawn(rng, given, 4000)).mean(axis=0)
    assert abs(held.mean() - 0.95) < 0.01, held
    assert (np.abs(held - 0.95) < 0.035).all(), held


def test_a_region_holds_the_middles_of_what_is_likely_and_nothing_far_away(rng):
    given = bodies(rng, 40)
    found = answer(*given)
    assert found.regions.holds(found.joints[0]).all()
    assert not found.regions.holds(found.joints[0] + [0.0, 0.0, 3.0]).any()


def test_probabilities_of_modes_sum_to_one_and_the_likeliest_comes_first(rng):
    regions = answer(*bodies(rng, 60, 4)).regions
    np.testing.assert_allclose(regions.probability.sum(axis=1), 1.0)
    assert (np.diff(regions.probability, axis=1) <= 0).all()
    assert (regions.radius[:, 0] > 0).all()


def test_one_gaussian_has_the_ellipsoid_of_the_chi_square_quantile(rng):
    joints, _, covariance = bodies(rng, 1)
    regions = answer(joints, np.ones(1), covariance).regions
    np.testing.assert_allclose(regions.radius[:, 0], np.sqrt(7.814727903), rtol=0.01)


def test_even_points_have_the_moments_of_a_normal_distribution():
    points = even_normal(512)
    np.testing.assert_allclose(points.mean(axis=0), 0.0, atol=0.05)
    np.testing.assert_allclose(np.cov(points.T), np.eye(3), atol=0.1)


def test_representatives_are_distinct_and_hold_enough(rng):
    joints, probability, covariance = bodies(rng, 200, 8)
    found = answer(joints, probability, covariance)
    apart = np.linalg.norm(found.joints[:, None] - found.joints[None], axis=-1).max(axis=-1)
    assert (apart[~np.eye(len(found), dtype=bool)] > DISTINCT_METRES).all()
    assert REPRESENTED_PROBABILITY <= found.probability.sum() <= 1.0 + 1e-9
    assert found.probability[:-1].sum() < REPRESENTED_PROBABILITY
    assert (np.diff(found.probability) <= 0).all()
    np.testing.assert_array_equal(found.joints, joints[found.rows])
    np.testing.assert_array_equal(found.posture, found.joints[0])
    assert found.sure == found.probability[0]


def test_twins_are_one(rng):
    joints, probability, covariance = bodies(rng, 100, 1)
    found = answer(joints, probability, covariance)
    assert len(found) == 1
    assert found.sure == pytest.approx(1.0)


def test_depth_orders_sum_to_one_and_know_near_from_far():
    joints = np.full((2, 14, 3), 4.0)
    elbow = JOINT["right_elbow"]
    joints[0, elbow, 2] -= 0.2
    joints[1, elbow, 2] += 0.2
    depth = answer(joints, np.array([0.75, 0.25]), DEVIATION).depth
    arm = ANSWER_SEGMENTS.index((JOINT["right_shoulder"], elbow))
    assert depth.near[arm] == pytest.approx(0.75)
    assert depth.far[arm] == pytest.approx(0.25)
    np.testing.assert_allclose(depth.near + depth.far + depth.level, 1.0)
    still = [k for k, (start, end) in enumerate(ANSWER_SEGMENTS) if elbow not in (start, end)]
    np.testing.assert_allclose(depth.level[still], 1.0)


def test_a_segment_at_the_edge_of_level_is_near_as_often_as_not():
    joints = np.full((1, 14, 3), 4.0)
    joints[0, JOINT["right_wrist"], 2] -= LEVEL_METRES
    depth = answer(joints, np.ones(1), DEVIATION).depth
    forearm = ANSWER_SEGMENTS.index((JOINT["right_elbow"], JOINT["right_wrist"]))
    assert depth.near[forearm] == pytest.approx(0.5)


def test_what_is_not_known_stays_so(rng):
    joints, probability, covariance = bodies(rng, 20)
    wrist = JOINT["left_wrist"]
    joints[:, wrist] = np.nan
    found = answer(joints, probability, covariance)
    forearm = ANSWER_SEGMENTS.index((JOINT["left_elbow"], wrist))
    assert np.isnan(found.depth.near[forearm])
    assert np.isnan(found.regions.level[wrist])
    assert not found.regions.holds(found.posture)[wrist]
    assert found.regions.holds(np.delete(joints, wrist, axis=1).mean(axis=0)[:0].reshape(0, 14, 3)).shape == (
        0,
        14,
    )
    assert found.probability.sum() >= REPRESENTED_PROBABILITY


def test_frames_do_not_depend_on_each_other(rng):
    frames = [bodies(rng, count) for count in (12, 1, 30)]
    J, p, S = frames[0]
    frames.insert(1, (J[:0], p[:0], S[:0]))
    together = answers_of([ListedBodies(joints=J, probability=p, uncertainty=S) for J, p, S in frames])
    for given, found in zip(frames, together, strict=True):
        alone = answer(*given)
        np.testing.assert_array_equal(alone.rows, found.rows)
        np.testing.assert_array_equal(alone.depth.near, found.depth.near)
        np.testing.assert_array_equal(alone.regions.level, found.regions.level)


def test_a_frame_without_bodies_has_an_empty_answer():
    found = answer(np.empty((0, 14, 3)), np.empty(0))
    assert (len(found.bodies), len(found)) == (0, 0)
    assert np.isnan(found.sure)
    assert np.isnan(found.posture).all()
    assert np.isnan(found.depth.near).all()
    assert not found.regions.holds(np.zeros((14, 3))).any()


def test_no_frames_have_no_answers():
    assert answers_of([]) == []


def test_what_does_not_fit_together_is_refused(rng):
    joints, probability, covariance = bodies(rng, 5)
    with pytest.raises(InputError, match=r"probability has shape \(4,\); expected \(5,\)"):
        answer(joints, probability[:4], covariance)
    with pytest.raises(InputError, match="uncertainty has shape"):
        answer(joints, probability, covariance[0])


def test_representatives_are_those_of_the_plain_way(rng):
    joints, probability, covariance = bodies(rng, 150, 12)
    joints[rng.random(joints.shape[:2]) < 0.05] = np.nan
    left: list[int] = list(range(150))
    held: dict[int, float] = {}
    while left and sum(held.values()) < REPRESENTED_PROBABILITY:
        centre = max(left, key=lambda row: probability[row])
        apart = np.linalg.norm(joints[left] - joints[centre], axis=-1)
        near = [row for row, far in zip(left, apart, strict=True) if not (far > DISTINCT_METRES).any()]
        held[centre] = probability[near].sum()
        left = [row for row in left if row not in near]
    found = answer(joints, probability, covariance)
    expected = sorted(held, key=lambda row: -held[row])[: len(found)]
    assert found.rows.tolist() == expected
    np.testing.assert_allclose(found.probability, [held[row] for row in expected])


@pytest.mark.parametrize("unlisted", [0.0, 0.01, 0.4, 1.0])
def test_no_probability_says_more_than_what_is_listed_holds(rng, unlisted):
    joints, probability, covariance = bodies(rng, 40)
    whole = answer(joints, probability, covariance)
    given = {"joints": joints, "probability": probability, "uncertainty": covariance, "unlisted": unlisted}
    empty = ListedBodies(joints=joints[:0], probability=probability[:0])
    found, nothing = answers_of([ListedBodies(**given), empty])
    listed = 1.0 - unlisted
    assert not len(nothing)
    assert found.sure == pytest.approx(listed * whole.sure)
    assert found.probability.sum() >= min(REPRESENTED_PROBABILITY, listed) - 1e-9
    assert found.probability.sum() <= listed + 1e-9
    np.testing.assert_allclose(found.depth.near, listed * whole.depth.near)
    np.testing.assert_allclose(found.depth.far, listed * whole.depth.far)
    np.testing.assert_allclose(found.depth.level, listed * whole.depth.level, atol=1e-12)


@pytest.mark.parametrize("unlisted", [-0.1, 1.5, np.nan])
def test_what_is_unlisted_is_a_probability(unlisted):
    with pytest.raises(InputError, match="unlisted"):
        ListedBodies(joints=np.zeros((1, 14, 3)), probability=np.ones(1), unlisted=unlisted)


def test_an_answer_is_written_in_a_line(rng):
    assert len(repr(answer(*bodies(rng, 40)))) < 100
