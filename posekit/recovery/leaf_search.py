"""Leaves refined, one of each valley, of which those are listed that hold the probability that is asked."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.ranking.ranking import softmax
from posekit.recovery.certified import Contradiction, contradictions
from posekit.recovery.factored import FactoredLeaves
from posekit.recovery.listing import BodyListing, likeliest
from posekit.recovery.refined import RefinedSurvivors
from posekit.recovery.survival import LeafOutcomes
from posekit.refinement import ObservedFrames, Refined, merge
from posekit.refinement.alike import alike
from posekit.refinement.descent import CHI2_PRECISION, MAX_STEPS
from posekit.refinement.limb_fitting import SearchSettings
from posekit.refinement.refine import BegunRefinement, begin_refinement
from posekit.refinement.refined import REJECTION_PROBABILITY
from posekit.tree import Check

HOPELESS_CHI2: Final = 60.0
"""A chi2 beyond which a leaf is given up unless the next step promises to halve it."""

HOPELESS_CHI2_AT_WALLS: Final = 250.0
"""The same where limits couple angles: they bend, and a single step promises less."""

LEAVES_AT_ONCE: Final = 60_000
"""Leaves that are refined together: each takes some kilobytes on the way."""

P_DECIMALS: Final = 6
"""Decimals of foretold probabilities that tell leaves apart: of fewer, each machine would choose otherwise."""


def refine_leaves(
    sight: ObservedFrames,
    postures: Array,
    head: Array,
    hypothesis: NDArray[np.intp],
    frame: NDArray[np.intp],
    checks: Sequence[Check],
    listing: BodyListing,
    hopeless: float | None = None,
) -> LeafOutcomes:
    """Refine leaves (N, 14, 3) as their hypotheses (N,) were seen; reject, list and merge frame by frame (N,).

    A chi2 is `hopeless` where nothing else is said as `HOPELESS_CHI2` says.
    """
    if hopeless is None:
        hopeless = HOPELESS_CHI2 if sight.walls is None else HOPELESS_CHI2_AT_WALLS
    settings = SearchSettings(MAX_STEPS, CHI2_PRECISION, hopeless)
    parts = []
    for rows in blocks(frame, LEAVES_AT_ONCE):
        start = postures[rows]
        begun = begin_refinement(sight, start, frame=hypothesis[rows], head=head[rows], settings=settings)
        one = _LeafSearch(begun, frame[rows], np.asarray(np.isfinite(start).all(axis=2)), checks, listing)
        parts.append(one.outcomes())
    return LeafOutcomes.joined(parts)


class _LeafSearch:
    """Some leaves, their trunks and limbs refined by themselves, of which one of each valley is refined whole.

    Where lengths vary, a branch has a valley of postures in which searches stop here and there. What whole bodies come
    to is foretold from their trunks and limbs: of each valley that tells it which fits best so and passes, whatever
    share of the probability is listed.
    """

    def __init__(
        self,
        begun: BegunRefinement,
        frame: NDArray[np.intp],
        known: NDArray[np.bool_],
        checks: Sequence[Check],
        listing: BodyListing,
    ) -> None:
        count = len(frame)
        self.begun, self.frame, self.known = begun, frame, known
        self.checks, self.listing = checks, listing
        self.p, self.group = begun.promised_p.copy(), np.unique(frame, return_inverse=True)[1].reshape(-1)
        self.rows, self.parts = [np.arange(0)], list[Refined]()
        self.explained, self.done = (np.zeros(count, dtype=np.bool_) for _ in range(2))
        self.contradicted: list[Contradiction] = []
        self.legal = (self.p >= REJECTION_PROBABILITY) & ~begun.search.hopeless
        vary = begun.search.problem.shape_weight is not None
        self.valley = alike(begun, frame) if vary else np.arange(count)
        self.order = np.lexsort((-np.round(self.p, P_DECIMALS), self.valley))

    def outcomes(self) -> LeafOutcomes:
        """Refine, reject, merge and list."""
        most = 1
        while len(chosen := self._waiting(most)):
            self._refine(chosen)
            most *= 2
        row, refined = self._tellers()
        merged = merge(refined)
        rows = row[merged.rows]
        score = self.listing.score(merged.refined.joints, merged.refined.chi2, self.frame[rows])
        share = np.zeros(len(self.frame))
        share[rows] = softmax(score, self.group[rows])
        whole = np.zeros(len(self.frame), dtype=np.bool_)
        whole[rows] = True
        spare = np.full(int(self.group.max(initial=-1)) + 1, 1.0 - self.listing.coverage)
        listed = whole if self.listing.all else likeliest(share, self.group, spare)
        legal = np.flatnonzero(self.legal)
        number = np.full(int(self.valley.max(initial=-1)) + 1, -1)
        number[self.valley[row]] = merged.group
        merged = replace(merged, group=number[self.valley[legal]])
        return LeafOutcomes(
            p=self.p,
            contradicted=tuple(self.contradicted),
            explained=self.explained | self.legal,
            kept=listed,
            unlisted=whole & ~listed,
            share=share,
            survivors=RefinedSurvivors.of(merged.take(np.flatnonzero(listed[rows])), self.known[row]),
            made_of=(FactoredLeaves.of(self.begun, self.frame, self.legal),),
        )

    def _waiting(self, most: int) -> NDArray[np.intp]:
        """Return the next leaves of each valley that none tells yet, no more than `most` of each."""
        told = np.zeros(len(self.frame), dtype=np.bool_)
        told[self.valley[np.concatenate(self.rows)]] = True
        rows = self.order[(self.legal & ~self.done & ~told[self.valley])[self.order]]
        first = np.diff(self.valley[rows], prepend=-1) > 0
        place = np.arange(len(rows)) - np.flatnonzero(first)[np.cumsum(first) - 1]
        return np.sort(rows[place < most])

    def _refine(self, chosen: NDArray[np.intp]) -> None:
        """Refine some leaves as whole bodies, and judge them."""
        part = replace(self.begun.finish(chosen), frame=self.frame[chosen])
        likely = part.explained()
        self.done[chosen], self.p[chosen], self.explained[chosen] = True, part.p, likely
        rows = chosen[likely]
        joints = np.where(self.known[rows, :, None], part.joints[likely], np.nan)
        found = contradictions(self.checks, np.concatenate([joints, part.head[likely]], axis=1), rows)
        self.legal[chosen] = False
        self.legal[rows] = True
        for one in found:
            self.legal[one.row] = False
        self.contradicted += found
        passed = self.order[(self.legal & self.done)[self.order]]
        tells = np.zeros(len(self.frame), dtype=np.bool_)
        tells[passed[np.diff(self.valley[passed], prepend=-1) > 0]] = True
        own = tells[chosen]
        self.rows.append(chosen[own])
        self.parts.append(part.select(own))

    def _tellers(self) -> tuple[NDArray[np.intp], Refined]:
        """Return the leaves that tell of a valley each, in their order, refined as whole bodies."""
        row = np.concatenate(self.rows)
        if not len(row):
            return row, replace(self.begun.finish(row), frame=self.frame[row])
        order = np.argsort(row)
        joined = Refined.joined(self.parts, self.begun.search.problem.take(row))
        return row[order], joined.select(order)


def blocks(frame: NDArray[np.intp], most: int) -> Iterator[slice]:
    """Yield runs of whole frames with no more rows than are treated together, or one frame; at least one."""
    starts = np.flatnonzero(np.diff(frame, prepend=-1))
    ends = [*starts[1:].tolist(), len(frame)]
    begin = 0
    for k, end in enumerate(ends):
        if k + 1 == len(ends) or ends[k + 1] - begin > most:
            yield slice(begin, end)
            begin = end
