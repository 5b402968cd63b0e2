r"""The nearest posture that keeps within all bounds: sequential quadratic programming with an exact penalty.

Of all moves u of a posture that is sought near a target x,

.. math:: \min_u \tfrac12 \sum_j w_j |y_j(u) - x_j|^2 + \rho \sum_i \max(0, -c_i(u)),

with margins c. Each step minimises this with y and c linearised and the damping of Levenberg and Marquardt (Fletcher
1987, Practical Methods of Optimization, §12.4: Sl1QP). Its dual has one unknown a margin between 0 and
:math:`\rho`, which `posekit.robots.limited_step` solves. From a penalty that is greater than any multiplier on, the
minimum is that of the problem with hard bounds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.display.short_repr import ShortRepr
from posekit.geometry import Array
from posekit.least_squares import Damping, Rows, State, Stopping, minimise
from posekit.remedy.constraints import MarginConstraints
from posekit.remedy.pieces import jacobian_of, moved
from posekit.robots.limited_step import limited_step

BOUND_PENALTY: Final = 20.0
"""Metres squared a metre: more than the changes of all joints together that one bound can ask for."""

MAX_TURN: Final = 0.3
"""Radians, or metres, of one step."""

DUAL_ROUNDS: Final = 8
"""How often the dual is solved with the bounds that hold in it."""

DUAL_SOFTNESS: Final = 1e-9
"""Added to the dual's diagonal: margins that say the same share what they ask for."""

TINY_STIFFNESS: Final = 1e-9
"""Metres squared a radian squared: a segment's turn about itself moves nothing."""

REPAIR_DAMPING: Final = Damping(initial=1e-3, smallest=1e-9, largest=1e6, growth=8.0, decay=0.15, light=0.3)
REPAIR_STOPPING: Final = Stopping(steps=50, precision=1e-6, smallest=1e-13)


@dataclass(frozen=True, kw_only=True, eq=False)
class NearestPosture(ShortRepr):
    """Postures that are sought near targets; see `posekit.least_squares.LeastSquaresProblem`.

    Parameters
    ----------
    target : array (N, 19, 3)
        Metres; NaN counts for nothing.
    weight : array (N, 19)
        Of squared distances.
    constraints : MarginConstraints
        The bounds.
    """

    target: Array
    weight: Array
    constraints: MarginConstraints

    def linearise(self, rows: Rows, state: State) -> State:
        """Return the cost, and what a step needs: normal matrix, gradient, margins, slopes."""
        (points,) = state
        count, size = len(points), self.constraints.size
        if self.constraints.free:
            jacobian = np.broadcast_to(np.eye(57).reshape(1, 19, 3, 57), (count, 19, 3, 57))
        else:
            jacobian = jacobian_of(points)
        gap = points - self.target[rows]
        known = np.isfinite(gap)
        root = np.where(known, np.sqrt(self.weight[rows])[..., None], 0.0)
        residual = (np.where(known, gap, 0.0) * root).reshape(count, -1)
        weighted = (jacobian * root[..., None]).reshape(count, -1, size)
        transposed = weighted.swapaxes(1, 2)
        normal, gradient = transposed @ weighted, (transposed @ residual[..., None])[..., 0]
        found = self.constraints.linearised(points, jacobian)
        cost = 0.5 * np.einsum("ni,ni->n", residual, residual) + BOUND_PENALTY * found.excess
        return cost, normal, gradient, found.value, found.slope

    def step(self, rows: Rows, state: State, here: State, damping: Array) -> tuple[Array, Array]:
        """Return damped steps, and by how much each lowers the model of the cost."""
        del rows, state
        _, normal, gradient, value, slope = here
        size = normal.shape[1]
        diagonal = np.einsum("nii->ni", normal)
        stiff = normal + (damping[:, None] * (diagonal + 0.01) + TINY_STIFFNESS)[:, :, None] * np.eye(size)
        right = np.concatenate([gradient[..., None], slope.swapaxes(1, 2)], axis=2)
        solved = np.linalg.solve(stiff, right)
        alone, pulled = -solved[..., 0], solved[..., 1:]
        dual = slope @ pulled
        offset = value + (slope @ alone[..., None])[..., 0]
        force = bounded_forces(dual, offset)
        step = alone + (pulled @ force[..., None])[..., 0]
        longest = np.abs(step).max(axis=1)
        share = np.minimum(1.0, MAX_TURN / np.maximum(longest, 1e-300))
        step = step * share[:, None]
        quadratic = np.einsum("ni,ni->n", step, gradient) + 0.5 * np.einsum(
            "ni,nij,nj->n", step, normal, step
        )
        after = value + (slope @ step[..., None])[..., 0]
        seen = np.minimum(value, 0.0).sum(axis=1)
        gain = -quadratic + BOUND_PENALTY * (np.minimum(after, 0.0).sum(axis=1) - seen)
        return step, np.maximum(gain, 0.0)

    def moved(self, rows: Rows, state: State, step: Array) -> State:
        """Return the postures after steps."""
        del rows
        if self.constraints.free:
            return (state[0] + step.reshape(-1, 19, 3),)
        return (moved(state[0], step),)


def bounded_forces(dual: Array, offset: Array, most: float = BOUND_PENALTY) -> Array:
    """Minimise f'Mf / 2 + o'f over forces (N, K) between 0 and the penalty of a bound.

    Parameters
    ----------
    dual : array (N, K, K)
        M.
    offset : array (N, K)
        o: margins without forces.
    most : float
        The penalty.
    """
    soft = DUAL_SOFTNESS * np.maximum(1.0, np.einsum("nii->ni", dual))
    dual = dual + soft[:, :, None] * np.eye(dual.shape[1])
    force = np.zeros_like(offset)
    for _ in range(DUAL_ROUNDS):
        gradient = offset + (dual @ force[..., None])[..., 0]
        change = limited_step(dual, gradient, -force, most - force)
        force = force + change
        if np.abs(change).max(initial=0.0) < 1e-12:
            break
    return force


def nearest(
    target: Array, start: Array, weight: Array, constraints: MarginConstraints
) -> tuple[Array, Array]:
    """Find the postures nearest to targets from where the search starts.

    Parameters
    ----------
    target, start : array (N, 19, 3)
        Metres; the start has the lengths that are kept.
    weight : array (N, 19)
        Of squared distances.
    constraints : MarginConstraints
        The bounds.

    Returns
    -------
    points : array (N, 19, 3)
    cost : array (N,)
        With the penalty for what is left.
    """
    problem = NearestPosture(target=target, weight=weight, constraints=constraints)
    found = minimise(problem, (start,), REPAIR_DAMPING, REPAIR_STOPPING)
    return found.state[0], found.cost
