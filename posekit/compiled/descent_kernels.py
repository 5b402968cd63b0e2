"""Parts of a descent's step as plain loops, for `posekit.refinement`, where the formulas are.

Arrays come as refinement has them, with the batch as their last axis, along which the innermost loops go. A step makes
dozens of small sums of few postures: as NumPy's operations they take longer to be called than to be done.
"""

from __future__ import annotations

import math

from posekit.geometry import Array
from posekit.geometry.batch_last import MIN_PIVOT


def damp_blocks(matrix: Array, damping: Array, floor: float, damped: Array) -> None:
    """Add to the diagonals of blocks (k, k, B) a fraction (B,) of them and a floor; write down what (k, B)."""
    for j in range(matrix.shape[0]):
        for n in range(matrix.shape[2]):
            added = matrix[j, j, n] * damping[n] + floor
            damped[j, n] = added
            matrix[j, j, n] += added


def eliminate_blocks(matrix: Array, right: Array) -> None:
    """Factor blocks (k, k, B) as `cholesky` does, and solve for right sides (k, m, B) as `forward` does, in place."""
    k, B = matrix.shape[0], matrix.shape[2]
    for j in range(k):
        for n in range(B):
            pivot = matrix[j, j, n]
            if pivot < MIN_PIVOT:  # noqa: PLR1730 - what is no number stays so
                pivot = MIN_PIVOT
            matrix[j, j, n] = math.sqrt(pivot)
        for i in range(j + 1, k):
            for n in range(B):
                matrix[i, j, n] /= matrix[j, j, n]
        for i in range(j + 1, k):
            for c in range(j + 1, i + 1):
                for n in range(B):
                    matrix[i, c, n] -= matrix[i, j, n] * matrix[c, j, n]
        for r in range(right.shape[1]):
            for n in range(B):
                right[j, r, n] /= matrix[j, j, n]
            for i in range(j + 1, k):
                for n in range(B):
                    right[i, r, n] -= matrix[i, j, n] * right[j, r, n]


def distances(
    weight: Array, squared: Array, apart: Array, shape: Array, residual: Array, jacobian: Array
) -> None:
    """Write down residuals (9, N) of the trunk's distances and, where there is room, derivatives (9, 9, N).

    The distance of a row is that of `apart` (9, 3, 9) times the shape (9, N); its own, squared, is known.
    """
    rows, width, N = apart.shape[0], shape.shape[0], shape.shape[1]
    wanted = jacobian.shape[0] > 0
    for row in range(rows):
        for n in range(N):
            x, y, z = 0.0, 0.0, 0.0
            for s in range(width):
                x += apart[row, 0, s] * shape[s, n]
                y += apart[row, 1, s] * shape[s, n]
                z += apart[row, 2, s] * shape[s, n]
            square = x * x + y * y + z * z
            residual[row, n] = weight[row, n] * 0.5 * math.log(square / squared[row])
            if wanted:
                for s in range(width):
                    slope = x * apart[row, 0, s] + y * apart[row, 1, s] + z * apart[row, 2, s]
                    jacobian[row, s, n] = weight[row, n] * slope / square


COMPILED_TYPES = {
    "damp_blocks": "(f8[:,:,::1], f8[::1], f8, f8[:,::1])",
    "eliminate_blocks": "(f8[:,:,::1], f8[:,:,::1])",
    "distances": "(f8[:,::1], f8[::1], f8[:,:,::1], f8[:,::1], f8[:,::1], f8[:,:,::1])",
}
"""The kernels, with the types that they take."""
