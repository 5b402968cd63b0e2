"""Judging by several checks of one validator: asking the later first says what asking all of them says."""

from typing import Any

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.geometry import Array
from posekit.tree import Check
from posekit.validators import Validator
from posekit.validators.suite import judge, worst_margins


def suite(ranges: str) -> tuple[list[Check], Array]:
    figure = load_figure()
    rng = np.random.default_rng(4)
    points = figure.neutral_points + rng.normal(0, 0.08, (300, 19, 3))
    points[rng.random((300, 19)) < 0.1] = np.nan
    points[:20, 3:] = np.nan
    points[20:40, 6:] = figure.neutral_points[6:]
    _, checks = Validator(ranges=ranges).figure_and_suite(points[:, :14])
    return list(checks), points


@pytest.mark.parametrize("ranges", ["anatomical", "urdf"])
def test_the_last_check_that_decides_a_place_holds(ranges: str) -> None:
    checks, points = suite(ranges)
    for judged in judge(checks, points):
        held: dict[str, list[Any]] = {}
        for check in (one for one in checks if one.name == judged.check):
            found = check.judge(points[:, list(check.points)])
            shape = found.value.shape
            parts = (found.value, found.lower, found.upper, found.margin, found.violated)
            for k, where in enumerate(check.where):
                new = [np.broadcast_to(part, shape)[:, k] for part in parts]
                known = ~np.isnan(new[3])
                before = held.setdefault(where, new)
                held[where] = [np.where(known, a, b) for a, b in zip(new, before, strict=True)]
        assert judged.where == tuple(held)
        for k, where in enumerate(judged.where):
            given: tuple[Any, ...] = (
                judged.value,
                judged.lower,
                judged.upper,
                judged.margin,
                judged.violated,
            )
            for one, expected in zip(given, held[where], strict=True):
                np.testing.assert_allclose(one[:, k], expected, rtol=0, atol=1e-9)


def test_worst_margins_are_those_of_the_judgements() -> None:
    checks, points = suite("anatomical")
    worst = worst_margins(checks, points)
    for judged in judge(checks, points):
        np.testing.assert_allclose(judged.worst, worst[judged.check], rtol=0, atol=1e-9)


def test_no_check_is_asked_about_no_posture(monkeypatch: pytest.MonkeyPatch) -> None:
    checks, points = suite("anatomical")
    asked: list[int] = []
    who: set[int] = set()
    kinds = {type(check): (type(check).judge, type(check).judge_looped) for check in checks}
    for kind, (judge_all, judge_looped) in kinds.items():

        def spy(self: Check, of: Array, judge_all: Any = judge_all) -> Any:
            asked.append(len(of))
            who.add(id(self))
            return judge_all(self, of)

        def spy_looped(self: Check, of: Array, judge_looped: Any = judge_looped) -> Any:
            asked.append(len(of))
            who.add(id(self))
            return judge_looped(self, of)

        monkeypatch.setattr(kind, "judge", spy)
        monkeypatch.setattr(kind, "judge_looped", spy_looped)
    whole = np.repeat(load_figure().neutral_points[None], 3, axis=0)
    judge(checks, whole)
    assert min(asked) > 0 and len(who) < len(checks)
    judge(checks, points)
    assert min(asked) > 0
