"""How deep bodies are below the ground."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.ground import ground_of
from posekit.validators.motion.motion_check import MotionCheck

NOISE_FACTOR: Final = 3.0
"""Standard deviations of measuring by which the lowest of several points may be lower than they are."""


@dataclass(frozen=True, kw_only=True)
class Penetration(MotionCheck):
    """Whether the lowest sole or joint is below the ground; see `posekit.validators.motion.ground`.

    Where the ground is given, a clip whose lowest level is below it is so in all its frames. Where it is not, it may
    be lower where nothing rests.

    Parameters
    ----------
    depth : float
        Metres that it may be below.
    unlevel : float
        Metres by which a ground that is not given may be lower than where something rests; not where that hangs.
    """

    name = "penetration"
    unit = "m"
    meaning = "the body is below the ground"
    needs = ("up", "ground")

    depth: float = 0.025
    unlevel: float = 0.1

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the body's lowest point; see `MotionCheck`."""
        del clip
        return ("lowest",)

    def judge(self, clip: MotionClip) -> Findings:
        """Measure how high the lowest point is over the ground; see `MotionCheck`."""
        ground = ground_of(clip)
        unlevel = np.where(ground.hanging, 0.0, self.unlevel if clip.ground is None else 0.0)
        lower = ground.lowest + unlevel
        over = ground.offset + ground.lifted + np.minimum(lower, 0.0)
        return Findings(
            value=over[:, None],
            lower=np.array(-self.depth - NOISE_FACTOR * clip.noise),
            upper=np.array(np.inf),
        )
