"""What the tests of formats share: somebody who walks past a camera."""

from __future__ import annotations

import numpy as np
import pytest

from posekit.cameras import PinholeCamera
from posekit.formats.own import OpenCVModel, View
from posekit.synthesis import Walker, walker_scene


@pytest.fixture(scope="session")
def walking() -> View:
    """Return somebody who walks past a camera that stands in a world with y up: 8 frames at 25 Hz."""
    K = np.array([[1400.0, 0, 960], [0, 1390.0, 540], [0, 0, 1]])
    scene = walker_scene(
        Walker(velocity=0.9),
        camera=(2.5, 0.3, 4.0),
        target=(0.4, -0.3, 0),
        frames=8,
        dt=1 / 25,
        carried=False,
    )
    camera = PinholeCamera(K=K)
    R, t = scene.R_cam_world[0], scene.t_cam_world[0]
    return View(
        camera=OpenCVModel(K=K, size=(1920, 1080), R=R, t=t),
        time=scene.time,
        image=camera.project(scene.joints_cam),
        head_image=camera.project(scene.head_cam),
        truth=scene.joints_cam,
    )
