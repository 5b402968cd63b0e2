"""One interface to both solvers: the compiled one if it was built, otherwise its NumPy reference."""

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
    """Return the name of the solver in use: ``compiled`` or ``reference``."""
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
    """Call a function of the compiled solver, or of `posekit.solver.reference`, on the frames of a problem."""
    if compiled is None:
        _warn_once()
        return getattr(reference, name)(problem, *arguments)
    numbers = None if problem.limits is None else problem.limits.numbers
    return getattr(compiled, name)(problem.records, numbers, *arguments)


def descend(
    problem: Problem,
    which: Ints,
    start: Array,
    parts: int,
    *,
    most: int = 40,
    hopeless: Array | float = np.inf,
    damping: Array | float = reference.FIRST_DAMPING,
) -> tuple[Array, Array, Array]:
    """Minimise chi2 from N starts; see `posekit.solver.reference.descend`."""
    of_starts = (np.broadcast_to(np.float64(one), len(which)) for one in (hopeless, damping))
    x, chi2, damped = run("descend", problem, which, start, parts, most, *of_starts)
    return x, chi2, damped
