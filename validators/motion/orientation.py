"""Bodies that are upside down, or lie because another axis points up than the file states."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array, dot, unit
from posekit.skeleton import JOINT, both
from posekit.validators.body import Body
from posekit.validators.check import Judgement, NotAskedError, check
from posekit.validators.motion.ground import up_of

#: Frames of which a share tells the orientation.
FEWEST_FRAMES: Final = 5

#: Cosine between trunk and up below which a body is upside down.
INVERTED_COSINE: Final = -0.5

#: Cosine (32 degrees) of trunk and legs with an axis along which a body stands.
UPRIGHT_COSINE: Final = 0.85

#: Largest cosine (60 degrees) between trunk and up of a body that lies.
LYING_COSINE: Final = 0.5

#: Way of the hips from which a straight body that lies travels: people who lie do not.
TRAVEL_METRES: Final = 0.4

#: Range of the height of the lowest joint, 5th to 95th percentile, metres: a body that lies stays on the ground.
LEVEL_METRES: Final = 0.1

#: Coordinate of the lowest joint along up, metres, of a person who stands on the plane through the origin.
SOLE_METRES: Final = (-0.03, 0.2)

#: Range of that coordinate, 5th to 95th percentile, metres.
STEADY_METRES: Final = 0.12

#: Height of the wrists below the neck from which hands may carry a body that is upside down, metres.
REACH_METRES: Final = 0.1


@check("orientation", unit="deg", reads=("joints", "up"), over_time=True)
def orientation(body: Body, *, upside_down: float = 0.8, aligned: float = 0.9) -> Judgement:
    """Bodies are upside down, or lie as if another axis pointed up.

    A body is upside down if neck, pelvis and ankles are one above the other in the wrong order, and hands do not carry
    it. It lies by a wrong axis if trunk and legs are straight along one axis across up, as people stand, while the
    body travels or its lowest point rises and sinks, as nobody who lies does; or if feet stand on the plane through the
    origin across another axis, and not across up.

    Parameters
    ----------
    upside_down, aligned : float
        Shares of the frames that show it.
    """
    if not body.motion or len(body) < FEWEST_FRAMES:
        raise NotAskedError(f"it needs {FEWEST_FRAMES} frames of motion")
    trunk = unit(body.joints[:, JOINT["neck"]] - body.joints[:, JOINT["pelvis"]])
    cosine = dot(trunk, up_of(body))
    angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    wrong = _inverted(body, cosine, upside_down) or _lies(body, trunk, cosine, aligned)
    bound = np.degrees(np.arccos(LYING_COSINE)) if wrong else np.inf
    return Judgement(("body",), angle, upper=bound, scale=90.0)


def _inverted(body: Body, cosine: Array, share: float) -> bool:
    height = body.height
    neck, pelvis = height[:, JOINT["neck"]], height[:, JOINT["pelvis"]]
    ankles = height[:, both("ankle")].min(axis=1)
    wrists = height[:, both("wrist")].max(axis=1)
    turned = (cosine < INVERTED_COSINE) & (ankles > pelvis)
    carried = wrists < neck - REACH_METRES
    return bool(np.mean(turned & ~carried) >= share)


def _lies(body: Body, trunk: Array, cosine: Array, share: float) -> bool:
    middle = np.nanmean(trunk, axis=0)
    axis = np.zeros(3)
    axis[np.argmax(np.abs(middle))] = np.sign(middle[np.argmax(np.abs(middle))])
    hips, ankles = (body.joints[:, both(name)].mean(axis=1) for name in ("hip", "ankle"))
    straight = (trunk @ axis > UPRIGHT_COSINE) & (unit(hips - ankles) @ axis > UPRIGHT_COSINE)
    if np.mean(straight & (np.abs(cosine) < LYING_COSINE)) >= share:
        across = hips - (hips @ axis)[:, None] * axis
        travel = float(np.linalg.norm(np.nanmax(across, axis=0) - np.nanmin(across, axis=0)))
        if travel > TRAVEL_METRES or _range(np.fmin.reduce(body.height, axis=1)) > LEVEL_METRES:
            return True
    return not _stands(body, up_of(body), share) and any(
        _stands(body, way, share) and bool(np.nanmedian(trunk @ way) > 0)
        for way in (*np.eye(3), *-np.eye(3))
        if float(way @ up_of(body)) < LYING_COSINE
    )


def _stands(body: Body, up: Array, share: float) -> bool:
    """Return whether ankles are the lowest joints along a direction, at one level on the plane through the origin."""
    height = body.joints @ up
    lowest = np.fmin.reduce(height, axis=1)
    ankles = np.fmin.reduce(height[:, both("ankle")], axis=1)
    level = SOLE_METRES[0] < float(np.nanmedian(lowest)) < SOLE_METRES[1]
    return level and _range(lowest) < STEADY_METRES and bool(np.mean(ankles <= lowest) >= share)


def _range(values: Array) -> float:
    """Return the range between the 5th and the 95th percentile."""
    low, high = np.nanpercentile(values, (5, 95))
    return float(high - low)
