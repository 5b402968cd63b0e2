"""The walking model of Lee & Chen 1985, §3.3: Rules 1 to 5, which judge single postures.

The body plane contains the line from neck to pelvis and is normal to the moving direction. In a single posture the
moving direction is the mean of the directions that shoulders and hips face. In a sequence it is the direction of the
neck's motion (`WalkingRules.heading`). The paper uses the direction that the head faces (setting ``walkers``:
``paper-printed``). But then a person who stands and turns the head by 15 degrees violates Rule 2, because arm and leg
of one side seem to swing together.

The *swing* of a joint is its displacement out of the body plane, minus its displacement in the neutral posture of the
figure. A rule is undecided if a swing in it is near zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.body.frames import torso_frame
from posekit.geometry import Array, cross, dot, perpendicular, unit
from posekit.skeleton import JOINT, JOINTS, POINTS, SIDES, TORSO
from posekit.validators.body import Body
from posekit.validators.check import Judgement

LIMB_PARTS: Final = (("arms", "shoulder", "elbow", "wrist"), ("legs", "hip", "knee", "ankle"))


#: Thresholds of the rules, by the setting ``walkers``; the paper gives no numbers. ``elbow``, ``knee``, ``girdle``:
#: minimum swing of elbows, of knees, and of shoulders and hips, metres. ``out`` (rule 4): largest angle between a
#: limb's segment and the plane of moving direction and body axis, degrees. ``flexed``, ``lean`` (rule 5): minimum
#: flexion of a flexed knee, and largest lean of the other leg from the body axis, degrees. The thresholds ``people``
#: were fitted to real walkers (16 clips of CMU motion capture). Unlike the figure, their shoulders lie behind and their
#: hips in front of the body plane, their arms swing outward, and both knees are bent while one leg passes the other.
THRESHOLDS: Final[Mapping[str, Mapping[str, float]]] = {
    "paper": {"elbow": 0.02, "knee": 0.02, "girdle": 0.01, "out": 10.0, "flexed": 15.0, "lean": 30.0},
    "people": {"elbow": 0.10, "knee": 0.25, "girdle": 0.06, "out": 35.0, "flexed": 40.0, "lean": 35.0},
}

#: Pairs of joints of Rules 1 to 3 that swing to the same side (1) or to opposite sides (-1) of the body plane. Rule 1:
#: the two arms swing to opposite sides, and so do the two legs. Rule 2: arm and leg of one side swing to opposite
#: sides. Rule 3: shoulder and elbow swing to the same side, and so do hip and knee.
SWINGS: Final[Mapping[str, tuple[str, str, int]]] = {
    **{f"rule1.{limb}": (f"right_{mid}", f"left_{mid}", -1) for limb, _, mid, _ in LIMB_PARTS},
    **{f"rule2.{side}": (f"{side}_elbow", f"{side}_knee", -1) for side in SIDES},
    **{
        f"rule3.{side}_{limb[:-1]}": (f"{side}_{girdle}", f"{side}_{mid}", 1)
        for limb, girdle, mid, _ in LIMB_PARTS
        for side in SIDES
    },
}


@dataclass(frozen=True, kw_only=True, eq=False)
class WalkingRules:
    """The limbs do not swing as a walker's limbs do.

    Parameters
    ----------
    rules : tuple of int, optional
        Numbers of the rules to judge, 1 to 5; by default the rules of the settings.
    heading : array (N, 3), optional
        Moving direction of each posture, unit vectors; NaN if unknown.
    """

    name = "walking"
    unit = "1"
    reads = ("joints",)
    points = POINTS

    rules: tuple[int, ...] = ()
    heading: Array | None = None

    def judge(self, body: Body) -> Judgement:
        """Judge the rules; values are multiples of the thresholds, positive if a rule holds."""
        limits = THRESHOLDS["people" if body.settings.walkers == "people" else "paper"]
        axes = self._axes(body)
        swing = _swings(body, axes[0], limits)
        found = {place: sign * _together(swing, one, other) for place, (one, other, sign) in SWINGS.items()}
        found |= _planes(body, axes[1], limits["out"]) | _legs(body, axes[2], limits)
        rules = self.rules or body.settings.rules
        places = [place for rule in rules for place in found if place.startswith(f"rule{rule}.")]
        value = np.array([found[place] for place in places]).reshape(len(places), len(body)).T
        return Judgement(places, value, lower=0.0, scale=1.0)

    def _axes(self, body: Body) -> tuple[Array, Array, Array]:
        """Return the moving direction, the direction to the left, and the direction from neck to pelvis (N, 3)."""
        joints = body.joints
        R_torso = torso_frame(*(joints[:, JOINT[name]] for name in TORSO))
        down, facing = -R_torso[:, :, 2], R_torso[:, :, 0]
        if body.settings.walkers == "paper-printed":
            head = body.figure.ik.head_frame(joints[:, 0], body.head)[:, :, 0]
            facing = np.where(np.isnan(head), facing, head)
        else:
            hips = unit(cross(down, joints[:, JOINT["left_hip"]] - joints[:, JOINT["right_hip"]]))
            facing = facing + np.where(np.isnan(hips), 0.0, hips)
            if self.heading is not None:
                facing = np.where(np.isnan(self.heading), facing, self.heading)
        forward = unit(perpendicular(facing, down))
        return forward, cross(forward, down), down


def _swings(body: Body, forward: Array, limits: Mapping[str, float]) -> Array:
    """Return the swing of each joint (N, 14) in multiples of the minimum swing; NaN for smaller swings."""
    out = np.einsum("nji,ni->nj", body.joints - body.joints[:, :1], forward)
    swing = out - body.figure.neutral_points[: len(JOINTS), 0]
    least = [limits.get(name.split("_")[-1], limits["girdle"]) for name in JOINTS]
    return np.where(np.abs(swing) < least, np.nan, swing / least)


def _together(swing: Array, one: str, other: str) -> Array:
    """Return the smaller absolute swing of two joints (N,), with sign: positive if both swing to the same side."""
    a, b = swing[:, JOINT[one]], swing[:, JOINT[other]]
    return np.sign(a * b) * np.minimum(np.abs(a), np.abs(b))


def _planes(body: Body, left: Array, most: float) -> dict[str, Array]:
    """Judge rule 4: limbs swing in planes parallel to the moving direction."""
    found = {}
    for limb, *names in LIMB_PARTS:
        for side in SIDES:
            start, middle, end = (body.joints[:, JOINT[f"{side}_{name}"]] for name in names)
            sines = [np.abs(dot(unit(b - a), left)) for a, b in ((start, middle), (middle, end))]
            angle = np.degrees(np.arcsin(np.minimum(np.maximum(*sines), 1.0)))
            found[f"rule4.{side}_{limb[:-1]}"] = 1.0 - angle / most
    return found


def _legs(body: Body, down: Array, limits: Mapping[str, float]) -> dict[str, Array]:
    """Judge rule 5: at most one knee is flexed; if so, the other leg is nearly parallel to the line neck-pelvis."""
    flexion, lean = [], []
    for side in SIDES:
        hip, knee, ankle = (body.joints[:, JOINT[f"{side}_{name}"]] for name in ("hip", "knee", "ankle"))
        flexion.append(_angle(knee - hip, ankle - knee))
        lean.append(_angle(ankle - hip, down))
    less = np.argmin(flexion, axis=0)
    smaller, larger = np.min(flexion, axis=0), np.max(flexion, axis=0)
    standing = np.array(lean)[less, np.arange(len(body))]
    standing = np.where(larger > limits["flexed"], standing, np.nan)
    return {
        "rule5.knees": 1.0 - smaller / limits["flexed"],
        "rule5.standing_leg": 1.0 - standing / limits["lean"],
    }


def _angle(a: Array, b: Array) -> Array:
    """Return the angle between vectors (N, 3), degrees."""
    return np.asarray(np.degrees(np.arctan2(np.linalg.norm(cross(a, b), axis=1), dot(a, b))))
