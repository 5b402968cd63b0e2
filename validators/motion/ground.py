r"""The ground of a clip, estimated from resting parts of the body, and the heights of the body above it.

Files do not state the height of the ground, but parts of the body rest on it. The estimate uses the heights of the
lowest point in frames in which a part rests. The 5th percentile of these heights is the lowest level of the ground, and
their 98th percentile is the highest level. The levels differ because feet are seldom horizontal, people climb stairs,
and floors are not quite level. A point below the lowest level penetrates the ground. A body above the highest level
without a resting part is in the air. Heights between the levels are not judged.

A recording may also contain frames that are shifted up or down as a whole. Then all points of the body make the same
vertical step between two frames. While a foot rests, real motion has no such steps. Let d be the vertical displacement
from frame to frame. The step at frame t is the median over points of
:math:`d_t - \mathrm{median}(d_{t-2}, d_{t-1}, d_{t+1}, d_{t+2})`, if nine tenths of the points agree on its sign. A
foot must rest before and after the step, because all points of a body in the air may move together. The shifted frames
lie between a step and the next step in the opposite direction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, known_median, mean_known, norm, runs
from posekit.ranking.standing import centre_of_mass
from posekit.skeleton import FEET_POINTS, JOINT, SIDES, both
from posekit.validators.body import LIMB_ROWS, Body, once
from posekit.validators.motion.timeline import centred, spaced, timeline_of

#: Height of the points of toes and heels above the sole, metres; joints and labels lie inside the foot.
TOE_METRES: Final = 0.02

#: Length of the foot, as a share of the stature (Winter 2009, Biomechanics and Motor Control, figure 4.1).
FOOT_SHARE: Final = 0.152

#: Part of the foot that is in front of the ankle, as a share of its length.
FORWARD_SHARE: Final = 0.75

#: Height of the ankle above the sole, as a share of the stature (same figure).
ANKLE_SHARE: Final = 0.039

#: Length of thigh and shank, as a share of the stature (same figure).
LEG_SHARE: Final = 0.245 + 0.246

#: Length of the hand, wrist to fingertips, as a share of the stature (same figure).
HAND_SHARE: Final = 0.108

#: Assumed stature if no leg is known, metres.
USUAL_STATURE: Final = 1.7

#: Largest speed of a resting point, metres per second: a foot is slower in stance and faster in swing.
REST_SPEED: Final = 0.25

#: Largest height of a resting point that carries the body above the lowest point of the body, metres.
NEAR_METRES: Final = 0.30

#: Minimum number of frames with a resting part for an estimate of the ground.
BY_CHANCE: Final = 3

#: Minimum height of a body in the air above the highest level of the ground, metres.
AIR_METRES: Final = 0.03

#: Rise of the ankle on tiptoe, as a share of the stature; used if toes are unknown.
TIPTOE_SHARE: Final = np.hypot(FORWARD_SHARE * FOOT_SHARE, ANKLE_SHARE) - ANKLE_SHARE


#: Minimum rate, frames per second, for central differences: at lower rates the frames around the top of a jump have one
#: height, which looks like rest.
TURNING_RATE: Final = 20.0

#: Minimum vertical step of shifted frames, metres; clean recordings at 30 Hz have steps of up to 0.7 cm.
LEAST_STEP_METRES: Final = 0.012

#: Minimum vertical step of shifted frames without a resting foot, metres, and minimum frame rate, frames per second.
#: Clean recordings have steps of up to 13 cm (a backflip).
SURE_STEP_METRES, SURE_RATE = 0.15, 16.0

#: Largest difference between a step and the opposite step, as a share of the larger step.
SAME_SHARE: Final = 0.35

#: Minimum number of shifted frames in succession; fewer frames are a jump of the body.
SHORTEST_FRAMES: Final = 3

#: Largest vertical displacement of a resting foot in the frames before and after a step, metres.
REST_METRES: Final = 0.01

#: Largest difference between heights at which a body rests on one ground, metres.
LEVEL_METRES: Final = 0.05

#: Shortest flight in which the fall can be separated from the motion of limbs, seconds.
SHORTEST_FLIGHT: Final = 0.25

#: Acceleration of gravity, metres per second squared.
GRAVITY_ACCELERATION: Final = 9.81

#: Minimum number of frames for an estimate of the acceleration of the centre of mass.
FEWEST_FRAMES: Final = 6

#: Minimum downward acceleration of the centre of mass in the air, as a share of gravity; whole jumps have 0.8 to 1.1.
FALL_SHARE: Final = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class Ground:
    """Height of the ground in a clip of T frames, and heights of the body; all along up, in metres.

    Parameters
    ----------
    low : float
        Lowest level of the ground.
    high : float
        Height of the highest level above the lowest.
    height : array (T,)
        Height of the lowest sole or joint.
    lifted : array (T,)
        Upward shift of each frame as a whole relative to neighbouring frames.
    lowest : array (T,)
        Height of the lowest sole or joint above `low`, minus `lifted`.
    resting : bool array (T,)
        Whether a part near the lowest point of the body rests and carries the body.
    hanging : bool array (T,)
        Whether a part rests at a level that the body reached neither by a step nor by a jump.
    centre : array (T,)
        Height of the centre of mass.
    in_air : bool array (T,)
        Whether no part rests, and the whole body, including hands and toes, is above all levels of the ground.
    """

    low: float
    high: float
    height: Array
    lifted: Array
    lowest: Array
    resting: NDArray[np.bool_]
    hanging: NDArray[np.bool_]
    centre: Array
    in_air: NDArray[np.bool_]


@once
def stature_of(body: Body) -> float:
    """Estimate the stature, metres, from the median length of the legs; `USUAL_STATURE` if no leg is known."""
    legs = [known_median(leg) for leg in body.segment_lengths[LIMB_ROWS[4:]]]
    stature = 2 * float(mean_known(np.array(legs))) / LEG_SHARE
    return stature if stature > 0 else USUAL_STATURE


def up_of(body: Body) -> Array:
    """Return the unit vector against gravity (3,); the direction up of the body must be known."""
    return np.zeros(3) if body.up is None else body.up


@once
def soles(body: Body) -> tuple[Array, Array]:
    """Return toes, heels and ankles (T, 6, 3), and the heights of the soles below these points (T, 6), metres."""
    points = np.concatenate([body.feet, body.joints[:, both("ankle")]], axis=1)
    toes = TOE_METRES if body.q is None else 0.0  # a robot's points lie on its soles
    over = [toes] * len(FEET_POINTS) + [ANKLE_SHARE * stature_of(body)] * len(SIDES)
    return points, points @ up_of(body) - over


def speeds(body: Body, points: Array, frames: int = 1) -> Array:
    """Return the speeds of points (T, P), metres per second, by central differences over 2 `frames` frames.

    Speeds at the start and end are NaN. Below `TURNING_RATE` frames per second the result is the larger of the speeds
    before and after each frame.
    """
    line = timeline_of(body)
    placed = line.spread(points)
    if body.rate < TURNING_RATE:
        ways = norm(placed[frames:] - placed[:-frames]) / (frames * body.dt)
        fast = centred(np.maximum(ways[:-frames], ways[frames:]), len(placed), frames)
    else:
        fast = norm(spaced(placed, (-1.0, 0.0, 1.0), frames)) / (2 * frames * body.dt)
    return line.of_frames(fast)


@once
def ground_of(body: Body) -> Ground:
    """Estimate the ground of a body whose direction up is known."""
    feet, over_ground = soles(body)
    line, up = timeline_of(body), up_of(body)
    points = np.concatenate([body.joints, feet[:, : len(FEET_POINTS)]], axis=1)
    height = points @ up
    legs = slice(JOINT["right_ankle"], None)  # ankles, toes and heels
    lifted = line.of_frames(lifted_by(line.spread(height), legs, body.rate, body.noise))
    lifted = np.where(np.isfinite(lifted), lifted, 0.0)
    # If the heel of a foot is unknown, the ankle replaces it as a point of the sole.
    over_ground = over_ground.copy()
    over_ground[:, 4:][:, np.isfinite(over_ground[:, 2:4]).any(axis=0)] = np.nan
    sole = np.fmin.reduce(over_ground, axis=1)
    lowest = np.fmin(sole, np.fmin.reduce(height, axis=1)) - lifted
    near = height - lifted[:, None] < lowest[:, None] + NEAR_METRES
    frames = 1.0 if body.rate < TURNING_RATE else 2.0  # frames spanned by a speed
    noise = np.sqrt(2) * body.noise / (frames * body.dt) if body.dt > 0 else 0.0
    slow = speeds(body, points - (lifted[:, None] * up)[:, None]) < REST_SPEED + 2 * noise
    centre = centre_of_mass(body.joints) @ up
    still = (near & slow).any(axis=1)
    resting = carried(still, lowest, centre, body.dt)
    held = lowest[resting & np.isfinite(lowest)]
    if len(held) < BY_CHANCE:
        held = lowest[np.isfinite(lowest)]
        low, high = np.percentile(held, (5, 50)) if len(held) else (np.nan, np.nan)
    else:
        low, high = np.percentile(held, (5, 98))
    toes = np.isfinite(feet[:, : len(FEET_POINTS)]).any()
    air = AIR_METRES + (0.0 if toes else TIPTOE_SHARE * stature_of(body))
    # Palm and fingers of a hand that carries the body are below the wrist.
    hands = np.fmin.reduce(height[:, both("wrist")], axis=1) - lifted - HAND_SHARE * stature_of(body)
    return Ground(
        low=float(low),
        high=float(high - low),
        height=lowest + lifted,
        lifted=lifted,
        lowest=lowest - low,
        resting=resting,
        hanging=still & ~resting,
        centre=centre,
        in_air=~resting & (np.fmin(lowest, hands) > high + air),
    )


def carried(resting: NDArray[np.bool_], lowest: Array, centre: Array, step: float) -> NDArray[np.bool_]:
    """Return the frames in which a resting part carries the body.

    The result excludes frames in which parts rest in the air, at a level that the body reached neither by a step nor by
    a jump.

    Parameters
    ----------
    resting : bool array (T,)
        Whether a part of the body rests in each frame.
    lowest, centre : array (T,)
        Heights of the lowest point and of the centre of mass, metres.
    step : float
        Seconds from one frame to the next.

    Returns
    -------
    bool array (T,)
        Whether a resting part carries the body.
    """
    rests = runs(resting)
    if len(rests) < 2 or not step > 0:
        return resting
    group = np.zeros(len(rests), dtype=np.intp)
    levels = np.array([np.median(lowest[start:stop]) for start, stop in rests])
    for k in range(1, len(rests)):
        # The body may return to a level at which it rested earlier.
        alike = np.flatnonzero(~(np.abs(levels[:k] - levels[k]) > LEVEL_METRES))
        between = slice(rests[k - 1][1], rests[k][0])
        if len(alike):
            group[k] = group[alike[-1]]
        elif (between.stop - between.start) * step >= SHORTEST_FLIGHT and falls(centre[between], step):
            group[k] = group[k - 1]
        else:
            group[k] = group.max() + 1
    count = np.bincount(group, weights=[stop - start for start, stop in rests])
    left = resting.copy()
    for (start, stop), of in zip(rests, group, strict=True):
        left[start:stop] = of == count.argmax()
    return left


def falls(centre: Array, step: float, share: float = FALL_SHARE) -> bool:
    """Return whether a centre of mass with heights (N,) accelerates downward by at least `share` g; True if unknown.

    The acceleration is that of a fitted parabola.
    """
    known = np.isfinite(centre)
    if known.sum() < FEWEST_FRAMES:
        return True
    curve = np.polyfit(np.arange(len(centre))[known] * step, centre[known], 2)[0]
    return bool(2 * curve <= -share * GRAVITY_ACCELERATION)


def lifted_by(height: Array, feet: slice, rate: float, noise: float = 0.0) -> Array:
    """Return by how much frames are shifted upward as a whole relative to neighbouring frames.

    Parameters
    ----------
    height : array (S, P)
        Heights of points of the body along up, metres; NaN if unknown.
    feet : slice
        Indices of the points of the feet; a point of a foot must rest before and after a step.
    rate : float
        Frames per second; NaN if unknown.
    noise : float
        Standard deviation of measured coordinates, metres.

    Returns
    -------
    array (S,)
        Upward shift, metres; negative in lowered frames, 0 in most frames.
    """
    lifted = np.zeros(len(height))
    if len(height) < 2 * SHORTEST_FRAMES:
        return lifted
    steps = steps_of(height)
    way = np.abs(np.diff(height[:, feet], axis=0, prepend=np.nan, append=np.nan))
    # Displacements before the step and after it.
    beside = np.maximum(way[:-2], way[2:])
    rests = np.zeros(len(height), dtype=np.bool_)
    rests[1:] = (beside < REST_METRES + 3 * noise).any(axis=1)
    start = -1
    # At lower rates a falling body moves farther in a frame.
    longer = SURE_RATE / rate if rate < SURE_RATE else 1.0
    large = np.abs(steps) >= SURE_STEP_METRES * longer**2
    for frame in np.flatnonzero(large | (rests & (np.abs(steps) >= max(LEAST_STEP_METRES, 4 * noise)))):
        size = steps[frame]
        if start >= 0 and size * steps[start] < 0:
            larger = max(abs(size), abs(steps[start]))
            if abs(size + steps[start]) <= SAME_SHARE * larger:
                if frame - start >= SHORTEST_FRAMES:
                    lifted[start:frame] = (steps[start] - size) / 2
                start = -1
                continue
        start = int(frame)
    return lifted


def steps_of(height: Array) -> Array:
    """Return the common vertical step of most points at each frame (S,), metres; 0 if points disagree on its sign."""
    way = np.diff(height, axis=0)
    padded = np.pad(way, ((2, 2), (0, 0)), mode="edge")
    around = np.stack([padded[k : k + len(way)] for k in (0, 1, 3, 4)])
    around.sort(axis=0)
    beyond = np.sort(way - (around[1] + around[2]) / 2, axis=1)
    known = np.isfinite(beyond).sum(axis=1)
    rows, last = np.arange(len(way)), np.maximum(known - 1, 0)
    low = beyond[rows, (0.1 * last).astype(np.intp)]
    high = beyond[rows, np.ceil(0.9 * last).astype(np.intp)]
    median = beyond[rows, last // 2]
    agreed = (known >= 6) & ((low > 0) | (high < 0))
    return np.concatenate([[0.0], np.where(agreed, median, 0.0)])
