r"""How high bodies are above the ground that nothing holds there.

What is in the air falls: its centre of mass has the acceleration :math:`-g`, so a flight of t seconds rises by
:math:`g t^2 / 8` and no more. A body that is above all levels of the ground, nothing of which rests, and whose centre
of mass falls by less than half of that, hovers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posekit.geometry import runs
from posekit.tree import Findings
from posekit.validators.motion.carried import FALL_SHARE, falls
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.ground import ground_of
from posekit.validators.motion.motion_check import MotionCheck


@dataclass(frozen=True, kw_only=True)
class Floating(MotionCheck):
    """Whether a body is above the ground without a jump; see `posekit.validators.motion.ground`.

    Where the ground is given, a clip whose lowest level is above it is so in all its frames.

    Parameters
    ----------
    height : float
        Metres that it may be above.
    shortest : float
        Seconds below which a flight is not judged: its fall cannot be told from the motion of limbs.
    fall : float
        The share of gravity by which the centre of mass of a body in the air must fall.
    """

    name = "floating"
    unit = "m"
    meaning = "the body is above the ground, and nothing holds it there"
    needs = ("up", "time", "ground")

    height: float = 0.02
    shortest: float = 0.35
    fall: float = FALL_SHARE

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the body's lowest point; see `MotionCheck`."""
        del clip
        return ("lowest",)

    def judge(self, clip: MotionClip) -> Findings:
        """Measure how high the lowest point is over the ground; see `MotionCheck`."""
        ground = ground_of(clip)
        over = ground.offset + ground.lifted
        for start, stop in runs(ground.in_air):
            lasts = (stop - start) * clip.step
            if lasts >= self.shortest and not falls(ground.centre[start:stop], clip.step, self.fall):
                over[start:stop] += ground.lowest[start:stop] - ground.high
        return Findings(
            value=over[:, None], lower=np.array(-np.inf), upper=np.array(self.height + 2 * clip.noise)
        )
