"""Leaves as they survive noise and checks: rejected, merged where they became one, listed or too unlikely for that."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.posture_set import PostureSet
from posekit.geometry import Array
from posekit.recovery.certified import Contradiction
from posekit.recovery.factored import FactoredLeaves
from posekit.recovery.refined import RefinedSurvivors
from posekit.refinement.refined import REJECTION_PROBABILITY
from posekit.skeleton import JOINTS
from posekit.tree import Leaves
from posekit.tree.leaves import Pruned


@dataclass(frozen=True, kw_only=True, eq=False)
class LeafOutcomes:
    """What became of N leaves.

    Parameters
    ----------
    p : array (N,)
        The probability that noise alone gives a chi2 as large; of leaves that were not refined, as what is promised.
    contradicted : tuple of Contradiction
        Those that the noise explains and a check contradicts.
    explained, kept : bool array (N,)
        Those that the noise explains, and of those that no check contradicts the likeliest that became one.
    unlisted : bool array (N,)
        Those kept but for being too unlikely to be listed.
    share : array (N,)
        What share of its frame's probability each of these, or of those kept, has.
    survivors : RefinedSurvivors
        Those kept, in the leaves' order.
    made_of : tuple of FactoredLeaves
        The trunks and limbs of leaves, and which of these they are.
    """

    p: Array
    contradicted: tuple[Contradiction, ...]
    explained: NDArray[np.bool_]
    kept: NDArray[np.bool_]
    unlisted: NDArray[np.bool_]
    share: Array
    survivors: RefinedSurvivors
    made_of: tuple[FactoredLeaves, ...]

    @staticmethod
    def joined(parts: list[LeafOutcomes]) -> LeafOutcomes:
        """Put the leaves of one part behind those of the last."""
        arrays = {
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in ("p", "explained", "kept", "unlisted", "share")
        }
        begin = np.cumsum([0, *(len(part.p) for part in parts)])
        contradicted = tuple(
            replace(one, row=one.row + int(first))
            for part, first in zip(parts, begin, strict=False)
            for one in part.contradicted
        )
        return LeafOutcomes(
            **arrays,
            contradicted=contradicted,
            survivors=RefinedSurvivors.joined([part.survivors for part in parts]),
            made_of=tuple(one for part in parts for one in part.made_of),
        )

    def posture_set(self, frame: int) -> PostureSet:
        """Return the set of one frame: the trunks and limbs of the leaves that are kept, or may be explained."""
        own = [part for part in self.made_of if (part.frame == frame).any()]
        return own[0].posture_set(frame) if own else PostureSet.of(np.empty((0, len(JOINTS), 3)))

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
        place = np.where(self.unlisted, 2, np.where(self.explained, 1, 0))
        why = Contradiction(
            check="noise",
            where=("unlikely", "merged", "unlisted"),
            unit=("", "", ""),
            row=number[gone],
            place=place[number][gone].astype(np.int8),
            value=self.p[number][gone],
            lower=np.full(count, REJECTION_PROBABILITY),
            upper=np.full(count, np.inf),
        )
        return drop(leaves, gone, why)


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
