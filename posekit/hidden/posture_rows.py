"""Judging postures by checks without writing the postures out: their points come from different tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.tree import Check, Findings

Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

METRES_PER_RADIAN = 0.3
"""Metres for a radian: what makes violations in metres and in degrees comparable."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PostureRows:
    """N postures, each point of which stands in a table of its own.

    Parameters
    ----------
    count : int
        How many postures there are: N.
    columns : mapping of int to (array (k, 3), int array (N,) or None)
        By point: its table, and the row of it that each posture has; None where they are the same.
    """

    count: int
    columns: Mapping[int, tuple[Array, Index | None]]

    @staticmethod
    def of(points: Array, index: Index | None = None) -> PostureRows:
        """Take all points of postures (k, P, 3), or of some of them."""
        count = len(points) if index is None else len(index)
        return PostureRows(count=count, columns={p: (points[:, p], index) for p in range(points.shape[1])})

    def with_(self, columns: Mapping[int, tuple[Array, Index | None]]) -> PostureRows:
        """Replace some points."""
        return PostureRows(count=self.count, columns={**self.columns, **columns})

    def take(self, points: Sequence[int], rows: Index) -> Array:
        """Place some points in some rows (len(rows), len(points), 3)."""
        placed = np.empty((len(rows), len(points), 3))
        for column, point in enumerate(points):
            table, index = self.columns[point]
            placed[:, column] = table[rows if index is None else index[rows]]
        return placed


def judge_rows(checks: Sequence[Check], rows: PostureRows) -> tuple[Mask, Array]:
    """Ask checks one after the other, each about the rows that passed so far.

    Returns
    -------
    alive : bool array (N,)
        The rows that no check rejects.
    violation : array (N,)
        How far, in radians, a row is outside the first bound that rejected it, metres counted as `METRES_PER_RADIAN`;
        0 where none did. A hint where to look closer, never a proof.
    """
    violation = np.zeros(rows.count)
    left: Index = np.arange(rows.count)
    for check in checks:
        if not len(left):
            break
        findings = check.judge(rows.take(check.points, left))
        bad = np.asarray(findings.violated.any(axis=1))
        if bad.any():
            violation[left[bad]] = _violation(findings, check.unit)[bad]
            left = left[~bad]
    alive = np.zeros(rows.count, dtype=bool)
    alive[left] = True
    return alive, violation


def _violation(findings: Findings, unit: str) -> Array:
    outside = np.fmax.reduce(np.where(findings.violated, -findings.margin, 0.0), axis=1)
    scale = {"deg": np.pi / 180.0, "m": 1.0 / METRES_PER_RADIAN}.get(unit, 1.0)
    return np.asarray(np.maximum(outside * scale, np.finfo(np.float64).tiny))
