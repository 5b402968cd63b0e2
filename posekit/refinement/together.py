r"""The joint step of survivors whose trunk and limbs have each been refined alone.

At its own minimum the trunk is quadratic, :math:`\chi^2_0 + \delta^T H \delta`, and each limb with its own unknowns
eliminated too, in the shift of its start and the turn of its part. Their sum is minimised for each survivor: one
system of nine (or eighteen) unknowns. Where chi2 then is what the quadratic promised, the survivor is done; where not,
`posekit.refinement.descent` goes on from there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.refinement.descent import BLOCK, Descent
from posekit.refinement.equations import FLOOR, assemble, eliminate, evaluate, left_over, linearise
from posekit.refinement.factors import Factors
from posekit.refinement.limb_descent import LimbFit
from posekit.refinement.limb_terms import Chains, limb_terms
from posekit.refinement.problem import Problem
from posekit.refinement.small import backward
from posekit.refinement.state import State, Step, moved
from posekit.refinement.trunk_terms import start_ways, trunk_terms

AGREES = 20.0
"""Times the precision that a further step may gain where a survivor is taken for done. The quadratic's error e, of its
promise g, leaves about e^2 / g."""


class Together(NamedTuple):
    """Survivors after their joint step.

    Attributes
    ----------
    state : State
    chi2 : array (N,)
    settled : bool array (N,)
    folds, active : int array (N,)
        Of the limbs alone, before the step.
    """

    state: State
    chi2: Array
    settled: NDArray[np.bool_]
    folds: NDArray[np.intp]
    active: NDArray[np.intp]


class _Trunks(NamedTuple):
    """Of each trunk.

    Attributes
    ----------
    matrix, gradient : array (T, C, C), (T, C)
    head, head_slope : array (T, 3), (T, 3, 6), or (T, 0), (T, 0, 6) without a head
        The head's own step, and how that follows the trunk's.
    """

    matrix: Array
    gradient: Array
    head: Array
    head_slope: Array


class _Limbs(NamedTuple):
    """Of each limb of each row.

    Attributes
    ----------
    matrix, gradient : array (4, M, C, C), (4, M, C)
        What it adds to the trunk's.
    step, slope : array (4, M, U), (4, M, U, C)
        Its own step, and how that follows the trunk's.
    tangents : array (4, 2, 2, 3, M)
    folds, active : bool array (4, 2, M), int array (4, M)
    """

    matrix: Array
    gradient: Array
    step: Array
    slope: Array
    tangents: Array
    folds: NDArray[np.bool_]
    active: NDArray[np.intp]


def join(
    problem: Problem,
    rows: Problem,
    trunks: Descent,
    fit: LimbFit,
    factors: Factors,
    *,
    precision: float,
    hopeless: float,
) -> Together:
    """Put survivors together from trunks and limbs, and take their joint step where a limb pulls at its trunk.

    Parameters
    ----------
    problem : Problem
        Of N survivors.
    rows : Problem
        Of M rows of limbs.
    trunks : Descent
        T trunks, each at its own minimum.
    fit : LimbFit
        The rows' limbs, each at its own.
    factors : Factors
    precision, hopeless : float
        See `posekit.refinement.descent.descend`.
    """
    state = put_together(trunks.state, fit.chains, factors)
    by_limb = np.stack([fit.chi2[k, factors.row_of[k]] for k in range(4)])
    chi2 = trunks.chi2[factors.trunk_of] + by_limb.sum(axis=0)
    limbs = _limb_tables(rows, trunks.state.take(factors.row_trunk), fit.chains)
    folds = np.sum([limbs.folds[k][:, factors.row_of[k]].sum(axis=0) for k in range(4)], axis=0)
    active = trunks.active[factors.trunk_of] + np.sum(
        [limbs.active[k, factors.row_of[k]] for k in range(4)], axis=0
    )
    settled = trunks.settled[factors.trunk_of] & (by_limb <= precision).all(axis=0)
    busy = np.flatnonzero(~settled & (by_limb < hopeless).all(axis=0) & np.isfinite(chi2))
    trunk_tables = _trunk_tables(problem.take(factors.trunk), trunks.state) if busy.size else None
    for at in range(0, len(busy), BLOCK):
        part = busy[at : at + BLOCK]
        if trunk_tables is not None:
            step, gain = _joint_step(trunk_tables, limbs, factors, part)
            tangents = np.stack([limbs.tangents[k][..., factors.row_of[k, part]] for k in range(4)])
            trial = moved(state.take(part), step, tangents)
            value, _ = evaluate(problem.take(part), trial)
            better = value <= chi2[part]
            off = value - (chi2[part] - gain)
            settled[part] = better & (off * off <= AGREES * precision * np.maximum(gain, precision))
            good = np.flatnonzero(better)
            state.put(part[good], trial.take(good))
            chi2[part[good]] = value[good]
    return Together(state, chi2, settled, folds, active)


def put_together(trunks: State, chains: Chains, factors: Factors) -> State:
    """Return survivors (N) from trunks (T) and rows of limbs (M)."""
    directions = np.stack([chains.directions[k][..., factors.row_of[k]] for k in range(4)])
    lengths = np.stack([chains.lengths[k][..., factors.row_of[k]] for k in range(4)])
    return trunks.take(factors.trunk_of)._replace(directions=directions, limbs=lengths)


def _joint_step(
    trunks: _Trunks, limbs: _Limbs, factors: Factors, part: NDArray[np.intp]
) -> tuple[Step, Array]:
    """Solve for the joint step of some survivors, and the decrease of chi2 that it promises."""
    which, rows = factors.trunk_of[part], factors.row_of[:, part]
    matrix, gradient = trunks.matrix[which], trunks.gradient[which]
    for k in range(4):
        matrix += limbs.matrix[k, rows[k]]
        gradient += limbs.gradient[k, rows[k]]
    trunk = -np.linalg.solve(matrix, gradient[..., None])
    gain = -np.einsum("nc,nc->n", trunk[..., 0], gradient)
    steps = np.stack([limbs.step[k, rows[k]] + (limbs.slope[k, rows[k]] @ trunk)[..., 0] for k in range(4)])
    head = None
    if trunks.head.shape[1]:
        head = (trunks.head[which] + (trunks.head_slope[which] @ trunk[:, :6])[..., 0]).T
    return Step(
        np.ascontiguousarray(trunk[..., 0].T), np.ascontiguousarray(steps.transpose(2, 0, 1)), head
    ), gain


def _trunk_tables(problem: Problem, state: State) -> _Trunks:
    parts = []
    alone = problem.trunk_alone()
    n = state.root.shape[1]
    for at in range(0, n, BLOCK):
        rows = np.arange(at, min(at + BLOCK, n))
        arrow = assemble(linearise(alone.take(rows), state.take(rows)), 0.0)
        index = np.arange(len(arrow.gradient))
        arrow.matrix[index, index] += FLOOR
        head, slope = np.zeros((0, len(rows))), np.zeros((0, 6, len(rows)))
        if arrow.head is not None:
            both = -backward(arrow.head.factor, arrow.head.right.copy())
            head, slope = both[:, -1], both[:, :-1]
        parts.append(_Trunks(*(_rows_first(array) for array in (arrow.matrix, arrow.gradient, head, slope))))
    return _Trunks(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def _limb_tables(problem: Problem, trunks: State, chains: Chains) -> _Limbs:
    n = chains.start.shape[2]
    parts = []
    for at in range(0, max(n, 1), BLOCK):
        rows = np.arange(at, min(at + BLOCK, n))
        part = problem.take(rows)
        terms = limb_terms(part, chains.take(rows))
        block = eliminate(terms.matrix, terms.coupling, terms.gradient, 0.0, FLOOR)
        start, push = left_over(block, terms.start, terms.start_gradient)
        ways = start_ways(trunk_terms(part, trunks.take(rows)))
        carried = np.einsum("ijln,ljcn->licn", start, ways)
        slope = -backward(block.factor, block.right.copy())
        parts.append(
            _Limbs(
                np.ascontiguousarray(np.einsum("licn,lidn->lncd", ways, carried)),
                np.ascontiguousarray(np.einsum("licn,iln->lnc", ways, push)),
                np.ascontiguousarray(slope[:, -1].transpose(1, 2, 0)),
                np.ascontiguousarray(np.einsum("uiln,licn->lnuc", slope[:, :-1], ways)),
                terms.tangents,
                terms.folds,
                (terms.crossed != 0).sum(axis=0),
            )
        )
    axes = (1, 1, 1, 1, 4, 2, 1)
    return _Limbs(
        *(
            np.concatenate(arrays, axis=axis)
            for arrays, axis in zip(zip(*parts, strict=True), axes, strict=True)
        )
    )


def _rows_first(array: Array) -> Array:
    """Move the batch to the first axis."""
    return np.ascontiguousarray(np.moveaxis(array, -1, 0))
