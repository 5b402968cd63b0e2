r"""Rules of walking over strides: by the speeds and phases of limbs.

Of Lee & Chen's rules (1985, §3.3) the first, second and fourth speak of motion: what swings forward or backward "at the
same time", and in which plane. Over a stride that is seen. Two swings a and b out of the body plane are in step or in
turn by the correlation of their speeds

.. math:: r = \overline{\dot a \dot b} / \sqrt{\overline{\dot a^2}\;\overline{\dot b^2}},

the cosine of the angle between their phases if both are sinusoidal. The body plane is normal to the way of the hips: a
body whose hips rest does not walk, and a limb that hardly moves does not swing; nothing is said of these.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.errors import refusal
from posekit.geometry import Array, cross, dot, perpendicular, unit
from posekit.skeleton import JOINT, SIDES, both
from posekit.validators.body import Body
from posekit.validators.check import Judgement, NotAskedError, check
from posekit.validators.motion.timeline import norm, timeline_of

#: Rules that speak of motion; Rules 3 and 5 are of an instant.
RULES_OVER_STRIDES: Final = (1, 2, 4)

#: Two joints that swing in turn (Rules 1 and 2), and girdle and end of limbs that swing forward (Rule 4), by place.
SWING_IN_TURN: Final = {
    "rule1.arms": ("right_elbow", "left_elbow"),
    "rule1.legs": ("right_knee", "left_knee"),
    **{f"rule2.{side}": (f"{side}_elbow", f"{side}_knee") for side in SIDES},
}
SWING_FORWARD: Final = {
    f"rule4.{side}_{limb}": (f"{side}_{girdle}", f"{side}_{end}")
    for limb, girdle, end in (("arm", "shoulder", "wrist"), ("leg", "hip", "ankle"))
    for side in SIDES
}

#: Speed of the hips below which nobody walks, metres a second: half of a slow walk, several times a standing sway.
SLOWEST_WALK: Final = 0.3

#: Share of a stride whose frames must be known.
LEAST_PART: Final = 0.5


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
    if len(body) < 2:
        raise NotAskedError("it needs two frames")
    line = timeline_of(body)
    joints, size = line.spread(body.joints), 2 * max(round(stride / 2 / body.dt), 1) + 1

    def change(values: Array) -> Array:
        return np.asarray(np.gradient(values, body.dt, axis=0))

    down = unit(_mean(joints[:, JOINT["pelvis"]] - joints[:, JOINT["neck"]], size))
    velocity = perpendicular(_mean(change(joints[:, both("hip")].mean(axis=1)), size), down)
    walks = np.asarray(norm(velocity) >= slowest)[:, None]
    # Hips at rest have no direction; rounding must not give them one.
    forward = unit(np.where(norm(velocity)[:, None] > 1e-9, velocity, np.nan))[:, None]
    # How far each joint is out of the body plane, from the middle of its swing.
    out = dot(joints - joints[:, JOINT["neck"], None], forward)
    out = out - _mean(out, size)
    swings, speeds = _mean(out**2, size) >= swing**2, change(out)

    first, second = ([JOINT[name] for name in names] for names in zip(*SWING_IN_TURN.values(), strict=True))
    squares = _mean(speeds**2, size)
    product = _mean(speeds[:, first] * speeds[:, second], size)
    turns = swings[:, first] & swings[:, second] & walks
    girdles, ends = ([JOINT[name] for name in names] for names in zip(*SWING_FORWARD.values(), strict=True))
    limbs = joints[:, ends] - joints[:, girdles]
    along, over = (
        _mean(change(dot(limbs, axis)) ** 2, size) for axis in (forward, cross(forward, down[:, None]))
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        phase = np.where(turns, product / np.sqrt(squares[:, first] * squares[:, second]), np.nan)
        part = np.where(swings[:, ends] & walks, np.sqrt(over / (over + along)), np.nan)
    places = (*SWING_IN_TURN, *SWING_FORWARD)
    asked = [k for k, place in enumerate(places) if place[len("rule")] in rules]
    bounds = np.array([in_step] * len(SWING_IN_TURN) + [across] * len(SWING_FORWARD))
    value = line.of_frames(np.concatenate([phase, part], axis=1))
    return Judgement([places[k] for k in asked], value[:, asked], upper=bounds[asked])


def _mean(values: Array, size: int) -> Array:
    """Return the mean of `size` frames around each (S, ...); NaN where too few are known."""
    from scipy.ndimage import uniform_filter1d

    known = np.isfinite(values)
    total, share = (
        uniform_filter1d(part, size, axis=0, mode="constant")
        for part in (np.where(known, values, 0.0), known.astype(np.float64))
    )
    enough = share >= LEAST_PART - 1e-9
    return np.asarray(np.where(enough, total / np.where(enough, share, 1.0), np.nan))
