"""Checks of ground contact: bodies penetrate the ground, hover, are in the air for too long, or would fall over."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from posekit.geometry import Array, beyond_hull, runs
from posekit.ranking.standing import centre_of_mass
from posekit.skeleton import FEET_POINTS, both
from posekit.validators.body import Body
from posekit.validators.check import Judgement, check
from posekit.validators.motion.ground import (
    FALL_SHARE,
    FOOT_SHARE,
    FORWARD_SHARE,
    LEG_SHARE,
    falls,
    ground_of,
    soles,
    speeds,
    stature_of,
    up_of,
)

#: Tolerance of the height of the lowest point, in standard deviations of noise.
PENETRATION_DEVIATIONS: Final = 3.0

#: Time before, and after, each frame within which a body must touch a stated ground, seconds.
TOUCH_SECONDS: Final = 0.4

#: Tolerance for a stated ground that is not level, metres; measured laboratory floors slope by 2 to 4 cm.
UNLEVEL_METRES: Final = 0.03

#: Tolerance for lifted heels if toes are unknown, metres.
HEEL_METRES: Final = 0.04

#: Tolerance of the speed of the fastest joint, in standard deviations of noise.
STILL_DEVIATIONS: Final = 4.0

#: Largest height above the lowest sole for a foot that carries the body, metres.
BEARING_METRES: Final = 0.06

#: Minimum height of the hips above the feet of a standing person, as a share of the legs' length; with lower hips a
#: person may sit.
SITTING_SHARE: Final = 0.8


@check("penetration", unit="m", reads=("joints", "up", "ground"), over_time=True)
def penetration(body: Body, *, depth: float = 0.025, unlevel: float = 0.1) -> Judgement:
    """Bodies are below the ground.

    Parameters
    ----------
    depth : float
        Allowed depth, metres.
    unlevel : float
        Tolerance for an estimated ground that is not level, metres. It does not apply to parts that rest at a level
        that the body reached neither by a step nor by a jump.
    """
    ground, stated = ground_of(body), body.settings.ground
    if stated is None:
        lower = ground.lowest + np.where(ground.hanging, 0.0, unlevel)
        over = ground.lifted + np.minimum(lower, 0.0)
    else:
        over = ground.height - stated
    return Judgement(("lowest",), over, lower=-depth, tolerance=PENETRATION_DEVIATIONS * body.noise)


@check("floating", unit="m", reads=("joints", "up", "time", "ground"), over_time=True)
def floating(
    body: Body, *, height: float = 0.02, shortest: float = 0.35, fall: float = FALL_SHARE
) -> Judgement:
    r"""Bodies are above the ground, and nothing holds them there.

    The centre of mass of a body in the air has the acceleration :math:`-g`. A body floats if it is above all levels of
    the ground, no part of it rests, and its centre of mass falls with less than half of gravity. If the height of the
    ground is stated, a body also floats if its lowest resting parts are above this height, or if no part comes near it
    within 0.4 s.

    Parameters
    ----------
    height : float
        Allowed height, metres.
    shortest : float
        Minimum duration of a judged flight, seconds; in shorter flights the motion of limbs hides the fall.
    fall : float
        Minimum downward acceleration of the centre of mass of a body in the air, as a share of gravity.
    """
    ground, stated = ground_of(body), body.settings.ground
    over = ground.lifted.copy()
    if stated is not None:
        untouched = _untouched(ground.height - ground.lifted - stated, body) - UNLEVEL_METRES
        over += np.maximum(untouched, max(ground.low - stated, 0.0))
    for start, stop in runs(ground.in_air):
        lasts = (stop - start) * body.dt
        if lasts >= shortest and not falls(ground.centre[start:stop], body.dt, fall):
            hovers = ground.lowest[start:stop] - ground.high
            over[start:stop] = np.maximum(over[start:stop], hovers + ground.lifted[start:stop])
    tiptoe = HEEL_METRES if stated is not None and not np.isfinite(body.feet[:, :2]).any() else 0.0
    return Judgement(("lowest",), over, upper=height, tolerance=2 * body.noise + tiptoe)


def _untouched(height: Array, body: Body) -> Array:
    """Return the minimum height (T,) within `TOUCH_SECONDS` of each frame; 0 for heights below the ground."""
    half = max(round(TOUCH_SECONDS / body.dt), 1)
    padded = np.pad(np.where(np.isnan(height), np.inf, height), half, constant_values=np.inf)
    least = sliding_window_view(padded, 2 * half + 1).min(axis=-1)
    return np.where(np.isfinite(least), np.maximum(least, 0.0), 0.0)


@check("support", unit="s", reads=("joints", "up", "time", "ground"), over_time=True)
def support(body: Body, *, longest: float = 1.0) -> Judgement:
    """Bodies are in the air for longer than a jump lasts.

    Parameters
    ----------
    longest : float
        Longest allowed flight, seconds.
    """
    lasts = np.zeros(len(body))
    for start, stop in runs(ground_of(body).in_air):
        lasts[start:stop] = (stop - start) * body.dt
    return Judgement(("body",), lasts, upper=longest)


@check("balance-still", unit="m", reads=("joints", "up", "time", "ground"), over_time=True)
def balance_still(
    body: Body, *, beyond: float = 0.05, slower: float = 0.1, lasting: float = 1.0
) -> Judgement:
    """Bodies stand still with the centre of mass outside their feet.

    Parameters
    ----------
    beyond : float
        Allowed distance of the centre of mass beyond the feet, metres.
    slower : float
        Largest speed of any joint of a still body, metres per second.
    lasting : float
        Minimum time for which the body is still, seconds.
    """
    still = _stands(body, slower, lasting)
    value = np.where(still, beyond_feet(body), np.nan) if still.any() else np.full(len(body), np.nan)
    return Judgement(("centre_of_mass",), value, upper=beyond, tolerance=2 * body.noise)


def _stands(body: Body, slower: float, lasting: float) -> NDArray[np.bool_]:
    """Return whether the body stands still in each frame (T,), for at least `lasting` seconds."""
    # Number of frames over which the speed due to noise is below the bound.
    noise = STILL_DEVIATIONS * body.noise / (np.sqrt(2) * body.dt)
    frames = len(body) if noise >= slower * len(body) else max(int(np.ceil(noise / slower)), 1)
    fast = np.nan_to_num(speeds(body, body.joints, frames), nan=0.0).max(axis=1)
    still = fast < slower + noise / frames
    for start, stop in runs(still):
        still[start:stop] = (stop - start) * body.dt >= lasting
    return np.asarray(still & upright(body, SITTING_SHARE) & ground_of(body).resting)


@check("balance", unit="m", reads=("joints", "up"))
def balance(body: Body, *, beyond: float = 0.0) -> Judgement:
    """Centres of mass are outside the feet; each frame is judged as if the body stood still.

    Parameters
    ----------
    beyond : float
        Allowed distance beyond the feet, metres.
    """
    value = beyond_feet(body)
    return Judgement(("centre_of_mass",), value, upper=beyond, tolerance=2 * body.noise, scale=0.1)


def upright(body: Body, share: float) -> NDArray[np.bool_]:
    """Return whether the hips are above the feet by at least a share of the legs' length in each frame (T,)."""
    hips = body.height[:, both("hip")].mean(axis=1)
    ankles = np.fmin.reduce(body.height[:, both("ankle")], axis=1)
    return np.asarray(hips - ankles > share * LEG_SHARE * stature_of(body))


def beyond_feet(body: Body) -> Array:
    """Return the horizontal distance from the centre of mass to the feet's hull (T,), metres; negative inside."""
    feet, height = soles(body)
    bears = height < np.fmin.reduce(height, axis=1)[:, None] + BEARING_METRES
    # The sole extends beyond the known points: by most of the foot's length from an ankle, by less from a toe.
    toes = np.isfinite(feet[:, : len(FEET_POINTS)]).any()
    reach = (0.4 if toes else FORWARD_SHARE) * FOOT_SHARE * stature_of(body)
    centre = centre_of_mass(body.joints)
    return beyond_hull(centre, np.where(bears[..., None], feet, np.nan), up_of(body)) - reach
