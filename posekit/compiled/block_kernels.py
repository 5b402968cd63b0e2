"""Small matrices and damping of one posture's search as plain loops, for `posekit.compiled.posture_kernels`.

What `posekit.refinement.equations` eliminates with arrays, and the damping of `posekit.least_squares`.
"""

from __future__ import annotations

import math
from typing import Any

from posekit.geometry import Array
from posekit.geometry.batch_last import MIN_PIVOT

(
    FIRST_DAMPING,
    LEAST_DAMPING,
    MOST_DAMPING,
    DAMPING_GROWTH,
    DAMPING_DECAY,
    LIGHT_DAMPING,
    DIAGONAL_FLOOR,
    MOST_STEPS,
    GAIN_PRECISION,
    HOPELESS_CHI2,
) = range(10)
"""Where a search's settings stand: those of its damping, the floor of diagonals, and when it ends."""

LEAST_PROMISE = 1e-300
"""As `posekit.least_squares.MIN_PROMISE`."""


def damped_factor(matrix: Array, width: Any, damping: Any, floor: Any, damped: Array) -> None:
    """Add a fraction of its diagonal and a floor to a matrix, write down what, and factor it (Cholesky)."""
    for j in range(width):
        damped[j] = matrix[j, j] * damping + floor
        matrix[j, j] += damped[j]
    for j in range(width):
        for i in range(j, width):
            total = matrix[i, j]
            for m in range(j):
                total -= matrix[i, m] * matrix[j, m]
            if i == j:
                matrix[j, j] = math.sqrt(MIN_PIVOT if total < MIN_PIVOT else total)
            else:
                matrix[i, j] = total / matrix[j, j]


def solve_forward(L: Array, width: Any, right: Array, columns: Any) -> None:
    """Solve L y = b for the columns of right sides, in place."""
    for i in range(width):
        for c in range(columns):
            total = right[i, c]
            for m in range(i):
                total -= L[i, m] * right[m, c]
            right[i, c] = total / L[i, i]


def solve_backward(L: Array, width: Any, x: Array) -> None:
    """Solve L' x = y, in place."""
    for i in range(width - 1, -1, -1):
        total = x[i]
        for m in range(i + 1, width):
            total -= L[m, i] * x[m]
        x[i] = total / L[i, i]


def next_damping(h: Array, damping: Any, better: Any, decrease: Any, promise: Any, ran: Any) -> Any:
    """Return the damping of the next step, as `posekit.least_squares.Damping.updated` does."""
    factor = 1.0 if ran else h[DAMPING_GROWTH]
    if better:
        ratio = min(max(decrease / max(promise, LEAST_PROMISE), 0.0), 1.0)
        factor = max(1.0 - (2.0 * ratio - 1.0) ** 3, h[DAMPING_DECAY])
    return max(damping * factor, h[LEAST_DAMPING])


def leave(right: Array, width: Any, own: Array, push: Array) -> None:
    """Take from matrix (6, 6) and gradient (6,) what an eliminated block takes along."""
    for a in range(6):
        for b in range(6):
            for k in range(width):
                own[a, b] -= right[k, a] * right[k, b]
        for k in range(width):
            push[a] -= right[k, a] * right[k, 6]


def eliminate_coupled(
    matrix: Array, right: Array, width: Any, damping: Any, floor: Any, damped: Array, own: Array, push: Array
) -> None:
    """Damp and factor a block, solve for its coupling and gradient (U, 7), and take from what it touches its part."""
    damped_factor(matrix, width, damping, floor, damped)
    solve_forward(matrix, width, right, 7)
    leave(right, width, own, push)


def follow(L: Array, right: Array, width: Any, shift: Array, damped: Array, step: Array) -> Any:
    """Solve for the step of an eliminated block when what it is coupled with moves; return the decrease it promises."""
    gain = 0.0
    for k in range(width):
        step[k] = right[k, 6]
        gain += right[k, 6] * right[k, 6]
        for a in range(6):
            step[k] += right[k, a] * shift[a]
    solve_backward(L, width, step)
    for k in range(width):
        step[k] = -step[k]
        gain += damped[k] * step[k] * step[k]
    return gain


COMPILED_TYPES = {
    "damped_factor": "",
    "solve_forward": "",
    "solve_backward": "",
    "next_damping": "",
    "leave": "",
    "eliminate_coupled": "",
    "follow": "",
}
"""The kernels, in the order in which they need each other: compiled into those that call them."""
