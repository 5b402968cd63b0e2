"""Steps of the compiled tree: branches, and the checks that come with posekit as numbers."""

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

#: Kinds of steps. Numbers of a distance: metres; of a torso: its four joints, and whether its mirror image is
#: undecided; of two capsules: centre and half length of each, both radii, and the distance that they must keep.
BRANCH, DISTANCE, TORSO, PELVIS, LIMB, CAPSULES = range(6)


class Step(NamedTuple):
    """A step of the compiled tree.

    Attributes
    ----------
    places : tuple of str
        Places that it judges.
    numbers : tuple of 25 float
        Kind, limb, tolerance, the joints that are read (eight, -1 for none), and the numbers of the kind.
    limits : record, optional
        Joint ranges (`posekit.solver.Limits.numbers`), which limbs and pelvis are judged by.
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
    """Make a step; `points` and `numbers` are filled up."""
    read = (*points, *(-1,) * (8 - len(points)))
    return Step(
        tuple(places), (kind, limb, tolerance, *read, *numbers, *(0.0,) * (14 - len(numbers))), limits
    )
