"""Checks as inequalities between the points of a posture, with derivatives by differences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.remedy.pieces import N_UNKNOWNS, unknowns_between
from posekit.tree import Check

METRES_A_DEGREE: Final = 0.3 * np.pi / 180
"""What a degree counts for beside metres: about the way of a limb's end."""

INSIDE_BOUNDS: Final = {"m": 2e-6, "deg": 1e-4}
"""How far inside its bounds a posture is brought, so that rounding does not reject it."""

NEAR_METRES: Final = 0.08
"""Margins beyond which a bound is not looked at in one step."""

STEP_RADIANS: Final = 1e-6
"""Radians, and metres, by which is differentiated."""

MAX_SLOPE: Final = 100.0
"""The most that a margin follows an unknown: beyond it another way to write the limb is judged."""

MOST_ROWS: Final = 24
"""The most inequalities that one step looks at: those with the least margins."""


class Linearised(NamedTuple):
    """Inequalities that are violated or near, K a posture; rows that a posture does not need have no slope.

    Attributes
    ----------
    excess : array (N,)
        The sum of what all inequalities are violated by, metres.
    value : array (N, K)
        Margins, metres; negative where violated.
    slope : array (N, K, m)
        Their derivatives by the unknowns.
    """

    excess: Array
    value: Array
    slope: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class MarginConstraints:
    """What some checks demand of postures.

    Parameters
    ----------
    checks : sequence of Check
        The checks.
    free : bool
        Whether the points move each by itself (m = 57), not as pieces (m = 36).
    """

    checks: Sequence[Check]
    free: bool = False

    @cached_property
    def _unknowns(self) -> list[NDArray[np.intp]]:
        if self.free:
            return [
                np.array([3 * point + axis for point in check.points for axis in range(3)])
                for check in self.checks
            ]
        return [unknowns_between(check.points) for check in self.checks]

    @property
    def size(self) -> int:
        """How many unknowns there are."""
        return 57 if self.free else N_UNKNOWNS

    def margins(self, points: Array) -> Array:
        """Return all margins (N, K) of postures (N, 19, 3), metres; infinite where undecided."""
        found = [margins_of(check, points[:, list(check.points)]) for check in self.checks]
        return np.concatenate(found, axis=1) if found else np.full((len(points), 0), np.inf)

    def linearised(self, points: Array, jacobian: Array) -> Linearised:
        """Linearise what is violated or near.

        Parameters
        ----------
        points : array (N, 19, 3)
            The postures, metres.
        jacobian : array (N, 19, 3, m)
            The derivatives of the points by the unknowns.
        """
        count = len(points)
        margin = self.margins(points)
        slope = np.zeros((*margin.shape, self.size))
        first = 0
        for check, unknowns in zip(self.checks, self._unknowns, strict=True):
            places = slice(first, first + len(check.places))
            first += len(check.places)
            here = margin[:, places]
            rows = np.flatnonzero((here < NEAR_METRES).any(axis=1))
            if not rows.size:
                continue
            own = points[rows][:, list(check.points)]
            ways = np.moveaxis(jacobian[rows[:, None], list(check.points)][..., unknowns], -1, 0)
            turned = own + STEP_RADIANS * ways
            there = margins_of(check, turned.reshape(-1, *own.shape[1:]))
            there = there.reshape(len(unknowns), len(rows), -1)
            with np.errstate(invalid="ignore"):
                change = (there - here[rows]) / STEP_RADIANS
            change[~(np.abs(change) < MAX_SLOPE)] = 0.0
            slope[rows[:, None, None], np.arange(places.start, places.stop)[None, :, None], unknowns] = (
                np.moveaxis(change, 0, -1)
            )
        excess = -np.minimum(margin, 0.0).sum(axis=1)
        kept = min(MOST_ROWS, margin.shape[1])
        nearest = np.argpartition(margin, kept - 1, axis=1)[:, :kept] if kept else np.zeros((count, 0), int)
        value = np.take_along_axis(margin, nearest, axis=1)
        slope = np.take_along_axis(slope, nearest[..., None], axis=1)
        away = value >= NEAR_METRES
        slope[away] = 0.0
        return Linearised(excess, np.where(away, NEAR_METRES, value), slope)


def margins_of(check: Check, points: Array) -> Array:
    """Return the margins (N, K) of a check's own points, metres; infinite where undecided.

    An axial rotation that a check judges less strictly, because the limb is almost straight, counts less.
    """
    found = check.judge(points)
    tolerance = np.broadcast_to(np.asarray(found.tolerance, dtype=np.float64), found.value.shape)
    margin = found.margin + tolerance
    least = tolerance.min(axis=1, keepdims=True)
    share = np.divide(least, tolerance, out=np.ones_like(margin), where=tolerance > least)
    margin = margin * share - INSIDE_BOUNDS.get(check.unit, 0.0)
    margin = margin * (METRES_A_DEGREE if check.unit == "deg" else 1.0)
    return np.where(np.isnan(margin), np.inf, margin)
