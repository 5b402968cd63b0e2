"""What repair gives back: the motion before the defect, with as many frames as possible where they were."""

from __future__ import annotations

import numpy as np
import pytest

import posekit
from posekit.motion import Motion
from posekit.settings import ValidateSettings
from posekit.skeleton import JOINT
from tests.test_checks_bounds import LEFT, SOLE, STRETCH, TIME, UP, along
from tests.test_checks_motion import gesture, lengthened, swapped


def repaired(joints: np.ndarray, check: str, **settings: object) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the repaired joints, which pass the check, and the notes."""
    given = ValidateSettings(**{"checks": [check], "noise": 0.0, **settings})
    done = posekit.repair(Motion(joints=joints, time=TIME, up="+z"), settings=given)
    assert done.report.ok.all() and not done.before.ok.all() and done.motion is not None
    return np.asarray(done.motion.figure_joints), done.notes


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("height", "shifted"), [(0.49, True), (0.51, False)])
def test_a_body_is_shifted_to_the_ground_from_half_a_metre(height: float, shifted: bool, sign: float) -> None:
    check, ground = ("floating", {}) if sign > 0 else ("penetration", {"ground": SOLE})
    joints, notes = repaired(gesture() + along(sign * height * STRETCH, UP), check, **ground)
    assert ("the body shifted to the ground" in notes) is shifted
    if shifted:
        np.testing.assert_array_equal(joints[~STRETCH], gesture()[~STRETCH])
        np.testing.assert_allclose(joints, gesture(), atol=0.03)


@pytest.mark.parametrize("first", [3, 5, 40, 80, 117])
def test_a_step_of_the_body_is_taken_out_of_the_fewer_frames(first: int) -> None:
    moved = gesture() + along(0.3 * (np.arange(120) < first), LEFT)
    joints, notes = repaired(moved, "teleport")
    assert "steps of the whole body taken out" in notes
    kept = np.arange(120) >= first if first < 60 else np.arange(120) < first
    np.testing.assert_allclose(joints[kept], moved[kept], atol=1e-9)
    np.testing.assert_allclose(joints, gesture() + along(np.full(120, 0.3 * (first >= 60)), LEFT), atol=0.02)
    assert f"{int((~kept).sum())} of 120 frames changed" in notes


def test_exchanged_sides_come_back_as_they_were() -> None:
    joints, notes = repaired(swapped(gesture()), "swap")
    np.testing.assert_array_equal(joints, gesture())
    assert "right and left exchanged back" in notes and "21 of 120 frames changed" in notes


def test_a_limb_gets_its_usual_length_and_direction() -> None:
    joints, notes = repaired(lengthened(gesture()), "drift")
    assert "lengths of limbs restored" in notes
    hip, knee, ankle = (JOINT[f"left_{name}"] for name in ("hip", "knee", "ankle"))
    usual = np.linalg.norm(gesture()[0, knee] - gesture()[0, hip])
    lengths = np.linalg.norm(joints[:, knee] - joints[:, hip], axis=1)
    np.testing.assert_allclose(lengths, usual, rtol=0.025)
    np.testing.assert_allclose(lengths[30:90], usual, rtol=2e-3)
    shank = joints[:, ankle] - joints[:, knee]
    np.testing.assert_allclose(shank, gesture()[:, ankle] - gesture()[:, knee], atol=1e-9)
    others = [k for k in range(14) if k not in (knee, ankle)]
    np.testing.assert_array_equal(joints[:, others], gesture()[:, others])
