"""What is kept from one call to the next is what would be made anew: nobody has written into it."""

from __future__ import annotations

import numpy as np
import pytest

from posekit.body import load_figure, loading
from posekit.synthesis import random_views
from posekit.validators import CheckOptions, ranges, registry
from posekit.validators.motion import profile
from posekit.validators.ranges import NAMED_TABLES, load_ranges

FIGURE = load_figure()
VIEWS = random_views(FIGURE, 20, np.random.default_rng(61))
POINTS = np.concatenate([VIEWS.joints_cam, VIEWS.head_cam], axis=1)


@pytest.mark.parametrize("name", NAMED_TABLES)
def test_ranges(name: str) -> None:
    anew = ranges._named.__wrapped__(name)
    assert repr(anew) == repr(load_ranges(name))
    kinds = {"table1": "rotation", "table1-printed": "projected", "anatomical": "configuration"}
    assert (anew.name, anew.kind) == (name, kinds[name])


@pytest.mark.parametrize("name", profile.BUILT_IN_PROFILES)
def test_profiles(name: str) -> None:
    assert profile._named.__wrapped__(name) == profile.load_profile(name)


def test_the_figure() -> None:
    again = loading._built_in.__wrapped__()
    assert again.lengths == FIGURE.lengths and again.shoulder_offset == FIGURE.shoulder_offset
    np.testing.assert_array_equal(again.neutral_points, FIGURE.neutral_points)
    np.testing.assert_array_equal(
        [again.limits.lower, again.limits.upper], [FIGURE.limits.lower, FIGURE.limits.upper]
    )
    assert repr(again.capsules) == repr(FIGURE.capsules)


@pytest.mark.parametrize("table", ["urdf", *NAMED_TABLES])
@pytest.mark.parametrize("name", ["rigid-parts", "joint-range", "collision", "walking"])
def test_checks(name: str, table: str) -> None:
    options = CheckOptions(ranges=load_ranges(table), rules=(1, 2, 3, 4))
    kept, anew = (
        make(name, FIGURE, options) for make in (registry._built_in, registry._built_in.__wrapped__)
    )
    assert len(kept) == len(anew) > 0
    for one, other in zip(kept, anew, strict=True):
        assert (one.name, one.unit, one.where, one.points) == (
            other.name,
            other.unit,
            other.where,
            other.points,
        )
        found, again = (check.judge(POINTS[:, list(check.points)]) for check in (one, other))
        np.testing.assert_array_equal(found.margin, again.margin)
        np.testing.assert_array_equal(found.violated, again.violated)
