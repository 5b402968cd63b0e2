"""The sentence that says why most postures fail."""

from __future__ import annotations

import numpy as np
import pytest

import posekit
from posekit.body import load_figure
from posekit.formats.held_postures import HeldPostures
from posekit.formats.own import NamedConfigurations, Postures
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


def test_angles_in_degrees_are_told_by_their_size() -> None:
    q = np.zeros((20, 29 + 7))
    q[:, 2], q[:, 6], q[:, 7:] = 0.8, 1.0, 20.0
    report = posekit.validate(NamedConfigurations(q=q), urdf="g1", checks=["joint-range"])
    assert "its angles are in degrees" in report.settings["why"]


def test_a_clip_is_judged_alike_alone_and_beside_others_of_the_same_skeleton() -> None:
    upright, bent = bent_walk(40), bent_walk(40)
    hips = [
        JOINT[name]
        for name in ("right_hip", "left_hip", "right_knee", "left_knee", "right_ankle", "left_ankle")
    ]
    c, s = np.cos(0.9), np.sin(0.9)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    pelvis = bent[:, [JOINT["pelvis"]]]
    bent[:, hips] = (bent[:, hips] - pelvis) @ turn.T + pelvis
    both = HeldPostures(
        postures=Postures(joints=np.concatenate([upright, bent])),
        frame=np.tile(np.arange(40), 2),
        clip=np.repeat([0, 1], 40),
        time=np.tile(np.arange(40) / 30.0, 2),
        up="+z",
    )
    together = posekit.validate(both, checks=["joint-range"])
    alone = [posekit.validate(one, rate=30.0, up="+z", checks=["joint-range"]) for one in (upright, bent)]
    assert together.columns is not None
    margins = [one.columns.worst_margin for one in alone if one.columns is not None]
    assert np.array_equal(together.columns.worst_margin, np.concatenate(margins))
