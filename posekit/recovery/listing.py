"""Which whole bodies of a set are listed: the likeliest, until they hold the share of the probability that is asked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array

Score = Callable[[Array, Array, NDArray[np.intp]], Array]
"""Log-probabilities (N,), but for a constant of each frame, of postures (N, 14, 3) with a chi2 (N,) in frames (N,)."""


@dataclass(frozen=True, kw_only=True)
class BodyListing:
    """How much of the probability of each frame is listed.

    Parameters
    ----------
    coverage : float
        The share of the probability that listed bodies hold at least; 1 lists all.
    score : callable
        The logarithm of each body's probability, but for a constant of its frame.
    """

    coverage: float
    score: Score

    @property
    def all(self) -> bool:
        """Whether every body is listed."""
        return self.coverage >= 1.0


def likeliest(mass: Array, group: NDArray[np.intp], spare: Array) -> NDArray[np.bool_]:
    """Choose the likeliest bodies (N,) of each group, so that what is left weighs no more than may be spared (G,).

    What weighs nothing is never chosen; equals are chosen together.
    """
    order = np.lexsort((mass, group))
    ends = np.cumsum(mass[order])
    begin = np.searchsorted(group[order], np.arange(len(spare)))
    before = np.concatenate([[0.0], ends])[begin]
    left = ends - before[group[order]]  # of each body and those that weigh less
    chosen = np.zeros(len(mass), dtype=np.bool_)
    chosen[order] = left > spare[group[order]]
    least = np.full(len(spare), np.inf)
    np.minimum.at(least, group[chosen], mass[chosen])
    return np.asarray((mass >= least[group]) & (mass > 0))
