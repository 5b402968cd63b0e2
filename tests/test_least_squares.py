"""Laws of damped least squares, with SciPy as the oracle."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from posekit.least_squares import (
    Damping,
    Stopping,
    minimise,
    normal_equations,
    scaled_equations,
    solve_each,
)

TIME = np.linspace(0.0, 2.0, 12)
DAMPING = Damping(initial=1e-3, smallest=1e-12, largest=1e10, growth=8.0, decay=0.1, light=1e-3)
STOPPING = Stopping(steps=80, precision=1e-12)


class Decays:
    """Amplitude and rate of exponentials that were seen with noise."""

    def __init__(self, seen):
        self.seen = seen
        self.calls = 0

    def residual(self, seen, amplitude, rate):
        return amplitude[:, None] * np.exp(-rate[:, None] * TIME) - seen

    def linearise(self, rows, state):
        self.calls += len(rows)
        amplitude, rate = state
        residual = self.residual(self.seen[rows], amplitude, rate)
        shape = np.exp(-rate[:, None] * TIME)
        jacobian = np.stack([shape, -amplitude[:, None] * TIME * shape], axis=-1)
        return (residual**2).sum(axis=1), *scaled_equations(residual, jacobian)

    def step(self, rows, state, here, damping):
        _, normal, gradient, scale = here
        step = -solve_each(normal + damping[:, None, None] * np.eye(2), gradient)
        bend = (normal @ step[..., None])[..., 0]
        return step / scale, -(step * (2 * gradient + bend)).sum(axis=1)

    def moved(self, rows, state, step):
        return state[0] + step[:, 0], state[1] + step[:, 1]


@pytest.fixture
def decays(rng):
    amplitude, rate = rng.uniform(0.5, 3.0, size=(2, 40))
    seen = amplitude[:, None] * np.exp(-rate[:, None] * TIME) + 0.02 * rng.normal(size=(40, len(TIME)))
    return Decays(seen), (np.ones(40), np.ones(40))


def test_minima_are_scipys(decays):
    problem, start = decays
    found = minimise(problem, start, DAMPING, STOPPING)
    assert found.settled.all()
    for k, seen in enumerate(problem.seen):
        expected = least_squares(
            lambda x, seen=seen: problem.residual(seen[None], x[:1], x[1:])[0],
            [1.0, 1.0],
            xtol=1e-14,
            ftol=1e-14,
        )
        np.testing.assert_allclose([found.state[0][k], found.state[1][k]], expected.x, rtol=1e-6)
        assert found.cost[k] <= 2 * expected.cost * (1 + 1e-9)


@pytest.mark.parametrize("gradual", [True, False])
def test_a_problem_has_the_same_bits_alone_and_among_others(decays, gradual):
    problem, start = decays
    damping = Damping(initial=1e-3, largest=1e10, growth=8.0, decay=0.2, light=np.inf, gradual=gradual)
    together = minimise(problem, start, damping, STOPPING)
    for k in range(0, 40, 7):
        one = slice(k, k + 1)
        alone = minimise(Decays(problem.seen[one]), tuple(each[one] for each in start), damping, STOPPING)
        np.testing.assert_array_equal(np.concatenate(alone.state), [each[k] for each in together.state])
        assert alone.steps[0] == together.steps[k]


def test_the_cost_never_grows_and_more_precision_takes_no_fewer_steps(decays):
    problem, start = decays
    before = problem.linearise(np.arange(40), start)[0]
    last = np.zeros(40, dtype=int)
    for precision in (1e-1, 1e-4, 1e-8, 1e-12):
        found = minimise(problem, start, DAMPING, Stopping(steps=80, precision=precision))
        assert (found.cost <= before).all()
        assert (found.steps >= last).all()
        before, last = found.cost, found.steps


def test_starts_stay_and_one_without_a_cost_is_left_alone(decays):
    problem, start = decays
    start[0][3] = np.nan
    given = [each.copy() for each in start]
    found = minimise(problem, start, DAMPING, STOPPING)
    for each, kept in zip(start, given, strict=True):
        np.testing.assert_array_equal(each, kept)
    assert np.isinf(found.cost[3])
    assert not found.settled[3]
    assert found.steps[3] == 0
    assert np.isnan(found.promise[3])
    assert np.delete(found.settled, 3).all()


def test_a_search_without_steps_left_is_not_settled(decays):
    problem, start = decays
    found = minimise(problem, start, DAMPING, Stopping(steps=1, precision=1e-12))
    assert not found.settled.any()
    assert (found.steps == 1).all()


def test_what_is_settled_is_looked_at_no_more(decays):
    problem, start = decays
    end = minimise(problem, start, DAMPING, STOPPING).state
    problem.calls = 0
    found = minimise(problem, end, DAMPING, STOPPING)
    assert problem.calls == 40 + found.steps.sum()
    assert found.steps.max() <= 2


def test_a_cost_within_rounding_is_settled(decays):
    problem, start = decays
    found = minimise(problem, start, DAMPING, STOPPING, rounding=1e3)
    assert found.settled.all()
    assert (found.steps == 1).all()


def test_damping_is_nielsens():
    better = np.array([True, True, True, True, False])
    decrease = np.array([1.0, 0.5, 0.0, 2.0, -np.inf])
    found = DAMPING.updated(np.ones(5), better, decrease, np.ones(5))
    np.testing.assert_allclose(found, [0.1, 1.0, 2.0, 0.1, 8.0])
    plain = Damping(initial=1.0, largest=1e3, growth=8.0, decay=0.2, light=1.0, gradual=False)
    np.testing.assert_allclose(plain.updated(np.ones(5), better, decrease, np.ones(5)), [0.2] * 4 + [8.0])
    held = DAMPING.updated(np.ones(5), better, decrease, np.ones(5), np.ones(5))
    assert held[4] == 1.0
    assert DAMPING.updated(np.full(1, 1e-12), better[:1], decrease[:1], np.ones(1))[0] == 1e-12


def test_scaled_equations_have_a_unit_diagonal_and_the_same_solution(rng):
    residual, jacobian = rng.normal(size=(5, 9)), rng.normal(size=(5, 9, 3)) * [1.0, 1e3, 1e-3]
    normal, gradient, scale = scaled_equations(residual, jacobian)
    np.testing.assert_allclose(np.einsum("nii->ni", normal), 1.0)
    plain = solve_each(*normal_equations(residual, jacobian))
    np.testing.assert_allclose(solve_each(normal, gradient) / scale, plain, rtol=1e-8)
    unseen = scaled_equations(residual, np.zeros_like(jacobian))
    np.testing.assert_array_equal(unseen[2], 1.0)
