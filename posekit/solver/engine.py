"""The compiled solver where it was built, its NumPy reference elsewhere: one interface."""

from __future__ import annotations

import warnings
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

from posekit.geometry import Array, Ints
from posekit.solver import reference
from posekit.solver.problem import Problem

try:
    compiled: Any = import_module("posekit.solver._compiled")
except ImportError:
    compiled = None


def backend() -> str:
    """Return which solver runs: ``compiled`` or ``reference``."""
    return "reference" if compiled is None else "compiled"


@cache
def _warn_once() -> None:
    warnings.warn(
        "posekit was installed without its compiled solver: noisy frames take about 20 times as long; install a "
        "C++ compiler (apt-get install g++) and reinstall posekit",
        UserWarning,
        stacklevel=4,
    )


def run(name: str, problem: Problem, *arguments: Any) -> Any:
    """Call a function of `posekit.solver.reference`, or its compiled twin, about the frames of a problem."""
    if compiled is None:
        _warn_once()
        return getattr(reference, name)(problem.records, problem.limits, *arguments)
    numbers = None if problem.limits is None else problem.limits.numbers
    return getattr(compiled, name)(problem.records, numbers, *arguments)


def descend(
    problem: Problem,
    which: Ints,
    start: Array,
    parts: int,
    *,
    most: int = 40,
    hopeless: Array | None = None,
    damping: Array | None = None,
) -> tuple[Array, Array, Array]:
    """Minimise chi2 from N starts; see `posekit.solver.reference.descend`."""
    limit = np.full(len(which), np.inf) if hopeless is None else hopeless
    damped = np.full(len(which), reference.FIRST_DAMPING) if damping is None else damping
    x, chi2, damped = run("descend", problem, which, start, parts, most, limit, damped)
    return x, chi2, damped
