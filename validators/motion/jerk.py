"""How fast the acceleration of joints changes."""

from __future__ import annotations

from dataclasses import dataclass

from posekit.geometry import Array
from posekit.validators.motion.speed import Derivative, trunk_and_limbs


@dataclass(frozen=True, kw_only=True)
class JointJerk(Derivative):
    """Whether the acceleration of joints changes faster than that of people can.

    Parameters
    ----------
    trunk : float
        Metres a second cubed of neck, shoulders, pelvis and hips.
    limbs : float
        Metres a second cubed of the other joints.
    """

    name = "jerk"
    unit = "m/s³"
    meaning = "the acceleration of a joint changes faster than that of people can"
    order = 3

    trunk: float = 48_000.0
    limbs: float = 144_000.0

    def bounds(self) -> Array:
        """Return the upper bound of each joint (14,)."""
        return trunk_and_limbs(self.trunk, self.limbs)
