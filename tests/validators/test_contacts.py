"""Contact is no collision: capsules lie inside their parts, and bodies may touch where real ones do."""

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.skeleton import DOFS, JOINT, SIDES
from posekit.validators import collision

FIGURE = load_figure()
RADIUS = {capsule.link: capsule.radius for capsule in FIGURE.capsules}
# Heinz et al. 2003, J Stat Educ 11(2), means of 247 men and 260 women, cm: the least girth of ankle and wrist, the
# width of a knee's bones, the depth of the chest.
THINNEST = {
    "shank": 22.2 / (2 * np.pi), "forearm": 16.1 / (2 * np.pi), "thigh": 18.8 / 2 / 2, "torso": 19.2 / 2
}  # fmt: skip


def hits(points: np.ndarray) -> set[str]:
    return {
        check.where[0] for check in collision(FIGURE) if check.judge(points[:, check.points]).violated.any()
    }


def posture(**angles: float) -> np.ndarray:
    q = pin.neutral(FIGURE.model)[None].copy()
    for name, angle in angles.items():
        joint, _, kind = name.rpartition("_")
        q[0, FIGURE.angle_index[DOFS.index(f"{joint}.{kind}")]] = np.radians(angle)
    return np.asarray(FIGURE.forward_kinematics(q))


@pytest.mark.parametrize("part", THINNEST)
def test_no_capsule_is_thicker_than_its_part_where_that_is_thinnest(part: str) -> None:
    radii = [100 * radius for link, radius in RADIUS.items() if link.endswith(part)]
    assert len(radii) == (1 if part == "torso" else 2)
    for radius in radii:
        assert 0.85 * THINNEST[part] < radius < THINNEST[part]


def test_ankles_may_touch_and_shanks_may_not_cross() -> None:
    # Bones touch where the shanks' lines are an ankle's width apart: two radii of the least girth.
    points = posture()
    apart = 2 * THINNEST["shank"] / 100
    for gap, touching in ((apart, set()), (0.5 * apart, {"right_shank-left_shank"})):
        near = points.copy()
        for side, sign in zip(SIDES, (-1, 1), strict=True):
            near[0, JOINT[f"{side}_knee"], 1] = sign * 0.12
            near[0, JOINT[f"{side}_ankle"], 1] = sign * gap / 2
        found = {frozenset(pair.split("-")) for pair in hits(near) if "shank" in pair}
        assert found == {frozenset(pair.split("-")) for pair in touching}


@pytest.mark.parametrize(
    "arms",
    [
        {"flexion": 0.0, "abduction": 0.0, "rotation": 0.0},  # hanging
        {"flexion": 25.0, "abduction": -25.0, "rotation": 60.0, "elbow": 95.0},  # folded before the chest
        {"flexion": -35.0, "abduction": -5.0, "rotation": 85.0, "elbow": 85.0},  # a hand behind the back
    ],
)
def test_an_arm_may_lie_against_the_trunk(arms: dict[str, float]) -> None:
    elbow = arms.pop("elbow", 5.0)
    angles = {f"right_shoulder_{name}": angle for name, angle in arms.items()} | {
        "right_elbow_flexion": elbow
    }
    assert hits(posture(**angles)) == set()


def test_an_arm_through_the_trunk_is_a_collision() -> None:
    points = posture()
    points[0, JOINT["left_elbow"]] = points[0, JOINT["pelvis"]] + [0.0, 0.05, 0.2]
    points[0, JOINT["left_wrist"]] = points[0, JOINT["pelvis"]] + [0.0, -0.2, 0.2]
    assert {"torso-left_forearm", "torso-left_upper_arm"} <= hits(points)
