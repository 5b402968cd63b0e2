"""Checks against the ground: bodies in it, above it without support, in the air for too long, or about to fall over."""

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

#: Standard deviations of noise by which the lowest of several points may be lower than they are.
PENETRATION_DEVIATIONS: Final = 3.0

#: Time before and after a frame within which a body that a stated ground carries touches it.
TOUCH_SECONDS: Final = 0.4

#: Height over a stated ground of one that is not level, metres: recordings of one laboratory slope by 2 to 4 cm.
UNLEVEL_METRES: Final = 0.03

#: Height of an ankle over its height on a flat foot, metres, within `TOUCH_SECONDS` of any frame: only toes stand for
#: longer.
HEEL_METRES: Final = 0.04

#: Standard deviations of noise by which the fastest of the joints may be faster than it is.
STILL_DEVIATIONS: Final = 4.0

#: Height above the lowest sole up to which a foot bears, metres.
BEARING_METRES: Final = 0.06

#: Height of the hips above the feet of a person who stands, as a share of the legs' length: lower hips may sit.
SITTING_SHARE: Final = 0.8


@check("penetration", unit="m", reads=("joints", "up", "ground"), over_time=True)
def penetration(body: Body, *, depth: float = 0.025, unlevel: float = 0.1) -> Judgement:
    """Bodies are below the ground.

    Parameters
    ----------
    depth : float
        Depth that is allowed, metres.
    unlevel : float
        Metres by which an estimated ground may be lower than where something rests; not where that hangs.
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

    A body in the air falls: its centre of mass has the acceleration :math:`-g`. A body hovers if it is above all levels
    of the ground, no part of it rests, and its centre of mass falls at less than half of gravity. Over a stated ground
    a body also floats if its lowest rests are above it, or if it does not come near it within 0.4 s.

    Parameters
    ----------
    height : float
        Height that is allowed, metres.
    shortest : float
        Seconds below which a flight is not judged: limbs hide its fall.
    fall : float
        Least share of gravity by which the centre of mass of a body in the air falls.
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
    """Return the least height (T,) within `TOUCH_SECONDS` of each frame, and 0 if it is below the ground."""
    half = max(round(TOUCH_SECONDS / body.dt), 1)
    padded = np.pad(np.where(np.isnan(height), np.inf, height), half, constant_values=np.inf)
    least = sliding_window_view(padded, 2 * half + 1).min(axis=-1)
    return np.where(np.isfinite(least), np.maximum(least, 0.0), 0.0)


@check("support", unit="s", reads=("joints", "up", "time", "ground"), over_time=True)
def support(body: Body, *, longest: float = 1.0) -> Judgement:
    """Nothing holds the body for longer than a jump lasts.

    Parameters
    ----------
    longest : float
        Seconds.
    """
    lasts = np.zeros(len(body))
    for start, stop in runs(ground_of(body).in_air):
        lasts[start:stop] = (stop - start) * body.dt
    return Judgement(("body",), lasts, upper=longest)


@check("balance-still", unit="m", reads=("joints", "up", "time", "ground"), over_time=True)
def balance_still(
    body: Body, *, beyond: float = 0.05, slower: float = 0.1, lasting: float = 1.0
) -> Judgement:
    """Bodies stand still, and would fall over.

    Parameters
    ----------
    beyond : float
        Distance of the centre of mass beyond the feet that is allowed, metres.
    slower : float
        Speed below which all joints are still, metres a second.
    lasting : float
        Seconds for which the body must be still.
    """
    value = np.full(len(body), np.nan)
    still = np.flatnonzero(_stands(body, slower, lasting))
    if len(still):
        value[still] = beyond_feet(body)[still]
    return Judgement(("centre_of_mass",), value, upper=beyond, tolerance=2 * body.noise)


def _stands(body: Body, slower: float, lasting: float) -> NDArray[np.bool_]:
    """Return the frames (T,) in which the body stands, and is still for long enough."""
    # Over this number of frames, noise moves more slowly than the bound for standing still.
    noise = STILL_DEVIATIONS * body.noise / (np.sqrt(2) * body.dt)
    frames = len(body) if noise >= slower * len(body) else max(int(np.ceil(noise / slower)), 1)
    fast = np.nan_to_num(speeds(body, body.joints, frames), nan=0.0).max(axis=1)
    still = fast < slower + noise / frames
    for start, stop in runs(still):
        still[start:stop] = (stop - start) * body.dt >= lasting
    return np.asarray(still & upright(body, SITTING_SHARE) & ground_of(body).resting)


@check("balance", unit="m", reads=("joints", "up"))
def balance(body: Body, *, beyond: float = 0.0) -> Judgement:
    """Bodies have their centre of mass beyond the feet, as if they stood still in every frame.

    Parameters
    ----------
    beyond : float
        Distance beyond the feet that is allowed, metres.
    """
    value = beyond_feet(body)
    return Judgement(("centre_of_mass",), value, upper=beyond, tolerance=2 * body.noise, scale=0.1)


def upright(body: Body, share: float) -> NDArray[np.bool_]:
    """Return the frames (T,) whose hips are above the feet by a share of the legs' length."""
    hips = body.height[:, both("hip")].mean(axis=1)
    ankles = np.fmin.reduce(body.height[:, both("ankle")], axis=1)
    return np.asarray(hips - ankles > share * LEG_SHARE * stature_of(body))


def beyond_feet(body: Body) -> Array:
    """Return how far the centre of mass is beyond the feet that bear (T,), metres; negative over them."""
    feet, height = soles(body)
    bears = height < np.fmin.reduce(height, axis=1)[:, None] + BEARING_METRES
    # A foot reaches beyond its known points: all of it beyond an ankle, its end and edges beyond a toe.
    toes = np.isfinite(feet[:, : len(FEET_POINTS)]).any()
    reach = (0.4 if toes else FORWARD_SHARE) * FOOT_SHARE * stature_of(body)
    centre = centre_of_mass(body.joints)
    return beyond_hull(centre, np.where(bears[..., None], feet, np.nan), up_of(body)) - reach
