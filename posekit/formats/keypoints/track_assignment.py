"""Assign rows to columns such that the sum is least, without SciPy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array


def assign(cost: Array) -> NDArray[np.intp]:
    """Find for each row its own column, with the least sum of costs: shortest augmenting paths.

    Every row takes the cheapest column; where that is taken, the path of exchanges that costs least is found, as
    Dijkstra's algorithm does, on costs reduced by prices (Jonker & Volgenant 1987, *Computing* 38:325-340). A row whose
    column is free costs one pass over the columns.

    Parameters
    ----------
    cost : array (R, C)
        Finite, with R not larger than C.

    Returns
    -------
    int array (R,)
        The column of each row.
    """
    rows, columns = cost.shape
    price_row, price = np.zeros(rows), np.zeros(columns)
    owner: NDArray[np.intp] = np.full(columns, -1, dtype=np.intp)
    for start in range(rows):
        shortest = np.full(columns, np.inf)
        before: NDArray[np.intp] = np.full(columns, -1, dtype=np.intp)
        done = np.zeros(columns, dtype=np.bool_)
        row, reached, column = start, 0.0, -1
        while True:
            way = reached + cost[row] - price_row[row] - price
            nearer = ~done & (way < shortest)
            shortest[nearer], before[nearer] = way[nearer], column
            column = int(np.argmin(np.where(done, np.inf, shortest)))
            reached = float(shortest[column])
            done[column] = True
            if owner[column] < 0:
                break
            row = int(owner[column])
        passed = done & (owner >= 0)
        price_row[owner[passed]] += reached - shortest[passed]
        price_row[start] += reached
        price[done] -= reached - shortest[done]
        while column >= 0:
            previous = int(before[column])
            owner[column] = owner[previous] if previous >= 0 else start
            column = previous
    taken = np.flatnonzero(owner >= 0)
    found: NDArray[np.intp] = np.empty(rows, dtype=np.intp)
    found[owner[taken]] = taken
    return found
