"""The compiled parts of a descent's step are what NumPy makes of the same formulas."""

from __future__ import annotations

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.compiled import descent_kernels
from posekit.compiled.compiling import compiled
from posekit.geometry.batch_last import cholesky, forward
from posekit.refinement.equations import DIAGONAL_FLOOR, eliminate
from posekit.refinement.figure_numbers import FigureNumbers
from posekit.refinement.trunk_terms import shape_distances, summed_distances


@pytest.mark.parametrize("trailing", [(1,), (7,), (4, 5)])
@pytest.mark.parametrize(("k", "m"), [(4, 7), (9, 1), (18, 0)])
def test_blocks_are_eliminated_as_numpy_does(
    k: int, m: int, trailing: tuple[int, ...], rng: np.random.Generator
) -> None:
    root = rng.standard_normal((k, k, *trailing))
    matrix = np.einsum("ij...,kj...->ik...", root, root)
    coupling, gradient = rng.standard_normal((k, m, *trailing)), rng.standard_normal((k, *trailing))
    damping = rng.uniform(0, 1, trailing[-1])
    before = matrix.copy(), coupling.copy(), gradient.copy()
    found = eliminate(matrix, coupling, gradient, damping, DIAGONAL_FLOOR)
    for given, kept in zip((matrix, coupling, gradient), before, strict=True):
        np.testing.assert_array_equal(given, kept)
    diagonal = np.arange(k)
    added = matrix[diagonal, diagonal] * damping + DIAGONAL_FLOOR
    matrix[diagonal, diagonal] += added
    lower = np.tril(np.ones((k, k), dtype=bool))
    np.testing.assert_array_equal(found.damped, added)
    factor = cholesky(matrix)
    np.testing.assert_allclose(found.factor[lower], factor[lower], rtol=1e-12, atol=1e-12)
    right = forward(factor, np.concatenate([coupling, gradient[:, None]], axis=1))
    np.testing.assert_allclose(found.right, right, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_pivots_that_are_none_are_the_least_and_unknown_ones_stay_unknown(value: float) -> None:
    matrix, right = np.full((1, 1, 1), value), np.ones((1, 1, 1))
    compiled(descent_kernels).eliminate_blocks(matrix, right)
    np.testing.assert_array_equal(matrix, cholesky(np.full((1, 1, 1), value)))


@pytest.mark.parametrize("count", [1, 50])
def test_distances_of_the_trunk_are_what_numpy_finds(count: int, rng: np.random.Generator) -> None:
    own = FigureNumbers.of(load_figure()).shape
    weight = rng.uniform(10, 100, 9)
    shape = own[:, None] + rng.normal(scale=0.01, size=(9, count))
    expected, slopes = summed_distances(weight, own, shape)
    found, along = shape_distances(weight, own, shape)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(along, slopes, rtol=1e-9, atol=1e-9)
    alone, none = shape_distances(weight, own, shape, slopes=False)
    np.testing.assert_array_equal(alone, found)
    assert len(none) in (0, 9)
