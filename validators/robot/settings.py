"""What decides the verdicts on a robot's postures."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.robots.joint_map import JointMap
from posekit.settings.validate import Bodies, Lengths

ROBOT_CHECKS: Final = ("reach", "rigid-parts", "joint-range", "collision", "balance")
ROBOT_DEFAULT: Final = ROBOT_CHECKS[:4]
OF_POSITIONS: Final = ("reach", "rigid-parts")
"""Checks of what was seen: a configuration has nothing to compare."""

LENGTHS_CHOICES: Final[tuple[Lengths, ...]] = ("model", "median", "each")
BODIES_FROM: Final[Mapping[str, str]] = {
    "urdf": "the URDF's collision bodies",
    "visual": "the URDF's visual bodies",
    "capsules": "made up: capsules along the segments, with the stick figure's radii in proportion",
}

LEAST_REACH: Final = 1e-3
"""Metres: no fit is asked to be closer."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotSettings:
    """Checks and tolerances.

    Parameters
    ----------
    checks : sequence of str
        Some of `ROBOT_CHECKS`.
    ranges : str
        ``urdf``, or the path of a TOML table of the robot's own joints.
    joint_map : str or JointMap, optional
        The joint map, its name or its file; found by the frames' names where not given.
    lengths : {"model", "median", "each"}
        The model has its own segment lengths, the medians of the postures that are judged together, or each
        posture's own.
    bodies : {"auto", "urdf", "visual", "capsules"}
        What collides; ``auto`` takes the URDF's bodies if there are pairs of them, else capsules that are made up.
    rigid_tolerance, angle_tolerance, contact_margin : float
        Metres, degrees, metres; the first holds for `reach` too.
    up : array (3,)
        The direction against gravity in the frame of the postures, for `balance`.

    Raises
    ------
    InputError
        Where a check or an option is unknown or impossible.
    """

    checks: tuple[str, ...] = ROBOT_DEFAULT
    ranges: str = "urdf"
    joint_map: str | JointMap | None = None
    lengths: Lengths = "median"
    bodies: Bodies = "auto"
    rigid_tolerance: float = 0.03
    angle_tolerance: float = 1e-3
    contact_margin: float = 0.0
    up: ArrayLike = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "checks", check_robot_names(self.checks))
        for what, value in (
            ("rigid tolerance", self.rigid_tolerance),
            ("angle tolerance", self.angle_tolerance),
        ):
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"the {what} is {value!r}; expected zero or a positive, finite number")
        if not math.isfinite(self.contact_margin):
            raise InputError(f"the contact margin is {self.contact_margin!r} m; expected a finite length")
        options: tuple[tuple[str, str, tuple[str, ...]], ...] = (
            ("--lengths", self.lengths, LENGTHS_CHOICES),
            ("--bodies", self.bodies, ("auto", *BODIES_FROM)),
        )
        for option, given, known in options:
            if given not in known:
                raise InputError(f"{option}: {given!r}; expected one of {', '.join(known)}")
        up = np.asarray(self.up, dtype=np.float64)
        if up.shape != (3,) or not np.isfinite(up).all() or not np.linalg.norm(up) > 0:
            raise InputError(f"up is {self.up!r}; expected a direction, three finite numbers")

    @property
    def upward(self) -> Array:
        """The unit vector against gravity (3,)."""
        up = np.asarray(self.up, dtype=np.float64)
        return np.asarray(up / np.linalg.norm(up))

    @property
    def reach_tolerance(self) -> float:
        """Metres that a fit may be off."""
        return max(self.rigid_tolerance, LEAST_REACH)

    @property
    def wants_bodies(self) -> bool:
        """Whether some check asks for bodies."""
        return "collision" in self.checks or "balance" in self.checks


def check_robot_names(names: Iterable[str]) -> tuple[str, ...]:
    """Refuse names that are no checks of robots; return them in the order in which they are applied."""
    chosen = tuple(names)
    unknown = [name for name in chosen if name not in ROBOT_CHECKS]
    if unknown:
        extra = " (walking is for the stick figure)" if unknown[0] == "walking" else ""
        raise InputError(
            f"--checks: {unknown[0]!r} is not a check of robots{extra}; expected some of {', '.join(ROBOT_CHECKS)}"
        )
    if not chosen:
        raise InputError("--checks: none is given, so nothing would be judged; expected one or more")
    return tuple(name for name in ROBOT_CHECKS if name in chosen)
