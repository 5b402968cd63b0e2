"""Leaves refined, the likeliest first: those that hold the probability that is asked, and no more."""

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

MAX_LISTING_ROUNDS: Final = 4
"""Times that bodies are taken in likeliest first, before all that are left of a frame are."""


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
        listing: BodyListing,
    ) -> None:
        count = len(frame)
        self.begun, self.frame, self.known = begun, frame, known
        self.checks, self.listing = checks, listing
        self.p, self.group = begun.promised_p.copy(), np.unique(frame, return_inverse=True)[1].reshape(-1)
        self.row, self.refined = np.arange(0), replace(begun.finish(np.arange(0)), frame=np.arange(0))
        self.explained, self.done, self.leads = (np.zeros(count, dtype=np.bool_) for _ in range(3))
        self.contradicted: list[Contradiction] = []
        possible = (self.p >= REJECTION_PROBABILITY) & ~begun.search.hopeless
        self.score = np.where(possible, 0.0, -np.inf)
        # Where lengths vary a branch may have a valley of postures, in which searches stop here and there.
        vary = begun.search.problem.shape_weight is not None
        self.alike = alike(begun, frame) if vary else np.arange(count)
        if not listing.all:
            self.joints = begun.joints
            self._rate(np.flatnonzero(possible), begun.promised[possible])

    def outcomes(self) -> LeafOutcomes:
        """Refine, reject, merge and list."""
        for turn in range(MAX_LISTING_ROUNDS + 1):
            chosen = self._chosen(every=turn == MAX_LISTING_ROUNDS)
            if not (len(chosen) or turn == 0):
                break
            self._refine(chosen)
            self._merge()
        listed, share = self._listed(self.row[self.merged.rows])
        merged = self.merged.take(np.flatnonzero(listed[self.row[self.merged.rows]]))
        legal = np.isfinite(self.score)
        unlisted = legal.copy()
        unlisted[self.row[merged.group >= 0]] = False
        return LeafOutcomes(
            p=self.p,
            contradicted=tuple(self.contradicted),
            explained=self.explained | legal,
            kept=listed,
            unlisted=unlisted,
            share=share,
            survivors=RefinedSurvivors.of(merged, self.known[self.row]),
            made_of=(FactoredLeaves.of(self.begun, self.frame, legal),),
        )

    def _rate(self, rows: NDArray[np.intp], chi2: Array) -> None:
        """Score some leaves as they are now."""
        self.score[rows] = self.listing.score(self.joints[rows], chi2, self.frame[rows])

    def _merge(self) -> None:
        """Make one of what became one, of all leaves that passed so far."""
        self.merged = merge(self.refined, told=self.alike[self.row])
        self.leads[self.done] = False
        self.leads[self.row[self.merged.rows]] = True

    def _lead(self) -> None:
        """Find which of the leaves that are not refined stand for themselves: others would become one with these."""
        waiting = ~self.done & np.isfinite(self.score)
        told = np.zeros(len(self.frame), dtype=np.bool_)
        told[self.alike[self.row]] = True
        rows = np.flatnonzero(waiting & ~told[self.alike])
        rows = rows[np.lexsort((-self.p[rows], self.alike[rows]))]
        waiting[:] = False
        waiting[rows[np.diff(self.alike[rows], prepend=-1) > 0]] = True
        self.leads = np.where(self.done, self.leads, waiting)

    def _chosen(self, *, every: bool) -> NDArray[np.intp]:
        """Return the leaves to be refined next; all that are left of frames which lack some, if `every`."""
        if self.listing.all:
            return np.flatnonzero(np.isfinite(self.score) & ~self.done)
        self._lead()
        share, left = self._shares(self.leads)
        # A tenth of what may be left out is for those that are only foretold: of the rest the likeliest are listed.
        spare = np.full(len(left), 0.1 * (1.0 - self.listing.coverage))
        wanted = ~self.done & self.leads & (left > spare)[self.group]
        return np.flatnonzero(wanted if every else likeliest(np.where(wanted, share, 0.0), self.group, spare))

    def _shares(self, among: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Return what share of its frame's probability each of some leaves has (N,), and those not refined (F,)."""
        some = among & np.isfinite(self.score)
        share = np.where(some, softmax(np.where(some, self.score, -np.inf), self.group), 0.0)
        return share, np.asarray(np.bincount(self.group, np.where(self.done, 0.0, share)), dtype=np.float64)

    def _refine(self, chosen: NDArray[np.intp]) -> None:
        """Refine some leaves as whole bodies, and judge them."""
        part = replace(self.begun.finish(chosen), frame=self.frame[chosen])
        likely = part.explained()
        self.done[chosen], self.p[chosen], self.explained[chosen] = True, part.p, likely
        rows = chosen[likely]
        joints = np.where(self.known[rows, :, None], part.joints[likely], np.nan)
        found = contradictions(self.checks, np.concatenate([joints, part.head[likely]], axis=1), rows)
        legal = np.zeros(len(self.frame), dtype=np.bool_)
        legal[rows] = True
        for one in found:
            legal[one.row] = False
        self.contradicted += found
        own = legal[chosen]
        self.score[chosen[~own]] = -np.inf
        part = part.select(own)
        row = np.concatenate([self.row, chosen[own]])
        joined = Refined.joined([self.refined, part], self.begun.search.problem.take(row))
        order = np.argsort(row)
        self.row, self.refined = row[order], joined.select(order)
        if not self.listing.all:
            self.joints[chosen[own]] = part.joints
            self._rate(chosen[own], part.chi2)

    def _listed(self, rows: NDArray[np.intp]) -> tuple[NDArray[np.bool_], Array]:
        """Choose those of the merged leaves, at `rows`, that are listed.

        Returns
        -------
        bool array (N,)
            Those.
        array (N,)
            What share of its frame's probability each leaf has that is listed, or leads others that are not.
        """
        listed = np.zeros(len(self.frame), dtype=np.bool_)
        listed[rows] = True
        if self.listing.all:
            return listed, np.zeros(len(listed))
        share, left = self._shares(listed | (~self.done & self.leads))
        spare = np.maximum(1.0 - self.listing.coverage - left, 0.0)
        return likeliest(np.where(listed, share, 0.0), self.group, spare), share


def blocks(frame: NDArray[np.intp], most: int) -> Iterator[slice]:
    """Yield runs of whole frames with no more rows than are treated together, or one frame; at least one."""
    starts = np.flatnonzero(np.diff(frame, prepend=-1))
    ends = [*starts[1:].tolist(), len(frame)]
    begin = 0
    for k, end in enumerate(ends):
        if k + 1 == len(ends) or ends[k + 1] - begin > most:
            yield slice(begin, end)
            begin = end
