"""The likelihood of a limb's lengths: its closed form, and what it does not depend on."""

from __future__ import annotations

import numpy as np
import pytest

from posekit.refinement.limb_evidence import N_ANGLES, DirectionDensity, LimbEvidence

FLAT = DirectionDensity(mean=np.zeros(6), whitening=1e-6 * np.eye(6), dof=4.0)
"""All directions are as likely."""

DEPTH, BLUR = 4.0, 0.002
LENGTHS = np.linspace(0.25, 0.40, 31)


def evidence(
    upper: float, lower: float, density: DirectionDensity = FLAT, depth: float = DEPTH
) -> LimbEvidence:
    """Hang a limb seen `upper` and `lower` metres long, at the start's depth, on a trunk that faces the camera."""
    start = np.array([0.0, 0.0, depth])
    middle = start + np.array([0.0, upper, 0.0])
    end = middle + np.array([0.0, lower, 0.0])
    rays = np.stack([point / np.linalg.norm(point) for point in (start, middle, end)])[:, :, None]
    torso = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])[:, :, None]
    return LimbEvidence.of(rays, np.full((3, 1), BLUR / np.sqrt(2)), np.array([depth]), torso, density)


def of_upper(found: LimbEvidence, lengths: np.ndarray = LENGTHS) -> np.ndarray:
    """Return the likelihood of lengths of the upper segment, over all its angles."""
    return np.asarray(np.exp(found.of_upper(lengths)).sum(axis=(0, 1)))


def test_isotropic_directions_have_the_density_of_a_projected_length() -> None:
    seen = 0.2
    found = of_upper(evidence(seen, 0.2))
    x = seen / LENGTHS
    expected = x / np.sqrt(1 - x * x) / LENGTHS
    np.testing.assert_allclose(found / found.mean(), expected / expected.mean(), rtol=0.08)


def test_lengths_that_are_too_short_are_impossible_and_the_full_length_is_likeliest() -> None:
    found = of_upper(evidence(0.32, 0.2))
    best = LENGTHS[np.argmax(found)]
    assert abs(best - 0.32) < 0.01
    assert found[LENGTHS < 0.30].max() < 0.05 * found.max()
    assert found[-1] > found[0]


def test_a_body_as_much_larger_and_farther_is_as_likely() -> None:
    near, far = evidence(0.3, 0.25), evidence(0.3 * 1.1, 0.25 * 1.1, depth=DEPTH * 1.1)
    one, other = of_upper(near), of_upper(far, LENGTHS * 1.1)
    np.testing.assert_allclose(one / one.max(), other / other.max(), atol=2e-3)


def test_lower_segments_are_longer_where_the_upper_leans_away() -> None:
    found = evidence(0.2, 0.25)
    upper = found.of_upper(np.array([0.3]))
    lower = found.of_lower(upper.max(axis=2), LENGTHS, 0.3)[0]
    nearer, farther = (
        int(np.argmax(np.where(side, upper[0, :, 0], -np.inf))) for side in (angles < 0, angles > 0)
    )
    best = [LENGTHS[np.argmax(lower[angle])] for angle in (nearer, farther)]
    assert best[1] > best[0]


angles = np.arange(41) - 20
"""The side of each angle: the farther from the camera the larger."""


def test_what_is_not_seen_says_nothing() -> None:
    found = evidence(np.nan, 0.25).of_upper(LENGTHS)
    assert np.isfinite(found).all()
    assert np.ptp(found, axis=2).max() == 0


@pytest.mark.parametrize("unseen", [False, True])
def test_lengths_are_weighed_by_loops_as_by_sums(unseen: bool, rng: np.random.Generator) -> None:
    count, lengths = 30, 0.27 * np.exp(np.linspace(-0.1, 0.1, 9))
    found = LimbEvidence(
        depth=rng.uniform(2, 6, count),
        upper=rng.uniform(0.0, 0.1, count),
        lower=np.where(rng.random(count) < 0.3 * unseen, np.nan, rng.uniform(0.0, 0.1, count)),
        blur=rng.uniform(1e-3, 4e-3, (2, count)),
        forward=rng.uniform(0.9, 1.0, count),
        prior=rng.normal(size=(count, N_ANGLES, N_ANGLES)),
    )
    upper = found.of_upper(0.3 * np.ones(1))[..., 0]
    likely = upper[:, :, None] + found.prior
    least = likely.max(axis=(1, 2)) - 3.0
    depth = np.repeat(found.depth[:, None], N_ANGLES, axis=1)
    end = found.lower[:, None] * depth, found.blur[1][:, None] * depth, depth
    looped = found.looped(likely, least, end, lengths)
    summed = found.summed(likely, least, end, lengths)
    assert (summed > -600).any() and (summed < -600).any()
    # Sums are of numbers with six digits.
    np.testing.assert_allclose(looped, summed, rtol=0, atol=1e-5)
