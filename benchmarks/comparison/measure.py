"""Times of several ways in one run, what they ran on, and the sections of a report."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

LISTED_PACKAGES = ("numpy", "pin", "coal", "numba", "mujoco", "pybullet", "python-fcl", "torch")


class Cost(NamedTuple):
    """Seconds of one call: the processor's, and on the clock."""

    cpu: float
    wall: float


def least(ways: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, Cost]:
    """Time ways in turn and keep the least of each: whatever else runs on a shared machine only adds."""
    costs: dict[str, list[Cost]] = {name: [] for name in ways}
    for _ in range(repeats):
        for name, way in ways.items():
            wall, cpu = time.perf_counter(), time.process_time()
            way()
            costs[name].append(Cost(time.process_time() - cpu, time.perf_counter() - wall))
    return {
        name: Cost(min(cost.cpu for cost in all_), min(cost.wall for cost in all_))
        for name, all_ in costs.items()
    }


class Line(NamedTuple):
    """One line of a chart."""

    name: str
    x: Sequence[float]
    y: Sequence[float]


@dataclass(frozen=True, kw_only=True)
class Chart:
    """What a chart shows: bars of one number a name, or lines; logarithmic where `log` names the axis."""

    name: str
    title: str
    y: str
    x: str = ""
    bars: Mapping[str, float] = field(default_factory=dict)
    lines: Sequence[Line] = ()
    log: str = ""


@dataclass(frozen=True, kw_only=True)
class Section:
    """One question of the report.

    Parameters
    ----------
    title, text : str
    head : tuple of str
    rows : sequence of tuple of str
    ratios : dict
        What the gate compares: larger is better, none depends on the machine's speed alone.
    charts : tuple of Chart
    left_out : tuple of str
        What was not measured, each with its reason.
    """

    title: str
    text: str
    head: tuple[str, ...] = ()
    rows: Sequence[tuple[str, ...]] = ()
    ratios: dict[str, float] = field(default_factory=dict)
    charts: tuple[Chart, ...] = ()
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Sizes:
    """How much is measured.

    Parameters
    ----------
    views, brute : int
        Views of the tree's sections, and how many of them brute force judges.
    configurations, slow : int
        Configurations of the pool, and how many of them the engines that are asked from Python judge.
    repeats, starts : int
        Turns of each way; fresh processes of each start.
    memory : int
        Views of the larger of two runs.
    """

    views: int = 2000
    brute: int = 40
    configurations: int = 50_000
    slow: int = 5000
    repeats: int = 5
    starts: int = 5
    memory: int = 100_000


QUICK_SIZES = Sizes(views=500, brute=5, configurations=10_000, slow=1000, repeats=3, starts=2, memory=20_000)
TINY_SIZES = Sizes(views=12, brute=1, configurations=200, slow=20, repeats=1, starts=1, memory=500)


def machine() -> dict[str, Any]:
    """Describe the machine, its load, and the versions of what is compared."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {
        "processor": _processor(),
        "cores": cores,
        "system": platform.system(),
        "python": platform.python_version(),
        "load": round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None,
        "versions": {name: found for name in LISTED_PACKAGES if (found := version(name))},
    }


def version(package: str) -> str:
    """Return the version of an installed package, or nothing."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def microseconds(seconds: float, count: int) -> str:
    """Write a time for each of some, three digits."""
    each = seconds / count * 1e6
    return f"{each:,.0f}" if each >= 100 else f"{each:.3g}"
