"""Arrays as a validator is given them, checked once."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import InputError
from posekit.geometry import Array

MAX_METRES: Final = 1e9
"""Metres: no body is there, and well beyond it squares overflow, to findings that are undecided."""


def sequence_of(given: ArrayLike, count: int) -> NDArray[np.intp]:
    """Make an array (N,) of which sequence each of so many postures belongs to, or refuse it.

    Parameters
    ----------
    given : array-like
        Whole numbers.
    count : int
        N.

    Raises
    ------
    InputError
        Where they are none, or not one a posture.
    """
    which = np.asarray(given)
    if which.shape != (count,) or which.dtype.kind not in "iu":
        raise InputError(f"sequence: {which.dtype} of shape {which.shape}; expected whole numbers ({count},)")
    return which.astype(np.intp)


def points_of(name: str, given: ArrayLike | None, count: int, postures: int | None = None) -> Array:
    """Make an array (N, count, 3) of what was given, or refuse it.

    Parameters
    ----------
    name : str
        What to call it.
    given : array-like
        Metres; NaN where unknown.
    count : int
        Points of a posture.
    postures : int, optional
        N, where it is known.

    Raises
    ------
    InputError
        Where the shape is another, or a coordinate is infinite or absurd.
    """
    expected = f"({'N' if postures is None else postures}, {count}, 3)"
    try:
        points = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: not an array of numbers; expected {expected}, metres") from error
    if points.ndim != 3 or points.shape[1:] != (count, 3) or postures not in (None, len(points)):
        raise InputError(f"{name}: the shape is {points.shape}; expected {expected}, metres")
    refuse_far(points, name)
    return points


def refuse_far(points: Array | None, name: str = "postures") -> None:
    """Refuse coordinates where no body is; NaN is unknown.

    Parameters
    ----------
    points : array, optional
        Metres.
    name : str
        What to call them.

    Raises
    ------
    InputError
        Where a coordinate is infinite or absurd.
    """
    far = np.zeros(0, dtype=np.bool_) if points is None else np.abs(points) > MAX_METRES
    if points is not None and far.any():
        raise InputError(
            f"{name}: a coordinate is {points[far][0]:g} m; expected finite ones within {MAX_METRES:g} m, "
            "NaN where unknown"
        )
