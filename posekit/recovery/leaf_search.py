"""Leaves refined, the likeliest first: those that hold the probability that is asked, and no more."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.recovery.certified import Contradiction, contradictions
from posekit.recovery.factored import FactoredLeaves
from posekit.recovery.listing import Listing, likeliest, masses
from posekit.recovery.refined import RefinedSurvivors
from posekit.recovery.survival import LeafOutcomes
from posekit.refinement import ObservedFrames, Refined, merge
from posekit.refinement.descent import CHI2_PRECISION, MAX_STEPS
from posekit.refinement.limb_fitting import SearchSettings
from posekit.refinement.merging import INDISTINCT_SQUARE, SAME_SIDES_METRES, leaders_of
from posekit.refinement.refine import BegunRefinement, begin_refinement
from posekit.refinement.refined import REJECTION_PROBABILITY
from posekit.tree import Check

HOPELESS_CHI2: Final = 60.0
"""A chi2 beyond which a leaf is given up unless the next step promises to halve it."""

HOPELESS_CHI2_AT_WALLS: Final = 250.0
"""The same where limits couple angles: they bend, and a single step promises less."""

LEAVES_AT_ONCE: Final = 60_000
"""Leaves that are refined together: each takes some kilobytes on the way."""

MAX_LISTING_ROUNDS: Final = 4
"""Times that bodies are taken in likeliest first, before all that are left of a frame are."""


def refine_leaves(
    sight: ObservedFrames,
    postures: Array,
    head: Array,
    hypothesis: NDArray[np.intp],
    frame: NDArray[np.intp],
    checks: Sequence[Check],
    listing: Listing,
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
    """Some leaves, their trunks and limbs refined by themselves, of which the likeliest are refined as whole bodies.

    What whole bodies come to is foretold from their trunks and limbs; those that hold the probability asked for, of
    what is foretold, are refined, and more until those which pass hold it.
    """

    def __init__(
        self,
        begun: BegunRefinement,
        frame: NDArray[np.intp],
        known: NDArray[np.bool_],
        checks: Sequence[Check],
        listing: Listing,
    ) -> None:
        count = len(frame)
        self.begun, self.frame, self.known = begun, frame, known
        self.checks, self.listing = checks, listing
        self.p, self.group = begun.promised_p.copy(), np.unique(frame, return_inverse=True)[1].reshape(-1)
        self.explained, self.legal, self.done = (np.zeros(count, dtype=np.bool_) for _ in range(3))
        self.contradicted: list[Contradiction] = []
        self.score = np.where(np.isfinite(begun.promised) & ~begun.search.hopeless, 0.0, -np.inf)
        self.twin = np.arange(count)
        if not listing.all:
            self._foretell()

    def outcomes(self) -> LeafOutcomes:
        """Refine, reject, merge and list."""
        rows, parts = [np.arange(0)], []
        for turn in range(MAX_LISTING_ROUNDS + 1):
            chosen = self._chosen(every=turn == MAX_LISTING_ROUNDS)
            if not (len(chosen) or turn == 0):
                break
            rows.append(chosen)
            parts.append(self._refine(chosen))
        row = np.concatenate(rows)
        refined = Refined.joined(parts, self.begun.search.problem.take(row))
        order = np.argsort(row)
        row, refined = row[order], refined.select(order)
        merged = merge(
            refined, keep=self.legal[row], indistinct=INDISTINCT_SQUARE if self._uncertain else 0.0
        )
        waiting = ~self.done & np.isfinite(self.score)
        listed, unlisted, share = self._listed(row[merged.rows], waiting)
        merged = merged.take(np.flatnonzero(listed[row[merged.rows]]))
        kept = np.zeros(len(self.frame), dtype=np.bool_)
        kept[row[merged.rows]] = True
        return LeafOutcomes(
            p=self.p,
            contradicted=tuple(self.contradicted),
            explained=self.explained,
            kept=kept,
            unlisted=unlisted,
            share=share,
            survivors=RefinedSurvivors.of(merged, self.known[row]),
            made_of=(FactoredLeaves.of(self.begun, self.frame, self.legal | waiting),),
        )

    @property
    def _uncertain(self) -> bool:
        """Whether lengths are, so that one branch may have a valley of postures."""
        return bool(self.begun.observed.size_deviation) and self.begun.observed.root is not None

    def _foretell(self) -> None:
        """Score leaves by what is foretold of them; what one more step does not explain, by its trunk alone."""
        open_ = np.flatnonzero(np.isfinite(self.score))
        begun = self.begun
        chi2 = np.where(self.p >= REJECTION_PROBABILITY, begun.promised, begun.search.least)[open_]
        joints = begun.joints[open_]
        self.score[open_] = self.listing.score(joints, chi2, self.frame[open_])
        if self._uncertain:
            order = np.lexsort((-self.score[open_], self.frame[open_]))
            leader = leaders_of(self.frame[open_][order], joints[order], 0.0, SAME_SIDES_METRES)
            self.twin[open_[order]] = open_[order][leader]
            self.explained[self.twin != np.arange(len(self.twin))] = True

    def _chosen(self, *, every: bool) -> NDArray[np.intp]:
        """Return the leaves to be refined next; all that are left of frames which lack some, if `every`."""
        own = self.twin == np.arange(len(self.twin))
        waiting = ~self.done & np.isfinite(self.score) & own
        if self.listing.all:
            return np.flatnonzero(waiting)
        mass, group = masses(np.where(self.done & ~self.legal | ~own, -np.inf, self.score), self.group)
        total = np.bincount(group, mass)
        left = np.bincount(group, np.where(waiting, mass, 0.0), len(total))
        # Half of what may be left out is for those that are never looked at: of the rest the likeliest are listed.
        spare = np.asarray(0.5 * (1.0 - self.listing.coverage) * total)
        short = left > spare
        wanted = waiting & short[group]
        return np.flatnonzero(wanted if every else likeliest(np.where(wanted, mass, 0.0), group, spare))

    def _refine(self, chosen: NDArray[np.intp]) -> Refined:
        """Refine some leaves as whole bodies, and judge them."""
        part = replace(self.begun.finish(chosen), frame=self.frame[chosen])
        likely = part.explained()
        self.done[chosen], self.p[chosen] = True, part.p
        self.explained[chosen] = self.legal[chosen] = likely
        rows = chosen[likely]
        joints = np.where(self.known[rows, :, None], part.joints[likely], np.nan)
        found = contradictions(self.checks, np.concatenate([joints, part.head[likely]], axis=1), rows)
        for one in found:
            self.legal[one.row] = False
        self.contradicted += found
        legal = self.legal[chosen]
        if not self.listing.all:
            rows = chosen[legal]
            self.score[rows] = self.listing.score(part.joints[legal], part.chi2[legal], self.frame[rows])
            # What would have become one with a body that fails is looked at by itself.
            alone = self.done[self.twin] & ~self.legal[self.twin] & ~self.done
            self.twin[alone] = np.flatnonzero(alone)
            self.explained[alone] = False
        return part

    def _listed(
        self, rows: NDArray[np.intp], waiting: NDArray[np.bool_]
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_], Array]:
        """Choose those of the merged leaves, at `rows`, that are listed; others are `waiting` (N,) to be refined.

        Returns
        -------
        listed, unlisted : bool array (N,)
            Those, and those that might have been.
        share : array (N,)
            What share of its frame's probability each of both has, as far as is known.
        """
        listed = np.zeros(len(self.frame), dtype=np.bool_)
        listed[rows] = True
        if self.listing.all:
            return listed, np.zeros_like(listed), np.zeros(len(listed))
        waiting = waiting & (self.twin == np.arange(len(self.twin)))
        mass, group = masses(np.where(listed | waiting, self.score, -np.inf), self.group)
        total = np.bincount(group, mass)
        left = np.bincount(group, np.where(waiting, mass, 0.0), len(total))
        spare = np.maximum((1.0 - self.listing.coverage) * total - left, 0.0)
        first = likeliest(np.where(listed, mass, 0.0), group, spare)
        share = mass / np.maximum(total, np.finfo(float).tiny)[group]
        return first, (listed | waiting) & ~first, share


def blocks(frame: NDArray[np.intp], most: int) -> Iterator[slice]:
    """Yield runs of whole frames with no more rows than are treated together, or one frame; at least one."""
    starts = np.flatnonzero(np.diff(frame, prepend=-1))
    ends = [*starts[1:].tolist(), len(frame)]
    begin = 0
    for k, end in enumerate(ends):
        if k + 1 == len(ends) or ends[k + 1] - begin > most:
            yield slice(begin, end)
            begin = end
