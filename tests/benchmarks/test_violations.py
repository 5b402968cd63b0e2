"""The study of who violates what: Taylor's lifting, and the shares that it counts."""

import numpy as np
import pytest

from benchmarks.studies.violations import Moved, beyond, lifted
from posekit import Validator, load_figure
from posekit.skeleton import JOINT, PARENTS

STANDING = load_figure().neutral_points[:14]


@pytest.mark.parametrize("seed", range(3))
def test_a_picture_by_scaled_orthographic_projection_is_lifted_back(seed: int) -> None:
    rng = np.random.default_rng(seed)
    joints = STANDING + rng.normal(0.0, 0.05, STANDING.shape)
    steps = joints[1:] - joints[list(PARENTS[1:])]
    lengths, signs = np.linalg.norm(steps, axis=1), np.sign(steps[:, 2])
    image = 300.0 * joints[:, :2]
    found = lifted(image, lengths, signs, 300.0)
    np.testing.assert_allclose(found - found[0], joints - joints[0], rtol=0, atol=1e-9)
    least = lifted(image, lengths, signs, None)
    np.testing.assert_allclose(np.linalg.norm(least[1:] - least[list(PARENTS[1:])], axis=1), lengths)


def test_an_elbow_that_bends_backward_is_counted_on_its_side_by_its_degrees() -> None:
    joints = np.tile(STANDING, (4, 1, 1))
    elbow = STANDING[JOINT["left_elbow"]]
    arm = STANDING[JOINT["left_wrist"]] - elbow
    for frame, degrees in enumerate((0.0, 25.0, 60.0, 60.0)):
        turn = np.radians(degrees)
        joints[frame, JOINT["left_wrist"]] = (
            elbow + np.cos(turn) * arm - np.sin(turn) * np.linalg.norm(arm) * np.eye(3)[0]
        )
    source = Moved(
        name="bent", joints=joints, clip=np.zeros(4, dtype=np.intp), rate=np.array([30.0]), clips=("one",)
    )
    shares = beyond(source, Validator())
    assert shares[:2] == shares[4:6] == shares[6:8] == ["0.0%", "0.0%"]
    assert shares[2] == "75.0%"
