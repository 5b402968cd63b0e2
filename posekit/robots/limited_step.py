"""Steps of a search that stay within limits, for a batch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.least_squares import solve_each

CLAMPING_ROUNDS = 4
"""How often a step that passes a limit is cut there and the rest solved anew."""


def limited_step(normal: Array, gradient: Array, lowest: Array, highest: Array) -> Array:
    r"""Minimise :math:`g^T d + d^T H d / 2` over steps between limits, by clamping.

    Entries that stand at a limit and are pushed against it stay; what a step takes past a limit is set on it and
    the others are solved anew. The last clip makes the limits exact. A descent direction whenever the damping in
    H is large enough; entries are released by the sign of the gradient at the next call (projected Newton,
    Bertsekas 1982).

    Parameters
    ----------
    normal : array (N, m, m)
        H, positive definite.
    gradient : array (N, m)
        g.
    lowest, highest : array (N, m)
        The step's limits, lowest <= 0 <= highest; infinite where there are none.

    Returns
    -------
    array (N, m)
    """
    held = ((lowest >= 0) & (gradient > 0)) | ((highest <= 0) & (gradient < 0))
    step = _solve(normal, gradient, held, np.zeros_like(gradient))
    for _ in range(CLAMPING_ROUNDS - 1):
        past = ~held & ((step < lowest) | (step > highest))
        rows = np.flatnonzero(past.any(axis=1))
        if not rows.size:
            break
        held[rows] |= past[rows]
        value = np.clip(step[rows], lowest[rows], highest[rows])
        step[rows] = _solve(normal[rows], gradient[rows], held[rows], value)
    return np.clip(step, lowest, highest)


def _solve(normal: Array, gradient: Array, held: NDArray[np.bool_], value: Array) -> Array:
    """Solve H d = -g for the entries that are not held; the held ones have their value."""
    if not held.any():
        return -solve_each(normal, gradient)
    free = (~held).astype(np.float64)
    fixed = np.where(held, value, 0.0)
    right = free * (gradient + (normal @ fixed[..., None])[..., 0])
    matrix = normal * free[:, :, None] * free[:, None, :]
    diagonal = np.arange(normal.shape[1])
    matrix[:, diagonal, diagonal] += 1.0 - free
    return fixed - solve_each(matrix, right)
