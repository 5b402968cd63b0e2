"""Which ends of paths are followed while searching."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.geometry import Array


@dataclass(frozen=True, kw_only=True)
class Beam:
    """Which ends of paths are followed.

    Parameters
    ----------
    width : int
        How many at most. As long as no path has a velocity, all survivors of a frame are followed.
    slack : float
        None whose cost is more than this above the cheapest.
    survivors : int
        How many survivors of a frame are looked at, those that cost least.

    Raises
    ------
    InputError
        Where one of them is impossible.
    """

    width: int = 1024
    slack: float = 60.0
    survivors: int = 4096

    def __post_init__(self) -> None:
        for name in ("width", "survivors"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise InputError(f"beam: {name} is {value!r}; expected a whole number, one or more")
        if not self.slack >= 0:
            raise InputError(f"beam: slack is {self.slack!r}; expected zero or more")

    def cheapest(self, own: Array) -> tuple[NDArray[np.intp], float]:
        """Choose among survivors by what they cost themselves (N,): which, and the cheapest cost that was not."""
        possible = np.flatnonzero(np.isfinite(own))
        if len(possible) <= self.survivors:
            return possible, np.inf
        order = possible[np.argsort(own[possible], kind="stable")]
        return np.sort(order[: self.survivors]), float(own[order[self.survivors]])

    def keep(
        self, cost: Array, fresh: NDArray[np.bool_], *, least: int = 0
    ) -> tuple[NDArray[np.intp], float]:
        """Choose among ends of paths, the fresh ones by themselves.

        Parameters
        ----------
        cost : array (S,)
            Of each path so far, infinite for one that is not to be followed.
        fresh : bool array (S,)
            Those that are compared with each other only: a dearer path that goes elsewhere is not to be crowded out.
        least : int
            How many may be kept of each kind, even where the beam is narrower.

        Returns
        -------
        kept : int array
            Ascending.
        dropped : float
            The cheapest cost that was not kept; infinite if all were.
        """
        kept, dropped = [], np.inf
        # Fresh paths are compared among themselves: they are dearer than the best path, and would be crowded out.
        for kind in (False, True):
            rows = np.flatnonzero(fresh == kind)
            if not len(rows):
                continue
            near = cost[rows] <= cost[rows].min() + self.slack
            dropped = min(dropped, float(cost[rows][~near].min(initial=np.inf)))
            rows = rows[near & np.isfinite(cost[rows])]
            width = max(self.width, least)
            if len(rows) > width:
                # The element at `width` is in its sorted place: the cheapest of those that are dropped.
                order = np.argpartition(cost[rows], width)
                dropped = min(dropped, float(cost[rows[order[width]]]))
                rows = rows[order[:width]]
            kept.append(rows)
        return np.sort(np.concatenate(kept)) if kept else np.empty(0, dtype=np.intp), dropped
