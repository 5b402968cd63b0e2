"""Trunks with the limbs that pull at them, refined together: what many survivors share."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.refinement.descent import DescentResult, descend
from posekit.refinement.equations import chi2_of
from posekit.refinement.figure_numbers import LIMB_ENDS, LIMB_MIDDLES
from posekit.refinement.joint_step import (
    LimbTables,
    TrunkTables,
    gain_of,
    joint_quadratics,
    joint_step,
    limb_tables,
    trunk_tables,
)
from posekit.refinement.limb_fitting import Bases, LimbsOnBases, SearchSettings
from posekit.refinement.problem import BLOCK_POSTURES, RefinementProblem
from posekit.refinement.state import moved
from posekit.tree.factors import Rows

LAST_STEP_GAIN_RATIO = 20.0
"""Times the precision that a further step may gain where a joint step is taken for the last.

The quadratic's error e, of its promise g, leaves about e^2 / g.
"""


MAX_BASE_STEPS = 10
"""The most steps of a base."""


class BaseTables(NamedTuple):
    """The quadratics of trunks, and of the limbs that pull at them."""

    trunks: TrunkTables
    limbs: LimbTables

    @staticmethod
    def of(problem: RefinementProblem, bases: Bases, fitted: LimbsOnBases) -> BaseTables:
        """Tabulate trunks alone and their limbs; `problem` is that of all survivors."""
        pulling = fitted.pulling
        return BaseTables(
            trunk_tables(problem.take(bases.leaf), bases.found.state),
            limb_tables(pulling.problem, bases.found.state.take(pulling.base), pulling.chains),
        )

    def least(self, bases: Bases, fitted: LimbsOnBases) -> Array:
        """Return what chi2 of trunk and one limb can come down to, to second order (4, P)."""
        base = fitted.pulling.base
        out = np.zeros(fitted.pulling.chi2.shape)
        for kind in range(4):
            rows = np.flatnonzero(fitted.pulling.chi2[kind] > 0)
            gain = gain_of(
                self.trunks.matrix[base[rows]] + self.limbs.matrix[kind, rows],
                self.trunks.gradient[base[rows]] + self.limbs.gradient[kind, rows],
            )
            out[kind, rows] = bases.found.chi2[base[rows]] + fitted.pulling.chi2[kind, rows] - gain
        return out

    def gain(self, base: Rows, slots: Rows) -> Array:
        """Return the decrease of chi2 that trunks (G,) with limbs in some slots (4, G), -1 for none, promise (G,)."""
        return gain_of(*joint_quadratics(self.trunks, self.limbs, base, slots))


def assemble(
    problem: RefinementProblem,
    before: Bases,
    base: Rows,
    leaf: Rows,
    fitted: LimbsOnBases,
    slots: Rows,
    settings: SearchSettings,
    tables: BaseTables | None,
) -> Bases:
    """Put bases together with limbs that pull at them, and refine them.

    Parameters
    ----------
    problem : RefinementProblem
        Of all survivors.
    before : Bases
        The bases of the round before.
    base, leaf : int array (G,)
        The base that each starts from, and a survivor of each.
    fitted : LimbsOnBases
        The limbs on those bases.
    slots : int array (4, G)
        Limbs among those that pull, -1 for none.
    tables : BaseTables, optional
        Of trunks and limbs: a joint step is tried first.
    """
    held = before.held[:, base] | (slots >= 0)
    part = _with_limbs(problem.take(leaf), held)
    found = before.found.take(base)
    found.settled[...] = False
    for kind in range(4):
        rows = np.flatnonzero(slots[kind] >= 0)
        own = slots[kind, rows]
        found.state.directions[kind][..., rows] = fitted.pulling.chains.directions[kind][..., own]
        found.state.limbs[kind][..., rows] = fitted.pulling.chains.lengths[kind][..., own]
        found.chi2[rows] += fitted.pulling.chi2[kind, own]
    promised = found.chi2
    if tables is not None:
        promised = _step_together(part, tables, before.found.settled[base], base, slots, found, settings)
    rest = np.flatnonzero(~found.settled & (promised <= settings.hopeless))
    if rest.size:
        few = settings._replace(steps=min(settings.steps, MAX_BASE_STEPS))
        found.put(rest, descend(part.take(rest), found.state.take(rest), **few._asdict()))
    return Bases(found, leaf, held)


def _step_together(
    part: RefinementProblem,
    tables: BaseTables,
    settled: NDArray[np.bool_],
    base: Rows,
    slots: Rows,
    found: DescentResult,
    settings: SearchSettings,
) -> Array:
    """Take the joint step of trunks and limbs, in place; settled is where chi2 is then what it promised.

    Return the chi2 that it promised (G,); where that is hopeless the step is not taken.
    """
    trunks, limbs = tables
    for kind in range(4):
        rows = np.flatnonzero(slots[kind] >= 0)
        found.folds[rows] += limbs.folds[kind, slots[kind, rows]]
        found.active[rows] += limbs.active[kind, slots[kind, rows]]
    promised = np.empty(len(base))
    for at in range(0, len(base), BLOCK_POSTURES):
        rows = np.arange(at, min(at + BLOCK_POSTURES, len(base)))
        step, gain, tangents = joint_step(trunks, limbs, base[rows], slots[:, rows])
        promised[rows] = found.chi2[rows] - gain
        worth = np.flatnonzero(promised[rows] <= settings.hopeless)
        if not worth.size:
            continue
        rows, step, gain, tangents = rows[worth], step.take(worth), gain[worth], tangents[..., worth]
        found.steps[rows] += 1
        trial = moved(found.state.take(rows), step, tangents)
        chi2 = found.chi2[rows]
        value = chi2_of(part.take(rows), trial)
        better = value <= chi2
        off = value - (chi2 - gain)
        # Of the promise g the quadratic missed e: the next step would gain about e^2 / g, less than is worth it.
        agrees = off * off <= LAST_STEP_GAIN_RATIO * settings.precision * np.maximum(gain, settings.precision)
        found.settled[rows] = better & agrees & settled[rows]
        good = np.flatnonzero(better)
        found.state.put(rows[good], trial.take(good))
        found.chi2[rows[good]] = value[good]
    return promised


def _with_limbs(problem: RefinementProblem, held: NDArray[np.bool_]) -> RefinementProblem:
    """Leave those limbs out that are not held (4, N)."""
    weight = problem.weight.copy()
    for joints in (LIMB_MIDDLES, LIMB_ENDS):
        weight[list(joints)] *= held
    return replace(problem, weight=weight, free=~held)
