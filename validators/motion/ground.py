"""Where the ground of a clip is, by where its body rests, and how high frames are above it.

The ground is not measured: it is where points of the body are at rest. Its lowest level is the 5th percentile of the
lowest point over the frames in which something rests, its highest level the 98th: feet are seldom flat, some stand on
stairs, and a recording's volume is never quite level. What is below the lowest level is in the ground, what is above
the highest without rest is in the air; between them nothing is said.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.body.stature import SHANK_OF_STATURE, THIGH_OF_STATURE
from posekit.geometry import Array
from posekit.ranking.centre_of_mass import centre_of_mass
from posekit.skeleton import FEET_POINTS, JOINT, SIDES
from posekit.validators.motion.carried import carried
from posekit.validators.motion.clip import MotionClip, once_a_clip
from posekit.validators.motion.lifted import lifted_by
from posekit.validators.motion.timeline import norm, timeline_of

TOE_METRES: Final = 0.02
"""Height of the points of toes and heels over the sole of a foot that stands: joints and labels lie inside it."""

FOOT_SHARE: Final = 0.152
"""Length of the foot, of the stature (Winter 2009, Biomechanics and Motor Control, figure 4.1)."""

FORWARD_SHARE: Final = 0.75
"""Of the foot's length, that is before the ankle."""

ANKLE_SHARE: Final = 0.039
"""Height of the ankle over the sole, of the stature (Winter 2009, Biomechanics and Motor Control, figure 4.1)."""

LEG_SHARE: Final = THIGH_OF_STATURE + SHANK_OF_STATURE
"""Thigh and shank, of the stature (same figure)."""

USUAL_STATURE: Final = 1.7
"""Metres, of whoever has no legs to tell it by."""

REST_SPEED: Final = 0.25
"""Metres a second below which a point rests; a foot's parts move so slowly in stance, in no part of a swing."""

HEELS_OF_SIDES: Final = (FEET_POINTS.index("right_heel"), FEET_POINTS.index("left_heel"))

NEAR_METRES: Final = 0.30
"""What rests carries where it is not this much higher than the body's lowest point."""

BY_CHANCE: Final = 3
"""Frames at rest below which nothing is known of the ground."""

AIR_METRES: Final = 0.03
"""Above the highest level of the ground by which a body that nothing holds is in the air."""

TIPTOE_SHARE: Final = np.hypot(FORWARD_SHARE * FOOT_SHARE, ANKLE_SHARE) - ANKLE_SHARE
"""Of the stature, by which the ankle rises of a foot that is held by its toes: more than that is in the air, where toes
are not known."""


TURNING_RATE: Final = 20.0
"""Frames a second: at fewer, who is at the top of a jump is at one height before and after it, and rests nowhere."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Ground:
    """The ground of a clip, and T frames against it; heights are along up, in metres.

    Parameters
    ----------
    low : float
        Its lowest level.
    high : float
        How far its highest level is above that.
    offset : float
        How far `low` is above the ground that was given; 0 where none was.
    lifted : array (T,)
        By how much frames are lifted as a whole against those around them.
    lowest : array (T,)
        The lowest sole, or joint, over `low`, without what `lifted` says.
    resting : bool array (T,)
        Whether something that can carry the body rests.
    hanging : bool array (T,)
        Whether what rests got there with no step and no jump.
    centre : array (T,)
        The centre of mass, along up.
    in_air : bool array (T,)
        Whether nothing rests, and the body is above all levels of the ground: higher than on the toes that it has.
    """

    low: float
    high: float
    offset: float
    lifted: Array
    lowest: Array
    resting: NDArray[np.bool_]
    hanging: NDArray[np.bool_]
    centre: Array
    in_air: NDArray[np.bool_]


@once_a_clip
def stature_of(clip: MotionClip) -> float:
    """Return the stature, metres, by the median length of the legs; NaN where no leg is known."""
    legs = [
        norm(clip.joints[:, JOINT[f"{side}_{upper}"]] - clip.joints[:, JOINT[f"{side}_{lower}"]])
        for side in SIDES
        for upper, lower in (("hip", "knee"), ("knee", "ankle"))
    ]
    medians = [float(np.median(leg[np.isfinite(leg)])) for leg in legs if np.isfinite(leg).any()]
    return 2 * float(np.mean(medians)) / LEG_SHARE if medians else np.nan


def _stature(clip: MotionClip) -> float:
    stature = stature_of(clip)
    return stature if stature > 0 else USUAL_STATURE


def soles(clip: MotionClip) -> tuple[Array, Array]:
    """Return the points of feet (T, 6, 3), toes, heels and ankles, and how high each is over its sole (6,)."""
    ankles = clip.joints[:, [JOINT["right_ankle"], JOINT["left_ankle"]]]
    toes = TOE_METRES if clip.q is None else 0.0  # a robot's are the ends of its soles
    over = np.array([toes] * len(FEET_POINTS) + [ANKLE_SHARE * _stature(clip)] * 2)
    return np.concatenate([clip.feet, ankles], axis=1), over


def speeds(clip: MotionClip, points: Array, frames: int = 1) -> Array:
    """Return how fast points (T, P, 3) move, metres a second, from so many frames before to after; NaN at ends.

    Under `TURNING_RATE` frames a second it is the faster of the way before and of that after a frame.
    """
    line = timeline_of(clip)
    placed = line.spread(points)
    fast = np.full(placed.shape[:2], np.nan)
    if len(placed) > 2 * frames:
        if clip.rate < TURNING_RATE:
            ways = norm(placed[frames:] - placed[:-frames]) / (frames * clip.step)
            fast[frames:-frames] = np.maximum(ways[:-frames], ways[frames:])
        else:
            fast[frames:-frames] = norm(placed[2 * frames :] - placed[: -2 * frames]) / (
                2 * frames * clip.step
            )
    return line.of_frames(fast)


@once_a_clip
def ground_of(clip: MotionClip) -> Ground:
    """Find the ground of a clip whose way up is known; of one clip once."""
    feet, over = soles(clip)
    up = np.zeros(3) if clip.up is None else clip.up
    line = timeline_of(clip)
    points = np.concatenate([clip.joints, feet[:, : len(FEET_POINTS)]], axis=1)
    height = points @ up
    legs = slice(JOINT["right_ankle"], None)  # the ankles are the last joints, toes and heels come after them
    lifted = line.of_frames(lifted_by(line.spread(height), legs, clip.rate, clip.noise))
    lifted = np.where(np.isfinite(lifted), lifted, 0.0)
    over_ground = feet @ up - over
    for side in range(len(SIDES)):
        # The ankle of a foot whose heel is not known is its heel: it is down when the toes are up.
        if np.isfinite(over_ground[:, HEELS_OF_SIDES[side]]).any():
            over_ground[:, len(FEET_POINTS) + side] = np.nan
    sole = np.fmin.reduce(over_ground, axis=1)
    lowest = np.fmin(sole, np.fmin.reduce(height, axis=1)) - lifted
    near = height - lifted[:, None] < lowest[:, None] + NEAR_METRES
    slow = speeds(clip, points - (lifted[:, None] * up)[:, None]) < REST_SPEED + 2 * _speed_noise(clip)
    centre = up @ centre_of_mass(np.moveaxis(clip.joints, 0, -1))
    still = (near & slow).any(axis=1)
    resting = carried(still, lowest, centre, clip.step)
    held = lowest[resting & np.isfinite(lowest)]
    if len(held) < BY_CHANCE:
        held = lowest[np.isfinite(lowest)]
        low, high = np.percentile(held, (5, 50)) if len(held) else (np.nan, np.nan)
    else:
        low, high = np.percentile(held, (5, 98))
    toes = np.isfinite(feet[:, : len(FEET_POINTS)]).any()
    air = AIR_METRES + (0.0 if toes else TIPTOE_SHARE * _stature(clip))
    return Ground(
        low=float(low),
        high=float(high - low),
        offset=0.0 if clip.ground is None else float(low - clip.ground),
        lifted=lifted,
        lowest=lowest - low,
        resting=resting,
        hanging=still & ~resting,
        centre=centre,
        in_air=~resting & (lowest > high + air),
    )


def _speed_noise(clip: MotionClip) -> float:
    """Return the standard deviation of a speed between the neighbours of a frame."""
    frames = 1.0 if clip.rate < TURNING_RATE else 2.0
    return np.sqrt(2) * clip.noise / (frames * clip.step) if clip.step > 0 else 0.0


def ground_unknown(clip: MotionClip) -> str:
    """Say why nothing is known of the ground under a clip whose way up is known; empty where something is."""
    return "" if np.isfinite(ground_of(clip).low) else "no height of a foot or a joint is known"
