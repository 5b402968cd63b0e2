"""The walking rules: each passes, fails and abstains, by postures made by hand."""

import re
from collections.abc import Iterable
from dataclasses import astuple
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.skeleton import DOFS, HEAD, JOINT, POINTS
from posekit.validators import walking
from posekit.validators.walking import DEFAULT_RULES, PEOPLE_THRESHOLDS, RULE_NUMBERS, WalkingThresholds

FIGURE = load_figure()
LIMITS = WalkingThresholds()
PRINTED = WalkingThresholds(printed=True)
ANYWHERE = pin.Quaternion(np.array([0.3, -0.5, 0.7, 0.2]) / np.linalg.norm([0.3, -0.5, 0.7, 0.2])).matrix()


def posture(**angles: float) -> np.ndarray:
    """Place a person (1, 19, 3) by the figure's own angles in degrees, ``right_hip_flexion=20``."""
    q = pin.neutral(FIGURE.model)[None].copy()
    for name, angle in angles.items():
        joint, _, kind = name.rpartition("_")
        q[0, FIGURE.angle_index[DOFS.index(f"{joint}.{kind}")]] = np.radians(angle)
    return np.asarray(FIGURE.forward_kinematics(q) @ ANYWHERE.T + [0.2, -0.1, 4.0])


STRIDE = {
    "right_shoulder_flexion": -25,
    "left_shoulder_flexion": 25,
    "right_hip_flexion": 20,
    "left_hip_flexion": -15,
}
"""Right leg and left arm forward, left leg and right arm backward."""


def rejected(
    points: np.ndarray, rules: Iterable[int] = RULE_NUMBERS, thresholds: WalkingThresholds | None = None
) -> set[str]:
    found = set()
    for check in walking(FIGURE, rules, thresholds):
        bad = np.any(check.judge(points[:, check.points]).violated, axis=0).tolist()
        found |= {where for where, wrong in zip(check.where, bad, strict=True) if wrong}
    return found


def values(points: np.ndarray, rules: Iterable[int] = RULE_NUMBERS) -> dict[str, float]:
    found: dict[str, float] = {}
    for check in walking(FIGURE, rules):
        found |= dict(zip(check.where, check.judge(points[:, check.points]).value[0].tolist(), strict=True))
    return found


def flexed(joint: str, swing: float) -> float:
    """Return the flexion (degrees) that swings an elbow or a knee out of the body plane by so much (m)."""
    start, end = ("shoulder", "elbow") if joint == "elbow" else ("hip", "knee")
    return float(np.degrees(np.arcsin(swing / FIGURE.lengths[f"right_{start}-right_{end}"])))


class TestRules:
    def test_a_stride_breaks_none(self) -> None:
        assert rejected(posture(**STRIDE)) == set()

    def test_standing_breaks_none_and_is_no_evidence_for_the_first_three(self) -> None:
        assert rejected(posture()) == set()
        for where, value in values(posture(), (1, 2, 3)).items():
            assert np.isnan(value), where

    @pytest.mark.parametrize(("limb", "joint"), [("arms", "shoulder"), ("legs", "hip")])
    @pytest.mark.parametrize("angle", [20, -20])
    def test_1_both_on_one_side(self, limb: str, joint: str, angle: float) -> None:
        points = posture(**{f"right_{joint}_flexion": angle, f"left_{joint}_flexion": angle})
        assert rejected(points, (1,)) == {f"rule1.{limb}"}

    @pytest.mark.parametrize("side", ["right", "left"])
    @pytest.mark.parametrize("angle", [20, -20])
    def test_2_arm_and_leg_of_one_side_together(self, side: str, angle: float) -> None:
        points = posture(**{f"{side}_shoulder_flexion": angle, f"{side}_hip_flexion": angle})
        assert rejected(points, (2,)) == {f"rule2.{side}"}
        other = "left" if side == "right" else "right"
        opposite = posture(**{f"{side}_shoulder_flexion": angle, f"{other}_hip_flexion": angle})
        assert rejected(opposite, (2,)) == set()

    @pytest.mark.parametrize("side", ["right", "left"])
    @pytest.mark.parametrize(
        ("limb", "joint", "twist"), [("arm", "shoulder", "neck"), ("leg", "hip", "pelvis")]
    )
    def test_3_girdle_and_limb_apart(self, side: str, limb: str, joint: str, twist: str) -> None:
        # The head, or the torso over the hips, turned left or right puts one girdle joint in front, one behind.
        place = f"rule3.{side}_{limb}"
        for turn in (20, -20):
            for swing in (25, -25):
                points = posture(**{f"{twist}_rotation": turn, f"{side}_{joint}_flexion": swing})
                apart = girdle_swing(points, side, joint) * swing < 0
                assert abs(girdle_swing(points, side, joint)) > 2 * LIMITS.girdle_swing
                assert (place in rejected(points, (3,), PRINTED)) == apart

    @pytest.mark.parametrize("side", ["right", "left"])
    @pytest.mark.parametrize(
        ("limb", "joint", "hinge"), [("arm", "shoulder", "elbow"), ("leg", "hip", "knee")]
    )
    def test_4_out_of_the_moving_plane(self, side: str, limb: str, joint: str, hinge: str) -> None:
        place = f"rule4.{side}_{limb}"
        for abduction, passes in (
            (LIMITS.out_of_plane - 0.01, True),
            (LIMITS.out_of_plane + 0.01, False),
            (-LIMITS.out_of_plane + 0.01, True),
            (-LIMITS.out_of_plane - 0.01, False),
        ):
            points = posture(**{f"{side}_{joint}_abduction": abduction})
            assert values(points, (4,))[place] == pytest.approx(abs(abduction), abs=1e-9)
            assert (place in rejected(points, (4,))) == (not passes)
        # The lower segment alone: bent by 90 degrees and turned.
        turned = posture(
            **{f"{side}_{hinge}_flexion": 90, f"{side}_{joint}_rotation": LIMITS.out_of_plane + 1}
        )
        assert rejected(turned, (4,)) == {place}
        bent = posture(**{f"{side}_{hinge}_flexion": 90, f"{side}_{joint}_flexion": 30})
        assert rejected(bent, (4,)) == set()

    @pytest.mark.parametrize("side", ["right", "left"])
    def test_5_both_knees(self, side: str) -> None:
        other = "left" if side == "right" else "right"
        for angle, passes in ((LIMITS.flexed_knee - 0.01, True), (LIMITS.flexed_knee + 0.01, False)):
            points = posture(**{f"{side}_knee_flexion": 60, f"{other}_knee_flexion": angle})
            assert values(points, (5,))["rule5.knees"] == pytest.approx(angle, abs=1e-9)
            assert ("rule5.knees" in rejected(points, (5,))) == (not passes)

    @pytest.mark.parametrize("side", ["right", "left"])
    @pytest.mark.parametrize("lean", [1, -1])
    def test_5_the_other_leg_stands(self, side: str, lean: int) -> None:
        other = "left" if side == "right" else "right"
        for angle, passes in ((LIMITS.vertical - 0.01, True), (LIMITS.vertical + 0.01, False)):
            points = posture(**{f"{side}_knee_flexion": 60, f"{other}_hip_flexion": lean * angle})
            assert values(points, (5,))["rule5.standing_leg"] == pytest.approx(angle, abs=1e-9)
            assert ("rule5.standing_leg" in rejected(points, (5,))) == (not passes)

    def test_5_two_straight_legs_need_not_stand(self) -> None:
        points = posture(right_hip_flexion=80, left_hip_flexion=-35)
        assert rejected(points, (5,)) == set()
        assert np.isnan(values(points, (5,))["rule5.standing_leg"])


def girdle_swing(points: np.ndarray, side: str, joint: str) -> float:
    """Return how far a girdle joint is out of the plane through the spine, square to the head's facing (m)."""
    neck, pelvis = points[0, JOINT["neck"]], points[0, JOINT["pelvis"]]
    ears = points[0, POINTS.index("left_ear")] - points[0, POINTS.index("right_ear")]
    down = (pelvis - neck) / np.linalg.norm(pelvis - neck)
    forward = np.cross(down, ears)
    forward /= np.linalg.norm(forward)
    place = JOINT[f"{side}_{joint}"]
    return float((points[0, place] - neck) @ forward - FIGURE.neutral_points[place, 0])


class TestTooCloseToTheTorso:
    @pytest.mark.parametrize(
        ("limb", "hinge", "joint"), [("arms", "elbow", "shoulder"), ("legs", "knee", "hip")]
    )
    @pytest.mark.parametrize("sign", [1, -1])
    def test_a_small_swing_is_no_evidence_for_rule_1(
        self, limb: str, hinge: str, joint: str, sign: int
    ) -> None:
        for swing, decided in ((LIMITS.knee_swing - 1e-4, False), (LIMITS.knee_swing + 1e-4, True)):
            angle = sign * flexed(hinge, swing)
            points = posture(**{f"right_{joint}_flexion": angle, f"left_{joint}_flexion": sign * 30})
            assert (f"rule1.{limb}" in rejected(points, (1,))) == decided
            assert np.isnan(values(points, (1,))[f"rule1.{limb}"]) == (not decided)
            if decided:
                assert values(points, (1,))[f"rule1.{limb}"] == pytest.approx(swing, abs=1e-9)

    def test_a_small_swing_is_no_evidence_for_rule_2(self) -> None:
        for swing, decided in ((LIMITS.knee_swing - 1e-4, False), (LIMITS.knee_swing + 1e-4, True)):
            points = posture(left_shoulder_flexion=flexed("elbow", swing), left_hip_flexion=30)
            assert (rejected(points, (2,)) == {"rule2.left"}) == decided

    def test_a_small_swing_of_the_girdle_is_no_evidence_for_rule_3(self) -> None:
        # The head turned by an angle a puts a shoulder 0.2015 sin a + 0.0374 (1 - cos a) out of its plane.
        for swing, decided in ((LIMITS.girdle_swing - 2e-4, False), (LIMITS.girdle_swing + 2e-4, True)):
            turn = float(np.degrees(np.arcsin(swing / 0.2015)))
            apart = posture(neck_rotation=turn, right_shoulder_flexion=-25)
            together = posture(neck_rotation=turn, right_shoulder_flexion=25)
            found = [rejected(points, (3,), PRINTED) for points in (apart, together)]
            assert ({"rule3.right_arm"} in found) == decided

    def test_elbows_and_knees_have_thresholds_of_their_own(self) -> None:
        arms = posture(right_shoulder_flexion=flexed("elbow", 0.05), left_shoulder_flexion=30)
        legs = posture(right_hip_flexion=flexed("knee", 0.05), left_hip_flexion=30)
        for elbow, knee in ((0.04, 0.06), (0.06, 0.04)):
            thresholds = WalkingThresholds(elbow_swing=elbow, knee_swing=knee)
            assert rejected(arms, (1,), thresholds) == ({"rule1.arms"} if elbow < 0.05 else set())
            assert rejected(legs, (1,), thresholds) == ({"rule1.legs"} if knee < 0.05 else set())

    def test_people_are_given_more_than_the_papers_walker(self) -> None:
        # One leg passes the other: both knees in front and bent, the elbows behind, the arms turned outward.
        passing = {
            "right_hip_flexion": 25,
            "left_hip_flexion": 12,
            "right_knee_flexion": 60,
            "left_knee_flexion": 20,
        }
        arms = {f"{side}_shoulder_{name}": angle for side in ("right", "left")
                for name, angle in (("flexion", -10), ("abduction", 12), ("rotation", 15))}  # fmt: skip
        points = posture(**passing, **arms)
        assert {"rule1.legs", "rule1.arms", "rule5.knees", "rule4.right_arm"} <= rejected(points)
        assert rejected(points, thresholds=PEOPLE_THRESHOLDS) == set()
        # But not: both legs far in front, or an arm and a leg of one side.
        assert rejected(posture(right_hip_flexion=60, left_hip_flexion=55), (1,), PEOPLE_THRESHOLDS) == {
            "rule1.legs"
        }
        together = posture(right_shoulder_flexion=40, right_hip_flexion=50)
        assert rejected(together, (2,), PEOPLE_THRESHOLDS) == {"rule2.right"}

    def test_thresholds_can_be_chosen(self) -> None:
        points = posture(right_hip_flexion=10, left_hip_flexion=10)
        assert rejected(points, (1,)) == {"rule1.legs"}
        assert rejected(points, (1,), WalkingThresholds(knee_swing=0.1)) == set()


class TestTheBodyPlane:
    def test_follows_the_head_as_printed(self) -> None:
        # Both arms forward of the torso; with the head turned by 90 degrees they are at its side.
        arms = {"right_shoulder_flexion": 40, "left_shoulder_flexion": 40}
        assert rejected(posture(**arms), (1,), PRINTED) == {"rule1.arms"}
        assert rejected(posture(**arms, neck_rotation=90), (1,), PRINTED) == set()
        assert rejected(posture(**arms, neck_rotation=90), (1,)) == {"rule1.arms"}

    @pytest.mark.parametrize("turn", [15, -15, 60, -60])
    def test_a_turned_head_breaks_rule_2_as_printed_alone(self, turn: float) -> None:
        standing = posture(neck_rotation=turn)
        assert {"rule2.right", "rule2.left"} <= rejected(standing, (1, 2), PRINTED)
        assert rejected(standing) == set()
        assert rejected(posture(**STRIDE, neck_rotation=turn)) == set()

    @pytest.mark.parametrize("side", ["right", "left"])
    @pytest.mark.parametrize("twist", [30, -30])
    def test_is_midway_between_shoulders_and_hips(self, side: str, twist: float) -> None:
        # A trunk that turns its shoulders one way and its hips the other brings each shoulder forward or backward.
        forward = 1 if (side == "right") == (twist > 0) else -1
        for swing in (25, -25):
            points = posture(pelvis_rotation=twist, **{f"{side}_shoulder_flexion": swing})
            assert (f"rule3.{side}_arm" in rejected(points, (3,))) == (swing * forward < 0)

    def test_is_the_way_that_the_body_goes_in_a_sequence(self) -> None:
        points = np.concatenate([posture(right_shoulder_flexion=30, left_shoulder_flexion=30)] * 3)
        heading = np.stack([ANYWHERE[:, 0], ANYWHERE[:, 1], np.full(3, np.nan)])
        frames = np.arange(3)
        # Ahead, sidelong, and not known: one arm is then before the body plane and one behind it.
        check = walking(FIGURE, (1,))[0].moving(heading)
        assert check.judge_frames(points[:, check.points], frames).violated[:, 0].tolist() == [
            True,
            False,
            True,
        ]
        printed = walking(FIGURE, (1,), PRINTED)[0].moving(heading)
        assert printed.judge_frames(points[:, printed.points], frames).violated.all()

    def test_does_not_follow_a_nod(self) -> None:
        for nod in (-40, 0, 40):
            points = posture(right_hip_flexion=20, left_hip_flexion=20, neck_flexion=nod)
            assert rejected(points, (1,)) == {"rule1.legs"}
            assert values(points, (1,))["rule1.legs"] == pytest.approx(
                0.38 * np.sin(np.radians(20)), abs=1e-9
            )

    def test_is_the_torsos_where_the_head_was_not_seen(self) -> None:
        points = posture(neck_rotation=90, right_shoulder_flexion=40, left_shoulder_flexion=40)
        assert rejected(points, (1,), PRINTED) == set()
        points[:, HEAD] = np.nan
        assert rejected(points, (1,), PRINTED) == {"rule1.arms"}

    def test_has_its_axes_forward_left_and_down(self) -> None:
        q = pin.neutral(FIGURE.model)[None]
        points = FIGURE.forward_kinematics(q)
        check = walking(FIGURE, (1,))[0]
        body = check.body(points[:, check.points])  # type: ignore[attr-defined]
        np.testing.assert_allclose(
            np.concatenate(body), [[1, 0, 0], [0, 1, 0], [0, 0, -1]], rtol=0, atol=1e-12
        )


class TestSwitches:
    def test_each_rule_is_on_its_own(self) -> None:
        places = {
            rule: {where for check in walking(FIGURE, (rule,)) for where in check.where}
            for rule in RULE_NUMBERS
        }
        for rule, names in places.items():
            assert names
            assert all(name.startswith(f"rule{rule}.") for name in names)
        everything = {where for check in walking(FIGURE, RULE_NUMBERS) for where in check.where}
        assert everything == set.union(*places.values())

    def test_rules_1_and_2_are_the_default(self) -> None:
        assert DEFAULT_RULES == (1, 2)
        assert [check.where for check in walking(FIGURE)] == [
            check.where for check in walking(FIGURE, (2, 1, 2))
        ]

    def test_no_rules_are_no_checks(self) -> None:
        assert walking(FIGURE, ()) == []

    @pytest.mark.parametrize("rules", [(0,), (1, 6), (-1,), (1, 2, 3, 4, 5, 99)])
    def test_an_unknown_rule_is_refused(self, rules: tuple[int, ...]) -> None:
        with pytest.raises(InputError, match="is not a rule; expected some of 1, 2, 3, 4, 5") as error:
            walking(FIGURE, rules)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize("missing", POINTS)
def test_a_missing_joint_never_rejects_and_leaves_its_rules_undecided(missing: str) -> None:
    points = posture(**STRIDE, right_knee_flexion=40)
    k = POINTS.index(missing)
    points[:, k] = np.nan
    for check in walking(FIGURE, RULE_NUMBERS):
        findings = check.judge(points[:, check.points])
        assert not findings.violated.any()
        if k in check.joints:  # type: ignore[attr-defined]
            assert findings.undecided.all()


def test_the_mirror_image_has_the_mirrored_verdicts() -> None:
    rng = np.random.default_rng(8)
    q = np.tile(pin.neutral(FIGURE.model), (500, 1))
    limits = FIGURE.limits
    q[:, FIGURE.angle_index] = limits.lower + rng.random((500, 22)) * (limits.upper - limits.lower)
    points = FIGURE.forward_kinematics(q)

    def other(name: str) -> str:
        return name.replace("right", "L").replace("left", "right").replace("L", "left")

    mirrored = (points * [1, -1, 1])[:, [POINTS.index(other(name)) for name in POINTS]]
    checks = {check.where: check for check in walking(FIGURE, RULE_NUMBERS)}
    for where, check in checks.items():
        twin = checks[tuple(other(place) for place in where)]
        ours, theirs = check.judge(points[:, check.points]), twin.judge(mirrored[:, twin.points])
        np.testing.assert_array_equal(ours.violated, theirs.violated)
        np.testing.assert_allclose(ours.value, theirs.value, rtol=0, atol=1e-9)
        assert ours.violated.any()


def test_people_have_the_thresholds_that_are_published() -> None:
    page = Path(__file__).parents[2] / "docs/explanation/walking-rules.md"
    told = (
        page.read_text(encoding="utf-8")
        .split("`--walkers people` has thresholds", 1)[1]
        .split("With these", 1)[0]
    )
    elbow, knee, girdle, *degrees = (float(number) for number in re.findall(r"\d+", told))
    assert astuple(PEOPLE_THRESHOLDS) == (elbow / 100, knee / 100, girdle / 100, *degrees, False)
