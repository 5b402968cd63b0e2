"""What the checks of a suite are made with: whoever asks for a suite says it once."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final

from posekit.errors import InputError
from posekit.settings import RigidTolerance
from posekit.settings.judging import checked_rules
from posekit.validators.joint_range import ANGLE_TOLERANCE
from posekit.validators.ranges import URDF_RANGES, Ranges, load_ranges
from posekit.validators.rigid_parts import Mode
from posekit.validators.walking import DEFAULT_RULES, WalkingThresholds

LEVEL_CAMERA_UP: Final = (0.0, -1.0, 0.0)
"""Which way is up in the frame of a camera that is held level: against the image's y."""


@dataclass(frozen=True, kw_only=True)
class CheckOptions:
    """What checks are made with; each takes what concerns it.

    Parameters
    ----------
    ranges : Ranges
        The joint ranges.
    rigid_tolerance : float or RigidTolerance
        Metres by which distances inside torso and hips may be off: all the same, or each its own.
    rigid_mode : {"placement", "side", "distances"}
        See `posekit.validators.rigid_parts`.
    limbs : bool
        Whether the lengths of lifted segments are judged too.
    angle_tolerance : float
        Degrees by which the direction of a segment may be off.
    directions : bool
        See `posekit.validators.joint_range`.
    rules : tuple of int
        Rules of walking.
    thresholds : WalkingThresholds
        Of these rules.
    contact_margin : float
        Metres that bodies must keep from each other; negative allows penetration.
    exact : bool
        Whether every distance between bodies is measured, for margins; otherwise those that are clear of contact report
        a bound. The verdicts are the same.
    up : tuple of float
        Which way is up in the frame of the postures, for checks of scope `VIEW`.

    Raises
    ------
    InputError
        Where a rule is unknown, or a tolerance or margin is not finite: nothing compares with NaN, and every posture
        would pass.
    """

    ranges: Ranges = URDF_RANGES
    rigid_tolerance: float | RigidTolerance = 0.0
    rigid_mode: Mode = "placement"
    limbs: bool = False
    angle_tolerance: float = ANGLE_TOLERANCE
    directions: bool = False
    rules: tuple[int, ...] = DEFAULT_RULES
    thresholds: WalkingThresholds = field(default_factory=WalkingThresholds)
    contact_margin: float = 0.0
    exact: bool = False
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        for what, value in (("rigid", self.rigid_tolerance), ("angle", self.angle_tolerance)):
            if isinstance(value, RigidTolerance):
                continue  # it has checked itself
            if not (math.isfinite(value) and value >= 0):
                raise InputError(
                    f"the {what} tolerance is {value!r}; expected zero or a positive, finite number"
                )
        if not math.isfinite(self.contact_margin):
            raise InputError(f"the contact margin is {self.contact_margin!r} m; expected a finite length")
        object.__setattr__(self, "rules", checked_rules(self.rules))

    def with_parameters(self, check: str, parameters: Mapping[str, Any]) -> CheckOptions:
        """Return the options that one check is made with, whose settings say some of its parameters.

        Raises
        ------
        InputError
            Where a parameter is none of these options.
        """
        known = {item.name for item in fields(self)}
        unknown = sorted(set(parameters) - known)
        if unknown:
            raise InputError(
                f"--checks: {check} has no parameter {unknown[0]!r}; expected some of {', '.join(sorted(known))}"
            )
        changes = dict(parameters)
        if isinstance(changes.get("ranges"), str):
            changes["ranges"] = load_ranges(changes["ranges"])
        return replace(self, **changes)
