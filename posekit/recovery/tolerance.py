"""How much a view may disagree with the figure."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from posekit.errors import InputError
from posekit.validators.rigid_parts import RigidTolerance


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """Allowances for lengths and image points that are not exact.

    Parameters
    ----------
    rigid : float
        Metres by which distances inside torso and hips may be off.
    tangent : float
        Metres by which a segment may be too short for its image: its end is then put at the nearest point of
        the ray, and the posture carries what is missing as its length residual.
    placement : bool
        Whether the torso must also be the figure's own laid onto the posture, which tells it from its mirror
        image. With centimetres of tolerance that question has no answer.
    angle : float
        Degrees by which the direction of a segment may be off, for joint ranges.
    hips : float
        What part of `rigid` the distance from hip to hip may be off, 0 to 1: shoulders and spines give, the pelvis is
        bone.
    """

    rigid: float
    tangent: float
    placement: bool
    angle: float = 1e-3
    hips: float = 1.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.angle) and self.angle >= 0):
            raise InputError(
                f"the angle tolerance is {self.angle!r} degrees; expected zero or a positive number"
            )
        for name in ("rigid", "tangent"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"--{name}-tolerance: {value!r} m; expected zero or a positive length")
        if not 0 <= self.hips <= 1:
            raise InputError(
                f"the hips' part of the rigid tolerance is {self.hips!r}; expected a number from 0 to 1"
            )

    @property
    def distances(self) -> RigidTolerance:
        """What each distance inside torso and hips may be off."""
        return RigidTolerance(shoulders=self.rigid, sides=self.rigid, hips=self.hips * self.rigid)


EXACT: Final = Tolerance(rigid=1e-8, tangent=1e-9, placement=True)
"""For exact image points: rounding only."""

MEASURED: Final = Tolerance(rigid=0.03, tangent=0.01, placement=False, angle=2.0, hips=0.25)
"""For measured image points and bodies: what real torsos give (docs, "A torso that gives")."""

PHOTOGRAPH: Final = Tolerance(rigid=0.10, tangent=0.05, placement=False, angle=10.0)
"""For uncalibrated pictures: what took them was no scaled orthographic camera, and from a few metres the scale
differs by some percent between the nearer and the farther limbs (docs, "Uncalibrated pictures")."""
