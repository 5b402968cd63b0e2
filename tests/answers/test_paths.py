"""Laws of the answer of a sequence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import posekit
from posekit.answers import path_answer
from posekit.skeleton import JOINT


@pytest.fixture(scope="module")
def following():
    return posekit.follow(posekit.recover(posekit.builtin_view("seq1")), k=4)


def test_representatives_of_paths_are_distinct_and_hold_enough(following):
    found = path_answer(following)
    paths = following.joints[found.rows]
    apart = np.linalg.norm(paths[:, None] - paths[None], axis=-1).max(axis=(-2, -1))
    assert (apart[~np.eye(len(found), dtype=bool)] > 0.05).all()
    assert 0.95 <= found.probability.sum() <= 1.0 + 1e-9
    assert len(found.frames) == len(following.time)


def test_twin_paths_are_one(following):
    twin = replace(
        following,
        joints=np.concatenate([following.joints[:1], following.joints[:1] + 0.01]),
        deviation=np.concatenate([following.deviation[:1]] * 2),
        share=np.array([0.4, 0.6]),
    )
    found = path_answer(twin)
    assert found.rows.tolist() == [1]
    assert found.probability.tolist() == pytest.approx([1.0])
    assert {len(answer) for answer in found.frames} == {1}


def test_what_is_bridged_has_no_region(following):
    deviation = following.deviation.copy()
    wrist = JOINT["left_wrist"]
    deviation[:, 2, wrist] = np.inf
    answer = path_answer(replace(following, deviation=deviation)).frames[2]
    assert np.isnan(answer.regions.level).nonzero()[0].tolist() == [wrist]
