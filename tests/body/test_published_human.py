"""The stick figure's limits against the human URDF that example-robot-data publishes."""

from __future__ import annotations

import importlib.metadata
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.skeleton import DOFS

HUMAN = "human_description/robots/human.urdf"
# That model's axes are the ISB's: Z flexes. Its limits are loose, but for the elbow's, which ends at 150 degrees
# where Table 1 says 160.
SAME_ANGLE = {
    "right_hip.flexion": "right_hip_Z",
    "right_knee.flexion": "right_knee_Z",
    "right_shoulder.flexion": "right_shoulder_Z",
}


@pytest.fixture(scope="module")
def human() -> pin.Model:
    files = importlib.metadata.files("example-robot-data") or []
    found = [Path(str(file.locate())) for file in files if str(file).endswith(HUMAN)]
    assert found, f"example-robot-data has no {HUMAN}"
    return pin.buildModelFromUrdf(str(found[0]))


@pytest.mark.parametrize("dof", SAME_ANGLE)
def test_the_ranges_lie_inside_those_of_the_published_human(human: pin.Model, dof: str) -> None:
    limits, k = load_figure().limits, DOFS.index(dof)
    index = human.idx_qs[human.getJointId(SAME_ANGLE[dof])]
    theirs = np.degrees([human.lowerPositionLimit[index], human.upperPositionLimit[index]])
    ours = np.degrees([limits.lower[k], limits.upper[k]])
    rounding = 0.1  # it writes pi with three digits
    assert theirs[0] - rounding <= ours[0]
    assert ours[1] <= theirs[1] + rounding
