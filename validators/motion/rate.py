r"""Doubts about the frame rate of a file, from how bodies fall and walk.

A clip played k times too fast has k times the speeds and :math:`k^2` times the accelerations. Two things do not scale:

- gravity. A body in the air falls with :math:`g`, and nothing pulls a body down faster;
- the gait. A walk has a step length, a cadence and a share of double support that belong together. The walk ratio, step
  length over cadence, is about 0.0065 m/(steps/min) at all speeds of adults (Sekiya & Nagasaki 1998, Gait Posture
  7:225), and people run instead of walk above a Froude number :math:`v^2 / (g l)` of 0.5 (Alexander 1989, Physiol Rev
  69:1199), l the length of the legs.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array, dot, runs
from posekit.ranking.standing import centre_of_mass
from posekit.skeleton import JOINT, SIDES
from posekit.validators.body import Body
from posekit.validators.motion.ground import GRAVITY_ACCELERATION, LEG_SHARE, ground_of, stature_of
from posekit.validators.motion.timeline import norm, timeline_of

#: Time over which the acceleration of the centre of mass is measured, before and after a frame, seconds.
FALL_SECONDS: Final = 0.1

#: Downward acceleration that nobody has, in g; recordings have up to 1.2 by the approximate centre of mass.
FASTEST_FALL: Final = 1.6

#: Median downward acceleration in flights, in g, of clips at half and at double the speed: a quarter, and four times.
SLOW_FALL, FAST_FALL = (0.1, 0.42), (2.2, 7.0)

#: Frames in flights that tell how a body falls.
FLIGHT_FRAMES: Final = 4

#: Range of walk ratios, metres a step per minute, that walks with long steps have; slow people have more, not less.
WALK_RATIOS: Final = (0.0040, 0.0120)

#: Step length, as a share of the legs' length, from which the walk ratio is judged: short steps are slow at will.
LONG_STEP: Final = 0.5

#: Speed of a foot in stance, at most, as a share of the hips' speed.
STANCE_SHARE: Final = 0.35

#: Largest share of the time in which both feet stand of a walk that is not slow, and in which none does of any walk.
MOST_DOUBLE_SUPPORT, MOST_FLIGHT = 0.32, 0.25

#: Froude number above which nobody walks.
RUNNING_FROUDE: Final = 0.55

FEWEST_STEPS: Final = 3


def rate_doubts(body: Body) -> list[str]:
    """Return a sentence if the motion looks as if it had about half or double the stated frame rate."""
    if not body.knows("time") or not body.knows("joints") or body.up is None or body.q is not None:
        return []
    factor, why = _by_falls(body)
    if not why:
        factor, why = _by_gait(body)
    if not why:
        return []
    likely = body.rate * factor
    return [
        f"The frame rate of {body.rate:g} Hz is doubtful: {why}; about {likely:.3g} Hz would fit (--rate)."
    ]


def _by_falls(body: Body) -> tuple[float, str]:
    """Return the factor of the rate that gravity asks for, and why."""
    line, up = timeline_of(body), np.zeros(3) if body.up is None else body.up
    height = line.spread(centre_of_mass(body.joints) @ up)
    span = max(round(FALL_SECONDS / body.dt), 1)
    if len(height) <= 2 * span:
        return 1.0, ""
    fall = np.full(len(height), np.nan)
    fall[span:-span] = -(height[2 * span :] - 2 * height[span:-span] + height[: -2 * span])
    fall /= (span * body.dt) ** 2 * GRAVITY_ACCELERATION
    in_air = line.spread(ground_of(body).in_air.astype(np.float64)) > 0
    inside = np.zeros(len(fall), dtype=np.bool_)
    for start, stop in runs(in_air):
        inside[start + span : max(stop - span, start + span)] = True
    flights = fall[inside & np.isfinite(fall)]
    middle = float(np.median(flights)) if len(flights) >= FLIGHT_FRAMES else np.nan
    if SLOW_FALL[0] < middle < SLOW_FALL[1]:
        return 2.0, f"bodies in the air fall with {middle:.2g} g"
    known = fall[np.isfinite(fall)]
    most = float(np.percentile(known, 98)) if len(known) else np.nan
    if FAST_FALL[0] < middle < FAST_FALL[1] or FASTEST_FALL < most < FAST_FALL[1]:
        return 0.5, f"the body is pulled down with {max(most, np.nan_to_num(middle)):.2g} g"
    return 1.0, ""


def _by_gait(body: Body) -> tuple[float, str]:
    """Return the factor of the rate that the gait asks for, and why."""
    gait, leg = _gait(body), LEG_SHARE * stature_of(body)
    if gait is None or not leg > 0:
        return 1.0, ""
    speed, cadence, double_support, flight = gait
    step = speed / cadence
    ratio, froude = step / (60.0 * cadence), speed**2 / (GRAVITY_ACCELERATION * leg)
    why = f"a walk with steps of {step:.2g} m, {60 * cadence:.0f} a minute, is unusual"
    if step >= LONG_STEP * leg:
        if ratio > WALK_RATIOS[1] and double_support < MOST_DOUBLE_SUPPORT:
            return 2.0, why
        if flight < MOST_FLIGHT and (ratio < WALK_RATIOS[0] or froude > RUNNING_FROUDE):
            return 0.5, why
    return 1.0, ""


def _gait(body: Body) -> tuple[float, float, float, float] | None:
    """Return speed (m/s), steps a second, and the shares of time with both and no feet down, or None."""
    line, up = timeline_of(body), np.zeros(3) if body.up is None else body.up
    joints = line.spread(body.joints)
    hips = joints[:, [JOINT[f"{side}_hip"] for side in SIDES]].mean(axis=1)
    ankles = joints[:, [JOINT[f"{side}_ankle"] for side in SIDES]]
    span = max(round(FALL_SECONDS / body.dt), 1)
    if len(joints) <= 4 * span:
        return None

    def velocity(points: Array) -> Array:
        found = (points[2 * span :] - points[: -2 * span]) / (2 * span * body.dt)
        return np.asarray(found - (found @ up)[..., None] * up)

    way, feet = velocity(hips), velocity(ankles)
    speed = norm(way)
    leg = LEG_SHARE * stature_of(body)
    travels = speed > 0.3 * float(np.nanmax(speed, initial=0.0))
    if not float(np.nanmean(speed)) * len(speed) * body.dt > 2 * leg or np.mean(travels) < 0.7:
        return None
    between = (ankles[:, 0] - ankles[:, 1])[span:-span]
    ahead = dot(between, way / np.maximum(speed, 1e-9)[:, None])
    apart = np.abs(ahead) > 0.15 * leg
    signs = np.sign(ahead[travels & apart])
    steps = int(np.count_nonzero(np.diff(signs)))
    seconds = float(np.count_nonzero(travels)) * body.dt
    if steps < FEWEST_STEPS:
        return None
    stands = np.asarray(norm(feet) < STANCE_SHARE * speed[:, None])
    both, none = (float(np.mean(one[travels])) for one in (np.all(stands, axis=1), ~np.any(stands, axis=1)))
    return float(np.mean(speed[travels])), steps / seconds, both, none
