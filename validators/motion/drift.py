"""Whether lengths of limbs stay what they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from posekit.geometry import Array
from posekit.skeleton import LIMB_SEGMENTS, segment_name
from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.explained import explained
from posekit.validators.motion.motion_check import MotionCheck
from posekit.validators.motion.timeline import norm

DRIFT_FRAMES: Final = 5
"""Whose median length is judged: one frame's is no drift."""

NOISE_FACTOR: Final = 4.0
"""Standard deviations of measuring, or of trembling, by which a length may be off."""

SHAKEN_METRES: Final = 0.0025
"""A joint that trembles by more makes lengths tremble: `jitter` names that."""


@dataclass(frozen=True, kw_only=True)
class Drift(MotionCheck):
    """Whether a limb's segment is longer or shorter than it mostly is in the clip.

    Parameters
    ----------
    share : float
        Of its median length, either way.
    """

    name = "drift"
    unit = "1"
    meaning = "a limb's segment is longer or shorter than it mostly is in the clip"

    share: float = 0.025

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the segments; see `MotionCheck`."""
        del clip
        return tuple(map(segment_name, LIMB_SEGMENTS))

    def judge(self, clip: MotionClip) -> Findings:
        """Measure by what share lengths are off their medians; see `MotionCheck`."""
        found = explained(clip)
        starts, ends = (list(one) for one in zip(*LIMB_SEGMENTS, strict=True))
        lengths = norm(found.joints[:, ends] - found.joints[:, starts])
        usual = _usual(lengths)
        shaken = np.maximum(found.trembling[:, starts], found.trembling[:, ends])
        shaken = np.where(shaken > SHAKEN_METRES, shaken, 0.0)
        return Findings(
            value=found.timeline.of_frames(_smooth(lengths) / usual - 1.0),
            lower=np.array(-self.share),
            upper=np.array(self.share),
            # A length has the noise of its two ends, the median of five frames about half of it.
            tolerance=found.timeline.of_frames(
                NOISE_FACTOR * np.fmax(shaken, clip.noise) / np.where(usual > 0, usual, 1.0)
            ),
        )


def _usual(lengths: Array) -> Array:
    """Return the median length of each segment (K,); NaN where none is known."""
    known = [column[column > 0] for column in lengths.T]
    return np.array([np.median(one) if len(one) else np.nan for one in known])


def _smooth(lengths: Array) -> Array:
    """Return medians over five slots (S, K): unknown lengths are what they were, edges stay where they are."""
    half = DRIFT_FRAMES // 2
    slots = np.arange(len(lengths))[:, None]
    last = np.maximum.accumulate(np.where(np.isfinite(lengths), slots, 0), axis=0)
    held = np.take_along_axis(lengths, last, axis=0)
    padded = np.pad(held, ((half, half), (0, 0)), mode="edge")
    smooth = np.partition(sliding_window_view(padded, DRIFT_FRAMES, axis=0), half, axis=-1)[..., half]
    return np.where(np.isfinite(lengths), smooth, np.nan)
