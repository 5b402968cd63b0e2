"""Leaves of one tree share limbs: what is found once for each set of them is what each leaf would give."""

import numpy as np
import pytest

from posekit import recover
from posekit.body import load_figure
from posekit.recovery.trees import Batch
from posekit.synthesis import random_views
from posekit.validators import judge
from posekit.views.builtin import view_of

RNG = 20


@pytest.fixture(scope="module")
def batch() -> Batch:
    recovery = recover(view_of(random_views(load_figure(), 12, np.random.default_rng(RNG))))
    grown = recovery.frames[0].batch
    assert grown is not None
    assert all(frame.batch is grown for frame in recovery.frames)
    return grown


def test_leaves_that_are_alike_have_the_points_in_the_same_places(batch: Batch) -> None:
    for check in batch.checks:
        rows, place = batch.leaves.alike(check.points)
        points = batch.points[:, list(check.points)]
        assert np.array_equal(points[rows[place]], points, equal_nan=True)
        assert np.array_equal(np.unique(place), np.arange(len(rows)))
    assert len(rows) < len(batch.points)


def test_margins_are_those_of_each_leaf(batch: Batch) -> None:
    alone = {found.check: found.worst for found in judge(batch.checks, batch.points)}
    assert list(batch.margins) == list(alone)
    for name, margin in batch.margins.items():
        np.testing.assert_allclose(margin, alone[name], rtol=0, atol=1e-12)


def test_configurations_are_those_of_each_leaf(batch: Batch) -> None:
    alone = batch.body.figure.configurations(batch.points)
    np.testing.assert_allclose(batch.q, alone.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(batch.fk_distance, alone.distance, rtol=0, atol=1e-12)
