"""Whether right and left are exchanged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.explained import explained
from posekit.validators.motion.motion_check import MotionCheck
from posekit.validators.motion.sides import SIDE_PAIRS


@dataclass(frozen=True, kw_only=True)
class Swap(MotionCheck):
    """Whether the right and the left joint of a pair have each other's names; see `posekit.validators.motion.sides`.

    Parameters
    ----------
    most : float
        Pairs' ends that may be exchanged: none, or with 1 all.
    """

    name = "swap"
    unit = "1"
    meaning = "right and left are exchanged"

    most: float = 0.0

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the pairs; see `MotionCheck`."""
        del clip
        return SIDE_PAIRS

    def not_asked(self, clip: MotionClip) -> str:
        """Ask nothing of one posture, whose knees may bend a little backward; see `MotionCheck`."""
        return super().not_asked(clip) or ("it needs two frames" if len(clip) < 2 else "")

    def judge(self, clip: MotionClip) -> Findings:
        """Say 1 where a pair is exchanged and 0 where it is as labelled; see `MotionCheck`."""
        exchanged = explained(clip).exchanged.astype(np.float64)
        return Findings(value=exchanged, lower=np.array(-np.inf), upper=np.array(self.most))
