"""Least squares on the reprojection error: Levenberg-Marquardt over a batch of heads."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.head.perspective import Heads, Placement, look

STEPS = 200
DAMPING = 1e-4
SLOWER, FASTER = 10.0, 0.03
STUCK = 1e8
"""Damping beyond which no step improves the fit: it is at the rounding."""

SETTLED = 1e-14
"""Predicted decrease of the squared error, as a fraction of it, that ends the search.

The unknowns are then within 1e-7 of their standard deviation.
"""

EXACT = (4 * np.finfo(np.float64).eps) ** 2
"""Squared error, as a fraction of the squared image, that is rounding alone."""


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


def fit(heads: Heads, start: Placement) -> Fit:
    """Minimise the sum of squared residuals from a start (Levenberg 1944; Marquardt 1963).

    A start with NaN, or with points on the wrong side of the camera, gives no fit.
    """
    here = Placement(*(array.copy() for array in start))
    residual, jacobian, possible = look(heads, here)
    cost = np.where(possible, np.einsum("fi,fi->f", residual, residual), np.inf)
    cost[~np.isfinite(cost)] = np.inf
    settled = np.zeros(len(cost), dtype=np.bool_)
    damping = np.full(len(cost), DAMPING)
    exact = EXACT * np.einsum("fpi,fpi->f", heads.image, heads.image)
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
        better = new_cost <= cost[active]
        settled[active] = (gain <= SETTLED * cost[active]) & (damping[active] <= DAMPING)
        cost[active[better]] = new_cost[better]
        here.put(active[better], trial.take(better))
        residual[better], jacobian[better] = new_residual[better], new_jacobian[better]
        damping[active] = np.maximum(damping[active] * np.where(better, FASTER, SLOWER), 1e-15)
        settled[active] |= (cost[active] <= exact[active]) | (damping[active] > STUCK)
        left = ~settled[active]
        active, residual, jacobian, few = active[left], residual[left], jacobian[left], few.take(left)
    # Products of many rotations drift from orthonormal by a few roundings; one Newton step takes them back.
    here.R[:] = 1.5 * here.R - 0.5 * here.R @ np.swapaxes(here.R, -1, -2) @ here.R
    return Fit(here, cost, settled)


def equations(residual: Array, jacobian: Array) -> tuple[Array, Array, Array]:
    """Return the normal equations of unknowns scaled to a unit diagonal, and the scales (F, n)."""
    size = np.sqrt(np.einsum("fpi,fpi->fi", jacobian, jacobian))
    size = np.where(size > 0, size, 1.0)
    scaled = jacobian / size[:, None]
    transposed = np.swapaxes(scaled, -1, -2)
    return transposed @ scaled, (transposed @ residual[..., None])[..., 0], size


def _solve(normal: Array, gradient: Array, damping: Array) -> Array:
    damped = normal + damping[:, None, None] * np.eye(normal.shape[-1])
    solution: Array = np.linalg.solve(damped, gradient[..., None])[..., 0]
    return solution
