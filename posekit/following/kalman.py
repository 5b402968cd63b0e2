"""Kalman filter of joints with random acceleration (Kalman 1960), and the smoother of the filter.

The state of a joint is its position and velocity, and the acceleration is white noise of spectral density q. The filter
applies eqs. 21 to 25 of Kalman (1960, Journal of Basic Engineering 82:35-45) to each measured position and its
covariance. The smoother passes backward over the filtered frames (Rauch, Tung & Striebel 1965, AIAA Journal 3:1445) and
interpolates skipped frames.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array

#: Scale of the joints' accelerations, m/s^2: about the 75th to 90th percentile over basketball, soccer, jumping and
#: signals in the CMU Graphics Lab Motion Capture Database at 30 Hz.
ACCELERATION: Final = np.array([5.0] * 6 + [7.0, 7.0, 10.0, 10.0, 8.0, 8.0, 11.0, 11.0])

#: Spectral density q of each joint's random acceleration, m^2/s^3, for a correlation time of 0.05 s.
DENSITY: Final = 0.05 * ACCELERATION**2

#: Least variance of a measured coordinate, square metres.
LEAST_VARIANCE: Final = 1e-8

#: Standard deviation of each coordinate of an unknown velocity, m/s.
START_SPEED: Final = 1.5

#: Variance of a joint that was never measured, square metres.
UNKNOWN: Final = 1e4


class Moving(NamedTuple):
    """States of a Kalman filter for the joints of S bodies.

    Attributes
    ----------
    mean : array (S, 14, 6)
        Position and velocity, metres and metres per second.
    spread : array (S, 14, 6, 6)
        Their covariance.
    known : bool array (S, 14)
        Joints that were measured.
    since : array (S, 14)
        Seconds since the last measurement of each joint.
    """

    mean: Array
    spread: Array
    known: NDArray[np.bool_]
    since: Array

    @staticmethod
    def nothing(count: int) -> Moving:
        """Return the state of bodies whose positions and velocities are unknown."""
        spread = np.diag([UNKNOWN] * 3 + [START_SPEED**2] * 3)
        shape = (count, len(DENSITY))
        spreads, known = np.tile(spread, (*shape, 1, 1)), np.zeros(shape, dtype=bool)
        return Moving(np.zeros((*shape, 6)), spreads, known, np.zeros(shape))

    def take(self, rows: NDArray[np.intp]) -> Moving:
        """Return the selected bodies."""
        return Moving(self.mean[rows], self.spread[rows], self.known[rows], self.since[rows])

    def after(self, seconds: float) -> Moving:
        """Predict the state after a time, seconds."""
        F, noise = steps(seconds)
        spread = F @ self.spread @ F.T + DENSITY[:, None, None] * noise
        return Moving(self.mean @ F.T, spread, self.known, self.since + seconds)

    def given(self, joints: Array, covariance: Array) -> Moving:
        """Update the state with measured joints (S, 14, 3), NaN if unseen, and their covariances (S, 14, 3, 3)."""
        seen = np.asarray(np.isfinite(joints).all(axis=2))
        noise = covariance + LEAST_VARIANCE * np.eye(3)
        gain = self.spread[..., :3] @ np.linalg.inv(self.spread[..., :3, :3] + noise)
        gain = np.where(seen[..., None, None], gain, 0.0)
        off = np.where(seen[..., None], joints - self.mean[..., :3], 0.0)
        # Joseph's form keeps covariances symmetric and positive.
        keep = np.eye(6) - gain @ np.eye(3, 6)
        spread = keep @ self.spread @ keep.swapaxes(-1, -2) + gain @ noise @ gain.swapaxes(-1, -2)
        return Moving(
            self.mean + (gain @ off[..., None])[..., 0],
            spread,
            self.known | seen,
            np.where(seen, 0.0, self.since),
        )


def steps(seconds: float) -> tuple[Array, Array]:
    """Return the transition matrix over a time in seconds, and the process noise for a spectral density of one."""
    one, t = np.eye(3), seconds
    noise = np.array([[t**3 / 3, t**2 / 2], [t**2 / 2, t]])
    return np.kron(np.array([[1.0, t], [0.0, 1.0]]), one), np.kron(noise, one)


def smooth(time: Array, joints: Array, covariance: Array) -> Array:
    """Return the joints (T, 14, 3) of a smoothed path; NaN for a joint that is unknown in all frames.

    Parameters
    ----------
    time : array (T,)
        Seconds, ascending.
    joints : array (T, 14, 3)
        Metres; unknown joints (NaN) are interpolated.
    covariance : array (T, 14, 3, 3)
        Square metres.
    """
    body = Moving.nothing(1)
    ahead, after = [], []
    for k in range(len(time)):
        body = body.after(float(time[k] - time[k - 1])) if k else body
        ahead.append((body.mean[0], body.spread[0]))
        body = body.given(joints[None, k], covariance[None, k])
        after.append((body.mean[0], body.spread[0]))
    mean = after[-1][0]
    means = [mean]
    for k in range(len(time) - 2, -1, -1):
        F, _ = steps(float(time[k + 1] - time[k]))
        own, spread = after[k]
        back = np.linalg.solve(ahead[k + 1][1], F @ spread).swapaxes(-1, -2)
        mean = own + (back @ (mean - ahead[k + 1][0])[..., None])[..., 0]
        means.append(mean)
    never = np.asarray((~np.isfinite(joints).all(axis=2)).all(axis=0))
    return np.where(never[:, None], np.nan, np.stack(means[::-1])[..., :3])
