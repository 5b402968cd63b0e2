"""How much joints tremble: what is left of motion when all that is smooth is taken off."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from posekit.geometry import Array
from posekit.skeleton import JOINTS
from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.explained import explained
from posekit.validators.motion.motion_check import MotionCheck
from posekit.validators.motion.timeline import centred, filtered, norm

ORDER: Final = 6
"""Of the differences that are taken for what is not smooth."""

WINDOW: Final = 15
"""Frames over which trembling is measured."""

MEDIAN_OF_THREE: Final = 1.5382
"""Median length of a vector of three normal coordinates of unit deviation."""

CURVED: Final = 0.15
"""Share of the second difference, over three frames each way, that fast motion at few frames leaves in the sixth."""

SLOWEST_RATE: Final = 25.0
"""Frames a second: at fewer, fast motion is not smooth from frame to frame."""

_DIFFERENCE: Final = np.array([(-1.0) ** k * comb(ORDER, k) for k in range(ORDER + 1)])
_CURVATURE: Final = np.array([1.0, 0, 0, -2.0, 0, 0, 1.0]) / 9.0


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

    deviation: float = 0.0065

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the joints; see `MotionCheck`."""
        del clip
        return JOINTS

    def not_asked(self, clip: MotionClip) -> str:
        """Ask nothing of clips at few frames a second; see `MotionCheck`."""
        few = "" if clip.rate >= SLOWEST_RATE else f"needs {SLOWEST_RATE:g} frames a second"
        return super().not_asked(clip) or few

    def judge(self, clip: MotionClip) -> Findings:
        """Measure the standard deviation of what trembles, over fifteen frames; see `MotionCheck`."""
        found = explained(clip)
        value = trembling(found.joints)
        return Findings(
            value=found.timeline.of_frames(value),
            lower=np.array(-np.inf),
            upper=np.array(self.deviation),
            tolerance=2.0 * clip.noise,
        )


def trembling(joints: Array) -> Array:
    """Return the standard deviation of a coordinate's trembling (S, 14), metres, of joints in even time (S, 14, 3).

    Notes
    -----
    The sixth difference of noise of deviation s has the deviation s sqrt(924) in each coordinate. Its median length
    over 15 frames is that of noise which lasts, not of one jump; what the curvature of fast motion leaves in it is
    taken off. A frame in a window that trembles does so too where its own sixth difference is large.
    """
    rough = norm(filtered(joints, _DIFFERENCE)) / (np.sqrt(comb(2 * ORDER, ORDER)) * MEDIAN_OF_THREE)
    rough = np.maximum(rough - CURVED * norm(filtered(joints, _CURVATURE)), 0.0)
    half = WINDOW // 2
    padded = np.pad(np.nan_to_num(rough), ((half, half), (0, 0)))
    return centred(np.median(sliding_window_view(padded, WINDOW, axis=0), axis=-1), len(joints), ORDER // 2)
