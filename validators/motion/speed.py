"""How fast joints move, and how suddenly that changes: bounds of what people have been measured to do."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb
from typing import ClassVar, Final

import numpy as np

from posekit.geometry import Array
from posekit.skeleton import JOINTS, N_TRUNK_JOINTS
from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.explained import explained
from posekit.validators.motion.motion_check import MotionCheck
from posekit.validators.motion.timeline import centred, filtered, norm

SHORTEST_SECONDS: Final = 1.0 / 60.0
"""Differences are taken over no less: bounds hold for motion of so many hertz, and more frames a second add noise."""

NOISE_FACTOR: Final = 5.0
"""Standard deviations of measuring by which a difference may be off."""


class Derivative(MotionCheck):
    """A derivative of the way of each joint against bounds for the trunk and for limbs.

    Attributes
    ----------
    order : int
        Of the derivative.
    """

    order: ClassVar[int]
    needs: ClassVar[tuple[str, ...]] = ("time",)

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the joints; see `MotionCheck`."""
        del clip
        return JOINTS

    def bounds(self) -> Array:
        """Return the upper bound of each joint (14,)."""
        raise NotImplementedError

    def judge(self, clip: MotionClip) -> Findings:
        """Take the difference of that order over a sixtieth of a second or a frame; see `MotionCheck`."""
        found = explained(clip)
        stride = max(round(SHORTEST_SECONDS / clip.step), 1)
        weights = np.zeros(self.order * stride + 1)
        weights[::stride] = [(-1.0) ** (self.order - k) * comb(self.order, k) for k in range(self.order + 1)]
        seconds = (stride * clip.step) ** self.order
        values = norm(filtered(found.joints, weights)) / seconds
        values = centred(values, found.timeline.count, (self.order * stride + 1) // 2)
        if self.order == 1:
            values = np.where(np.isnan(values), _over_gaps(found.joints) / clip.step, values)
        spread = np.sqrt(3.0 * comb(2 * self.order, self.order)) * clip.noise / seconds
        return Findings(
            value=found.timeline.of_frames(values),
            lower=np.array(-np.inf),
            upper=self.bounds(),
            tolerance=NOISE_FACTOR * float(spread),
        )


def _over_gaps(joints: Array) -> Array:
    """Return metres a slot from where each joint was last known (S, 14): NaN where it was not or is not."""
    slots = np.arange(len(joints))[:, None]
    known = np.isfinite(joints[..., 0])
    last = np.maximum.accumulate(np.where(known, slots, -1), axis=0)
    before = np.concatenate([np.full((1, last.shape[1]), -1), last[:-1]])[: len(joints)]
    gap = known & (before >= 0) & (before < slots - 1)
    ways = np.full(known.shape, np.nan)
    at, joint = np.nonzero(gap)
    from_slot = before[at, joint]
    ways[at, joint] = norm(joints[at, joint] - joints[from_slot, joint]) / (at - from_slot)
    return ways


def trunk_and_limbs(trunk: float, limbs: float) -> Array:
    """Return a bound for each joint (14,)."""
    return np.where(np.arange(len(JOINTS)) < N_TRUNK_JOINTS, trunk, limbs)


@dataclass(frozen=True, kw_only=True)
class JointSpeed(Derivative):
    """Whether joints move faster than people have been measured to.

    Parameters
    ----------
    trunk : float
        Metres a second of neck, shoulders, pelvis and hips.
    limbs : float
        Metres a second of the other joints.
    """

    name = "speed"
    unit = "m/s"
    meaning = "a joint moves faster than people can"
    order = 1

    trunk: float = 14.0
    limbs: float = 30.0

    def bounds(self) -> Array:
        """Return the upper bound of each joint (14,)."""
        return trunk_and_limbs(self.trunk, self.limbs)
