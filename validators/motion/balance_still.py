"""Whether bodies that stand still would fall over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import runs
from posekit.ranking.centre_of_mass import centre_of_mass
from posekit.skeleton import FEET_POINTS, JOINT, SIDES
from posekit.tree import Findings
from posekit.validators.motion.base_of_support import beyond_support
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.ground import (
    FOOT_SHARE,
    FORWARD_SHARE,
    LEG_SHARE,
    ground_of,
    soles,
    speeds,
    stature_of,
)
from posekit.validators.motion.motion_check import MotionCheck

BEARING_METRES: Final = 0.06
"""Above the lowest sole up to which a foot bears."""

NOISE_FACTOR: Final = 4.0
"""Standard deviations of measuring by which the fastest of the joints may be faster than it is."""

SITTING_SHARE: Final = 0.8
"""Of the legs' length, by which the hips of whoever stands are above the feet: lower ones may sit on something."""


@dataclass(frozen=True, kw_only=True)
class BalanceStill(MotionCheck):
    """Whether the centre of mass of a body that stands still is over its feet.

    Parameters
    ----------
    beyond : float
        Metres by which it may be beyond the feet.
    slower : float
        Metres a second below which all joints are still.
    lasting : float
        Seconds for which the body must be still.
    """

    name = "balance-still"
    unit = "m"
    meaning = "the body stands still, and would fall over"
    needs = ("up", "time", "ground")

    beyond: float = 0.05
    slower: float = 0.1
    lasting: float = 1.0

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the centre of mass; see `MotionCheck`."""
        del clip
        return ("centre_of_mass",)

    def judge(self, clip: MotionClip) -> Findings:
        """Measure how far the centre of mass is beyond the feet; see `MotionCheck`."""
        feet, over = soles(clip)
        up = np.zeros(3) if clip.up is None else clip.up
        value = np.full((len(clip), 1), np.nan)
        still = np.flatnonzero(self._stands(clip))
        if len(still):
            height = feet[still] @ up - over
            bears = height < np.fmin.reduce(height, axis=1)[:, None] + BEARING_METRES
            # What a foot reaches beyond its known points: all of it beyond an ankle, its end and edges beyond a toe.
            toes = np.isfinite(feet[:, : len(FEET_POINTS)]).any()
            reach = (0.4 if toes else FORWARD_SHARE) * FOOT_SHARE * stature_of(clip)
            centre = centre_of_mass(np.moveaxis(clip.joints[still], 0, -1)).T
            bearing = np.where(bears[..., None], feet[still], np.nan)
            value[still, 0] = beyond_support(centre, bearing, up) - reach
        return Findings(value=value, lower=np.array(-np.inf), upper=np.array(self.beyond + 2 * clip.noise))

    def _stands(self, clip: MotionClip) -> NDArray[np.bool_]:
        """Say in which frames (T,) the body stands, and is still for long enough."""
        # Over so many frames that noise is slow beside what is still.
        noise = NOISE_FACTOR * clip.noise / (np.sqrt(2) * clip.step)
        frames = len(clip) if noise >= self.slower * len(clip) else max(int(np.ceil(noise / self.slower)), 1)
        fast = np.nan_to_num(speeds(clip, clip.joints, frames), nan=0.0).max(axis=1)
        still = fast < self.slower + noise / frames
        for start, stop in runs(still):
            still[start:stop] = (stop - start) * clip.step >= self.lasting
        hips = clip.height[:, [JOINT[f"{side}_hip"] for side in SIDES]].mean(axis=1)
        ankles = np.fmin.reduce(clip.height[:, [JOINT[f"{side}_ankle"] for side in SIDES]], axis=1)
        upright = hips - ankles > SITTING_SHARE * LEG_SHARE * stature_of(clip)
        return np.asarray(still & upright & ground_of(clip).resting)
