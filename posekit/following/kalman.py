"""Where a body's joints are and how fast they move, as far as what was measured says (Kalman 1960).

Each joint moves with a random acceleration, white noise of the spectral density q, and is measured in all three
coordinates with a covariance (R. E. Kalman 1960, "A new approach to linear filtering and prediction problems", J. Basic
Eng. 82:35-45, equations 21 to 25).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.geometry import Array

ACCELERATION_CORRELATION_SECONDS: Final = 0.05
"""Seconds over which an acceleration lasts: q is its square times this."""

MIN_DEVIATION_METRES: Final = 1e-4
"""The least standard deviation that a joint is given, metres: nothing is known better."""

START_SPEED: Final = 1.5
"""Metres a second: the standard deviation of each coordinate of a velocity of which nothing is known yet."""


def density_of(acceleration: ArrayLike) -> Array:
    """Return the spectral density of the random acceleration of each joint, square metres a second cubed."""
    return ACCELERATION_CORRELATION_SECONDS * np.asarray(acceleration, dtype=np.float64) ** 2


@dataclass(frozen=True, kw_only=True, eq=False)
class MovingJoints:
    """The joints of S bodies in motion.

    Parameters
    ----------
    place, velocity : array (S, 14, 3)
        Camera frame, metres, metres a second.
    of_place, of_both, of_velocity : array (S, 14, 3, 3)
        The blocks of their covariance; `of_both` has the places in its rows.
    known : bool array (S, 14)
        Which joints were measured.
    since : array (S, 14)
        Seconds since that was last done.
    """

    place: Array
    velocity: Array
    of_place: Array
    of_both: Array
    of_velocity: Array
    known: NDArray[np.bool_]
    since: Array

    @staticmethod
    def measured(joints: Array, covariance: Array, known: NDArray[np.bool_]) -> MovingJoints:
        """Begin with what is measured (S, 14, ...); nothing is known of velocities."""
        at_rest = np.broadcast_to(START_SPEED**2 * np.eye(3), covariance.shape)
        return MovingJoints(
            place=joints,
            velocity=np.zeros_like(joints),
            of_place=covariance,
            of_both=np.zeros_like(covariance),
            of_velocity=at_rest,
            known=known,
            since=np.zeros(known.shape),
        )

    def __len__(self) -> int:
        """Count the bodies."""
        return len(self.place)

    def take(self, rows: NDArray[np.intp]) -> MovingJoints:
        """Return some, by index."""
        return MovingJoints(**{item.name: getattr(self, item.name)[rows] for item in fields(self)})

    @staticmethod
    def joined(first: MovingJoints, second: MovingJoints) -> MovingJoints:
        """Put two together."""
        return MovingJoints(
            **{
                item.name: np.concatenate([getattr(first, item.name), getattr(second, item.name)])
                for item in fields(first)
            }
        )

    def after(self, seconds: float, density: Array) -> MovingJoints:
        """Let time pass."""
        noise = density[:, None, None] * np.eye(3)
        both = self.of_both + seconds * self.of_velocity
        grown = self.of_both + self.of_both.swapaxes(-1, -2) + seconds * self.of_velocity
        return MovingJoints(
            place=self.place + seconds * self.velocity,
            velocity=self.velocity,
            of_place=self.of_place + seconds * grown + noise * (seconds**3 / 3),
            of_both=both + noise * (seconds**2 / 2),
            of_velocity=self.of_velocity + noise * seconds,
            known=self.known,
            since=self.since + seconds,
        )

    def given(self, joints: Array, covariance: Array, known: NDArray[np.bool_]) -> MovingJoints:
        """Learn of each body what is measured (S, 14, ...): what is measured first begins, what is not goes on."""
        both = (self.known & known)[..., None]
        total = np.where(both[..., None], self.of_place + covariance, np.eye(3))
        inverse = np.linalg.inv(total)
        place_gain = np.where(both[..., None], self.of_place @ inverse, 0.0)
        velocity_gain = np.where(both[..., None], self.of_both.swapaxes(-1, -2) @ inverse, 0.0)
        off = np.where(both, joints - self.place, 0.0)[..., None]
        new = MovingJoints.measured(joints, covariance, known)
        learnt = MovingJoints(
            place=self.place + (place_gain @ off)[..., 0],
            velocity=self.velocity + (velocity_gain @ off)[..., 0],
            of_place=_symmetric(self.of_place - place_gain @ self.of_place),
            of_both=self.of_both - place_gain @ self.of_both,
            of_velocity=_symmetric(self.of_velocity - velocity_gain @ self.of_both),
            known=self.known | known,
            since=np.where(known, 0.0, self.since),
        )
        first = known & ~self.known
        if not first.any():
            return learnt
        return MovingJoints(
            **{
                item.name: np.where(
                    first.reshape(*first.shape, *([1] * (getattr(new, item.name).ndim - 2))),
                    getattr(new, item.name),
                    getattr(learnt, item.name),
                )
                for item in fields(new)
            }
        )


def _symmetric(matrices: Array) -> Array:
    """Take off what rounding made of one side: what is not symmetric grows from frame to frame."""
    return np.asarray((matrices + matrices.swapaxes(-1, -2)) / 2)
