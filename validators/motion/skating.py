r"""Published measures of skating, each by its name and as its authors compute it, from the points that there are.

They are for comparing with what is published. All three call much of what real feet do skating; `sliding` is the check
that does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.skeleton import SIDES
from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.ground import ground_of, soles
from posekit.validators.motion.motion_check import MotionCheck
from posekit.validators.motion.timeline import norm, timeline_of

SMOOTHED_FRAMES: Final = 5
"""Over which GMD's measure takes the mean speed."""


@dataclass(frozen=True, kw_only=True)
class _Skating(MotionCheck):
    """What the three have in common: the way of each foot's lowest point from frame to frame, while it is low.

    Parameters
    ----------
    height : float
        Metres over the ground up to which a foot touches it.
    way : float
        Metres in the measure's own frame that it may go.

    Attributes
    ----------
    rate : float
        The measure's own frames a second; NaN where it takes those of the clip.
    level : bool
        Whether the way along the ground alone counts.
    """

    unit = "m"
    needs = ("up", "time", "ground")
    rate: ClassVar[float] = np.nan
    level: ClassVar[bool] = True

    height: float
    way: float

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the feet; see `MotionCheck`."""
        del clip
        return tuple(f"{side}_foot" for side in SIDES)

    def judge(self, clip: MotionClip) -> Findings:
        """Measure the ways of feet; see `MotionCheck`."""
        moved, height = _ways(clip, *_feet(clip), level=self.level)
        frames = 1.0 if np.isnan(self.rate) else self.rate * clip.step
        value = np.where(height < self.height, self._smoothed(moved / frames), 0.0)
        found = np.concatenate([np.full((1, len(SIDES)), np.nan), value])
        return Findings(
            value=timeline_of(clip).of_frames(found), lower=np.array(-np.inf), upper=np.array(self.way)
        )

    def _smoothed(self, ways: Array) -> Array:
        return ways


@dataclass(frozen=True, kw_only=True)
class GmdSkating(_Skating):
    """Guided Motion Diffusion's foot skating (Karunratanakul et al. 2023, ICCV, section 5 and its code).

    The way of a foot along the ground from frame to frame at 20 frames a second, the mean of five, where it is lower
    than `height` in both. `way` is in metres in a twentieth of a second.
    """

    name = "skating-gmd"
    meaning = "a foot on the ground goes too far in a frame (GMD)"
    rate = 20.0

    height: float = 0.05
    way: float = 0.025

    def _smoothed(self, ways: Array) -> Array:
        padded = np.pad(ways, ((2, 2), (0, 0)))
        return np.asarray(np.mean([padded[k : k + len(ways)] for k in range(SMOOTHED_FRAMES)], axis=0))


@dataclass(frozen=True, kw_only=True)
class WhamSliding(_Skating):
    """WHAM's foot sliding (Shin et al. 2024, CVPR, section 4 and its code).

    The way of a foot from frame to frame, at 30 frames a second, while it is in contact. There contact is where the
    true body's foot goes less than a centimetre; here the clip is all there is, so contact is where its lowest
    point is less than `height` over the ground. `way` is in metres in a thirtieth of a second.
    """

    name = "skating-wham"
    meaning = "a foot in contact goes too far in a frame (WHAM)"
    rate = 30.0
    level = False

    height: float = 0.05
    way: float = 0.01


@dataclass(frozen=True, kw_only=True)
class PhysDiffSkate(_Skating):
    """PhysDiff's Skate (Yuan et al. 2023, ICCV, section 4): the way along the ground of feet that touch it.

    A foot touches the ground in a frame where it is less than `height` over it; what counts is the way to the next
    frame where it touches it in both. `way` is in metres a frame.
    """

    name = "skating-physdiff"
    meaning = "a foot that touches the ground in two frames goes along it (PhysDiff)"

    height: float = 0.005
    way: float = 0.005


def _feet(clip: MotionClip) -> tuple[Array, Array]:
    """Return a point of each foot (T, 2, 3), its toe or else its ankle, and how high each is over the sole (2,)."""
    points, over = soles(clip)
    known: NDArray[np.bool_] = np.asarray(np.isfinite(points).any(axis=(0, 2)))
    which = [side if known[side] else side + 4 for side in range(2)]
    return points[:, which], over[which]


def _ways(clip: MotionClip, points: Array, over: Array, *, level: bool) -> tuple[Array, Array]:
    """Return the way of feet from each slot to the next (S - 1, 2), and their greater height in the two."""
    line, ground = timeline_of(clip), ground_of(clip)
    up = np.zeros(3) if clip.up is None else clip.up
    placed = line.spread(points)
    moved = np.diff(placed, axis=0)
    if level:
        moved = moved - (moved @ up)[..., None] * up
    height = np.asarray(placed @ up - over) - (ground.low if clip.ground is None else clip.ground)
    higher: Array = np.maximum(height[1:], height[:-1])
    return norm(moved), higher
