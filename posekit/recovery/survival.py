"""Leaves refined, rejected where noise or a check contradicts them, and merged where they became one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.recovery.certified import Contradiction, contradictions
from posekit.recovery.refined import RefinedSurvivors
from posekit.refinement import ObservedFrames, Refined, merge, refine
from posekit.refinement.merging import INDISTINCT_SQUARE
from posekit.refinement.refined import REJECTION_PROBABILITY
from posekit.tree import Check, Leaves
from posekit.tree.leaves import Pruned

HOPELESS_CHI2: Final = 60.0
"""A chi2 beyond which a leaf is given up unless the next step promises to halve it."""

HOPELESS_CHI2_AT_WALLS: Final = 250.0
"""The same where limits couple angles: they bend, and a single step promises less."""

LEAVES_AT_ONCE: Final = 60_000
"""Leaves that are refined together: each takes some kilobytes on the way."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LeafOutcomes:
    """What became of N leaves.

    Parameters
    ----------
    p : array (N,)
        The probability that noise alone gives a chi2 as large.
    contradicted : tuple of Contradiction
        Those that the noise explains and a check contradicts.
    explained, kept : bool array (N,)
        Those that the noise explains, and of those that no check contradicts the likeliest that became one.
    survivors : RefinedSurvivors
        Those kept, in the leaves' order.
    """

    p: Array
    contradicted: tuple[Contradiction, ...]
    explained: NDArray[np.bool_]
    kept: NDArray[np.bool_]
    survivors: RefinedSurvivors

    @staticmethod
    def of(
        refined: Refined,
        known: NDArray[np.bool_],
        explained: NDArray[np.bool_],
        contradicted: Sequence[Contradiction],
    ) -> LeafOutcomes:
        """Reject leaves that noise has not `explained`, then what checks contradict, and merge what became one.

        Joints that are not `known` (N, 14) become NaN.
        """
        legal = explained.copy()
        for one in contradicted:
            legal[one.row] = False
        merged = merge(refined, keep=legal, indistinct=0.0 if refined.size is None else INDISTINCT_SQUARE)
        kept = np.zeros(len(refined), dtype=np.bool_)
        kept[merged.rows] = True
        return LeafOutcomes(
            p=refined.p,
            contradicted=tuple(contradicted),
            explained=explained,
            kept=kept,
            survivors=RefinedSurvivors.of(merged, known),
        )

    @staticmethod
    def joined(parts: list[LeafOutcomes]) -> LeafOutcomes:
        """Put the leaves of one part behind those of the last."""
        p, explained, kept = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("p", "explained", "kept")
        )
        begin = np.cumsum([0, *(len(part.p) for part in parts)])
        contradicted = tuple(
            replace(one, row=one.row + int(first))
            for part, first in zip(parts, begin, strict=False)
            for one in part.contradicted
        )
        survivors = RefinedSurvivors.joined([part.survivors for part in parts])
        return LeafOutcomes(
            p=p, contradicted=contradicted, explained=explained, kept=kept, survivors=survivors
        )

    def prune(self, leaves: Leaves) -> Leaves:
        """Drop the leaves that checks contradict, those that noise cannot explain, and those that became another."""
        number = np.arange(len(self.p))
        for one in self.contradicted:
            gone = np.zeros(len(self.p), dtype=np.bool_)
            gone[one.row] = True
            at = np.searchsorted(one.row, number[gone[number]])
            leaves = drop(leaves, gone[number], replace(one, row=one.row[at]))
            number = number[~gone[number]]
        gone = ~self.kept[number]
        count = int(gone.sum())
        why = Contradiction(
            check="noise",
            where=("unlikely", "merged"),
            unit=("", ""),
            row=number[gone],
            place=np.where(self.explained[number][gone], 1, 0).astype(np.int8),
            value=self.p[number][gone],
            lower=np.full(count, REJECTION_PROBABILITY),
            upper=np.full(count, np.inf),
        )
        return drop(leaves, gone, why)


def refine_leaves(
    sight: ObservedFrames,
    postures: Array,
    head: Array,
    hypothesis: NDArray[np.intp],
    frame: NDArray[np.intp],
    checks: Sequence[Check],
    hopeless: float | None = None,
) -> LeafOutcomes:
    """Refine leaves (N, 14, 3) as their hypotheses (N,) were seen; reject and merge frame by frame (N,).

    A chi2 is `hopeless` where nothing else is said as `HOPELESS_CHI2` says.
    """
    parts = []
    if hopeless is None:
        hopeless = HOPELESS_CHI2 if sight.walls is None else HOPELESS_CHI2_AT_WALLS
    for rows in blocks(frame, LEAVES_AT_ONCE):
        start = postures[rows]
        refined = refine(sight, start, frame=hypothesis[rows], head=head[rows], hopeless=hopeless)
        refined = replace(refined, frame=frame[rows])
        known = np.asarray(np.isfinite(start).all(axis=2))
        explained = refined.explained()
        likely = np.flatnonzero(explained)
        joints = np.where(known[likely, :, None], refined.joints[likely], np.nan)
        found = contradictions(checks, np.concatenate([joints, refined.head[likely]], axis=1), likely)
        parts.append(LeafOutcomes.of(refined, known, explained, found))
    return LeafOutcomes.joined(parts)


def blocks(frame: NDArray[np.intp], most: int) -> Iterator[slice]:
    """Yield runs of whole frames with no more rows than are treated together, or one frame; at least one."""
    starts = np.flatnonzero(np.diff(frame, prepend=-1))
    ends = [*starts[1:].tolist(), len(frame)]
    begin = 0
    for k, end in enumerate(ends):
        if k + 1 == len(ends) or ends[k + 1] - begin > most:
            yield slice(begin, end)
            begin = end


def drop(leaves: Leaves, gone: NDArray[np.bool_], why: Contradiction) -> Leaves:
    """Drop leaves (N,), of which `why` says what is against them, in their order."""
    if not gone.any():
        return leaves
    pruned = Pruned(
        level=leaves.level,
        frame=leaves.frame[gone],
        code=leaves.code[gone],
        check=why.check,
        where=why.where,
        unit=why.unit[0],
        place=why.place,
        value=why.value,
        lower=why.lower,
        upper=why.upper,
    )
    return leaves.keep(~gone, leaves.frame, leaves.code, leaves.level, (*leaves.pruned, pruned))
