"""Many bracketed roots at once, to the last digits (Chandrupatla 1997)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array

MAX_ITERATIONS = 240
"""Of which every fourth halves the bracket: enough for any, where ten are usual."""

Function = Callable[[Array, NDArray[np.intp]], Array]


def find_roots(function: Function, a: Array, b: Array) -> Array:
    """Find one root in each of M brackets.

    Inverse quadratic interpolation where the last three points allow it, bisection elsewhere: T. R. Chandrupatla
    (1997), A new hybrid quadratic/bisection algorithm, *Advances in Engineering Software* 28, 145-149.

    Parameters
    ----------
    function : callable
        Takes places (K,) and the numbers (K,) of the brackets they are for; returns values (K,).
    a, b : array (M,)
        The brackets; where the function has one sign at both ends, the end with the smaller value is returned.
    """
    rows = np.arange(len(a))
    x1, x2 = np.array(b, dtype=np.float64), np.array(a, dtype=np.float64)
    f1, f2 = function(x1, rows), function(x2, rows)
    x3, f3 = x2.copy(), f2.copy()
    t = np.full(len(a), 0.5)
    best = np.where(np.abs(f1) < np.abs(f2), x1, x2)
    active = (f1 != 0) & (f2 != 0) & (np.sign(f1) != np.sign(f2))
    rows = rows[active]
    x1, x2, x3, f1, f2, f3, t = (values[active] for values in (x1, x2, x3, f1, f2, f3, t))
    for step in range(MAX_ITERATIONS):
        if len(rows) == 0:
            break
        x = x1 + t * (x2 - x1)
        f = function(x, rows)
        same = np.sign(f) == np.sign(f1)
        x3, f3 = np.where(same, x1, x2), np.where(same, f1, f2)
        x2, f2 = np.where(same, x2, x1), np.where(same, f2, f1)
        x1, f1 = x, f
        nearest = np.where(np.abs(f1) < np.abs(f2), x1, x2)
        best[rows] = nearest
        smallest = 4 * np.finfo(np.float64).eps * np.abs(nearest) + np.finfo(np.float64).tiny
        width = np.abs(x2 - x1)
        active = (f1 != 0) & (f2 != 0) & (width > smallest)
        rows = rows[active]
        x1, x2, x3, f1, f2, f3, smallest, width = (
            values[active] for values in (x1, x2, x3, f1, f2, f3, smallest, width)
        )
        # Every fourth step bisects, which bounds how many are needed whatever the function does.
        t = _next(x1, x2, x3, f1, f2, f3) if step % 4 < 3 else np.full(len(rows), 0.5)
        least = np.minimum(0.5 * smallest / width, 0.5)
        t = np.clip(t, least, 1 - least)
    return best


def _next(x1: Array, x2: Array, x3: Array, f1: Array, f2: Array, f3: Array) -> Array:
    """Return where between x1 (0) and x2 (1) to look next."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        xi = (x1 - x2) / (x3 - x2)
        phi = (f1 - f2) / (f3 - f2)
        quadratic = (phi**2 < xi) & ((1 - phi) ** 2 < 1 - xi)
        alpha = (x3 - x1) / (x2 - x1)
        t = (f1 / (f1 - f2)) * (f3 / (f3 - f2)) - alpha * (f1 / (f3 - f1)) * (f2 / (f2 - f3))
    return np.where(quadratic & np.isfinite(t), t, 0.5)
