"""Two sets of corresponding points, broadcast against each other, with what both know."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import InputError
from posekit.geometry import Array


def paired(points: ArrayLike, target: ArrayLike) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Broadcast two sets of points, and tell which points both know.

    Parameters
    ----------
    points, target : array (..., P, 3)
        Corresponding points, in one unit; NaN where a point is not known. Leading axes broadcast.

    Returns
    -------
    points, target : array (..., P, 3)
    known : bool array (..., P)

    Raises
    ------
    InputError
        Where the shapes do not go together, or a coordinate is infinite.
    """
    a, b = (np.asarray(given, dtype=np.float64) for given in (points, target))
    for name, given in (("points", a), ("target", b)):
        if given.ndim < 2 or given.shape[-1] != 3:
            raise InputError(f"{name} has shape {given.shape}; expected (..., P, 3), x y z of P points")
        if np.isinf(given).any():
            raise InputError(
                f"{name} has an infinite coordinate; expected finite numbers, or NaN where unknown"
            )
    if a.shape[-2] != b.shape[-2]:
        raise InputError(
            f"points has {a.shape[-2]} points and target {b.shape[-2]}; expected the same points in both"
        )
    try:
        shape = np.broadcast_shapes(a.shape, b.shape)
    except ValueError as error:
        raise InputError(
            f"points {a.shape} and target {b.shape} do not broadcast; give one target, or one a posture"
        ) from error
    a, b = np.broadcast_to(a, shape), np.broadcast_to(b, shape)
    unknown: NDArray[np.bool_] = np.logical_or.reduce(np.isnan(a) | np.isnan(b), axis=-1)
    return a, b, ~unknown
