r"""What the image, the limits and the lengths say of limbs, linearised.

Given where a limb starts, nothing but its own directions and lengths moves it. So its part of the normal equations
is a small block, coupled with the start's place alone and, where its limits are felt, with the rotation of the part
on which it hangs.

Besides :math:`J^T J` the block has the curvature of turning where it is positive: a point at :math:`l\,d` pushed
outward by its gradient g has :math:`-l\,(g \cdot d)` for each turn. Where a segment is too short for its image, J
vanishes at the solution and this is all that is left.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, dot
from posekit.refinement.figure_numbers import LIMB_ENDS, LIMB_MIDDLES
from posekit.refinement.limits import Outside, Signs, limb_angles, limb_limits, limb_rows, tangents_of
from posekit.refinement.looped_descent import looped_limb_chi2
from posekit.refinement.problem import BLOCK_POSTURES, RefinementProblem
from posekit.refinement.state import place_limbs
from posekit.refinement.walls import Beyond, beyond_walls, wall_rows


class Chains(NamedTuple):
    """Limbs of N postures.

    Attributes
    ----------
    start : array (4, 3, N)
        Camera frame, metres.
    parent : array (4, 3, 3, N)
        Rotations of the parts on which they hang.
    directions : array (4, 2, 3, N)
        Unit vectors of upper and lower segments, camera frame.
    lengths : array (4, 2, N)
        Of upper and lower segments, metres.
    """

    start: Array
    parent: Array
    directions: Array
    lengths: Array

    def take(self, rows: NDArray[np.intp]) -> Chains:
        """Return some postures."""
        return Chains(*(array[..., rows] for array in self))


class LimbTerms(NamedTuple):
    """The limbs' part of the normal equations; U is four, or six where lengths are varied.

    Attributes
    ----------
    chi2 : array (4, N)
        Each limb's sum of squares: image points, limits, lengths.
    matrix : array (U, U, 4, N)
        J'J of the limb's own unknowns, with the curvature of turning.
    coupling : array (U, 6, 4, N)
        With the start's place and its part's rotation vector.
    start : array (6, 6, 4, N)
        Of those two.
    gradient, start_gradient : array (U, 4, N), (6, 4, N)
        J'r of its own unknowns, and of the start's place and its part's rotation.
    tangents : array (4, 2, 2, 3, N)
        Unit vectors along which its two segments turn, two each.
    folds : bool array (4, 2, N)
        Segments that are held at a right angle to their ray by an image beyond their reach.
    crossed : int array (4, 4, N)
        By angle and limb, limits that are passed: 1 the upper, -1 the lower.
    slack : array (4, N)
        Squares of what is watched, not passed: in the matrices, not in chi2.
    """

    chi2: Array
    matrix: Array
    coupling: Array
    start: Array
    gradient: Array
    start_gradient: Array
    tangents: Array
    folds: NDArray[np.bool_]
    crossed: Signs
    slack: Array


_MIDDLE, _END = ([joint - 6 for joint in joints] for joints in (LIMB_MIDDLES, LIMB_ENDS))


def limb_terms(problem: RefinementProblem, chains: Chains, watch: Signs | None = None) -> LimbTerms:
    """Linearise limbs; limits that are watched are in the matrices though they are not passed."""
    n = chains.start.shape[2]
    points = np.empty((8, 3, n))
    place_limbs(chains.start, chains.directions, chains.lengths, points)
    residual, jacobian = problem.linearised_image(points, slice(6, 14))
    A_middle, A_end = jacobian[_MIDDLE], jacobian[_END]
    r_middle, r_end = residual[_MIDDLE], residual[_END]
    chi2 = np.einsum("lcn,lcn->ln", r_middle, r_middle) + np.einsum("lcn,lcn->ln", r_end, r_end)
    found = limb_angles(chains.directions, chains.parent)
    tangents = tangents_of(found, chains.directions[:, 0])
    reach = problem.limb_width
    rows = np.zeros((4, 4, reach, n))
    levers = chains.lengths[:, :, None, None] * tangents
    rows[:, :2, :2] = np.einsum("lcin,ltin->lctn", A_middle, levers[:, 0])
    rows[:, 2:, :2] = np.einsum("lcin,ltin->lctn", A_end, levers[:, 0])
    rows[:, 2:, 2:4] = np.einsum("lcin,ltin->lctn", A_end, levers[:, 1])
    if reach > 4:
        along = chains.lengths[:, :, None] * chains.directions
        rows[:, :2, 4] = np.einsum("lcin,lin->lcn", A_middle, along[:, 0])
        rows[:, 2:, 4:] = np.einsum("lcin,lsin->lcsn", A_end, along)
    A, r = np.concatenate([A_middle, A_end], axis=1), np.concatenate([r_middle, r_end], axis=1)
    matrix = np.empty((reach, reach, 4, n))
    for i in range(reach):
        np.einsum("lrn,lrvn->vln", rows[:, :, i], rows[:, :, : i + 1], out=matrix[i, : i + 1])
        matrix[:i, i] = matrix[i, :i]
    gradient = np.einsum("lrun,lrn->uln", rows, r)
    coupling, start, start_gradient = np.zeros((reach, 6, 4, n)), np.zeros((6, 6, 4, n)), np.zeros((6, 4, n))
    np.einsum("lrun,lrin->uiln", rows, A, out=coupling[:, :3])
    np.einsum("lrin,lrjn->ijln", A, A, out=start[:3, :3])
    np.einsum("lrin,lrn->iln", A, r, out=start_gradient[:3])
    g_end = np.einsum("lcin,lcn->lin", A_end, r_end)
    folds = _curve(chains, start_gradient[:3].transpose(1, 0, 2), g_end, matrix)
    if problem.limb_weight is not None:
        weight = problem.limb_weight[..., None]
        stretch = weight * np.log(chains.lengths / problem.anatomy.limbs[..., None])
        chi2 += np.einsum("lsn,lsn->ln", stretch, stretch)
        for segment in range(2):
            matrix[4 + segment, 4 + segment] += weight[:, segment] ** 2
            gradient[4 + segment] += weight[:, segment] * stretch[:, segment]
    crossed, slack = np.zeros((4, 4, n), dtype=np.int8), np.zeros((4, n))
    terms = LimbTerms(
        chi2, matrix, coupling, start, gradient, start_gradient, tangents, folds, crossed, slack
    )
    if problem.limited and problem.walls is not None:
        out = beyond_walls(problem.walls, chains.directions, chains.parent, watch, problem.free)
        if out is not None:
            J = wall_rows(problem.walls, out, chains.parent, chains.directions, tangents)
            _add_limits(problem, out, out.over, J, terms)
    elif problem.limited:
        boxed = limb_limits(found, problem.anatomy.limb_bounds, watch, problem.free)
        if boxed is not None:
            k, m = boxed.limb, boxed.row
            J = limb_rows(found, boxed, tangents[k, 1, 0, :, m], tangents[k, 1, 1, :, m])
            _add_limits(problem, boxed, boxed.residual(), J, terms)
    return terms


def _add_limits(
    problem: RefinementProblem, out: Outside | Beyond, residual: Array, J: Array, terms: LimbTerms
) -> None:
    """Add the limits that are passed or watched, in place: radians, and how they change."""
    k, m = out.limb, out.row
    scale = 1.0 / problem.limit_deviation
    judged, J = residual * scale, J * scale
    normal, push = np.einsum("aim,ajm->ijm", J, J), np.einsum("aim,am->im", J, judged)
    terms.matrix[:4, :4, k, m] += normal[:4, :4]
    terms.coupling[:4, 3:, k, m] += normal[:4, 4:]
    terms.start[3:, 3:, k, m] += normal[4:, 4:]
    terms.gradient[:4, k, m] += push[:4]
    terms.start_gradient[3:, k, m] += push[4:]
    terms.crossed[:, k, m] = out.crossed
    cost = out.cost() * scale * scale
    terms.chi2[k, m] += cost
    terms.slack[k, m] = (judged * judged).sum(axis=0) - cost


def limb_chi2(problem: RefinementProblem, chains: Chains) -> tuple[Array, Signs]:
    """Return the limbs' chi2 (4, N) and the limits that are passed (4, 4, N): `limb_terms` without the derivatives."""
    n = chains.start.shape[2]
    points = np.empty((8, 3, n))
    place_limbs(chains.start, chains.directions, chains.lengths, points)
    residual = problem.image_residuals(points, slice(6, 14))
    each = np.einsum("jcn,jcn->jn", residual, residual)
    chi2 = each[_MIDDLE] + each[_END]
    if problem.limb_weight is not None:
        stretch = problem.limb_weight[..., None] * np.log(chains.lengths / problem.anatomy.limbs[..., None])
        chi2 += np.einsum("lsn,lsn->ln", stretch, stretch)
    crossed = np.zeros((4, 4, n), dtype=np.int8)
    if problem.limited:
        out: Outside | Beyond | None
        if problem.walls is not None:
            out = beyond_walls(problem.walls, chains.directions, chains.parent, free=problem.free)
        else:
            found = limb_angles(chains.directions, chains.parent)
            out = limb_limits(found, problem.anatomy.limb_bounds, free=problem.free)
        if out is not None:
            chi2[out.limb, out.row] += out.cost() / problem.limit_deviation**2
            crossed[:, out.limb, out.row] = out.crossed
    return np.where(np.isfinite(chi2), chi2, np.inf), crossed


def chi2_of_limbs(problem: RefinementProblem, chains: Chains) -> Array:
    """Return the limbs' chi2 (4, M)."""
    chi2 = looped_limb_chi2(problem, chains)
    if chi2 is None:
        rows, chi2 = np.arange(chains.start.shape[2]), np.empty((4, chains.start.shape[2]))
    else:
        rows = np.flatnonzero(np.isnan(chi2).any(axis=0))
    for at in range(0, len(rows), BLOCK_POSTURES):
        some = rows[at : at + BLOCK_POSTURES]
        chi2[:, some] = limb_chi2(problem.take(some), chains.take(some))[0]
    return chi2


def _curve(chains: Chains, g_both: Array, g_end: Array, matrix: Array) -> NDArray[np.bool_]:
    """Add the curvature of turning; return which segments are folds: turned by it more than by the image."""
    folds = np.empty((4, 2, g_end.shape[2]), dtype=np.bool_)
    for segment, g in ((0, g_both), (1, g_end)):
        bend = np.maximum(-chains.lengths[:, segment] * dot(chains.directions[:, segment], g, axis=-2), 0.0)
        first = 2 * segment
        a, b, c = matrix[first, first], matrix[first + 1, first + 1], matrix[first, first + 1]
        # Less than the smaller eigenvalue of [[a, c], [c, b]].
        folds[:, segment] = (bend > a) | (bend > b) | ((a - bend) * (b - bend) < c * c)
        folds[:, segment] &= bend > 0
        matrix[first, first] += bend
        matrix[first + 1, first + 1] += bend
    return folds
