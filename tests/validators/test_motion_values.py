"""What checks of motion measure, on motions whose measure can be written down."""

from __future__ import annotations

import itertools
from dataclasses import replace
from math import factorial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from posekit.body import load_figure
from posekit.geometry import Array
from posekit.ranking.centre_of_mass import centre_of_mass
from posekit.skeleton import JOINT, JOINTS
from posekit.validators.motion import MOTION_CHECKS, MotionClip, judge_motion
from posekit.validators.motion.base_of_support import beyond_support
from posekit.validators.motion.carried import carried, falls
from posekit.validators.motion.clip import once_a_clip
from posekit.validators.motion.displaced_body import displaced_by, middle
from posekit.validators.motion.jumps import jumps_of
from posekit.validators.motion.lifted import lifted_by, steps_of
from posekit.validators.motion.root_jerk import low_pass, parts
from posekit.validators.motion.speed import JointSpeed
from posekit.validators.motion.timeline import centred, filtered, norm, timeline_of

UP = np.array([0.0, 0.0, 1.0])
BODY = load_figure().neutral_points[: len(JOINTS)]


def clip_of(joints: Array, rate: float = 30.0, **known: object) -> MotionClip:
    time = np.arange(len(joints)) / rate
    return MotionClip(**{"joints": joints, "time": time, "rate": rate, "up": UP, **known})  # type: ignore[arg-type]


def along(way: ArrayLike) -> Array:
    """Return the body (T, 14, 3) moved by so much along an oblique direction."""
    return np.asarray(BODY + np.asarray(way, dtype=np.float64)[:, None, None] * [0.48, -0.6, 0.64])


# --- clips and their time -------------------------------------------------------------------------------


def test_a_clip_knows_step_and_height() -> None:
    clip = clip_of(np.repeat(BODY[None], 3, axis=0), rate=40.0, up=np.array([0.6, 0.0, 0.8]))
    assert clip.step == 0.025 and len(clip) == 3
    np.testing.assert_allclose(clip.height, 0.6 * clip.joints[..., 0] + 0.8 * clip.joints[..., 2])
    assert clip.head.shape == (3, 5, 3) and clip.feet.shape == (3, 4, 3)
    assert np.isnan(clip.head).all() and np.isnan(clip.feet).all() and clip.noise == 0.0
    for rate in (0.0, -1.0, np.inf, np.nan):
        assert np.isnan(replace(clip, rate=rate).step)
    assert np.isnan(replace(clip, up=None).height).all()


@pytest.mark.parametrize("shapes", [((3, 13, 3), (3,)), ((3, 14, 2), (3,)), ((3, 14, 3), (4,))])
def test_a_clip_refuses_shapes_that_do_not_fit(shapes: tuple[tuple[int, ...], tuple[int, ...]]) -> None:
    with pytest.raises(ValueError, match="do not fit"):
        MotionClip(joints=np.zeros(shapes[0]), time=np.zeros(shapes[1]), rate=30.0)


def test_what_is_found_in_a_clip_is_found_once() -> None:
    asked: list[MotionClip] = []

    @once_a_clip
    def find(clip: MotionClip) -> int:
        asked.append(clip)
        return len(asked)

    one, other = clip_of(np.repeat(BODY[None], 2, axis=0)), clip_of(np.repeat(BODY[None], 2, axis=0))
    assert [find(one), find(other), find(one), find(other)] == [1, 2, 1, 2]
    assert asked == [one, other]


@given(gaps=st.lists(st.integers(1, 40), min_size=1, max_size=8), order=st.randoms(use_true_random=False))
def test_frames_stand_in_the_slots_of_their_times(gaps: list[int], order: object) -> None:
    """A gap of more than sixteen slots is given sixteen; stamps may be a fifth of a step off."""
    slots = np.concatenate([[0], np.cumsum(gaps)])
    shuffled = list(range(len(slots)))
    order.shuffle(shuffled)  # type: ignore[attr-defined]
    off = np.where(np.arange(len(slots)) % 2, 0.2, 0.0)
    time = (100.0 + slots + off)[shuffled] / 30.0
    line = timeline_of(clip_of(np.repeat(BODY[None], len(slots), axis=0), time=time))
    expected = np.concatenate([[0], np.cumsum(np.minimum(gaps, 16))])
    np.testing.assert_array_equal(line.slots, expected[shuffled])
    assert line.count == expected[-1] + 1
    steps = np.diff(slots + off, prepend=slots[0] - 1.0)
    np.testing.assert_allclose(line.missing, (steps - 1.0)[shuffled], atol=1e-9)
    # A frame that came at place k and is r-th in time is r - k out of place.
    np.testing.assert_array_equal(line.place, np.array(shuffled) - np.arange(len(slots)))


@pytest.mark.parametrize(
    ("late", "slot"), [(0.0, -1), (0.2, -1), (0.26, 1), (0.49, 1), (0.6, 1), (1.4, 1), (1.6, 2)]
)
def test_a_stamp_that_is_hardly_later_has_no_slot_of_its_own(late: float, slot: int) -> None:
    time = np.array([0.0, late]) / 30.0
    line = timeline_of(clip_of(np.repeat(BODY[None], 2, axis=0), time=time))
    assert line.slots.tolist() == [0, slot]
    values = np.array([[5.0], [7.0]])
    back = line.of_frames(line.spread(values))
    assert back[0] == 5.0 and (np.isnan(back[1]) if slot < 0 else back[1] == 7.0)


def test_without_times_frames_follow_one_another() -> None:
    body = np.repeat(BODY[None], 3, axis=0)
    for clip in (
        clip_of(body, rate=np.nan, time=np.zeros(3)),
        clip_of(body, time=np.array([0.0, np.nan, 1.0])),
    ):
        line = timeline_of(clip)
        assert line.slots.tolist() == [0, 1, 2] and line.count == 3
        assert line.place.tolist() == [0, 0, 0] and np.isnan(line.missing).all()
    assert timeline_of(clip_of(body[:0])).count == 0


@given(count=st.sampled_from([1, 4, 5, 6, 256, 260, 261, 600]), length=st.integers(1, 5))
def test_filters_are_sums_over_neighbours(count: int, length: int) -> None:
    rng = np.random.default_rng(count)
    points, weights = rng.normal(size=(count, 2, 3)), rng.normal(size=length)
    weights[length // 2] = 0.0
    found = filtered(points, weights)
    assert found.shape == (max(count - length + 1, 0), 2, 3)
    if len(found):
        expected = np.apply_along_axis(lambda one: np.convolve(one, weights[::-1], mode="valid"), 0, points)
        np.testing.assert_allclose(found, expected, atol=1e-12)
    laid = centred(norm(found), count, length // 2)
    assert laid.shape == (count, 2)
    np.testing.assert_array_equal(
        laid[length // 2 :][: len(found)], np.linalg.norm(found, axis=-1)[: count - length // 2]
    )
    assert np.isnan(laid[: length // 2]).all()


# --- speeds ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [30.0, 60.0, 90.0, 120.0, 240.0])
@pytest.mark.parametrize(("name", "order"), [("speed", 1), ("acceleration", 2), ("jerk", 3)])
def test_a_derivative_of_a_power_of_time_is_a_number(name: str, order: int, rate: float) -> None:
    time = np.arange(40) / rate
    clip = clip_of(along(2.0 * time**order), rate)
    (found,) = judge_motion([MOTION_CHECKS[name]()], clip).judgements
    known = np.isfinite(found.value[:, 0])
    np.testing.assert_allclose(found.value[known], 2.0 * factorial(order), rtol=1e-6)
    # Differences are over a sixtieth of a second, or a frame where that is longer.
    stride = max(1, round(rate / 60.0))
    assert known.sum() == len(time) - order * stride
    first = int(np.flatnonzero(known)[0])
    assert first == (order * stride + 1) // 2 and known[first : first + known.sum()].all()


def test_a_speed_over_a_gap_of_one_joint_is_that_from_where_it_was_last_known() -> None:
    joints = along(3.0 * np.arange(20) / 30.0)
    joints[5:9, JOINT["left_wrist"]] = np.nan
    joints[0, JOINT["neck"]] = np.nan
    found = JointSpeed().judge(clip_of(joints)).value
    expected = np.full((20, 14), 3.0)
    expected[0] = expected[1, JOINT["neck"]] = expected[5:9, JOINT["left_wrist"]] = np.nan
    expected[0, JOINT["neck"]] = np.nan
    np.testing.assert_allclose(found, expected, atol=1e-9)


@given(count=st.integers(0, 3000), rate=st.sampled_from([24.0, 30.0, 60.0, 100.0]))
def test_parts_of_four_seconds_overlap_by_half_a_second_and_leave_nothing_out(
    count: int, rate: float
) -> None:
    found = list(parts(count, 1.0 / rate))
    assert bool(found) == (count >= rate)
    if found:
        assert found[0].start == 0 and found[-1].stop == count
    for one, other in itertools.pairwise(found):
        assert one.stop - one.start == 4 * rate and one.stop - other.start == round(0.5 * rate)
    if found:
        # The last takes along what is too short to be a part of its own.
        assert rate <= found[-1].stop - found[-1].start < 4 * rate + rate


def test_a_part_has_a_second_and_four_slots() -> None:
    assert [list(parts(count, 1.0)) for count in (3, 4)] == [[], [slice(0, 4)]]


@pytest.mark.parametrize("hertz", [0.5, 2.0, 3.0, 4.0, 6.0])
def test_a_butterworth_filter_halves_its_cutoff_forward_and_backward(hertz: float) -> None:
    """The gain of the analogue filter, at a rate so high that the digital one is no other: a half at the cutoff."""
    step = 1.0 / 1000.0
    time = np.arange(6000) * step
    way = np.stack([np.sin(2 * np.pi * hertz * time), 0.3 * time, 5.0 + 0.0 * time], axis=1)
    smooth = low_pass(way, step, 3.0)
    middle_ = slice(2500, 3500)
    gain = 1.0 / (1.0 + (hertz / 3.0) ** 8)
    np.testing.assert_allclose(smooth[middle_, 0], gain * way[middle_, 0], atol=2e-3)
    np.testing.assert_allclose(smooth[:, 1:], way[:, 1:], atol=1e-6)
    assert smooth.shape == way.shape


def test_a_filter_is_the_digital_butterworth_filter_run_both_ways() -> None:
    signal = pytest.importorskip("scipy.signal")
    way = np.cumsum(np.random.default_rng(3).normal(size=(240, 2)), axis=0)
    b, a = signal.butter(4, 3.0, fs=30.0)
    expected = signal.filtfilt(b, a, way, axis=0, padlen=60)
    np.testing.assert_allclose(low_pass(way, 1 / 30.0, 3.0)[60:-60], expected[60:-60], atol=0.05)


@pytest.mark.parametrize("count", [4, 30, 61, 119, 121, 240])
def test_a_filter_knows_no_direction_of_time(count: int) -> None:
    """It mirrors two seconds at both ends, or as many frames as there are beside the last one."""
    way = np.cumsum(np.random.default_rng(count).normal(size=(count, 2)), axis=0)
    forward, backward = low_pass(way, 1 / 30.0, 3.0), low_pass(way[::-1], 1 / 30.0, 3.0)[::-1]
    np.testing.assert_allclose(forward, backward, atol=1e-9)


# --- jumps and displacements ----------------------------------------------------------------------------


@given(metres=st.floats(0.05, 2.0), frame=st.integers(3, 26), joint=st.integers(0, 13))
def test_a_joint_that_is_aside_for_a_frame_jumps_by_so_much(metres: float, frame: int, joint: int) -> None:
    """On a cubic path the others have no misfit, and the jump is the whole of it."""
    time = np.arange(30) / 30.0
    joints = along(time**3 - time)
    joints[frame, joint] += metres * UP
    found = jumps_of(joints, 1 / 30.0)
    assert found.joint[frame, joint] == pytest.approx(metres, abs=1e-9)
    assert np.nan_to_num(found.joint[:, np.arange(14) != joint]).max() < 1e-9
    assert np.nan_to_num(found.body).max() < 1e-9


def test_a_jump_is_how_far_a_frame_is_from_a_cubic_less_three_times_what_its_neighbours_are() -> None:
    """By least squares: seven frames, four of a cubic and one of the jump, so that two are left to be off."""
    rng = np.random.default_rng(7)
    joints = along(np.sin(np.arange(30) / 5.0)) + rng.normal(0.0, 0.002, (30, 14, 3))
    joints[15] += [0.3, 0.0, 0.0]
    joints[15, JOINT["left_wrist"]] += [0.2, 0.0, 0.1]
    joints[9, JOINT["neck"]] += [0.0, 0.2, 0.0]
    found = jumps_of(joints, 1 / 30.0)
    times = np.arange(-3.0, 4.0)
    design = np.column_stack([np.vander(times, 4), times == 0])
    for frame in (9, 15):
        fit, *_ = np.linalg.lstsq(design, joints[frame - 3 : frame + 4].reshape(7, -1), rcond=None)
        left = (joints[frame - 3 : frame + 4].reshape(7, -1) - design @ fit).reshape(7, 14, 3)
        misfit = 3.0 * np.sqrt((left**2).sum(axis=(0, 2)) / 2.0)
        offset = fit[-1].reshape(14, 3)
        body = np.median(offset, axis=0)
        alone = np.linalg.norm(offset, axis=1) - misfit
        beside = np.linalg.norm(offset - body, axis=1) - misfit
        jumps = np.linalg.norm(body) > np.median(misfit)
        np.testing.assert_allclose(
            found.joint[frame], np.minimum(alone, beside) if jumps else alone, atol=1e-9
        )
        if frame == 15:
            assert found.body[frame] == pytest.approx(np.linalg.norm(body) - np.median(misfit), abs=1e-9)


@given(metres=st.floats(0.1, 2.0), frame=st.integers(8, 21))
def test_a_body_that_is_aside_for_a_frame_jumps_by_so_much(metres: float, frame: int) -> None:
    joints = along(np.arange(30) / 30.0)
    joints[frame] += metres * UP
    found = jumps_of(joints, 1 / 30.0)
    assert found.body[frame] == pytest.approx(metres, abs=1e-9)
    assert np.nanargmax(found.body) == frame


@pytest.mark.parametrize("end", [0, 29])
@pytest.mark.parametrize("metres", [0.1, 0.5])
def test_a_joint_that_is_aside_at_an_end_jumps_by_so_much(end: int, metres: float) -> None:
    joints = along((np.arange(30) / 30.0) ** 2)
    joints[end, JOINT["left_knee"]] += metres * UP
    found = jumps_of(joints, 1 / 30.0).joint[:, JOINT["left_knee"]]
    assert found[end] == pytest.approx(metres, abs=1e-9)
    assert np.nan_to_num(np.delete(found, end)).max() < 0.07


@given(metres=st.floats(0.5, 2.0), count=st.integers(1, 5))
def test_a_body_that_stays_aside_is_displaced_by_what_no_push_explains(metres: float, count: int) -> None:
    """Of a way D in a time T a push of 20 m/s² explains 5 T²; what is left is D less that, in the frames it goes in."""
    way = metres * np.clip((np.arange(90) - 40) / count, 0.0, 1.0)
    found = displaced_by(along(way), 1.0 / 30.0)
    assert np.flatnonzero(np.isfinite(found)).tolist() == list(range(41, 41 + count))
    np.testing.assert_allclose(found[41 : 41 + count], metres - 5.0 * (count / 30.0) ** 2, atol=1e-9)


@pytest.mark.parametrize("rate", [60.0, 120.0])
def test_at_more_frames_a_second_the_same_is_displaced(rate: float) -> None:
    for count in (1, round(rate / 30.0), round(rate / 6.0)):
        way = np.clip((np.arange(200) - 80) / count, 0.0, 1.0)
        found = displaced_by(along(way), 1.0 / rate)
        assert np.flatnonzero(np.isfinite(found)).tolist() == list(range(81, 81 + count))
        np.testing.assert_allclose(found[81 : 81 + count], 1.0 - 5.0 * (count / rate) ** 2, atol=1e-9)


@pytest.mark.parametrize("count", [6, 8, 10])
def test_what_takes_longer_than_a_sixth_of_a_second_is_never_displaced_as_a_whole(count: int) -> None:
    way = np.clip((np.arange(90) - 40) / count, 0.0, 1.0)
    found = displaced_by(along(way), 1.0 / 30.0)
    assert np.nanmax(found, initial=0.0) < 1.0 - 5.0 * (count / 30.0) ** 2 - 0.05


@pytest.mark.parametrize(("rate", "beside"), [(30.0, (-3, 3)), (60.0, (-6, 6))])
def test_a_lesser_displacement_beside_another_comes_of_it_and_one_farther_off_does_not(
    rate: float, beside: tuple[int, int]
) -> None:
    """Beside is what the velocities of a fifteenth of a second, and a thirtieth more, reach: both ways, to the slot."""
    slots, first, last = np.arange(200), *beside
    for off in (first - 1, first, last, last + 1):
        for lesser in (0.5, 0.8):
            way = 1.0 * (slots > 100) + lesser * (slots > 100 + off)
            found = displaced_by(along(way), 1.0 / rate)
            alone = np.flatnonzero(np.isfinite(found)).tolist() == sorted([101, 101 + off])
            assert alone is (lesser > 0.75 or not first <= off <= last), (off, lesser)
            assert found[101] == pytest.approx(1.0 - 5.0 / rate**2, abs=1e-9)


def test_without_a_rate_only_what_is_displaced_at_once_is_found() -> None:
    way = 0.3 * (np.arange(40) > 20)
    found = displaced_by(along(way), np.nan)
    assert np.flatnonzero(np.isfinite(found)).tolist() == [21]
    assert found[21] == pytest.approx(0.3, abs=1e-9)
    assert np.isnan(displaced_by(along(0.3 * np.clip((np.arange(40) - 20) / 5, 0, 1)), np.nan)[:20]).all()


@given(known=st.lists(st.booleans(), min_size=14, max_size=14))
def test_the_middle_is_the_median_of_what_is_known(known: list[bool]) -> None:
    values = np.random.default_rng(0).normal(size=(5, 14, 3))
    values[:, ~np.array(known)] = np.nan
    found = middle(values)
    if any(known):
        np.testing.assert_allclose(found, np.nanmedian(values, axis=1), atol=1e-12)
    else:
        assert np.isnan(found).all()
    assert found.shape == (5, 3)


# --- what falls, what is lifted, what bears -------------------------------------------------------------


@pytest.mark.parametrize(
    ("share", "says"), [(0.49, False), (0.51, True), (1.0, True), (0.0, False), (-1.0, False)]
)
@pytest.mark.parametrize("count", [6, 20])
def test_what_falls_by_half_of_gravity_falls(share: float, says: bool, count: int) -> None:
    time = np.arange(count) / 30.0
    way = 1.0 + 2.0 * time - share * 9.81 * time**2 / 2
    assert falls(way, 1 / 30.0) is says
    assert falls(way, 1 / 30.0, share=share - 0.01) is True
    assert falls(way, 1 / 30.0, share=share + 0.01) is False
    way[1] = np.nan
    assert falls(way, 1 / 30.0) is (says or count == 6)


def test_five_frames_are_too_few_to_see_a_fall() -> None:
    assert falls(np.zeros(5), 1 / 30.0) is True and falls(np.zeros(6), 1 / 30.0) is False


@pytest.mark.parametrize(("rise", "frames", "fall", "kept"), [
    (0.04, 12, False, True),  # the same ground
    (0.06, 12, False, False),  # another level, and nothing led there
    (0.06, 12, True, True),  # a jump led there
    (0.06, 7, True, False),  # less than a quarter of a second is no jump
    (0.06, 8, True, True),
])  # fmt: skip
def test_a_rest_at_another_level_carries_where_a_jump_led_to_it(
    rise: float, frames: int, fall: bool, kept: bool
) -> None:
    rests = 30, 20
    count = rests[0] + frames + rests[1]
    resting = np.ones(count, dtype=bool)
    resting[rests[0] : rests[0] + frames] = False
    lowest = np.where(np.arange(count) < rests[0] + frames // 2, 0.0, rise)
    time = (np.arange(count) - rests[0]) / 30.0
    centre = 1.0 + (4.905 * time * (frames / 30.0 - time) if fall else 0.0 * time)
    found = carried(resting, lowest, centre, 1 / 30.0)
    expected = resting.copy()
    if not kept:
        expected[rests[0] + frames :] = False
    np.testing.assert_array_equal(found, expected)


def test_of_levels_the_one_that_is_rested_on_for_longest_carries() -> None:
    resting = np.ones(60, dtype=bool)
    resting[[10, 45]] = False
    lowest = np.zeros(60)
    lowest[11:45] = 0.3
    found = carried(resting, lowest, np.ones(60), 1 / 30.0)
    assert found[11:45].all() and found.sum() == 34  # beside 10 and 14 frames
    lowest[:11] = lowest[45:] = 0.2
    lowest[11:45] = np.where(np.arange(34) < 17, 0.2, 0.5)
    resting[28] = False
    found = carried(resting, lowest, np.ones(60), 1 / 30.0)
    assert found.sum() == resting.sum() - 16 and not found[29:45].any()
    assert (carried(resting, lowest, np.ones(60), np.nan) == resting).all()


@pytest.mark.parametrize(("up", "down", "frames", "rests", "found"), [
    (0.011, 0.011, 10, True, False),
    (0.013, 0.013, 10, True, True),
    (-0.013, -0.013, 10, True, True),
    (0.1, 0.1, 3, True, True),
    (0.1, 0.1, 2, True, False),
    (0.1, 0.066, 10, True, True),  # the step back may be another by 35 % of the larger one
    (0.1, 0.064, 10, True, False),
    (0.064, 0.1, 10, True, False),
    (0.14, 0.14, 10, False, False),  # with no foot at rest a step is sure from 15 cm on
    (0.16, 0.16, 10, False, True),
])  # fmt: skip
def test_a_stretch_is_lifted_by_the_mean_of_its_two_steps(
    up: float, down: float, frames: int, rests: bool, found: bool
) -> None:
    way = 0.0 if rests else 0.011
    height = way * np.repeat(np.arange(60.0)[:, None], 8, axis=1)
    height[20:] += up
    height[20 + frames :] -= down
    lifted = lifted_by(height, slice(6, 8), 30.0)
    expected = np.zeros(60)
    if found:
        expected[20 : 20 + frames] = (up + down) / 2
    np.testing.assert_allclose(lifted, expected, atol=1e-9)


@pytest.mark.parametrize(("way", "noise", "found"), [
    (0.009, 0.0, True),
    (0.011, 0.0, False),
    (0.011, 0.001, True),
    (0.0129, 0.001, True),
    (0.0131, 0.001, False),
])  # fmt: skip
def test_a_foot_rests_that_goes_up_by_less_than_a_centimetre(way: float, noise: float, found: bool) -> None:
    height = way * np.repeat(np.arange(60.0)[:, None], 8, axis=1)
    height[20:40] += 0.1
    assert lifted_by(height, slice(6, 8), 30.0, noise).any() == found


@pytest.mark.parametrize(("metres", "noise", "found"), [(0.019, 0.005, False), (0.021, 0.005, True)])
def test_a_step_of_a_noisy_clip_is_more_than_four_deviations(
    metres: float, noise: float, found: bool
) -> None:
    height = np.zeros((60, 8))
    height[20:40] += metres
    assert lifted_by(height, slice(6, 8), 30.0, noise).any() == found


@pytest.mark.parametrize(("rate", "least"), [(30.0, 0.15), (16.0, 0.15), (8.0, 0.6)])
def test_at_few_frames_a_second_a_sure_step_is_larger(rate: float, least: float) -> None:
    for metres, found in ((0.98 * least, False), (1.02 * least, True)):
        height = 0.02 * np.repeat(np.arange(60.0)[:, None], 8, axis=1)
        height[20:40] += metres
        assert lifted_by(height, slice(6, 8), rate).any() == found


@pytest.mark.parametrize(("agree", "found"), [(11, True), (10, True), (9, False)])
def test_nine_tenths_of_the_points_step_the_same_way(agree: int, found: bool) -> None:
    for way in (0.1, -0.1):
        height = np.zeros((20, 11))
        height[10:, :agree] += way
        height[10:, agree:] -= way
        steps = steps_of(height)
        assert steps[10] == pytest.approx(way if found else 0.0)
        assert not np.delete(steps, 10).any()


def test_a_step_needs_six_points() -> None:
    for known in (5, 6):
        height = np.full((20, 8), np.nan)
        height[:, :known] = 0.0
        height[10:, :known] += 0.1
        assert steps_of(height)[10] == pytest.approx(0.1 if known == 6 else 0.0)


@given(
    corners=st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), min_size=3, max_size=6),
    at=st.tuples(st.floats(-2, 2), st.floats(-2, 2)),
    axis=st.integers(0, 2),
)
def test_beyond_support_is_the_distance_from_a_hull(
    corners: list[tuple[float, float]], at: tuple[float, float], axis: int
) -> None:
    """By thousands of directions, along the ground of whichever axis is up."""
    up = np.eye(3)[axis]
    ground = [k for k in range(3) if k != axis]
    bearing = np.zeros((1, len(corners), 3))
    bearing[0][:, ground] = corners
    bearing[0, :, axis] = np.linspace(0.0, 9.0, len(corners))
    point = np.zeros((1, 3))
    point[0, ground] = at
    angles = np.linspace(0.0, 2 * np.pi, 6000, endpoint=False)
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    expected = (ways @ np.array(at) - (ways @ np.array(corners).T).max(axis=1)).max()
    assert beyond_support(point, bearing, up)[0] == pytest.approx(expected, abs=2e-3)


def test_the_centre_of_mass_of_a_body_that_is_turned_goes_with_it() -> None:
    turned = BODY[:, [1, 2, 0]]
    one, other = centre_of_mass(BODY[..., None])[:, 0], centre_of_mass(turned[..., None])[:, 0]
    np.testing.assert_allclose(one[[1, 2, 0]], other, atol=1e-12)
