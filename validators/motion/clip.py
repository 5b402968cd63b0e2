"""One recording of one body over time, as checks over time see it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from posekit.geometry import Array
from posekit.skeleton import FEET_POINTS, HEAD_POINTS, JOINTS

Found = TypeVar("Found")


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionClip:
    """T frames of one body, in the frame of the world.

    Parameters
    ----------
    joints : array (T, 14, 3)
        Metres, in tree order; NaN where unknown.
    time : array (T,)
        Seconds, as the file has them, in whatever order; NaN where it says none.
    rate : float
        Frames a second; NaN where it is not known.
    head : array (T, 5, 3), optional
        Nose, eyes and ears.
    feet : array (T, 4, 3), optional
        In the order of `posekit.skeleton.FEET_POINTS`; NaN where the file has none.
    up : array (3,), optional
        Against gravity; None where it is not known.
    ground : float, optional
        Metres of the ground along `up`; None where it is to be estimated.
    noise : float
        Standard deviation of measured coordinates, metres; 0 where none is supposed.
    q : array (T, nq), optional
        Configurations, where the motion is a robot's; in Pinocchio's order.
    velocity_limits : array (nv,), optional
        Of the robot's joints, radians or metres a second, as its URDF has them.
    velocity : array (T, nv), optional
        Its velocities, radians or metres a second, from neighbouring configurations on their manifold.
    velocity_names : tuple of str (nv,)
        A name for each of them.
    """

    joints: Array
    time: Array
    rate: float
    head: Array = field(default_factory=lambda: np.empty(0))
    feet: Array = field(default_factory=lambda: np.empty(0))
    up: Array | None = None
    ground: float | None = None
    noise: float = 0.0
    q: Array | None = None
    velocity_limits: Array | None = None
    velocity: Array | None = None
    velocity_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        count = len(self.joints)
        for name, points in (("head", len(HEAD_POINTS)), ("feet", len(FEET_POINTS))):
            if not getattr(self, name).size:
                object.__setattr__(self, name, np.full((count, points, 3), np.nan))
        if self.joints.shape != (count, len(JOINTS), 3) or self.time.shape != (count,):
            raise ValueError("the shapes of joints and times do not fit")

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.joints)

    @cached_property
    def step(self) -> float:
        """Seconds from a frame to the next, by the rate; NaN where it is not known."""
        return 1.0 / self.rate if np.isfinite(self.rate) and self.rate > 0 else np.nan

    @cached_property
    def height(self) -> Array:
        """How high each joint is along `up` (T, 14), metres; NaN where up is not known."""
        if self.up is None:
            return np.full(self.joints.shape[:2], np.nan)
        return np.asarray(self.joints @ self.up)


def once_a_clip(find: Callable[[MotionClip], Found]) -> Callable[[MotionClip], Found]:
    """Let several checks share what is found in a clip: it is sought once, and kept as long as the clip is."""
    known: WeakKeyDictionary[MotionClip, Found] = WeakKeyDictionary()

    @wraps(find)
    def found(clip: MotionClip) -> Found:
        if clip not in known:
            known[clip] = find(clip)
        return known[clip]

    return found
