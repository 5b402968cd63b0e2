"""Key points that are no joint's: those that jump, and those that leave a frame without any posture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import posekit
from posekit.body import LengthUncertainty
from posekit.formats.own import View
from posekit.recovery import recover
from posekit.recovery.noise import Noise
from posekit.recovery.outliers import DOUBTED_JOINTS, jumps
from posekit.skeleton import JOINT
from posekit.synthesis import random_views
from posekit.views.builtin import view_of
from posekit.views.person_view import person_view
from tests.detector_files import view_keypoints

FIGURE = posekit.load_figure()
STILL = view_of(random_views(FIGURE, 1, np.random.default_rng(3)))


def film(count: int, rng: np.random.Generator, rate: float = 30.0) -> View:
    """Somebody who goes straight on and swings a little, as a detector has them."""
    still = STILL
    place = still.image + rng.uniform(-20, 20, 2) * np.arange(count)[:, None, None]
    swing = 5 * np.sin(0.5 * np.arange(count))[:, None, None] * rng.uniform(-1, 1, (14, 2))
    return replace(
        still,
        time=np.arange(count) / rate,
        image=place + swing,
        root=np.empty(0),
        head_image=np.empty(0),
        confidence=np.empty(0),
        truth=np.empty(0),
        derived=("neck", "pelvis"),
    )


@given(
    seed=st.integers(0, 2**32 - 1),
    joint=st.sampled_from(DOUBTED_JOINTS),
    at=st.integers(0, 11),
    far=st.floats(300, 3000),
)
def test_a_point_that_jumps_is_found_and_no_other(seed: int, joint: str, at: int, far: float) -> None:
    rng = np.random.default_rng(seed)
    view = film(12, rng)
    deviation = np.full((12, 14), 5.0)
    assert not jumps(view, deviation).any()
    image = view.image.copy()
    image[at, JOINT[joint]] += far * np.array([np.cos(seed), np.sin(seed)])
    found = jumps(replace(view, image=image), deviation)
    assert np.argwhere(found).tolist() == [[at, JOINT[joint]]]
    apart = replace(view, image=image, time=np.arange(12.0))
    assert not jumps(apart, deviation).any()


def test_a_frame_that_an_outlier_leaves_without_posture_keeps_those_of_the_rest() -> None:
    joint = "left_ankle"
    true = view_of(random_views(FIGURE, 2, np.random.default_rng(5)))
    view = person_view(view_keypoints(true, "coco", "coco_17"), true.camera, FIGURE)
    image = view.image.copy()
    image[1, JOINT[joint]] += 1500.0
    found = recover(replace(view, image=image))
    assert found.settings["outliers"] == {"1": [joint]}
    assert all(len(frame) for frame in found.frames)
    inferred = found.frames[1].inferred
    assert inferred is not None and joint in inferred[0]


@given(sure=st.floats(0.06, 1.0), less=st.floats(0.1, 0.9))
def test_a_detectors_points_are_off_the_less_the_surer_it_is(sure: float, less: float) -> None:
    view = replace(film(1, np.random.default_rng(1)), confidence=np.full((1, 19), sure))
    noise = Noise.of(view, None, LengthUncertainty(), asked=None)
    assert noise is not None
    depth, focal = np.full(1, 4.0), np.full(1, 1500.0)
    one = noise.of_points(view, np.arange(1), depth, focal)
    other = noise.of_points(replace(view, confidence=less * view.confidence), np.arange(1), depth, focal)
    assert (other >= one).all()
    assert (noise.of_points(replace(view, confidence=np.empty(0)), np.arange(1), depth, focal) > 0).all()
