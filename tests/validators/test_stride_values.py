"""Swings over strides, exchanged sides and frames out of order: what is measured and found of made-up motion."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.skeleton import JOINT, JOINTS
from posekit.validators.motion import MotionClip
from posekit.validators.motion.order import _stretches, displaced, stretches_of
from posekit.validators.motion.sides import (
    LEFT_JOINTS,
    RIGHT_JOINTS,
    _sure,
    exchanged_pairs,
    known_before,
    put_right,
)
from posekit.validators.motion.strides import Strides
from posekit.validators.motion.walking_phases import WalkingPhases

BODY = load_figure().neutral_points[: len(JOINTS)]
FORWARD, LEFT, UP = np.eye(3)
RATE = 40.0


def swinging(
    ends: dict[str, tuple[float, float, float]], *, count: int = 160, speed: float = 1.0, rate: float = RATE
) -> Array:
    """Swing joints about where they hang: metres forward, metres to the left, and the phase in turns a second."""
    time = np.arange(count) / rate
    joints = BODY + speed * time[:, None, None] * FORWARD
    for name, (along, aside, phase) in ends.items():
        wave = np.sin(2 * np.pi * (time + phase))
        joints[:, JOINT[name]] += wave[:, None] * (along * FORWARD + aside * LEFT)
    return np.asarray(joints)


def strides(joints: Array, half: int = 20) -> Strides:
    return Strides(joints=joints, step=1.0 / RATE, half=half)


MIDDLE = slice(60, 100)


@given(
    values=st.lists(st.one_of(st.floats(-5, 5), st.just(np.nan)), min_size=1, max_size=30),
    half=st.integers(1, 6),
)
def test_a_mean_is_over_half_a_stride_before_and_after_where_half_of_it_is_known(
    values: list[float], half: int
) -> None:
    column = np.array(values)
    found = strides(np.zeros((len(values), 14, 3)), half).mean(np.stack([column, 2 * column], axis=1))
    for k in range(len(values)):
        window = column[max(k - half, 0) : k + half + 1]
        known = window[np.isfinite(window)]
        expected = known.mean() if len(known) >= 0.5 * (2 * half + 1) else np.nan
        np.testing.assert_allclose(found[k], [expected, 2 * expected], atol=1e-9)


@given(speed=st.floats(-2, 2), turn=st.floats(-3, 3))
def test_the_speed_is_that_of_the_hips_across_the_trunk(speed: float, turn: float) -> None:
    way = np.cos(turn) * FORWARD + np.sin(turn) * LEFT
    time = np.arange(120) / RATE
    joints = BODY + time[:, None, None] * (speed * way + 0.7 * UP)
    found = strides(np.asarray(joints))
    np.testing.assert_allclose(found.speed[MIDDLE], abs(speed), atol=1e-6)
    np.testing.assert_allclose(found.velocity[MIDDLE], np.tile(speed * way + 0.7 * UP, (40, 1)), atol=1e-6)


@pytest.mark.parametrize("phase", [0.0, 0.1, 0.25, 0.4, 0.5])
def test_two_swings_are_in_step_by_the_cosine_of_their_phases(phase: float) -> None:
    found = strides(swinging({"right_elbow": (0.1, 0.0, 0.0), "left_elbow": (0.2, 0.0, phase)}))
    r = found.in_step("right_elbow", "left_elbow", 0.03)
    np.testing.assert_allclose(r[MIDDLE], np.cos(2 * np.pi * phase), atol=0.03)
    np.testing.assert_allclose(
        found.swing("right_elbow")[60:100:10],
        0.1 * np.sin(2 * np.pi * np.arange(60, 100, 10) / RATE),
        atol=0.01,
    )


@pytest.mark.parametrize(("swing", "judged"), [(0.041, False), (0.0445, True)])
def test_who_hardly_swings_is_not_judged(swing: float, judged: bool) -> None:
    """Three centimetres root mean square are 4.24 of amplitude."""
    for other in (0.2, swing):
        found = strides(swinging({"right_elbow": (swing, 0.0, 0.0), "left_elbow": (other, 0.0, 0.5)}))
        assert np.isfinite(found.in_step("right_elbow", "left_elbow", 0.03)[MIDDLE]).all() == judged
        assert np.isfinite(found.in_step("left_elbow", "right_elbow", 0.03)[MIDDLE]).all() == judged
        wrist = strides(swinging({"right_wrist": (swing, 0.0, 0.0)}))
        assert np.isfinite(wrist.across("right_shoulder", "right_wrist", 0.03)[MIDDLE]).all() == judged


@given(angle=st.floats(0.0, 1.4))
def test_a_limb_moves_across_by_the_sine_of_its_way(angle: float) -> None:
    along, aside = 0.3 * np.cos(angle), 0.3 * np.sin(angle)
    found = strides(swinging({"left_ankle": (along, aside, 0.1)}))
    np.testing.assert_allclose(found.across("left_hip", "left_ankle", 0.01)[MIDDLE], np.sin(angle), atol=1e-6)


def test_one_frame_has_no_rate() -> None:
    assert np.isnan(strides(np.zeros((1, 14, 3))).rate(np.zeros(1))).all()
    assert strides(np.zeros((2, 14, 3))).rate(np.array([0.0, 1.0])).tolist() == [RATE, RATE]


def clip_of(joints: Array, rate: float = RATE) -> MotionClip:
    return MotionClip(joints=joints, time=np.arange(len(joints)) / rate, rate=rate)


STRIDE = {
    "right_elbow": (0.1, 0.0, 0.0), "left_elbow": (0.1, 0.0, 0.5),
    "right_knee": (0.1, 0.0, 0.5), "left_knee": (0.1, 0.0, 0.0),
    "right_wrist": (0.2, 0.05, 0.0), "left_wrist": (0.2, 0.05, 0.5),
    "right_ankle": (0.2, 0.05, 0.5), "left_ankle": (0.2, 0.05, 0.0),
}  # fmt: skip


def test_every_rule_says_its_number_at_its_places() -> None:
    """Arms in turn with legs and each other: correlations of -1; and limbs that go across by 0.05 in 0.206."""
    clip = clip_of(swinging(STRIDE))
    check = WalkingPhases()
    found, places = check.judge(clip), check.places(clip)
    assert sorted(places) == sorted(
        ["rule1.arms", "rule1.legs", "rule2.right", "rule2.left"]
        + [f"rule4.{side}_{limb}" for side in ("right", "left") for limb in ("arm", "leg")]
    )
    for k, place in enumerate(places):
        across = place.startswith("rule4")
        expected = 0.05 / np.hypot(0.2, 0.05) if across else -1.0
        np.testing.assert_allclose(found.value[MIDDLE, k], expected, atol=0.01)
        assert np.broadcast_to(found.upper, found.value.shape)[0, k] == (0.71 if across else 0.0)
        assert np.isneginf(found.lower)
    together = {**STRIDE, "left_elbow": (0.1, 0.0, 0.0)}
    wrong = check.judge(clip_of(swinging(together)))
    named = {places[k] for k in np.flatnonzero(wrong.violated[MIDDLE].all(axis=0))}
    assert named == {"rule1.arms", "rule2.left"}


@pytest.mark.parametrize(("speed", "judged"), [(0.29, False), (0.31, True)])
def test_who_goes_by_less_than_30_centimetres_a_second_does_not_walk(speed: float, judged: bool) -> None:
    found = WalkingPhases().judge(clip_of(swinging(STRIDE, speed=speed)))
    assert np.isfinite(found.value[MIDDLE]).all() == np.isfinite(found.value[MIDDLE]).any() == judged


def test_rules_are_named_by_commas() -> None:
    clip = clip_of(swinging(STRIDE))
    assert {place[:5] for place in WalkingPhases(rules="2,4").places(clip)} == {"rule2", "rule4"}
    with pytest.raises(InputError, match=r"rules: '1,3'; expected some of 1, 2, 4, by commas"):
        WalkingPhases(rules="1,3")


@pytest.mark.parametrize("rate", [25.0, 60.0])
def test_a_stride_lasts_for_more_than_a_second(rate: float) -> None:
    """Of a joint that is unknown but for 0.58 s of every stride of 1.2 nothing is said, and of 0.7 s something is."""
    for known, said in ((0.55, False), (0.75, True)):
        joints = swinging(STRIDE, count=round(4 * rate), rate=rate)
        gone = np.abs(np.arange(len(joints)) / rate - 2.0) > known / 2
        joints[gone, JOINT["left_ankle"]] = np.nan
        check = WalkingPhases(stride=1.2)
        clip = clip_of(joints, rate)
        found = check.judge(clip).value[round(2 * rate), check.places(clip).index("rule4.left_leg")]
        assert np.isfinite(found) == said


# --- sides ----------------------------------------------------------------------------------------------


@given(which=st.lists(st.booleans(), min_size=6, max_size=6))
def test_pairs_change_places_one_by_one(which: list[bool]) -> None:
    joints = np.repeat(BODY[None], 2, axis=0)
    swapped = np.array([which, [False] * 6])
    found = put_right(joints, swapped)
    for k, (right, left) in enumerate(zip(RIGHT_JOINTS, LEFT_JOINTS, strict=True)):
        one, other = (left, right) if which[k] else (right, left)
        np.testing.assert_array_equal(found[0, [right, left]], BODY[[one, other]])
    np.testing.assert_array_equal(found[1], BODY)
    assert (put_right(joints, swapped) is joints) == (not any(which))


@pytest.mark.parametrize("pair", range(6))
def test_a_pair_that_is_exchanged_for_a_while_is_found(pair: int) -> None:
    joints = swinging(STRIDE, count=90)
    wrong = np.zeros((90, 6), dtype=bool)
    wrong[30:60, pair] = True
    broken = put_right(joints, wrong)
    feet, head = np.full((90, 4, 3), np.nan), np.full((90, 5, 3), np.nan)
    np.testing.assert_array_equal(exchanged_pairs(broken, feet, head), wrong)
    assert not exchanged_pairs(joints, feet, head).any()
    assert exchanged_pairs(joints[:0], feet[:0], head[:0]).shape == (0, 6)


def test_after_a_gap_nothing_says_that_a_pair_turned_over() -> None:
    across = np.ones((5, 6, 3))
    across[2] = np.nan
    assert known_before(across).tolist() == [True, False, False, True]
    across[2, 3] = 1.0
    assert known_before(across).all()


def test_evidence_is_one_at_most_and_none_of_what_is_not_known() -> None:
    assert _sure(np.array([-5.0, -0.5, np.nan, 0.25, 5.0])).tolist() == [-1.0, -0.5, 0.0, 0.25, 1.0]


# --- order ----------------------------------------------------------------------------------------------


@given(order=st.permutations(range(8)))
def test_frames_that_were_shuffled_are_put_back(order: list[int]) -> None:
    """On a straight way every frame is where its place says; few that are out of place are none."""
    count, first = 40, 16
    joints = BODY + (0.05 * np.arange(count))[:, None, None] * FORWARD
    rows = np.arange(count)
    rows[first : first + 8] = first + np.array(order)
    found = displaced(np.asarray(joints[rows]))
    assert found.shape == (count,)
    at = np.flatnonzero(found)
    # A frame that stands at k and belongs to r is r - k out of its place.
    np.testing.assert_array_equal(found[at], rows[at] - at)
    length = np.abs(np.diff(rows)).sum()
    turns = np.count_nonzero(np.diff(rows)[1:] * np.diff(rows)[:-1] < 0)
    out = np.count_nonzero(rows != np.arange(count))
    if turns >= 3 and out >= 4 and length > 1.2 * (count - 1) / 0.6:
        assert found.any()


def test_stretches_hold_frames_that_are_in_place_by_chance() -> None:
    places = np.zeros(40, dtype=np.intp)
    places[[5, 7, 12, 30]] = [1, -1, 1, -1]
    inside = np.zeros(40, dtype=bool)
    inside[5:13] = True
    inside[30] = True
    np.testing.assert_array_equal(stretches_of(places), inside)
    places[19] = 1  # seven frames after the last
    inside[19] = True
    np.testing.assert_array_equal(stretches_of(places), inside)
    places[18] = 1  # six
    inside[12:20] = True
    np.testing.assert_array_equal(stretches_of(places), inside)
    assert not stretches_of(np.zeros(5, dtype=np.intp)).any()


def test_stretches_have_two_turns_back_and_at_most_six_hundred_frames() -> None:
    def stretches(*at: int, count: int = 2000) -> list[tuple[int, int]]:
        turning = np.zeros(count, dtype=bool)
        turning[list(at)] = True
        return _stretches(turning)

    assert stretches() == [] and stretches(5) == []
    assert stretches(5, 6) == [(5, 6)] and stretches(5, 11) == [(5, 11)] and stretches(5, 12) == []
    assert stretches(5, 6, 20, 23, 26, 40) == [(5, 6), (20, 26)]
    assert stretches(*range(100, 1301, 5)) == [(100, 699), (700, 1299)]  # one turn back is left over
    assert stretches(*range(100, 1306, 5)) == [(100, 699), (700, 1299), (1300, 1305)]
