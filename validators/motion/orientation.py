"""Orientation: bodies are upside down, or lie because the stated up axis is wrong."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array, dot, unit
from posekit.skeleton import JOINT, both
from posekit.validators.body import Body
from posekit.validators.check import Judgement, NotAskedError, check
from posekit.validators.motion.ground import up_of

#: Minimum number of frames of a judged clip.
FEWEST_FRAMES: Final = 5

#: Largest cosine between trunk and up for a body that is upside down.
INVERTED_COSINE: Final = -0.5

#: Minimum cosine (32 degrees) between an axis and both trunk and legs for a body that stands along the axis.
UPRIGHT_COSINE: Final = 0.85

#: Largest cosine (60 degrees) between trunk and up for a body that lies.
LYING_COSINE: Final = 0.5

#: Minimum range of the hips across an axis for a body that travels, metres; lying people do not travel.
TRAVEL_METRES: Final = 0.4

#: Largest range (5th to 95th percentile) of the height of the lowest joint for a body that lies, metres.
LEVEL_METRES: Final = 0.1

#: Range of the height of the lowest joint for a person who stands on the plane through the origin, metres.
SOLE_METRES: Final = (-0.03, 0.2)

#: Percentiles of the height of the lowest joint for a person who stays on that plane, and the largest difference
#: between the outer two, metres. The person may be in the air in 40 % of the frames.
STEADY_PERCENTILES, STEADY_METRES = (5, 50, 60), 0.12

#: Minimum depth of both wrists below the neck for a body on its hands, metres.
REACH_METRES: Final = 0.1


@check("orientation", unit="deg", reads=("joints", "up"), over_time=True)
def orientation(body: Body, *, upside_down: float = 0.8, aligned: float = 0.9) -> Judgement:
    """Bodies are upside down, or lie as if another axis pointed up.

    A body is upside down if the ankles are above the pelvis, the pelvis is above the neck, and hands do not carry the
    body. There are two signs that another axis points up. First, trunk and legs are straight along this axis, and the
    body travels or its lowest joint changes its height. A lying body does neither. Second, the body does not stand
    upright along the stated axis, and its lowest knee or ankle stays on a plane through the origin. This plane is
    perpendicular to the other axis instead of the stated axis.

    The value is the angle between up and the trunk, or between up and the other axis.

    Parameters
    ----------
    upside_down, aligned : float
        Minimum share of the frames with a body upside down, and with a body straight along another axis.
    """
    if not body.motion or len(body) < FEWEST_FRAMES:
        raise NotAskedError(f"it needs {FEWEST_FRAMES} frames of motion")
    trunk = unit(body.joints[:, JOINT["neck"]] - body.joints[:, JOINT["pelvis"]])
    if np.isnan(trunk).all():
        raise NotAskedError("it needs neck and pelvis in one frame")
    cosine = dot(trunk, up_of(body))
    inverted = _inverted(body, cosine, upside_down)
    axis = None if inverted else _other_up(body, trunk, cosine, aligned)
    cosine = cosine if axis is None else np.full(len(body), axis @ up_of(body))
    angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    bound = np.inf if axis is None and not inverted else np.degrees(np.arccos(LYING_COSINE))
    return Judgement(("body",), angle, upper=bound, scale=90.0)


def _inverted(body: Body, cosine: Array, share: float) -> bool:
    neck, pelvis = (body.height[:, JOINT[name]] for name in ("neck", "pelvis"))
    ankles = body.height[:, both("ankle")].min(axis=1)
    wrists = body.height[:, both("wrist")].max(axis=1)
    turned = (cosine < INVERTED_COSINE) & (ankles > pelvis)
    carried = wrists < neck - REACH_METRES
    return bool(np.mean(turned & ~carried) >= share)


def _other_up(body: Body, trunk: Array, cosine: Array, share: float) -> Array | None:
    """Return the axis (3,) that points up if it differs from the stated axis; otherwise None."""
    up, middle = up_of(body), np.nanmean(trunk, axis=0)
    axes = (*np.eye(3), *-np.eye(3))
    axis: Array = max(axes, key=lambda one: float(one @ middle))
    hips, ankles = (body.joints[:, both(name)].mean(axis=1) for name in ("hip", "ankle"))
    legs = unit(hips - ankles)
    straight = (trunk @ axis > UPRIGHT_COSINE) & (legs @ axis > UPRIGHT_COSINE)
    if np.mean(straight & (np.abs(cosine) < LYING_COSINE)) >= share:
        across = hips - (hips @ axis)[:, None] * axis
        travel = float(np.linalg.norm(np.nanmax(across, axis=0) - np.nanmin(across, axis=0)))
        level = np.ptp(np.nanpercentile(np.fmin.reduce(body.height, axis=1), (5, 95)))
        if travel > TRAVEL_METRES or level > LEVEL_METRES:
            return axis
    upright = np.median((cosine > UPRIGHT_COSINE) & (legs @ up > UPRIGHT_COSINE)) > 0
    if upright or np.isnan(legs).all() or _on_origin(body.height):
        return None
    lower = [one for one in axes if one @ up < LYING_COSINE and np.nanmedian(trunk @ one) > 0]
    # Both the lowest joint and the lowest knee or ankle must stay on the plane; the knees of a seated body do not.
    parts = body.joints, body.joints[:, JOINT["right_knee"] :]
    return next((one for one in lower if all(_on_origin(part @ one) for part in parts)), None)


def _on_origin(height: Array) -> bool:
    """Return whether the lowest joint mostly stays near the height 0, given heights of joints (T, J), metres."""
    low, middle, high = np.nanpercentile(np.fmin.reduce(height, axis=1), STEADY_PERCENTILES)
    return bool(SOLE_METRES[0] < middle < SOLE_METRES[1] and high - low < STEADY_METRES)
