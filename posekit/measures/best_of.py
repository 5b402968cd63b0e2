"""The best of N answers, with N."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from posekit.errors import InputError


@dataclass(frozen=True, kw_only=True)
class BestOf:
    """The smallest error among N answers. It falls as N grows, so it means nothing without N.

    Parameters
    ----------
    error : float
        The smallest.
    index : int
        Whose it is: the first, where several have it.
    n : int
        N, all answers that were given.
    unmeasured : int
        How many of them have no error (NaN).
    """

    error: float
    index: int
    n: int
    unmeasured: int = 0

    def __str__(self) -> str:
        """Write the error with its N."""
        return f"{self.error:g} (best of {self.n})"


def best_of(errors: ArrayLike) -> BestOf:
    """Choose the smallest of N errors.

    Parameters
    ----------
    errors : array (N,)
        One an answer, in any unit; NaN where it could not be measured.

    Raises
    ------
    InputError
        Where there are no answers, or none was measured.
    """
    given = np.asarray(errors, dtype=np.float64)
    if given.ndim != 1:
        raise InputError(f"errors has shape {given.shape}; expected (N,), one an answer")
    if len(given) == 0:
        raise InputError(
            "best of 0 answers: there is none to choose; count the frames without an answer instead"
        )
    measured = ~np.isnan(given)
    if not measured.any():
        raise InputError(f"none of the {len(given)} answers has an error; all are NaN")
    index = int(np.nanargmin(given))
    return BestOf(error=float(given[index]), index=index, n=len(given), unmeasured=int((~measured).sum()))
