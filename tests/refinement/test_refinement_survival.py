"""The chi-square survival function against SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2 as oracle

from posekit.errors import InputError
from posekit.refinement import chi2_survival


@settings(deadline=None, derandomize=True)
@given(st.floats(0, 1e4), st.integers(1, 200))
def test_it_is_scipys(x: float, dof: int) -> None:
    np.testing.assert_allclose(chi2_survival(x, dof), oracle.sf(x, dof), rtol=1e-10, atol=1e-14)


def test_a_table_of_all_degrees_of_freedom_at_once() -> None:
    x, dof = np.linspace(0, 300, 200)[:, None], np.arange(1, 80)
    np.testing.assert_allclose(chi2_survival(x, dof), oracle.sf(x, dof), rtol=1e-10, atol=1e-300)


@settings(deadline=None, derandomize=True)
@given(st.floats(0, 500), st.floats(0, 100), st.integers(0, 100))
def test_it_falls_with_chi2_and_rises_with_freedom(x: float, more: float, dof: int) -> None:
    assert chi2_survival(x + more, dof) <= chi2_survival(x, dof) + 1e-15
    assert chi2_survival(x, dof + 1) >= chi2_survival(x, dof) - 1e-15 or dof == 0


def test_without_freedom_nothing_can_disagree() -> None:
    np.testing.assert_array_equal(chi2_survival([0.0, 5.0, np.nan], 0), [1.0, 1.0, np.nan])


def test_nan_gives_nan_and_what_is_far_out_nothing() -> None:
    assert np.isnan(chi2_survival(np.nan, 3))
    np.testing.assert_allclose(chi2_survival([1e5, np.inf], [3, 7]), 0.0, atol=1e-200)


@pytest.mark.parametrize(("x", "dof"), [(-1.0, 3), (1.0, -1), (1.0, 2.5), (1.0, np.nan), (1.0, 1001)])
def test_what_is_no_sum_of_squares_is_refused(x: float, dof: float) -> None:
    with pytest.raises(InputError, match=r"chi2|degrees of freedom"):
        chi2_survival(x, dof)
