"""The two ways to bend a limb: half a turn about itself, and the joint below it bent the other way."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from posekit.geometry import Array
from posekit.robots.configuration_space import HINGE_MODELS
from posekit.robots.kinematics import Kinematics

GRID_ANGLES: Final = 720
"""Angles at which it is looked which bend places the points alike."""

NEAR_METRES: Final = 0.02
"""Metres by which the points may then be off: robots' axes miss each other by so much. A descent closes it."""

GENERIC_BEND: Final = 0.7
"""Radians: a bend in no special position."""


class Flip(NamedTuple):
    """Two hinges, one above the other, by where they stand in q; `total` is what the two bends add up to."""

    turn: int
    bend: int
    total: float

    def apply(self, q: Array) -> Array:
        """Return configurations (N, nq) with the limb bent the other way."""
        other = q.copy()
        other[:, self.turn] += np.pi
        other[:, self.bend] = self.total - q[:, self.bend]
        return other


def find_flips(kinematics: Kinematics) -> tuple[Flip, ...]:
    """Find the hinges that place all points alike in two ways: an upper arm's rotation and the elbow below it.

    Parameters
    ----------
    kinematics : Kinematics
        The model and its points.
    """
    model = kinematics.model
    flips = []
    for joint in range(2, model.njoints):
        above = model.parents[joint]
        hinges = all(model.joints[k].shortname() in HINGE_MODELS for k in (above, joint))
        moved = kinematics.moved_by[:, model.idx_vs[joint]] if hinges else np.zeros(0, dtype=np.bool_)
        if not moved.any():
            continue
        turn, bend = int(model.idx_qs[above]), int(model.idx_qs[joint])
        q = kinematics.generic[:1].copy()
        q[:, bend] = GENERIC_BEND
        other = np.repeat(q, GRID_ANGLES, axis=0)
        other[:, turn] += np.pi
        other[:, bend] = np.linspace(-np.pi, np.pi, GRID_ANGLES, endpoint=False)
        apart = kinematics.positions(other)[:, moved] - kinematics.positions(q)[:, moved]
        off = np.linalg.norm(apart, axis=2).max(axis=1)
        best = int(np.argmin(off))
        if off[best] < NEAR_METRES:
            flips.append(Flip(turn, bend, float(GENERIC_BEND + other[best, bend])))
    return tuple(flips)
