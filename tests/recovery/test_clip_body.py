"""One body for a clip: found from wrong lengths, said in the result, and left alone where lengths are exact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from posekit.body import LengthUncertainty, load_figure
from posekit.cameras import PinholeCamera
from posekit.formats.own import View
from posekit.recovery import recover
from posekit.recovery.advice import advice_lines
from posekit.recovery.clip_body import changed_lengths
from posekit.skeleton import SEGMENT_NAMES
from posekit.synthesis import SyntheticScene
from posekit.synthesis.camera_sphere import CameraPlacements
from posekit.synthesis.observe import observe
from posekit.synthesis.viewpoints import look_at
from posekit.synthesis.walker import Walker
from posekit.views.builtin import view_of

FRAMES = 16
NOISE_PIXELS = 2.0
LIMB_JOINTS = ("elbow", "wrist", "knee", "ankle")
LIMBS = [name for name in SEGMENT_NAMES if name.endswith(LIMB_JOINTS)]
SIDE, FRONT = (0.5, 0.0, 4.5), (5.0, 0.0, 0.5)


def walk(camera: tuple[float, float, float], seed: int = 0) -> SyntheticScene:
    """Let the walker pass a camera of 1500 pixels."""
    walker = Walker(figure=load_figure(), velocity=0.7)
    time = np.linspace(0.0, 2.2, FRAMES)
    q = walker.configurations(walker.phase(time, 0.1))
    position = np.array(camera)
    R = look_at(position, np.array([0.0, -0.6, 0.0]), np.array([0.0, 1.0, 0.0]))
    K = np.array([[1500.0, 0.0, 960.0], [0.0, 1500.0, 540.0], [0.0, 0.0, 1.0]])
    scene = observe(
        walker.figure,
        PinholeCamera(K=K),
        walker.figure.forward_kinematics(q),
        CameraPlacements(
            R_cam_world=np.broadcast_to(R, (FRAMES, 3, 3)), position=np.broadcast_to(position, (FRAMES, 3))
        ),
        q=q,
        time=time,
    )
    return scene.with_noise(NOISE_PIXELS, np.random.default_rng(seed))


def off(scene: SyntheticScene, rng: np.random.Generator, *, told: bool = True) -> View:
    """Make a view whose lengths are off by up to a tenth, each and all, and whose necks are `told`."""
    factors = rng.uniform(0.9, 1.1, len(SEGMENT_NAMES)) * rng.uniform(0.9, 1.1)
    lengths = {
        name: scene.figure.lengths[name] * factor for name, factor in zip(SEGMENT_NAMES, factors, strict=True)
    }
    root = scene.joints_cam[:, 0] if told else np.empty((0,))
    view = view_of(scene)
    return replace(
        view,
        lengths=lengths,
        deviation=NOISE_PIXELS,
        root=root,
        head_image=np.empty((0,)),
        head_points=None,
    )


def errors(found: dict[str, float], scene: SyntheticScene) -> np.ndarray:
    """Return errors of the limbs' logarithms after the common factor."""
    error = np.array([np.log(found[name] / scene.figure.lengths[name]) for name in LIMBS])
    return np.asarray(error - np.median(error))


@pytest.mark.parametrize(("camera", "bound"), [(SIDE, 0.03), (FRONT, 0.045)])
def test_limbs_are_found_from_lengths_that_are_off(camera: tuple[float, float, float], bound: float) -> None:
    scene = walk(camera)
    view = off(scene, np.random.default_rng(5))
    recovery = recover(view)
    said = recovery.settings["one_body"]
    start = errors(dict(view.lengths), scene)
    found = errors(said["lengths"], scene)
    assert np.sqrt(np.mean(found**2)) < bound < 1.5 * np.sqrt(np.mean(start**2))
    assert dict(recovery.figure.lengths) == pytest.approx(said["lengths"], abs=1e-12)
    assert recovery.settings["lengths"] == pytest.approx(said["lengths"], abs=1e-12)
    assert said["size"] == "told by the necks"
    assert all(0 < said["deviation"][name] < 0.3 for name in SEGMENT_NAMES)
    assert all(len(frame) for frame in recovery.frames)


def test_a_size_that_nothing_tells_stays_and_is_said() -> None:
    scene = walk(SIDE)
    view = off(scene, np.random.default_rng(6), told=False)
    recovery = recover(view)
    said = recovery.settings["one_body"]
    assert said["size"] == "not told: depth and size look alike"
    # As well known as what was given: the sizes of the figure's own lengths are as before, on average.
    change = [np.log(said["lengths"][name] / said["start"][name]) for name in SEGMENT_NAMES]
    assert abs(np.mean(change)) < 0.03
    assert said["size_deviation"] == recovery.settings["noise"]["size"] > 0
    assert "size and depth are those of the lengths that it was recovered with" in " ".join(
        advice_lines(recovery)
    )


def test_exact_lengths_stay() -> None:
    view = replace(view_of(walk(SIDE)), deviation=NOISE_PIXELS)
    for exact in (
        recover(view, length_deviation=0.0),
        recover(replace(view, length_deviation=0.0)),
    ):
        assert "one_body" not in exact.settings
        assert exact.settings["lengths"] == dict(load_figure().lengths)


def test_few_frames_make_no_clip() -> None:
    scene = walk(SIDE).select(range(6))
    assert "one_body" not in recover(off(scene, np.random.default_rng(7))).settings


def test_frames_that_close_exactly_keep_their_lengths() -> None:
    scene = walk(SIDE)
    points = scene.joints_cam, scene.head_cam
    image, head = (scene.camera.project(each) for each in points)
    exact = replace(scene, image=image, head_image=head)
    recovery = recover(view_of(exact))
    assert "one_body" not in recovery.settings
    assert all(frame.judged == "exact" for frame in recovery.frames)


def test_lengths_that_changed_are_named_with_how_much() -> None:
    stated = dict(load_figure().lengths)
    known = LengthUncertainty(common=0.01, own=dict.fromkeys(SEGMENT_NAMES, 0.01))
    found = {name: length * 1.1 for name, length in stated.items()}
    found["right_hip-right_knee"] *= 1.08
    size, thigh = changed_lengths(stated, found, known, sized=True)
    assert "all lengths are stated" in size
    assert "too short" in size
    assert thigh.startswith("right_hip-right_knee is stated as")
    assert "6." in thigh or "7." in thigh
    assert changed_lengths(stated, stated, known, sized=True) == []
