"""Levenberg-Marquardt on the manifold of configurations, inside limits, for a batch of postures."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.robot.kinematics import Kinematics
from posekit.robot.normal_equations import limited_step, normal_equations

STEPS = 60
DAMPING = 1e-3
LEAST, MOST = 1e-12, 1e6
SLOWER, FASTER = 8.0, 0.05
FLOOR = 1e-6
"""Added to the normal equations' diagonal before it scales the damping (m^2/rad^2): for what moves no point."""

SETTLED = 1e-6
"""Predicted decrease of the cost, as a fraction of it, that ends the search."""

NOTHING = 1e-19
"""Predicted decrease (m^2) that ends it in any case: residuals are then below a nanometre."""

BLOCK = 256
"""Postures worked on at once."""


class Problem(NamedTuple):
    """What is minimised, for N postures.

    Attributes
    ----------
    targets : array (N, P, 3)
        Metres; NaN is unknown.
    weights : array (N, P)
        Of each point's squared distance.
    lower, upper : array (nq,)
        Limits of q.
    reference : array (N, nq)
        Where the pull draws what the points do not determine.
    pull : float
        Its strength, m^2/rad^2.
    """

    targets: Array
    weights: Array
    lower: Array
    upper: Array
    reference: Array
    pull: float

    def take(self, rows: NDArray[np.intp] | slice) -> Problem:
        """Select postures."""
        return self._replace(
            targets=self.targets[rows], weights=self.weights[rows], reference=self.reference[rows]
        )


class Descent(NamedTuple):
    """Where the search ended.

    Attributes
    ----------
    q : array (N, nq)
    cost : array (N,)
        Half the weighted sum of squared distances and the pull's share, m^2.
    steps : int array (N,)
    settled : bool array (N,)
        Whether it ended at a minimum, not for want of steps.
    """

    q: Array
    cost: Array
    steps: NDArray[np.intp]
    settled: NDArray[np.bool_]


def descend(
    kinematics: Kinematics,
    problem: Problem,
    start: Array,
    steps: int = STEPS,
    columns: NDArray[np.intp] | None = None,
) -> Descent:
    r"""Minimise :math:`\frac12 \sum_p w_p |p(q) - y_p|^2 + \frac{\epsilon}{2} |q \ominus q_0|^2` within limits.

    Levenberg 1944, Marquardt 1963, damping after Nielsen 1999; limits by `limited_step`. A start outside the
    limits is clipped first. Only `columns` of v are moved, all that move a point unless told otherwise.
    """
    if columns is None:
        columns = np.flatnonzero(kinematics.moved_by.any(axis=0))
    parts = [
        _descend(kinematics, problem.take(rows), start[rows], steps, columns)
        for rows in (slice(at, at + BLOCK) for at in range(0, max(len(start), 1), BLOCK))
    ]
    return Descent(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def _descend(
    kinematics: Kinematics, problem: Problem, start: Array, steps: int, moving: NDArray[np.intp]
) -> Descent:
    space = kinematics.space
    q = np.clip(start, problem.lower, problem.upper)
    n = len(q)
    weight = np.sqrt(np.where(np.isfinite(problem.targets).all(axis=2), problem.weights, 0.0))[..., None]
    target = np.nan_to_num(problem.targets)
    pull = np.full(space.nv, problem.pull)
    for first in space.free_v:
        pull[first : first + 6] = 0.0
    pull = pull[moving]
    lower, upper = _limits(kinematics, problem.lower, problem.upper)
    position_of = np.full(space.nv, -1)
    position_of[space.bounded_v] = space.bounded_q
    at = position_of[moving]
    bounded = at >= 0

    def look(rows: NDArray[np.intp], where: Array) -> tuple[Array, Array, Array, Array]:
        placed = kinematics.place(where, moving)
        residual = ((placed.positions - target[rows]) * weight[rows]).reshape(len(rows), -1)
        jacobian = placed.jacobians
        jacobian *= weight[rows][..., None]
        away = space.difference(problem.reference[rows], where)[:, moving]
        cost = 0.5 * (np.einsum("ni,ni->n", residual, residual) + (away * away) @ pull)
        return residual, jacobian.reshape(len(rows), -1, len(moving)), away, cost

    active = np.arange(n)
    residual, jacobian, away, cost_here = look(active, q)
    normal, gradient = normal_equations(residual, jacobian)
    gradient += pull * away
    cost = cost_here.copy()
    damping = np.full(n, DAMPING)
    taken = np.zeros(n, dtype=np.intp)
    settled = np.zeros(n, dtype=np.bool_)
    diagonal = np.arange(len(moving))
    for _ in range(steps):
        if not active.size:
            break
        here = q[active]
        scale = normal[:, diagonal, diagonal] + FLOOR
        damped = normal.copy()
        damped[:, diagonal, diagonal] += pull + damping[active, None] * scale
        room = np.zeros((2, len(active), len(moving)))
        room[0], room[1] = -np.inf, np.inf
        room[0][:, bounded] = lower[moving[bounded]] - here[:, at[bounded]]
        room[1][:, bounded] = upper[moving[bounded]] - here[:, at[bounded]]
        step = limited_step(damped, gradient, *room)
        bend = (normal @ step[..., None])[..., 0] + pull * step
        gain = -np.einsum("ni,ni->n", step, gradient + 0.5 * bend)
        dv = np.zeros((len(active), space.nv))
        dv[:, moving] = step
        trial = space.integrate(here, dv)
        trial[:, space.bounded_q] = np.clip(
            trial[:, space.bounded_q], problem.lower[space.bounded_q], problem.upper[space.bounded_q]
        )
        new_residual, new_jacobian, new_away, new_cost = look(active, trial)
        better = new_cost <= cost[active]
        ratio = np.minimum((cost[active] - new_cost) / np.maximum(gain, 1e-300), 1.0)
        small = gain <= np.maximum(SETTLED * cost[active], NOTHING)
        taken[active] += 1
        settled[active] = small & (damping[active] <= DAMPING)
        factor = np.where(better, np.maximum(1.0 - (2.0 * ratio - 1.0) ** 3, FASTER), SLOWER)
        damping[active] = np.maximum(damping[active] * factor, LEAST)
        settled[active] |= damping[active] > MOST
        rows = np.flatnonzero(better)
        q[active[rows]], cost[active[rows]] = trial[rows], new_cost[rows]
        if rows.size:
            normal[rows], gradient[rows] = normal_equations(new_residual[rows], new_jacobian[rows])
            gradient[rows] += pull * new_away[rows]
        left = ~settled[active]
        if not left.all():
            active, normal, gradient = active[left], normal[left], gradient[left]
    return Descent(q, cost, taken, settled)


def _limits(kinematics: Kinematics, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return the limits of the entries of v."""
    space = kinematics.space
    low, high = np.full(space.nv, -np.inf), np.full(space.nv, np.inf)
    low[space.bounded_v], high[space.bounded_v] = lower[space.bounded_q], upper[space.bounded_q]
    return low, high
