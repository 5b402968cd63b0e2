r"""The walking model of Boulic, Thalmann & Thalmann 1990, *The Visual Computer* 6:344-358.

Everything follows from the relative velocity v (leg lengths a second) and the phase t of the cycle. The
phase is the right side's: at t = 0 the right foot strikes; the left side is half a cycle later. Root
translations are in leg lengths.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.synthesis.monotone_cubic import PeriodicMonotoneCubic

MIN_RELATIVE_SPEED, MAX_RELATIVE_SPEED = 0.5, 1.3
"""The range of v of the hip, knee and elbow curves: mid gait. Faster is running, slower has other curves."""


class GaitAngles(NamedTuple):
    """The gait at phases of any shape (...).

    Attributes
    ----------
    vertical, lateral, fore_aft : array (...)
        Translation of the root (the pelvis): up from the height of the leg, to the left, and forward, in leg
        lengths.
    lean : array (...)
        How far the back flexes forward against the hips, radians: the model's pelvis tilt, its sign turned.
    torsion : array (...)
        How far the hips turn to the left, radians: positive brings the right hip forward. The printed angle
        counts the other way, for the hip of the leg that is in front is in front too.
    shoulder, elbow, hip, knee : array (..., 2)
        Flexion on the right and on the left, radians.
    """

    vertical: Array
    lateral: Array
    fore_aft: Array
    lean: Array
    torsion: Array
    shoulder: Array
    elbow: Array
    hip: Array
    knee: Array


@dataclass(frozen=True, kw_only=True)
class Gait:
    """Walking at one relative velocity.

    Parameters
    ----------
    velocity : float
        v, leg lengths a second, 0.5 to 1.3.

    Raises
    ------
    InputError
        Where v lies outside mid gait.

    Examples
    --------
    >>> gait = Gait(velocity=1.0)
    >>> gait.cycle_duration
    1.346
    >>> np.degrees(gait.angles([-0.1, 0.5]).hip[:, 0]).round(6).tolist()
    [25.0, -15.0]
    """

    velocity: float

    def __post_init__(self) -> None:
        if not MIN_RELATIVE_SPEED <= self.velocity <= MAX_RELATIVE_SPEED:
            raise InputError(
                f"the walker's velocity is {self.velocity:g} leg lengths/s; expected {MIN_RELATIVE_SPEED:g} to "
                f"{MAX_RELATIVE_SPEED:g}: slower and faster gaits follow other curves"
            )

    @property
    def cycle_length(self) -> float:
        """The way of one cycle, two steps: 1.346 sqrt(v) leg lengths."""
        return 1.346 * math.sqrt(self.velocity)

    @property
    def cycle_duration(self) -> float:
        """Seconds of one cycle."""
        return self.cycle_length / self.velocity

    @property
    def support_duration(self) -> float:
        """Seconds that a foot is on the ground in one cycle."""
        return 0.752 * self.cycle_duration - 0.143

    def angles(self, phase: ArrayLike) -> GaitAngles:
        """Evaluate the gait at phases (...); whole numbers are whole cycles."""
        t = np.asarray(phase, dtype=np.float64)
        v = self.velocity
        # The coefficients are the paper's; angles in degrees, translations in leg lengths.
        early = 0.625 - self.support_duration / self.cycle_duration
        sides = np.stack([t, t + 0.5], axis=-1)
        tilt = -2 + 2 * _wave(2 * t - 0.1)
        return GaitAngles(
            vertical=-0.015 * v + 0.015 * v * _wave(2 * t - 0.35),
            lateral=-0.032 * _wave(t - 0.1),
            fore_aft=-0.021 * _wave(2 * t + 2 * early),
            lean=np.radians(-tilt),
            torsion=np.radians(4 * v * np.cos(2 * np.pi * t)),
            shoulder=np.radians(3 - 4.94 * v - 9.88 * v * np.cos(2 * np.pi * sides)),
            elbow=np.radians(self._elbow(sides)),
            hip=np.radians(HIP_FLEXION(sides)),
            knee=np.radians(KNEE_FLEXION(sides)),
        )

    @cached_property
    def _elbow(self) -> PeriodicMonotoneCubic:
        u = (self.velocity - 0.5) / 0.8  # 0 at the slowest, 1 at the fastest of mid gait
        return PeriodicMonotoneCubic(x=[0.05, 0.5 + 0.01 * u, 0.9], y=[6 + 8 * u, 20 + 24 * u, 8 + 9 * u])


def _wave(turns: Array) -> Array:
    return np.sin(2 * np.pi * turns)


HIP_FLEXION = PeriodicMonotoneCubic(x=[0.5, 0.9], y=[-15.0, 25.0])
"""Hip flexion of mid gait, degrees over the phase."""

KNEE_FLEXION = PeriodicMonotoneCubic(x=[0.17, 0.4, 0.75, 1.0], y=[3.0, 3.0, 70.0, 3.0])
"""Knee flexion of mid gait, degrees over the phase."""
