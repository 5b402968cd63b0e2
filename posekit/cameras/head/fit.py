"""Least squares on the reprojection error of a batch of heads, or of other rigid sets of points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.cameras.head.perspective import HeadPlacement, Heads, look
from posekit.geometry import Array
from posekit.least_squares import (
    Damping,
    Minimum,
    Rows,
    State,
    Stopping,
    minimise,
    scaled_equations,
    solve_each,
)

MAX_STEPS = 60

HEAD_DAMPING = Damping(initial=1e-4, smallest=1e-13, largest=1e8, growth=10.0, decay=0.03, light=1e-4)

FIT_PRECISION = 1e-10
"""Predicted decrease of the squared error, as a fraction of it, that ends the search.

The unknowns are then within about 1e-5 of their standard deviation.
"""

NEARLY_SETTLED = 1e-6
"""The same where the steps have run out: where f hardly shows, the search creeps to its end."""

RESIDUAL_ROUNDING = 4 * np.finfo(np.float64).eps
"""Error of a residual, as a fraction of the image point's coordinates, that is rounding alone."""


class HeadFit(NamedTuple):
    """The best placement of F heads.

    Attributes
    ----------
    placement : HeadPlacement
        Where each is.
    cost : array (F,)
        Sum of the squared residuals; infinite where there is no placement.
    settled : bool array (F,)
        Whether the search ended at a minimum.
    """

    placement: HeadPlacement
    cost: Array
    settled: NDArray[np.bool_]

    def take(self, index: NDArray[np.intp]) -> HeadFit:
        """Select heads."""
        return HeadFit(self.placement.take(index), self.cost[index], self.settled[index])


def fit(heads: Heads, start: HeadPlacement, precision: float = FIT_PRECISION) -> HeadFit:
    """Minimise the sum of squared residuals from a start.

    A start with NaN, or with points on the wrong side of the camera, gives no fit.
    """
    rounding = RESIDUAL_ROUNDING * np.sqrt(np.einsum("fpi,fpi->f", heads.image, heads.image))
    stopping = Stopping(steps=MAX_STEPS, precision=precision)
    placement, found = fit_reprojection(heads, start, HEAD_DAMPING, stopping, rounding=rounding)
    near = found.promise <= NEARLY_SETTLED * found.cost
    return HeadFit(placement, found.cost, found.settled | near)


def fit_reprojection(
    heads: Heads,
    start: HeadPlacement,
    damping: Damping,
    stopping: Stopping,
    *,
    weights: Array | None = None,
    rounding: Array | float = 0.0,
) -> tuple[HeadPlacement, Minimum]:
    """Minimise the sum of squared residuals, each times a weight, from a start.

    Parameters
    ----------
    heads : Heads
        What is seen of F sets of points.
    start : HeadPlacement
        Where the searches begin.
    damping : Damping
        How steps are damped.
    stopping : Stopping
        When a search ends.
    weights : array (F, P), optional
        Of each point's residuals, one over its standard deviation.
    rounding : array (F,) or float
        As `posekit.least_squares.minimise` takes it.

    Returns
    -------
    HeadPlacement, Minimum
        The placement, with rotations that are orthonormal to rounding; and how the search went.
    """
    both = None if weights is None else np.concatenate([weights, weights], axis=1)
    found = minimise(_Reprojection(heads, both), start, damping, stopping, rounding)
    placement = HeadPlacement(*found.state)
    # Products of many rotations drift from orthonormal by a few roundings; one Newton step takes them back.
    placement.R[:] = 1.5 * placement.R - 0.5 * placement.R @ np.swapaxes(placement.R, -1, -2) @ placement.R
    return placement, found


class _Reprojection:
    """The problem that `posekit.least_squares.minimise` is given."""

    def __init__(self, heads: Heads, weights: Array | None) -> None:
        self.all_heads, self.all_weights = heads, weights
        self.rows, self.heads, self.weights = np.arange(len(heads.image)), heads, weights

    def _look_at(self, rows: Rows) -> None:
        """Select heads, unless they are those of the last call: most searches go on for several steps."""
        if rows is not self.rows:
            self.rows, self.heads = rows, self.all_heads.take(rows)
            self.weights = None if self.all_weights is None else self.all_weights[rows]

    def linearise(self, rows: Rows, state: State) -> State:
        """Return the weighted sum of squared residuals, infinite where no pose is possible, these and the Jacobian."""
        self._look_at(rows)
        residual, jacobian, possible = look(self.heads, HeadPlacement(*state))
        # Where f hardly shows, a search ends elsewhere for one rounding: each cost keeps the order of its sum.
        with np.errstate(over="ignore", invalid="ignore"):  # of a step far too long
            if self.weights is None:
                cost = np.einsum("fi,fi->f", residual, residual)
            else:
                residual, jacobian = self.weights * residual, self.weights[..., None] * jacobian
                cost = (residual**2).sum(axis=1)
        return np.where(possible, cost, np.inf), residual, jacobian

    def step(self, rows: Rows, state: State, here: State, damping: Array) -> tuple[Array, Array]:
        """Return damped steps, and the decrease that each promises."""
        _, residual, jacobian = here
        normal, gradient, scale = scaled_equations(residual, jacobian)
        step = -solve_each(normal + damping[:, None, None] * np.eye(normal.shape[-1]), gradient)
        bend = np.einsum("fij,fj->fi", normal, step)
        return step / scale, -np.einsum("fi,fi->f", step, 2 * gradient + bend)

    def moved(self, rows: Rows, state: State, step: Array) -> State:
        """Return placements after steps."""
        self._look_at(rows)
        return HeadPlacement(*state).moved(step, self.heads)
