"""Checks by compiled loops: what they find is what `judge` finds, to rounding; verdicts are the same."""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.compiled.compiling import path
from posekit.geometry import Array
from posekit.tree import Check, Findings
from posekit.validators import Validator
from posekit.validators.suite import judge

FIGURE = load_figure()
ROUNDING = 1e-9
"""Degrees, or metres."""


def postures(noise: float, seed: int = 0, n: int = 250) -> Array:
    """Draw postures within the figure's limits, put off by noise, metres; with some, a few points are not known."""
    rng, limits = np.random.default_rng(seed), FIGURE.limits
    q = np.tile(pin.neutral(FIGURE.model), (n, 1))
    q[:, FIGURE.angle_index] = limits.lower + rng.random((n, 22)) * (limits.upper - limits.lower)
    points = FIGURE.forward_kinematics(q)
    if noise:
        points += noise * rng.normal(size=points.shape)
        points[rng.random(points.shape[:2]) < 0.02] = np.nan
    return points


def hostile() -> Array:
    """Make postures at singular places: straight, raised, folded, in one point, out of reach, unknown."""
    points = np.repeat(FIGURE.neutral_points[None], 8, axis=0)
    points[1, 8] = points[1, 2] + [0.0, 0.0, 0.3]
    points[2, 8] = points[2, 0]
    points[3] = 0.0
    points[4] *= 1e6
    points[5] = np.nan
    points[6, 6:] = np.nan
    points[7, 8:] = points[7, 6:7]
    return points


def same(one: Findings, other: Findings) -> None:
    assert (one.violated == other.violated).all()
    for name in ("value", "lower", "upper", "margin"):
        expected: Any = np.broadcast_to(getattr(one, name), one.value.shape)
        given: Any = np.broadcast_to(getattr(other, name), one.value.shape)
        np.testing.assert_allclose(given, expected, rtol=1e-12, atol=ROUNDING)


def suite(points: Array, **changes: Any) -> list[Check]:
    with np.errstate(all="ignore"):
        return list(Validator(lengths="model", **changes).figure_and_suite(points[:, :14])[1])


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.3])
@pytest.mark.parametrize("changes", [{}, {"contact_margin": 0.02}, {"angle_tolerance": 0.001}])
def test_loops_find_what_judges_find(noise: float, changes: dict[str, Any]) -> None:
    points = postures(noise)
    for check in suite(points, **changes):
        own = points[:, list(check.points)]
        same(check.judge(own), check.judge_looped(own))


def test_they_do_where_postures_are_hostile() -> None:
    points = hostile()
    with np.errstate(all="ignore"):
        for check in suite(points[:1]):
            own = points[:, list(check.points)]
            same(check.judge(own), check.judge_looped(own))


def test_whole_suites_say_the_same_compiled() -> None:
    points = postures(0.02, seed=1)
    checks = suite(points)
    with path("plain"):
        plain = judge(checks, points)
    with path("fast"):
        fast = judge(checks, points)
    for one, other in zip(plain, fast, strict=True):
        assert (one.check, one.where) == (other.check, other.where)
        assert (one.violated == other.violated).all()
        np.testing.assert_allclose(other.margin, one.margin, rtol=1e-12, atol=ROUNDING)
