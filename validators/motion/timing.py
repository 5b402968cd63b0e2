"""Whether frames are all there, and in their order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.explained import explained
from posekit.validators.motion.motion_check import MotionCheck

TWICE_FRAMES: Final = 0.75
"""Of a step, by which a stamp must be early to be that of the frame before: a quarter of one is a slot of its own."""


@dataclass(frozen=True, kw_only=True)
class Timing(MotionCheck):
    """Whether frames are missing before one, and by how many frames each is out of its place.

    Parameters
    ----------
    missing : float
        Frames that may be missing before a frame; a part of one is time that stamps are off.
    displaced : float
        Frames by which one may be out of its place, by its time or, without times, by the motion.
    """

    name = "timing"
    unit = "frames"
    meaning = "frames are missing, come twice, or are out of order"

    missing: float = 0.5
    displaced: float = 0.5

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name what is missing and what is out of order; see `MotionCheck`."""
        del clip
        return "missing", "order"

    def judge(self, clip: MotionClip) -> Findings:
        """Measure gaps and displacements in frames; see `MotionCheck`.

        A frame with the time of one before it has -1 frames missing before it: it comes twice.
        """
        found = explained(clip)
        by_time = found.timeline.place
        place = np.where(by_time != 0, by_time, found.displaced).astype(np.float64)
        return Findings(
            value=np.column_stack([found.timeline.missing, place]),
            lower=np.array([-TWICE_FRAMES, -self.displaced]),
            upper=np.array([self.missing, self.displaced]),
        )
