"""What decides the verdicts on a robot's postures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

from posekit.errors import InputError
from posekit.settings import DEFAULT_RANGES, ValidateSettings

ROBOT_CHECKS: Final = ("reach", "rigid-parts", "joint-range", "collision", "balance")
ROBOT_DEFAULT: Final = ROBOT_CHECKS[:4]
OF_POSITIONS: Final = ("reach", "rigid-parts")
"""Checks of what was seen: a configuration has nothing to compare."""

BODIES_FROM: Final[Mapping[str, str]] = {
    "urdf": "the URDF's collision bodies",
    "visual": "the URDF's visual bodies",
    "capsules": "made up: capsules along the segments, with the stick figure's radii in proportion",
}

LEAST_REACH: Final = 1e-3
"""Metres: no fit is asked to be closer."""


def robot_settings(asked: ValidateSettings) -> ValidateSettings:
    """Fill in what is usual for robots: four checks, the lengths of the postures, and limits of their own.

    Raises
    ------
    InputError
        Where a check is none of robots.
    """
    return asked.changed(
        checks=check_robot_names(ROBOT_DEFAULT if asked.checks is None else asked.check_names),
        lengths=asked.lengths or "median",
        ranges="urdf" if asked.ranges == DEFAULT_RANGES else asked.ranges,
    )


def reach_tolerance(settings: ValidateSettings) -> float:
    """Return the metres that a fit may be off."""
    return max(settings.rigid, LEAST_REACH)


def check_robot_names(names: Iterable[str]) -> tuple[str, ...]:
    """Refuse names that are no checks of robots; return them in the order in which they are applied."""
    chosen = tuple(names)
    unknown = [name for name in chosen if name not in ROBOT_CHECKS]
    if unknown:
        extra = " (walking is for the stick figure)" if unknown[0] == "walking" else ""
        raise InputError(
            f"--checks: {unknown[0]!r} is not a check of robots{extra}; expected some of {', '.join(ROBOT_CHECKS)}"
        )
    return tuple(name for name in ROBOT_CHECKS if name in chosen)
