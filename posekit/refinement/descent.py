"""Levenberg-Marquardt over a batch of postures, until each is settled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.refinement.elimination import reduce, step
from posekit.refinement.equations import Equations, Watch, linearise
from posekit.refinement.problem import Problem
from posekit.refinement.state import State, Step, moved

STEPS = 20
"""Steps after which a posture is left where it is."""

DAMPING = 1e-4
"""Fraction of the diagonal that is added to it, at first."""

LEAST, MOST = 1e-12, 1e6

LIGHT = 0.1
"""Damping up to which a small promise means that there is nothing left to gain."""

SLOWER, FASTER = 8.0, 0.1

ROUND = 4
"""Steps after which those that are not settled are gathered into new blocks."""

BLOCK = 256
"""Postures worked on at once: their matrices stay in the processor's cache."""

TINY = 1e-300

PRECISION = 1e-3
"""Promised decrease of chi2 that ends the search."""


class Descent(NamedTuple):
    """Where the search ended.

    Attributes
    ----------
    state : State
    chi2 : array (N,)
    steps : int array (N,)
    settled : bool array (N,)
    folds, active : int array (N,)
        How many segments are held at right angles to their rays, and how many limits are felt.
    """

    state: State
    chi2: Array
    steps: NDArray[np.intp]
    settled: NDArray[np.bool_]
    folds: NDArray[np.intp]
    active: NDArray[np.intp]


def descend(
    problem: Problem, start: State, *, steps: int = STEPS, precision: float = PRECISION, hopeless: float = np.inf
) -> Descent:
    """Minimise chi2 from postures; it never increases.

    Levenberg 1944, Marquardt 1963, damping after Nielsen 1999. A posture is settled where a step promises less
    than `precision` of chi2, or no step decreases it. It is given up where chi2 is beyond `hopeless` and the next
    step does not promise to halve it.
    """
    n = start.root.shape[1]
    state = State(*(array.copy() for array in start))
    found = Descent(
        state,
        np.full(n, np.inf),
        np.zeros(n, dtype=np.intp),
        np.zeros(n, dtype=np.bool_),
        np.zeros(n, dtype=np.intp),
        np.zeros(n, dtype=np.intp),
    )
    damping = np.full(n, DAMPING)
    rows = np.arange(n)
    for begin in range(0, steps, ROUND):
        left = []
        for at in range(0, len(rows), BLOCK):
            part = rows[at : at + BLOCK]
            count = min(ROUND, steps - begin)
            block = _Block(problem.take(part), state.take(part), damping[part], precision, hopeless)
            left.append(part[block.run(count)])
            state.put(part, block.state)
            damping[part] = block.damping
            found.chi2[part], found.settled[part] = block.chi2, block.settled
            found.steps[part] += block.taken
            found.folds[part], found.active[part] = block.folds, block.active
        rows = np.concatenate(left) if left else rows
        if not rows.size:
            break
    return found


class _Block:
    """Some postures that take steps together."""

    def __init__(self, problem: Problem, state: State, damping: Array, precision: float, hopeless: float) -> None:
        self.problem, self.state, self.damping = problem, state, damping
        self.precision, self.hopeless = precision, hopeless
        n = len(damping)
        self.chi2, self.settled = np.full(n, np.inf), np.zeros(n, dtype=np.bool_)
        self.taken, self.folds, self.active = np.zeros((3, n), dtype=np.intp)

    def run(self, steps: int) -> NDArray[np.intp]:
        """Take steps; return which postures are not done."""
        rows = np.arange(len(self.damping))
        part, now, watch = self.problem, self.state.take(rows), Watch.none(len(rows))
        here = linearise(part, now)
        self._note(rows, here)
        watching = np.zeros(len(rows), dtype=np.bool_)
        for _ in range(steps):
            chi2, damping = self.chi2[rows], self.damping[rows]
            change, gain = step(here, reduce(here, damping))
            gain = gain - here.slack
            ended = (damping > MOST) | ((gain <= self.precision) & (damping <= LIGHT) & ~watching)
            self.settled[rows[ended]] = True
            ended |= ~np.isfinite(chi2) | ((chi2 > self.hopeless) & (gain < 0.5 * chi2) & ~watching)
            if ended.any():
                left = np.flatnonzero(~ended)
                rows = rows[left]
                if not rows.size:
                    break
                here, part, now, watch = here.take(left), part.take(left), now.take(left), watch.take(left)
                change = Step(*(array[..., left] for array in change))
                gain, watching, chi2, damping = gain[left], watching[left], chi2[left], damping[left]
            trial = moved(now, change, here.tangents)
            there = linearise(part, trial)
            self.taken[rows] += 1
            better = there.chi2 <= chi2
            # A step that ran into a limit is taken anew, with that limit in its equations.
            new = [np.where((old == 0) & ~better, it, 0) for old, it in zip(watch, there.crossed, strict=True)]
            ran = np.logical_or.reduce([array.reshape(-1, len(rows)).any(axis=0) for array in new])
            # Nielsen 1999: less damping where the decrease is what was predicted, more where it is not.
            with np.errstate(invalid="ignore"):
                ratio = np.clip((chi2 - there.chi2) / np.maximum(gain, TINY), 0.0, 1.0)
            factor = np.where(better, np.maximum(1.0 - (2.0 * ratio - 1.0) ** 3, FASTER), np.where(ran, 1.0, SLOWER))
            self.damping[rows] = np.maximum(damping * factor, LEAST)
            good = np.flatnonzero(better)
            if len(good) == len(rows):
                here, now = there, trial
            elif len(good):
                here.put(good, there.take(good))
                now.put(good, trial.take(good))
            self.state.put(rows[good], now.take(good))
            self._note(rows[good], here.take(good))
            for mine, theirs in zip(watch, new, strict=True):
                mine[..., good] = 0
                mine += theirs
            watching = (watching | ran) & ~better
            if ran.any():
                again = np.flatnonzero(ran)
                here.put(again, linearise(part.take(again), now.take(again), watch.take(again)))
        return rows

    def _note(self, rows: NDArray[np.intp], here: Equations) -> None:
        self.chi2[rows], self.folds[rows] = here.chi2, here.folds.sum(axis=(0, 1))
        self.active[rows] = here.crossed.count()
