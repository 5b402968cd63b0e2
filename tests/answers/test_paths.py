"""Laws of the answer of a sequence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import posekit
from posekit.answers import path_answer
from posekit.cameras import PinholeCamera
from posekit.formats.own import OpenCVModel, View
from posekit.skeleton import JOINT
from posekit.synthesis import Walker, walker_scene


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


def test_what_a_frame_does_not_list_is_counted(following):
    unlisted = np.zeros(len(following.time))
    unlisted[1] = 0.3
    before = path_answer(following).frames
    after = path_answer(replace(following, unlisted=unlisted)).frames
    assert after[1].sure == pytest.approx(0.7 * before[1].sure)
    np.testing.assert_allclose(after[1].depth.near, 0.7 * before[1].depth.near)
    assert after[0].sure == before[0].sure


def test_paths_know_what_frames_do_not_list(rng):
    scene = walker_scene(Walker(velocity=0.9), camera=(2.5, 0.3, 4.0), frames=2, carried=False)
    camera = PinholeCamera(K=np.array([[1400.0, 0, 960], [0, 1390.0, 540], [0, 0, 1]]))
    image = camera.project(scene.joints_cam)
    view = View(
        camera=OpenCVModel(K=camera.K, size=(1920, 1080)),
        time=scene.time,
        image=image + rng.normal(size=image.shape) * 2,
        root=scene.joints_cam[:, 0],
        truth=scene.joints_cam,
        deviation=2.0,
    )
    recovery = posekit.recover(view)
    expected = [frame.unlisted_probability for frame in recovery.frames]
    assert max(expected) > 0
    found = posekit.follow(recovery).unlisted
    assert found is not None
    assert found.tolist() == expected
