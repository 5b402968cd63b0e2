"""Checks laid out in plain arrays, as compiled loops read them: where their points are, and what their rules say."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from types import ModuleType
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from posekit.compiled.frame_kernels import MOST_POINTS, MOST_PRESUMED, NUMBERS, PATHS
from posekit.geometry import Array
from posekit.tree.bits import path_of, support_of
from posekit.tree.check import Check, Rule, Ruled

Indices = NDArray[np.int32]
Table = NDArray[np.int64]

MOST_VERDICTS = 1 << 16
"""Verdicts that are remembered of a frame: of more the memory is not worth it."""


class Places(NamedTuple):
    """Where the points of a check are.

    Attributes
    ----------
    tips, bits : int array (S,)
        Joints whose paths, of each so many last branches, decide.
    joints, first : int array (P,)
        Each point's joint, and the column of its first candidate.
    """

    tips: Indices
    bits: Indices
    joints: Indices
    first: Indices


class Programme(NamedTuple):
    """Rules as `posekit.compiled.frame_kernels.grow` takes them.

    Attributes
    ----------
    kernels : module
        The rules' own.
    levels, checks, tips, places, numbers
        As told there; the numbers are w.
    verdicts : int
        How many are to be remembered.
    """

    kernels: ModuleType
    levels: Table
    checks: Table
    tips: Table
    places: Table
    numbers: Array
    verdicts: int

    @property
    def arrays(self) -> tuple[Array, ...]:
        """What the loop takes, in its order; the numbers, beside which it writes, are its own."""
        return (self.levels, self.checks, self.tips, self.places, self.numbers.copy())  # type: ignore[return-value]


@lru_cache(maxsize=1024)
def places_of(
    points: tuple[int, ...], parents: tuple[int, ...], first: tuple[int, ...], columns: int
) -> Places:
    """Find the points of a check among so many columns of candidates; the last is a point that is not known."""
    joints = len(parents)
    tips: list[tuple[int, int]] = []
    known: set[int] = set()
    for joint in reversed(support_of(points, parents)):
        new = [one for one in path_of(joint, parents) if one not in known]
        if new:
            tips.append((joint, len(new)))
            known.update(new)
    found = [
        (p, first[p]) if p < joints else (joints, min(first[-1] + p - joints, columns - 1)) for p in points
    ]
    return Places(
        *(np.array([pair[k] for pair in tips], dtype=np.int32) for k in (0, 1)),
        *(np.array([pair[k] for pair in found], dtype=np.int32) for k in (0, 1)),
    )


def programme_of(checks: Sequence[Sequence[Check]], places: Sequence[Sequence[Places]]) -> Programme | None:
    """Lay out checks by level, and where their points are; None where one has no rule, or another's kernels."""
    flat = [check for at in checks for check in at]
    if not flat or not all(hasattr(check, "rule") for check in flat):
        return None
    rules: list[Rule] = [cast(Ruled, check).rule for check in flat]
    if any(rule.kernels is not rules[0].kernels for rule in rules):
        return None
    where = [each for at in places for each in at]
    count, joints = len(rules), len(checks)
    table = np.zeros((count, 6), dtype=np.int64)
    tips = np.zeros((count, max(len(each.tips) for each in where), 3), dtype=np.int64)
    points = np.zeros((count, max(len(each.joints) for each in where), 2), dtype=np.int64)
    verdicts, at = 0, NUMBERS
    for c, (rule, each) in enumerate(zip(rules, where, strict=True)):
        table[c] = rule.kind, rule.presumed, len(each.tips), len(each.joints), verdicts, at
        below = np.cumsum(each.bits[::-1])[::-1] - each.bits
        tips[c, : len(each.tips)] = np.stack([PATHS + each.tips, (1 << each.bits) - 1, below], axis=-1)
        points[c, : len(each.joints), 0] = np.where(each.joints < joints, each.joints, -1)
        points[c, : len(each.joints), 1] = each.first
        at += len(rule.numbers)
        verdicts += 1 << int(each.bits.sum())
    levels = np.cumsum([0, *(len(at) for at in checks)], dtype=np.int64)
    if verdicts > MOST_VERDICTS or points.shape[1] > MOST_POINTS or table[:, 1].max() > MOST_PRESUMED:
        return None
    numbers = np.concatenate([np.zeros(NUMBERS), *(rule.numbers for rule in rules)])
    return Programme(rules[0].kernels, levels, table, tips, points, numbers, verdicts)
