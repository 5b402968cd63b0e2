"""PHUMA's rules for what a humanoid can learn from, other than the root's jerk.

Lee et al. 2025, PHUMA: Physically-Grounded Humanoid Locomotion Dataset, arXiv 2510.26236, section 3.1 and the code of
its curation. Clips are judged in parts of four seconds that overlap by half a second. They take vertices of SMPL-X's
feet; here there are points of feet, so a contact is one of them being as near the ground.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posekit.geometry import Array
from posekit.skeleton import FEET_POINTS, JOINT, SIDES
from posekit.tree import Findings
from posekit.validators.motion.base_of_support import beyond_support
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.ground import soles
from posekit.validators.motion.motion_check import MotionCheck
from posekit.validators.motion.root_jerk import LEAST_SECONDS, parts
from posekit.validators.motion.timeline import timeline_of


class _Curation(MotionCheck):
    """What the rules have in common."""

    needs = ("up", "time", "ground")

    def not_asked(self, clip: MotionClip) -> str:
        """Ask nothing of short clips; see `MotionCheck`."""
        short = "" if len(clip) * clip.step >= LEAST_SECONDS else f"it needs {LEAST_SECONDS:g} s of motion"
        return super().not_asked(clip) or short


@dataclass(frozen=True, kw_only=True)
class ContactShare(_Curation):
    """In what share of four seconds a foot touches the ground.

    Parameters
    ----------
    least : float
        The share.
    window : float
        Metres: heights of soles within so much are the ground's; the ground is where most frames have theirs.
    """

    name = "contact-share"
    unit = "1"
    meaning = "the feet touch the ground in too few frames, over seconds (PHUMA)"

    least: float = 0.6
    window: float = 0.05

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the feet; see `MotionCheck`."""
        del clip
        return ("feet",)

    def judge(self, clip: MotionClip) -> Findings:
        """Measure the share in each part, at each of its frames; see `MotionCheck`."""
        height, level = _soles(clip), _voted(clip, self.window)
        touches = np.asarray((np.abs(height - level) <= self.window / 2).any(axis=1), dtype=np.float64)
        return Findings(
            value=_of_parts(clip, touches[:, None], worst=np.fmin),
            lower=np.array(self.least),
            upper=np.array(np.inf),
        )


@dataclass(frozen=True, kw_only=True)
class RootHeight(_Curation):
    """How high the root, the middle of the hips, is over the ground.

    Parameters
    ----------
    least, most : float
        Metres.
    window : float
        As `ContactShare` has it.
    """

    name = "root-height"
    unit = "m"
    meaning = "the hips are too low or too high over the ground (PHUMA)"

    least: float = 0.6
    most: float = 1.5
    window: float = 0.05

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the root; see `MotionCheck`."""
        del clip
        return ("root",)

    def judge(self, clip: MotionClip) -> Findings:
        """Measure the height; see `MotionCheck`."""
        hips = clip.height[:, [JOINT[f"{side}_hip"] for side in SIDES]].mean(axis=1)
        value = (hips - _voted(clip, self.window))[:, None]
        return Findings(value=value, lower=np.array(self.least), upper=np.array(self.most))


@dataclass(frozen=True, kw_only=True)
class SupportDistance(_Curation):
    """How far root and pelvis are, on the mean of four seconds, from over the hull of ankles and toes.

    Parameters
    ----------
    root : float
        Metres of the middle of the hips, which is SMPL's pelvis.
    pelvis : float
        Metres of the pelvis joint, some 10 cm above, which is SMPL's first joint of the spine.
    """

    name = "support-distance"
    unit = "m"
    meaning = "the trunk is not over the feet, over seconds (PHUMA)"

    root: float = 0.06
    pelvis: float = 0.11

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name root and pelvis; see `MotionCheck`."""
        del clip
        return "root", "pelvis"

    def judge(self, clip: MotionClip) -> Findings:
        """Measure the mean distance in each part, at each of its frames; see `MotionCheck`."""
        up = np.zeros(3) if clip.up is None else clip.up
        feet, _ = soles(clip)
        hips = clip.joints[:, [JOINT[f"{side}_hip"] for side in SIDES]].mean(axis=1)
        away = np.stack(
            [beyond_support(point, feet, up) for point in (hips, clip.joints[:, JOINT["pelvis"]])], axis=1
        )
        value = _of_parts(clip, np.maximum(away, 0.0), worst=np.fmax)
        return Findings(value=value, lower=np.array(-np.inf), upper=np.array([self.root, self.pelvis]))


def _soles(clip: MotionClip) -> Array:
    """Return the heights of soles (T, P) along up, by toes and heels, or by ankles where there are none."""
    feet, over = soles(clip)
    height = np.asarray(feet @ (np.zeros(3) if clip.up is None else clip.up)) - over
    toes = height[:, : len(FEET_POINTS)]
    return np.asarray(toes if np.isfinite(toes).any() else height[:, len(FEET_POINTS) :])


def _voted(clip: MotionClip, window: float) -> float:
    """Return the ground that is given, or the middle of the window of heights that has most frames."""
    if clip.ground is not None:
        return clip.ground
    lowest = np.sort(np.fmin.reduce(_soles(clip), axis=1))
    lowest = lowest[np.isfinite(lowest)]
    if not len(lowest):
        return np.nan
    votes = np.searchsorted(lowest, lowest + window, side="right") - np.arange(len(lowest))
    return float(np.median(lowest[votes == votes.max()]) + window / 2)


def _of_parts(clip: MotionClip, values: Array, *, worst: np.ufunc) -> Array:
    """Return, for each frame, the worst mean of values (T, K) over the parts of the clip that it is in."""
    line = timeline_of(clip)
    placed = line.spread(values)
    found = np.full(placed.shape, np.nan)
    for part in parts(len(placed), clip.step):
        known = np.isfinite(placed[part])
        count = known.sum(axis=0)
        mean = np.where(known, placed[part], 0.0).sum(axis=0) / np.where(count > 0, count, np.nan)
        found[part] = worst(found[part], mean)
    return line.of_frames(found)
