r"""The joint step of a trunk and limbs that have each been refined alone.

At its own minimum the trunk is quadratic, :math:`\chi^2_0 + \delta^T H \delta`, and each limb with its own unknowns
eliminated too, in the shift of its start and the turn of its part. Their sum is minimised for each assembly: one
system of nine (or eighteen) unknowns. Where chi2 then is what the quadratic promised, it is done; where not,
`posekit.refinement.descent` goes on from there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.geometry.batch_last import backward
from posekit.refinement.equations import DIAGONAL_FLOOR, assemble, eliminate, left_over, linearise
from posekit.refinement.limb_terms import Chains, limb_terms
from posekit.refinement.looped_descent import looped_limb_tables, looped_trunk_tables
from posekit.refinement.problem import BLOCK_POSTURES, RefinementProblem
from posekit.refinement.state import PostureState, PostureStep
from posekit.refinement.trunk_terms import start_jacobian, trunk_terms


class TrunkTables(NamedTuple):
    """What the joint step needs of each trunk, laid out before limbs are added.

    Attributes
    ----------
    matrix, gradient : array (T, C, C), (T, C)
        The quadratic of each trunk: half its Hessian, and half its slope.
    head, head_slope : array (T, 3), (T, 3, 6), or (T, 0), (T, 0, 6) without a head
        The head's own step, and how that follows the trunk's.
    """

    matrix: Array
    gradient: Array
    head: Array
    head_slope: Array


class LimbTables(NamedTuple):
    """What the joint step needs of the limbs of each column.

    Attributes
    ----------
    matrix, gradient : array (4, M, C, C), (4, M, C)
        What it adds to the trunk's.
    step, slope : array (4, M, U), (4, M, U, C)
        Its own step, and how that follows the trunk's.
    tangents : array (4, 2, 2, 3, M)
        Unit vectors along which the limbs' upper and lower segments turn, two each.
    folds, active : int array (4, M)
        Its segments at right angles to their rays, its limits that are felt.
    """

    matrix: Array
    gradient: Array
    step: Array
    slope: Array
    tangents: Array
    folds: NDArray[np.intp]
    active: NDArray[np.intp]


def joint_step(
    trunks: TrunkTables, limbs: LimbTables, which: NDArray[np.intp], columns: NDArray[np.intp]
) -> tuple[PostureStep, Array, Array]:
    """Solve for the joint step of trunks (N,) and limbs in some columns (4, N), -1 for none.

    Returns
    -------
    PostureStep
    array (N,)
        The decrease of chi2 that it promises.
    array (4, 2, 2, 3, N)
        The limbs' tangents.
    """
    matrix, gradient = joint_quadratics(trunks, limbs, which, columns)
    trunk = -np.linalg.solve(matrix, gradient[..., None])
    gain = -np.einsum("nc,nc->n", trunk[..., 0], gradient)
    steps = np.zeros((limbs.step.shape[2], 4, len(which)))
    tangents = np.zeros((4, 2, 2, 3, len(which)))
    for k in range(4):
        rows = np.flatnonzero(columns[k] >= 0)
        own = columns[k, rows]
        steps[:, k, rows] = (limbs.step[k, own] + (limbs.slope[k, own] @ trunk[rows])[..., 0]).T
        tangents[k][..., rows] = limbs.tangents[k][..., own]
    head = None
    if trunks.head.shape[1]:
        head = (trunks.head[which] + (trunks.head_slope[which] @ trunk[:, :6])[..., 0]).T
    return PostureStep(np.ascontiguousarray(trunk[..., 0].T), steps, head), gain, tangents


def joint_quadratics(
    trunks: TrunkTables, limbs: LimbTables, which: NDArray[np.intp], columns: NDArray[np.intp]
) -> tuple[Array, Array]:
    """Add up trunks (N,) and limbs in some columns (4, N), -1 for none: matrices (N, C, C) and gradients (N, C)."""
    matrix, gradient = trunks.matrix[which], trunks.gradient[which]
    for k in range(4):
        rows = np.flatnonzero(columns[k] >= 0)
        matrix[rows] += limbs.matrix[k, columns[k, rows]]
        gradient[rows] += limbs.gradient[k, columns[k, rows]]
    return matrix, gradient


def gain_of(matrix: Array, gradient: Array) -> Array:
    """Return the decrease that quadratics (N, C, C), (N, C) promise (N,)."""
    return np.asarray(np.einsum("nc,nc->n", np.linalg.solve(matrix, gradient[..., None])[..., 0], gradient))


def trunk_tables(problem: RefinementProblem, state: PostureState) -> TrunkTables:
    """Tabulate trunks, their limbs left out."""
    looped = looped_trunk_tables(problem, state, DIAGONAL_FLOOR)
    if looped is not None:
        matrix, gradient, follows = looped
        return TrunkTables(matrix, gradient, follows[..., -1], follows[..., :-1])
    return stepped_trunk_tables(problem, state)


def stepped_trunk_tables(problem: RefinementProblem, state: PostureState) -> TrunkTables:
    """Do the same with all trunks at once."""
    parts = []
    alone = problem.trunk_alone()
    n = state.root.shape[1]
    for at in range(0, n, BLOCK_POSTURES):
        rows = np.arange(at, min(at + BLOCK_POSTURES, n))
        arrow = assemble(linearise(alone.take(rows), state.take(rows)), 0.0)
        index = np.arange(len(arrow.gradient))
        arrow.matrix[index, index] += DIAGONAL_FLOOR
        head, slope = np.zeros((0, len(rows))), np.zeros((0, 6, len(rows)))
        if arrow.head is not None:
            both = -backward(arrow.head.factor, arrow.head.right.copy())
            head, slope = both[:, -1], both[:, :-1]
        parts.append(
            TrunkTables(*(_rows_first(array) for array in (arrow.matrix, arrow.gradient, head, slope)))
        )
    return TrunkTables(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def limb_tables(problem: RefinementProblem, trunks: PostureState, chains: Chains) -> LimbTables:
    """Tabulate limbs, each column on its own trunk (M)."""
    looped = looped_limb_tables(problem, trunks, chains, DIAGONAL_FLOOR)
    if looped is None:
        return stepped_limb_tables(problem, trunks, chains)
    matrix, gradient, step, slope, tangents, counts = looped
    along = np.ascontiguousarray(tangents.reshape(4, -1, 2, 2, 3).transpose(0, 2, 3, 4, 1))
    return LimbTables(matrix, gradient, step, slope, along, counts[..., 0], counts[..., 1])


def stepped_limb_tables(problem: RefinementProblem, trunks: PostureState, chains: Chains) -> LimbTables:
    """Do the same with all limbs at once."""
    n = chains.start.shape[2]
    parts = []
    for at in range(0, max(n, 1), BLOCK_POSTURES):
        rows = np.arange(at, min(at + BLOCK_POSTURES, n))
        part = problem.take(rows)
        terms = limb_terms(part, chains.take(rows))
        block = eliminate(terms.matrix, terms.coupling, terms.gradient, 0.0, DIAGONAL_FLOOR)
        start, push = left_over(block, terms.start, terms.start_gradient)
        trunk = trunk_terms(part, trunks.take(rows))
        jacobian = start_jacobian(trunk)
        carried = np.einsum("ijln,ljcn->licn", start[:, :3], jacobian[:, :3])
        for limb in range(4):
            carried[limb, :, trunk.turns[limb]] += start[:, 3:, limb]
        matrix = np.einsum("licn,lidn->lcdn", jacobian[:, :3], carried[:, :3])
        gradient = np.einsum("licn,iln->lcn", jacobian[:, :3], push[:3])
        for limb in range(4):
            matrix[limb, trunk.turns[limb]] += carried[limb, 3:]
            gradient[limb, trunk.turns[limb]] += push[3:, limb]
        slope = -backward(block.factor, block.right.copy())
        parts.append(
            LimbTables(
                np.ascontiguousarray(matrix.transpose(0, 3, 1, 2)),
                np.ascontiguousarray(gradient.transpose(0, 2, 1)),
                np.ascontiguousarray(slope[:, -1].transpose(1, 2, 0)),
                np.ascontiguousarray(np.einsum("uiln,licn->lnuc", slope[:, :-1], jacobian)),
                terms.tangents,
                terms.folds.sum(axis=1),
                (terms.crossed != 0).sum(axis=0),
            )
        )
    axes = (1, 1, 1, 1, 4, 1, 1)
    return LimbTables(
        *(
            np.concatenate(arrays, axis=axis)
            for arrays, axis in zip(zip(*parts, strict=True), axes, strict=True)
        )
    )


def _rows_first(array: Array) -> Array:
    """Move the batch to the first axis."""
    return np.ascontiguousarray(np.moveaxis(array, -1, 0))
