"""Grouping: everyone near to their representative, representatives apart from each other."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.recovery.grouping import group_postures, representatives

RADIUS = 0.05


def postures(seed: int, count: int, joints: int = 14, missing: float = 0.0) -> np.ndarray:
    """Draw postures in a few clusters, some joints unknown in all of them."""
    rng = np.random.default_rng(seed)
    centres = rng.normal(size=(4, joints, 3)) * 0.06
    drawn = centres[rng.integers(0, 4, count)] + rng.normal(size=(count, joints, 3)) * 0.012
    drawn[:, rng.random(joints) < missing] = np.nan
    return drawn


def apart(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the distance between postures: the largest over the joints that both know."""
    return np.asarray(np.fmax.reduce(np.linalg.norm(a - b, axis=-1), axis=-1, initial=0.0))


@given(st.integers(0, 10**6), st.integers(0, 60), st.sampled_from([0.0, 0.3]), st.floats(0.0, 0.3))
def test_members_are_near_and_representatives_far(seed, count, missing, radius):
    joints = postures(seed, count, missing=missing)
    groups = group_postures(joints, radius)
    leaders = representatives(groups)
    assert groups.shape == (count,)
    assert sorted(set(groups.tolist())) == list(range(len(leaders)))
    assert (apart(joints, joints[leaders[groups]]) <= radius).all()
    between = apart(joints[leaders][:, None], joints[leaders][None])
    assert (between[~np.eye(len(leaders), dtype=bool)] > radius).all()


@given(st.integers(0, 10**6), st.integers(1, 40))
def test_groups_are_numbered_as_they_appear_and_led_by_their_first(seed, count):
    groups = group_postures(postures(seed, count), RADIUS)
    assert groups[0] == 0
    assert (groups <= np.maximum.accumulate(groups)).all()
    assert (np.diff(np.maximum.accumulate(groups)) <= 1).all()
    for group, leader in enumerate(representatives(groups)):
        assert leader == np.flatnonzero(groups == group)[0]


@given(st.integers(0, 10**6))
def test_a_member_joins_the_first_representative_that_is_near(seed):
    joints = postures(seed, 40)
    groups = group_postures(joints, RADIUS)
    leaders = representatives(groups)
    for k, group in enumerate(groups):
        near = apart(joints[k], joints[leaders]) <= RADIUS
        assert group == np.flatnonzero(near)[0]


def test_the_radius_itself_is_near():
    joints = np.zeros((3, 14, 3))
    joints[1, 5, 2] = 0.5
    joints[2, 5, 2] = np.nextafter(0.5, 1)
    assert group_postures(joints, 0.5).tolist() == [0, 0, 1]


def test_every_joint_counts_not_the_mean():
    joints = np.zeros((2, 14, 3))
    joints[1, 13] = [0.03, 0.04, 0.0]
    assert group_postures(joints, 0.049).tolist() == [0, 1]
    assert group_postures(joints, 0.051).tolist() == [0, 0]


def test_no_radius_groups_equal_postures_alone():
    joints = postures(1, 6)
    assert group_postures(joints[[0, 1, 0, 2, 1, 0]], 0.0).tolist() == [0, 1, 0, 2, 1, 0]


@pytest.mark.parametrize("count", [0, 1])
def test_none_and_one(count):
    groups = group_postures(np.zeros((count, 14, 3)), RADIUS)
    assert groups.tolist() == [0] * count
    assert representatives(groups).tolist() == [0] * count


def test_unknown_joints_are_not_compared():
    joints = np.zeros((3, 14, 3))
    joints[:, 9] = np.nan
    joints[2, 3] = 1.0
    assert group_postures(joints, RADIUS).tolist() == [0, 0, 1]
    assert group_postures(np.full((2, 14, 3), np.nan), RADIUS).tolist() == [0, 0]


def test_chains_do_not_drift():
    """Of postures 4 cm apart in a row, the third is 8 cm from the first and starts a group of its own."""
    joints = np.zeros((5, 14, 3))
    joints[:, 8, 0] = 0.04 * np.arange(5)
    assert group_postures(joints, RADIUS).tolist() == [0, 0, 1, 1, 2]
