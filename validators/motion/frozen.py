"""Whether the body is held still while it should move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.explained import explained
from posekit.validators.motion.motion_check import MotionCheck
from posekit.validators.motion.repeated import LONGEST_REPEAT


@dataclass(frozen=True, kw_only=True)
class Frozen(MotionCheck):
    """Whether a posture stays the same to rounding, in motion, for longer than a few frames.

    Parameters
    ----------
    longest : float
        Frames that may be the one before again.
    """

    name = "frozen"
    unit = "frames"
    meaning = "the posture is held, to rounding, while the body moves before and after"

    longest: float = LONGEST_REPEAT

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the body; see `MotionCheck`."""
        del clip
        return ("body",)

    def judge(self, clip: MotionClip) -> Findings:
        """Count the frames of a run, at each of them; see `MotionCheck`."""
        held = explained(clip).repeats.astype(np.float64)[:, None]
        return Findings(value=held, lower=np.array(-np.inf), upper=np.array(self.longest))
