"""The search in rounds: different trunks, different limbs on them, and what of these pulls at each other.

A limb that meets its image within its limits pulls at nothing. So survivors that differ only in such limbs share
everything else: each trunk with those limbs that do pull is refined once (`bases`), and the others are laid on their
rays from where it ends (`limb_fitting`). One that no longer can be joins those that pull, in the next round.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.refinement.bases import BaseTables, assemble
from posekit.refinement.descent import DescentResult, descend
from posekit.refinement.equations import chains_of, chi2_of
from posekit.refinement.limb_fitting import Bases, InitialLimbs, LimbsOnBases, SearchSettings, fit_on_bases
from posekit.refinement.limb_terms import Chains, chi2_of_limbs
from posekit.refinement.problem import RefinementProblem
from posekit.refinement.start import limb_directions, sides, state_of
from posekit.refinement.state import PostureState
from posekit.tree.factors import Factors, LimbColumns, Rows, columns_of

MAX_PULLING_ROUNDS = 3
"""Times that limbs which turn out to pull are taken in, before survivors go on one by one."""

MUCH_CHI2 = 9.0
"""A promised chi2 of a trunk with one limb that is not taken at its word."""


class SearchResult(NamedTuple):
    """Where the search ended, and the chi2 (N,) with which it began."""

    descent: DescentResult
    first: Array


class SharedSearch:
    """The search over postures (N, 14, 3) and heads (N, 5, 3), begun: trunks alone, and limbs alone on them.

    Parameters
    ----------
    problem : RefinementProblem
        Of all N.
    postures, head : array
        Where the search starts.
    factors : Factors
        What the postures are made of.
    settings : SearchSettings
        How far it goes.
    """

    def __init__(
        self,
        problem: RefinementProblem,
        postures: Array,
        head: Array | None,
        factors: Factors,
        settings: SearchSettings,
    ) -> None:
        self.problem, self.settings = problem, settings
        one = factors.trunk
        begin = state_of(problem.anatomy, postures[one], None if head is None else head[one])
        own = np.repeat(one[None], 4, axis=0)
        begin = begin._replace(directions=limb_directions(postures, own, begin))
        alone = problem.take(one).trunk_alone()
        columns = columns_of([factors.trunk_of[limb] for limb in factors.limb], len(one))
        whose = np.repeat(one[columns.base][None], 4, axis=0)
        for kind in range(4):
            whose[kind, columns.of[kind]] = factors.limb[kind]
        self.column = np.stack([columns.of[kind][factors.limb_of[kind]] for kind in range(4)])
        on_columns = begin.take(columns.base)
        rows = problem.take(one[columns.base])
        given = chains_of(rows, on_columns._replace(directions=limb_directions(postures, whose, on_columns)))
        self.first = _first(alone, rows, begin, given, factors.trunk_of, self.column)
        self.limbs = InitialLimbs(given.directions, sides(rows.optics, given))
        self.begin, self.columns, self.trunk_of = begin, columns, factors.trunk_of
        trunks = descend(alone, begin, steps=settings.steps, precision=settings.precision)
        self.bases = Bases(trunks, one, np.zeros((4, len(one)), dtype=np.bool_))
        which = np.repeat(np.arange(len(columns.base))[None], 4, axis=0)
        self.fitted = fit_on_bases(problem, self.bases, columns, self.limbs.gather(which), settings)
        self.pull = _at(self.fitted.chi2, self.column, 0.0) > settings.precision
        self.tables = BaseTables.of(problem, self.bases, self.fitted) if self.pull.any() else None

    @cached_property
    def promised(self) -> Array:
        """What chi2 of each posture (N,) comes down to, to second order: of its trunk with the limbs that pull."""
        fitted = self.fitted
        chi2 = self.bases.found.chi2[self.trunk_of] + _at(fitted.chi2, self.column, 0.0).sum(axis=0)
        pulled = np.flatnonzero(self.pull.any(axis=0))
        if self.tables is not None and len(pulled):
            group, one, slots = _groups(
                self.trunk_of[pulled], self.column[:, pulled], self.pull[:, pulled], fitted
            )
            gain = self.tables.gain(self.trunk_of[pulled[one]], slots)
            chi2[pulled] -= gain[group]
        return np.asarray(chi2)

    @cached_property
    def least(self) -> Array:
        """What chi2 of each posture (N,) cannot come below: that of its trunk, with any of its limbs that pull much."""
        least = self.bases.found.chi2[self.trunk_of].copy()
        if self.tables is not None:
            np.maximum(least, _at(self._pairs, self._slots, 0.0).max(axis=0), out=least)
        return least

    @cached_property
    def hopeless(self) -> NDArray[np.bool_]:
        """Which postures (N,) have a trunk, or a limb on it, whose chi2 is hopeless even when both give way."""
        over = ~np.isfinite(self.least) | ~self.bases.open(self.settings)[self.trunk_of]
        if self.tables is not None:
            least = _at(self.tables.least(self.bases, self.fitted), self._slots, 0.0)
            over |= (least > self.settings.hopeless).any(axis=0)
        return over

    @cached_property
    def _slots(self) -> Rows:
        """The place of each posture's limbs (4, N) among those that pull, -1 for the others."""
        return _at(self.fitted.place, np.where(self.pull, self.column, -1), -1)

    @cached_property
    def _pairs(self) -> Array:
        """The chi2 of a trunk with each limb (4, P) that pulls at it, where that promises to be much; else zero.

        Two together are refined to the end: where limits bend, what is promised may be far too much.
        """
        out = np.zeros(self.fitted.pulling.chi2.shape)
        if self.tables is None:
            return out
        promised = self.tables.least(self.bases, self.fitted)
        kind, slot = np.nonzero((promised > MUCH_CHI2) & (promised <= self.settings.hopeless))
        if not len(kind):
            return out
        slots = np.full((4, len(kind)), -1)
        slots[kind, np.arange(len(kind))] = slot
        base = self.fitted.pulling.base[slot]
        pairs = assemble(
            self.problem,
            self.bases,
            base,
            self.bases.leaf[base],
            self.fitted,
            slots,
            self.settings,
            self.tables,
        )
        out[kind, slot] = pairs.found.chi2
        return out

    @property
    def promised_dof(self) -> Rows:
        """How many limits and folds each posture (N,) feels then."""
        found = self.bases.found
        felt = (found.active + found.folds)[self.trunk_of]
        if self.tables is None:
            return felt
        limbs = self.tables.limbs
        return np.asarray(felt + _at(limbs.active + limbs.folds, self._slots, 0).sum(axis=0))

    def finish(self, rows: Rows) -> SearchResult:
        """Refine some of the postures (M,) to the end; chi2 is never more than it was."""
        first, settings = self.first[rows], self.settings
        found, late = self._grow(rows)
        # What trunk and limbs shared may have ended higher than a survivor began: it goes on by itself from its start.
        worse = ~(found.chi2 <= first)
        if worse.any():
            back = np.flatnonzero(worse)
            start = self.begin.take(self.trunk_of[rows[back]])
            directions = self.limbs.gather(self.column[:, rows[back]]).directions
            found.state.put(back, start._replace(directions=directions))
            found.chi2[back] = first[back]
        worse[late] = True
        rest = np.flatnonzero(worse & (found.chi2 <= settings.hopeless))
        if rest.size:
            part = self.problem.take(rows[rest])
            found.put(rest, descend(part, found.state.take(rest), **settings._asdict()))
        return SearchResult(found, first)

    def _grow(self, chosen: Rows) -> tuple[DescentResult, Rows]:
        """Refine some postures (M,) from their bases outward, round by round.

        Return them, and which have limbs that pull after the last round.
        """
        problem, settings, fitted, bases = self.problem, self.settings, self.fitted, self.bases
        n = len(chosen)
        found = DescentResult.nothing(bases.found.state, n)
        leaves, late = np.arange(n), np.arange(0)
        base_of, column, pull = self.trunk_of[chosen], self.column[:, chosen], self.pull[:, chosen]
        origin = column
        for turn in range(MAX_PULLING_ROUNDS + 1):
            each = _at(fitted.chi2, column, 0.0)
            total = bases.found.chi2[base_of] + each.sum(axis=0)
            over = ~np.isfinite(total) | ~bases.open(settings)[base_of]
            tables = None
            if turn == 0:
                tables, over = self.tables, over | self.hopeless[chosen]
            going = pull.any(axis=0) & ~over
            if turn == MAX_PULLING_ROUNDS:
                late, going = leaves[going], np.zeros_like(going)
            done = np.flatnonzero(~going)
            _write(found, leaves[done], bases, base_of[done], fitted, column[:, done], total[done])
            found.settled[leaves[done]] &= ~pull[:, done].any(axis=0)
            left = np.flatnonzero(going)
            if not left.size:
                break
            leaves, base_of, column, pull = leaves[left], base_of[left], column[:, left], pull[:, left]
            group, one, slots = _groups(base_of, column, pull, fitted)
            bases = assemble(
                problem, bases, base_of[one], chosen[leaves[one]], fitted, slots, settings, tables
            )
            base_of = group
            columns, column, which = _columns(
                np.where(pull, -1, column), origin[:, leaves], base_of, len(one)
            )
            fitted = fit_on_bases(problem, bases, columns, self.limbs.gather(which), settings)
            pull = _at(fitted.chi2, column, 0.0) > settings.precision
        return found, late


def _groups(
    base_of: Rows, column: Rows, pull: NDArray[np.bool_], fitted: LimbsOnBases
) -> tuple[Rows, Rows, Rows]:
    """Group survivors (n,) by their bases and by those of their limbs that pull.

    Returns
    -------
    group : int array (n,)
    one : int array (G,)
        A survivor of each.
    slots : int array (4, G)
        Its limbs among those that pull, -1 where one does not.
    """
    slots = _at(fitted.place, np.where(pull, column, -1), -1)
    rank = np.where(pull, slots - np.searchsorted(fitted.pulling.base, base_of) + 1, 0)
    most = int(rank.max()) + 1
    key = base_of.astype(np.int64)
    for kind in range(4):
        key = key * most + rank[kind]
    _, one, group = np.unique(key, return_index=True, return_inverse=True)
    return group.reshape(-1), one, slots[:, one]


def _columns(column: Rows, origin: Rows, base_of: Rows, count: int) -> tuple[LimbColumns, Rows, Rows]:
    """Set limbs that are not yet held (`column` of 0 or more) side by side on `count` new bases.

    Returns
    -------
    columns : LimbColumns
    column : int array (4, n)
        Each survivor's, -1 where its limb is held.
    which : int array (4, M)
        The limb of each column.
    """
    out, bases, limbs, rows = np.full_like(column, -1), [], [], []
    width = int(origin.max()) + 1
    for kind in range(4):
        own = np.flatnonzero(column[kind] >= 0)
        pair, inverse = np.unique(base_of[own] * width + origin[kind, own], return_inverse=True)
        bases.append(pair // width)
        limbs.append(pair % width)
        rows.append((own, inverse.reshape(-1)))
    columns = columns_of(bases, count)
    which = np.zeros((4, len(columns.base)), dtype=np.intp)
    for kind, (own, inverse) in enumerate(rows):
        which[kind, columns.of[kind]] = limbs[kind]
        out[kind, own] = columns.of[kind][inverse]
    return columns, out, which


def _write(
    found: DescentResult,
    rows: Rows,
    bases: Bases,
    base: Rows,
    fitted: LimbsOnBases,
    column: Rows,
    total: Array,
) -> None:
    """Write down survivors: their bases, and the limbs in `column` (4, n) that those do not hold."""
    part = bases.found.take(base)
    for kind in range(4):
        own = np.flatnonzero(column[kind] >= 0)
        part.state.directions[kind][..., own] = fitted.chains.directions[kind][..., column[kind, own]]
        part.state.limbs[kind][..., own] = fitted.chains.lengths[kind][..., column[kind, own]]
    part.chi2[...] = total
    found.put(rows, part)


def _at(table: NDArray[Any], column: Rows, nothing: float) -> NDArray[Any]:
    """Look up limbs (4, n) in a table (4, M) by their columns; -1 is nothing."""
    out = np.full(column.shape, nothing, dtype=table.dtype)
    for kind in range(4):
        own = np.flatnonzero(column[kind] >= 0)
        out[kind, own] = table[kind, column[kind, own]]
    return out


def _first(
    alone: RefinementProblem,
    rows: RefinementProblem,
    begin: PostureState,
    limbs: Chains,
    trunk_of: Rows,
    origin: Rows,
) -> Array:
    """Return the chi2 of survivors as they were given (N,), from their trunks' and their limbs'."""
    trunk, limb = chi2_of(alone, begin), chi2_of_limbs(rows, limbs)
    return np.asarray(trunk[trunk_of] + np.take_along_axis(limb, origin, axis=1).sum(axis=0))
