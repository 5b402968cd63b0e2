"""The search in stages: different trunks, different limbs on them, and the survivors that they make up."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from posekit.cameras import Array
from posekit.refinement.descent import BLOCK, Descent, descend
from posekit.refinement.equations import chains_of, evaluate
from posekit.refinement.factors import Factors
from posekit.refinement.limb_descent import fit_limbs
from posekit.refinement.limb_terms import Chains, limb_chi2
from posekit.refinement.problem import Problem
from posekit.refinement.start import limb_directions, relift, sides, state_of
from posekit.refinement.state import State
from posekit.refinement.together import join, put_together


class Found(NamedTuple):
    """Where the search ended, and the chi2 (N,) with which it began."""

    descent: Descent
    first: Array


def search(
    problem: Problem,
    postures: Array,
    skull: Array | None,
    factors: Factors,
    *,
    steps: int,
    precision: float,
    hopeless: float,
) -> Found:
    """Refine postures (N, 14, 3) and heads (N, 5, 3); chi2 is never more than it was.

    Torso and hips alone first; then each limb, laid on its rays again to the sides that it had; then the survivors that
    they make up, by one joint step, and from there by `descend` where the quadratic was not to be trusted.
    """
    one = factors.trunk
    begin = state_of(problem.anatomy, postures[one], None if skull is None else skull[one])
    alone, rows = problem.take(one).trunk_alone(), problem.take(one[factors.row_trunk])
    on_rows = begin.take(factors.row_trunk)
    directions = limb_directions(postures, factors.row_from, on_rows)
    limbs = chains_of(on_rows._replace(directions=directions))
    first = _first(alone, rows, begin, limbs, factors)
    trunks = descend(alone, begin, steps=steps, precision=precision)
    far = sides(rows.optics, limbs)
    held = chains_of(trunks.state.take(factors.row_trunk)._replace(directions=directions))
    fit = fit_limbs(rows, relift(rows, held, far), steps, precision, hopeless)
    joined = join(problem, rows, trunks, fit, factors, precision=precision, hopeless=hopeless)
    taken = trunks.steps[factors.trunk_of] + 1
    found = Descent(joined.state, joined.chi2, taken, joined.settled, joined.folds, joined.active)
    worse = ~(found.chi2 <= first)
    if worse.any():
        back = np.flatnonzero(worse)
        found.state.put(back, put_together(begin, limbs, factors).take(back))
        found.chi2[back] = first[back]
    rest = np.flatnonzero(worse | (~found.settled & (found.chi2 <= hopeless)))
    if rest.size:
        more = descend(
            problem.take(rest), found.state.take(rest), steps=steps, precision=precision, hopeless=hopeless
        )
        found.state.put(rest, more.state)
        found.steps[rest] += more.steps
        found.chi2[rest], found.settled[rest] = more.chi2, more.settled
        found.folds[rest], found.active[rest] = more.folds, more.active
    return Found(found, first)


def _first(alone: Problem, rows: Problem, begin: State, limbs: Chains, factors: Factors) -> Array:
    """Return the chi2 of survivors as they were given (N,), from their trunks' and their limbs'."""
    trunk, limb = np.empty(len(factors.trunk)), np.empty((4, len(factors.row_trunk)))
    for at in range(0, len(trunk), BLOCK):
        part = np.arange(at, min(at + BLOCK, len(trunk)))
        trunk[part] = evaluate(alone.take(part), begin.take(part))[0]
    for at in range(0, limb.shape[1], BLOCK):
        part = np.arange(at, min(at + BLOCK, limb.shape[1]))
        limb[:, part] = limb_chi2(rows.take(part), limbs.take(part))[0]
    chi2 = trunk[factors.trunk_of]
    for k in range(4):
        chi2 = chi2 + limb[k, factors.row_of[k]]
    return np.asarray(chi2)
