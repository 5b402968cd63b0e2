"""The walking model of Lee & Chen 1985, §3.3: Rules 1-5 of one instant.

The body plane holds the line from neck to pelvis and is normal to the moving direction. That is the direction that the
trunk faces, midway between shoulders and hips; in a sequence it is the way of the neck (`WalkingRules.heading`). The
paper takes the head's facing direction (walkers ``paper-printed``): a person who stands and turns the head by 15
degrees then swings arm and leg of one side together, and breaks Rule 2.

The *swing* of a joint is its displacement out of the body plane, less the one it has when the figure stands at
neutral. A swing that does not clearly differ from zero is not evidence: rules about it are undecided.
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


#: When a swing is evidence, and what counts as parallel, flexed and vertical, by the name of the walkers; the paper
#: gives no numbers. Least swing of elbows, of knees, and of shoulders and hips, metres; rule 4: angle between a limb's
#: segment and the plane of moving direction and body axis; rule 5: flexion from which a knee counts as flexed, lean of
#: the other leg from the body axis; degrees. Those of people are for real walkers (CMU motion capture, 16 clips): their
#: shoulders lie behind, their hips before the figure's, arms turned outward leave the moving plane, and while one leg
#: passes the other both knees are bent.
THRESHOLDS: Final[Mapping[str, Mapping[str, float]]] = {
    "paper": {"elbow": 0.02, "knee": 0.02, "girdle": 0.01, "out": 10.0, "flexed": 15.0, "lean": 30.0},
    "people": {"elbow": 0.10, "knee": 0.25, "girdle": 0.06, "out": 35.0, "flexed": 40.0, "lean": 35.0},
}

#: Rules 1 to 3: two joints, and whether they swing to the same side (1) or not (-1). Not both arms, or both legs, are
#: in front of or behind the torso; arm and leg of one side do not swing together; shoulder and elbow, hip and knee do.
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
    """The limbs are not where a walker's limbs are.

    Parameters
    ----------
    rules : tuple of int, optional
        Rules, 1 to 5; those of the settings by default.
    heading : array (N, 3), optional
        Moving direction of each posture, unit vectors; NaN where it is not known.
    """

    name = "walking"
    unit = "1"
    reads = ("joints",)
    points = POINTS

    rules: tuple[int, ...] = ()
    heading: Array | None = None

    def judge(self, body: Body) -> Judgement:
        """Judge the rules; values are shares of their thresholds, positive where a rule is kept."""
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
        """Return where the walking body moves, its left and its down (N, 3)."""
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
    """Return the swing of each joint (N, 14) in multiples of the least one; NaN where it is not clear."""
    out = np.einsum("nji,ni->nj", body.joints - body.joints[:, :1], forward)
    swing = out - body.figure.neutral_points[: len(JOINTS), 0]
    least = [limits.get(name.split("_")[-1], limits["girdle"]) for name in JOINTS]
    return np.where(np.abs(swing) < least, np.nan, swing / least)


def _together(swing: Array, one: str, other: str) -> Array:
    """Return the smaller of two swings (N,), positive if both are to the same side."""
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
    """Judge rule 5: at most one knee is flexed; then the other leg stands nearly vertically."""
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
