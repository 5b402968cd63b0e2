"""Frames that come again, lengths that drift, and joints that tremble: what is measured of made-up motion."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from posekit.body import load_figure
from posekit.geometry import Array
from posekit.skeleton import JOINT, JOINTS, SEGMENTS
from posekit.validators.motion import MotionClip, trembling
from posekit.validators.motion.drift import Drift
from posekit.validators.motion.duplicates import duplicates
from posekit.validators.motion.trembling import _evidence, trembling_frames, trembling_of, usual_trembling

UP = np.array([0.0, 0.0, 1.0])
BODY = load_figure().neutral_points[: len(JOINTS)]


def clip_of(joints: Array, rate: float = 30.0, **known: object) -> MotionClip:
    time = np.arange(len(joints)) / rate
    return MotionClip(**{"joints": joints, "time": time, "rate": rate, "up": UP, **known})  # type: ignore[arg-type]


def along(way: ArrayLike) -> Array:
    """Return the body (T, 14, 3) moved by so much along an oblique direction."""
    return np.asarray(BODY + np.asarray(way, dtype=np.float64)[:, None, None] * [0.48, -0.6, 0.64])


# --- frames that come again -----------------------------------------------------------------------------


@given(first=st.integers(0, 15), run=st.integers(1, 4), step=st.sampled_from([0.0009, 0.0011, 0.01]))
def test_frames_that_come_again_are_counted_where_the_body_moves(first: int, run: int, step: float) -> None:
    at = np.minimum(np.arange(20), first) + np.maximum(np.arange(20) - first - run, 0)
    found = duplicates(along(step * at))
    expected = np.zeros(20, dtype=int)
    last = min(first + run, 19)
    if step > 0.001 and last - first < 19:
        expected[first + 1 : last + 1] = last - first
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(("metres", "same"), [(0.9e-6, True), (1.1e-6, False)])
def test_frames_are_the_same_to_a_millionth_of_a_metre(metres: float, same: bool) -> None:
    way = 0.01 * np.minimum(np.arange(20.0), 9) + 0.01 * np.maximum(np.arange(20) - 10, 0)
    way[10] += metres
    assert duplicates(along(way)).any() == same


@pytest.mark.parametrize(("still", "counted"), [(2, True), (3, False)])
@pytest.mark.parametrize("turned", [False, True])
def test_the_body_moves_within_three_frames_of_a_run(still: int, counted: bool, turned: bool) -> None:
    """A frame comes again, the body creeps for some frames, and then moves."""
    steps = np.full(30, 0.01)
    steps[12] = 0.0
    steps[13 : 13 + still] = 1e-5
    way = np.cumsum(steps)
    found = duplicates(along(way[::-1] if turned else way))
    assert found.any() == counted


def test_one_frame_repeats_nothing_and_unknown_joints_are_alike_where_both_are() -> None:
    assert duplicates(BODY[None]).tolist() == [0]
    joints = along(0.01 * np.array([0, 1, 2, 3, 3, 4, 5, 6.0]))
    joints[4, 3] = np.nan
    assert not duplicates(joints).any()
    joints[3, 3] = np.nan
    assert duplicates(joints).tolist() == [0, 0, 0, 0, 1, 0, 0, 0]
    joints[3:5] = np.nan
    assert not duplicates(joints).any()


# --- lengths, and what trembles -------------------------------------------------------------------------


@given(share=st.floats(-0.3, 0.3), frames=st.integers(3, 20))
def test_drift_is_the_share_by_which_a_length_is_off_its_median(share: float, frames: int) -> None:
    joints = along(np.arange(60) / 30.0)
    knee, ankle = JOINT["left_knee"], JOINT["left_ankle"]
    joints[20 : 20 + frames, ankle] += share * (BODY[ankle] - BODY[knee])
    found = Drift().judge(clip_of(joints))
    places = Drift().places(clip_of(joints))
    mine = places.index("left_knee-left_ankle")
    expected = np.zeros((60, len(places)))
    expected[20 : 20 + frames, mine] = share
    np.testing.assert_allclose(found.value, expected, atol=1e-9)


@pytest.mark.parametrize("frames", [1, 2])
def test_a_length_that_is_off_for_a_frame_or_two_does_not_drift(frames: int) -> None:
    joints = along(np.arange(40) / 30.0)
    joints[20 : 20 + frames, JOINT["left_ankle"]] += 0.05 * UP
    assert np.abs(Drift().judge(clip_of(joints)).value).max() < 1e-9


@pytest.mark.parametrize("turned", [False, True])
def test_at_its_ends_a_clip_has_the_lengths_of_its_last_frames(turned: bool) -> None:
    joints = along(np.arange(40) / 30.0)
    joints[:2, JOINT["left_ankle"]] += 0.1 * (BODY[JOINT["left_ankle"]] - BODY[JOINT["left_knee"]])
    clip = clip_of(joints[::-1] if turned else joints)
    found = Drift().judge(clip).value[:, Drift().places(clip).index("left_knee-left_ankle")]
    expected = np.where(np.arange(40) < 2, 0.1, 0.0)
    np.testing.assert_allclose(found, expected[::-1] if turned else expected, atol=1e-9)


@pytest.mark.parametrize(("noise", "times"), [(0.001, 4.0), (0.004, 4.0)])
def test_noise_of_measuring_may_move_a_length_by_four_deviations(noise: float, times: float) -> None:
    clip = clip_of(along(np.arange(60) / 30.0), noise=noise)
    found = Drift().judge(clip)
    lengths = [np.linalg.norm(BODY[b] - BODY[a]) for a, b in SEGMENTS if min(a, b) > 0 and max(a, b) > 5]
    np.testing.assert_allclose(
        np.sort(np.asarray(found.tolerance)[30]), np.sort(times * noise / np.array(lengths)), rtol=1e-9
    )


@pytest.mark.parametrize("deviation", [0.001, 0.004, 0.02])
def test_trembling_is_the_deviation_of_a_coordinate(deviation: float) -> None:
    rng = np.random.default_rng(5)
    joints = along(0.01 * np.arange(1500)) + rng.normal(0.0, deviation, (1500, 14, 3))
    found = trembling_of(joints)
    assert np.nanmean(found) == pytest.approx(deviation, rel=0.1)
    assert np.isnan(found[:3]).all() and np.isnan(found[-3:]).all() and np.isfinite(found[3:-3]).all()
    assert usual_trembling(joints) == pytest.approx(deviation, rel=0.02)


@pytest.mark.parametrize("turn", [1.6, 2.0, 2.6])
def test_of_what_turns_fast_the_curvature_is_taken_off(turn: float) -> None:
    """On a circle of radius r a sixth difference is (2 sin ω/2)⁶ r long, a second over three frames 2 - 2 cos 3ω."""
    way = 0.1 * np.stack([np.cos(turn * np.arange(60)), np.sin(turn * np.arange(60)), np.zeros(60)], axis=1)
    rough = 0.1 * (2 * np.sin(turn / 2)) ** 6 / np.sqrt(924) / 1.5382
    curved = 0.3 * 0.1 * (2 - 2 * np.cos(3 * turn)) / 9.0
    found = trembling_of(BODY + way[:, None])
    np.testing.assert_allclose(found[12:-14], max(rough - curved, 0.0), rtol=1e-6)
    assert rough > curved > 0


def test_what_is_smooth_does_not_tremble_and_few_frames_say_nothing() -> None:
    time = np.arange(60) / 30.0
    assert np.nanmax(trembling_of(along(time**5 - time))) < 1e-9
    assert usual_trembling(along(time**5 - time)) < 1e-9
    assert np.isnan(trembling_of(along(time[:6]))).all() and np.isfinite(trembling_of(along(time[:7]))).any()
    assert usual_trembling(along(time[:6])) == 0.0


def test_a_joint_trembles_alone_where_all_lengths_at_it_do() -> None:
    rng = np.random.default_rng(6)
    joints = along(np.zeros(300))
    joints[:, JOINT["left_knee"]] += rng.normal(0.0, 0.01, (300, 3))
    found = np.nanmean(trembling_of(joints), axis=0)
    assert found[JOINT["left_knee"]] == pytest.approx(0.01, rel=0.1)
    # The ankle's one length trembles by the knee's noise along it: eight tenths of that are said to be its own.
    assert found[JOINT["left_ankle"]] == pytest.approx(0.008, rel=0.1)
    assert found[JOINT["right_ankle"]] < 1e-9
    noisy = np.nanmean(trembling_of(joints, 0.001), axis=0)
    assert noisy[JOINT["left_ankle"]] == pytest.approx(found[JOINT["left_ankle"]] - 0.002, abs=1e-4)


@pytest.mark.parametrize(("numbers", "median"), [(3, 1.5382), (1, 0.6745)])
@pytest.mark.parametrize(("calm", "said"), [(0.2, 0.2), (0.01, 0.1), (0.9, 0.6)])
def test_evidence_is_a_ratio_of_likelihoods_of_normal_noise(
    numbers: int, median: float, calm: float, said: float
) -> None:
    """Outside there is a tenth of the trembling inside at least, and six tenths at most; six is all one frame says."""
    norm_ = pytest.importorskip("scipy.stats").norm
    rough = np.full((120, 1), calm * 0.02)
    rough[50:70] = 0.02
    rough[60] = 0.014
    found = _evidence(rough, 50, 69, numbers)
    inside, outside = 0.02 / median, said * 0.02 / median
    for frame in (20, 55, 60):
        parts = np.zeros(numbers)
        parts[0] = rough[frame, 0]
        ratio = (norm_.logpdf(parts, scale=inside) - norm_.logpdf(parts, scale=outside)).sum()
        assert found[frame] == pytest.approx(np.clip(ratio, -6.0, 6.0))
    still = _evidence(0.05 * rough, 50, 69, numbers)
    assert (still == 0).all()  # less than 2 mm is no trembling


def test_places_are_judged_as_three_numbers_and_lengths_as_one(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, int]] = []

    def evidence(rough: Array, first: int, last: int, numbers: int) -> Array:
        asked.append((rough.shape[1], numbers))
        return _evidence(rough, first, last, numbers)

    monkeypatch.setattr(trembling, "_evidence", evidence)
    joints = along(0.01 * np.arange(200))
    knee = JOINT["left_knee"]
    joints[80:120, knee] += np.random.default_rng(8).normal(0.0, 0.02, (40, 3))
    hot = np.zeros((200, 14), dtype=bool)
    hot[78:123, knee] = True
    found = trembling_frames(joints, hot)
    assert asked == [(1, 3), (len([1 for segment in SEGMENTS if knee in segment]), 1)]
    assert set(np.flatnonzero(found.any(axis=0)).tolist()) == {knee}
    at = np.flatnonzero(found[:, knee])
    assert abs(at[0] - 80) <= 1 and abs(at[-1] - 119) <= 1 and (np.diff(at) == 1).all()
