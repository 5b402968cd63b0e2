r"""Remarks in addition to the findings: height of the ground, remedies for known causes, doubts about the frame rate.

If a clip is played k times too fast, speeds are multiplied by k and accelerations by :math:`k^2`, but gravity is the
same. Therefore falls and balance reveal a wrong frame rate:

- A body in the air falls with :math:`g`, and nothing accelerates a body downward much faster.
- The line of the ground reaction force passes near the centre of mass c. It meets the ground at the zero moment point,
  with the horizontal coordinates of :math:`c - \ddot c \, h / (g + \ddot h)`, where h is the height of c (Vukobratović
  & Borovac 2004, Int. J. Humanoid Robot. 1:157). While a person stands on one foot, this point is under that foot.

If a clip has neither falls nor steps, the tempo of joints is compared with the usual tempo of people. The tempo is the
ratio of acceleration to speed, which is proportional to the frame rate. Over recordings the tempo varies by a factor of
1.35 (one standard deviation), so that the tempo detects one in four wrong rates.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, cross, dot, known_median, norm, perpendicular, runs, unit
from posekit.ranking.standing import centre_of_mass
from posekit.skeleton import JOINT, JOINTS, both
from posekit.validators.body import Body
from posekit.validators.check import Judgement
from posekit.validators.motion.ground import BY_CHANCE, GRAVITY_ACCELERATION, ground_of, soles, up_of
from posekit.validators.motion.timeline import spaced, timeline_of

#: Minimum number of jumping joints in a frame that counts as another posture.
POSTURE_JOINTS: Final = 3

#: Minimum share of the frames in which feet slide on a treadmill, and minimum speed of the belt, metres per second.
BELT_SHARE, BELT_SPEED = 0.5, 0.3

#: Largest range of the hips on a treadmill, as a share of the distance that the belt moves.
IN_PLACE_SHARE: Final = 0.25


#: Time before, and after, a frame over which velocities and accelerations are measured, seconds.
SPAN_SECONDS: Final = 0.1

#: Downward acceleration that people do not reach, in g. Recordings (a backflip) have up to 1.9 g, because the centre of
#: mass is approximate.
FASTEST_FALL: Final = 2.0

#: Ranges of the median downward acceleration in flights, in g, of clips at half speed (about 1/4 g) and at double speed
#: (about 4 g).
SLOW_FALL, FAST_FALL = (0.1, 0.42), (2.2, 7.0)

#: Minimum number of frames in flights for an estimate of the acceleration.
FLIGHT_FRAMES: Final = 4

#: Minimum upward acceleration plus g for a body on the ground, metres per second squared; in flights it is smaller.
LEAST_LOAD: Final = 2.0

#: Largest speed of a standing foot, and minimum speed of the swinging foot, as shares of the hips' speed.
STANCE_SHARE, SWING_SHARE = 0.35, 1.0

#: Minimum share of the frames in which each foot stands alone in a clip with steps. In a kick only one foot does.
STEPPING_SHARE: Final = 0.1

#: Bounds of a ratio: distance of the centre of mass from the standing foot, divided by its distance from the zero
#: moment point. The ratio is the geometric mean of two ratios, along the direction of motion and across it. In 24
#: recordings of walks and runs (CMU, Bandai-Namco, other BVH files) it is 0.70 to 1.66, at half speed 1.71 to 5.9, at
#: double speed 0.13 to 0.41. The bounds were chosen on these recordings.
FAST_RATIO, SLOW_RATIO = 0.4, 1.9

#: Minimum correlation between the two distances, averaged over the direction of motion and the direction across it. If
#: it is smaller, something else supports the body, or the motion is not physical. Walks have at least 0.38 at any rate.
LEAST_CORRELATION: Final = 0.3

#: Minimum speed of a moving joint, metres per second, and multiple of the speed due to noise that is added to it. Noise
#: has a high tempo.
MOVING_SPEED, NOISE_FACTOR = 0.02, 10.0

#: Usual tempo of joints (median acceleration divided by median speed; median over moving joints), 1/s, and the largest
#: factor between a tempo and the usual tempo. In 57 recordings of walks, sports, gestures and dances the factors are
#: 0.55 to 1.8. If the usual tempo is computed from one half of them, the other half has factors of up to 1.9.
USUAL_TEMPO, MOST_TEMPO = 6.65, 2.2


def hints(body: Body, found: Mapping[str, Judgement], frame: NDArray[np.intp]) -> list[str]:
    """Return remarks about a body, given the judgements by check and the frames' numbers in the file (T,)."""
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
                    f"Frame {frame[edge]} is another posture than its neighbours, e.g. the skeleton's rest pose: "
                    "cut it off with --keep DIR --keep-spans SECONDS."
                )
    if "sliding" in found and found["sliding"].violated.any(axis=1).mean() > BELT_SHARE:
        hips, feet, up = body.joints[:, both("hip")], soles(body)[0], up_of(body)
        forward = unit(cross(-up, np.nanmedian(hips[:, 1] - hips[:, 0], axis=0)))
        backward = -dot(np.gradient(feet, body.dt, axis=0), forward)
        # The points of the feet alternate between right and left.
        speed = known_median(backward[np.tile(found["sliding"].violated, feet.shape[1] // 2)])
        middle = perpendicular(hips.mean(axis=1), up)
        travel = float(norm(np.nanmax(middle, axis=0) - np.nanmin(middle, axis=0)))
        if speed > BELT_SPEED and travel < IN_PLACE_SHARE * speed * len(body) * body.dt:
            said.append(
                f"Feet move backward at {speed:.2g} m/s while the body stays in place, as on a treadmill: use a "
                "profile without sliding (--profile FILE.toml), or add the motion of the belt to all points."
            )
    return said


def rate_doubts(body: Body) -> list[str]:
    """Return a warning if about half or double the stated frame rate fits the motion; otherwise an empty list."""
    if not body.knows("time") or not body.knows("joints") or body.up is None or body.q is not None:
        return []
    span = max(round(SPAN_SECONDS / body.dt), 1)
    centre = timeline_of(body).spread(centre_of_mass(body.joints))
    if len(centre) <= 4 * span:
        return []
    acceleration = spaced(centre, (1.0, -2.0, 1.0), span) / (span * body.dt) ** 2
    rise = acceleration @ up_of(body) / GRAVITY_ACCELERATION
    found = (
        _by_falls(body, rise, span) or _by_balance(body, centre, acceleration, span) or _by_tempo(body, span)
    )
    if found is None or found[0] == 1.0:
        return []
    factor, why = found
    likely = f"about {body.rate * factor:.3g} Hz would fit (--rate)"
    return [f"The frame rate of {body.rate:g} Hz is doubtful: {why}; {likely}."]


def _by_falls(body: Body, rise: Array, span: int) -> tuple[float, str] | None:
    """Return the likely frame rate divided by the stated rate, from upward accelerations (S,) in g, and the reason."""
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
    return None if np.isnan(middle) else (1.0, "")


def _by_balance(body: Body, centre: Array, acceleration: Array, span: int) -> tuple[float, str] | None:
    """Return the likely frame rate divided by the stated rate, from the zero moment point, and the reason."""
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
        return None
    distance, expected = np.concatenate(pairs, axis=1)
    squares, expected_squares = (distance**2).sum(axis=0), (expected**2).sum(axis=0)
    alike = (distance * expected).sum(axis=0) / np.sqrt(squares * expected_squares)
    ratio = float(np.prod(squares / expected_squares) ** 0.25)
    if alike.mean() > LEAST_CORRELATION and not FAST_RATIO < ratio < SLOW_RATIO:
        why = f"the body sways over its feet as under {1 / ratio:.2g} times gravity"
        return (2.0 if ratio > 1 else 0.5), why
    return (1.0, "") if alike.mean() > LEAST_CORRELATION else None


def _by_tempo(body: Body, span: int) -> tuple[float, str] | None:
    """Return the likely frame rate divided by the stated rate, from the tempo of joints, and the reason."""
    joints, seconds = timeline_of(body).spread(body.joints), span * body.dt
    paths = np.concatenate([joints, joints - joints[:, [JOINT["pelvis"]]]], axis=1)
    speed, change = (
        np.array([known_median(one) for one in norm(spaced(paths, weights, span)).T]) / seconds
        for weights in ((-0.5, 0.0, 0.5), (1.0, -2.0, 1.0))
    )
    moving = speed > MOVING_SPEED + NOISE_FACTOR * body.noise / seconds
    factor = known_median(change[moving] / speed[moving]) / seconds / USUAL_TEMPO
    if moving.sum() < len(JOINTS) // 2 or 1 / MOST_TEMPO < factor < MOST_TEMPO:
        return None
    why = f"joints change their speed {factor:.2g} times as fast as those of people usually do"
    return (0.5 if factor > 1 else 2.0), why
