r"""Damped least squares for a batch of small problems (Levenberg 1944; Marquardt 1963).

A step d from where the residuals are r and their derivatives J minimises the damped quadratic

.. math:: |r + J d|^2 + \lambda\, d^T D\, d,

with D the diagonal of :math:`J^T J`, or the identity where the unknowns are scaled to a unit diagonal. A step that
makes the cost no worse is taken. The damping :math:`\lambda` then falls the more, the nearer the decrease came to what
the quadratic promised (Nielsen 1999, *Damping parameter in Marquardt's method*, IMM-REP-1999-05, eq. 2.5); after a step
that was worse it grows. Each problem ends by itself, and only those that have not are worked on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array

Rows = NDArray[np.intp]

State = tuple[Array, ...]
"""Arrays (N, ...): where N searches stand, or what is known of them there."""

MIN_PROMISE = 1e-300
"""Least promised decrease that the one found is compared with: at a minimum both are zero."""


@dataclass(frozen=True, kw_only=True)
class Damping:
    """How the damping of a search changes from step to step.

    Parameters
    ----------
    initial : float
        At first: a fraction of the diagonal that is added to it.
    smallest, largest : float
        It never falls below the one; beyond the other no step improves the cost, and the search ends.
    growth : float
        Factor after a step that was worse.
    decay : float
        Factor after a step that was as good as promised, the least that there is.
    light : float
        Damping up to which a small promise means that little is left to gain, not that steps are held short.
    gradual : bool
        Whether a step that was better than before, but not as good as promised, lets the damping fall less, or grow up
        to twofold; otherwise it falls by `decay` after each better step.
    """

    initial: float
    smallest: float = 0.0
    largest: float
    growth: float
    decay: float
    light: float
    gradual: bool = True

    def updated(
        self,
        damping: Array,
        better: NDArray[np.bool_],
        decrease: Array,
        promise: Array,
        growth: Array | float | None = None,
    ) -> Array:
        """Return the damping of the next step.

        Parameters
        ----------
        damping : array (...)
            Of this step.
        better : bool array (...)
            Whether the step was taken.
        decrease, promise : array (...)
            By how much the cost fell, and by how much the quadratic said that it would.
        growth : array (...), optional
            What stands for `growth` where the step was not taken.

        Returns
        -------
        array (...)
        """
        falls: Array | float = self.decay
        if self.gradual:
            with np.errstate(invalid="ignore"):
                ratio = np.clip(decrease / np.maximum(promise, MIN_PROMISE), 0.0, 1.0)
            falls = np.maximum(1.0 - (2.0 * ratio - 1.0) ** 3, self.decay)
        factor = np.where(better, falls, self.growth if growth is None else growth)
        return np.asarray(np.maximum(damping * factor, self.smallest))


class LeastSquaresProblem(Protocol):
    """N problems of m unknowns."""

    def linearise(self, rows: Rows, state: State) -> State:
        """Return the cost of some problems in their states, infinite where there is none, and what `step` needs."""

    def step(self, rows: Rows, state: State, here: State, damping: Array) -> tuple[Array, Array]:
        """Return damped steps (N, m) of what was linearised, and the decrease of the cost that each promises (N,)."""

    def moved(self, rows: Rows, state: State, step: Array) -> State:
        """Return the states after steps."""


class Minimum(NamedTuple):
    """Where the searches ended.

    Attributes
    ----------
    state : tuple of array (N, ...)
        The best states that were found.
    cost : array (N,)
        Theirs.
    steps : int array (N,)
        How many were tried.
    settled : bool array (N,)
        Whether the search ended at a minimum, not for want of steps.
    promise : array (N,)
        The decrease that the last step promised; NaN where there was none.
    """

    state: State
    cost: Array
    steps: Rows
    settled: NDArray[np.bool_]
    promise: Array


@dataclass(frozen=True, kw_only=True)
class Stopping:
    """When a search ends.

    Parameters
    ----------
    steps : int
        Steps after which it is left where it is.
    precision : float
        Promised decrease, as a fraction of the cost, that ends it.
    full_cost : float
        Cost above which the promise is compared with this instead.
    smallest : float
        Promised decrease that ends it in any case.
    """

    steps: int
    precision: float
    full_cost: float = np.inf
    smallest: float = 0.0


def minimise(
    problem: LeastSquaresProblem,
    start: State,
    damping: Damping,
    stopping: Stopping,
    rounding: Array | float = 0.0,
) -> Minimum:
    """Take damped steps until each problem is settled, or so many are taken.

    Parameters
    ----------
    problem : LeastSquaresProblem
        What is minimised.
    start : tuple of array (N, ...)
        Where the searches begin; they stay as they are. A start of infinite cost is left there.
    damping : Damping
        How steps are damped.
    stopping : Stopping
        When a search ends.
    rounding : array (N,) or float
        Root of the cost that is rounding alone: within it a cost is no worse, and nothing is left to gain.

    Returns
    -------
    Minimum
    """
    state = tuple(array.copy() for array in start)
    count = len(state[0])
    every = np.arange(count)
    noise_root = np.broadcast_to(np.asarray(rounding, dtype=np.float64), (count,))
    here = problem.linearise(every, state)
    cost = np.where(np.isfinite(here[0]), here[0], np.inf)
    size = np.full(count, damping.initial)
    taken, settled = np.zeros(count, dtype=np.intp), np.zeros(count, dtype=np.bool_)
    promise = np.full(count, np.nan)
    active = np.flatnonzero(np.isfinite(cost))
    here = _taken(here, active)
    for _ in range(stopping.steps):
        if not active.size:
            break
        now, value, weight = _taken(state, active), cost[active], size[active]
        step, gain = problem.step(active, now, here, weight)
        trial = problem.moved(active, now, step)
        there = problem.linearise(active, trial)
        floor = noise_root[active] ** 2
        noise = noise_root[active] * np.sqrt(value)
        # At rounding costs are equal. A damping that is not gradual must grow then, or the search would not end.
        better = there[0] <= value + noise if damping.gradual else there[0] < value + noise
        done = gain <= np.maximum(
            stopping.precision * np.minimum(value, stopping.full_cost), np.maximum(floor, stopping.smallest)
        )
        done &= weight <= damping.light
        with np.errstate(over="ignore"):  # after a step that made things far worse
            size[active] = damping.updated(weight, better, value - there[0] + noise, gain + noise)
        rows = active[better]
        for mine, theirs in zip(state, trial, strict=True):
            mine[rows] = theirs[better]
        for mine, theirs in zip(here, there, strict=True):
            mine[better] = theirs[better]
        cost[rows] = there[0][better]
        promise[active] = gain
        taken[active] += 1
        exact = (floor > 0) & (cost[active] <= floor)
        settled[active] = done | exact | (size[active] > damping.largest)
        left = ~settled[active]
        if not left.all():
            active, here = active[left], _taken(here, left)
    return Minimum(state, cost, taken, settled, promise)


def normal_equations(residual: Array, jacobian: Array) -> tuple[Array, Array]:
    """Return J'J (N, m, m) and J'r (N, m) of residuals (N, k) and their Jacobian (N, k, m)."""
    transposed = np.swapaxes(jacobian, -1, -2)
    return transposed @ jacobian, (transposed @ residual[..., None])[..., 0]


def scaled_equations(residual: Array, jacobian: Array) -> tuple[Array, Array, Array]:
    """Return J'J and J'r of unknowns scaled to a unit diagonal (Moré 1978), and the scales (N, m)."""
    squares = np.einsum("fpi,fpi->fi", jacobian, jacobian)
    scale = np.sqrt(np.where(squares > 0, squares, 1.0))
    normal, gradient = normal_equations(residual, jacobian / scale[:, None])
    return normal, gradient, scale


def solve_each(matrix: Array, right: Array) -> Array:
    """Solve A x = b for matrices (N, m, m) and right sides (N, m)."""
    return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0], dtype=np.float64)


def _taken(arrays: State, rows: Rows | NDArray[np.bool_]) -> State:
    return tuple(array[rows] for array in arrays)
