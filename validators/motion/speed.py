"""How fast joints move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posekit.skeleton import JOINTS
from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.motion_check import MotionCheck


@dataclass(frozen=True, kw_only=True)
class JointSpeed(MotionCheck):
    """Whether joints move faster than people can.

    Parameters
    ----------
    fastest : float
        Metres a second.
    """

    name = "speed"
    unit = "m/s"
    meaning = "a joint moves faster than people can"
    needs = ("time",)

    fastest: float = 15.0

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the joints; see `MotionCheck`."""
        del clip
        return JOINTS

    def judge(self, clip: MotionClip) -> Findings:
        """Measure the way to the next frame over its time; see `MotionCheck`."""
        speed = np.full(clip.joints.shape[:2], np.nan)
        speed[1:] = np.linalg.norm(np.diff(clip.joints, axis=0), axis=-1) / clip.step
        return Findings(value=speed, lower=np.array(-np.inf), upper=np.array(self.fastest))
