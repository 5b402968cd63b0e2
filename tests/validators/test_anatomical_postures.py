"""Postures that people take: as they are described and measured, they are inside the anatomical ranges."""

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.skeleton import DOFS, JOINT
from posekit.validators import joint_range, load_ranges

FIGURE = load_figure()
CHECKS = joint_range(FIGURE, load_ranges("anatomical"))
STANDING = {"pelvis.flexion": 13.5, "hip.flexion": -13.5}
"""The figure's angles where the clinic's are zero: the hips lie before the pelvis (docs, "Anatomical ranges")."""

POSTURES: dict[str, dict[str, float]] = {
    "standing": {},
    # Hemmerich et al. 2006, J Orthop Res 24:770, 30 adults: squatting with heels up, kneeling, sitting cross-legged.
    "squatting with heels up": {"hip.flexion": 115, "hip.abduction": 15, "knee.flexion": 157, "pelvis.flexion": 30},
    "squatting with heels flat": {"hip.flexion": 121, "hip.abduction": 20, "knee.flexion": 151, "pelvis.flexion": 35},
    "kneeling on the heels": {"hip.flexion": 75, "knee.flexion": 155, "pelvis.flexion": 10},
    "sitting cross-legged": {
        "hip.flexion": 88, "hip.abduction": 36, "hip.rotation": -40, "knee.flexion": 135, "pelvis.flexion": 35,
    },
    "sitting on a chair": {"hip.flexion": 85, "knee.flexion": 90},
    # Straight leg raised, Gajdosik et al. 1993; a kick adds what knee and pelvis give.
    "a leg raised straight": {"right_hip.flexion": 80, "right_knee.flexion": 3},
    "a kick": {"right_hip.flexion": 95, "right_knee.flexion": 20, "pelvis.flexion": 20, "pelvis.rotation": 25},
    "the backswing of a kick": {
        "right_hip.flexion": -20, "right_knee.flexion": 105, "right_hip.abduction": 15, "pelvis.rotation": 47,
    },
    "a lunge": {"right_hip.flexion": 95, "right_knee.flexion": 90, "left_hip.flexion": -20, "left_knee.flexion": 10},
    "legs astride": {"hip.abduction": 45},
    "legs crossed, standing": {"hip.abduction": -22},
    # Trunk: J Sports Sci Med 2015, 14:246, Table 3; Fitzgerald et al. 1983.
    "the trunk turned before a throw": {"pelvis.rotation": 49},
    "bent sideways": {"pelvis.bending": 38},
    "bent backward": {"pelvis.flexion": -30},
    "touching the floor": {"hip.flexion": 78, "pelvis.flexion": 65},
    # Arms: Vairo et al. 2012, Table 4; Soucie et al. 2011.
    "reaching overhead": {"shoulder.flexion": 170, "elbow.flexion": 5},
    "arms raised sideways": {"shoulder.abduction": 90},
    "hands behind the back": {"shoulder.flexion": -35, "shoulder.rotation": 80, "elbow.flexion": 95},
    "hands behind the head": {"shoulder.abduction": 80, "shoulder.rotation": -95, "elbow.flexion": 130},
    "arms crossed": {"shoulder.flexion": 40, "shoulder.rotation": 70, "elbow.flexion": 100},
    "about to throw": {"right_shoulder.abduction": 90, "right_shoulder.rotation": -105, "right_elbow.flexion": 90},
    "a hand on the other shoulder": {
        "right_shoulder.flexion": 80, "right_shoulder.abduction": -25, "right_shoulder.rotation": 40,
        "right_elbow.flexion": 125,
    },
    "a telephone at the ear": {"right_shoulder.flexion": 60, "right_elbow.flexion": 148},
    "elbows that bend back by 8 degrees": {"elbow.flexion": -7.5},
    "knees that bend back by 5 degrees": {"knee.flexion": -5},
}  # fmt: skip
"""In the clinic's degrees, both sides alike unless one is named."""

IMPOSSIBLE: dict[str, dict[str, float]] = {
    "an elbow bent backward": {"elbow.flexion": -40},
    "a knee bent backward": {"knee.flexion": -20},
    "a knee bent forward with the thigh turned": {"hip.rotation": 90, "knee.flexion": 40},
    "a forearm through the back": {"shoulder.rotation": 175, "elbow.flexion": 90},
    "a trunk turned to the back": {"pelvis.rotation": 90},
    "a thigh raised backward": {"hip.flexion": -70},
    "a leg raised straight to the head": {"right_hip.flexion": 125},
    "an arm swung backward overhead": {"shoulder.flexion": -120},
}


def points_of(clinic: dict[str, float]) -> np.ndarray:
    """Return a posture (1, 19, 3) by angles that the clinic would read."""
    q = pin.neutral(FIGURE.model)[None].copy()
    angles = np.zeros(len(DOFS))
    for k, dof in enumerate(DOFS):
        name = dof.removeprefix("right_").removeprefix("left_")
        angles[k] = clinic.get(dof, clinic.get(name, 0.0)) + STANDING.get(name, 0.0)
    q[:, FIGURE.angle_index] = np.radians(angles)
    return np.asarray(FIGURE.forward_kinematics(q))


def violated(points: np.ndarray) -> set[str]:
    found = ((check, check.judge(points[:, check.points]).violated[0]) for check in CHECKS)
    return {check.where[k] for check, bad in found for k in np.flatnonzero(bad)}


@pytest.mark.parametrize("name", POSTURES)
def test_people_can_be(name: str) -> None:
    assert violated(points_of(POSTURES[name])) == set()


@pytest.mark.parametrize("name", IMPOSSIBLE)
def test_nobody_has(name: str) -> None:
    assert violated(points_of(IMPOSSIBLE[name]))


@pytest.mark.parametrize("bend", [1.0, 5.0, 12.0, 20.0])
@pytest.mark.parametrize("outward", [0.0, 5.0, 10.0, 14.0])
@pytest.mark.parametrize("rotation", [-70.0, 0.0, 70.0])
def test_a_nearly_straight_arm_may_stand_off_outward(bend: float, outward: float, rotation: float) -> None:
    # A carrying angle of 11.6 (3.2) in men and 16.7 (2.6) in women (Van Roy et al. 2005), however the arm is turned.
    arm = {"right_shoulder.rotation": rotation, "right_elbow.flexion": bend}
    points, turned = points_of(arm), points_of(arm | {"right_shoulder.rotation": rotation - 1})
    elbow, wrist = JOINT["right_elbow"], JOINT["right_wrist"]
    forearm, outside = points[0, wrist] - points[0, elbow], turned[0, wrist] - points[0, wrist]
    outside *= np.linalg.norm(forearm) / np.linalg.norm(outside)
    by = np.radians(outward)
    points[0, wrist] = points[0, elbow] + np.cos(by) * forearm + np.sin(by) * outside
    assert violated(points) == set()
