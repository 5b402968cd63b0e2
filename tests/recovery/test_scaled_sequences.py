"""A person whose lengths are known up to a common factor: the factor that a sequence tells."""

import dataclasses
import math
from functools import partial

import numpy as np
import pytest

import posekit
from posekit.errors import InputError, PosekitError
from posekit.following import Paths, ScaleChoice
from posekit.formats.own import OpenCVModel, View
from posekit.recovery.scaled_sequences import BEST_PATH_DEVIATION, follow_scaled
from posekit.settings import EXACT_TOLERANCE
from posekit.synthesis import CameraPlacements, Walker
from posekit.synthesis.camera_sphere import CameraSphere
from posekit.synthesis.observe import observe
from posekit.synthesis.viewpoints import look_at
from posekit.views.builtin import forget_camera


@pytest.fixture(scope="module")
def view():
    """A walker who passes a standing camera, seen with 1 px of noise."""
    walker, sphere = Walker(), CameraSphere()
    time = np.arange(4) / 10
    q = walker.configurations(walker.phase(time, 0.1))
    q[:, :3] += walker.travel(time, 0.1)
    points = walker.figure.forward_kinematics(q)
    middle = points.reshape(-1, 3).mean(axis=0)
    position = middle + np.array([2.0, 0.2, -3.5])
    R = np.broadcast_to(look_at(position, middle, np.array([0.0, 1.0, 0.0])), (4, 3, 3))
    scene = observe(
        walker.figure,
        sphere.camera,
        points,
        CameraPlacements(R, np.broadcast_to(position, (4, 3))),
        time=time,
    )
    seen = scene.with_noise(1.0, np.random.default_rng(0))
    return View(
        camera=OpenCVModel(K=scene.camera.K),
        time=time,
        image=seen.image,
        root=scene.joints_cam[:, 0],
        truth=scene.joints_cam,
        lengths=dict(scene.figure.lengths),
        deviation=1.0,
    )


def off_by(view, factor):
    return dataclasses.replace(view, lengths={name: at * factor for name, at in view.lengths.items()})


def test_the_scale_of_lengths_that_are_off_is_told(view):
    told, factor = [], 1.05
    found = follow_scaled(off_by(view, factor), progress=lambda *count: told.append(count))
    assert found.scale * factor == pytest.approx(1.0, abs=0.02)
    assert BEST_PATH_DEVIATION <= found.deviation < 0.02
    assert not found.at_the_end
    neck = "neck-pelvis"
    assert found.recovery.figure.lengths[neck] == pytest.approx(
        view.lengths[neck] * factor * found.scale, rel=1e-6
    )
    wrong = posekit.recovery.sequences.follow(posekit.recover(off_by(view, factor), refine=True), k=1)
    error, without = (
        np.linalg.norm(one.joints[0] - view.truth, axis=-1).mean() for one in (found.following, wrong)
    )
    assert error < without
    assert error < 0.014
    assert [done for done, _ in told] == list(range(1, len(told) + 1))
    assert len(found.choice.scales) <= len(told) <= told[-1][1]


def test_where_all_scales_are_as_good_the_lengths_are_left(view):
    recovery = posekit.recover(dataclasses.replace(view, deviation=None))
    found = follow_scaled(view, lambda _: recovery, deviation=0.04)
    assert found.scale == pytest.approx(1.0, abs=1e-3)
    assert np.abs(found.choice.scales - 1).max() == pytest.approx(0.08)
    assert found.deviation == pytest.approx(0.04, rel=0.3)  # what was said of the lengths, and nothing more


@pytest.mark.parametrize(
    ("change", "deviation", "says"),
    [
        ({"deviation": None}, 0.05, "give --deviation"),
        ({}, 0.0, "fraction above 0"),
        ({}, math.nan, "fraction above 0"),
        ({}, 0.5, "at most 0.15"),
        ({"root": np.full((4, 3), np.nan)}, 0.05, "give root in every frame"),
    ],
)
def test_what_tells_no_scale(view, change, deviation, says):
    with pytest.raises(InputError, match=says) as caught:
        follow_scaled(dataclasses.replace(view, **change), deviation=deviation)
    assert "\n" not in str(caught.value)


def test_an_uncalibrated_view_tells_no_scale(view):
    with pytest.raises(InputError, match="uncalibrated"):
        follow_scaled(forget_camera(view))


def test_lengths_that_no_scale_saves_are_refused_as_they_are(view):
    with pytest.raises(PosekitError) as plain:
        posekit.recover(off_by(view, 0.3), tolerance=EXACT_TOLERANCE)
    with pytest.raises(PosekitError) as caught:
        follow_scaled(off_by(view, 0.3), partial(posekit.recover, tolerance=EXACT_TOLERANCE))
    assert str(caught.value) == str(plain.value)


def test_where_no_scale_leaves_a_posture_it_is_said(view):
    found = posekit.recover(view)
    nothing = dataclasses.replace(
        found, frames=[dataclasses.replace(one, batch=None) for one in found.frames]
    )
    with pytest.raises(InputError, match="frames has a posture"):
        follow_scaled(view, lambda _: nothing)


def chosen(scales, cost):
    paths = Paths(
        time=np.zeros(1),
        cost=np.zeros(1),
        share=np.ones(1),
        cheapest=np.zeros(1, dtype=np.intp),
        survivor=np.zeros((1, 1), dtype=np.intp),
        joints=np.zeros((1, 1, 14, 3)),
        deviation=np.zeros((1, 1, 14)),
        confidence=np.ones((1, 1)),
        interpolated=np.zeros((1, 1, 14), dtype=np.bool_),
        codes=(("",),),
        exact=True,
    )
    return ScaleChoice(scales=np.array(scales), cost=np.array(cost), paths=(paths,) * len(scales))


def test_a_parabola_of_costs_is_read_off_exactly():
    scales = np.array([0.9, 0.97, 1.0, 1.1])
    one = chosen(scales, 0.5 * ((scales - 0.985) / 0.01) ** 2 + 7)
    assert one.between == pytest.approx(0.985)
    assert one.deviation == pytest.approx(0.01)


def test_at_the_end_the_scale_is_as_sure_as_its_neighbour_is_far():
    one = chosen([0.9, 0.95, 1.0], [1.0, 2.0, 3.0])
    assert (one.between, one.deviation) == (0.9, pytest.approx(0.05))
