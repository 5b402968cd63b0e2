r"""How unlikely vectors are under a Student distribution, for all pairs of two sets at once.

A vector x of three coordinates with :math:`\nu` degrees of freedom and the scale s in each of them has
:math:`-\log p = \tfrac{\nu + 3}{2} \log(1 + |x|^2 / \nu s^2) + 3 \log s` plus a constant (Lange, Little & Taylor 1989,
"Robust statistical modeling using the t distribution", J. Am. Stat. Assoc. 84:881-896). Here x is the difference of a
row's vector and a column's, times a factor of the row, and :math:`s^2` the motion's own plus what noise adds from both:

.. math::

   H = s^2 / \sigma^2 = 1 + A_r + w_r B_c, \qquad G = H + \kappa_r |x_c - p_r|^2

   -\log p + 3 \log \sigma = \tfrac{\nu + 3}{2} \log G - \tfrac{\nu}{2} \log H \ge 0

G and H are bilinear in the row and the column: a matrix product each. Sums of logarithms are logarithms of products.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array


def columns(value: Array, variance: Array, known: NDArray[np.bool_]) -> Array:
    """Lay out the columns (C, 7, N) of vectors (C, N, 3) with their variances (C, N)."""
    laid = np.empty((value.shape[0], 7, value.shape[1]))
    laid[:, :3] = value.transpose(0, 2, 1)
    laid[:, 3] = known
    laid[:, 4] = (value**2).sum(axis=-1)
    laid[:, 5] = variance
    laid[:, 6] = 1.0
    return laid


def rows(value: Array, factor: Array, noise: Array, weight: Array, known: NDArray[np.bool_]) -> Array:
    """Lay out the rows (C, S, 8) of vectors p (C, S, 3).

    `factor` is kappa, `noise` is A, `weight` is w, each (C, S), in units of the motion's scale.
    """
    laid = np.empty((*value.shape[:2], 8))
    factor = np.where(known, factor, 0.0)
    laid[..., :3] = -2 * factor[..., None] * value
    laid[..., 7] = np.where(known, noise, 0.0)
    laid[..., 3] = factor * (value**2).sum(axis=-1) + laid[..., 7]
    laid[..., 4] = factor
    laid[..., 5] = np.where(known, weight, 0.0)
    laid[..., 6] = 1.0
    return laid


def unlikelihood(rows: Array, columns: Array, nu: float, *, noisy: bool) -> Array:
    """Return minus the log-likelihood of all pairs (S, N), summed over the C channels; zero at best.

    `noisy` is whether any variance is not zero.
    """
    with np.errstate(over="ignore"):
        G = np.prod(rows[..., :7] @ columns, axis=0)
        cost = np.log(np.maximum(G, 1.0, out=G), out=G)
        cost *= (nu + 3) / 2
        if noisy:
            H = np.prod(rows[..., [7, 5, 6]] @ columns[:, [3, 5, 6]], axis=0)
            cost -= (nu + 2) / 2 * np.log(np.maximum(H, 1.0, out=H), out=H)
    return np.asarray(np.maximum(cost, 0.0, out=cost))
