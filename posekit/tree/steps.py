"""Steps of the compiled tree: branches, and the checks that come with posekit as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

try:
    compiled: Any = import_module("posekit.tree._compiled")
except ImportError:
    compiled = None

#: A step as the compiled tree reads it: what is asked, at which level, the number of its first reason, the limb, the
#: joints that are read (-1 for none), the tolerance, and numbers of its kind.
STEP: Final = np.dtype(
    [
        ("kind", "f8"),
        ("level", "f8"),
        ("reason", "f8"),
        ("limb", "f8"),
        ("points", "f8", (4,)),
        ("tolerance", "f8"),
        ("numbers", "f8", (14,)),
    ]
)

#: Kinds of steps. Numbers of a distance: metres; of a torso: its four joints, and whether its mirror image is
#: undecided; of two capsules: centre and half length of each, both radii, and the distance that they must keep.
BRANCH, DISTANCE, TORSO, PELVIS, LIMB, CAPSULES = range(6)


class Step(NamedTuple):
    """A step of the compiled tree.

    Attributes
    ----------
    places : tuple of str
        What it judges.
    record : record of `STEP`
    limits : record, optional
        Joint ranges (`posekit.solver.Limits.numbers`), which limbs and pelvis are judged by.
    """

    places: tuple[str, ...]
    record: NDArray[np.void]
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
    """Make a step; parameters are the fields of `STEP`."""
    record = np.zeros((), dtype=STEP)
    record["kind"], record["limb"], record["tolerance"], record["points"] = kind, limb, tolerance, -1
    record["points"][: len(points)] = points
    record["numbers"][: len(numbers)] = numbers
    return Step(tuple(places), record, limits)
