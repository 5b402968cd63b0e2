"""What is said of frames without a posture whose neck had to be placed: the lengths that are wrong, and no other."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from posekit import load_figure
from posekit.formats.own import View
from posekit.recovery import recover
from posekit.recovery.advice import advice_lines
from posekit.synthesis import random_views
from posekit.views.builtin import view_of

FIGURE = load_figure()
HELD: dict[str, Any] = {"infer": False, "ranges": "urdf", "length_deviation": 0.0}
"""Lengths at their word, however wrong: where they may vary, most frames have a posture."""
UPPER_ARMS = ("right_shoulder-right_elbow", "left_shoulder-left_elbow")
TRUNK = tuple(
    name
    for name in FIGURE.lengths
    if name.split("-")[1] in ("pelvis", "right_shoulder", "left_shoulder", "right_hip", "left_hip")
)


def rootless(factors: dict[str, float], noise: float = 2.0) -> View:
    """See eight postures without a root or a head, their lengths stated wrongly by some factors."""
    scene = random_views(FIGURE, 8, np.random.default_rng(5), ranges="urdf")
    view = view_of(scene.with_noise(noise, np.random.default_rng(1)) if noise else scene)
    lengths = {name: FIGURE.lengths[name] * factor for name, factor in factors.items()}
    return replace(view, lengths=lengths, root=np.empty(0), head_image=np.empty(0), deviation=noise or None)


@pytest.mark.parametrize("noise", [0.0, 2.0])
def test_arms_that_are_too_short_are_named_where_no_root_is_given(noise: float) -> None:
    recovery = recover(rootless(dict.fromkeys(UPPER_ARMS, 0.7), noise), **HELD)
    assert sum(not len(frame) for frame in recovery.frames) > 4
    # The torso is blamed frame by frame, though its lengths are right: the arms hold the person too near.
    assert any("the rigid parts close at no depth" in frame.reason for frame in recovery.frames)
    doubts = [line for line in advice_lines(recovery) if "is stated as" in line]
    assert doubts
    for line in doubts:
        assert line.startswith(UPPER_ARMS)
        needed = float(line.partition(" frames need ")[2].partition(" m ")[0])
        assert 0.22 < needed < FIGURE.lengths[UPPER_ARMS[0]] + 0.005  # stated 0.21 m, truly 0.30 m
        assert "placed by shoulders, pelvis and hips" in line


def test_a_trunk_that_is_too_large_is_not_laid_upon_one_limb() -> None:
    recovery = recover(rootless(dict.fromkeys(TRUNK, 1.3)), **HELD)
    assert sum(not len(frame) for frame in recovery.frames) > 4
    lines = advice_lines(recovery)
    assert not any("is stated as" in line for line in lines)
    assert any("check all lengths" in line for line in lines)


@pytest.mark.filterwarnings("ignore:.*beside the ray on which the neck is seen")
@pytest.mark.parametrize("root", [False, True])
def test_right_lengths_are_not_doubted_where_points_are_worse_than_is_said(root: bool) -> None:
    view = replace(rootless({}, 8.0), deviation=1.0)
    if root:
        view = replace(view, root=view.truth[:, 0])
    recovery = recover(view, infer=False, length_deviation=0.02, ranges="urdf")
    assert sum(not len(frame) for frame in recovery.frames) > 4
    assert not any("is stated as" in line for line in advice_lines(recovery))
