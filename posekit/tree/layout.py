"""Checks laid out in plain arrays, as compiled loops read them: where their points are, and what their rules say."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.compiled.frame_kernels import MAX_POINTS, MAX_PRESUMED, NUMBERS_AT, PATH_COLUMNS
from posekit.geometry import Array
from posekit.tree.bits import path_of, support_of
from posekit.tree.check import Check, Rule

Table = NDArray[np.int64]

MAX_VERDICTS = 1 << 16
"""Verdicts that are remembered of a frame: of more the memory is not worth it."""


class PointTables(NamedTuple):
    """Where the points of a check are.

    Attributes
    ----------
    tips, bits : int array (S,)
        Joints whose paths, of each so many last branches, decide.
    joints, first : int array (P,)
        Each point's joint, and the column of its first candidate.
    choices : int
        How many choices of branches there are.
    """

    tips: Table
    bits: Table
    joints: Table
    first: Table
    choices: int


class Stretch(NamedTuple):
    """A part of the way from the root to the leaves on which only checks with a compiled form are asked.

    Attributes
    ----------
    span : int array (4,)
        The level at whose nodes it begins, and the compiled check that is asked first; the level at whose nodes it
        ends, and the compiled check before which it does.
    level : int
        Where it ends.
    number : int
        Which of all checks is asked then.
    check : Check or None
        That check, which has no compiled form; None at the leaves.
    """

    span: Table
    level: int
    number: int
    check: Check | None

    @property
    def empty(self) -> bool:
        """Whether it ends where it begins."""
        return bool((self.span[:2] == self.span[2:]).all())


class Programme(NamedTuple):
    """Checks as `posekit.compiled.frame_kernels.grow` takes them.

    Attributes
    ----------
    levels, checks, tips, places, numbers
        As described there; `numbers` is its w.
    verdicts : int
        How many verdicts are to be remembered.
    stretches : tuple of Stretch
        From the roots to the leaves: between them those checks are asked that have no compiled form.
    """

    levels: Table
    checks: Table
    tips: Table
    places: Table
    numbers: Array
    verdicts: int
    stretches: tuple[Stretch, ...]

    @property
    def arrays(self) -> tuple[Table, Table, Table, Table, Array]:
        """What the loop takes, in its order; the numbers, beside which it writes, are its own."""
        return (self.levels, self.checks, self.tips, self.places, self.numbers.copy())


@lru_cache(maxsize=1024)
def point_tables(
    points: tuple[int, ...], parents: tuple[int, ...], first: tuple[int, ...], columns: int
) -> PointTables:
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
    choice, place = (np.array(pairs, dtype=np.int64).reshape(-1, 2).T.copy() for pairs in (tips, found))
    return PointTables(
        tips=choice[0],
        bits=choice[1],
        joints=place[0],
        first=place[1],
        choices=1 << sum(bits for _, bits in tips),
    )


def programme_of(
    checks: Sequence[Sequence[Check]], parents: tuple[int, ...], first: tuple[int, ...], columns: int
) -> Programme:
    """Lay out checks by level, for candidates whose joints begin in their `first` of so many columns."""
    rules: list[tuple[int, Rule, tuple[int, ...]]] = []
    stretches: list[Stretch] = []
    levels, begin, number, verdicts = [0], (0, 0), 0, 0
    for level, at in enumerate(checks):
        for check in at:
            tables = point_tables(tuple(check.points), parents, first, columns)
            rule = check.rule
            if (
                rule is not None
                and verdicts + tables.choices <= MAX_VERDICTS
                and len(tables.joints) <= MAX_POINTS
                and rule.presumed <= MAX_PRESUMED
            ):
                rules.append((number, rule, tuple(check.points)))
                verdicts += tables.choices
            else:
                stretches.append(_stretch(begin, (level, len(rules)), number, check))
                begin = (level, len(rules))
            number += 1
        levels.append(len(rules))
    stretches.append(_stretch(begin, (len(checks) - 1, len(rules)), number, None))
    shape = tuple(
        (number, rule.kind, rule.presumed, len(rule.numbers), points) for number, rule, points in rules
    )
    table, tips, places, verdicts = _tables(shape, parents, first, columns)
    numbers = np.concatenate([np.zeros(NUMBERS_AT), *(rule.numbers for _, rule, _ in rules)])
    return Programme(
        np.array(levels, dtype=np.int64), table, tips, places, numbers, verdicts, tuple(stretches)
    )


def _stretch(begin: tuple[int, int], end: tuple[int, int], number: int, check: Check | None) -> Stretch:
    return Stretch(np.array([*begin, *end], dtype=np.int64), end[0], number, check)


@lru_cache(maxsize=64)
def _tables(
    shape: tuple[tuple[int, int, int, int, tuple[int, ...]], ...],
    parents: tuple[int, ...],
    first: tuple[int, ...],
    columns: int,
) -> tuple[Table, Table, Table, int]:
    """Return what `Programme` has of rules: number, kind, what they presume, how many numbers, and points of each.

    Kept, since a frame takes little longer: nobody writes to them.
    """
    count, joints = len(shape), len(parents)
    found = [point_tables(points, parents, first, columns) for *_, points in shape]
    table = np.zeros((count, 7), dtype=np.int64)
    tips = np.zeros((count, max((len(each.tips) for each in found), default=1), 3), dtype=np.int64)
    points = np.zeros((count, max((len(each.joints) for each in found), default=1), 2), dtype=np.int64)
    verdicts, at = 0, NUMBERS_AT
    for c, ((number, kind, presumed, width, _), each) in enumerate(zip(shape, found, strict=True)):
        table[c] = kind, presumed, len(each.tips), len(each.joints), verdicts, at, number
        below = np.cumsum(each.bits[::-1])[::-1] - each.bits
        tips[c, : len(each.tips)] = np.stack([PATH_COLUMNS + each.tips, (1 << each.bits) - 1, below], axis=-1)
        points[c, : len(each.joints), 0] = np.where(each.joints < joints, each.joints, -1)
        points[c, : len(each.joints), 1] = each.first
        at += width
        verdicts += each.choices
    return table, tips, points, verdicts
