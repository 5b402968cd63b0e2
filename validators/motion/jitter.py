"""Whether joints tremble."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.skeleton import JOINTS
from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.explained import explained
from posekit.validators.motion.motion_check import MotionCheck
from posekit.validators.motion.trembling import trembling_frames

NOISE_FACTOR: Final = 2.0
"""Times the standard deviation of measuring that is allowed for."""

SLOWEST_RATE: Final = 25.0
"""Frames a second: at fewer, fast motion is not smooth from frame to frame."""


@dataclass(frozen=True, kw_only=True)
class Jitter(MotionCheck):
    """Whether joints tremble by more than motion and the noise of the clip explain.

    Parameters
    ----------
    deviation : float
        Metres, standard deviation of a coordinate.
    """

    name = "jitter"
    unit = "m"
    meaning = "a joint trembles from frame to frame by more than the noise of the clip explains"
    needs = ("time",)

    deviation: float = 0.006

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the joints; see `MotionCheck`."""
        del clip
        return JOINTS

    def not_asked(self, clip: MotionClip) -> str:
        """Ask nothing of clips at few frames a second; see `MotionCheck`."""
        few = "" if clip.rate >= SLOWEST_RATE else f"it needs {SLOWEST_RATE:g} frames a second"
        return super().not_asked(clip) or few

    def judge(self, clip: MotionClip) -> Findings:
        """Measure the standard deviation of what trembles, over fifteen frames; see `MotionCheck`."""
        found = explained(clip)
        value, bound = found.trembling, self.deviation + NOISE_FACTOR * clip.noise
        hot = np.nan_to_num(value) > bound
        if hot.any():
            exact = trembling_frames(found.joints, hot)
            most = np.where(hot, value, 0.0).max(axis=0)
            value = np.where(exact, np.where(hot, value, most), np.minimum(value, self.deviation))
        return Findings(
            value=found.timeline.of_frames(value),
            lower=np.array(-np.inf),
            upper=np.array(self.deviation),
            tolerance=NOISE_FACTOR * clip.noise,
        )
