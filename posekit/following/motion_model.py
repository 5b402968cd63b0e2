"""How bodies move: how fast at most, how fast usually, how suddenly that changes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from posekit.errors import InputError
from posekit.following.channels import N_JOINTS, N_SEGMENTS
from posekit.geometry import Array

USUAL_ACCELERATION: Final = (5.0,) * 6 + (7.0, 7.0, 10.0, 10.0, 8.0, 8.0, 11.0, 11.0)
"""Metres a second squared, by joint: about the 75th to 90th percentile over basketball, soccer, jumping and signals in
the CMU Graphics Lab Motion Capture Database at 30 Hz."""

MAX_SPEED: Final = (15.0,) * 6 + (25.0, 25.0, 35.0, 35.0, 25.0, 25.0, 35.0, 35.0)
"""Metres a second. The trunk of the fastest sprinter passes 20 m at 12.1 m/s (Čoh et al. 2018, Kinesiology 50:172);
the fastest thrown and kicked balls leave hand and foot at 47 and 37 m/s, faster than wrist and ankle are."""

MAX_SWING: Final = (25.0,) * 5 + (45.0, 45.0, 130.0, 130.0, 35.0, 35.0, 50.0, 50.0)
"""Radians a second, by segment. A pitcher's upper arm turns inward at up to 7,240 deg/s, 126 rad/s, with the elbow
bent: that swings the forearm; the elbow extends at 2,320 deg/s (Fleisig et al. 1999, J Biomech 32:1371). A kicker's
shank swings at about 40 rad/s (reviewed by Kellis & Katis 2007, J Sports Sci Med 6:154), thighs at half of that."""


def _ankles() -> Array:
    resting = np.full(N_JOINTS, np.inf)
    resting[-2:] = 0.3
    return resting


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionModel:
    r"""What a path costs.

    Each step, from one frame that the path has a survivor in to the next, costs minus the log-likelihood of its
    velocities; each two steps that of the acceleration between them,

    .. math:: a = \frac{2}{\Delta_1 + \Delta_2}
              \left(\frac{x_3 - x_2}{\Delta_2} - \frac{x_2 - x_1}{\Delta_1}\right),

    both under Student distributions, so that a sudden move is dear and not impossible. Beyond the walls it is. The
    survivors' own deviations widen distributions and walls alike. All of it reads the same backward in time.

    A number may be given for all joints or segments, or one for each; infinity leaves a term out.

    Parameters
    ----------
    speed : float or array (14,)
        Scale of the joints' speeds, metres a second.
    swing : float or array (13,)
        Scale of the speeds with which segments turn, radians a second.
    acceleration : float or array (14,)
        Scale of the joints' accelerations, metres a second squared.
    resting : float or array (14,)
        Scale of the speeds of joints that mostly rest on the ground: the ankles. Infinite where the camera moves, and
        what rests is not at rest for it.
    max_speed, max_swing : float or array (14,), (13,)
        The walls.
    nu : float
        Degrees of freedom of the distributions: the fewer, the cheaper is what is rare.
    ranking : float
        What the survivors' own costs count. Postures of neighbouring frames are alike, and what is said of one is said
        of the other; yet less than all of it was worse where it was measured (docs, "Sequences").
    skip : float
        What it costs to pass over a frame, because none of its survivors fits or it has none.
    spread : float
        How many deviations of both ends the walls give way.

    Raises
    ------
    InputError
        Where a number is impossible.
    """

    speed: ArrayLike = 6.0
    swing: ArrayLike = 6.0
    acceleration: ArrayLike = USUAL_ACCELERATION
    resting: ArrayLike = field(default_factory=_ankles)
    max_speed: ArrayLike = MAX_SPEED
    max_swing: ArrayLike = MAX_SWING
    nu: float = 4.0
    ranking: float = 1.0
    skip: float = 150.0
    spread: float = 3.0

    def __post_init__(self) -> None:
        for name, count in (
            ("speed", N_JOINTS),
            ("swing", N_SEGMENTS),
            ("acceleration", N_JOINTS),
            ("resting", N_JOINTS),
            ("max_speed", N_JOINTS),
            ("max_swing", N_SEGMENTS),
        ):
            given = np.array(getattr(self, name), dtype=np.float64)
            if given.shape not in ((), (count,)):
                raise InputError(
                    f"{name} has shape {given.shape}; expected one number, or one for each of {count}"
                )
            if not (given > 0).all():
                raise InputError(
                    f"{name}: {float(given.min())!r}; expected positive numbers, infinite for none"
                )
            values = np.broadcast_to(given, count).copy()
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        if not (math.isfinite(self.nu) and self.nu > 0):
            raise InputError(f"nu is {self.nu!r}; expected a positive number of degrees of freedom")
        for name in ("ranking", "skip", "spread"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"{name} is {value!r}; expected a finite number, zero or more")

    @cached_property
    def usual(self) -> Array:
        """Scales of the velocities of all 27 channels."""
        return np.concatenate([np.asarray(self.speed), np.asarray(self.swing)])

    @cached_property
    def at_rest(self) -> Array:
        """Scales of the velocities of channels that rest."""
        return np.concatenate([np.asarray(self.resting), np.full(N_SEGMENTS, np.inf)])

    def reach(self, since: Array) -> Array:
        """Return the walls (27, S) after some time (27, S): metres, chords of angles; infinite where there is none."""
        far = np.asarray(self.max_speed)[:, None] * since[:N_JOINTS]
        angle = np.asarray(self.max_swing)[:, None] * since[N_JOINTS:]
        chord = np.where(angle < np.pi, 2 * np.sin(np.minimum(angle, np.pi) / 2), np.inf)
        return np.concatenate([far, chord])
