"""Left and right that a detector exchanged: undone where the path gets likelier."""

import dataclasses

import numpy as np
import pytest

import posekit
from posekit.formats.own import OpenCVModel, View
from posekit.measures import pa_mpjpe
from posekit.recovery.sequences import follow
from posekit.recovery.swapped_labels import PAIRS, swapped_line, undo_swaps
from posekit.skeleton import POINT
from posekit.synthesis import CameraPlacements, Walker
from posekit.synthesis.camera_sphere import CameraSphere
from posekit.synthesis.observe import observe
from posekit.synthesis.viewpoints import look_at

FRAMES = 20


@pytest.fixture(scope="module")
def view():
    """A walker who passes a standing camera, seen with 2 px of noise."""
    walker, sphere = Walker(), CameraSphere()
    time = np.arange(FRAMES) / 30
    q = walker.configurations(walker.phase(time, 0.1))
    q[:, :3] += walker.travel(time, 0.1)
    points = walker.figure.forward_kinematics(q)
    middle = points.reshape(-1, 3).mean(axis=0)
    position = middle + np.array([2.0, 0.2, -3.5])
    R = np.broadcast_to(look_at(position, middle, np.array([0.0, 1.0, 0.0])), (FRAMES, 3, 3))
    placements = CameraPlacements(R, np.broadcast_to(position, (FRAMES, 3)))
    scene = observe(walker.figure, sphere.camera, points, placements, time=time)
    return View(
        camera=OpenCVModel(K=scene.camera.K),
        time=time,
        image=scene.with_noise(2.0, np.random.default_rng(0)).image,
        root=scene.joints_cam[:, 0],
        truth=scene.joints_cam,
        lengths=dict(scene.figure.lengths),
        deviation=2.0,
    )


@pytest.fixture(scope="module")
def recovery(view):
    return posekit.recover(view)


def swapped(view, frames, kind):
    image = view.image.copy()
    for name in PAIRS[kind]:
        right, left = POINT[f"right_{name}"], POINT[f"left_{name}"]
        if max(right, left) < image.shape[1]:
            image[np.ix_(frames, [right, left])] = image[np.ix_(frames, [left, right])]
    return dataclasses.replace(view, image=image)


def off(found, view):
    """Return how far a path is off after a similarity, metres, mean of all frames."""
    return float(np.mean(pa_mpjpe(found.joints[0], view.truth).value))


@pytest.mark.parametrize(("kind", "frames"), [("legs", [6, 7, 13]), ("all", [3, 9, 10])])
def test_left_and_right_are_undone_with_the_path(view, recovery, kind, frames):
    exchanged = posekit.recover(swapped(view, frames, kind))
    undone = undo_swaps(exchanged)
    assert undone.settings["swapped"] == {str(k): kind for k in frames}
    assert all(f"{k} ({kind})" in swapped_line(undone) for k in frames)
    error = off(follow(undone, k=1), view)
    assert error == off(follow(recovery, k=1), view)
    assert error < off(follow(exchanged, k=1), view) - 0.01
    for one, other in zip(undone.frames, recovery.frames, strict=True):
        np.testing.assert_array_equal(one.joints, other.joints)


def test_a_sequence_without_swaps_is_not_touched(recovery):
    assert undo_swaps(recovery) is recovery
    assert swapped_line(recovery) == ""
