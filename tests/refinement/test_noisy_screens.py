"""Screens of joint ranges under noise say what their judges say, and are as sure as those without it."""

from typing import Any

import numpy as np
import pytest

from posekit.compiled.verdicts import NOT_CLEAR
from posekit.refinement import under_noise
from posekit.validators import joint_range, load_ranges
from tests.validators.test_screens import FIGURE, MIDDLE, N, places, postures, special

AWAY = np.array([0.3, -0.2, 4.0])
"""Where the neck is, metres: a camera with a perspective sees it."""

NOISES: dict[str, dict[str, Any]] = {
    "hardly any": {"bound": 1e-5},
    "two pixels": {"bound": 4e-3},
    "and lengths": {"bound": 4e-3, "stretch": 0.1},
    "without a perspective": {"bound": 0.01, "stretch": 0.05, "perspective": False},
}


@pytest.mark.parametrize("ranges", ["urdf", "anatomical"])
@pytest.mark.parametrize("noise", NOISES)
def test_a_screen_under_noise_never_contradicts_the_judge(ranges: str, noise: str) -> None:
    for figure in (FIGURE, MIDDLE):
        inner = joint_range(figure, load_ranges(ranges), tolerance=1.0)
        for seed, check in enumerate(under_noise(inner, **NOISES[noise])):
            ordinary, odd = postures(seed) + AWAY, special(seed) + AWAY
            screened, judged = places(check, np.concatenate([ordinary, odd]))
            clear = screened != NOT_CLEAR
            np.testing.assert_array_equal(screened[clear], judged[clear])
            of_inner = places(inner[seed], ordinary)[0] != NOT_CLEAR
            assert clear[:N].mean() >= of_inner.mean() - 0.02


def test_a_check_without_a_screen_has_none_under_noise() -> None:
    projected = joint_range(FIGURE, load_ranges("table1"), tolerance=1.0)
    assert all(check.rule is None for check in under_noise(projected, 4e-3))
