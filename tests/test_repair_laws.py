"""Laws of repair: it moves with the motion, comes back near the clean motion, and says what it did in true numbers."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import posekit
from posekit.skeleton import JOINT, JOINTS, other_side
from tests.test_repair import FAULTS, FRAMES, clean

__all__ = ["clean"]  # fixture
EXCHANGED = [JOINT[other_side(name)] for name in JOINTS]
TURN = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
REMAINS = {"jump": 0.01, "trembling": 0.25, "lengthened": 1e-3, "exchanged": 1e-3, "lifted": 1e-3}
"""Largest share of the planted error (root mean square) that remains where the true motion can be known."""
DISTANCES = {"elbow folded": 0.06, "elbow backward": 0.05, "knee folded": 0.055}
"""Distance in metres by which the end of a limb is outside its range: repair moves joints no farther."""


@pytest.mark.parametrize("fault", FAULTS)
def test_repair_moves_with_the_motion_and_says_what_it_did(clean: posekit.Motion, fault: str) -> None:
    broken = FAULTS[fault](np.asarray(clean.joints))
    done = posekit.repair(replace(clean, joints=broken))
    assert done.motion is not None
    joints = np.asarray(done.motion.joints)

    mirrored = (broken * [-1.0, 1.0, 1.0])[:, EXCHANGED] @ TURN.T
    again = posekit.repair(replace(clean, joints=mirrored))
    assert again.motion is not None
    back = (np.asarray(again.motion.joints) @ TURN * [-1.0, 1.0, 1.0])[:, EXCHANGED]
    np.testing.assert_allclose(back, joints, atol=1e-3)
    assert again.notes[0] == done.notes[0]

    off, planted = (np.sqrt(((one - clean.joints) ** 2).sum(axis=2).mean()) for one in (joints, broken))
    assert off <= REMAINS.get(fault, np.inf) * planted
    moved = np.linalg.norm(joints - broken, axis=2)
    assert done.notes[0] == f"{int((moved.max(axis=1) > 0).sum())} of {FRAMES} frames changed"
    (largest,) = (re.findall(r"up to (\S+) cm", note)[0] for note in done.notes if "moved" in note)
    assert float(largest) == pytest.approx(100 * moved.max(), rel=5e-3)
    assert moved.max() <= DISTANCES.get(fault, np.inf)
