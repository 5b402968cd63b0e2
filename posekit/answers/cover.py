"""Choosing few postures, or places of a joint, that stand for many."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array


def cover(
    points: Array, group: NDArray[np.intp], weight: Array, *, within: float, hold: Array | float
) -> NDArray[np.intp]:
    """Let the likeliest of each group stand for all that are near it, then the likeliest of the others, and so on.

    All groups are covered at once: a round costs what is left in them.

    Parameters
    ----------
    points : array (N, P, 3)
        Metres; NaN where a point is not known, which is then nowhere apart.
    group : int array (N,)
        Whose it is, zero or more.
    weight : array (N,)
        Probabilities; over a group they sum to one.
    within : float
        Metres: as far apart may a point of two be of which one stands for the other.
    hold : array (G,) or float
        A group is done when so much of its probability is covered.

    Returns
    -------
    int array (N,)
        Who stands for each, a row; -1 for those that were left when the group was done.
    """
    stands = np.full(len(points), -1, dtype=np.intp)
    if not len(points):
        return stands
    missing = np.zeros(int(group.max()) + 1)
    np.add.at(missing, group, weight)
    enough = (1.0 - hold) * missing
    left = np.lexsort((-weight, group))
    parts = _widest_first(points)
    while len(left):
        own = group[left]
        first = np.flatnonzero(np.diff(own, prepend=-1))
        centre = np.repeat(left[first], np.diff(first, append=len(left)))
        near = np.ones(len(left), dtype=np.bool_)
        for part in parts:
            apart = ((part[left[near]] - part[centre[near]]) ** 2).sum(axis=-1)
            near[near] = ~(apart > within**2).any(axis=1)  # NaN is not
        stands[left[near]] = centre[near]
        np.subtract.at(missing, own[near], weight[left[near]])
        left = left[~near & (missing[own] > enough[own])]
    return stands


def _widest_first(points: Array) -> list[Array]:
    """Split points (N, P, 3) into those two that are farthest about, which tell most apart, and the others."""
    about = np.nan_to_num(np.fmax.reduce(points, axis=0) - np.fmin.reduce(points, axis=0)).max(axis=-1)
    order = np.argsort(-about)
    return [np.ascontiguousarray(points[:, some]) for some in (order[:2], order[2:]) if len(some)]


def held_by(stands: NDArray[np.intp], weight: Array) -> Array:
    """Add up the probability (N,) that each row holds, by who stands for whom (`cover`)."""
    held = np.zeros(len(stands))
    np.add.at(held, stands[stands >= 0], weight[stands >= 0])
    return held


def most_held(held: Array, enough: float) -> NDArray[np.intp]:
    """Return the rows that hold most, the first of them most, as few as hold enough together."""
    rows = np.argsort(-held, kind="stable")
    before = np.cumsum(held[rows]) - held[rows]
    return rows[(before < enough - SUM_ROUNDING) & (held[rows] > 0)]


SUM_ROUNDING: Final = 1e-9
"""Of sums of probabilities."""
