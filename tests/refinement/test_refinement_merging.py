"""Merging: survivors that became one, whatever their order."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.refinement import Merged, ObservedFrames, Refined, RootPrior, merge, refine
from posekit.refinement.merging import groups_of
from posekit.synthesis import random_views


def one_by_one(frame: np.ndarray, joints: np.ndarray, within: float) -> np.ndarray:
    leaders: dict[int, list[int]] = {}
    found = np.empty(len(frame), dtype=int)
    for k in range(len(frame)):
        mine = leaders.setdefault(int(frame[k]), [])
        near = [i for i in mine if np.linalg.norm(joints[k] - joints[i], axis=-1).max() <= within]
        found[k] = near[0] if near else k
        if not near:
            mine.append(k)
    return found


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(0, 60), st.floats(0, 0.3))
def test_groups_are_those_of_going_through_them_one_by_one(seed: int, n: int, within: float) -> None:
    rng = np.random.default_rng(seed)
    frame = np.sort(rng.integers(0, 4, n))
    joints = (
        rng.normal(size=(n, 14, 3)) * rng.choice([0.001, 0.02, 0.2]) + rng.integers(0, 2, (n, 1, 1)) * 0.05
    )
    np.testing.assert_array_equal(groups_of(frame, joints, within), one_by_one(frame, joints, within))


@cache
def survivors() -> Refined:
    """Five frames, 20 survivors each that fall together in twos and threes."""
    view = random_views(load_figure(), 5, np.random.default_rng(3))
    rng = np.random.default_rng(4)
    frame = np.repeat(np.arange(5), 20)
    start = view.joints_cam[frame] + rng.normal(size=(100, 14, 3)) * 0.08
    root = RootPrior(mean=view.joints_cam[:, 0], covariance=np.zeros((5, 3, 3)))
    image = view.with_noise(2.0, np.random.default_rng(5)).image
    sight = ObservedFrames(figure=load_figure(), camera=view.camera, image=image, deviation=2.0, root=root)
    return refine(sight, start, frame=frame, precision=1e-9, steps=60)


def test_survivors_that_became_one_are_merged_into_the_likeliest() -> None:
    refined = survivors()
    merged = merge(refined)
    assert 5 <= len(merged.rows) < 100
    for group, members in enumerate(merged.members()):
        leader = merged.rows[group]
        assert leader in members
        assert (refined.p[members] <= refined.p[leader]).all()
        assert (refined.frame[members] == refined.frame[leader]).all()
        assert (np.linalg.norm(refined.joints[members] - refined.joints[leader], axis=-1) <= 0.005).all()
    np.testing.assert_array_equal(np.sort(np.concatenate(merged.members())), np.arange(100))
    np.testing.assert_array_equal(merged.refined.joints, refined.joints[merged.rows])


@settings(deadline=None, derandomize=True, max_examples=20)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.005, 0.05, 0.5]))
def test_the_order_does_not_matter(seed: int, within: float) -> None:
    refined = survivors()
    order = np.random.default_rng(seed).permutation(len(refined))
    one, other = merge(refined, within=within), merge(refined.select(order), within=within)
    np.testing.assert_array_equal(other.refined.joints, one.refined.joints)
    np.testing.assert_array_equal(other.group, one.group[order])


def test_merging_again_changes_nothing_and_farther_merges_more() -> None:
    one = merge(survivors())
    again = merge(one.refined)
    np.testing.assert_array_equal(again.refined.joints, one.refined.joints)
    counts = [len(merge(survivors(), within=within).rows) for within in (0.0, 0.005, 0.05, 10.0)]
    assert counts == sorted(counts, reverse=True) and counts[-1] == 5


def test_codes_of_what_is_left_out_are_not_listed() -> None:
    refined = survivors()
    keep = refined.explained()
    keep[:3] = False
    merged = merge(refined, keep=keep)
    assert isinstance(merged, Merged)
    codes = merged.codes([f"{k:03d}" for k in range(100)])
    listed = sorted(code for group in codes for code in group)
    assert listed == [f"{k:03d}" for k in np.flatnonzero(keep)]
    assert (merged.group[~keep] == -1).all()
    none = merge(refined, keep=np.zeros(100, dtype=bool))
    assert len(none.rows) == 0 and none.members() == [] and none.codes([""] * 100) == []


@pytest.mark.parametrize("within", [-1.0, np.nan, np.inf])
def test_a_distance_that_is_none_is_refused(within: float) -> None:
    with pytest.raises(InputError, match="within"):
        merge(survivors(), within=within)


def test_codes_must_be_one_each() -> None:
    with pytest.raises(InputError, match="3 branch codes for 100"):
        merge(survivors()).codes(["a", "b", "c"])
