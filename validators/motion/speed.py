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


@dataclass(frozen=True, kw_only=True)
class Derivative(MotionCheck):
    """A derivative of the way of each joint against bounds for the trunk and for limbs.

    Parameters
    ----------
    trunk : float
        Of neck, shoulders, pelvis and hips, in metres and seconds.
    limbs : float
        Of the other joints.

    Attributes
    ----------
    order : int
        Of the derivative.
    """

    order: ClassVar[int]
    needs: ClassVar[tuple[str, ...]] = ("time",)

    trunk: float
    limbs: float

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name the joints; see `MotionCheck`."""
        del clip
        return JOINTS

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
            upper=np.where(np.arange(len(JOINTS)) < N_TRUNK_JOINTS, self.trunk, self.limbs),
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


@dataclass(frozen=True, kw_only=True)
class JointSpeed(Derivative):
    """Whether joints move faster than people have been measured to; see `Derivative`."""

    name = "speed"
    unit = "m/s"
    meaning = "a joint moves faster than people can"
    order = 1

    trunk: float = 14.0
    limbs: float = 30.0


@dataclass(frozen=True, kw_only=True)
class JointAcceleration(Derivative):
    """Whether joints change their speed faster than people can; see `Derivative`."""

    name = "acceleration"
    unit = "m/s²"
    meaning = "the speed of a joint changes faster than that of people can"
    order = 2

    trunk: float = 400.0
    limbs: float = 1200.0


@dataclass(frozen=True, kw_only=True)
class JointJerk(Derivative):
    """Whether the acceleration of joints changes faster than that of people can; see `Derivative`."""

    name = "jerk"
    unit = "m/s³"
    meaning = "the acceleration of a joint changes faster than that of people can"
    order = 3

    trunk: float = 48_000.0
    limbs: float = 144_000.0
