"""Laws of checks of motion: what may not change a verdict, and what each of them alone names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from posekit.body import load_figure
from posekit.geometry import Array
from posekit.skeleton import JOINT, JOINTS, other_side
from posekit.validators.motion import MotionClip, judge_motion, load_profile
from posekit.validators.motion.sides import exchanged_pairs, put_right

UP = np.array([0.0, 0.0, 1.0])
OF_MOTION = (
    "timing", "frozen", "repeated", "swap", "teleport", "speed", "acceleration", "jerk", "jitter", "drift"
)  # fmt: skip
MIRRORED = [JOINTS.index(other_side(name)) for name in JOINTS]

Verdicts = dict[str, NDArray[np.bool_]]


def walking(count: int = 90, *, rate: float = 30.0) -> MotionClip:
    """Walk on: legs swing about the hips with knees bent forward, arms the other way, at 1.2 m/s."""
    time = np.arange(count) / rate
    joints = np.repeat(load_figure().neutral_points[None, :14], count, axis=0)
    hips = joints[0, JOINT["right_hip"]] - joints[0, JOINT["left_hip"]]
    forward = np.cross(UP, hips) / np.linalg.norm(np.cross(UP, hips))
    for side, sign in (("right", 1.0), ("left", -1.0)):
        swing = 0.5 * sign * np.sin(2 * np.pi * 0.9 * time)
        for start, middle, end, angle, bend in (
            ("hip", "knee", "ankle", swing, -0.5 - 0.4 * np.cos(2 * np.pi * 0.9 * time + sign)),
            ("shoulder", "elbow", "wrist", -swing, 0.6 + 0.0 * time),
        ):
            upper, lower = (
                np.linalg.norm(joints[0, JOINT[f"{side}_{b}"]] - joints[0, JOINT[f"{side}_{a}"]])
                for a, b in ((start, middle), (middle, end))
            )
            first = joints[:, JOINT[f"{side}_{start}"]]
            second = first + upper * turned(angle - 0.5 * bend, forward)
            joints[:, JOINT[f"{side}_{middle}"]] = second
            joints[:, JOINT[f"{side}_{end}"]] = second + lower * turned(angle + 0.5 * bend, forward)
    joints = joints + (1.2 * time)[:, None, None] * forward
    return MotionClip(joints=joints, time=time, rate=rate, up=UP)


def turned(angle: Array, forward: Array) -> Array:
    """Return directions (T, 3) that are so many radians from down to forward."""
    return np.asarray(np.sin(angle)[:, None] * forward - np.cos(angle)[:, None] * UP)


def verdicts(clip: MotionClip) -> Verdicts:
    """Return which frames and places each check of motion rejects."""
    asked = load_profile("posekit").only(OF_MOTION).checks
    return {one.check: one.violated for one in judge_motion(asked, clip).judgements}


def named(clip: MotionClip) -> dict[str, tuple[int, int]]:
    """Return first and last frame that each check rejects."""
    at = {name: np.flatnonzero(found.any(axis=1)) for name, found in verdicts(clip).items()}
    return {name: (int(rows[0]), int(rows[-1])) for name, rows in at.items() if len(rows)}


def with_joints(
    clip: MotionClip, rows: slice | int | NDArray[np.intp], change: Callable[[Array], Array]
) -> MotionClip:
    joints = clip.joints.copy()
    joints[rows] = change(joints[rows])
    return replace(clip, joints=joints)


def swapped(joints: Array) -> Array:
    return joints[:, MIRRORED]


def jumped(by: float) -> Callable[[Array], Array]:
    def change(joints: Array) -> Array:
        moved = joints.copy()
        moved[JOINT["left_wrist"]] += by * UP
        return moved

    return change


def longer(joints: Array) -> Array:
    changed = joints.copy()
    knee, ankle = JOINT["right_knee"], JOINT["right_ankle"]
    changed[:, ankle] = joints[:, knee] + 1.06 * (joints[:, ankle] - joints[:, knee])
    return changed


def trembling(joints: Array) -> Array:
    return joints + np.random.default_rng(0).normal(0, 0.01, joints.shape)


WALK = walking()
BROKEN = {
    "swap": with_joints(WALK, slice(30, 50), swapped),
    "teleport": with_joints(WALK, 40, jumped(0.15)),
    "drift": with_joints(WALK, slice(30, 50), longer),
    "jitter": with_joints(WALK, slice(30, 56), trembling),
    "frozen": with_joints(WALK, slice(30, 50), lambda joints: np.repeat(joints[:1], len(joints), axis=0)),
    "timing": replace(WALK, time=np.where(np.arange(90) < 40, WALK.time, WALK.time + 5 / 30)),
}
SPANS = {
    "swap": (30, 49),
    "teleport": (40, 40),
    "drift": (30, 49),
    "jitter": (30, 55),
    "frozen": (31, 49),
    "timing": (40, 40),
}


def test_walking_breaks_no_check() -> None:
    assert named(WALK) == {}


@pytest.mark.parametrize("name", BROKEN)
def test_a_defect_is_named_once_and_where_it_is(name: str) -> None:
    found = named(BROKEN[name])
    assert list(found) == [name]
    assert np.abs(np.array(found[name]) - SPANS[name]).max() <= 1


@pytest.mark.parametrize("frames", [1, 2, 3, 5])
@pytest.mark.parametrize("turned_back", [False, True])
def test_a_body_that_goes_half_a_metre_aside_jumps_while_it_goes(frames: int, turned_back: bool) -> None:
    way = 0.5 * np.clip((np.arange(90) - 39) / frames, 0.0, 1.0)
    joints = WALK.joints + way[:, None, None] * np.array([0.6, 0.0, 0.8])
    found = named(replace(WALK, joints=joints[::-1] if turned_back else joints))
    assert found == {"teleport": (51 - frames, 50) if turned_back else (40, 39 + frames)}


@pytest.mark.parametrize("frames", [1, 2, 3, 5, 8])
def test_a_body_that_is_aside_for_some_frames_jumps_there_and_back(frames: int) -> None:
    clip = with_joints(WALK, slice(40, 40 + frames), lambda joints: joints + np.array([0.3, 0.0, 0.4]))
    rejected = verdicts(clip)
    assert [name for name, found in rejected.items() if found.any()] == ["teleport"]
    ends = [40] if frames == 1 else [40, 40 + frames]
    assert np.flatnonzero(rejected["teleport"].any(axis=1)).tolist() == ends


def test_a_body_that_is_pushed_aside_in_a_third_of_a_second_is_none() -> None:
    way = 0.1 * (1.0 - np.cos(np.pi * np.clip((np.arange(90) - 40) / 10, 0.0, 1.0)))
    assert named(replace(WALK, joints=WALK.joints + way[:, None, None])) == {}


@pytest.mark.parametrize("name", BROKEN)
def test_where_and_how_a_body_is_turned_changes_nothing(name: str) -> None:
    clip, turn = BROKEN[name], np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    there = replace(clip, joints=clip.joints @ turn.T + np.array([3.0, -2.0, 1.0]))
    assert same(verdicts(clip), verdicts(there))


@pytest.mark.parametrize("name", sorted(set(BROKEN) - {"frozen", "timing"}))
def test_backward_in_time_the_same_frames_are_rejected(name: str) -> None:
    clip = BROKEN[name]
    back = verdicts(replace(clip, joints=clip.joints[::-1]))
    assert same(verdicts(clip), {check: found[::-1] for check, found in back.items()})


@pytest.mark.parametrize("name", BROKEN)
def test_a_mirror_image_is_rejected_on_the_other_side(name: str) -> None:
    clip = BROKEN[name]
    mirror = replace(clip, joints=(clip.joints * np.array([1.0, -1.0, 1.0]))[:, MIRRORED])
    assert {check: found.any(axis=1).tolist() for check, found in verdicts(mirror).items()} == {
        check: found.any(axis=1).tolist() for check, found in verdicts(clip).items()
    }


@pytest.mark.parametrize("rate", [8.0, 10.0, 12.0, 15.0, 20.0, 24.0, 25.0])
def test_few_frames_a_second_of_the_same_motion_raise_no_alarm(rate: float) -> None:
    assert named(walking(int(6 * rate), rate=rate)) == {}


@pytest.mark.parametrize("rate", [60.0, 120.0, 240.0])
def test_more_frames_a_second_of_the_same_motion_change_nothing(rate: float) -> None:
    assert named(walking(int(3 * rate), rate=rate)) == {}


def test_what_is_swapped_twice_is_as_it_was() -> None:
    exchanged = np.random.default_rng(0).random((len(WALK), 6)) < 0.5
    assert np.array_equal(put_right(put_right(WALK.joints, exchanged), exchanged), WALK.joints)


def test_a_swap_that_is_put_right_is_none() -> None:
    clip = BROKEN["swap"]
    exchanged = exchanged_pairs(clip.joints, clip.feet, clip.head)
    assert np.array_equal(put_right(clip.joints, exchanged), WALK.joints)


def test_a_clip_that_is_swapped_from_end_to_end_is_told_by_its_knees() -> None:
    found = verdicts(with_joints(WALK, slice(None), swapped))
    assert found.pop("swap").all()
    assert not any(violated.any() for violated in found.values())


def test_a_swap_of_a_hundred_frames_leaves_all_others_alone() -> None:
    clip = with_joints(walking(300), slice(100, 200), swapped)
    rejected = np.any([found.any(axis=1) for found in verdicts(clip).values()], axis=0)
    assert np.array_equal(np.flatnonzero(rejected), np.arange(100, 200))


def test_labels_that_flicker_are_exchanged_and_in_no_wrong_order() -> None:
    rows = np.flatnonzero(np.random.default_rng(0).random(len(WALK)) < 0.4)
    found = verdicts(with_joints(WALK, rows, swapped))
    assert np.array_equal(np.flatnonzero(found.pop("swap").all(axis=1)), rows)
    assert not any(violated.any() for violated in found.values())


def test_frames_that_come_twice_by_their_times_are_named() -> None:
    twice = np.sort(np.append(np.arange(90), [40, 41]))
    clip = replace(WALK, joints=WALK.joints[twice], time=WALK.time[twice], feet=np.empty(0), head=np.empty(0))
    assert np.array_equal(np.flatnonzero(verdicts(clip)["timing"].any(axis=1)), [41, 43])


def test_a_gap_is_no_jump() -> None:
    gone = replace(WALK, joints=np.delete(WALK.joints, slice(40, 50), 0), time=np.delete(WALK.time, slice(40, 50)),
                   feet=np.empty(0), head=np.empty(0))  # fmt: skip
    assert named(gone) == {"timing": (40, 40)}
    unknown = with_joints(WALK, slice(40, 50), lambda joints: joints * np.nan)
    assert named(unknown) == {}


def test_frames_in_a_wrong_order_are_named_with_times_and_without() -> None:
    order = np.arange(90)
    order[30:50] = 30 + np.random.default_rng(1).permutation(20)
    without = replace(WALK, joints=WALK.joints[order])
    assert list(named(without)) == ["timing"]
    assert list(named(replace(without, time=WALK.time[order]))) == ["timing"]


def test_noise_of_the_clip_is_no_violation() -> None:
    noisy = with_joints(
        WALK, slice(None), lambda joints: joints + np.random.default_rng(0).normal(0, 0.01, joints.shape)
    )
    assert named(replace(noisy, noise=0.01)) == {}


def same(first: Verdicts, second: Verdicts) -> bool:
    return first.keys() == second.keys() and all(np.array_equal(first[name], second[name]) for name in first)
