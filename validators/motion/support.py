"""How long nothing holds a body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posekit.geometry import runs
from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.ground import ground_of
from posekit.validators.motion.motion_check import MotionCheck


@dataclass(frozen=True, kw_only=True)
class Support(MotionCheck):
    """Whether a body is in the air for longer than a jump lasts; see `posekit.validators.motion.ground`.

    Parameters
    ----------
    longest : float
        Seconds.
    """

    name = "support"
    unit = "s"
    meaning = "nothing holds the body for longer than a jump lasts"
    needs = ("up", "time", "ground")

    longest: float = 1.0

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the body; see `MotionCheck`."""
        del clip
        return ("body",)

    def judge(self, clip: MotionClip) -> Findings:
        """Measure how long each flight lasts; see `MotionCheck`."""
        lasts = np.zeros((len(clip), 1))
        for start, stop in runs(ground_of(clip).in_air):
            lasts[start:stop] = (stop - start) * clip.step
        return Findings(value=lasts, lower=np.array(-np.inf), upper=np.array(self.longest))
