"""The compiled limits are what NumPy makes of the same formulas."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posekit.body import load_figure
from posekit.compiled.limit_kernels import LEAST_COSINE
from posekit.refinement.figure_numbers import FigureNumbers
from posekit.refinement.limits import (
    LIMB_BRANCHES,
    MIN_COSINE,
    looped_ball,
    looped_branches,
    summed_ball,
    summed_branches,
)

MANY = 200


def test_the_least_cosine_is_one() -> None:
    assert LEAST_COSINE == MIN_COSINE


@pytest.mark.parametrize(
    "possible", [list(LIMB_BRANCHES), list(LIMB_BRANCHES[:1]), list(LIMB_BRANCHES[1::2])]
)
def test_branches_are_those_that_numpy_finds(
    possible: list[tuple[int, float]], rng: np.random.Generator
) -> None:
    angles = rng.uniform(-np.pi, np.pi, (4, MANY))
    angles[:, 0] = np.nan
    weight, middle, half = rng.uniform(0, 1, (3, 4, MANY))
    expected = summed_branches(angles, weight, (middle, half), possible)
    found = looped_branches(angles, weight, (middle, half), possible)
    for mine, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("watched", [False, True])
@pytest.mark.parametrize("spread", [0.1, 3.0])
def test_balls_are_judged_as_numpy_does(watched: bool, spread: float, rng: np.random.Generator) -> None:
    bounds = FigureNumbers.of(load_figure()).pelvis_bounds
    parent = Rotation.random(MANY, random_state=1).as_matrix()
    child = parent @ Rotation.from_rotvec(spread * rng.standard_normal((MANY, 3))).as_matrix()
    mother, daughter = (np.moveaxis(each, 0, -1) for each in (parent, child))
    watch = rng.integers(-1, 2, (3, MANY)).astype(np.int8) if watched else None
    expected, found = (each(mother, daughter, bounds, watch) for each in (summed_ball, looped_ball))
    np.testing.assert_allclose(found.residual, expected.residual, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(found.crossed, expected.crossed)
    assert (found.jacobian is None) == (expected.jacobian is None)
    if found.jacobian is not None and expected.jacobian is not None:
        np.testing.assert_allclose(found.jacobian, expected.jacobian, rtol=0, atol=1e-9)


def test_nothing_is_felt_inside() -> None:
    bounds = FigureNumbers.of(load_figure()).pelvis_bounds
    upright = np.repeat(np.eye(3)[..., None], 2, axis=2)
    assert looped_ball(upright, upright, bounds).jacobian is None
