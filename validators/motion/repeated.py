"""Whether a frame comes again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.explained import explained
from posekit.validators.motion.motion_check import MotionCheck

LONGEST_REPEAT: Final = 4.0
"""Frames: more in a row that are the same are a posture that is held (`frozen`)."""


@dataclass(frozen=True, kw_only=True)
class Repeated(MotionCheck):
    """Whether a frame in motion is the one before again, to rounding, once or a few times.

    Parameters
    ----------
    most : float
        Frames in a row that may be the one before again.
    """

    name = "repeated"
    unit = "frames"
    meaning = "a frame is the one before again while the body moves"

    most: float = 0.0

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the body; see `MotionCheck`."""
        del clip
        return ("body",)

    def judge(self, clip: MotionClip) -> Findings:
        """Count the frames of a short run, at each of them; see `MotionCheck`."""
        repeats = explained(clip).repeats.astype(np.float64)[:, None]
        short = np.where(repeats > LONGEST_REPEAT, 0.0, repeats)
        return Findings(value=short, lower=np.array(-np.inf), upper=np.array(self.most))
