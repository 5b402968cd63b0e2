"""Which rows of a table are the same, and which entries of two."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array


def distinct(table: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Find rows (N, K) that are equal to the last bit.

    Rows are told apart by one number each, a fixed mixture of their entries, and then compared. Rows that differ by the
    last bit alone, as where both ends of a segment are tangent to a ray, may share that number: then they are sorted.

    Returns
    -------
    one : int array (U,)
        A row of each kind.
    which : int array (N,)
        The kind of each row.
    """
    filled = np.where(np.isnan(table), NAN_SUBSTITUTE, table)
    # Not a product of matrices: that adds up some rows in another order than others, so that equal rows would differ.
    mixture = (filled * _weights(table.shape[1])).sum(axis=1)
    _, one, which = np.unique(mixture, return_index=True, return_inverse=True)
    if not (filled[one[which.ravel()]] == filled).all():
        _, one, which = np.unique(filled, axis=0, return_index=True, return_inverse=True)
    return one, which.ravel()


def equal_pairs(left: NDArray[np.intp], right: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pair each entry of the one with all equal entries of the other, in order: the places of both."""
    order = np.argsort(right, kind="stable")
    begin = np.searchsorted(right[order], left)
    count = np.searchsorted(right[order], left, side="right") - begin
    row = np.repeat(np.arange(len(left)), count)
    within = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    return row, order[begin[row] + within]


@cache
def _weights(count: int) -> Array:
    """Return the mixture of so many entries."""
    return np.random.default_rng(0).standard_normal(count)


NAN_SUBSTITUTE = -4321.0
"""Stands for NaN, which equals nothing: no joint is there, and mixtures keep their digits."""
