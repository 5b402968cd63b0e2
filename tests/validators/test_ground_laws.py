"""Laws of the checks of ground and feet: what falls may be in the air, what hovers may not, wherever the body looks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.geometry import Array
from posekit.skeleton import FEET_POINTS, JOINT, JOINTS, other_side
from posekit.validators.motion import MOTION_CHECKS, MotionClip, judge_motion, load_profile
from posekit.validators.motion.base_of_support import beyond_support
from posekit.validators.motion.ground import ANKLE_SHARE, TOE_METRES, ground_of, stature_of
from posekit.validators.motion.lifted import lifted_by

UP = np.array([0.0, 0.0, 1.0])
OF_GROUND = ("penetration", "floating", "support", "sliding", "balance-still")


def standing(count: int, *, rate: float = 30.0, ground: float | None = None, toes: bool = True) -> MotionClip:
    """Return a body that stands, breathing a little, with the soles at 0."""
    body = load_figure().neutral_points[None, : len(JOINTS)]
    joints = np.repeat(body, count, axis=0)
    lowest = float(joints[0, :, 2].min())
    joints = joints - (lowest - 0.066) * UP
    joints = joints + 0.002 * np.sin(np.arange(count) / rate * 2.0)[:, None, None] * UP * (
        joints[:, :, 2:] > 0.5
    )
    ankles = joints[:, [JOINT["right_ankle"], JOINT["left_ankle"]]]
    forward = np.array([0.16, 0.0, 0.0])
    toe = ankles + forward
    toe[..., 2] = TOE_METRES
    feet = np.concatenate([toe, np.full_like(toe, np.nan)], axis=1) if toes else np.empty(0)
    return MotionClip(joints=joints, feet=feet, time=np.arange(count) / rate, rate=rate, up=UP, ground=ground)


def moved(clip: MotionClip, by: Array) -> MotionClip:
    return replace(clip, joints=clip.joints + by[:, None], feet=clip.feet + by[:, None])


def rejected(clip: MotionClip) -> dict[str, list[int]]:
    verdict = judge_motion(load_profile("posekit").only(OF_GROUND).checks, clip)
    return {
        one.check: np.flatnonzero(one.violated.any(axis=1)).tolist()
        for one in verdict.judgements
        if one.violated.any()
    }


def flight(clip: MotionClip, start: int, count: int, *, falls: bool) -> MotionClip:
    """Throw the body up, or lift it as high and hold it there."""
    time = np.arange(count + 1) / clip.rate
    last = time[-1]
    way = 4.905 * time * (last - time) if falls else np.minimum(np.minimum(time, last - time) * 2.0, 0.3)
    by = np.zeros(len(clip))
    by[start : start + count + 1] = way
    return moved(clip, by[:, None] * UP)


@pytest.mark.parametrize("toes", [True, False])
def test_a_body_that_stands_is_on_its_ground(toes: bool) -> None:
    clip = standing(60, toes=toes)
    assert not rejected(clip)
    assert ground_of(clip).low == pytest.approx(0.0, abs=0.01)
    assert stature_of(clip) * ANKLE_SHARE == pytest.approx(0.066, abs=0.01)
    assert not rejected(replace(clip, ground=0.0))


def test_a_robots_toes_and_heels_are_its_soles() -> None:
    clip = standing(30)
    soles = clip.feet.copy()
    soles[:, 2:] = soles[:, :2] - np.array([0.2, 0.0, 0.0])
    soles[..., 2] = 0.0
    robot = replace(clip, feet=soles, q=np.zeros((30, 1)), ground=0.0)
    assert ground_of(robot).low == pytest.approx(0.0, abs=1e-9)
    assert not rejected(robot)


@pytest.mark.parametrize("count", [9, 15, 21])
def test_a_jump_is_no_floating(count: int) -> None:
    assert not rejected(flight(standing(90), 30, count, falls=True))


def test_a_body_that_hovers_floats() -> None:
    found = rejected(flight(standing(120), 30, 45, falls=False))
    assert set(found) == {"floating", "support"}
    assert 30 <= found["floating"][0] <= 36 and 69 <= found["floating"][-1] <= 75


@pytest.mark.parametrize("height", [0.03, 0.1, -0.03, -0.1])
@pytest.mark.parametrize("toes", [True, False])
def test_a_stretch_that_is_lifted_is_named_from_its_first_to_its_last_frame(
    height: float, toes: bool
) -> None:
    by = np.zeros((90, 3))
    by[20:55, 2] = height
    name = "floating" if height > 0 else "penetration"
    assert rejected(moved(standing(90, toes=toes), by)) == {name: list(range(20, 55))}


@pytest.mark.parametrize("height", [0.2, 0.5, -0.2, -0.5])
def test_a_body_that_is_moved_up_or_down_smoothly_and_rests_there_is_named(height: float) -> None:
    by = np.interp(np.arange(180), [40, 52, 110, 122], [0.0, height, height, 0.0])
    name = "floating" if height > 0 else "penetration"
    found = rejected(moved(standing(180), by[:, None] * UP))
    assert set(range(60, 105)) <= set(found[name])
    assert min(found[name]) >= 40 and max(found[name]) <= 122


@pytest.mark.parametrize("height", [0.05, -0.05])
def test_a_whole_clip_is_judged_by_the_ground_that_is_given(height: float) -> None:
    clip = moved(standing(60), np.full((60, 1), height) * UP)
    assert not rejected(clip)
    name = "floating" if height > 0 else "penetration"
    assert rejected(replace(clip, ground=0.0)) == {name: list(range(60))}


@pytest.mark.parametrize("speed", [0.05, 0.3])
def test_a_standing_body_that_glides_slides(speed: float) -> None:
    by = np.zeros((90, 3))
    by[20:60, 0] = speed / 30.0 * np.arange(1, 41)
    by[60:, 0] = by[59, 0]
    found = rejected(moved(standing(90), by))
    assert set(found) == {"sliding"}
    assert abs(found["sliding"][0] - 20) <= 1 and abs(found["sliding"][-1] - 59) <= 1


def test_who_climbs_a_step_does_not_float() -> None:
    clip, rise = standing(150), np.zeros((150, len(JOINTS) + len(FEET_POINTS)))
    right = np.interp(np.arange(150), [30, 45], [0.0, 0.2])
    left = np.interp(np.arange(150), [60, 75], [0.0, 0.2])
    trunk = np.interp(np.arange(150), [45, 75], [0.0, 0.2])
    for k, name in enumerate((*JOINTS, *FEET_POINTS)):
        leg = name.endswith(("ankle", "toe", "heel", "knee"))
        rise[:, k] = (right if name.startswith("right") else left) if leg else trunk
    clip = replace(
        clip,
        joints=clip.joints + rise[:, : len(JOINTS), None] * UP,
        feet=clip.feet + rise[:, len(JOINTS) :, None] * UP,
    )
    assert not rejected(clip)


def test_who_stands_still_and_leans_too_far_falls() -> None:
    clip = standing(60)
    joints = clip.joints.copy()
    joints[:, : JOINT["right_ankle"]] += np.array([0.4, 0.0, 0.0])  # all but the feet
    found = rejected(replace(clip, joints=joints))
    assert set(found) == {"balance_still"}


def test_of_two_feet_the_one_that_is_wrong_is_named_and_its_mirror_image_on_the_other_side() -> None:
    clip = standing(90)
    by = np.zeros((90, 1, 3))
    by[20:60, 0, 0] = 0.1 / 30.0 * np.arange(1, 41)
    by[60:] = by[59]
    joints, feet = clip.joints.copy(), clip.feet.copy()
    joints[:, [JOINT["right_ankle"]]] += by
    feet[:, [0]] += by
    right = replace(clip, joints=joints, feet=feet)
    sides = [JOINTS.index(other_side(name)) for name in JOINTS]
    mirror = np.array([1.0, -1.0, 1.0])
    left = replace(right, joints=right.joints[:, sides] * mirror, feet=right.feet[:, [1, 0, 3, 2]] * mirror)
    check = [MOTION_CHECKS["sliding"]()]
    one, other = (judge_motion(check, each).judgements[0].violated for each in (right, left))
    assert one[:, 0].any() and not one[:, 1].any()
    np.testing.assert_array_equal(one, other[:, ::-1])


@pytest.mark.parametrize("angle", [1.0, 3.0])
def test_where_and_how_the_body_is_turned_about_up_changes_nothing(angle: float) -> None:
    clip = flight(standing(120), 30, 45, falls=False)
    turn = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    away = np.array([3.0, -8.0, 0.7])
    turned = replace(clip, joints=clip.joints @ turn + away, feet=clip.feet @ turn + away)
    assert rejected(turned) == rejected(clip)
    axes = np.eye(3)[[2, 0, 1]]  # another axis is up
    other = replace(clip, joints=clip.joints @ axes, feet=clip.feet @ axes, up=UP @ axes)
    assert rejected(other) == rejected(clip)


@pytest.mark.parametrize("rate", [24.0, 60.0, 120.0])
def test_more_frames_a_second_of_the_same_hover_give_the_same_seconds(rate: float) -> None:
    count = round(4 * rate)
    clip = flight(standing(count, rate=rate), round(rate), round(1.5 * rate), falls=False)
    seconds = [frame / rate for frame in rejected(clip)["floating"]]
    assert seconds[0] == pytest.approx(1.1, abs=0.12) and seconds[-1] == pytest.approx(2.4, abs=0.12)


def test_a_step_that_no_foot_rests_at_lifts_nothing() -> None:
    height = np.cumsum(np.full((40, 6), 0.05), axis=0)
    height[10:20] += 0.1
    assert not lifted_by(height, slice(4, 6), 30.0).any()


def test_distance_from_a_support_is_that_from_its_hull() -> None:
    square = np.array([[0, 0, 5.0], [1, 0, 0], [1, 1, 2], [0, 1, 0]])[None]
    for at, away in (((2, 0.5, 9), 1.0), ((0.5, 0.5, 1), -0.5), ((2, 2, 0), np.sqrt(2))):
        found = beyond_support(np.array([at], dtype=float), square, UP)
        np.testing.assert_allclose(found, [away], rtol=1e-3)


def test_published_measures_say_nothing_of_who_stands_and_all_of_who_glides() -> None:
    checks = [kind() for name, kind in MOTION_CHECKS.items() if name.startswith("skating-")]
    still, by = standing(60, ground=0.0), np.zeros((60, 3))
    by[:, 0] = 0.8 / 30.0 * np.arange(60)
    assert len(checks) == 3
    assert not any(one.violated.any() for one in judge_motion(checks, still).judgements)
    for one in judge_motion(checks, moved(still, by)).judgements:
        assert one.violated[5:-5].all(), one.check


def test_rules_of_curation_pass_who_stands_and_reject_who_lies_low() -> None:
    checks = load_profile("phuma").checks
    clip = standing(150)
    assert not any(one.violated.any() for one in judge_motion(checks, clip).judgements)
    low = replace(clip, joints=clip.joints * np.array([1, 1, 0.5]))
    names = {one.check for one in judge_motion(checks, low).judgements if one.violated.any()}
    assert names == {"root_height"}


@pytest.mark.parametrize("side", ["right", "left"])
def test_on_a_foot_whose_heel_is_known_the_ankle_is_none(side: str) -> None:
    """On its toes, the other foot lifted: what is lowest is the ankle itself, not the heel that would be below it."""
    clip = standing(60, toes=False)
    joints = clip.joints.copy()
    joints[:, JOINT[other_side(f"{side}_ankle")], 2] += 0.3
    ankle = joints[:, JOINT[f"{side}_ankle"]]
    feet = np.full((60, len(FEET_POINTS), 3), np.nan)
    unknown = ground_of(replace(clip, joints=joints)).lowest
    feet[:, FEET_POINTS.index(f"{side}_heel")] = ankle + 0.05 * UP
    known = ground_of(replace(clip, joints=joints, feet=feet))
    np.testing.assert_allclose(known.low + known.lowest, ankle[:, 2], atol=1e-9)
    assert (unknown + ground_of(replace(clip, joints=joints)).low < ankle[:, 2] - 0.02).all()
