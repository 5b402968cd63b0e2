r"""The nearest state that keeps within all bounds: sequential quadratic programming with an exact penalty.

.. math:: \min_u \tfrac12 |r(u)|^2 + \rho \sum_i \max(0, -c_i(u))

with residuals r of the change and margins c. Each step linearises both and damps as Levenberg and Marquardt do
(Fletcher 1987, *Practical Methods of Optimization*, §12.4: Sl1QP). Its dual has one unknown a margin, between 0 and
:math:`\rho`. From a penalty above every multiplier on, the minimum is that of the problem with hard bounds.
"""

from __future__ import annotations

from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.robots.inverse import limited_step

#: Steps of one search at most.
STEPS: Final = 50
#: First, smallest and largest damping, and its factors after good and bad steps.
DAMPING: Final = (1e-3, 1e-9, 1e6, 0.15, 8.0)
#: Radians, or metres, of one step.
MAX_STEP: Final = 0.3
#: Margins beyond which a bound is ignored in one step, metres.
NEAR: Final = 0.08
#: Bounds of one step at most: those with the smallest margins.
MOST_ROWS: Final = 24
#: Derivative of a margin above which it belongs to another way of writing an angle, and is ignored.
MAX_SLOPE: Final = 100.0
DUAL_ROUNDS: Final = 8
#: Added to the dual's diagonal: margins that demand the same share it.
DUAL_SOFTNESS: Final = 1e-9
#: Added to the diagonal that scales the damping, and to the normal matrix: some unknowns move nothing.
FLOOR: Final = (0.01, 1e-9)
SAFE_STEP: Final = 1e-300


class Problem(Protocol):
    """States (N, …) that are sought near others, within bounds."""

    size: int
    """Number of unknowns of a step."""
    penalty: float
    """:math:`\\rho`, above the largest multiplier."""
    settled: float
    """Relative decrease of the cost below which a search ends."""

    def moved(self, state: Array, step: Array) -> Array:
        """Return states after steps (N, size)."""

    def residuals(self, rows: NDArray[np.intp], state: Array) -> tuple[Array, Array]:
        """Return residuals (N, m) of some rows and their derivatives (N, m, size)."""

    def margins(self, state: Array) -> Array:
        """Return margins (N, K), negative where violated, infinite where they say nothing."""

    def slopes(self, state: Array, value: Array, chosen: NDArray[np.intp]) -> Array:
        """Return the derivatives (N, M, size) of some margins `chosen` (N, M), whose values are (N, M)."""


def nearest(problem: Problem, start: Array) -> tuple[Array, Array]:
    """Search from some states.

    Parameters
    ----------
    problem : Problem
    start : array (N, …)

    Returns
    -------
    state : array (N, …)
    cost : array (N,)
        With the penalty for what is still violated.
    """
    state, damping = start.copy(), np.full(len(start), DAMPING[0])
    rows = np.arange(len(start))
    cost, *model = _linearised(problem, rows, state)
    for _ in range(STEPS):
        if not len(rows):
            break
        trial = problem.moved(state[rows], _step(problem, [part[rows] for part in model], damping[rows]))
        new = _cost(problem, problem.residuals(rows, trial)[0], problem.margins(trial))
        better = new < cost[rows]
        small = cost[rows] - new < problem.settled * cost[rows] + 1e-13
        damping[rows] = np.clip(damping[rows] * np.where(better, *DAMPING[3:]), *DAMPING[1:3])
        moved = rows[better]
        state[moved] = trial[better]
        rows = rows[~np.where(better, small, damping[rows] >= DAMPING[2])]
        if len(moved):
            cost[moved], *fresh = _linearised(problem, moved, state[moved])
            for part, one in zip(model, fresh, strict=True):
                part[moved] = one
    return state, cost


def _cost(problem: Problem, residual: Array, margin: Array) -> Array:
    excess = -np.minimum(margin, 0.0).sum(axis=1)
    return np.asarray(0.5 * (residual**2).sum(axis=1) + problem.penalty * excess)


def _linearised(problem: Problem, rows: NDArray[np.intp], state: Array) -> tuple[Array, ...]:
    """Return cost (N,), normal matrix, gradient, the smallest margins (N, M) and their slopes (N, M, size)."""
    residual, jacobian = problem.residuals(rows, state)
    margin = problem.margins(state)
    chosen = np.argsort(margin, axis=1)[:, :MOST_ROWS]
    value = np.minimum(np.take_along_axis(margin, chosen, axis=1), NEAR)
    slope = problem.slopes(state, value, chosen)
    slope[value == NEAR] = 0.0
    transposed = jacobian.swapaxes(1, 2)
    gradient = (transposed @ residual[..., None])[..., 0]
    return _cost(problem, residual, margin), transposed @ jacobian, gradient, value, slope


def differences(problem: Problem, step: float, state: Array, value: Array, chosen: NDArray[np.intp]) -> Array:
    """Return the slopes (N, M, size) of chosen margins by differences; zero where all margins of a state are far."""
    slope = np.zeros((*value.shape, problem.size))
    near = np.flatnonzero((value < NEAR).any(axis=1))
    if len(near):
        every = np.tile(near, problem.size)
        steps = np.repeat(step * np.eye(problem.size), len(near), axis=0)
        there = problem.margins(problem.moved(state[every], steps))
        there = np.take_along_axis(there, chosen[every], axis=1).reshape(problem.size, *value[near].shape)
        change = (there - value[near]) / step
        slope[near] = np.moveaxis(np.where(np.abs(change) < MAX_SLOPE, change, 0.0), 0, -1)
    return slope


def _step(problem: Problem, model: list[Array], damping: Array) -> Array:
    """Minimise the damped model over steps, by its dual; cut steps that are too long."""
    normal, gradient, value, slope = model
    diagonal = np.einsum("nii->ni", normal)
    stiff = normal + (damping[:, None] * (diagonal + FLOOR[0]) + FLOOR[1])[..., None] * np.eye(problem.size)
    solved = np.linalg.solve(stiff, np.concatenate([gradient[..., None], slope.swapaxes(1, 2)], axis=2))
    alone, pulled = -solved[..., 0], solved[..., 1:]
    dual = slope @ pulled
    offset = value + (slope @ alone[..., None])[..., 0]
    softness = DUAL_SOFTNESS * np.maximum(1.0, np.einsum("nii->ni", dual))
    dual = dual + softness[..., None] * np.eye(dual.shape[1])
    force = np.zeros_like(offset)
    for _ in range(DUAL_ROUNDS if dual.shape[1] else 0):
        push = offset + (dual @ force[..., None])[..., 0]
        change = limited_step(dual, push, -force, problem.penalty - force)
        force = force + change
        if np.abs(change).max(initial=0.0) < 1e-12:
            break
    step = alone + (pulled @ force[..., None])[..., 0]
    longest = np.maximum(np.abs(step).max(axis=1), SAFE_STEP)
    return np.asarray(step * np.minimum(1.0, MAX_STEP / longest)[:, None])
