"""How fast a robot's joints move, against what its URDF allows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.motion_check import MotionCheck

NO_LIMIT: Final = 1e6
"""Radians or metres a second from which a URDF's number means that there is none."""


@dataclass(frozen=True, kw_only=True)
class JointVelocity(MotionCheck):
    """Whether a robot's joints move faster than its URDF's velocity limits.

    Parameters
    ----------
    share : float
        Of the limit that a joint may use.
    """

    name = "joint-velocity"
    unit = "1"
    meaning = "a robot's joint moves faster than its limit: a share of it"
    needs = ("time",)

    share: float = 1.0

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the joints that have a limit; see `MotionCheck`."""
        return tuple(np.array(clip.velocity_names)[_limited(clip)].tolist())

    def not_asked(self, clip: MotionClip) -> str:
        """Ask nothing where there are no configurations of a robot with limits; see `MotionCheck`."""
        reason = super().not_asked(clip)
        if not reason and (clip.velocity is None or clip.velocity_limits is None):
            return "there are no configurations of a robot (--urdf)"
        return reason or ("" if len(_limited(clip)) else "the URDF has no velocity limits")

    def judge(self, clip: MotionClip) -> Findings:
        """Measure velocities as shares of their limits; see `MotionCheck`."""
        velocity, limits, limited = (
            np.asarray(clip.velocity),
            np.asarray(clip.velocity_limits),
            _limited(clip),
        )
        return Findings(
            value=np.abs(velocity[:, limited]) / limits[limited],
            lower=np.array(-np.inf),
            upper=np.array(self.share),
        )


def _limited(clip: MotionClip) -> NDArray[np.intp]:
    """Return which velocities have a limit: the root has none, and 0 or no number in a URDF is none."""
    limits = np.empty(0) if clip.velocity_limits is None else clip.velocity_limits
    return np.flatnonzero(np.isfinite(limits) & (limits > 0) & (limits < NO_LIMIT))
