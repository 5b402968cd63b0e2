"""Which way is up: as the camera's calibration says it, else as if the camera were level."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.errors import CameraError
from posekit.formats.own import LeeChenModel, OpenCVModel
from posekit.ranking import Up
from posekit.recovery import recover
from posekit.recovery.ranked import up_of
from posekit.synthesis import random_views
from posekit.views import view_of

K = np.array([[1000.0, 0, 960], [0, 1000, 540], [0, 0, 1]])
R = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""A level camera of a world whose z is up."""


@pytest.mark.parametrize(("axis", "wanted"), [("+z", [0, -1, 0]), ("-z", [0, 1, 0]), ("+y", [0, 0, 1])])
def test_up_is_that_of_the_calibration(axis: str, wanted: list[float]) -> None:
    up = up_of(OpenCVModel(K=K, R=R, t=np.zeros(3), up=axis))
    assert up.direction.tolist() == wanted
    assert up.deviation == 0
    assert axis in up.says


@pytest.mark.parametrize(
    "camera",
    [
        LeeChenModel(f=None),
        OpenCVModel(K=K),
        OpenCVModel(K=K, up="+z"),  # nobody says how the camera is turned
        OpenCVModel(K=K, R=R, t=np.zeros(3)),  # nobody says which axis is up
    ],
)
def test_up_is_never_guessed_of_half_a_calibration(camera: OpenCVModel | LeeChenModel) -> None:
    assert up_of(camera).says == Up.level().says


def test_an_axis_that_is_none_is_refused() -> None:
    with pytest.raises(CameraError, match=r'up must be one of \+x, .*; got "z"'):
        OpenCVModel(K=K, R=R, up="z")


def test_a_recovery_is_ranked_by_the_up_of_its_view() -> None:
    """A world whose up is the camera's is a camera held level, but surely; another up is another ranking."""
    view = view_of(random_views(load_figure(), 2, np.random.default_rng(0)))
    assert isinstance(view.camera, OpenCVModel)
    ranked = {}
    for axis in ("", "-y", "+x"):
        camera = replace(view.camera, R=np.eye(3), t=np.zeros(3), up=axis)
        recovery = recover(replace(view, camera=camera))
        assert recovery.settings["ranking"]["up"] == recovery.up.says == recovery.ranking.up
        ranked[axis] = recovery.ranking
    assert ranked[""].up == Up.level().says
    np.testing.assert_allclose(ranked["-y"].terms["posture"], ranked[""].terms["posture"], rtol=0, atol=1e-9)
    assert np.abs(ranked["-y"].terms["gravity"] - ranked["+x"].terms["gravity"]).max() > 0.1
