"""Laws of checks: findings run backward with the film, and neighbouring frames show which way a hinge bends."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import posekit
from posekit.motion import Motion
from tests.test_checks_motion import RATE, gesture, judged, lengthened
from tests.test_checks_motion_laws import PLANTS, findings

FIGURE = posekit.load_figure()
BETWEEN_FRAMES = {"frozen": 1, "sliding": 1}
"""Checks of two neighbouring frames name the later one, which is the earlier one of the film run backward."""


@pytest.mark.parametrize("plant", PLANTS)
def test_findings_run_backward_with_the_film(plant: Callable[[np.ndarray], np.ndarray]) -> None:
    joints = plant(gesture())
    forward, backward = findings(judged(joints)), findings(judged(joints[::-1]))
    last = len(joints) - 1
    expected = {
        (last - frame + BETWEEN_FRAMES.get(check, 0), check, place): numbers
        for (frame, check, place), numbers in forward.items()
    }
    assert expected and expected.keys() == backward.keys()
    for key, numbers in expected.items():
        np.testing.assert_allclose(backward[key], numbers, atol=1e-9)


def bending(degrees: list[float], hinge: str) -> Motion:
    """Return a person who bends one elbow by these angles, frame by frame; negative ones bend it backward."""
    names = list(FIGURE.configuration_names)
    q = np.tile(FIGURE.neutral, (len(degrees), 1))
    q[:, names.index(f"{hinge.partition('_')[0]}_shoulder_flexion")] = 0.8
    q[:, names.index(f"{hinge}_flexion")] = np.radians(degrees)
    return Motion(joints=FIGURE.points(q), time=np.arange(len(degrees)) / RATE, up="+z")


@pytest.mark.parametrize("hinge", ["right_elbow", "left_elbow"])
@pytest.mark.parametrize(
    ("degrees", "first"),
    [
        ([40.0] + [-15.0] * 4 + [4.0] * 20, 1),
        ([4.0] * 20 + [-15.0] * 4 + [40.0], 20),
        ([40.0] + [-15.0] * 4 + [40.0], 1),
        ([-15.0] * 4 + [4.0] * 20, None),
        ([40.0] + [4.0] * 40 + [-15.0] * 4, None),
    ],
)
def test_the_nearest_bent_frame_shows_which_way_a_hinge_bends(
    degrees: list[float], first: int | None, hinge: str
) -> None:
    """A bend of 15 degrees alone could be a forward one of a limb turned by half a turn; it is known for a second."""
    report = posekit.validate(bending(degrees, hinge), checks="joint-range")
    found = {frame: numbers[0] for (frame, _, _), numbers in findings(report).items()}
    assert list(found) == ([] if first is None else list(range(first, first + 4)))
    assert list(found.values()) == pytest.approx([-15.0] * len(found), abs=0.5)


@pytest.mark.parametrize("hidden", [slice(0, 2), slice(1, 2), slice(1, 4), slice(57, 59), slice(118, 120)])
def test_a_hidden_joint_hides_the_defects_of_its_own_frames_alone(hidden: slice) -> None:
    joints = lengthened(gesture())
    seen = {key: numbers for key, numbers in findings(judged(joints)).items() if key[1] == "drift"}
    left = np.ones(len(joints), dtype=bool)
    left[hidden] = False
    joints[hidden, 8] = np.nan
    found = findings(judged(joints))
    expected = {key: numbers for key, numbers in seen.items() if left[key[0]]}
    assert expected and {key for key in found if key[1] == "drift" and left[key[0]]} == expected.keys()
    for key, numbers in expected.items():
        assert found[key] == pytest.approx(numbers, abs=1e-3)
