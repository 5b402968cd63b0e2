"""A few noisy pictures of one person, and a tracker of that person."""

import numpy as np
import pytest

import posekit
from posekit.formats.own import OpenCVModel, View
from posekit.synthesis import random_views

SETTINGS = posekit.RecoverSettings(ranges="urdf", length_deviation=0.0)
PIXELS = 1.0
PICTURES = 4


@pytest.fixture(scope="session")
def seen() -> View:
    """Return pictures of which the neck is known, with noise."""
    figure, rng = posekit.load_figure(), np.random.default_rng(3)
    scene = random_views(figure, PICTURES, rng).with_noise(PIXELS, rng)
    return View(
        camera=OpenCVModel(K=scene.camera.K, size=scene.size),
        time=np.arange(PICTURES) / 30,
        image=scene.image,
        root=scene.joints_cam[:, 0],
        lengths=figure.lengths,
        deviation=PIXELS,
    )


@pytest.fixture
def tracker(seen: View) -> posekit.Tracker:
    return posekit.Tracker(SETTINGS, camera=seen.camera, lengths=seen.lengths, deviation=PIXELS, lag=1)


@pytest.fixture(scope="session")
def alone(seen: View) -> list[posekit.Recovery]:
    """Return each picture recovered by itself."""
    return [posekit.recover(picture(seen, k), SETTINGS) for k in range(len(seen))]


def picture(view: View, k: int) -> View:
    """Return one picture of a view."""
    return view.take([k])
