"""Joints that were hidden, through a whole recovery: frames are exact by evidence only, and never empty for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.formats.own import View
from posekit.recovery import recover
from posekit.recovery.recovery import FrameRecovery
from posekit.skeleton import JOINT, JOINTS
from posekit.synthesis import random_views
from posekit.views.builtin import view_of

FIGURE = load_figure()
FRAMES = 6
ROUNDING = 1e-6
SPINE = ("right_shoulder-pelvis", "left_shoulder-pelvis")
TRUNK = ("right_shoulder", "pelvis", "left_hip")


@pytest.fixture(scope="module")
def exact() -> View:
    return view_of(random_views(FIGURE, FRAMES, np.random.default_rng(8)))


@pytest.fixture(scope="module")
def bent(exact: View) -> View:
    """Give lengths that are right but for the spine's, as those of a clip in which it bends."""
    longer = {name: FIGURE.lengths[name] + 0.008 for name in SPINE}
    return replace(exact, lengths=longer)


def without(view: View, *hidden: str) -> View:
    image = view.image.copy()
    image[:, [JOINT[name] for name in hidden]] = np.nan
    return replace(view, image=image)


def kept(frame: FrameRecovery, truth: np.ndarray, within: float) -> bool:
    """Whether some survivor has the truth: joints that were seen near enough, the others in their regions."""
    for joints, regions in zip(frame.joints, frame.inferred or [{}] * len(frame), strict=True):
        placed = [k for k, name in enumerate(JOINTS) if name not in regions]
        if not np.linalg.norm(joints[placed] - truth[placed], axis=1).mean() < within:
            continue
        places = [(region, truth[JOINT[name]]) for name, region in regions.items()]
        if all(((one.lower - ROUNDING <= at) & (at <= one.upper + ROUNDING)).all() for one, at in places):
            return True
    return False


@pytest.mark.parametrize("hidden", TRUNK)
def test_a_trunk_that_is_rigid_in_part_is_not_exact(bent: View, hidden: str) -> None:
    assert bent.truth is not None
    everything, recovery = recover(bent), recover(without(bent, hidden))
    for frame, whole, truth in zip(recovery.frames, everything.frames, bent.truth, strict=True):
        assert frame.judged != "exact"
        assert not len(whole) or len(frame)
        assert kept(frame, truth, 0.02) or not kept(whole, truth, 0.01)


@pytest.mark.parametrize("hidden", TRUNK)
def test_an_exact_trunk_is_exact_without_one_of_its_joints(exact: View, hidden: str) -> None:
    assert exact.truth is not None
    for frame, truth in zip(recover(without(exact, hidden)).frames, exact.truth, strict=True):
        assert frame.judged == "exact"
        assert kept(frame, truth, ROUNDING)


def test_shoulders_alone_are_no_evidence(exact: View) -> None:
    legs = [name for name in JOINTS if name.endswith(("pelvis", "hip", "knee", "ankle"))]
    for frame in recover(without(exact, *legs)).frames:
        assert frame.judged != "exact"
        assert len(frame)


@pytest.mark.parametrize(
    "hidden", [("right_shoulder",), ("pelvis",), ("left_hip", "left_knee", "left_ankle")]
)
def test_regions_of_refined_survivors_hold_the_truth(hidden: tuple[str, ...], exact: View) -> None:
    assert exact.truth is not None
    noisy = exact.image + np.random.default_rng(1).normal(0.0, 1.0, exact.image.shape)
    head = np.full_like(exact.head_image, np.nan)
    seen = replace(
        exact, image=noisy, head_image=head, deviation=1.0, length_deviation=0.01, root=exact.truth[:, 0]
    )
    # Random postures are none that a motion has: some hold under 1 %.
    everything, recovery = (recover(one, coverage=1.0) for one in (seen, without(seen, *hidden)))
    good = 0
    for frame, whole, truth in zip(recovery.frames, everything.frames, exact.truth, strict=True):
        assert frame.judged == "refined"
        if kept(whole, truth, 0.035):
            good += 1
            assert kept(frame, truth, 0.05)
        assert frame.refined is not None
        inferred = np.array([[name in regions for name in JOINTS] for regions in frame.inferred or []])
        assert np.isnan(frame.refined.covariance[inferred]).all()
    assert good >= FRAMES // 2
