r"""Rules of walking over strides: by the speeds and phases of limbs, where there is a sequence.

Of Lee & Chen's rules (1985, §3.3) the first, second and fourth speak of motion: what swings forward or backward "at the
same time", and on which plane. In a single frame that is guessed from where limbs are; over a stride it is seen. Two
swings a and b out of the body plane are in step or in turn by the correlation of their speeds

.. math:: r = \overline{\dot a \dot b} / \sqrt{\overline{\dot a^2}\;\overline{\dot b^2}},

the cosine of the angle between their phases where both are sinusoidal. The body plane is normal to the way that the
hips go: where they go nowhere nobody walks, and a limb that hardly moves does not swing; nothing is said.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.skeleton import SIDES
from posekit.tree import Findings
from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.motion_check import MotionCheck
from posekit.validators.motion.strides import Strides
from posekit.validators.motion.timeline import timeline_of
from posekit.validators.walking import SLOWEST_WALK

RULES_OVER_STRIDES: Final = (1, 2, 4)
"""Those that speak of motion; Rules 3 and 5 are of an instant."""

LIMB_PARTS: Final = (("arm", "shoulder", "elbow", "wrist"), ("leg", "hip", "knee", "ankle"))


class StrideFinding(NamedTuple):
    """What is said at a place: value (S,), and the most that it may be."""

    place: str
    value: Array
    most: float


@dataclass(frozen=True, kw_only=True)
class WalkingPhases(MotionCheck):
    """Whether limbs swing as walkers' do: Rules 1, 2 and 4 of Lee & Chen 1985, §3.3, over strides.

    Rules 1 and 2: the two arms, the two legs, arm and leg of one side swing in turn, r <= 0. Rule 4: wrists and ankles
    move along the moving direction more than across it; the value is the part of their speed that is across.

    Parameters
    ----------
    rules : str
        Which of the rules, by commas.
    slowest : float
        Metres a second of the hips below which nobody walks.
    stride : float
        Seconds of a stride, half of it before a frame and half after.
    swing : float
        Metres (root mean square) that elbows, knees, wrists and ankles must swing.
    in_step : float
        The correlation from which limbs that are to swing in turn are in step: 0 is a quarter of a stride.
    across : float
        The most of a limb's speed that may be across: as much as along is the root of a half.
    """

    name = "walking-phases"
    unit = "1"
    meaning = "limbs do not swing in turn, or not along the moving direction, as walkers' do"
    needs = ("time",)

    rules: str = "1,2,4"
    slowest: float = SLOWEST_WALK
    stride: float = 1.2
    swing: float = 0.03
    in_step: float = 0.0
    across: float = 0.71

    def __post_init__(self) -> None:
        known = {str(rule) for rule in RULES_OVER_STRIDES}
        if not set(self.rules.split(",")) <= known:
            raise InputError(f"rules: {self.rules!r}; expected some of {', '.join(sorted(known))}, by commas")

    def places(self, clip: MotionClip) -> tuple[str, ...]:
        """Name what each rule is about; see `MotionCheck`."""
        return tuple(one.place for one in self._found(clip))

    def judge(self, clip: MotionClip) -> Findings:
        """Compare speeds around each frame; see `MotionCheck`."""
        found = self._found(clip)
        value = np.stack([one.value for one in found], axis=-1)
        most = np.array([one.most for one in found])
        return Findings(value=timeline_of(clip).of_frames(value), lower=np.array(-np.inf), upper=most)

    def _found(self, clip: MotionClip) -> list[StrideFinding]:
        joints = timeline_of(clip).spread(clip.joints)
        strides = Strides(joints=joints, step=clip.step, half=max(round(self.stride / 2 / clip.step), 1))
        walks = strides.speed >= self.slowest
        return [
            one._replace(value=np.where(walks, one.value, np.nan))
            for one in self._said(strides)
            if one.place[len("rule")] in self.rules
        ]

    def _said(self, strides: Strides) -> Iterator[StrideFinding]:
        for limb, girdle, middle, end in LIMB_PARTS:
            value = strides.in_step(f"right_{middle}", f"left_{middle}", self.swing)
            yield StrideFinding(f"rule1.{limb}s", value, self.in_step)
            for side in SIDES:
                value = strides.across(f"{side}_{girdle}", f"{side}_{end}", self.swing)
                yield StrideFinding(f"rule4.{side}_{limb}", value, self.across)
        for side in SIDES:
            value = strides.in_step(f"{side}_elbow", f"{side}_knee", self.swing)
            yield StrideFinding(f"rule2.{side}", value, self.in_step)
