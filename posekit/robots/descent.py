"""Levenberg-Marquardt on the manifold of configurations, inside limits, for a batch of postures."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.least_squares import Damping, Rows, State, Stopping, minimise, normal_equations
from posekit.robots.kinematics import Kinematics
from posekit.robots.limited_step import limited_step

MAX_STEPS = 60

IK_DAMPING = Damping(initial=1e-3, smallest=1e-12, largest=1e6, growth=8.0, decay=0.05, light=1e-3)

DIAGONAL_FLOOR = 1e-6
"""Added to the normal equations' diagonal before it scales the damping (m^2/rad^2): for what moves no point."""

IK_PRECISION = 1e-6
"""Predicted decrease of the cost, as a fraction of it, that ends the search."""

NEGLIGIBLE_COST = 1e-19
"""Predicted decrease (m^2) that ends it in any case: residuals are then below a nanometre."""

BLOCK_POSTURES = 256
"""Postures worked on at once."""


class KinematicProblem(NamedTuple):
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

    def take(self, rows: NDArray[np.intp] | slice) -> KinematicProblem:
        """Select postures."""
        return self._replace(
            targets=self.targets[rows], weights=self.weights[rows], reference=self.reference[rows]
        )


class KinematicDescent(NamedTuple):
    """Where the search ended.

    Attributes
    ----------
    q : array (N, nq)
        The configurations that were reached.
    cost : array (N,)
        Half the weighted sum of squared distances and the pull's share, m^2.
    steps : int array (N,)
        How many steps were tried.
    settled : bool array (N,)
        Whether it ended at a minimum, not for want of steps.
    """

    q: Array
    cost: Array
    steps: NDArray[np.intp]
    settled: NDArray[np.bool_]


def descend(
    kinematics: Kinematics,
    problem: KinematicProblem,
    start: Array,
    steps: int = MAX_STEPS,
    columns: NDArray[np.intp] | None = None,
    precision: float = IK_PRECISION,
) -> KinematicDescent:
    r"""Minimise :math:`\frac12 \sum_p w_p |p(q) - y_p|^2 + \frac{\epsilon}{2} |q \ominus q_0|^2` within limits.

    Levenberg 1944, Marquardt 1963, damping after Nielsen 1999; limits by `limited_step`. A start outside the
    limits is clipped first. Only `columns` of v are moved, all that move a point unless told otherwise. The
    search ends where a step promises less than `precision` of the cost.
    """
    if columns is None:
        columns = np.flatnonzero(kinematics.moved_by.any(axis=0))
    parts = [
        _Block(kinematics, problem.take(rows), columns).descend(start[rows], steps, precision)
        for rows in (slice(at, at + BLOCK_POSTURES) for at in range(0, max(len(start), 1), BLOCK_POSTURES))
    ]
    return KinematicDescent(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


class _Block:
    """A block of postures and the entries of v that are moved."""

    def __init__(self, kinematics: Kinematics, problem: KinematicProblem, moving: NDArray[np.intp]) -> None:
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

    def descend(self, start: Array, steps: int, precision: float) -> KinematicDescent:
        """Take steps until every posture is settled, or so many are taken."""
        q = np.clip(start, self.problem.lower, self.problem.upper)
        stopping = Stopping(steps=steps, precision=precision, smallest=NEGLIGIBLE_COST)
        found = minimise(self, (q,), IK_DAMPING, stopping)
        return KinematicDescent(found.state[0], found.cost, found.steps, found.settled)

    def linearise(self, rows: Rows, state: State) -> State:
        """Return half the weighted sum of squared distances with the pull's share, and its normal equations."""
        (q,) = state
        placed = self.kinematics.place(q, self.moving)
        residual = ((placed.positions - self.target[rows]) * self.weight[rows]).reshape(
            len(rows), 3 * placed.positions.shape[1]
        )
        jacobian = placed.jacobians
        jacobian *= self.weight[rows][..., None]
        away = self.kinematics.space.difference(self.problem.reference[rows], q)[:, self.moving]
        cost = 0.5 * (np.einsum("ni,ni->n", residual, residual) + (away * away) @ self.pull)
        normal, gradient = normal_equations(residual, jacobian.reshape(*residual.shape, len(self.moving)))
        return cost, normal, gradient + self.pull * away

    def step(self, rows: Rows, state: State, here: State, damping: Array) -> tuple[Array, Array]:
        """Return a damped step (N, m) inside the limits, and the decrease that it promises (N,)."""
        (q,) = state
        _, normal, gradient = here
        diagonal = np.arange(len(self.moving))
        damped = normal.copy()
        damped[:, diagonal, diagonal] += self.pull + damping[:, None] * (
            normal[:, diagonal, diagonal] + DIAGONAL_FLOOR
        )
        lowest, highest = np.full(gradient.shape, -np.inf), np.full(gradient.shape, np.inf)
        lowest[:, self.bounded] = self.problem.lower[self.at] - q[:, self.at]
        highest[:, self.bounded] = self.problem.upper[self.at] - q[:, self.at]
        step = limited_step(damped, gradient, lowest, highest)
        bend = (normal @ step[..., None])[..., 0] + self.pull * step
        return step, -np.einsum("ni,ni->n", step, gradient + 0.5 * bend)

    def moved(self, rows: Rows, state: State, step: Array) -> State:
        """Take steps; rounding does not pass a limit."""
        (q,) = state
        space = self.kinematics.space
        dv = np.zeros((len(q), space.nv))
        dv[:, self.moving] = step
        moved = space.integrate(q, dv)
        moved[:, space.bounded_q] = np.clip(
            moved[:, space.bounded_q],
            self.problem.lower[space.bounded_q],
            self.problem.upper[space.bounded_q],
        )
        return (moved,)
