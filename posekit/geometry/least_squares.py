"""Least-squares smoothing of time series, and Newton steps that move states inside bounds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from posekit.geometry.vectors import Array, Flags

#: Coefficients of the third difference, the penalty of smoothing: it is zero for constant acceleration.
THIRD_DIFFERENCE: Final = (-1.0, 3.0, -3.0, 1.0)
#: Weight of a frame that keeps its values; a smoothed frame has weight one.
STAYS: Final = 1e9
#: Maximum number of steps, number of bounds in one step, and change of an entry in one step (radians or metres).
MOST_STEPS, MOST_BOUNDS, MOST_STEP = 12, 12, 0.2
#: Step of the finite differences of margins, radians or metres.
DIFFERENCE: Final = 1e-3
#: Damping added to the diagonal of a step's normal matrix, m²/rad².
SOFTNESS: Final = 1e-6


def into_bounds(
    state: Array,
    moved: Callable[[Array, Array], Array],
    size: int,
    free: Sequence[int],
    margins: Callable[[Array], Array],
) -> Array:
    """Move states (n, …) inside bounds: damped Newton steps of least length raise negative margins to zero.

    Parameters
    ----------
    state : array (n, …)
    moved : callable
        ``moved(state, step)`` applies steps (n, size) to states.
    size : int
        Number of entries of a step.
    free : sequence of int
        Indices of the entries of a step that may differ from zero.
    margins : callable
        Returns the margins (n, K) of states, metres, negative where a bound is violated. Derivatives of the margins are
        computed by finite differences.

    Returns
    -------
    array (n, …)
        Moved states; bounds that no steps satisfy stay violated.
    """
    for _ in range(MOST_STEPS):
        margin = margins(state)
        worst = np.argsort(margin, axis=1)[:, :MOST_BOUNDS]
        value = np.minimum(np.take_along_axis(margin, worst, axis=1), 0.0)
        rows = np.flatnonzero(value.any(axis=1))
        if not rows.size:
            break
        value, worst, near = value[rows], worst[rows], state[rows]
        slope = np.zeros((*value.shape, size))
        for k in free:
            there = margins(moved(near, np.tile(DIFFERENCE * np.eye(size)[k], (len(rows), 1))))
            change = np.minimum(np.take_along_axis(there, worst, axis=1), 0.0) - value
            slope[..., k] = np.where(value < 0, change / DIFFERENCE, 0.0)
        transposed = slope.swapaxes(1, 2)
        normal = slope @ transposed + SOFTNESS * np.eye(value.shape[1])
        step = -(transposed @ np.linalg.solve(normal, value[..., None]))[..., 0]
        state = state.copy()
        state[rows] = moved(near, np.clip(step, -MOST_STEP, MOST_STEP))
    return state


def smoothed(values: Array, loose: Flags, strength: float) -> Array:
    r"""Smooth values (T, K, …) over time in the frames that a mask `loose` (T, K) selects.

    The smoothed values y minimise :math:`|y - x|^2 + \lambda |D^3 y|^2` (Whittaker 1923; Eilers 2003, *A perfect
    smoother*, Anal. Chem. 75:3631). Here x are the given values, :math:`D^3` is the third difference, and
    :math:`\lambda` is `strength`. Frames that are not selected keep their values.
    """
    from scipy import sparse
    from scipy.sparse.linalg import spsolve

    count, out = len(values), values.copy()
    if count < len(THIRD_DIFFERENCE):
        return out
    difference = sparse.diags_array(THIRD_DIFFERENCE, offsets=range(4), shape=(count - 3, count))
    for k in np.flatnonzero(loose.any(axis=0)).tolist():
        weight = sparse.diags_array(np.where(loose[:, k], 1.0, STAYS))
        found = spsolve((weight + strength * difference.T @ difference).tocsc(), weight @ values[:, k])
        out[loose[:, k], k] = found[loose[:, k]]
    return out
