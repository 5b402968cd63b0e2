"""Which survivors, and which ends of paths, are looked at while searching."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.geometry import Array

TIED_COST: Final = 1e-9
"""Cost by which survivors that are as likely may differ by rounding."""


@dataclass(frozen=True, kw_only=True)
class Beam:
    """What is looked at while searching.

    Parameters
    ----------
    coverage : float
        Of a frame's survivors the likeliest that hold this share of the probability are looked at.
    survivors : int
        How many of them at most.
    width : int
        Paths are kept apart as long as there are no more; of more, those are merged that end in the same survivor.
    slack : float
        No end of a path is followed whose cost is more than this above the cheapest.

    Raises
    ------
    InputError
        Where one of them is impossible.
    """

    coverage: float = 0.95
    survivors: int = 128
    width: int = 64
    slack: float = 60.0

    def __post_init__(self) -> None:
        for name in ("survivors", "width"):
            count = getattr(self, name)
            if isinstance(count, bool) or not isinstance(count, int) or count < 1:
                raise InputError(f"beam: {name} is {count!r}; expected a whole number, one or more")
        if not 0 < self.coverage <= 1:
            raise InputError(f"beam: coverage is {self.coverage!r}; expected a share above 0, at most 1")
        if not self.slack >= 0:
            raise InputError(f"beam: slack is {self.slack!r}; expected zero or more")

    def likeliest(self, own: Array) -> tuple[NDArray[np.intp], float]:
        """Choose among survivors by what they cost (N,): which, ascending, and the cheapest cost that was not."""
        order = np.argsort(own, kind="stable")
        order = order[np.isfinite(own[order])]
        if not len(order):
            return order, np.inf
        held = np.cumsum(np.exp(own[order[0]] - own[order]))
        enough = len(order)
        if self.coverage < 1:
            last = min(int(np.searchsorted(held, self.coverage * held[-1])), len(order) - 1)
            # Of equally likely ones none is left out.
            enough = int(np.searchsorted(own[order], own[order[last]] + TIED_COST, side="right"))
        count = min(enough, self.survivors)
        left = float(own[order[count]]) if count < len(order) else np.inf
        return np.sort(order[:count]), left
