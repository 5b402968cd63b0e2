"""How fast the speed of joints changes."""

from __future__ import annotations

from dataclasses import dataclass

from posekit.geometry import Array
from posekit.validators.motion.speed import Derivative, trunk_and_limbs


@dataclass(frozen=True, kw_only=True)
class JointAcceleration(Derivative):
    """Whether joints change their speed faster than people can.

    Parameters
    ----------
    trunk : float
        Metres a second squared of neck, shoulders, pelvis and hips.
    limbs : float
        Metres a second squared of the other joints.
    """

    name = "acceleration"
    unit = "m/s²"
    meaning = "the speed of a joint changes faster than that of people can"
    order = 2

    trunk: float = 400.0
    limbs: float = 1200.0

    def bounds(self) -> Array:
        """Return the upper bound of each joint (14,)."""
        return trunk_and_limbs(self.trunk, self.limbs)
