"""The ends of paths that are followed: where each came from, how fast it moves, what it cost so far."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.sequences.channels import N_CHANNELS


@dataclass(frozen=True, kw_only=True, eq=False)
class States:
    """S ends of paths; what is carried is of the last frames in which a channel was known.

    Parameters
    ----------
    cost : array (S,)
        Of the path so far.
    group : int array (S,)
        Equal where the last survivor is the same: from there on only the velocity differs. -1 before the first.
    fresh : bool array (S,)
        Whether the path went through a survivor that no better path uses.
    position : array (27, S, 3)
        The channels' last values, camera frame.
    time : array (27, S)
        When that was, seconds; NaN where a channel was never known.
    variance : array (27, S)
    velocity : array (27, S, 3)
        Arriving there.
    interval : array (27, S)
        Seconds over which it was taken; NaN where there is none.
    earlier_variance : array (27, S)
        Of the position at the interval's start.
    """

    cost: Array
    group: NDArray[np.int64]
    fresh: NDArray[np.bool_]
    position: Array
    time: Array
    variance: Array
    velocity: Array
    interval: Array
    earlier_variance: Array

    @staticmethod
    def start() -> States:
        """Return the one state before the first frame: no path yet."""
        none = np.full((N_CHANNELS, 1), np.nan)
        return States(
            cost=np.zeros(1),
            group=np.full(1, -1, dtype=np.int64),
            fresh=np.zeros(1, dtype=np.bool_),
            position=np.zeros((N_CHANNELS, 1, 3)),
            time=none,
            variance=np.zeros((N_CHANNELS, 1)),
            velocity=np.zeros((N_CHANNELS, 1, 3)),
            interval=none,
            earlier_variance=np.zeros((N_CHANNELS, 1)),
        )

    def __len__(self) -> int:
        """Count the states."""
        return len(self.cost)

    def take(self, rows: NDArray[np.intp]) -> States:
        """Return some states, by index."""
        return States(
            **{
                item.name: getattr(self, item.name)[rows]
                if getattr(self, item.name).ndim == 1
                else getattr(self, item.name)[:, rows]
                for item in fields(self)
            }
        )

    @staticmethod
    def join(first: States, second: States) -> States:
        """Put the states of two together."""
        return States(
            **{
                item.name: np.concatenate(
                    [getattr(first, item.name), getattr(second, item.name)],
                    axis=0 if getattr(first, item.name).ndim == 1 else 1,
                )
                for item in fields(first)
            }
        )
