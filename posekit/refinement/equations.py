"""The normal equations of whole postures, an arrow of small blocks, and their solution.

Limbs are coupled with the trunk through their starts alone, the head through the root: each is eliminated by itself,
a matrix of four (or six) unknowns, and what remains is a quadratic function of the trunk, whose nine (or eighteen)
unknowns are solved last.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.geometry.batch_last import backward, cholesky, forward
from posekit.refinement.figure_numbers import LIMB_STARTS
from posekit.refinement.head_terms import HeadTerms, head_chi2, head_terms
from posekit.refinement.limb_terms import Chains, LimbTerms, limb_chi2, limb_terms
from posekit.refinement.limits import Signs
from posekit.refinement.looped_descent import looped_chi2
from posekit.refinement.problem import BLOCK_POSTURES, RefinementProblem
from posekit.refinement.state import PostureState, PostureStep, parents, trunk_offsets
from posekit.refinement.trunk_terms import TrunkTerms, start_jacobian, to_unknowns, trunk_chi2, trunk_terms

DIAGONAL_FLOOR = 1e-6
"""Added to diagonals, one over rad^2 or m^2: what nothing determines does not move."""


class LimitSigns(NamedTuple):
    """Limits that are passed, or would be: 1 the upper, -1 the lower, 0 neither.

    Attributes
    ----------
    limbs : int array (4, 4, N)
        By angle and limb.
    hips, head : int array (3, N)
        Of pelvis and neck, by angle.
    """

    limbs: Signs
    hips: Signs
    head: Signs

    @staticmethod
    def none(n: int) -> LimitSigns:
        """Watch nothing."""
        return LimitSigns(*(np.zeros((*shape, n), dtype=np.int8) for shape in ((4, 4), (3,), (3,))))

    def take(self, rows: NDArray[np.intp]) -> LimitSigns:
        """Return some postures."""
        return LimitSigns(*(array[..., rows] for array in self))

    def passed(self) -> NDArray[np.intp]:
        """Count the limits of each posture (N,)."""
        count = (self.limbs != 0).sum(axis=(0, 1))
        return np.asarray(count + (self.hips != 0).sum(axis=0) + (self.head != 0).sum(axis=0), dtype=np.intp)


class Equations(NamedTuple):
    """A problem linearised at some postures; limbs or head are None where they are left out."""

    trunk: TrunkTerms
    limbs: LimbTerms | None
    head: HeadTerms | None

    @property
    def slack(self) -> Array:
        """Squares of limits that are watched, not passed (N,): in the matrices, not in chi2."""
        slack = self.trunk.slack
        if self.limbs is not None:
            slack = slack + self.limbs.slack.sum(axis=0)
        return slack if self.head is None else slack + self.head.slack

    def folds(self) -> NDArray[np.intp]:
        """Count the segments that are held at right angles to their rays (N,)."""
        n = len(self.trunk.chi2)
        return np.zeros(n, dtype=np.intp) if self.limbs is None else self.limbs.folds.sum(axis=(0, 1))


def chains_of(problem: RefinementProblem, state: PostureState, offsets: Array | None = None) -> Chains:
    """Return the limbs of postures, whose trunks' offsets may be known already."""
    offsets = trunk_offsets(state) if offsets is None else offsets
    parent = parents(state, on_torso=problem.legs_on_torso)
    return Chains(state.root + offsets[list(LIMB_STARTS)], parent, state.directions, state.limbs)


def linearise(problem: RefinementProblem, state: PostureState, watch: LimitSigns | None = None) -> Equations:
    """Linearise the problem at postures; limits that are watched are in the matrices though they are not passed."""
    trunk = trunk_terms(problem, state, watch and watch.hips)
    limbs = None
    if not problem.trunk_only:
        limbs = limb_terms(problem, chains_of(problem, state, trunk.offsets), watch and watch.limbs)
    head = None if problem.head_image is None else head_terms(problem, state, watch and watch.head)
    return Equations(trunk, limbs, head)


def evaluate(problem: RefinementProblem, state: PostureState) -> tuple[Array, LimitSigns]:
    """Return chi2 of postures (N,), infinite where a joint that was seen is behind the camera, and limits passed."""
    offsets = trunk_offsets(state)
    passed = LimitSigns.none(state.root.shape[1])
    chi2, hips = trunk_chi2(problem, state, offsets)
    passed.hips[...] = hips
    if not problem.trunk_only:
        by_limb, limbs = limb_chi2(problem, chains_of(problem, state, offsets))
        chi2 += by_limb.sum(axis=0)
        passed.limbs[...] = limbs
    if problem.head_image is not None:
        of_head, head = head_chi2(problem, state)
        chi2 += of_head
        passed.head[...] = head
    return np.where(chi2 < MAX_CHI2, chi2, np.inf), passed


def chi2_of(problem: RefinementProblem, state: PostureState) -> Array:
    """Return chi2 of postures (N,), infinite where a joint that was seen is behind the camera."""
    chi2 = looped_chi2(problem, state)
    rows = np.arange(state.root.shape[1]) if chi2 is None else np.flatnonzero(np.isnan(chi2))
    if chi2 is None:
        chi2 = np.empty(len(rows))
    for at in range(0, len(rows), BLOCK_POSTURES):
        some = rows[at : at + BLOCK_POSTURES]
        chi2[some] = evaluate(problem.take(some), state.take(some))[0]
    return chi2


MAX_CHI2 = 1e150
"""Sums of squares beyond this come from joints behind the camera (`problem.BEHIND_CAMERA_RESIDUAL`): infinite."""


class EliminatedBlock(NamedTuple):
    """One block after elimination.

    Attributes
    ----------
    factor : array (k, k, ...)
        Cholesky factor.
    right : array (k, 7, ...)
        Its inverse times coupling and gradient.
    damped : array (k, ...)
        What was added to the diagonal.
    """

    factor: Array
    right: Array
    damped: Array


def eliminate(
    matrix: Array, coupling: Array, gradient: Array, damping: Array | float, floor: float
) -> EliminatedBlock:
    """Factor a block (k, k, ...), damped by a fraction of its diagonal."""
    factor = np.array(matrix, order="C")
    right = np.concatenate([coupling, gradient[:, None]], axis=1)
    damped = _damp(factor, damping, floor)
    return (
        EliminatedBlock(cholesky(factor), forward(factor, right), damped)
        if len(factor)
        else EliminatedBlock(factor, right, damped)
    )


def left_over(reduced: EliminatedBlock, matrix: Array, gradient: Array) -> tuple[Array, Array]:
    """Return what an eliminated block leaves of the matrix (6, 6, ...) and gradient (6, ...) that it touches."""
    coupling, own = reduced.right[:, :-1], reduced.right[:, -1]
    return matrix - np.einsum("ki...,kj...->ij...", coupling, coupling), gradient - np.einsum(
        "ki...,k...->i...", coupling, own
    )


def _damp(matrix: Array, damping: Array | float, floor: float) -> Array:
    """Add damping and floor to the diagonal, in place; return what was added."""
    index = np.arange(len(matrix))
    added = matrix[index, index] * damping + floor
    matrix[index, index] += added
    return np.asarray(added)


class TrunkEquations(NamedTuple):
    """The equations of the trunk when limbs and head are eliminated.

    Attributes
    ----------
    matrix, gradient : array (C, C, N), (C, N)
        J'J and J'r in the trunk's C unknowns, limbs and head eliminated.
    limbs, head : Reduced or None
        The eliminated blocks, from which their own steps follow.
    starts : array (4, 6, C, N) or None
        How the trunk's unknowns move limbs' starts and turn their parts.
    """

    matrix: Array
    gradient: Array
    limbs: EliminatedBlock | None
    head: EliminatedBlock | None
    starts: Array | None


def assemble(here: Equations, damping: Array | float, floor: float = DIAGONAL_FLOOR) -> TrunkEquations:
    """Eliminate limbs and head."""
    P, g = here.trunk.points, here.trunk.pull
    limbs = head = starts = turns = None
    if here.limbs is not None:
        terms = here.limbs
        limbs = eliminate(terms.matrix, terms.coupling, terms.gradient, damping, floor)
        start, push = left_over(limbs, terms.start, terms.start_gradient)
        P, g = P.copy(), g.copy()
        P[list(LIMB_STARTS)] += start[:3, :3].transpose(2, 0, 1, 3)
        g[list(LIMB_STARTS)] += push[:3].transpose(1, 0, 2)
        starts = start_jacobian(here.trunk)
        if (terms.crossed != 0).any() or terms.slack.any():
            turns = start, push
    matrix, gradient = to_unknowns(here.trunk, P, g)
    if turns is not None and starts is not None:
        _add_turns(*turns, starts, here.trunk.turns, matrix, gradient)
    if here.head is not None:
        head = eliminate(here.head.matrix, here.head.coupling, here.head.gradient, damping, floor)
        more, push = left_over(head, here.head.trunk, here.head.trunk_gradient)
        matrix[:6, :6] += more
        gradient[:6] += push
    return TrunkEquations(matrix, gradient, limbs, head, starts)


def _add_turns(
    start: Array, push: Array, starts: Array, turns: tuple[slice, ...], matrix: Array, gradient: Array
) -> None:
    """Add how the limits of limbs depend on the rotation of the part on which they hang, in place."""
    for limb, turn in enumerate(turns):
        gradient[turn] += push[3:, limb]
        matrix[turn, turn] += start[3:, 3:, limb]
        cross = np.einsum("jin,icn->jcn", start[3:, :3, limb], starts[limb, :3])
        matrix[turn] += cross
        matrix[:, turn] += cross.transpose(1, 0, 2)


def solve(here: Equations, damping: Array | float) -> tuple[PostureStep, Array]:
    """Solve for the step, and the decrease of chi2 that it promises (N,), watched limits left out."""
    arrow = assemble(here, damping)
    last = eliminate(arrow.matrix, arrow.matrix[:, :0], arrow.gradient, damping, DIAGONAL_FLOOR)
    own = last.right[:, 0]
    trunk = -backward(last.factor, own.copy())
    gain = np.einsum("cn,cn->n", own, own) + np.einsum("cn,cn->n", last.damped, trunk * trunk)
    limbs = head = None
    if arrow.limbs is not None and arrow.starts is not None:
        limbs = follow(arrow.limbs, np.einsum("licn,cn->iln", arrow.starts, trunk))
        gain += _gain(arrow.limbs, limbs).sum(axis=0)
    if arrow.head is not None:
        head = follow(arrow.head, trunk[:6])
        gain += _gain(arrow.head, head)
    return PostureStep(trunk, limbs, head), gain - here.slack


def follow(block: EliminatedBlock, shift: Array) -> Array:
    """Return the step of an eliminated block when what it is coupled with moves by `shift` (6, ...)."""
    right = block.right[:, -1] + np.einsum("ki...,i...->k...", block.right[:, :-1], shift)
    return -backward(block.factor, right)


def _gain(block: EliminatedBlock, step: Array) -> Array:
    return np.asarray((block.right[:, -1] ** 2).sum(axis=0) + (block.damped * step * step).sum(axis=0))
