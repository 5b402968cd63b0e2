"""What refinement finds late or in one go: covariances when they are read, leaves' postures, twins of trunks."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any
from unittest import mock

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.compiled.compiling import path
from posekit.formats.own import View
from posekit.recovery import recover, refiner
from posekit.recovery.recovery import Recovery
from posekit.recovery.refined import Covariances
from posekit.recovery.result import MAX_DETAILED, result_of
from posekit.refinement import covariance, refined
from posekit.skeleton import JOINT
from posekit.synthesis import random_views
from posekit.tree import Leaves
from posekit.views.builtin import view_of

FRAMES = 12


@pytest.fixture(scope="module")
def view() -> View:
    scene = random_views(load_figure(), FRAMES, np.random.default_rng(3))
    seen = view_of(scene.with_noise(2.0, np.random.default_rng(4)))
    image = seen.image.copy()
    image[0, 8] = np.nan
    return replace(seen, image=image, deviation=2.0, root=scene.joints_cam[:, 0])


class Recorded:
    """A run, with the leaves that came and went."""

    def __init__(self, view: View) -> None:
        self.grown: list[tuple[Leaves, Any, Leaves]] = []
        self.asked = 0
        without, find = refiner._without_twins, covariance.covariances

        def twins(leaves: Leaves, trunks: Any) -> Leaves:
            self.grown.append((leaves, trunks, without(leaves, trunks)))
            return self.grown[-1][2]

        def covariances(*arguments: Any) -> Any:
            self.asked += 1
            return find(*arguments)

        with mock.patch.object(refiner, "_without_twins", twins):
            with mock.patch.object(refined, "covariances", covariances):
                self.recovery: Recovery = recover(view, length_deviation=0.0)
                self.asked_by_frames = self.asked, sum(len(frame) for frame in self.recovery.frames)
                self.first = next(
                    frame.refined
                    for frame in self.recovery.frames
                    if frame.refined is not None and len(frame)
                )
                self.covariance = self.first.covariance
                self.result = result_of(self.recovery)


@pytest.fixture(scope="module")
def run(view: View) -> Recorded:
    return Recorded(view)


def test_covariances_are_not_found_before_they_are_read(view: View) -> None:
    seen = replace(view, image=np.where(np.isnan(view.image), view.image[1], view.image))
    assert Recorded(seen).asked_by_frames[0] == 0


def test_covariances_are_found_once(run: Recorded) -> None:
    assert run.asked_by_frames[0] == 1  # by the region of the joint that was not seen
    assert run.asked_by_frames[1] > 0
    assert run.asked == 1
    total = 0
    for frame, written in zip(run.recovery.frames, run.result.frames, strict=True):
        assert frame.refined is not None
        assert written.refined is not None
        own = frame.refined.covariance
        assert own.shape == (len(frame), 14, 3, 3)
        told = ~np.isnan(written.refined.covariance).all(axis=(1, 2, 3))
        np.testing.assert_array_equal(own[told], written.refined.covariance[told])
        assert min(len(frame), 1) <= told.sum() <= MAX_DETAILED
        unknown = np.asarray(np.isnan(frame.joints).any(axis=2))
        for row, regions in enumerate(frame.inferred or []):
            unknown[row, [JOINT[name] for name in regions]] = True
        np.testing.assert_array_equal(np.isnan(own).any(axis=(2, 3)), unknown)
        total += len(own)
    assert np.shares_memory(run.covariance, run.first.covariances.read())
    with pytest.raises(ValueError, match="read-only"):
        run.covariance[...] = 0.0
    assert total == len(run.first.covariances)


def test_covariances_are_those_of_the_survivors_themselves(run: Recorded) -> None:
    whole = run.first.covariances
    parts = [frame.refined for frame in run.recovery.frames if frame.refined is not None and len(frame)]
    joined = type(parts[0]).joined([part for part in parts if part.covariances is whole][:1] or parts[:1])
    assert len(joined.covariances) == len(whole)
    np.testing.assert_array_equal(joined.covariances.read(), whole.read())
    again = parts[0].part(slice(1, None)).part(slice(0, 2))
    np.testing.assert_array_equal(again.covariance, parts[0].covariance[1:3])
    assert parts[0].part(slice(0, 0)).covariance.shape == (0, 14, 3, 3)


def test_covariances_outlive_what_they_were_found_from(run: Recorded) -> None:
    copied = pickle.loads(pickle.dumps(run.first))
    np.testing.assert_array_equal(copied.covariance, run.first.covariance)
    both = Covariances.joined([run.first.covariances, copied.covariances])
    assert len(both) == 2 * len(copied.covariances) == len(both.read())


def test_leaves_are_placed_as_the_tree_places_them(run: Recorded) -> None:
    leaves, _, kept = run.grown[0]
    for some in (leaves, kept, leaves.at(5, leaves.frame[:3], leaves.code[:3] >> 8)):
        one_by_one = some.positions(range(some.level + 1), np.arange(len(some.code)))
        np.testing.assert_array_equal(some.postures()[:, : some.level + 1], one_by_one)
    nothing = leaves.at(leaves.level, leaves.frame[:0], leaves.code[:0])
    assert nothing.postures().shape == (0, 14, 3)


def test_twins_are_the_leaves_on_other_trunks(run: Recorded) -> None:
    """All candidates of the trunks, twins that the checks had already dropped among them."""
    leaves, trunks, kept = run.grown[0]
    own = trunks.carries(leaves.frame, leaves.postures())
    np.testing.assert_array_equal(kept.code, leaves.code[own])
    every = 1 << (len(leaves.joints) - 1)
    all_codes = np.arange(0, every, 16, dtype=leaves.code.dtype)
    frame = np.repeat(np.arange(leaves.n_frames, dtype=leaves.frame.dtype), len(all_codes))
    whole = leaves.at(leaves.level, frame, np.tile(all_codes, leaves.n_frames))
    left = refiner._without_twins(whole, trunks)
    carried = trunks.carries(whole.frame, whole.postures())
    assert 0 < carried.sum() < len(carried)
    np.testing.assert_array_equal(left.code, whole.code[carried])
    np.testing.assert_array_equal(left.frame, whole.frame[carried])


@pytest.mark.parametrize("ranges", ["urdf", "anatomical"])
def test_compiled_trees_change_no_bit_of_what_is_refined(view: View, ranges: str) -> None:
    """So results do not depend on what a process did before."""
    pytest.importorskip("numba")
    found = []
    for chosen in ("plain", "fast"):
        with path(chosen):
            found.append(recover(view, ranges=ranges))
    for plain, fast in zip(found[0].frames, found[1].frames, strict=True):
        assert plain.branches == fast.branches
        assert plain.rejected == fast.rejected
        assert plain.refined is not None
        assert fast.refined is not None
        np.testing.assert_array_equal(plain.joints, fast.joints)
        for name in ("dof", "chi2", "p", "merged", "covariance"):
            np.testing.assert_array_equal(getattr(plain.refined, name), getattr(fast.refined, name))
