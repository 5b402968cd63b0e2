"""How fast a robot's joints move, against what its URDF allows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.motion_check import MotionCheck


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
        if not reason and (clip.velocity is None or clip.fastest is None):
            return "there are no configurations of a robot (--urdf)"
        return reason or ("" if len(_limited(clip)) else "the URDF has no velocity limits")

    def judge(self, clip: MotionClip) -> Findings:
        """Measure velocities as shares of their limits; see `MotionCheck`."""
        velocity, fastest, limited = np.asarray(clip.velocity), np.asarray(clip.fastest), _limited(clip)
        return Findings(
            value=np.abs(velocity[:, limited]) / fastest[limited],
            lower=np.array(-np.inf),
            upper=np.array(self.share),
        )


def _limited(clip: MotionClip) -> np.ndarray:
    """Return which velocities have a limit: the root has none, and 0 or no number in a URDF is none."""
    fastest = np.empty(0) if clip.fastest is None else np.asarray(clip.fastest)
    return np.flatnonzero(np.isfinite(fastest) & (fastest > 0) & (fastest < 1e6))
