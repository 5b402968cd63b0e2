r"""Rules of walking over strides: by the speeds and phases of limbs.

Of Lee & Chen's rules (1985, §3.3) the first, second and fourth speak of motion: what swings forward or backward "at the
same time", and in which plane. Over a stride that is seen. Two swings a and b out of the body plane are in step or in
turn by the correlation of their speeds

.. math:: r = \overline{\dot a \dot b} / \sqrt{\overline{\dot a^2}\;\overline{\dot b^2}},

the cosine of the angle between their phases if both are sinusoidal. The body plane is normal to the way of the hips: a
body whose hips rest does not walk, and a limb that hardly moves does not swing; nothing is said of these.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import refusal
from posekit.geometry import Array, cross, dot, perpendicular, unit
from posekit.skeleton import JOINT, SIDES
from posekit.validators.body import Body
from posekit.validators.check import Judgement, check
from posekit.validators.motion.timeline import norm, timeline_of

#: Rules that speak of motion; Rules 3 and 5 are of an instant.
RULES_OVER_STRIDES: Final = (1, 2, 4)

LIMB_PARTS: Final = (("arm", "shoulder", "elbow", "wrist"), ("leg", "hip", "knee", "ankle"))

#: Speed of the hips below which nobody walks, metres a second: half of a slow walk, several times a standing sway.
SLOWEST_WALK: Final = 0.3

#: Share of a stride whose frames must be known.
LEAST_PART: Final = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class Strides:
    """A body's joints around each frame, half a stride before it and half after it.

    Parameters
    ----------
    joints : array (S, 14, 3)
        Metres, at even times; NaN where unknown.
    step : float
        Seconds from one to the next.
    half : int
        Frames of half a stride.
    """

    joints: Array
    step: float
    half: int

    def mean(self, values: Array) -> Array:
        """Return the mean over the stride around each frame (S, ...); NaN where too few are known."""
        known = np.isfinite(values)
        sums = [np.cumsum(part, axis=0) for part in (np.where(known, values, 0.0), known.astype(np.float64))]
        last = len(values) - 1
        ends = np.minimum(np.arange(len(values)) + self.half, last)
        starts = np.arange(len(values)) - self.half - 1
        total, count = (
            each[ends] - np.where(_column(starts >= 0, each), each[np.maximum(starts, 0)], 0.0)
            for each in sums
        )
        enough = count >= LEAST_PART * (2 * self.half + 1)
        return np.asarray(np.where(enough, total / np.where(enough, count, 1.0), np.nan))

    def rate(self, values: Array) -> Array:
        """Return how fast values (S, ...) change, per second."""
        if len(values) < 2:
            return np.full(values.shape, np.nan)
        return np.asarray(np.gradient(values, self.step, axis=0))

    def joint(self, name: str) -> Array:
        """Return the positions of a joint (S, 3)."""
        return self.joints[:, JOINT[name]]

    @cached_property
    def velocity(self) -> Array:
        """Velocity of the middle of the hips (S, 3), metres a second."""
        return self.mean(self.rate((self.joint("right_hip") + self.joint("left_hip")) / 2))

    @cached_property
    def speed(self) -> Array:
        """Speed of the hips across the trunk's own axis (S,)."""
        return norm(perpendicular(self.velocity, self._down))

    @cached_property
    def _down(self) -> Array:
        return unit(self.mean(self.joint("pelvis") - self.joint("neck")))

    @cached_property
    def _forward(self) -> Array:
        return unit(perpendicular(self.velocity, self._down))

    def swing(self, name: str) -> Array:
        """Return how far a joint is out of the body plane (S,), metres, from the middle of its swing."""
        out = dot(self.joint(name) - self.joint("neck"), self._forward)
        return np.asarray(out - self.mean(out))

    def in_step(self, one: str, other: str, least: float) -> Array:
        """Return the correlation of the speeds of two swings (S,); NaN where either swings by less than `least`."""
        a, b = self.swing(one), self.swing(other)
        swings = (self.mean(a * a) >= least**2) & (self.mean(b * b) >= least**2)
        a, b = self.rate(a), self.rate(b)
        both = np.sqrt(self.mean(a * a) * self.mean(b * b))
        return np.where(swings, self.mean(a * b) / np.where(swings, both, 1.0), np.nan)

    def across(self, girdle: str, end: str, least: float) -> Array:
        """Return the part of the speed of a limb's end that is across the moving direction (S,)."""
        limb = self.joint(end) - self.joint(girdle)
        along, over = (
            self.rate(dot(limb, axis)) for axis in (self._forward, cross(self._forward, self._down))
        )
        swings = self.mean(self.swing(end) ** 2) >= least**2
        square = self.mean(over * over)
        both = square + self.mean(along * along)
        return np.where(swings, np.sqrt(square / np.where(swings, both, 1.0)), np.nan)


def _column(flags: NDArray[np.bool_], like: Array) -> NDArray[np.bool_]:
    return flags.reshape(-1, *[1] * (like.ndim - 1))


@check("walking-phases", unit="1", reads=("joints", "time"), over_time=True)
def walking_phases(
    body: Body,
    *,
    rules: str = "1,2,4",
    slowest: float = SLOWEST_WALK,
    stride: float = 1.2,
    swing: float = 0.03,
    in_step: float = 0.0,
    across: float = 0.71,
) -> Judgement:
    """Limbs do not swing in turn, or not along the moving direction, as walkers' do.

    Rules 1 and 2: the two arms, the two legs, arm and leg of one side swing in turn, r <= 0. Rule 4: wrists and ankles
    move along the moving direction more than across it; the value is the part of their speed that is across.

    Parameters
    ----------
    rules : str
        Rules, by commas.
    slowest : float
        Speed of the hips below which nobody walks, metres a second.
    stride : float
        Seconds of a stride, half of it before a frame and half after.
    swing : float
        Least swing of elbows, knees, wrists and ankles, metres (root mean square).
    in_step : float
        Correlation from which limbs that are to swing in turn are in step: 0 is a quarter of a stride.
    across : float
        Largest part of a limb's speed that may be across: as much as along is the root of a half.
    """
    known = {str(rule) for rule in RULES_OVER_STRIDES}
    if not set(rules.split(",")) <= known:
        raise refusal("walking-phases", "rules", repr(rules), f"some of {', '.join(sorted(known))}")
    line = timeline_of(body)
    half = max(round(stride / 2 / body.dt), 1)
    strides = Strides(joints=line.spread(body.joints), step=body.dt, half=half)
    walks = strides.speed >= slowest
    found = [one for one in _found(strides, swing, in_step, across) if one[0][len("rule")] in rules]
    value = np.stack([np.where(walks, one, np.nan) for _, one, _ in found], axis=-1)
    places = tuple(place for place, _, _ in found)
    return Judgement(places, line.of_frames(value), upper=np.array([most for _, _, most in found]))


def _found(strides: Strides, swing: float, in_step: float, most: float) -> Iterator[tuple[str, Array, float]]:
    """Yield each place, its value (S,) and its bound."""
    for limb, girdle, middle, end in LIMB_PARTS:
        value = strides.in_step(f"right_{middle}", f"left_{middle}", swing)
        yield f"rule1.{limb}s", value, in_step
        for side in SIDES:
            value = strides.across(f"{side}_{girdle}", f"{side}_{end}", swing)
            yield f"rule4.{side}_{limb}", value, most
    for side in SIDES:
        value = strides.in_step(f"{side}_elbow", f"{side}_knee", swing)
        yield f"rule2.{side}", value, in_step
