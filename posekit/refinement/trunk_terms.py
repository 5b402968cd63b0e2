"""What the image, the root's prior, the limits of the hips and the trunk's lengths say of root, torso and hips."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, cross, dot
from posekit.geometry.batch_last import matrix_vector
from posekit.refinement.figure_numbers import LEG_LIMBS, LIMB_STARTS, TRUNK_SEGMENTS
from posekit.refinement.limits import Ball, Signs
from posekit.refinement.part_limits import pelvis_limits
from posekit.refinement.problem import RefinementProblem
from posekit.refinement.state import PostureState, trunk_offsets

SPINE_TURN_DEVIATION = 1e-3
"""Radians by which hips may be turned from where the spine has them: a hundredth of what an angle may be off."""


class TrunkTerms(NamedTuple):
    """The trunk's part of the normal equations: root, torso, hips (9 unknowns), and the shape (9 more) where varied.

    Attributes
    ----------
    chi2 : array (N,)
        Sum of squares of image points, root, limits of the hips, and distances.
    matrix, gradient : array (C, C, N), (C, N)
        Of prior, limits and distances.
    points, pull : array (6, 3, 3, N), (6, 3, N)
        J'J and J'r of the trunk's image points, along their joints.
    jacobian : array (6, 3, C, N)
        How the unknowns move the joints, metres for each unit of an unknown.
    offsets : array (6, 3, N)
        The joints from the root.
    crossed : int array (3, N)
        Limits of the hips that are passed.
    slack : array (N,)
        Squares of limits that are watched, not passed: in the matrices, not in chi2.
    turns : tuple of 4 slices
        Which unknowns turn the part by which each limb is judged.
    """

    chi2: Array
    matrix: Array
    gradient: Array
    points: Array
    pull: Array
    jacobian: Array
    offsets: Array
    crossed: Signs
    slack: Array
    turns: tuple[slice, ...]


def trunk_terms(problem: RefinementProblem, state: PostureState, watch: Signs | None = None) -> TrunkTerms:
    """Linearise the trunk."""
    offsets = trunk_offsets(state)
    residual, A = problem.linearised_image(state.root + offsets, slice(0, 6))
    n, width = state.root.shape[1], problem.trunk_width
    matrix, gradient = np.zeros((width, width, n)), np.zeros((width, n))
    W, away = problem.root_weight, _root(problem, state)
    matrix[:3, :3] = np.einsum("kin,kjn->ijn", W, W)
    gradient[:3] = np.einsum("kin,kn->in", W, away)
    chi2 = np.einsum("jcn,jcn->n", residual, residual) + np.einsum("kn,kn->n", away, away)
    crossed, slack = np.zeros((3, n), dtype=np.int8), np.zeros(n)
    if problem.limited:
        ball = pelvis_limits(problem, state, watch)
        squared = problem.limit_deviation**-2
        _add_ball(ball, squared, matrix, gradient)
        cost = ball.cost()
        chi2 += cost * squared
        slack = (dot(ball.residual, ball.residual, axis=-2) - cost) * squared
        crossed = ball.crossed
    if problem.anatomy.middle_pelvis:
        turn, normal = _spine_turn(state)
        _add_turn(turn[None], normal[None], SPINE_TURN_DEVIATION**-2, matrix, gradient)
        chi2 += (turn / SPINE_TURN_DEVIATION) ** 2
    if problem.shape_weight is not None:
        stretch, J = shape_distances(problem.shape_weight, problem.anatomy.shape, state.shape)
        matrix[9:, 9:] += np.einsum("kin,kjn->ijn", J, J)
        gradient[9:] += np.einsum("kin,kn->in", J, stretch)
        chi2 += np.einsum("kn,kn->n", stretch, stretch)
    return TrunkTerms(
        chi2=chi2,
        matrix=matrix,
        gradient=gradient,
        points=np.einsum("jcin,jckn->jikn", A, A),
        pull=np.einsum("jcin,jcn->jin", A, residual),
        jacobian=_joint_jacobian(problem, state, offsets),
        offsets=offsets,
        crossed=crossed,
        slack=slack,
        turns=turns_of(problem),
    )


def trunk_chi2(problem: RefinementProblem, state: PostureState, offsets: Array) -> tuple[Array, Signs]:
    """Return the trunk's chi2 (N,) and the limits of the hips that are passed (3, N)."""
    residual, away = problem.image_residuals(state.root + offsets, slice(0, 6)), _root(problem, state)
    chi2 = np.einsum("jcn,jcn->n", residual, residual) + np.einsum("kn,kn->n", away, away)
    crossed = np.zeros((3, len(chi2)), dtype=np.int8)
    if problem.limited:
        ball = pelvis_limits(problem, state)
        chi2 += ball.cost() / problem.limit_deviation**2
        crossed = ball.crossed
    if problem.anatomy.middle_pelvis:
        chi2 += (_spine_turn(state)[0] / SPINE_TURN_DEVIATION) ** 2
    if problem.shape_weight is not None:
        stretch, _ = shape_distances(problem.shape_weight, problem.anatomy.shape, state.shape)
        chi2 += np.einsum("kn,kn->n", stretch, stretch)
    return chi2, crossed


def to_unknowns(terms: TrunkTerms, P: Array, g: Array) -> tuple[Array, Array]:
    """Carry matrices (6, 3, 3, N) and gradients (6, 3, N) at the trunk's joints to its unknowns, with its own terms.

    With the curvature of turning: a joint at x from the axis, pushed outward, resists as `limb_terms` says.
    """
    moving = np.einsum("jikn,jkcn->jicn", P, terms.jacobian)
    matrix = np.einsum("jicn,jidn->cdn", terms.jacobian, moving)
    matrix += terms.matrix
    gradient = np.einsum("jicn,jin->cn", terms.jacobian, g)
    gradient += terms.gradient
    x, y = terms.offsets[1:4], terms.offsets[4:] - terms.offsets[3]
    torso = g[1:4].copy()
    torso[2] += g[4] + g[5]
    for first, arm, push in ((3, x, torso), (6, y, g[4:])):
        outward = np.maximum(-dot(arm, push, axis=-2), 0.0)
        square = dot(arm, arm, axis=-2)
        share = outward / np.where(square > 0, square, 1.0)
        matrix[first : first + 3, first : first + 3] -= np.einsum("jn,jin,jkn->ikn", share, arm, arm)
        total = outward.sum(axis=0)
        for i in range(first, first + 3):
            matrix[i, i] += total
    return matrix, gradient


def start_jacobian(terms: TrunkTerms) -> Array:
    """Return how the trunk's unknowns move limbs' starts and turn their parts (4, 6, C, N)."""
    width, n = terms.jacobian.shape[2:]
    out = np.zeros((4, 6, width, n))
    out[:, :3] = terms.jacobian[list(LIMB_STARTS)]
    for limb in range(4):
        for i, column in enumerate(range(9)[terms.turns[limb]]):
            out[limb, 3 + i, column] = 1.0
    return out


def turns_of(problem: RefinementProblem) -> tuple[slice, ...]:
    """Return which unknowns turn the part by which each limb is judged: torso or hips."""
    torso, hips = slice(3, 6), slice(6, 9)
    return tuple(
        hips if limb >= LEG_LIMBS.start and not problem.legs_on_torso else torso for limb in range(4)
    )


def _root(problem: RefinementProblem, state: PostureState) -> Array:
    return matrix_vector(problem.root_weight, state.root - problem.root)


def _joint_jacobian(problem: RefinementProblem, state: PostureState, offsets: Array) -> Array:
    jacobian = np.zeros((6, 3, problem.trunk_width, state.root.shape[1]))
    for i in range(3):
        jacobian[:, i, i] = 1.0
    # The torso turns about the neck and carries the pelvis, from which the hips hang; the hips turn about the pelvis.
    _turning(offsets[1:4], jacobian[1:4, :, 3:6])
    _turning(offsets[[3, 3]], jacobian[4:, :, 3:6])
    _turning(offsets[4:] - offsets[3], jacobian[4:, :, 6:9])
    if problem.shape_weight is not None:
        jacobian[..., 9:, :] = shape_jacobian(state)
    return jacobian


def _turning(x: Array, out: Array) -> None:
    """Write the derivative of w x x (J, 3, N) along w."""
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[:, i, j], out[:, j, i] = x[:, k], -x[:, k]


def _spine_turn(state: PostureState) -> tuple[Array, Array]:
    r"""Return how far hips are turned about their own line from where the spine has them (N,), and the normal (3, N).

    With the hips' forward x and the torso's up z, :math:`r = x \cdot z`; turning the hips by w against the torso
    changes it by :math:`w \cdot (x \times z)`.
    """
    forward, up = state.hips[:, 0], state.torso[:, 2]
    return dot(forward, up, axis=-2), cross(forward, up, axis=-2)


def _add_ball(ball: Ball, squared: float, matrix: Array, gradient: Array) -> None:
    if ball.jacobian is not None:
        _add_turn(ball.residual, ball.jacobian, squared, matrix, gradient)


def _add_turn(residual: Array, jacobian: Array, squared: float, matrix: Array, gradient: Array) -> None:
    """Add residuals (A, N) of the hips' turn against the torso's, with their derivatives (A, 3, N)."""
    normal = np.einsum("ain,ajn->ijn", jacobian, jacobian) * squared
    push = np.einsum("ain,an->in", jacobian, residual) * squared
    torso, hips = slice(3, 6), slice(6, 9)
    matrix[torso, torso] += normal
    matrix[hips, hips] += normal
    matrix[torso, hips] -= normal
    matrix[hips, torso] -= normal
    gradient[torso] -= push
    gradient[hips] += push


def shape_jacobian(state: PostureState) -> Array:
    """Return how the nine numbers of the shape move the trunk's joints (6, 3, 9, N)."""
    jacobian = np.zeros((6, 3, 9, state.root.shape[1]))
    forward, left, up = state.torso[:, 0], state.torso[:, 1], state.torso[:, 2]
    jacobian[3:, :, 0] = -up
    for shoulder, first in ((1, 2), (2, 4)):
        jacobian[shoulder, :, 1], jacobian[shoulder, :, first], jacobian[shoulder, :, first + 1] = (
            forward,
            left,
            up,
        )
    jacobian[4:, :, 6] = -state.hips[:, 2]
    jacobian[4, :, 7] = jacobian[5, :, 8] = state.hips[:, 1]
    return jacobian


def shape_distances(weight: Array, own: Array, shape: Array) -> tuple[Array, Array]:
    """Return the residuals (9, N) of the trunk's distances, and their derivative (9, 9, N)."""
    points, mine = np.einsum("jis,sn->jin", _PLACES, shape), _PLACES @ own
    residual, J = np.empty_like(shape), np.empty((9, *shape.shape))
    for row, (i, j) in enumerate(TRUNK_SEGMENTS):
        apart = points[j] - points[i]
        square = dot(apart, apart, axis=-2)
        residual[row] = weight[row] * 0.5 * np.log(square / ((mine[j] - mine[i]) ** 2).sum())
        J[row] = weight[row] * np.einsum("in,is->sn", apart, _PLACES[j] - _PLACES[i]) / square
    return residual, J


def _places() -> NDArray[np.float64]:
    """Return how the shape places torso and hips (6, 3, 9) with both parts' axes alike: for distances in one part."""
    places = np.zeros((6, 3, 9))
    places[3:, 2, 0] = -1.0
    for shoulder, first in ((1, 2), (2, 4)):
        places[shoulder, 0, 1] = places[shoulder, 1, first] = places[shoulder, 2, first + 1] = 1.0
    places[4:, 2, 6] = -1.0
    places[4, 1, 7] = places[5, 1, 8] = 1.0
    return places


_PLACES = _places()
TRUNK_APART = np.array([_PLACES[j] - _PLACES[i] for i, j in TRUNK_SEGMENTS])
"""How the shape places the end of each of the trunk's distances against its start (9, 3, 9)."""
