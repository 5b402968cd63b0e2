"""The rotation that lays points onto others best."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from posekit.geometry.arrays import Array


class CentredCovariance(NamedTuple):
    """Two sets of weighted points about their means, and how they vary together.

    Attributes
    ----------
    mean_x, mean_y : array (..., 3)
        The weighted means.
    x, y : array (..., P, 3)
        The points about them.
    covariance : array (..., 3, 3)
        The weighted sum of y x^T.
    """

    mean_x: Array
    mean_y: Array
    x: Array
    y: Array
    covariance: Array


def centred_covariance(x: Array, y: Array, weights: Array) -> CentredCovariance:
    """Centre points x and y (..., P, 3) of weights (..., P) and return their covariance; finite numbers only."""
    total = np.maximum(weights.sum(axis=-1), 1e-12)[..., None]  # no weight at all: means of zero
    mean_x, mean_y = (np.einsum("...k,...ki->...i", weights, each) / total for each in (x, y))
    x, y = x - mean_x[..., None, :], y - mean_y[..., None, :]
    covariance = np.einsum("...ki,...kj->...ij", weights[..., None] * y, x)
    return CentredCovariance(mean_x, mean_y, x, y, covariance)


def best_rotation(matrix: Array) -> tuple[Array, Array]:
    r"""Return the rotations nearest to matrices: they maximise :math:`tr(R^T M)`.

    With :math:`M = U D V^T` the singular value decomposition, :math:`R = U S V^T` where
    :math:`S = diag(1, 1, \det U V^T)` keeps R from being a reflection (Kabsch 1976, Acta Cryst. A32; Umeyama 1991, IEEE
    Trans. PAMI 13(4), eqs. 40-43). For a covariance :math:`\sum_p y_p x_p^T` it turns the x onto the y with the least
    squared distance; for a rotation that was rounded it is its polar factor (Higham 1989).

    Parameters
    ----------
    matrix : array (..., 3, 3)
        M.

    Returns
    -------
    rotation : array (..., 3, 3)
        R; NaN where M is.
    values : array (..., 3)
        The diagonal of D S: singular values in descending order, the last negative where M mirrors. The rotation is
        the only best one where the last two add up to more than zero.
    """
    known = np.asarray(np.isfinite(matrix).all(axis=(-2, -1)))
    if not known.any():
        return np.full(matrix.shape, np.nan), np.full(matrix.shape[:-1], np.nan)
    U, values, Vt = np.linalg.svd(np.where(known[..., None, None], matrix, 0.0))
    sign = np.sign(np.linalg.det(U @ Vt))
    U[..., 2] *= sign[..., None]
    values[..., 2] *= sign
    return (
        np.where(known[..., None, None], U @ Vt, np.nan),
        np.where(known[..., None], values, np.nan),
    )


def fit_rotation(offsets: Array, turned: Array) -> Array:
    r"""Return the rotations that turn rigid offsets into others best: least :math:`\sum_p |y_p - R x_p|^2`.

    Parameters
    ----------
    offsets : array (P, 3)
        The x, in the body's frame.
    turned : array (N, P, 3)
        The y, the same in the camera frame.

    Returns
    -------
    array (N, 3, 3)
        NaN where a turned offset is NaN.
    """
    return best_rotation(np.einsum("npi,pj->nij", turned, offsets))[0]
