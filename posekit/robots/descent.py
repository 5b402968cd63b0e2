"""Levenberg-Marquardt on the manifold of configurations, inside limits, for a batch of postures."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.robots.kinematics import Kinematics
from posekit.robots.normal_equations import limited_step, normal_equations

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
    precision: float = SETTLED,
) -> Descent:
    r"""Minimise :math:`\frac12 \sum_p w_p |p(q) - y_p|^2 + \frac{\epsilon}{2} |q \ominus q_0|^2` within limits.

    Levenberg 1944, Marquardt 1963, damping after Nielsen 1999; limits by `limited_step`. A start outside the
    limits is clipped first. Only `columns` of v are moved, all that move a point unless told otherwise. The
    search ends where a step promises less than `precision` of the cost.
    """
    if columns is None:
        columns = np.flatnonzero(kinematics.moved_by.any(axis=0))
    parts = [
        _Block(kinematics, problem.take(rows), columns).descend(start[rows], steps, precision)
        for rows in (slice(at, at + BLOCK) for at in range(0, max(len(start), 1), BLOCK))
    ]
    return Descent(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


class _Equations(NamedTuple):
    """The problem at a configuration, linearised: its cost, J'J and the gradient."""

    cost: Array
    normal: Array
    gradient: Array


class _Block:
    """A block of postures and the entries of v that are moved."""

    def __init__(self, kinematics: Kinematics, problem: Problem, moving: NDArray[np.intp]) -> None:
        self.kinematics, self.problem, self.moving = kinematics, problem, moving
        known = np.isfinite(problem.targets).all(axis=2)
        self.weight = np.sqrt(np.where(known, problem.weights, 0.0))[..., None]
        self.target = np.nan_to_num(problem.targets)
        space = kinematics.space
        pull = np.full(space.nv, problem.pull)
        for first in space.free_v:
            pull[first : first + 6] = 0.0
        self.pull = pull[moving]
        position = np.full(space.nv, -1)
        position[space.bounded_v] = space.bounded_q
        self.bounded = np.flatnonzero(position[moving] >= 0)
        self.at = position[moving][self.bounded]

    def descend(self, start: Array, steps: int, precision: float) -> Descent:
        """Take steps until every posture is settled, or so many are taken."""
        q = np.clip(start, self.problem.lower, self.problem.upper)
        n = len(q)
        active = np.arange(n)
        here = self._linearise(active, q)
        cost = here.cost.copy()
        damping = np.full(n, DAMPING)
        taken, settled = np.zeros(n, dtype=np.intp), np.zeros(n, dtype=np.bool_)
        for _ in range(steps):
            if not active.size:
                break
            step, gain = self._step(here, q[active], damping[active])
            trial = self._moved(q[active], step)
            there = self._linearise(active, trial)
            # Nielsen 1999: less damping where the decrease is what was predicted, more where it is not.
            better = there.cost <= cost[active]
            ratio = np.clip((cost[active] - there.cost) / np.maximum(gain, 1e-300), 0.0, 1.0)
            factor = np.where(better, np.maximum(1.0 - (2.0 * ratio - 1.0) ** 3, FASTER), SLOWER)
            small = gain <= np.maximum(precision * cost[active], NOTHING)
            settled[active] = small & (damping[active] <= DAMPING)
            damping[active] = np.maximum(damping[active] * factor, LEAST)
            settled[active] |= damping[active] > MOST
            taken[active] += 1
            q[active[better]], cost[active[better]] = trial[better], there.cost[better]
            for mine, theirs in zip(here, there, strict=True):
                mine[better] = theirs[better]
            left = ~settled[active]
            if not left.all():
                active, here = active[left], _Equations(*(array[left] for array in here))
        return Descent(q, cost, taken, settled)

    def _linearise(self, rows: NDArray[np.intp], q: Array) -> _Equations:
        placed = self.kinematics.place(q, self.moving)
        residual = ((placed.positions - self.target[rows]) * self.weight[rows]).reshape(
            len(rows), 3 * placed.positions.shape[1]
        )
        jacobian = placed.jacobians
        jacobian *= self.weight[rows][..., None]
        away = self.kinematics.space.difference(self.problem.reference[rows], q)[:, self.moving]
        cost = 0.5 * (np.einsum("ni,ni->n", residual, residual) + (away * away) @ self.pull)
        normal, gradient = normal_equations(residual, jacobian.reshape(*residual.shape, len(self.moving)))
        return _Equations(cost, normal, gradient + self.pull * away)

    def _step(self, here: _Equations, q: Array, damping: Array) -> tuple[Array, Array]:
        """Return a damped step (N, m) inside the limits, and the decrease that it promises (N,)."""
        diagonal = np.arange(len(self.moving))
        damped = here.normal.copy()
        damped[:, diagonal, diagonal] += self.pull + damping[:, None] * (
            here.normal[:, diagonal, diagonal] + FLOOR
        )
        lowest, highest = np.full(here.gradient.shape, -np.inf), np.full(here.gradient.shape, np.inf)
        lowest[:, self.bounded] = self.problem.lower[self.at] - q[:, self.at]
        highest[:, self.bounded] = self.problem.upper[self.at] - q[:, self.at]
        step = limited_step(damped, here.gradient, lowest, highest)
        bend = (here.normal @ step[..., None])[..., 0] + self.pull * step
        return step, -np.einsum("ni,ni->n", step, here.gradient + 0.5 * bend)

    def _moved(self, q: Array, step: Array) -> Array:
        """Take steps; rounding does not pass a limit."""
        space = self.kinematics.space
        dv = np.zeros((len(q), space.nv))
        dv[:, self.moving] = step
        moved = space.integrate(q, dv)
        moved[:, space.bounded_q] = np.clip(
            moved[:, space.bounded_q],
            self.problem.lower[space.bounded_q],
            self.problem.upper[space.bounded_q],
        )
        return moved
