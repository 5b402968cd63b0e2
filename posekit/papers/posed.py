"""Bodies bent by single angles, through Pinocchio, and what the checks say of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

import numpy as np
import pinocchio as pin

from posekit.body import Figure
from posekit.geometry import Array
from posekit.skeleton import DOFS, JOINT, SIDES
from posekit.validators import Validator

PROBE_DEGREES: Final = 0.3
"""How far on either side of a bound of Table 1 an angle is put."""

FLEXED_KNEE_DEGREES: Final = 60.0
HIP_FLEXIONS: Final = (80.0, 100.0, 119.0)
HIP_WORDS: Final = "flexed by 80, 100 and 119 degrees, abducted by 5, its knee bent"


def posed(figure: Figure, angles: Mapping[str, float]) -> tuple[Array, Array]:
    """Place a body that stands but for some of the URDF's angles, degrees: joints (1, 14, 3) and head (1, 5, 3).

    Where the pelvis alone is bent the legs hang: Table 1 counts their angles from the torso.
    """
    q = pin.neutral(figure.model)[None].copy()
    for dof, degrees in angles.items():
        q[0, figure.angle_index[DOFS.index(dof)]] = np.radians(degrees)
    points = figure.forward_kinematics(q)
    if angles and all(dof.startswith("pelvis") for dof in angles):
        for side in SIDES:
            legs = [JOINT[f"{side}_{joint}"] for joint in ("hip", "knee", "ankle")]
            hanging = figure.neutral_points[legs]
            points[:, legs] = points[:, legs[0], None] + hanging - hanging[0]
    return points[:, :14], points[:, 14:]


def keeps(validator: Validator, postures: Iterable[Mapping[str, float]]) -> list[bool]:
    """Say which of some bodies a validator finds valid."""
    found = []
    for angles in postures:
        joints, head = posed(validator.figure, angles)
        found.append(validator.check(joints, head, configured=False).verdicts == ["valid"])
    return found


def probes(angle: str, bounds: tuple[float, float]) -> tuple[list[bool], list[bool]]:
    """Say which postures just inside and just outside the bounds of a row of Table 1 are legal, both sides' limbs."""
    validator = Validator(strict=True, ranges="table1", checks=("joint-range",))
    joint, part = angle.split(".")
    sides = ("",) if joint in ("pelvis", "neck") else tuple(f"{side}_" for side in SIDES)
    dof = part.removesuffix("_with_straight_knee")
    inside, outside = [], []
    for bound, outward in zip(bounds, (-1.0, 1.0), strict=True):
        for side in sides:
            bent = {f"{side}knee.flexion": FLEXED_KNEE_DEGREES} if angle == "hip.flexion" else {}
            near, beyond = (
                {f"{side}{joint}.{dof}": bound + outward * by} | bent
                for by in (-PROBE_DEGREES, PROBE_DEGREES)
            )
            inside += keeps(validator, [near])
            outside += keeps(validator, [beyond])
    return inside, outside


def projected_hips() -> list[str]:
    """Say what the angles as printed make of hips that Table 1 allows: `HIP_WORDS`."""
    validator = Validator(strict=True, ranges="table1-printed", checks=("joint-range",))
    rest = {"right_hip.abduction": 5.0, "right_knee.flexion": FLEXED_KNEE_DEGREES}
    legal = keeps(validator, [{"right_hip.flexion": flexion} | rest for flexion in HIP_FLEXIONS])
    return ["legal" if one else "illegal" for one in legal]
