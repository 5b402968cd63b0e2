r"""Sentences beside the findings: where the ground is, remedies of known causes, doubts about the frame rate.

The rate shows in how bodies fall, and how they keep their balance. A clip played k times too fast has k times the
speeds and :math:`k^2` times the accelerations. Gravity does not scale:

- a body in the air falls with :math:`g`, and nothing pulls a body down faster;
- the force of the ground passes near the centre of mass c. It meets the ground at :math:`c - \ddot c \, h / (g +
  \ddot h)`, h the height of c, horizontally (the zero moment point: Vukobratović & Borovac 2004, Int. J. Humanoid
  Robot. 1:157). That point is under the feet and, while one foot stands, under this foot.

Bodies that stand and gesture slowly are in balance at any rate: nothing is said of these.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, cross, dot, known_median, norm, perpendicular, runs, unit
from posekit.ranking.standing import centre_of_mass
from posekit.skeleton import both
from posekit.validators.body import Body
from posekit.validators.check import Judgement
from posekit.validators.motion.ground import BY_CHANCE, GRAVITY_ACCELERATION, ground_of, soles, up_of
from posekit.validators.motion.timeline import spaced, timeline_of

#: Jumping joints from which a frame is another posture, and no wrong joint.
POSTURE_JOINTS: Final = 3

#: Share of the frames in which feet slide on a treadmill, and least speed of its belt, metres a second.
BELT_SHARE, BELT_SPEED = 0.5, 0.3

#: Way of the hips on a treadmill, at most, as a share of the way of the belt.
IN_PLACE_SHARE: Final = 0.25


#: Time before and after a frame over which velocities and accelerations are measured, seconds.
SPAN_SECONDS: Final = 0.1

#: Downward acceleration that nobody has, in g; recordings (a backflip) have up to 1.9 by the approximate centre.
FASTEST_FALL: Final = 2.0

#: Median downward acceleration in flights, in g, of clips at half and at double the speed: a quarter, and four times.
SLOW_FALL, FAST_FALL = (0.1, 0.42), (2.2, 7.0)

#: Frames in flights that tell how a body falls.
FLIGHT_FRAMES: Final = 4

#: Least acceleration of a body that stands on the ground, upward, with g, metres a second squared: less is flight.
LEAST_LOAD: Final = 2.0

#: Speed of a foot that stands, and of the other that swings, as shares of the hips' speed.
STANCE_SHARE, SWING_SHARE = 0.35, 1.0

#: Least share of the frames in which each foot stands alone in a clip of steps. A kick stands on one foot only.
STEPPING_SHARE: Final = 0.1

#: Distance of the centre of mass from the standing foot over that from the zero moment point, geometric mean of along
#: the way and across it: 24 recordings of walks and runs have 0.70 to 1.66 (CMU, Bandai-Namco, strangers' BVH); at half
#: the speed they have 1.71 to 5.9, at double speed 0.13 to 0.34. Chosen between, on these same clips.
FAST_RATIO, SLOW_RATIO = 0.4, 1.9

#: Least correlation of the two, mean of along the way and across it: without it something else holds the body, or its
#: motion was made up without forces. Recordings of walks have 0.38 or more at any rate.
LEAST_CORRELATION: Final = 0.3


def hints(body: Body, found: Mapping[str, Judgement], frame: NDArray[np.intp]) -> list[str]:
    """Return sentences about a body, given what checks found by their names, and the numbers of its frames."""
    said = []
    if body.settings.ground is None and {"penetration", "floating"} & set(found):
        ground = ground_of(body)
        resting = int(ground.resting.sum())
        frames = f"{resting} frames in which the body rests" if resting >= BY_CHANCE else "its lowest frames"
        said.append(
            f"Ground estimated at {ground.low:.3f} m along up, from {frames}; state it with --ground."
        )
    if "teleport" in found:
        jumps = found["teleport"].violated
        for edge in (0, len(body) - 1):
            if jumps[edge].sum() >= POSTURE_JOINTS and jumps.any(axis=1).sum() == 1:
                said.append(
                    f"Frame {frame[edge]} is another posture than the frames beside it, as of a skeleton at rest: "
                    "cut it off with --keep DIR --keep-spans SECONDS."
                )
    if "sliding" in found and found["sliding"].violated.any(axis=1).mean() > BELT_SHARE:
        hips, feet, up = body.joints[:, both("hip")], soles(body)[0], up_of(body)
        forward = unit(cross(-up, np.nanmedian(hips[:, 1] - hips[:, 0], axis=0)))
        backward = -dot(np.gradient(feet, body.dt, axis=0), forward)
        # Points of feet are right and left in turn.
        speed = known_median(backward[np.tile(found["sliding"].violated, feet.shape[1] // 2)])
        middle = perpendicular(hips.mean(axis=1), up)
        travel = float(norm(np.nanmax(middle, axis=0) - np.nanmin(middle, axis=0)))
        if speed > BELT_SPEED and travel < IN_PLACE_SHARE * speed * len(body) * body.dt:
            said.append(
                f"Feet go backward at {speed:.2g} m/s under a body that stays in place, as on a treadmill: judge it "
                "by a profile without sliding (--profile FILE.toml), or add the way of the belt to all points."
            )
    return said


def rate_doubts(body: Body) -> list[str]:
    """Return a sentence if the motion looks as if it had about half or double the stated frame rate."""
    if not body.knows("time") or not body.knows("joints") or body.up is None or body.q is not None:
        return []
    span = max(round(SPAN_SECONDS / body.dt), 1)
    centre = timeline_of(body).spread(centre_of_mass(body.joints))
    if len(centre) <= 4 * span:
        return []
    acceleration = spaced(centre, (1.0, -2.0, 1.0), span) / (span * body.dt) ** 2
    factor, why = _by_falls(body, acceleration @ up_of(body) / GRAVITY_ACCELERATION, span)
    if not why:
        factor, why = _by_balance(body, centre, acceleration, span)
    if not why:
        return []
    likely = f"about {body.rate * factor:.3g} Hz would fit (--rate)"
    return [f"The frame rate of {body.rate:g} Hz is doubtful: {why}; {likely}."]


def _by_falls(body: Body, rise: Array, span: int) -> tuple[float, str]:
    """Return the factor of the rate that gravity asks for, and why, by upward accelerations (S,), in g."""
    in_air = timeline_of(body).spread(ground_of(body).in_air.astype(np.float64)) > 0
    inside = np.zeros(len(rise), dtype=np.bool_)
    for start, stop in runs(in_air):
        inside[start + span : max(stop - span, start + span)] = True
    known = np.isfinite(rise)
    flights, fall = -rise[inside & known], -rise[known]
    middle = float(np.median(flights)) if len(flights) >= FLIGHT_FRAMES else np.nan
    if SLOW_FALL[0] < middle < SLOW_FALL[1]:
        return 2.0, f"bodies in the air fall with {middle:.2g} g"
    most = float(np.percentile(fall, 98)) if len(fall) else np.nan
    if FAST_FALL[0] < middle < FAST_FALL[1] or FASTEST_FALL < most < FAST_FALL[1]:
        return 0.5, f"the body is pulled down with {max(most, np.nan_to_num(middle)):.2g} g"
    return 1.0, ""


def _by_balance(body: Body, centre: Array, acceleration: Array, span: int) -> tuple[float, str]:
    """Return the factor of the rate that the zero moment point asks for, and why."""
    line, up, ground = timeline_of(body), up_of(body), ground_of(body)
    joints, feet = line.spread(body.joints), line.spread(soles(body)[0])
    load = GRAVITY_ACCELERATION + acceleration @ up
    loaded = load > LEAST_LOAD
    height = centre @ up - ground.low
    lever = perpendicular(acceleration, up) * (height / np.where(loaded, load, np.nan))[:, None]

    def velocity(points: Array) -> Array:
        return spaced(points, (-1.0, 0.0, 1.0), span) / (2 * span * body.dt)

    ankles, toes = joints[:, both("ankle")], feet[:, :2]
    hips = velocity(joints[:, both("hip")].mean(axis=1))
    forward = unit(perpendicular(hips, up))
    ways = np.stack([forward, cross(forward, up)], axis=1)
    speeds, speed = norm(velocity(ankles)), norm(hips)
    from_foot = centre[:, None] - np.where(np.isfinite(toes), (ankles + toes) / 2, ankles)
    pairs = []
    for side in (0, 1):
        alone = (speeds[:, side] < STANCE_SHARE * speed) & (speeds[:, 1 - side] > SWING_SHARE * speed)
        seen = np.stack([ways @ one[..., None] for one in (from_foot[:, side], lever)])[..., 0]
        pairs.append(seen[:, alone & np.isfinite(seen).all(axis=(0, 2))])
    if min(one.shape[1] for one in pairs) < STEPPING_SHARE * len(centre):
        return 1.0, ""
    distance, expected = np.concatenate(pairs, axis=1)
    squares, expected_squares = (distance**2).sum(axis=0), (expected**2).sum(axis=0)
    alike = (distance * expected).sum(axis=0) / np.sqrt(squares * expected_squares)
    ratio = float(np.prod(squares / expected_squares) ** 0.25)
    if alike.mean() > LEAST_CORRELATION and not FAST_RATIO < ratio < SLOW_RATIO:
        why = f"the body sways over its feet as under {1 / ratio:.2g} times gravity"
        return (2.0 if ratio > 1 else 0.5), why
    return 1.0, ""
