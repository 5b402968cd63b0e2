"""Which rests carry a body: levels, and what lies between them, by hand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.validators.motion.carried import FEWEST_FRAMES, carried, falls

STEP = 1.0 / 32.0


def stretches(*parts: tuple[str, float, int]) -> tuple[NDArray[np.bool_], Array, Array]:
    """Return who rests, and heights of the lowest point and the centre: rests at heights, flights and lifts to them."""
    resting: list[bool] = []
    height: list[float] = []
    for kind, to, frames in parts:
        start = height[-1] if height else to
        time = np.arange(1, frames + 1) / (frames + 1)
        bulge = 4.905 * (frames + 1) ** 2 * STEP**2 * time * (1 - time) if kind == "flight" else 0.0
        resting += [kind == "rest"] * frames
        height += (np.full(frames, to) if kind == "rest" else start + (to - start) * time + bulge).tolist()
    return np.array(resting), np.array(height), np.array(height) + 1.0


@pytest.mark.parametrize(
    ("parts", "bearing"),
    [
        # Onto a step by a jump, and by a hoist: then the longer of the two carries.
        ([("rest", 0.0, 20), ("flight", 0.5, 12), ("rest", 0.5, 10)], [0, 1]),
        ([("rest", 0.0, 20), ("lift", 0.5, 12), ("rest", 0.5, 10)], [0]),
        ([("rest", 0.0, 10), ("lift", 0.5, 12), ("rest", 0.5, 20)], [1]),
        # Back to where it was: whatever is between.
        (
            [("rest", 0.0, 20), ("lift", 0.5, 12), ("rest", 0.5, 30), ("lift", 0.0, 12), ("rest", 0.0, 20)],
            [0, 2],
        ),
        # Hoisted, then a jump: of the two that it is between, the one before.
        (
            [("rest", 0.0, 20), ("lift", 1.0, 12), ("rest", 1.0, 15), ("flight", 0.5, 12), ("rest", 0.5, 10)],
            [1, 2],
        ),
        (
            [("rest", 0.0, 30), ("lift", 1.0, 12), ("rest", 1.0, 15), ("flight", 0.5, 12), ("rest", 0.5, 10)],
            [0],
        ),
        # Two hoists make three levels.
        (
            [("rest", 0.0, 20), ("lift", 1.0, 12), ("rest", 1.0, 15), ("lift", 0.5, 12), ("rest", 0.5, 10)],
            [0],
        ),
        ([("rest", 0.0, 9)], [0]),
    ],
)
def test_a_body_is_carried_by_the_rests_between_which_it_falls(
    parts: list[tuple[str, float, int]], bearing: list[int]
) -> None:
    resting, lowest, centre = stretches(*parts)
    found = carried(resting, lowest, centre, STEP)
    rests = np.cumsum(np.diff(resting, prepend=False) & resting) - 1
    np.testing.assert_array_equal(found, resting & np.isin(rests, bearing))
    backward = carried(resting[::-1], lowest[::-1], centre[::-1], STEP)
    if len(parts) < 5:
        np.testing.assert_array_equal(backward[::-1], found)
    np.testing.assert_array_equal(carried(resting, lowest, centre, np.nan), resting)


@pytest.mark.parametrize("share", [0.25, 0.5, 1.0])
def test_a_fall_is_a_parabola_of_a_share_of_gravity(share: float) -> None:
    time = np.arange(20) * STEP
    for part, fell in ((1.01, True), (0.99, False), (-1.0, False)):
        centre = 2.0 + 0.3 * time - 0.5 * part * share * 9.80665 * time**2
        assert falls(centre, STEP, share) == fell
        centre[::3] = np.nan
        assert falls(centre, STEP, share) == fell
    hidden = np.full(20, np.nan)
    hidden[: FEWEST_FRAMES - 1] = 1.0
    assert falls(hidden, STEP, share)
    hidden[:FEWEST_FRAMES] = 1.0
    assert not falls(hidden, STEP, share)
