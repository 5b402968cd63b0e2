"""Whether joints, or the body, are where the frames before and after say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.skeleton import JOINTS
from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.explained import explained
from posekit.validators.motion.motion_check import MotionCheck

NOISE_FACTOR: Final = 5.0
"""Standard deviations of measuring by which a frame may be off."""

JUMPING_RATE: Final = 15.0
"""Frames a second: at fewer, limbs that are thrown jump."""


@dataclass(frozen=True, kw_only=True)
class Teleport(MotionCheck):
    """Whether a joint or the body jumps by what its neighbouring frames do not explain.

    See `posekit.validators.motion.jumps`.

    Parameters
    ----------
    joint : float
        Metres of a single joint.
    body : float
        Metres of the body, for one frame or for good.
    """

    name = "teleport"
    unit = "m"
    meaning = "a joint, or the body, is not where the frames before and after say"

    joint: float = 0.07
    body: float = 0.06

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the joints and the body; see `MotionCheck`."""
        del clip
        return (*JOINTS, "body")

    def not_asked(self, clip: MotionClip) -> str:
        """Ask nothing of clips at few frames a second; see `MotionCheck`."""
        few = f"it needs {JUMPING_RATE:g} frames a second" if clip.rate < JUMPING_RATE else ""
        return super().not_asked(clip) or few

    def judge(self, clip: MotionClip) -> Findings:
        """Measure what neighbours on both sides do not explain; see `MotionCheck`."""
        found = explained(clip)
        jumps = np.column_stack([found.jumps.joint, found.jumps.body])
        return Findings(
            value=found.timeline.of_frames(jumps),
            lower=np.array(-np.inf),
            upper=np.array([self.joint] * len(JOINTS) + [self.body]),
            tolerance=NOISE_FACTOR * clip.noise,
        )
