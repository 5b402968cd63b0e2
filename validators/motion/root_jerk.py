"""How jerky the root moves over seconds, as PHUMA's curation measures it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.geometry import Array
from posekit.skeleton import JOINT
from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.explained import explained
from posekit.validators.motion.motion_check import MotionCheck
from posekit.validators.motion.timeline import norm

CHUNK_SECONDS, OVERLAP_SECONDS, LEAST_SECONDS = 4.0, 0.5, 1.0
"""Parts of a clip that are judged as a whole, by how much they overlap, and how long they must be."""

BUTTERWORTH_ORDER: Final = 4
"""Of the filter, which runs forward and backward."""

PADDED_SECONDS: Final = 2.0
"""By which the way of the root is mirrored at its ends before it is filtered."""


@dataclass(frozen=True, kw_only=True)
class RootJerk(MotionCheck):
    """Whether the mean jerk of the root is too large over four seconds.

    Parameters
    ----------
    most : float
        Metres a second cubed.
    cutoff : float
        Hertz of the low-pass filter (Butterworth, fourth order, forward and backward) that the root's way passes.

    Notes
    -----
    As published with PHUMA (Lee et al. 2025, arXiv:2510.26236): clips in parts of four seconds that overlap by half a
    second; the mean length of third differences of the root's position. The root is the middle of the hips.
    """

    name = "root-jerk"
    unit = "m/s³"
    meaning = "the root jerks, over seconds, by more than a humanoid can follow"
    needs = ("time",)

    most: float = 50.0
    cutoff: float = 3.0

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the root; see `MotionCheck`."""
        del clip
        return ("root",)

    def not_asked(self, clip: MotionClip) -> str:
        """Ask nothing of short clips; see `MotionCheck`."""
        short = "" if len(clip) * clip.step >= LEAST_SECONDS else f"it needs {LEAST_SECONDS:g} s of motion"
        slow = (
            ""
            if clip.rate > 2.0 * self.cutoff
            else f"it needs more than {2.0 * self.cutoff:g} frames a second"
        )
        return super().not_asked(clip) or short or slow

    def judge(self, clip: MotionClip) -> Findings:
        """Measure the mean jerk of each part, at each of its frames; see `MotionCheck`."""
        timeline = explained(clip).timeline
        hips = [JOINT["right_hip"], JOINT["left_hip"]]
        root = timeline.spread(clip.joints[:, hips].mean(axis=1))
        value = np.full((len(root), 1), np.nan)
        if np.isfinite(root).any():
            smooth = low_pass(_filled(root), clip.step, self.cutoff)
            jerk = norm(np.diff(smooth, n=3, axis=0)) / clip.step**3
            for part in parts(len(root), clip.step):
                mean = jerk[part.start : max(part.stop - 3, part.start + 1)].mean()
                value[part] = np.fmax(value[part], mean)
        return Findings(value=timeline.of_frames(value), lower=np.array(-np.inf), upper=np.array(self.most))


def low_pass(way: Array, step: float, cutoff: float) -> Array:
    r"""Filter the columns of (S, K) without delay.

    The gain of a digital Butterworth filter of order n, forward and backward, is
    :math:`1 / (1 + (\tan \pi f \Delta t / \tan \pi f_c \Delta t)^{2n})` (Oppenheim & Schafer 2010, section 7.2).
    """
    pad = min(round(PADDED_SECONDS / step), len(way) - 1)
    before, after = 2.0 * way[:1] - way[pad:0:-1], 2.0 * way[-1:] - way[-2 : -2 - pad : -1]
    padded = np.concatenate([before, way, after])
    frequency = np.minimum(np.fft.rfftfreq(len(padded), step), 0.4999 / step)
    ratio = np.tan(np.pi * frequency * step) / np.tan(np.pi * cutoff * step)
    gain = 1.0 / (1.0 + ratio ** (2 * BUTTERWORTH_ORDER))
    trend = np.linspace(padded[0], padded[-1], len(padded))
    smooth = np.fft.irfft(np.fft.rfft(padded - trend, axis=0) * gain[:, None], len(padded), axis=0) + trend
    return np.asarray(smooth[pad : pad + len(way)])


def _filled(way: Array) -> Array:
    """Fill what is not known of (S, 3) by straight lines."""
    slots, known = np.arange(len(way)), np.isfinite(way[:, 0])
    return np.stack([np.interp(slots, slots[known], column[known]) for column in way.T], axis=1)


def parts(count: int, step: float) -> Iterator[slice]:
    """Go through the parts of so many slots."""
    size, overlap, least = (
        round(seconds / step) for seconds in (CHUNK_SECONDS, OVERLAP_SECONDS, LEAST_SECONDS)
    )
    start = 0
    while count - start >= max(least, 4):
        end = count if start + size + least - overlap > count else start + size
        yield slice(start, end)
        start += size - overlap
