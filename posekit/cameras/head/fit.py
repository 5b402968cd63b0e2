"""Least squares on the reprojection error: Levenberg-Marquardt over a batch of heads."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.cameras.head.perspective import Heads, Placement, look
from posekit.geometry import Array

STEPS = 60
DAMPING = 1e-4
LEAST = 1e-13
SLOWER, FASTER = 10.0, 0.03
STUCK = 1e8
"""Damping beyond which no step improves the fit: it is at the rounding."""

SETTLED = 1e-10
"""Predicted decrease of the squared error, as a fraction of it, that ends the search.

The unknowns are then within about 1e-5 of their standard deviation.
"""

NEARLY = 1e-6
"""The same where the steps have run out: where f hardly shows, the search creeps to its end."""

ROUNDING = 4 * np.finfo(np.float64).eps
"""Error of a residual, as a fraction of the image point's coordinates, that is rounding alone."""


class Fit(NamedTuple):
    """The best placement of F heads.

    Attributes
    ----------
    placement : Placement
    cost : array (F,)
        Sum of the squared residuals; infinite where there is no placement.
    settled : bool array (F,)
        Whether the search ended at a minimum.
    """

    placement: Placement
    cost: Array
    settled: NDArray[np.bool_]

    def take(self, index: NDArray[np.intp]) -> Fit:
        """Select heads."""
        return Fit(self.placement.take(index), self.cost[index], self.settled[index])


def fit(heads: Heads, start: Placement, precision: float = SETTLED) -> Fit:
    """Minimise the sum of squared residuals from a start (Levenberg 1944; Marquardt 1963).

    A start with NaN, or with points on the wrong side of the camera, gives no fit.
    """
    here = Placement(*(array.copy() for array in start))
    residual, jacobian, possible = look(heads, here)
    cost = np.where(possible, np.einsum("fi,fi->f", residual, residual), np.inf)
    cost[~np.isfinite(cost)] = np.inf
    settled = np.zeros(len(cost), dtype=np.bool_)
    near = np.zeros(len(cost), dtype=np.bool_)
    damping = np.full(len(cost), DAMPING)
    rounding = ROUNDING * np.sqrt(np.einsum("fpi,fpi->f", heads.image, heads.image))
    active = np.flatnonzero(np.isfinite(cost))
    residual, jacobian, few = residual[active], jacobian[active], heads.take(active)
    for _ in range(STEPS):
        if not active.size:
            break
        normal, gradient, size = equations(residual, jacobian)
        step = -_solve(normal, gradient, damping[active])
        gain = -np.einsum("fi,fi->f", step, 2 * gradient + np.einsum("fij,fj->fi", normal, step))
        trial = here.take(active).moved(step / size, few)
        new_residual, new_jacobian, possible = look(few, trial)
        new_cost = np.where(possible, np.einsum("fi,fi->f", new_residual, new_residual), np.inf)
        noise = rounding[active] * np.sqrt(cost[active])
        better = new_cost <= cost[active] + noise
        small = gain <= np.maximum(precision * cost[active], rounding[active] ** 2)
        settled[active] = small & (damping[active] <= DAMPING)
        # Nielsen 1999: less damping where the decrease is what was predicted, more where it is not.
        ratio = np.minimum((cost[active] - new_cost + noise) / (gain + noise), 1.0)
        factor = np.where(better, np.maximum(1.0 - (2.0 * ratio - 1.0) ** 3, FASTER), SLOWER)
        cost[active[better]] = new_cost[better]
        here.put(active[better], trial.take(better))
        residual[better], jacobian[better] = new_residual[better], new_jacobian[better]
        damping[active] = np.maximum(damping[active] * factor, LEAST)
        near[active] = gain <= NEARLY * cost[active]
        settled[active] |= (cost[active] <= rounding[active] ** 2) | (damping[active] > STUCK)
        left = ~settled[active]
        active, residual, jacobian, few = active[left], residual[left], jacobian[left], few.take(left)
    # Products of many rotations drift from orthonormal by a few roundings; one Newton step takes them back.
    here.R[:] = 1.5 * here.R - 0.5 * here.R @ np.swapaxes(here.R, -1, -2) @ here.R
    return Fit(here, cost, settled | near)


def equations(residual: Array, jacobian: Array) -> tuple[Array, Array, Array]:
    """Return the normal equations of unknowns scaled to a unit diagonal, and the scales (F, n)."""
    squares = np.einsum("fpi,fpi->fi", jacobian, jacobian)
    size = np.sqrt(np.where(squares > 0, squares, 1.0))
    scaled = jacobian / size[:, None]
    transposed = np.swapaxes(scaled, -1, -2)
    return transposed @ scaled, (transposed @ residual[..., None])[..., 0], size


def _solve(normal: Array, gradient: Array, damping: Array) -> Array:
    damped = normal + damping[:, None, None] * np.eye(normal.shape[-1])
    solution: Array = np.asarray(np.linalg.solve(damped, gradient[..., None]), dtype=np.float64)[..., 0]
    return solution
