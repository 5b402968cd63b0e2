"""What is found of single frames: their order, repeats and jumps, by laws that hold whatever the motion is."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from posekit.geometry import Array
from posekit.skeleton import FEET_POINTS, JOINTS, SIDES
from posekit.validators.motion import MotionClip
from posekit.validators.motion.balance_still import BalanceStill
from posekit.validators.motion.displaced_body import displaced_by
from posekit.validators.motion.duplicates import MOVED_METRES, SAME_METRES, duplicates
from posekit.validators.motion.explained import explained
from posekit.validators.motion.ground import ground_of
from posekit.validators.motion.jumps import jumps_of
from posekit.validators.motion.lifted import steps_of
from posekit.validators.motion.order import _length, _shortest, _with_moves, _without_sides
from posekit.validators.motion.sides import LEFT_JOINTS, RIGHT_JOINTS, _continuity, _evidence
from posekit.validators.motion.sliding import FOOT_POINTS
from posekit.validators.motion.speed import _over_gaps
from tests.validators.test_ground_laws import moved, standing
from tests.validators.test_motion_laws import WALK, jumped, named, swapped, with_joints


def test_backward_in_time_every_jump_is_as_large(rng: np.random.Generator) -> None:
    for count in (7, 8, 9, 12, 40):
        joints = rng.normal(0, 1e-3, (count, 14, 3)).cumsum(axis=0)
        joints[rng.integers(count, size=3), rng.integers(14, size=3)] += 0.2
        there, back = jumps_of(joints, 1 / 30), jumps_of(joints[::-1], 1 / 30)
        np.testing.assert_allclose(back.joint[::-1], there.joint, atol=1e-12)
        np.testing.assert_allclose(back.body[::-1], there.body, atol=1e-12)
        np.testing.assert_allclose(
            displaced_by(joints[::-1], 1 / 30)[::-1], displaced_by(joints, 1 / 30), atol=1e-12
        )


def test_what_joints_say_whichever_is_the_right_one_tells_how_far_apart_they_are(
    rng: np.random.Generator,
) -> None:
    """Neck and pelvis, six middles; then squares of halves of what is between, over their length: half that way."""
    joints = rng.normal(size=(8, len(JOINTS), 3))
    found = _without_sides(joints)
    np.testing.assert_allclose(found, _without_sides(swapped(joints)), atol=1e-12)
    right, left = joints[:, RIGHT_JOINTS], joints[:, LEFT_JOINTS]
    np.testing.assert_array_equal(found[:, 2:8], (right + left) / 2.0)
    np.testing.assert_allclose(found[:, 8:14].sum(axis=-1), np.linalg.norm(right - left, axis=-1) / 2.0)
    assert found.shape == (8, 20, 3)


def test_no_move_of_one_frame_makes_an_order_shorter(rng: np.random.Generator) -> None:
    for count in (6, 9, 14):
        points = rng.normal(size=(count, 4))
        ways = np.linalg.norm(points[:, None] - points, axis=-1)
        found = _with_moves(np.arange(count), ways)
        assert sorted(found) == list(range(count)) and (found[0], found[-1]) == (0, count - 1)
        for at, to in itertools.permutations(range(1, count - 1), 2):
            other = np.insert(np.delete(found, at), to, found[at])
            assert _length(other, ways) > _length(found, ways) - 1e-9


def test_frames_on_a_line_are_put_into_its_order(rng: np.random.Generator) -> None:
    for count in (6, 10, 30):
        line = np.arange(count) + rng.uniform(-0.3, 0.3, count)
        given = np.array([0, *(1 + rng.permutation(count - 2)), count - 1])
        assert given[_shortest(line[given][:, None])].tolist() == list(range(count))


@pytest.mark.parametrize("frames", [1, 2])
def test_a_frame_that_comes_again_is_named_beside_what_else_is_wrong(frames: int) -> None:
    running = replace(WALK, joints=WALK.joints + np.arange(90)[:, None, None] * np.array([0.15, 0.0, 0.0]))
    again = with_joints(
        running, slice(30, 31 + frames), lambda joints: np.repeat(joints[:1], len(joints), axis=0)
    )
    repeated = {"repeated": (31, 30 + frames)}
    assert named(again) == repeated
    assert named(with_joints(again, 60, jumped(0.15))) == {**repeated, "teleport": (60, 60)}


@pytest.mark.parametrize("count", [1, 2, 3])
def test_right_and_left_are_exchanged_from_two_postures_on(count: int) -> None:
    right = WALK.joints[40 : 40 + count]
    clip = MotionClip(joints=swapped(right), time=WALK.time[:count], rate=30.0, up=WALK.up)
    found = explained(clip)
    assert found.exchanged.all() == found.exchanged.any() == (count > 1)
    assert np.array_equal(found.joints, right if count > 1 else swapped(right))


def test_points_of_a_foot_are_of_one_side() -> None:
    names = [*FEET_POINTS, "right_ankle", "left_ankle"]
    parts = ("toe", "heel", "ankle")
    assert [[names[k] for k in foot] for foot in FOOT_POINTS] == [
        [f"{side}_{part}" for part in parts] for side in SIDES
    ]


def test_a_body_rests_while_it_is_lifted_as_a_whole() -> None:
    clip = standing(90)
    up = np.array([0.0, 0.0, 1.0])
    lifted = moved(clip, np.where((np.arange(90) >= 30) & (np.arange(90) < 45), 0.1, 0.0)[:, None] * up)
    ground = ground_of(lifted)
    assert ground.lifted[30:45] == pytest.approx(0.1, abs=1e-3)
    assert ground.resting.tolist() == ground_of(clip).resting.tolist()


def test_what_a_body_does_as_a_whole_says_nothing_of_its_sides(rng: np.random.Generator) -> None:
    joints = WALK.joints[:20].copy()
    joints[10:] = swapped(joints[10:])
    across = rng.normal(size=(20, 6, 3))
    along = rng.normal(0, 0.2, (20, 1, 3)).cumsum(axis=0)
    still = joints - joints[:, :4].mean(axis=1, keepdims=True)
    expected = _continuity(still, across)
    np.testing.assert_allclose(_continuity(still + along, across), expected, atol=1e-9)
    turned_over = np.abs(expected).max(axis=1) > 0.1
    assert turned_over[9] and (expected[9] > 0).any()


def along_x(*places: float) -> Array:
    joints = np.zeros((len(places), 14, 3))
    joints[:, 3, 0] = places
    return joints


def test_bounds_of_a_repeated_frame_are_outside_of_it() -> None:
    """A way of just so much is no repetition, and no motion beside one."""
    for way, moved_metres, again in (
        (SAME_METRES, 0.01, False),
        (np.nextafter(SAME_METRES, 0), 0.01, True),
        (0.0, MOVED_METRES, False),
        (0.0, np.nextafter(MOVED_METRES, 1), True),
    ):
        found = duplicates(along_x(-moved_metres, 0.0, way, moved_metres + way))
        assert found.tolist() == ([0, 0, 1, 0] if again else [0] * 4)


def test_points_that_stay_do_not_step_with_the_others() -> None:
    for still in range(4):
        height = np.zeros((12, 11))
        height[6:, still:] = 0.1
        assert steps_of(height).max() == pytest.approx(0.1 if still < 2 else 0.0)
        assert steps_of(-height).min() == pytest.approx(-0.1 if still < 2 else 0.0)


def test_a_way_over_a_gap_is_divided_by_its_slots() -> None:
    for known in itertools.product((False, True), repeat=6):
        places = np.arange(6.0) ** 2
        joints = np.where(np.array(known)[:, None, None], along_x(*places), np.nan)
        expected = np.full((6, 14), np.nan)
        for start, end in itertools.pairwise(np.flatnonzero(known)):
            if end > start + 1:
                expected[end] = 0.0
                expected[end, 3] = (places[end] - places[start]) / (end - start)
        np.testing.assert_allclose(_over_gaps(joints), expected)


@pytest.mark.parametrize("step", [np.nan, 1.0 / 30.0])
@pytest.mark.parametrize("frame", range(3, 12))
def test_a_jump_is_found_in_its_frame_wherever_two_frames_are_beside_it(step: float, frame: int) -> None:
    joints = np.zeros((14, len(JOINTS), 3)) + np.arange(14)[:, None, None] / 64.0
    joints[frame:, :, 0] += 0.5
    found = displaced_by(joints, step)
    assert np.flatnonzero(found > 0).tolist() == [frame]
    assert found[frame] == pytest.approx(0.5, abs=0.01)


def test_who_stands_still_for_exactly_so_long_stands() -> None:
    """In times that are exact: still, then away at eight metres a second."""
    clip = standing(64, rate=32.0)
    joints = np.repeat(clip.joints[:1], 64, axis=0)
    joints[40:] += 0.25 * np.arange(24)[:, None, None] * np.eye(3)[0]
    clip = replace(clip, joints=joints)
    standing_ = [n for n in range(30, 50) if BalanceStill(lasting=n / 32.0)._stands(clip).any()]
    assert standing_ and not BalanceStill(lasting=np.nextafter(standing_[-1] / 32.0, 2.0))._stands(clip).any()


def test_what_a_frame_says_of_its_sides_it_says_alone(rng: np.random.Generator) -> None:
    """Of hips and shoulders; toes before or behind ankles and a nose before or behind ears say it, too."""
    joints = WALK.joints[::9]
    across = joints[:, RIGHT_JOINTS] - joints[:, LEFT_JOINTS]
    ankles = joints[:, [JOINTS.index(f"{side}_ankle") for side in SIDES]]
    feet = ankles + 0.1 * rng.normal(size=ankles.shape)
    feet[1, 0], feet[2] = np.nan, np.nan
    head = joints[:, :1] + 0.1 * rng.normal(size=(len(joints), 5, 3))
    _, hips, shoulders = _evidence(joints, across, feet, head, 0.0)
    for frame in range(len(joints)):
        own = slice(frame, frame + 1)
        _, hips_alone, shoulders_alone = _evidence(joints[own], across[own], feet[own], head[own], 0.0)
        np.testing.assert_allclose(hips[own], hips_alone)
        np.testing.assert_allclose(shoulders[own], shoulders_alone)
    unseen = np.full_like(feet, np.nan)
    assert not np.allclose(hips, _evidence(joints, across, unseen, head, 0.0)[1])
    turned = [np.r_[RIGHT_JOINTS, LEFT_JOINTS], np.r_[LEFT_JOINTS, RIGHT_JOINTS]]
    other = joints.copy()
    other[:, turned[0]] = joints[:, turned[1]]
    mirrored = _evidence(other, -across, feet[:, ::-1], head, 0.0)
    np.testing.assert_allclose(mirrored[1], -hips, atol=1e-12)
