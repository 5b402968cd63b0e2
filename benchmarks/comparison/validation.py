"""Verdicts on configurations against the bare calls behind them, on several robots.

Bare is one call of Pinocchio's pool and one vectorised comparison with the limits, of as many threads. The last
number is a whole file's judging (`posekit.validation.validate_postures`), with the pairs and depths of what fails.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pinocchio as pin

from benchmarks.comparison.measure import Chart, Section, Sizes, least, microseconds
from posekit.body.pool import make_pool, n_threads
from posekit.formats.own.postures_q import NamedConfigurations
from posekit.robots import load_robot
from posekit.validation import validate_postures
from posekit.validators import Validator

ROBOT_NAMES = ("stick_figure", "human", "simple_humanoid")
FAILING_SHARE = 0.03
"""Share of the configurations that some check rejects: what real recordings have."""


def section(sizes: Sizes) -> Section:
    """Measure some robots."""
    rows: list[tuple[str, ...]] = []
    ratios: dict[str, float] = {}
    bars: dict[str, float] = {}
    for name in ROBOT_NAMES:
        robot, count = load_robot(name), sizes.configurations
        validator = Validator(robot, checks=("joint-range", "collision"))
        q = mixed(validator, count)
        bare = bare_way(validator, q)
        expected, report = bare(), validator.check(q=q)
        margin = np.abs(np.min([one.margin.min(axis=1) for one in report.judgements[:1]], axis=0))
        equal = (report.invalid == expected) | (margin < 0.01)  # the tolerance of the limits
        given = NamedConfigurations(q=q)
        with one_core():
            bare = bare_way(validator, q)
            costs = least(
                {
                    "bare": bare,
                    "verdicts": lambda v=validator, q=q: v.check(q=q).valid,  # type: ignore[misc]
                    "file": lambda v=validator, g=given: validate_postures(v, g, detail="verdicts"),  # type: ignore[misc]
                },
                2 * sizes.repeats,
            )
        base = costs["bare"].cpu
        pairs = len(validator.describe().get("pairs", ()))
        rows.append(
            (
                name,
                str(pairs),
                microseconds(base, count),
                f"{costs['verdicts'].cpu / base:.2f}",
                f"{costs['file'].cpu / base:.2f}",
                f"{int(equal.sum())} of {count}",
            )
        )
        ratios[f"bare against verdicts, {name}"] = base / costs["verdicts"].cpu
        ratios[f"bare against a file's, {name}"] = base / costs["file"].cpu
        bars |= {f"{name}, {what}": cost.cpu / base for what, cost in costs.items() if what != "bare"}
    return Section(
        title="Validating configurations",
        text=f"{sizes.configurations} configurations, {FAILING_SHARE:.0%} of them outside a limit or colliding; "
        "limits and self-collision, one thread. `verdicts` is `Validator.check(q=…).valid`; `a file's` is everything "
        "that `posekit validate` does with the configurations it has read, with the pairs and depths of those that "
        "fail.",
        head=("robot", "pairs", "bare, µs", "verdicts / bare", "a file's / bare", "verdicts as bare's"),
        rows=rows,
        ratios=ratios,
        charts=(
            Chart(name="validation", title="Validating configurations", y="times the bare calls", bars=bars),
        ),
    )


@contextmanager
def one_core() -> Iterator[None]:
    """Keep this process on one core for a while, so that all ways take one thread: two wait for each other, noisily."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def mixed(validator: Validator, count: int) -> Any:
    """Draw configurations within, or barely outside, the limits, so that a few percent fail."""
    robot = validator.robot
    if robot is None:
        raise SystemExit("a robot is needed; the stick figure can be loaded as one")
    lower, upper = robot.lower[7:], robot.upper[7:]
    drawn = np.tile(pin.neutral(robot.model), (max(2000, count // 10), 1))
    drawn[:, 7:] = np.random.default_rng(0).uniform(lower - 0.01, upper + 0.01, (len(drawn), len(lower)))
    invalid = validator.check(q=drawn).invalid
    rng = np.random.default_rng(1)
    bad = rng.random(count) < FAILING_SHARE
    good_rows = rng.choice(np.flatnonzero(~invalid), count)
    bad_rows = rng.choice(np.flatnonzero(invalid), count)
    return drawn[np.where(bad, bad_rows, good_rows)]


def bare_way(validator: Validator, q: Any) -> Any:
    """Return the calls that a user would write by hand."""
    subject = validator._robot.models.own.subject
    columns, pool = np.asfortranarray(q.T), make_pool(subject.model, subject.geometry)
    lower, upper = subject.lower, subject.upper
    threads = n_threads()

    def bare() -> Any:
        hit = np.asarray(pin.computeCollisionsInParallel(threads, pool, columns, True)).astype(bool)
        return hit | ((q < lower) | (q > upper)).any(axis=1)

    return bare
