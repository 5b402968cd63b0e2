"""Levenberg-Marquardt over a batch of postures, until each is settled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.least_squares import Damping
from posekit.refinement.equations import (
    DIAGONAL_FLOOR,
    LimitSigns,
    evaluate,
    linearise,
    solve,
)
from posekit.refinement.looped_descent import looped_descent, settings_of
from posekit.refinement.problem import BLOCK_POSTURES, RefinementProblem
from posekit.refinement.state import PostureState, moved

MAX_STEPS = 20
"""Steps after which a posture is left where it is."""

REFINEMENT_DAMPING = Damping(initial=1e-4, smallest=1e-12, largest=1e6, growth=8.0, decay=0.1, light=0.1)

CHI2_PRECISION = 1e-2
"""Promised decrease of chi2 that ends the search."""


class DescentResult(NamedTuple):
    """Where the search ended.

    Attributes
    ----------
    state : PostureState
        The postures.
    chi2 : array (N,)
        Their sums of squares.
    steps : int array (N,)
        How many steps each took.
    settled : bool array (N,)
        Whether each is at a minimum.
    folds, active : int array (N,)
        How many segments are held at right angles to their rays, and how many limits are felt.
    """

    state: PostureState
    chi2: Array
    steps: NDArray[np.intp]
    settled: NDArray[np.bool_]
    folds: NDArray[np.intp]
    active: NDArray[np.intp]

    @staticmethod
    def nothing(like: PostureState, n: int) -> DescentResult:
        """Make room for n postures."""
        none = np.zeros(n, dtype=np.intp)
        state = PostureState(*(np.zeros((*array.shape[:-1], n)) for array in like))
        return DescentResult(
            state, np.full(n, np.inf), none, np.zeros(n, dtype=np.bool_), none.copy(), none.copy()
        )

    def take(self, rows: NDArray[np.intp]) -> DescentResult:
        """Return some postures."""
        return DescentResult(self.state.take(rows), *(array[rows] for array in self[1:]))  # type: ignore[arg-type]

    def put(self, rows: NDArray[np.intp], other: DescentResult) -> None:
        """Overwrite some postures; the steps that were taken add up."""
        self.state.put(rows, other.state)
        self.steps[rows] += other.steps
        self.chi2[rows], self.settled[rows] = other.chi2, other.settled
        self.folds[rows], self.active[rows] = other.folds, other.active


def descend(
    problem: RefinementProblem,
    start: PostureState,
    *,
    steps: int = MAX_STEPS,
    precision: float = CHI2_PRECISION,
    hopeless: float = np.inf,
) -> DescentResult:
    """Minimise chi2 from postures; it never increases.

    The damping of `posekit.least_squares`, not its loop: the equations are arrows of blocks that are eliminated, batch
    last; a limit that a step ran into is watched in the next, which is no reason for more damping; and what is hopeless
    is given up before its step is tried.

    A posture is settled where a step promises less
    than `precision` of chi2, be it for a limit in its way, or no step decreases it. It is given up where chi2 is
    beyond `hopeless` and the next step does not promise to halve it.
    """
    looped = looped_descent(
        problem, start, settings_of(REFINEMENT_DAMPING, DIAGONAL_FLOOR, steps, precision, hopeless)
    )
    if looped is None:
        return stepped_descent(problem, start, steps=steps, precision=precision, hopeless=hopeless)
    state, chi2, counts, asked = looped
    found = DescentResult(state, chi2, counts[:, 0], counts[:, 1] > 0, counts[:, 2], counts[:, 3])
    rows = np.flatnonzero(asked)
    if rows.size:
        part = problem.take(rows)
        found.put(
            rows, stepped_descent(part, start.take(rows), steps=steps, precision=precision, hopeless=hopeless)
        )
    return found


def stepped_descent(
    problem: RefinementProblem,
    start: PostureState,
    *,
    steps: int = MAX_STEPS,
    precision: float = CHI2_PRECISION,
    hopeless: float = np.inf,
) -> DescentResult:
    """Do what `descend` does with all postures at once, step by step."""
    search = _BatchDescent(problem, start)
    rows = np.arange(start.root.shape[1])
    for taken in range(steps + 1):
        rows = np.concatenate(
            [
                search.advance(rows[at : at + BLOCK_POSTURES], precision, hopeless, last=taken == steps)
                for at in range(0, max(len(rows), 1), BLOCK_POSTURES)
            ]
        )
        if not rows.size:
            break
    return search.found


class _BatchDescent:
    """All postures, and how far each search has come."""

    def __init__(self, problem: RefinementProblem, start: PostureState) -> None:
        n = start.root.shape[1]
        self.problem, self.state = problem, start.copy()
        self.damping, self.watch = np.full(n, REFINEMENT_DAMPING.initial), LimitSigns.none(n)
        self.watching = np.zeros(n, dtype=np.bool_)
        self.passed = np.zeros(n, dtype=np.intp)
        chi2, active = np.empty(n), np.empty(n, dtype=np.intp)
        for at in range(0, n, BLOCK_POSTURES):
            rows = np.arange(at, min(at + BLOCK_POSTURES, n))
            chi2[rows], passed = evaluate(problem.take(rows), self.state.take(rows))
            active[rows] = passed.passed()
        none = np.zeros(n, dtype=np.intp)
        self.found = DescentResult(
            self.state, chi2, none.copy(), np.zeros(n, dtype=np.bool_), none.copy(), active
        )

    def advance(
        self, rows: NDArray[np.intp], precision: float, hopeless: float, *, last: bool
    ) -> NDArray[np.intp]:
        """Take a step with some postures, unless it is the last time; return which are not done."""
        if not rows.size:
            return rows
        part, now, found = self.problem.take(rows), self.state.take(rows), self.found
        watched = self.watching[rows].any()
        here = linearise(part, now, self.watch.take(rows) if watched else None)
        change, gain = solve(here, self.damping[rows])
        chi2, damping, watching = found.chi2[rows], self.damping[rows], self.watching[rows]
        found.folds[rows] = here.folds()
        light = damping <= REFINEMENT_DAMPING.light
        done = (damping > REFINEMENT_DAMPING.largest) | ((gain <= precision) & (light | watching))
        found.settled[rows] = done
        done |= ~np.isfinite(chi2) | ((chi2 > hopeless) & (gain < 0.5 * chi2) & ~watching)
        if last:
            return rows[:0]
        if done.any():
            left = np.flatnonzero(~done)
            rows = rows[left]
            if not rows.size:
                return rows
            part, now = part.take(left), now.take(left)
            change = change.take(left)
            tangents = None if here.limbs is None else here.limbs.tangents[..., left]
            gain, chi2, damping = gain[left], chi2[left], damping[left]
        else:
            tangents = None if here.limbs is None else here.limbs.tangents
        trial = moved(now, change, tangents)
        value, passed = evaluate(part, trial)
        found.steps[rows] += 1
        better = value <= chi2
        # A step that ran into a limit is taken anew, with that limit in its equations.
        ran = self._run_into(rows, passed, better)
        growth = np.where(ran, 1.0, REFINEMENT_DAMPING.growth)
        self.damping[rows] = REFINEMENT_DAMPING.updated(damping, better, chi2 - value, gain, growth)
        good = np.flatnonzero(better)
        self.state.put(rows[good], trial.take(good))
        found.chi2[rows[good]] = value[good]
        found.active[rows[good]] = passed.take(good).passed()
        return rows

    def _run_into(
        self, rows: NDArray[np.intp], passed: LimitSigns, better: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Watch the limits that a step which was no better ran into (N,); forget them after one that was."""
        ran = np.zeros(len(rows), dtype=np.bool_)
        if better.all() and not self.watching[rows].any():
            return ran
        for mine, theirs in zip(self.watch, passed, strict=True):
            old = mine[..., rows]
            new = np.where((old == 0) & ~better, theirs, 0)
            ran |= new.reshape(-1, len(rows)).any(axis=0)
            mine[..., rows] = np.where(better, 0, old + new)
        self.watching[rows] = (self.watching[rows] | ran) & ~better
        return ran
