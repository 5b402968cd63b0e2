"""The checks over time, by the names that profiles and ``--checks`` take."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from posekit.validators.motion.motion_check import MotionCheck
from posekit.validators.motion.penetration import Penetration
from posekit.validators.motion.speed import JointSpeed

MOTION_CHECKS: Final[Mapping[str, type[MotionCheck]]] = {
    check.name: check for check in (Penetration, JointSpeed)
}
"""In the order in which they are reported."""
