"""Rules of walking over strides: walkers keep them, whoever ambles breaks them, and who stands is asked nothing."""

from __future__ import annotations

import numpy as np
import pytest

import posekit
from posekit.body import load_figure
from posekit.errors import InputError
from posekit.skeleton import DOFS, JOINTS
from posekit.synthesis import Walker
from posekit.validators.motion import MotionClip
from posekit.validators.motion.walking_phases import WalkingPhases

FIGURE = load_figure()
RATE = 30.0
TIME = np.arange(90) / RATE
FORWARD = np.eye(3)[0]


Swings = dict[str, tuple[float, float]]


def moving(swings: Swings, speed: float = 1.2, way: np.ndarray = FORWARD) -> np.ndarray:
    """Place somebody (90, 19, 3) whose angles swing once a second: degrees, and the phase as a part of the second."""
    q = np.repeat(FIGURE.configurations(FIGURE.neutral_points[None]).q, len(TIME), axis=0)
    for name, (degrees, phase) in swings.items():
        joint, _, angle = name.rpartition("_")
        column = FIGURE.angle_index[DOFS.index(f"{joint}.{angle}")]
        q[:, column] = np.radians(degrees) * np.sin(2 * np.pi * (TIME + phase))
    return np.asarray(FIGURE.forward_kinematics(q) + speed * TIME[:, None, None] * way)


def striding(arm: float = 25.0, phase: float = 0.5) -> Swings:
    """Swing legs in turn, and each arm so long after the leg of its side."""
    return {
        "right_hip_flexion": (25.0, 0.0),
        "left_hip_flexion": (25.0, 0.5),
        "right_shoulder_flexion": (arm, phase),
        "left_shoulder_flexion": (arm, phase + 0.5),
    }


TURNING: Swings = {"neck_rotation": (60.0, 0.1)}


def judged(points: np.ndarray, check: WalkingPhases | None = None) -> tuple[set[str], set[str]]:
    """Return the places that are violated in some frame, and those that are decided in some."""
    clip = MotionClip(joints=points[:, : len(JOINTS)], time=TIME[: len(points)], rate=RATE)
    check = check or WalkingPhases()
    found, places = check.judge(clip), check.places(clip)
    return tuple(  # type: ignore[return-value]
        {places[k] for k in np.flatnonzero(flags.any(axis=0))} for flags in (found.violated, ~found.undecided)
    )


PLACES = {"rule1.arms", "rule1.legs", "rule2.right", "rule2.left"}
PLACES |= {f"rule4.{side}_{limb}" for side in ("right", "left") for limb in ("arm", "leg")}


@pytest.mark.parametrize("way", [FORWARD, -FORWARD])
def test_a_stride_keeps_all_rules(way: np.ndarray) -> None:
    assert judged(moving(striding(), way=way)) == (set(), PLACES)


@pytest.mark.parametrize("velocity", [0.8, 1.0, 1.2])
def test_the_walker_keeps_them(velocity: float) -> None:
    walker = Walker(velocity=velocity)
    q = walker.configurations(walker.phase(TIME, 0.0))
    q[:, :3] += walker.travel(TIME, 0.0)
    violated, decided = judged(walker.figure.forward_kinematics(q))
    assert violated == set()
    assert {"rule1.arms", "rule1.legs"} <= decided


def test_the_turn_of_a_head_changes_nothing() -> None:
    straight, turned = moving(striding()), moving(TURNING | striding())
    assert judged(straight) == judged(turned)
    standing = moving(TURNING, speed=0.0)
    assert judged(standing) == (set(), set())


def test_an_amble_breaks_rule_2() -> None:
    assert judged(moving(striding(phase=0.0)))[0] == {"rule2.right", "rule2.left"}


@pytest.mark.parametrize(("phase", "in_turn"), [(0.3, True), (0.7, True), (0.2, False), (0.8, False)])
def test_a_quarter_of_a_stride_is_where_in_turn_ends(phase: float, in_turn: bool) -> None:
    assert (judged(moving(striding(phase=phase)))[0] == set()) == in_turn


def test_hops_break_rule_1() -> None:
    for joint, place in (("hip", "rule1.legs"), ("shoulder", "rule1.arms")):
        together = {f"{side}_{joint}_flexion": (25.0, 0.0) for side in ("right", "left")}
        assert judged(moving(together))[0] == {place}


def test_an_arm_that_flaps_sideways_breaks_rule_4() -> None:
    flapping = moving({"right_shoulder_abduction": (40.0, 0.0), "right_shoulder_flexion": (20.0, 0.0)})
    assert judged(flapping)[0] == {"rule4.right_arm"}


def test_limbs_that_hardly_swing_are_not_judged() -> None:
    _, decided = judged(moving(striding(arm=3.0)))
    assert {place for place in PLACES if "arm" not in place and "rule2" not in place} == decided


def test_what_is_missing_is_not_judged_and_a_gap_is_passed_over() -> None:
    points = moving(striding())
    points[40:44] = np.nan
    assert judged(points)[0] == set()
    points[:, JOINTS.index("left_knee")] = np.nan
    assert {"rule1.legs", "rule2.left"}.isdisjoint(judged(points)[1])
    assert judged(points[:5]) == (set(), set())


@pytest.mark.parametrize(("slowest", "walks"), [(0.5, True), (np.nextafter(0.5, 1.0), False)])
def test_who_goes_as_fast_as_the_slowest_walker_walks(slowest: float, walks: bool) -> None:
    """At half a metre a second, in times and places that are exact."""
    joints = np.zeros((90, len(JOINTS), 3))
    joints[:, JOINTS.index("neck"), 2] = 1.0
    joints[..., 0] = np.arange(90)[:, None] / 64.0
    joints[:, -8:, 0] += (
        np.round(8 * np.sin(np.arange(90) / 5.0))[:, None] / 64.0 * [1, -1, 1, -1, 1, -1, 1, -1]
    )
    clip = MotionClip(joints=joints, time=np.arange(90) / 32.0, rate=32.0)
    assert np.isfinite(WalkingPhases(slowest=slowest).judge(clip).value).any() == walks


def test_rules_are_chosen_one_by_one() -> None:
    points = moving(striding(phase=0.0))
    assert judged(points, WalkingPhases(rules="1"))[1] == {"rule1.arms", "rule1.legs"}
    with pytest.raises(InputError, match=r"rules: '3'; expected some of 1, 2, 4, by commas"):
        WalkingPhases(rules="3")


def test_validate_asks_rules_of_motion_over_strides_where_there_is_motion() -> None:
    standing = moving(TURNING, speed=0.0)
    walking = moving(TURNING | striding())
    ambling = moving(TURNING | striding(phase=0.0))
    for points, valid in ((standing, True), (walking, True), (ambling, False)):
        report = posekit.validate(points, checks=("walking",), rate=RATE)
        assert (report.summary["valid"] == len(points)) == valid
    printed = posekit.validate(walking, checks=("walking",), rate=RATE, walkers="paper-printed")
    assert printed.summary["valid"] < len(walking)
    still = posekit.validate(walking, checks=("walking",))
    assert all("walking-phases" not in one.settings["checks"] for one in (printed, still))
    assert "walking-phases" in report.settings["checks"]
