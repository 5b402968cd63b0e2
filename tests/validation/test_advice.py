"""The sentence that says why most postures fail."""

from __future__ import annotations

import numpy as np
import pytest

import posekit
from posekit.body import load_figure
from posekit.skeleton import JOINT, JOINTS, other_side


def bent_walk(count: int) -> np.ndarray:
    """Let the figure go on with knees and elbows bent, so that right and left differ."""
    joints = np.repeat(load_figure().neutral_points[None, :14], count, axis=0)
    swing = np.sin(np.arange(count) / 5)[:, None]
    for side, sign in (("right", 1), ("left", -1)):
        for name, share in (("elbow", 0.05), ("wrist", 0.12), ("knee", 0.1), ("ankle", 0.05)):
            joints[:, JOINT[f"{side}_{name}"], :1] += share * (1 + sign * swing)
    return joints


@pytest.mark.parametrize("first", [10, 40])
def test_exchanged_sides_are_the_reason_and_not_what_they_cause(first: int) -> None:
    joints = bent_walk(90)
    sides = [JOINTS.index(other_side(name)) for name in JOINTS]
    joints[first : first + 30] = joints[first : first + 30][:, sides]
    report = posekit.validate(joints, rate=30.0, up="+z")
    assert "have left and right exchanged: put them right by --repair" in report.settings["why"]
    assert report.columns is not None and report.columns.summary["valid"] == 60
