"""How deep joints are below the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.motion_check import MotionCheck


@dataclass(frozen=True, kw_only=True)
class Penetration(MotionCheck):
    """Whether the lowest point of the body is below the ground.

    Parameters
    ----------
    depth : float
        Metres that it may be below.
    """

    name = "penetration"
    unit = "m"
    meaning = "the body is below the ground"
    needs = ("up",)

    depth: float = 0.03

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the body's lowest point; see `MotionCheck`."""
        del clip
        return ("lowest",)

    def not_asked(self, clip: MotionClip) -> str:
        """Ask nothing where the ground is not given; see `MotionCheck`."""
        return super().not_asked(clip) or (
            "" if clip.ground is not None else "the ground is not known (--ground)"
        )

    def judge(self, clip: MotionClip) -> Findings:
        """Measure how high the lowest joint is over the ground; see `MotionCheck`."""
        lowest = np.fmin.reduce(clip.height, axis=1)[:, None] - (clip.ground or 0.0)
        return Findings(value=lowest, lower=np.array(-self.depth), upper=np.array(np.inf))
