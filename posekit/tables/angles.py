"""The angles that tables of joint ranges name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from posekit.skeleton import DOFS

TABLE1_ANGLES: Final[Mapping[str, tuple[str, ...]]] = {
    "shoulder": ("flexion", "abduction"),
    "elbow": ("flexion",),
    "hip": ("flexion", "flexion_with_straight_knee", "abduction"),
    "knee": ("flexion",),
    "pelvis": ("flexion", "rotation", "bending"),
    "neck": ("flexion", "rotation", "bending"),
}
"""The angles of Lee & Chen (1985, section 3.2.A) by joint; of both sides."""

SIDELESS_ANGLES: Final = tuple(
    dict.fromkeys(dof.removeprefix("right_").removeprefix("left_") for dof in DOFS)
)
"""The 12 angles that differ by more than their side: ``"hip.flexion"``."""

DERIVED_ANGLES: Final = ("shoulder.elevation", "shoulder.plane", "shoulder.turn")
"""What `posekit.validators.anatomical_shoulder` makes of the shoulder's three angles."""

SIDEWAYS_ANGLES: Final[Mapping[str, str]] = {"elbow.valgus": "elbow.flexion", "knee.valgus": "knee.flexion"}
"""How far a lower segment stands off its hinge's plane, away from the body positive; and the hinge's angle."""
