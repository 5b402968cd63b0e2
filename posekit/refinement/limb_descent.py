"""Limbs refined by themselves, with the trunk held: four independent searches in each column."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.geometry.batch_last import backward
from posekit.refinement.descent import REFINEMENT_DAMPING
from posekit.refinement.equations import DIAGONAL_FLOOR, eliminate
from posekit.refinement.limb_terms import Chains, limb_chi2, limb_terms
from posekit.refinement.looped_descent import looped_limbs, settings_of
from posekit.refinement.problem import BLOCK_POSTURES, RefinementProblem
from posekit.refinement.state import moved_limbs


def fit_limbs(
    problem: RefinementProblem,
    chains: Chains,
    chi2: Array,
    used: NDArray[np.bool_],
    *,
    steps: int,
    precision: float,
    hopeless: float,
) -> None:
    """Minimise each limb's chi2 (4, M) over its own directions and lengths, in place; it never increases.

    The damping is that of `posekit.refinement.descent`, whose docstring says why the loop is its own; here four
    searches stand beside each other in a column. A limb is left where it is when its next step promises less than
    `precision`, or when its chi2 is beyond `hopeless` and the next step does not promise to halve it. Only those that
    are `used` (4, M) are looked at.
    """
    settings = settings_of(REFINEMENT_DAMPING, DIAGONAL_FLOOR, steps, precision, hopeless)
    left = looped_limbs(problem, chains, chi2, used, settings)
    if left is None or left.any():
        kept = used if left is None else left
        stepped_limbs(problem, chains, chi2, kept, steps=steps, precision=precision, hopeless=hopeless)


def stepped_limbs(
    problem: RefinementProblem,
    chains: Chains,
    chi2: Array,
    used: NDArray[np.bool_],
    *,
    steps: int,
    precision: float,
    hopeless: float,
) -> None:
    """Do what `fit_limbs` does with all limbs at once, step by step."""
    n = chains.start.shape[2]
    search = _LimbSearch(
        problem=problem,
        chains=chains,
        chi2=chi2,
        used=used,
        damping=np.full((4, n), REFINEMENT_DAMPING.initial),
        watch=np.zeros((4, 4, n), dtype=np.int8),
        precision=precision,
        hopeless=hopeless,
    )
    rows = np.flatnonzero((used & (chi2 > precision)).any(axis=0))
    for _ in range(steps):
        left: list[NDArray[np.intp]] = []
        for at in range(0, len(rows), BLOCK_POSTURES):
            part = rows[at : at + BLOCK_POSTURES]
            left.append(part[_advance(search, part)])
        rows = np.concatenate(left) if left else rows[:0]
        if not rows.size:
            break


@dataclass(frozen=True, kw_only=True, eq=False)
class _LimbSearch:
    """The limbs (4, M) of a search, and how far it has come: arrays are changed in place."""

    problem: RefinementProblem
    chains: Chains
    chi2: Array
    used: NDArray[np.bool_]
    damping: Array
    watch: NDArray[np.int8]
    precision: float
    hopeless: float


def _advance(search: _LimbSearch, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Take a step with the limbs of some columns, in place; return which columns have limbs that are not done."""
    chains, chi2, used, damping, watch = search.chains, search.chi2, search.used, search.damping, search.watch
    problem = search.problem.take(rows)
    now, watched, value, damped = chains.take(rows), watch[..., rows], chi2[:, rows], damping[:, rows]
    terms = limb_terms(problem, now, watched if watched.any() else None)
    block = eliminate(terms.matrix, terms.coupling[:, :0], terms.gradient, damped, DIAGONAL_FLOOR)
    step = -backward(block.factor, block.right[:, -1].copy())
    gain = (block.right[:, -1] ** 2).sum(axis=0) + (block.damped * step * step).sum(axis=0) - terms.slack
    watching = (watched != 0).any(axis=0)
    light = damped <= REFINEMENT_DAMPING.light
    done = (damped > REFINEMENT_DAMPING.largest) | ((gain <= search.precision) & (light | watching))
    done |= (value > search.hopeless) & (gain < 0.5 * value) & ~watching
    done |= ~used[:, rows]
    if done.all():
        return np.zeros(len(rows), dtype=np.bool_)
    step *= ~done
    directions, lengths = moved_limbs(now.directions, now.lengths, step, terms.tangents)
    trial, passed = limb_chi2(problem, now._replace(directions=directions, lengths=lengths))
    better = (trial <= value) & ~done
    new = np.where((watched == 0) & ~better & ~done, passed, 0)
    ran = new.any(axis=0)
    growth = np.where(ran | done, 1.0, REFINEMENT_DAMPING.growth)
    damping[:, rows] = REFINEMENT_DAMPING.updated(damped, better, value - trial, gain, growth)
    watch[..., rows] = np.where(better | done, 0, watched + new)
    chi2[:, rows] = np.where(better, trial, value)
    chains.directions[..., rows] = np.where(better[:, None, None], directions, now.directions)
    chains.lengths[..., rows] = np.where(better[:, None], lengths, now.lengths)
    return np.asarray(~done.all(axis=0))
