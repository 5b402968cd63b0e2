"""How bodies move: how suddenly that changes, and how fast at most."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from posekit.errors import InputError
from posekit.following.channels import N_JOINTS

USUAL_ACCELERATION: Final = (5.0,) * 6 + (7.0, 7.0, 10.0, 10.0, 8.0, 8.0, 11.0, 11.0)
"""Metres a second squared, by joint: about the 75th to 90th percentile over basketball, soccer, jumping and signals in
the CMU Graphics Lab Motion Capture Database at 30 Hz."""

MAX_SPEED: Final = (15.0,) * 6 + (25.0, 25.0, 35.0, 35.0, 25.0, 25.0, 35.0, 35.0)
"""Metres a second. The trunk of the fastest sprinter passes 20 m at 12.1 m/s (Čoh et al. 2018, Kinesiology 50:172);
the fastest thrown and kicked balls leave hand and foot at 47 and 37 m/s, faster than wrist and ankle are."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionModel:
    r"""What a path costs: what its survivors cost, and what its steps do.

    A joint moves with a random acceleration, so that a Kalman filter along the path says where it will be, give or take
    P. A step costs minus the log-likelihood of what its joints are off that by, x, under a Student distribution with
    the noise R of the survivor,

    .. math:: w \sum_j \tfrac{\nu + 3}{2} \log\left(1 + \tfrac{1}{\nu} x_j^T S_j^{-1} x_j\right)
              + \tfrac12 \log\frac{|S_j|}{\sigma_j^6}, \qquad S_j = P_j + R_j,

    so that a sudden move is dear and not impossible, and one along a ray, where noise is large, is less dear than one
    across it. Beyond the walls it is impossible.

    A number may be given for all joints or one for each.

    Parameters
    ----------
    acceleration : float or array (14,)
        Scale of the joints' accelerations, metres a second squared, by which a path is judged and smoothed.
    max_speed : float or array (14,)
        The walls, metres a second; infinite for none.
    nu : float
        Degrees of freedom of the distribution: the fewer, the cheaper is what is rare.
    weight : float
        What steps to survivors with noise count: joints of a body are off together, and frames as their neighbours
        are. Where points are exact, steps count whole.
    ranking : float
        What the survivors' own costs count.
    skip : float
        What it costs to pass over a frame, beside what a step to one that is as noisy costs on average.
    spread : float
        How many deviations of both ends the walls give way.

    Raises
    ------
    InputError
        Where a number is impossible.
    """

    acceleration: ArrayLike = USUAL_ACCELERATION
    max_speed: ArrayLike = MAX_SPEED
    nu: float = 4.0
    weight: float = 0.25
    ranking: float = 1.0
    skip: float = 100.0
    spread: float = 3.0

    def __post_init__(self) -> None:
        for name in ("acceleration", "max_speed"):
            given = np.array(getattr(self, name), dtype=np.float64)
            if given.shape not in ((), (N_JOINTS,)):
                raise InputError(
                    f"{name} has shape {given.shape}; expected one number, or one for each of {N_JOINTS}"
                )
            if not (given > 0).all() or (name != "max_speed" and not np.isfinite(given).all()):
                raise InputError(f"{name}: {float(given.min())!r}; expected positive numbers")
            values = np.broadcast_to(given, N_JOINTS).copy()
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        if not (math.isfinite(self.nu) and self.nu > 0):
            raise InputError(f"nu is {self.nu!r}; expected a positive number of degrees of freedom")
        for name in ("weight", "ranking", "skip", "spread"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"{name} is {value!r}; expected a finite number, zero or more")
