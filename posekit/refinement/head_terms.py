"""What the head's image points and the neck's limits say of the head, the root and the torso."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from posekit.geometry import Array, cross, dot
from posekit.refinement.limits import Signs
from posekit.refinement.part_limits import neck_limits
from posekit.refinement.problem import RefinementProblem
from posekit.refinement.state import PostureState, head_points


class HeadTerms(NamedTuple):
    """The head's part of the normal equations: its rotation (3), and root and torso's rotation (6).

    Attributes
    ----------
    chi2 : array (N,)
        Sum of squares of the head's image points and the neck's limits.
    matrix, coupling, trunk : array (3, 3, N), (3, 6, N), (6, 6, N)
        J'J: of the head's rotation, between that and root and torso, and of these alone.
    gradient, trunk_gradient : array (3, N), (6, N)
        J'r of the head's rotation, and of root and torso.
    crossed : int array (3, N)
        Limits of the neck that are passed: 1 the upper, -1 the lower.
    slack : array (N,)
        Squares of limits that are watched, not passed: in the matrices, not in chi2.
    """

    chi2: Array
    matrix: Array
    coupling: Array
    trunk: Array
    gradient: Array
    trunk_gradient: Array
    crossed: Signs
    slack: Array


def head_terms(problem: RefinementProblem, state: PostureState, watch: Signs | None = None) -> HeadTerms:
    """Linearise the head."""
    n = state.root.shape[1]
    offsets = head_points(state, np.concatenate([problem.anatomy.head, problem.own_head]))
    residual, A = problem.linearised_head(state.root + offsets)
    chi2 = np.einsum("jcn,jcn->n", residual, residual)
    turn = cross(np.broadcast_to(offsets[:, None], A.shape), A, axis=-2)
    J = np.concatenate([turn, A], axis=2)  # along its rotation, then the root
    normal, push = np.einsum("jcin,jckn->ikn", J, J), np.einsum("jcin,jcn->in", J, residual)
    matrix, gradient = normal[:3, :3].copy(), push[:3].copy()
    coupling, trunk, trunk_gradient = np.zeros((3, 6, n)), np.zeros((6, 6, n)), np.zeros((6, n))
    coupling[:, :3], trunk[:3, :3], trunk_gradient[:3] = normal[:3, 3:], normal[3:, 3:], push[3:]
    crossed, slack = np.zeros((3, n), dtype=np.int8), np.zeros(n)
    if problem.limited:
        ball = neck_limits(problem, state, watch)
        squared = problem.limit_deviation**-2
        cost = ball.cost()
        chi2 += cost * squared
        slack = (dot(ball.residual, ball.residual, axis=-2) - cost) * squared
        crossed = ball.crossed
        if ball.jacobian is not None:
            limit = np.einsum("ain,ajn->ijn", ball.jacobian, ball.jacobian) * squared
            pushed = np.einsum("ain,an->in", ball.jacobian, ball.residual) * squared
            matrix += limit
            coupling[:, 3:] -= limit
            trunk[3:, 3:] += limit
            gradient += pushed
            trunk_gradient[3:] -= pushed
    return HeadTerms(chi2, matrix, coupling, trunk, gradient, trunk_gradient, crossed, slack)


def head_chi2(problem: RefinementProblem, state: PostureState) -> tuple[Array, Signs]:
    """Return the head's chi2 (N,) and the limits of the neck that are passed (3, N)."""
    terms = head_terms(problem, state)
    return terms.chi2, terms.crossed
