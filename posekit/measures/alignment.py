"""The similarity that lays one set of points onto another best (Umeyama 1991)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import InputError
from posekit.geometry import Array, best_rotation, centred_covariance
from posekit.measures.pairs import paired

LEAST_POINTS = 3
"""Any two points are laid onto any two others without error: below three there is nothing to measure."""

NO_EXTENT = 1e-12
"""Spread of a set, over its distance from the origin, below which all its points are one."""

COLLINEAR_GAP = 1e-9
"""Gap between singular values, over the largest, below which the best rotation is not the only one."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Alignment:
    r"""Similarities :math:`x \mapsto c\,R\,x + t` that lay N sets of points onto their targets.

    Parameters
    ----------
    rotation : array (..., 3, 3)
        R, proper: never a reflection. NaN where nothing can be aligned.
    translation : array (..., 3)
        t, in the target's unit.
    scale : array (...)
        c; one where the alignment is rigid.
    used : int array (...)
        How many points both sets know, and the fit used.
    left_out : int array (...)
        How many it did not.
    unique : bool array (...)
        Whether the rotation is the only best one. It is not for collinear points, nor for some mirror images; the
        residual is the same for all.
    """

    rotation: Array
    translation: Array
    scale: Array
    used: NDArray[np.int64]
    left_out: NDArray[np.int64]
    unique: NDArray[np.bool_]

    def __post_init__(self) -> None:
        for name in ("rotation", "translation", "scale", "used", "left_out", "unique"):
            values = np.array(getattr(self, name))
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    def apply(self, points: ArrayLike) -> Array:
        """Lay points (..., P, 3) onto the target: NaN where they are not known, or nothing was aligned."""
        turned = np.einsum("...ij,...pj->...pi", self.rotation, np.asarray(points, dtype=np.float64))
        aligned: Array = self.scale[..., None, None] * turned + self.translation[..., None, :]
        return aligned


def align(points: ArrayLike, target: ArrayLike, *, scale: bool = True) -> Alignment:
    r"""Find the similarity that minimises the squared distance of points from their targets.

    .. math:: \min_{c, R, t} \sum_p |y_p - (c R x_p + t)|^2

    With :math:`U D V^T` the singular value decomposition of :math:`\sum_p y_p x_p^T` about the means,
    :math:`R = U S V^T`, :math:`c = tr(D S) / \sum_p |x_p|^2` and
    :math:`S = diag(1, 1, \det U \det V)`, which keeps R from being a reflection (Umeyama 1991, IEEE Trans. PAMI
    13(4), eqs. 40-43).

    Parameters
    ----------
    points, target : array (..., P, 3)
        Corresponding points, in one unit; NaN where a point is not known. Leading axes broadcast.
    scale : bool
        Fit c too; else it is one: the rigid alignment.

    Returns
    -------
    Alignment
        NaN where fewer than three points are known in both sets, or all of either set are in one place.

    Raises
    ------
    InputError
        Where the shapes do not go together, or a coordinate is infinite.
    """
    if not isinstance(scale, bool):
        raise InputError(f"scale is {scale!r}; expected True (similarity) or False (rigid)")
    x, y, known = paired(points, target)
    used = known.sum(axis=-1)
    weights = known / np.maximum(used, 1)[..., None]
    x, y = (np.where(known[..., None], each, 0.0) for each in (x, y))
    fit = centred_covariance(x, y, weights)
    spread_x, spread_y = ((weights[..., None] * each**2).sum(axis=(-2, -1)) for each in (fit.x, fit.y))
    possible = used >= LEAST_POINTS
    for spread, mean in ((spread_x, fit.mean_x), (spread_y, fit.mean_y)):
        possible &= np.sqrt(spread) > NO_EXTENT * np.linalg.norm(mean, axis=-1)
    R, values = best_rotation(fit.covariance)
    c = values.sum(axis=-1) / np.where(possible, spread_x, 1.0) if scale else np.ones_like(spread_x)
    c = np.where(possible, c, np.nan)
    R = np.where(possible[..., None, None], R, np.nan)
    t = fit.mean_y - c[..., None] * np.einsum("...ij,...j->...i", R, fit.mean_x)
    return Alignment(
        rotation=R,
        translation=t,
        scale=c,
        used=used,
        left_out=known.shape[-1] - used,
        unique=possible & (values[..., 1] + values[..., 2] > COLLINEAR_GAP * values[..., 0]),
    )
