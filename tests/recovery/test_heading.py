"""Where somebody goes in a sequence: along the way of the neck, and nowhere where that tells nothing."""

import numpy as np
import pytest

from posekit.recovery.heading import headings

TIME = np.arange(20) / 10
WAY = np.array([0.6, 0.0, -0.8])


def necks(speed: float) -> np.ndarray:
    """Place the neck (20, 3) of somebody who sways by 3 cm, twice a second, while going."""
    sway = 0.03 * np.sin(4 * np.pi * TIME)[:, None] * [0.0, 1.0, 0.0]
    return np.asarray([0.0, -0.5, 5.0] + speed * TIME[:, None] * WAY + sway)


def test_a_walker_goes_where_the_neck_goes() -> None:
    found = headings(TIME, np.arange(20), necks(1.2))
    assert (found @ WAY > np.cos(np.radians(10))).all()
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)


@pytest.mark.parametrize("speed", [0.0, 0.2, 4.0])
def test_who_does_not_walk_goes_nowhere_that_is_known(speed: float) -> None:
    assert np.isnan(headings(TIME, np.arange(20), necks(speed))).all()


def test_photographs_are_no_sequence(rng: np.random.Generator) -> None:
    assert np.isnan(headings(TIME, np.arange(20), rng.normal(size=(20, 3)))).all()
    assert np.isnan(headings(TIME[:1], np.arange(1), necks(1.2)[:1])).all()
    assert np.isnan(headings(10 * TIME, np.arange(20), necks(1.2))).all()


def test_of_several_hypotheses_the_nearest_one_counts() -> None:
    near = necks(1.2)
    both = np.stack([near, 1.5 * near], axis=1).reshape(-1, 3)
    found = headings(TIME, np.repeat(np.arange(20), 2), both)
    np.testing.assert_allclose(found[::2], headings(TIME, np.arange(20), near))
    np.testing.assert_allclose(found[1::2], headings(TIME, np.arange(20), 1.5 * near))


def test_a_missing_neck_tells_nothing_and_is_passed_over() -> None:
    way = necks(1.2)
    way[4] = np.nan
    found = headings(TIME, np.arange(20), way)
    assert np.isnan(found[4]).all()
    assert np.isfinite(np.delete(found, 4, axis=0)).all()
