"""Rotations and similarity transformations that align points, and distances between postures."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from posekit.geometry.vectors import Array, Flags, Ints

#: Minimum number of known points for an alignment: any two points align exactly with any other two.
MIN_ALIGNED_POINTS: Final = 3

#: Ratio of a point set's spread to its mean's distance from the origin; below it all points coincide.
NO_EXTENT: Final = 1e-12


def best_rotation(matrix: Array) -> tuple[Array, Array]:
    r"""Return the rotations R nearest to 3 x 3 matrices M: they maximise :math:`tr(R^T M)`.

    With :math:`M = U D V^T` the singular value decomposition, :math:`R = U S V^T` where :math:`S = diag(1, 1, \det U
    V^T)` ensures that R is no reflection (Kabsch 1976, Acta Cryst. A32; Umeyama 1991, IEEE Trans. PAMI 13(4), eqs.
    40-43). If M is the covariance :math:`\sum_p y_p x_p^T`, R rotates points x onto points y with the least sum of
    squared distances. If M is a rotation matrix with rounding errors, R is its orthogonal polar factor (Higham 1989).

    Parameters
    ----------
    matrix : array (..., 3, 3)
        The matrices M.

    Returns
    -------
    rotation : array (..., 3, 3)
        R; NaN if M has a NaN.
    values : array (..., 3)
        The diagonal of D S: singular values in descending order; the last is negative if det M < 0. The best rotation
        is unique if the sum of the last two values is positive.
    """
    known = np.asarray(np.isfinite(matrix).all(axis=(-2, -1)))
    if not known.any():
        return np.full(matrix.shape, np.nan), np.full(matrix.shape[:-1], np.nan)
    U, values, Vt = np.linalg.svd(np.where(known[..., None, None], matrix, 0.0))
    sign = np.sign(np.linalg.det(U @ Vt))
    U[..., 2] *= sign[..., None]
    values[..., 2] *= sign
    rotation = np.where(known[..., None, None], U @ Vt, np.nan)
    return rotation, np.where(known[..., None], values, np.nan)


def fit_rotation(offsets: Array, turned: Array) -> Array:
    r"""Return the rotations R that best map rigid offsets x to vectors y: they minimise :math:`\sum_p |y_p - R x_p|^2`.

    Parameters
    ----------
    offsets : array (P, 3)
        The offsets x, in the frame of the rigid object.
    turned : array (N, P, 3)
        The vectors y: the same offsets in the camera frame.

    Returns
    -------
    array (N, 3, 3)
        R; NaN if one of the vectors y is NaN.
    """
    return best_rotation(np.einsum("npi,pj->nij", turned, offsets))[0]


class Alignment(NamedTuple):
    r"""Similarity transformations :math:`x \mapsto c\,R\,x + t`.

    Attributes
    ----------
    rotation : array (..., 3, 3)
        R, never a reflection; NaN if the points cannot be aligned.
    translation : array (..., 3)
        t, in the target's unit.
    scale : array (...)
        c; one in a rigid alignment.
    """

    rotation: Array
    translation: Array
    scale: Array

    def apply(self, points: ArrayLike) -> Array:
        """Map points (..., P, 3) onto the target; NaN for unknown points, or if no alignment was found."""
        turned = np.einsum("...ij,...pj->...pi", self.rotation, np.asarray(points, dtype=np.float64))
        return np.asarray(self.scale[..., None, None] * turned + self.translation[..., None, :])


def align(points: ArrayLike, target: ArrayLike, *, scale: bool = True) -> Alignment:
    r"""Find the similarity transformation that minimises the squared distances of points from their targets.

    .. math:: \min_{c, R, t} \sum_p |y_p - (c R x_p + t)|^2

    R, D and S are those of `best_rotation` for the covariance of y and x about their means. The scale is :math:`c =
    tr(D S) / \sum_p |x_p|^2`, with x relative to its mean (Umeyama 1991, IEEE Trans. PAMI 13(4), eqs. 40-43).

    Parameters
    ----------
    points, target : array (..., P, 3)
        Corresponding points, in one unit; NaN marks an unknown point. Leading axes broadcast.
    scale : bool
        Whether the scale c is fitted; otherwise c = 1 (rigid alignment).

    Returns
    -------
    Alignment
        NaN if fewer than three points are known in both sets, or if all points of either set coincide.
    """
    x, y, known = _paired(points, target)
    used = known.sum(axis=-1)
    weights = known / np.maximum(used, 1)[..., None]
    x, y = (np.where(known[..., None], each, 0.0) for each in (x, y))
    mean_x, mean_y = (np.einsum("...k,...ki->...i", weights, each) for each in (x, y))
    x, y = x - mean_x[..., None, :], y - mean_y[..., None, :]
    spread_x, spread_y = ((weights[..., None] * each**2).sum(axis=(-2, -1)) for each in (x, y))
    possible = used >= MIN_ALIGNED_POINTS
    for spread, mean in ((spread_x, mean_x), (spread_y, mean_y)):
        possible &= np.sqrt(spread) > NO_EXTENT * np.linalg.norm(mean, axis=-1)
    R, values = best_rotation(np.einsum("...ki,...kj->...ij", weights[..., None] * y, x))
    c = values.sum(axis=-1) / np.where(possible, spread_x, 1.0) if scale else np.ones_like(spread_x)
    c = np.where(possible, c, np.nan)
    R = np.where(possible[..., None, None], R, np.nan)
    return Alignment(R, mean_y - c[..., None] * np.einsum("...ij,...j->...i", R, mean_x), c)


def mpjpe(points: ArrayLike, target: ArrayLike) -> Array:
    r"""Return the mean per-joint position error: the mean of P distances, :math:`\sum_p d_p / P` (Ionescu 2014, §5.1).

    Parameters
    ----------
    points, target : array (..., P, 3)
        Measured and true points, in one unit; points that are NaN in either set are left out.

    Returns
    -------
    array (...)        In the unit of the points; NaN if no point is known in both sets.
    """
    return mean_known(np.sqrt(_squared(*_paired(points, target))))


def pa_mpjpe(points: ArrayLike, target: ArrayLike, *, scale: bool = True) -> Array:
    """Return the mean per-joint position error after `align` ("Procrustes aligned"); parameters as for `mpjpe`."""
    return mpjpe(align(points, target, scale=scale).apply(points), target)


def rms_distance(points: ArrayLike, target: ArrayLike, *, aligned: bool = True) -> Array:
    r"""Return the root mean square distance between corresponding points, :math:`\sqrt{\sum_p d_p^2 / P}`.

    By default, the points are first aligned by "the rotation, translation and scale factor that best aligned the two
    data sets" (Taylor 2000, §3.2). Parameters are those of `mpjpe`.
    """
    if aligned:
        points = align(points, target).apply(points)
    return np.sqrt(mean_known(_squared(*_paired(points, target))))


def _paired(points: ArrayLike, target: ArrayLike) -> tuple[Array, Array, Flags]:
    """Broadcast two sets of points; return both, and whether each point (..., P) is known in both."""
    x, y = np.broadcast_arrays(np.asarray(points, dtype=np.float64), np.asarray(target, dtype=np.float64))
    return x, y, np.isfinite(x).all(axis=-1) & np.isfinite(y).all(axis=-1)


def _squared(x: Array, y: Array, known: Flags) -> Array:
    return np.where(known, ((x - y) ** 2).sum(axis=-1), np.nan)


def mean_known(values: Array) -> Array:
    """Return the mean (...) of the known entries along the last axis; NaN if no entry is known."""
    known = ~np.isnan(values)
    count = known.sum(axis=-1)
    total = np.where(known, values, 0.0).sum(axis=-1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def known_median(values: Array | Ints) -> float:
    """Return the median of an array's known numbers; NaN if no number is known."""
    known = np.sort(values[np.isfinite(values)])
    # NumPy's median would load numpy.ma.
    return float(known[(len(known) - 1) // 2] + known[len(known) // 2]) / 2 if len(known) else np.nan
