"""The ends of paths that are followed: where each came from, how fast it moves, what it cost so far."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.following.channels import N_CHANNELS, N_JOINTS
from posekit.geometry import Array


class Heading(NamedTuple):
    """Where the joints of S ends are at a time if they keep their velocities, and how hard it is to be elsewhere.

    Attributes
    ----------
    known : bool array (14, S)
        Whether there is a velocity.
    place : array (14, S, 3)
        Where each joint would be, camera frame, metres.
    weight : array (14, S)
        The square of the acceleration that a metre away is, per second squared.
    variance : array (14, S)
        Of the place.
    """

    known: NDArray[np.bool_]
    place: Array
    weight: Array
    variance: Array


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
        Of each coordinate of the position: square metres, square radians for directions.
    velocity : array (14, S, 3)
        Of the joints, arriving there.
    interval : array (14, S)
        Seconds over which it was taken; NaN where there is none.
    earlier_variance : array (14, S)
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
        return States(
            cost=np.zeros(1),
            group=np.full(1, -1, dtype=np.int64),
            fresh=np.zeros(1, dtype=np.bool_),
            position=np.zeros((N_CHANNELS, 1, 3)),
            time=np.full((N_CHANNELS, 1), np.nan),
            variance=np.zeros((N_CHANNELS, 1)),
            velocity=np.zeros((N_JOINTS, 1, 3)),
            interval=np.full((N_JOINTS, 1), np.nan),
            earlier_variance=np.zeros((N_JOINTS, 1)),
        )

    def __len__(self) -> int:
        """Count the states."""
        return len(self.cost)

    def heading(self, time: float) -> Heading:
        """Return where the joints are heading."""
        known = np.isfinite(self.interval)
        before = np.where(known, self.interval, 1.0)
        after = np.where(known, time - self.time[:N_JOINTS], 1.0)
        ratio = after / before
        return Heading(
            known=known,
            place=self.position[:N_JOINTS] + self.velocity * after[..., None],
            # The acceleration of `MotionModel` is 2 / (D1 + D2) times the change of velocity, and a metre away at the
            # later place changes the velocity by 1 / D2.
            weight=np.where(known, 2 / (after * (before + after)), 0.0) ** 2,
            variance=(1 + ratio) ** 2 * self.variance[:N_JOINTS] + ratio**2 * self.earlier_variance,
        )

    def take(self, rows: NDArray[np.intp]) -> States:
        """Return some states, by index."""
        return States(
            **{
                item.name: getattr(self, item.name)[rows]
                if getattr(self, item.name).ndim == 1
                else getattr(self, item.name).take(rows, axis=1)
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
