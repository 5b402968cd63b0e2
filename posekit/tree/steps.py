"""Steps of the compiled (C++) tree: branching at a joint, and posekit's own checks, encoded as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

try:
    compiled: Any = import_module("posekit.tree._compiled")
except ImportError:
    compiled = None

#: Kinds of steps. The numbers of a distance are its length. The numbers of a torso are coordinates of its four joints
#: (12), and 1 if joints that fit its mirror image are undecided. The numbers of two capsules are centre and half length
#: of each, sum of their radii, and least distance between them. Lengths are in metres.
BRANCH, DISTANCE, TORSO, PELVIS, LIMB, CAPSULES = range(6)


class Step(NamedTuple):
    """A step of the compiled tree.

    Attributes
    ----------
    places : tuple of str
        Names of the places that the step judges.
    numbers : tuple of 25 float
        Kind of the step, limb, tolerance, indices of up to eight joints that the step reads (padded with -1), and
        fourteen numbers that depend on the kind.
    limits : record, optional
        Joint ranges of limbs and pelvis (`posekit.solver.Limits.numbers`).
    """

    places: tuple[str, ...]
    numbers: tuple[float, ...]
    limits: NDArray[np.void] | None = None


def step(
    kind: int,
    places: Sequence[str],
    *,
    points: Sequence[int] = (),
    tolerance: float = 0.0,
    numbers: Sequence[float] = (),
    limb: int = 0,
    limits: NDArray[np.void] | None = None,
) -> Step:
    """Make a step; pad its points with -1 and its numbers with 0."""
    read = (*points, *(-1,) * (8 - len(points)))
    return Step(
        tuple(places), (kind, limb, tolerance, *read, *numbers, *(0.0,) * (14 - len(numbers))), limits
    )
