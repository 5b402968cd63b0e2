"""What checks of ground and feet measure, on bodies whose feet are put where the measure can be written down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from posekit.body import load_figure
from posekit.geometry import Array
from posekit.ranking.centre_of_mass import centre_of_mass
from posekit.skeleton import JOINT, JOINTS
from posekit.validators.motion import MotionClip
from posekit.validators.motion.balance_still import BalanceStill
from posekit.validators.motion.curation import ContactShare, RootHeight, SupportDistance
from posekit.validators.motion.floating import Floating
from posekit.validators.motion.ground import ground_of, soles, speeds, stature_of
from posekit.validators.motion.penetration import Penetration
from posekit.validators.motion.skating import GmdSkating, PhysDiffSkate, WhamSliding
from posekit.validators.motion.sliding import Sliding
from posekit.validators.motion.support import Support

UP = np.array([0.0, 0.0, 1.0])
BODY = load_figure().neutral_points[: len(JOINTS)]
ANKLES = [JOINT["right_ankle"], JOINT["left_ankle"]]
FOOT = np.array([[0.16, 0.0], [0.16, 0.0], [-0.05, 0.0], [-0.05, 0.0]])
"""Toes and heels before and behind the ankles, metres."""


def standing(count: int = 60, *, rate: float = 30.0, sole: float = 0.0, **known: object) -> MotionClip:
    """Return a body that stands still, but for a breath, toes and heels 2 cm over soles at a height."""
    joints = np.repeat(BODY[None], count, axis=0)
    feet = np.repeat(joints[:, ANKLES], 2, axis=1)[:, [0, 2, 1, 3]]
    feet[:, :, 0] += FOOT[:, 0]
    feet[:, :, 2] = 0.02
    joints[:, :, 2] += 0.08 - BODY[ANKLES, 2].min()
    joints[:, 0, 2] += 1e-4 * np.sin(np.arange(count))
    by = sole * UP
    given_ = {
        "joints": joints + by,
        "feet": feet + by,
        "time": np.arange(count) / rate,
        "rate": rate,
        "up": UP,
    }
    return MotionClip(**{**given_, **known})  # type: ignore[arg-type]


def moved(clip: MotionClip, by: Array) -> MotionClip:
    """Move each frame by (T, 3)."""
    return replace(clip, joints=clip.joints + by[:, None], feet=clip.feet + by[:, None])


def gliding(way: ArrayLike, clip: MotionClip) -> MotionClip:
    return moved(clip, np.asarray(way)[:, None] * np.array([0.6, 0.8, 0.0]))


# --- the ground -----------------------------------------------------------------------------------------


def test_the_stature_is_that_of_the_legs() -> None:
    """Thigh and shank are 0.245 and 0.246 of it (Winter 2009, figure 4.1)."""
    clip = standing()
    legs = [
        np.linalg.norm(BODY[JOINT[f"{side}_{a}"]] - BODY[JOINT[f"{side}_{b}"]])
        for side in ("right", "left") for a, b in (("hip", "knee"), ("knee", "ankle"))
    ]  # fmt: skip
    assert stature_of(clip) == pytest.approx(sum(legs) / 2 / 0.491)
    one = clip.joints.copy()
    one[:, JOINT["left_ankle"]] = np.nan
    assert stature_of(replace(clip, joints=one)) == pytest.approx(2 * np.mean(legs[:3]) / 0.491)
    assert np.isnan(stature_of(replace(clip, joints=clip.joints * np.nan)))


def test_soles_are_below_toes_and_ankles() -> None:
    clip = standing()
    points, over = soles(clip)
    assert points.shape == (60, 6, 3)
    np.testing.assert_array_equal(points[:, 4:], clip.joints[:, ANKLES])
    np.testing.assert_allclose(over, [0.02] * 4 + [0.039 * stature_of(clip)] * 2)
    np.testing.assert_allclose(soles(replace(clip, q=np.zeros((60, 1))))[1][:4], 0.0)
    nobody = replace(clip, joints=clip.joints * np.nan)
    np.testing.assert_allclose(soles(nobody)[1][4:], 0.039 * 1.7)


@pytest.mark.parametrize("rate", [10.0, 19.0, 20.0, 60.0])
@pytest.mark.parametrize("frames", [1, 2])
def test_speeds_are_over_frames_before_and_after(rate: float, frames: int) -> None:
    """Who turns back at a frame has no speed between its neighbours, and under 20 frames a second that of the ways."""
    way = 0.3 * np.abs(np.arange(21) - 10.0) / rate
    clip = gliding(way, standing(21, rate=rate))
    found = speeds(clip, clip.feet[:, :1], frames)[:, 0]
    assert np.isnan(found[:frames]).all() and np.isnan(found[-frames:]).all()
    np.testing.assert_allclose(found[frames : 10 - frames + 1], 0.3)
    assert found[10] == pytest.approx(0.3 if rate < 20 else 0.0, abs=1e-9)
    few = gliding(way[: 2 * frames], standing(2 * frames, rate=rate))
    assert np.isnan(speeds(few, few.feet, frames)).all()
    enough = gliding(way[: 2 * frames + 1], standing(2 * frames + 1, rate=rate))
    assert np.isfinite(speeds(enough, enough.feet, frames)[frames]).all()


@given(sole=st.floats(-3, 3), given_ground=st.floats(-3, 3))
def test_the_ground_is_below_the_soles_of_who_stands(sole: float, given_ground: float) -> None:
    ground = ground_of(standing(sole=sole, ground=given_ground))
    assert ground.low == pytest.approx(sole, abs=1e-9)
    assert ground.high == pytest.approx(0.0, abs=1e-9)
    assert ground.offset == pytest.approx(sole - given_ground, abs=1e-9)
    assert ground.resting[1:-1].all() and not ground.in_air.any() and not ground.hanging.any()
    assert ground_of(standing(sole=sole)).offset == 0.0


@pytest.mark.parametrize(("speed", "rests"), [(0.24, True), (0.26, False)])
def test_what_is_slower_than_a_quarter_of_a_metre_a_second_rests(speed: float, rests: bool) -> None:
    clip = gliding(speed * np.arange(60) / 30.0, standing())
    assert ground_of(clip).resting[1:-1].all() == rests
    assert ground_of(clip).resting.any() == rests


@pytest.mark.parametrize(("speed", "rests"), [(0.29, True), (0.31, False)])
def test_noise_makes_what_rests_faster(speed: float, rests: bool) -> None:
    """Two deviations of a speed over two frames: 2 √2 times the noise over 2 / 30 s is 5 cm/s here."""
    clip = gliding(speed * np.arange(60) / 30.0, standing(noise=0.05 / 30.0 / np.sqrt(2)))
    assert ground_of(clip).resting[1:-1].any() == rests


@pytest.mark.parametrize(("height", "rests"), [(0.28, True), (0.34, False)])
def test_what_rests_carries_near_the_lowest_point(height: float, rests: bool) -> None:
    """A hand on something 30 cm over the feet carries nobody whose feet go."""
    clip = standing()
    joints, feet = clip.joints.copy(), clip.feet.copy()
    way = (np.arange(60) / 30.0)[:, None] * np.array([1.0, 0.0, 0.0])
    joints += way[:, None]
    feet += way[:, None]
    joints[:, JOINT["left_wrist"]] = [0.5, 0.5, height]
    found = ground_of(replace(clip, joints=joints, feet=feet)).resting
    assert found[1:-1].all() == rests and found.any() == rests


@pytest.mark.parametrize(("height", "flies"), [(0.028, False), (0.032, True)])
def test_who_is_three_centimetres_up_is_in_the_air(height: float, flies: bool) -> None:
    clip = standing(90)
    by = np.zeros((90, 3))
    by[:, 2] = np.interp(np.arange(90), [28, 31, 59, 62], [0.0, height, height, 0.0])
    by[:, 0] = 0.02 * np.clip(np.arange(90) - 25, 0, 40)  # so that nothing rests there
    found = ground_of(moved(clip, by)).in_air
    assert found[31:60].all() == flies and found.any() == flies


# --- heights --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("height", [0.0, 0.07, -0.04])
def test_floating_and_penetration_are_heights_over_the_ground_that_is_given(height: float) -> None:
    clip = standing(sole=height, ground=0.0)
    for check in (Floating(), Penetration()):
        np.testing.assert_allclose(check.judge(clip).value, height, atol=1e-9)


@pytest.mark.parametrize(("given_ground", "unlevel"), [(True, 0.0), (False, 0.1)])
@pytest.mark.parametrize("depth", [0.05, 0.3])
def test_a_swing_below_the_ground_is_as_deep_as_it_goes(
    given_ground: bool, unlevel: float, depth: float
) -> None:
    """Where the ground is not given it may be 10 cm lower where nothing rests."""
    clip = standing(90, ground=0.0 if given_ground else None)
    by = np.zeros((90, 3))
    dip = np.clip(1.0 - np.abs(np.arange(90) - 45) / 15.0, 0.0, 1.0)
    by[:, 2] = -depth * dip
    by[:, 0] = 0.02 * np.clip(np.arange(90) - 29, 0, 31)
    found = Penetration().judge(moved(clip, by)).value[:, 0]
    np.testing.assert_allclose(found[35:55], np.minimum(by[35:55, 2] + unlevel, 0.0), atol=2e-3)


@pytest.mark.parametrize("shortest", [0.98, 1.02])
@pytest.mark.parametrize("fall", [0.0, 0.45, 0.55])
def test_a_flight_of_a_second_that_does_not_fall_floats(fall: float, shortest: float) -> None:
    """It is judged where it is long enough, and falls by half of gravity or more."""
    time = (np.arange(90) - 29) / 30.0
    inside = (time > 0) & (time < 31 / 30)
    way = (
        fall * 4.905 * time * (31 / 30 - time)
        if fall
        else np.clip(3 * np.minimum(time, 31 / 30 - time), 0, 0.3)
    )
    by = np.zeros((90, 3))
    by[:, 2] = np.where(inside, way, 0.0)
    by[:, 0] = np.clip(time, 0.0, 31 / 30)
    clip = moved(standing(90), by)
    assert np.flatnonzero(ground_of(clip).in_air).tolist() == list(range(30, 60))
    found = Floating(shortest=shortest).judge(clip).value[:, 0]
    np.testing.assert_allclose(found, by[:, 2] if shortest < 1 and fall < 0.5 else 0.0, atol=1e-2)
    stricter = Floating(fall=fall + 0.3).judge(clip).value[:, 0]
    np.testing.assert_allclose(stricter, by[:, 2], atol=1e-2)
    np.testing.assert_allclose(Support().judge(clip).value[:, 0], np.where(inside, 1.0, 0.0))


# --- feet that go ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [20.0, 30.0, 60.0])
@pytest.mark.parametrize("speed", [0.1, 0.7])
@pytest.mark.parametrize(
    ("check", "own"), [(GmdSkating(), 20.0), (WhamSliding(), 30.0), (PhysDiffSkate(), np.nan)]
)
def test_published_skating_is_the_way_in_a_frame_of_its_own(
    check: GmdSkating | WhamSliding | PhysDiffSkate, own: float, speed: float, rate: float
) -> None:
    clip = gliding(speed * np.arange(60) / rate, standing(rate=rate, ground=0.0))
    found = check.judge(clip).value
    assert check.places(clip) == ("right_foot", "left_foot")
    assert np.isnan(found[0]).all()
    np.testing.assert_allclose(found[3:-3], speed / (rate if np.isnan(own) else own))


@pytest.mark.parametrize(
    ("check", "height"), [(GmdSkating(), 0.05), (WhamSliding(), 0.05), (PhysDiffSkate(), 0.005)]
)
@pytest.mark.parametrize(("share", "touches"), [(0.98, True), (1.02, False)])
def test_published_skating_is_of_feet_that_are_low_in_two_frames(
    check: GmdSkating | WhamSliding | PhysDiffSkate, height: float, share: float, touches: bool
) -> None:
    clip = gliding(0.02 * np.arange(60), standing(ground=0.0))
    feet = clip.feet.copy()
    feet[20:40, 0, 2] += share * height  # the right toe
    found = check.judge(replace(clip, feet=feet)).value
    assert (found[25:35, 0] > 0).all() == touches and (found[20:41, 0] > 0).any() == touches
    assert (found[3:-3, 1] > 0).all()


def test_one_measure_counts_ways_upward_and_one_takes_the_mean_of_five() -> None:
    clip = standing(ground=0.0)
    feet = clip.feet.copy()
    feet[30:, 0, 0] += 0.03
    feet[30:, 0, 2] += 0.004
    one = replace(clip, feet=feet)
    wham, diff, gmd = (
        check.judge(one).value[:, 0] for check in (WhamSliding(), PhysDiffSkate(), GmdSkating())
    )
    assert wham[30] == pytest.approx(np.hypot(0.03, 0.004)) and diff[30] == pytest.approx(0.03)
    assert np.flatnonzero(gmd > 1e-9).tolist() == [28, 29, 30, 31, 32]
    np.testing.assert_allclose(gmd[28:33], 0.03 * 30 / 20 / 5)
    for found in (wham, diff):
        assert np.flatnonzero(found > 1e-9).tolist() == [30]


def test_feet_without_toes_skate_by_their_ankles() -> None:
    clip = gliding(0.02 * np.arange(60), standing(ground=0.0))
    joints, feet = clip.joints.copy(), clip.feet.copy()
    feet[:, [0, 2]] = np.nan
    joints[:, JOINT["right_ankle"], 0] += 0.01 * np.arange(60)
    over = 0.039 * stature_of(clip)
    joints[:, ANKLES, 2] = over
    found = PhysDiffSkate().judge(replace(clip, joints=joints, feet=feet)).value
    np.testing.assert_allclose(found[3:-3, 1], 0.02)
    np.testing.assert_allclose(found[3:-3, 0], np.hypot(0.022, 0.016))


@pytest.mark.parametrize("rate", [25.0, 30.0, 60.0])
@pytest.mark.parametrize("speed", [0.05, 0.2, 0.6])
def test_a_slide_is_as_fast_as_it_goes(speed: float, rate: float) -> None:
    start, stop = round(rate), round(2.5 * rate)
    way = speed * np.clip(np.arange(round(4 * rate)) - start, 0, stop - start) / rate
    found = Sliding().judge(gliding(way, standing(len(way), rate=rate))).value
    inside = slice(start + 3, stop - 3)
    np.testing.assert_allclose(found[inside], speed, rtol=0.02)
    assert not found[: start - 3].any() and not found[stop + 3 :].any()


@pytest.mark.parametrize(("rate", "seconds", "slides"), [
    (60.0, 0.3, False), (60.0, 0.6, True),
    (25.0, 0.6, False), (25.0, 1.0, True),  # twice as long at fewer than 29 frames a second
])  # fmt: skip
def test_a_slide_lasts_for_a_while(rate: float, seconds: float, slides: bool) -> None:
    way = 0.3 * np.clip(np.arange(round(4 * rate)) / rate - 1.5, 0, seconds)
    found = Sliding().judge(gliding(way, standing(len(way), rate=rate))).value
    assert found.any() == slides


@pytest.mark.parametrize(("rate", "lasting", "frames"), [
    (30.0, 0.4, 12), (60.0, 0.4, 24), (29.0, 0.4, 12), (28.0, 0.4, 22), (20.0, 0.4, 16), (30.0, 0.01, 3),
])  # fmt: skip
def test_a_slide_is_of_so_many_frames(rate: float, lasting: float, frames: int) -> None:
    assert Sliding(lasting=lasting)._frames(standing(4, rate=rate)) == frames


@pytest.mark.parametrize(("speed", "noise", "slides"), [
    (0.19, 0.06, False), (0.21, 0.06, True), (0.98, 0.06, True), (1.02, 0.06, False), (1.02, 0.0, True),
])  # fmt: skip
def test_under_noise_a_slide_is_faster_than_what_feet_differ_by(
    speed: float, noise: float, slides: bool
) -> None:
    """By three tenths of it, noise of three deviations of a way; and slower than a swing, whose roll noise hides."""
    clip = standing(60, noise=noise / 30.0 / (3 * np.sqrt(2)))
    assert Sliding().judge(gliding(speed * np.arange(60) / 30.0, clip)).value.any() == slides


@pytest.mark.parametrize(("rise", "slides"), [(0.045, True), (0.055, False)])
def test_a_foot_that_goes_up_or_down_does_not_slide(rise: float, slides: bool) -> None:
    for sign in (1.0, -1.0):
        clip = gliding(0.3 * np.arange(20) / 30.0, standing(20))
        by = np.zeros((20, 3))
        by[:, 2] = sign * rise * np.arange(20) / 30.0
        assert Sliding().judge(moved(clip, by)).value.any() == slides


@pytest.mark.parametrize(("height", "slides"), [(0.035, True), (0.045, False)])
def test_a_foot_slides_that_is_down(height: float, slides: bool) -> None:
    """The other foot stands where the ground is; this one is so high over it."""
    clip = standing(60)
    joints, feet = clip.joints.copy(), clip.feet.copy()
    way = 0.2 * np.arange(60) / 30.0
    for points, which in ((joints, [ANKLES[0]]), (feet, [0, 2])):
        points[:, which, 0] += way[:, None]
        points[:, which, 2] += height
    joints[:, ANKLES[0], 2] = 0.2
    found = Sliding().judge(replace(clip, joints=joints, feet=feet)).value
    assert found[:, 0].any() == slides and not found[:, 1].any()


# --- standing and falling over --------------------------------------------------------------------------


@given(lean=st.floats(0.0, 0.2))
def test_who_stands_still_is_as_far_from_falling_as_the_centre_of_mass_is_from_the_feet(lean: float) -> None:
    clip = standing(60)
    joints = clip.joints.copy()
    joints[:, : ANKLES[0], 0] += lean
    clip = replace(clip, joints=joints)
    centre = centre_of_mass(np.moveaxis(joints[30:31], 0, -1))[:, 0]
    toe, heel = clip.feet[30, 0, 0], clip.feet[30, 2, 0]
    side = np.abs(clip.feet[30, :2, 1]).min() - abs(centre[1])
    # Each foot reaches two fifths of its length, 0.152 of the stature, beyond its points.
    reach = 0.4 * 0.152 * stature_of(clip)
    expected = max(centre[0] - toe, heel - centre[0], -side) - reach
    np.testing.assert_allclose(BalanceStill().judge(clip).value[2:-2, 0], expected, atol=1e-6)


def test_without_toes_feet_reach_beyond_their_ankles() -> None:
    clip = standing(60)
    joints = clip.joints.copy()
    joints[:, : ANKLES[0], 0] += 0.2
    bare = replace(clip, joints=joints, feet=np.empty(0))
    centre = centre_of_mass(np.moveaxis(joints[:1], 0, -1))[0, 0]
    expected = centre - joints[0, ANKLES[0], 0] - 0.75 * 0.152 * stature_of(bare)
    np.testing.assert_allclose(BalanceStill().judge(bare).value[2:-2, 0], expected, atol=1e-6)


@pytest.mark.parametrize(("lift", "bears"), [(0.055, True), (0.065, False)])
def test_a_foot_bears_that_is_within_six_centimetres(lift: float, bears: bool) -> None:
    clip = standing(60)
    joints, feet = clip.joints.copy(), clip.feet.copy()
    joints[:, ANKLES[0], 2] += lift
    feet[:, [0, 2], 2] += lift
    raised = replace(clip, joints=joints, feet=feet)
    both, found = (BalanceStill().judge(each).value[2:-2, 0] for each in (clip, raised))
    assert (np.abs(found - both) < 0.005).all() == bears
    # On the left foot alone the centre of mass is beside it.
    assert (found > both + 0.05).all() != bears


@pytest.mark.parametrize(
    ("speed", "count", "still"), [(0.09, 40, True), (0.11, 40, False), (0.05, 31, True), (0.05, 29, False)]
)
def test_still_is_slow_for_a_second(speed: float, count: int, still: bool) -> None:
    """Before and after, the body goes at half a metre a second."""
    fast = np.full(120, 0.5)
    fast[40 : 40 + count + 1] = speed
    found = BalanceStill().judge(gliding(np.cumsum(fast) / 30.0, standing(120))).value
    assert np.isfinite(found).any() == still


@pytest.mark.parametrize(("noise", "limit"), [(0.05, 0.15), (0.25, 0.1 + 0.25 / 3)])
@pytest.mark.parametrize("share", [0.98, 1.02])
def test_still_is_slower_by_four_deviations_of_a_speed(noise: float, limit: float, share: float) -> None:
    """Over so many frames before and after that noise is no faster than 10 cm/s."""
    clip = standing(120, noise=noise * np.sqrt(2) / 30.0 / 4.0)
    found = BalanceStill().judge(gliding(share * limit * np.arange(120) / 30.0, clip)).value
    assert np.isfinite(found[5:-5]).all() == np.isfinite(found[5:-5]).any() == (share < 1)


def test_who_sits_may_lean() -> None:
    """Hips that are lower than four fifths of the legs over the feet may sit on something."""
    for share, judged in ((0.82, True), (0.78, False)):
        clip = standing(60)
        joints = clip.joints.copy()
        for side in ("right", "left"):
            hip, knee, ankle = (JOINT[f"{side}_{name}"] for name in ("hip", "knee", "ankle"))
            thigh, shank = (float(np.linalg.norm(BODY[a] - BODY[b])) for a, b in ((hip, knee), (knee, ankle)))
            height = share * (thigh + shank)
            along = (shank**2 - thigh**2 + height**2) / (2 * height)
            at = joints[:, ankle]
            joints[:, hip] = at + height * UP
            joints[:, knee] = at + along * UP + np.sqrt(shank**2 - along**2) * np.eye(3)[0]
        joints[:, : JOINT["right_hip"]] += (
            joints[0, JOINT["right_hip"], 2] - clip.joints[0, JOINT["right_hip"], 2]
        ) * UP
        found = BalanceStill().judge(replace(clip, joints=joints)).value[2:-2]
        assert np.isfinite(found).all() == np.isfinite(found).any() == judged


# --- PHUMA's curation -----------------------------------------------------------------------------------


@given(touching=st.integers(0, 60))
def test_contact_is_the_share_of_frames_in_which_a_foot_is_near_the_ground(touching: int) -> None:
    by = np.zeros((60, 3))
    by[touching:, 2] = 0.4
    found = ContactShare().judge(moved(standing(60, ground=0.0), by)).value
    np.testing.assert_allclose(found[:, 0], touching / 60)


@pytest.mark.parametrize(
    ("height", "touches"), [(0.024, True), (0.026, False), (-0.024, True), (-0.026, False)]
)
def test_a_foot_touches_within_half_a_window(height: float, touches: bool) -> None:
    found = ContactShare().judge(standing(60, sole=height, ground=0.0)).value
    assert (found == float(touches)).all()


def test_shares_are_of_the_worst_part_of_four_seconds() -> None:
    """Of ten seconds the first three are in the air: parts begin at 0, 3.5 and 7 s."""
    by = np.zeros((300, 3))
    by[:90, 2] = 0.4
    clip = moved(standing(300, ground=0.0), by)
    found = ContactShare().judge(clip).value[:, 0]
    np.testing.assert_allclose(found[:120], 0.25)
    np.testing.assert_allclose(found[120:], 1.0)
    away = SupportDistance().judge(moved(standing(300), np.zeros((300, 3)))).value
    assert not away.any()


def test_the_ground_is_voted_for_by_frames_and_the_root_is_over_it() -> None:
    clip = standing(90, sole=0.3)
    by = np.zeros((90, 3))
    by[:20, 2] = 0.2
    clip = moved(clip, by)
    hips = clip.joints[:, [JOINT["right_hip"], JOINT["left_hip"]], 2].mean(axis=1)
    # All others' soles are at 0.3, the foot of a window of 5 cm: the ground is the middle of it.
    np.testing.assert_allclose(RootHeight().judge(clip).value[:, 0], hips - 0.325)
    np.testing.assert_allclose(RootHeight().judge(replace(clip, ground=0.1)).value[:, 0], hips - 0.1)
    np.testing.assert_allclose(RootHeight(window=0.01).judge(clip).value[:, 0], hips - 0.305)
    nothing = replace(clip, joints=clip.joints * np.nan, feet=clip.feet * np.nan)
    assert np.isnan(RootHeight().judge(nothing).value).all()


@given(lean=st.floats(0.0, 0.8))
def test_support_distance_is_how_far_hips_are_beyond_ankles_and_toes(lean: float) -> None:
    clip = standing(60)
    joints = clip.joints.copy()
    joints[:, : ANKLES[0], 0] += lean
    found = SupportDistance().judge(replace(clip, joints=joints)).value
    front, back = clip.feet[0, 0, 0], clip.feet[0, 2, 0]
    hips = joints[0, [JOINT["right_hip"], JOINT["left_hip"]], 0].mean()
    for k, at in enumerate((hips, joints[0, JOINT["pelvis"], 0])):
        np.testing.assert_allclose(found[:, k], max(at - front, back - at, 0.0), atol=1e-6)


def test_of_what_is_not_known_no_share_is_taken() -> None:
    clip = standing(150, ground=0.0)
    joints, feet = clip.joints.copy(), clip.feet.copy()
    joints[:, ANKLES] = feet[:] = np.nan
    assert np.isnan(SupportDistance().judge(replace(clip, joints=joints, feet=feet)).value).all()
    joints[:60], feet[:60] = clip.joints[:60], clip.feet[:60]
    found = SupportDistance().judge(replace(clip, joints=joints, feet=feet)).value
    np.testing.assert_allclose(
        found[:120], 0.0, atol=0.05
    )  # the part from 3.5 s on has no frame that is known
    assert np.isnan(found[120:]).all()


def test_feet_without_toes_touch_by_their_ankles() -> None:
    clip = standing(60, ground=0.0)
    bare = replace(clip, feet=np.empty(0))
    ankle = clip.joints[0, ANKLES[0], 2] - 0.039 * stature_of(clip)
    found = ContactShare().judge(bare).value
    assert (found == float(abs(ankle) <= 0.025)).all()
    high = moved(bare, np.repeat((0.1 * UP)[None], 60, axis=0))
    assert not ContactShare().judge(high).value.any()


def test_levels_of_the_ground_are_percentiles_of_what_rests_or_of_all_where_little_does() -> None:
    rising = moved(standing(), np.linspace(0.0, 0.03, 60)[:, None] * UP)
    flying = moved(standing(), np.arange(60)[:, None] * np.array([0.05, 0.0, 0.015]))
    for one, most in ((rising, 98), (flying, 50)):
        found = ground_of(one)
        heights = found.lowest + found.low
        held = heights[found.resting] if most == 98 else heights
        assert found.resting.any() == (most == 98)
        assert found.low == pytest.approx(np.percentile(held, 5))
        assert found.low + found.high == pytest.approx(np.percentile(held, most))
