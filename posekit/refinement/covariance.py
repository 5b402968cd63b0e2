r"""The uncertainty of refined joints, to first order.

With the trunk's covariance C (the inverse of its matrix when limbs and head are eliminated), a limb whose own matrix
is H and whose coupling with its start is K moves by :math:`-H^{-1} K` per change of the start, and by
:math:`H^{-1}` besides. So a joint with Jacobians T along the trunk and U along the limb has

.. math:: (T - U H^{-1} K)\, C\, (T - U H^{-1} K)^T + U H^{-1} U^T .

What nothing determines keeps the deviation of an angle that may be anything, :math:`\pi / \sqrt 3`, and of a place
in the room. Near a right angle to the ray, where a segment's depth does not show in the image to first order, the
image still shows it to second order: a length l seen too short by the noise :math:`\sigma` (metres) turns by
:math:`t = \sqrt{2 \sigma / l}`, and the estimate :math:`\sqrt{\max(y, 0)}` from :math:`y = t^2 + e` is off by
:math:`E[(\hat t - t)^2] = E[\max(e, 0)] = 0.8\,\sigma / l` at t = 0. Its inverse would be :math:`1.25\, l / \sigma`;
but beside t = 0 the error is larger than either order says. :math:`0.5\, l / \sigma` is added as information on the
turn: with it stated and measured errors agree over random legal postures, at half a pixel as at five (docs, "Noise").
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from posekit.compiled import covariance_kernels
from posekit.compiled.compiling import compiled, is_installed
from posekit.errors import InputError
from posekit.geometry import Array, dot
from posekit.geometry.batch_last import backward, cholesky, forward, matrix_vector
from posekit.refinement.equations import assemble, linearise
from posekit.refinement.figure_numbers import LIMB_ENDS, LIMB_MIDDLES, LIMB_STARTS
from posekit.refinement.limb_terms import LimbTerms
from posekit.refinement.looped_descent import looped_knowledge
from posekit.refinement.problem import BLOCK_POSTURES, RefinementProblem
from posekit.refinement.state import PostureState, place
from posekit.refinement.trunk_terms import turns_of

UNKNOWN_PLACE_METRES = 10.0
"""Metres: standard deviation of a place of which nothing is known."""

UNKNOWN_ANGLE_RADIANS = np.pi / np.sqrt(3.0)
"""Radians: standard deviation of an angle of which nothing is known."""

MAX_TURN_INFORMATION = 0.5
"""See the module: information on a turn, times the noise over the length."""


def covariances(problem: RefinementProblem, state: PostureState, gain: Array | None = None) -> Array:
    """Return the covariance of every joint (N, 14, 3, 3), square metres.

    With a `gain` (N, 3), of a body that is scaled about the camera's centre by a factor whose logarithm falls by as
    much when the root moves (`posekit.refinement.size.BodySize`).
    """
    n = state.root.shape[1]
    out = np.empty((n, 14, 3, 3))
    for at in range(0, n, BLOCK_POSTURES):
        rows = np.arange(at, min(at + BLOCK_POSTURES, n))
        part, here = problem.take(rows), state.take(rows)
        system = joint_system(part, here, None if gain is None else gain[rows].T)
        out[rows] = system.looped() if is_installed() else system.summed()
    return out


def joint_system(problem: RefinementProblem, state: PostureState, gain: Array | None = None) -> JointSystem:
    """Set up what covariances of whole postures follow from; the gain is (3, N)."""
    gain = np.zeros((3, state.root.shape[1])) if gain is None else gain
    looped = None if problem.trunk_only else looped_knowledge(problem, state)
    if looped is None:
        return stepped_system(problem, state, gain)
    matrix, jacobian, factor, right, levers, joints = looped
    return JointSystem(
        matrix=matrix,
        jacobian=jacobian,
        turns=tuple(turn.start for turn in turns_of(problem)),
        factor=factor,
        right=right,
        levers=levers,
        joints=joints,
        gain=gain,
    )


def stepped_system(problem: RefinementProblem, state: PostureState, gain: Array) -> JointSystem:
    """Do the same with all postures at once."""
    here = linearise(problem, state)
    if here.limbs is None:
        raise InputError("covariances are of whole postures; expected a problem that has its limbs")
    width = problem.trunk_width
    limbs = here.limbs._replace(matrix=_with_priors(problem, state, here.limbs))
    arrow = assemble(here._replace(limbs=limbs), 0.0, UNKNOWN_ANGLE_RADIANS**-2 * 1e-6)
    index = np.arange(width)
    arrow.matrix[index, index] += np.where(
        index < 3,
        UNKNOWN_PLACE_METRES**-2,
        np.where(index < 9, UNKNOWN_ANGLE_RADIANS**-2, UNKNOWN_PLACE_METRES**-2),
    )[:, None]
    assert arrow.limbs is not None  # there are limbs
    return JointSystem(
        matrix=arrow.matrix,
        jacobian=here.trunk.jacobian,
        turns=tuple(turn.start for turn in here.trunk.turns),
        factor=arrow.limbs.factor,
        right=arrow.limbs.right,
        levers=_levers(state, limbs),
        joints=place(state),
        gain=gain,
    )


class JointSystem(NamedTuple):
    """How N bodies' unknowns are known, and move their joints.

    Attributes
    ----------
    matrix : array (C, C, N)
        The trunk's, limbs and head eliminated; with what is known of all.
    jacobian : array (6, 3, C, N)
        How the trunk's unknowns move its joints.
    turns : tuple of 4 int
        The first of the three unknowns that turn the part by which each limb is judged.
    factor, right : array (U, U, 4, N), (U, 7, 4, N)
        The limbs, eliminated: as `posekit.refinement.equations.EliminatedBlock` has them.
    levers : array (2, 4, 3, U, N)
        How limbs' unknowns move their middles and ends, from their starts.
    joints, gain : array (14, 3, N), (3, N)
        Of bodies that are scaled, see `covariances`; a gain of zeros of others.
    """

    matrix: Array
    jacobian: Array
    turns: tuple[int, ...]
    factor: Array
    right: Array
    levers: Array
    joints: Array
    gain: Array

    def looped(self) -> Array:
        """Find the covariances (N, 14, 3, 3) by a compiled loop."""
        order = [*range(6), *np.ravel(np.column_stack([LIMB_MIDDLES, LIMB_ENDS]))]
        scaled = np.concatenate([self.joints[order], self.gain[None]])
        found = np.empty((scaled.shape[2], 14, 3, 3))
        turns = np.column_stack([LIMB_STARTS, self.turns])
        arrays = self.matrix, self.jacobian, turns, self.factor, self.right, self.levers, scaled
        compiled(covariance_kernels).joint_covariances(*map(np.ascontiguousarray, arrays), found)
        out = np.empty_like(found)
        out[:, order] = found
        return out

    def summed(self) -> Array:
        """Find them by sums over all postures at once."""
        width, n = self.jacobian.shape[2:]
        trunk = cholesky(self.matrix.copy())
        out = np.empty((14, 3, 3, n))
        # With C = (L L')^-1 and S = L^-1 T', T C T' is S'S.
        right = np.ascontiguousarray(self.jacobian.transpose(2, 0, 1, 3)).reshape(width, 18, n)
        root = forward(trunk, right).reshape(width, 6, 3, n)
        shrink = np.einsum("win,in->wn", root[:, 0], self.gain)
        root = root - self.joints[None, :6] * shrink[:, None, None]
        np.einsum("wpin,wpjn->pijn", root, root, out=out[:6])
        whitened = backward(trunk, np.repeat(np.eye(width)[:, :, None], n, axis=2))
        starts = np.zeros((4, 6, width, n))
        starts[:, :3] = self.jacobian[list(LIMB_STARTS)]
        for limb, turn in enumerate(self.turns):
            starts[limb, 3:, turn : turn + 3] = np.eye(3)[..., None]
        shift = np.einsum("licn,cwn->iwln", starts, whitened)
        coupling = self.right[:, :6]
        reach = len(coupling)
        followed = -backward(self.factor, np.einsum("uiln,iwln->uwln", coupling, shift))
        own = np.empty((reach, reach, 4, n))
        own[:] = np.eye(reach)[:, :, None, None]
        own = backward(self.factor, own)
        for U, ends in zip(self.levers, (list(LIMB_MIDDLES), list(LIMB_ENDS)), strict=True):
            moving = np.einsum("liun,uwln->liwn", U, followed) + shift[:3].transpose(2, 0, 1, 3)
            moving -= self.joints[ends][:, :, None] * shrink
            alone = np.einsum("liun,uwln->liwn", U, own)
            both = np.concatenate([moving, alone], axis=2)
            out[ends] = np.einsum("liwn,ljwn->lijn", both, both)
        return out.transpose(3, 0, 1, 2)


def _with_priors(problem: RefinementProblem, state: PostureState, terms: LimbTerms) -> Array:
    """Add to the limbs' matrices what is known of turns that the image does not show to first order."""
    limb = terms.matrix.copy()
    joints = place(state)
    _, A = problem.linearised_image(joints, slice(0, 14))
    for segment, ends in enumerate((LIMB_MIDDLES, LIMB_ENDS)):
        first = 2 * segment
        for i in (first, first + 1):
            limb[i, i] += UNKNOWN_ANGLE_RADIANS**-2
        seen = matrix_vector(A[list(ends)], state.directions[:, segment])
        ray = joints[list(ends)] if problem.optics.perspective else np.array([0.0, 0.0, 1.0])[:, None]
        c, s = (
            dot(
                terms.tangents[:, segment, k],
                np.broadcast_to(ray, (*seen.shape[:1], 3, *seen.shape[2:])),
                axis=-2,
            )
            for k in range(2)
        )
        size = np.maximum(np.sqrt(c * c + s * s), MIN_LENGTH)
        # Information on the turn along the ray's own tangent alone: across it the image shows the turn to first order.
        known = (
            MAX_TURN_INFORMATION * state.limbs[:, segment] * np.sqrt(dot(seen, seen, axis=-2)) / (size * size)
        )
        for (i, x), (j, y) in (((a, p), (b, q)) for a, p in ((0, c), (1, s)) for b, q in ((0, c), (1, s))):
            limb[first + i, first + j] += known * x * y
    return limb


MIN_LENGTH = 1e-12
"""Stands for zero where a vector's length is divided by: the direction is then arbitrary, and its share zero."""


def _levers(state: PostureState, terms: LimbTerms) -> Array:
    """Return how limbs' unknowns move their middles and ends, from their starts: (2, 4, 3, U, N)."""
    out = np.zeros((2, 4, 3, len(terms.matrix), state.root.shape[1]))
    for segment, part in ((0, 0), (1, 0), (1, 1)):
        length = state.limbs[:, part, None]
        for tangent in range(2):
            out[segment, :, :, 2 * part + tangent] = length * terms.tangents[:, part, tangent]
        if len(terms.matrix) > 4:
            out[segment, :, :, 4 + part] = length * state.directions[:, part]
    return out
