"""The checks over time, by the names that profiles and ``--checks`` take."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from posekit.validators.motion.balance_still import BalanceStill
from posekit.validators.motion.curation import ContactShare, RootHeight, SupportDistance
from posekit.validators.motion.drift import Drift
from posekit.validators.motion.floating import Floating
from posekit.validators.motion.frozen import Frozen
from posekit.validators.motion.jitter import Jitter
from posekit.validators.motion.joint_velocity import JointVelocity
from posekit.validators.motion.motion_check import MotionCheck
from posekit.validators.motion.penetration import Penetration
from posekit.validators.motion.repeated import Repeated
from posekit.validators.motion.root_jerk import RootJerk
from posekit.validators.motion.skating import GmdSkating, PhysDiffSkate, WhamSliding
from posekit.validators.motion.sliding import Sliding
from posekit.validators.motion.speed import JointAcceleration, JointJerk, JointSpeed
from posekit.validators.motion.support import Support
from posekit.validators.motion.swap import Swap
from posekit.validators.motion.teleport import Teleport
from posekit.validators.motion.timing import Timing
from posekit.validators.motion.walking_phases import WalkingPhases

MOTION_CHECKS: Final[Mapping[str, type[MotionCheck]]] = {
    check.name: check
    for check in (
        Timing,
        Frozen,
        Repeated,
        Swap,
        Teleport,
        JointSpeed,
        JointAcceleration,
        JointJerk,
        RootJerk,
        Jitter,
        Drift,
        JointVelocity,
        Penetration,
        Floating,
        Support,
        Sliding,
        BalanceStill,
        GmdSkating,
        WhamSliding,
        PhysDiffSkate,
        ContactShare,
        RootHeight,
        SupportDistance,
        WalkingPhases,
    )
}
"""In the order in which they are reported."""
