r"""The problem linearised at some postures: its normal equations, an arrow of small blocks.

Given where a limb starts, nothing but its own directions and lengths moves it: the normal matrix couples limbs with
the start's place alone (and, where its limits are felt, with the rotation of the part that it hangs on), and the
head with the root. `posekit.refinement.elimination` solves them.

Besides :math:`J^T J` the matrix has the curvature of turning where it is positive: a point at :math:`l\,d` pushed
outward by its gradient g has :math:`-l\,(g \cdot d)` for each turn. Where a segment is too short for its image, J
vanishes at the solution and this is all that is left.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.refinement.anatomy import END, MIDDLE, TRUNK_SEGMENTS
from posekit.refinement.limits import Active, Ball, Limbs, ball_residuals, limb_residuals, limbs
from posekit.refinement.problem import Problem
from posekit.refinement.small import cross, dot, turned
from posekit.refinement.state import State, head_points, parents, place


class Watch(NamedTuple):
    """Limits that are passed, or would be: 1 the upper, -1 the lower, 0 neither.

    Attributes
    ----------
    limbs : int array (4, 4, N)
        By limb and angle.
    hips, head : int array (3, N)
    """

    limbs: NDArray[np.int8]
    hips: NDArray[np.int8]
    head: NDArray[np.int8]

    @staticmethod
    def none(n: int) -> Watch:
        """Watch nothing."""
        return Watch(*(np.zeros((*shape, n), dtype=np.int8) for shape in ((4, 4), (3,), (3,))))

    def take(self, rows: NDArray[np.intp]) -> Watch:
        """Return some postures."""
        return Watch(*(array[..., rows] for array in self))

    def put(self, rows: NDArray[np.intp], other: Watch) -> None:
        """Overwrite some postures."""
        for mine, theirs in zip(self, other, strict=True):
            mine[..., rows] = theirs

    def count(self) -> NDArray[np.intp]:
        """Count the limits of each posture (N,)."""
        return (self.limbs != 0).sum(axis=(0, 1)) + (self.hips != 0).sum(axis=0) + (self.head != 0).sum(axis=0)


class Equations(NamedTuple):
    """Normal equations of N postures; the batch is the last axis.

    Attributes
    ----------
    chi2 : array (N,)
        Sum of squared residuals; infinite where a point is behind the camera.
    trunk : array (C, C, N)
        Of root, torso, hips and shape: what prior, limits and distances add to the image's.
    trunk_gradient : array (C, N)
    limb : array (U, U, 4, N)
    limb_start : array (U, 6, 4, N)
        Coupling with the start's place and its part's rotation.
    start : array (6, 6, 4, N)
    limb_gradient, start_gradient : array (U, 4, N), (6, 4, N)
    head : array (3, 3, N)
    head_start : array (3, 6, N)
        Coupling with the root and the torso's rotation.
    head_root : array (6, 6, N)
    head_gradient, head_root_gradient : array (3, N), (6, N)
    points, point_gradient : array (6, 3, 3, N), (6, 3, N)
        J'J and J'r of the trunk's image points, along their joints.
    offsets : array (6, 3, N)
        Trunk joints from the root.
    ways : array (6, 3, 9, N) or (6, 3, 0, N)
        How the trunk's shape moves them.
    tangents : array (4, 2, 2, 3, N)
    folds : bool array (4, 2, N)
        Segments that are held at a right angle to their ray by an image beyond their reach.
    crossed : Watch
        The limits that are passed.
    slack : array (N,)
        Squared residuals of limits that are watched, not passed: in the matrices, not in chi2.
    felt : bool array (N,)
        Whether a limb's is among them.
    """

    chi2: Array
    trunk: Array
    trunk_gradient: Array
    limb: Array
    limb_start: Array
    start: Array
    limb_gradient: Array
    start_gradient: Array
    head: Array
    head_start: Array
    head_root: Array
    head_gradient: Array
    head_root_gradient: Array
    points: Array
    point_gradient: Array
    offsets: Array
    ways: Array
    tangents: Array
    folds: NDArray[np.bool_]
    crossed: Watch
    slack: Array
    felt: NDArray[np.bool_]

    def take(self, rows: NDArray[np.intp]) -> Equations:
        """Return some postures."""
        return Equations(*(array.take(rows) if isinstance(array, Watch) else array[..., rows] for array in self))

    def put(self, rows: NDArray[np.intp], other: Equations) -> None:
        """Overwrite some postures."""
        for mine, theirs in zip(self, other, strict=True):
            if isinstance(mine, Watch):
                mine.put(rows, theirs)
            else:
                mine[..., rows] = theirs


def linearise(problem: Problem, state: State, watch: Watch | None = None) -> Equations:
    """Linearise the problem at postures; limits that are watched are in the matrices though they are not passed."""
    n = state.root.shape[1]
    crossed = Watch.none(n)
    slack = np.zeros(n)
    placed = place(state)
    information, pull, chi2 = image_terms(problem, placed.joints)
    width, reach = problem.trunk_width, problem.limb_width
    limb = np.zeros((reach, reach, 4, n))
    limb_start, start = np.zeros((reach, 6, 4, n)), np.zeros((6, 6, 4, n))
    limb_gradient, start_gradient = np.zeros((reach, 4, n)), np.zeros((6, 4, n))
    folds, felt_limbs = np.zeros((4, 2, n), dtype=np.bool_), np.zeros(n, dtype=np.bool_)
    if problem.trunk_only:
        tangents = np.zeros((4, 2, 2, 3, n))
    else:
        found = limbs(state.directions, parents(state))
        tangents = found.tangents
        _limb_blocks(problem, state, found, information, pull, limb, limb_start, start, limb_gradient, start_gradient)
        folds = _curve_limbs(state, tangents, pull, limb)
        chi2 += _limb_lengths(problem, state, limb, limb_gradient)
        if np.isfinite(problem.limit_deviation):
            bounds = problem.anatomy.limb_bounds
            cost, felt = limb_residuals(found, bounds, problem.limit_deviation, watch and watch.limbs)
            chi2 += cost
            if felt is not None:
                _add_limits(felt, limb, limb_start, start, limb_gradient, start_gradient)
                felt_limbs[felt.row] = True
                crossed.limbs[felt.limb, :, felt.row] = felt.crossed.T
                np.add.at(slack, felt.row, (felt.residual**2).sum(axis=0))
                slack -= cost
    trunk, gradient = np.zeros((width, width, n)), np.zeros((width, n))
    chi2 += _prior(problem, state, trunk, gradient)
    if np.isfinite(problem.limit_deviation):
        bounds = problem.anatomy.pelvis_bounds
        ball = ball_residuals(state.torso, state.hips, bounds, problem.limit_deviation, watch and watch.hips)
        _add_ball(ball, trunk, gradient)
        chi2 += ball.cost
        slack += (ball.residual**2).sum(axis=0) - ball.cost
        crossed.hips[...] = ball.crossed
    if problem.shape_weight is not None:
        chi2 += _shape(problem, state, trunk, gradient)
    head = _head(problem, state, crossed, watch)
    chi2 += head.chi2
    slack += head.slack
    return Equations(
        chi2=np.where(np.isfinite(chi2), chi2, np.inf),
        trunk=trunk,
        trunk_gradient=gradient,
        limb=limb,
        limb_start=limb_start,
        start=start,
        limb_gradient=limb_gradient,
        start_gradient=start_gradient,
        head=head.matrix,
        head_start=head.coupling,
        head_root=head.root,
        head_gradient=head.gradient,
        head_root_gradient=head.root_gradient,
        points=information[:6],
        point_gradient=pull[:6],
        offsets=placed.trunk,
        ways=np.zeros((6, 3, 0, n)) if problem.shape_weight is None else shape_ways(state),
        tangents=tangents,
        folds=folds,
        crossed=crossed,
        slack=slack,
        felt=felt_limbs,
    )


def chi2_of(problem: Problem, state: State) -> Array:
    """Return the sum of squared residuals of postures (N,)."""
    n = state.root.shape[1]
    return np.concatenate(
        [
            linearise(problem.take(rows), state.take(rows)).chi2
            for rows in (np.arange(at, min(at + 256, n)) for at in range(0, max(n, 1), 256))
        ]
    )


def image_terms(problem: Problem, joints: Array) -> tuple[Array, Array, Array]:
    """Return J'J (14, 3, 3, N) and J'r (14, 3, N) of the image points along the joints, and their chi2 (N,)."""
    count = 6 if problem.trunk_only else 14
    image, jacobian = problem.optics.project(joints[:count])
    weight = problem.weight[:count, None]
    residual = (image - problem.image[:count]) * weight
    behind = np.isnan(residual)
    if behind.any():
        residual = np.where(behind, np.where(weight > 0, np.inf, 0.0), residual)
    chi2 = np.einsum("jcn,jcn->n", residual, residual)
    if behind.any():
        residual, jacobian = np.nan_to_num(residual, posinf=0.0), np.nan_to_num(jacobian)
    jacobian *= weight[:, :, None]
    u, v = jacobian[:, 0], jacobian[:, 1]
    information = u[:, :, None] * u[:, None] + v[:, :, None] * v[:, None]
    pull = u * residual[:, 0, None] + v * residual[:, 1, None]
    return information, pull, chi2


def _limb_blocks(
    problem: Problem,
    state: State,
    found: Limbs,
    information: Array,
    pull: Array,
    limb: Array,
    limb_start: Array,
    start: Array,
    limb_gradient: Array,
    start_gradient: Array,
) -> None:
    """Fill in what the image points of limbs say."""
    P_end, P_both = information[list(END)], information[list(MIDDLE)] + information[list(END)]
    g_end, g_both = pull[list(END)], pull[list(MIDDLE)] + pull[list(END)]
    columns: list[tuple[Array, Array, Array]] = []
    for tangent in range(2):
        for segment in range(2):
            way = state.limbs[:, segment, None] * found.tangents[:, segment, tangent]
            columns.append((way, P_both if segment == 0 else P_end, g_both if segment == 0 else g_end))
    order = (0, 2, 1, 3)
    ways = [columns[k] for k in order]
    if problem.limb_weight is not None:
        for segment in range(2):
            way = state.limbs[:, segment, None] * state.directions[:, segment]
            ways.append((way, P_both if segment == 0 else P_end, g_both if segment == 0 else g_end))
    start[:3, :3] = P_both.transpose(1, 2, 0, 3)
    start_gradient[:3] = g_both.transpose(1, 0, 2)
    for i, (way, P, g) in enumerate(ways):
        pushed = turned(P, way)
        limb_start[i, :3] = pushed.transpose(1, 0, 2)
        limb_gradient[i] = dot(way, g)
        upper_i = i in (0, 1, 4)
        for j in range(i + 1):
            # Upper and lower share the end's information alone.
            both = pushed if not upper_i or j in (0, 1, 4) else None
            other = ways[j][0]
            value = dot(both, other) if both is not None else dot(turned(P_end, way), other)
            limb[i, j] = value
            if i != j:
                limb[j, i] = value


def _curve_limbs(state: State, tangents: Array, pull: Array, limb: Array) -> NDArray[np.bool_]:
    """Add the curvature of turning limbs; return which segments are folds."""
    folds = np.zeros((4, 2, state.root.shape[1]), dtype=np.bool_)
    g_end = pull[list(END)]
    for segment, g in ((0, pull[list(MIDDLE)] + g_end), (1, g_end)):
        bend = np.maximum(-state.limbs[:, segment] * dot(state.directions[:, segment], g), 0.0)
        first = 2 * segment
        a, b, c = limb[first, first], limb[first + 1, first + 1], limb[first, first + 1]
        stiff = 0.5 * (a + b) - np.hypot(0.5 * (a - b), c)
        folds[:, segment] = bend > stiff
        limb[first, first] += bend
        limb[first + 1, first + 1] += bend
    return folds


def _limb_lengths(problem: Problem, state: State, limb: Array, gradient: Array) -> Array | float:
    if problem.limb_weight is None:
        return 0.0
    chi2: Array = np.zeros(state.root.shape[1])
    for segment in range(2):
        weight = problem.limb_weight[:, segment, None]
        residual = np.log(state.limbs[:, segment] / problem.anatomy.limbs[:, segment, None]) * weight
        limb[4 + segment, 4 + segment] += weight * weight
        gradient[4 + segment] += weight * residual
        chi2 += (residual * residual).sum(axis=0)
    return chi2


def _add_limits(
    felt: Active, limb: Array, limb_start: Array, start: Array, limb_gradient: Array, start_gradient: Array
) -> None:
    """Add the limits of limbs."""
    normal = np.einsum("aim,ajm->ijm", felt.jacobian, felt.jacobian)
    gradient = np.einsum("aim,am->im", felt.jacobian, felt.residual)
    k, n = felt.limb, felt.row
    limb[:4, :4, k, n] += normal[:4, :4]
    limb_start[:4, 3:, k, n] += normal[:4, 4:]
    start[3:, 3:, k, n] += normal[4:, 4:]
    limb_gradient[:4, k, n] += gradient[:4]
    start_gradient[3:, k, n] += gradient[4:]


def _prior(problem: Problem, state: State, trunk: Array, gradient: Array) -> Array:
    residual = turned(problem.root_weight, state.root - problem.root)
    weight = problem.root_weight
    trunk[:3, :3] += np.einsum("kin,kjn->ijn", weight, weight)
    gradient[:3] += np.einsum("kin,kn->in", weight, residual)
    return np.asarray(np.einsum("kn,kn->n", residual, residual))


def _add_ball(ball: Ball, trunk: Array, gradient: Array) -> None:
    """Add the limits of the hips on the torso."""
    if ball.jacobian is None:
        return
    normal = np.einsum("ain,ajn->ijn", ball.jacobian, ball.jacobian)
    push = np.einsum("ain,an->in", ball.jacobian, ball.residual)
    trunk[3:6, 3:6] += normal
    trunk[6:9, 6:9] += normal
    trunk[3:6, 6:9] -= normal
    trunk[6:9, 3:6] -= normal
    gradient[3:6] -= push
    gradient[6:9] += push


def _shape(problem: Problem, state: State, trunk: Array, gradient: Array) -> Array:
    """Add the trunk's distances."""
    residual, jacobian = _distances(problem, state)
    trunk[9:, 9:] += np.einsum("kin,kjn->ijn", jacobian, jacobian)
    gradient[9:] += np.einsum("kin,kn->in", jacobian, residual)
    return np.asarray(np.einsum("kn,kn->n", residual, residual))


def shape_ways(state: State) -> Array:
    """Return how the nine numbers of the shape move the trunk's joints (6, 3, 9, N)."""
    ways = np.zeros((6, 3, 9, state.root.shape[1]))
    forward, left, up = state.torso[:, 0], state.torso[:, 1], state.torso[:, 2]
    ways[3:, :, 0] = -up
    for shoulder, first in ((1, 2), (2, 4)):
        ways[shoulder, :, 1], ways[shoulder, :, first], ways[shoulder, :, first + 1] = forward, left, up
    ways[4:, :, 6] = -state.hips[:, 2]
    ways[4, :, 7] = ways[5, :, 8] = state.hips[:, 1]
    return ways


def _distances(problem: Problem, state: State) -> tuple[Array, Array]:
    """Return the residuals (9, N) of the trunk's distances and their derivative (9, 9, N) along the shape."""
    n = state.root.shape[1]
    points, ways = _part_points(state.shape), np.zeros((6, 3, 9))
    own = _part_points(problem.anatomy.shape[:, None])
    for k in range(9):
        ways[:, :, k] = _part_points(np.eye(9)[:, k : k + 1])[..., 0]
    residual, jacobian = np.empty((9, n)), np.empty((9, 9, n))
    assert problem.shape_weight is not None
    for row, (i, j) in enumerate(TRUNK_SEGMENTS):
        apart, far = points[j] - points[i], np.linalg.norm(own[j] - own[i], axis=0)
        square = dot(apart, apart)
        residual[row] = problem.shape_weight[row] * 0.5 * np.log(square / (far * far))
        along = np.einsum("in,is->sn", apart, ways[j] - ways[i])
        jacobian[row] = problem.shape_weight[row] * along / square
    return residual, jacobian


def _part_points(shape: Array) -> Array:
    """Place torso and hips (6, 3, N) with both parts' axes alike: for distances inside a part alone."""
    b, a, right_y, right_z, left_y, left_z, h, hip_right, hip_left = shape
    zero = np.zeros_like(b)
    pelvis = np.stack([zero, zero, -b])
    return np.stack(
        [
            np.stack([zero, zero, zero]),
            np.stack([a, right_y, right_z]),
            np.stack([a, left_y, left_z]),
            pelvis,
            pelvis + np.stack([zero, hip_right, -h]),
            pelvis + np.stack([zero, hip_left, -h]),
        ]
    )


class Head(NamedTuple):
    """What the head's points say: see `Equations`."""

    chi2: Array
    matrix: Array
    coupling: Array
    root: Array
    gradient: Array
    root_gradient: Array
    slack: Array


def _head(problem: Problem, state: State, crossed: Watch, watch: Watch | None) -> Head:
    n = state.root.shape[1]
    if problem.head_image is None or problem.head_weight is None:
        none = np.zeros((0, n))
        nothing = np.zeros(n)
        return Head(nothing, np.zeros((0, 0, n)), np.zeros((0, 6, n)), np.zeros((0, 0, n)), none, none, nothing)
    offsets = head_points(state, problem.anatomy.head)
    image, jacobian = problem.optics.project(state.root + offsets)
    weight = problem.head_weight[:, None]
    residual = (image - problem.head_image) * weight
    behind = np.isnan(residual)
    residual = np.where(behind, np.where(weight > 0, np.inf, 0.0), residual)
    chi2 = np.einsum("pcn,pcn->n", residual, residual)
    residual = np.nan_to_num(residual, posinf=0.0)
    J = np.nan_to_num(jacobian) * weight[:, :, None]
    turn = cross(offsets[:, None], J)
    both = np.concatenate([turn, J], axis=2)  # its own rotation, then the root
    normal = np.einsum("pcin,pcjn->ijn", both, both)
    push = np.einsum("pcin,pcn->in", both, residual)
    coupling, root, root_gradient = np.zeros((3, 6, n)), np.zeros((6, 6, n)), np.zeros((6, n))
    matrix, gradient = normal[:3, :3].copy(), push[:3].copy()
    coupling[:, :3], root[:3, :3], root_gradient[:3] = normal[:3, 3:], normal[3:, 3:], push[3:]
    slack = np.zeros(n)
    if np.isfinite(problem.limit_deviation):
        bounds = problem.anatomy.neck_bounds
        ball = ball_residuals(state.torso, state.head, bounds, problem.limit_deviation, watch and watch.head)
        chi2 = chi2 + ball.cost
        slack = (ball.residual**2).sum(axis=0) - ball.cost
        crossed.head[...] = ball.crossed
        if ball.jacobian is not None:
            limit = np.einsum("ain,ajn->ijn", ball.jacobian, ball.jacobian)
            pushed = np.einsum("ain,an->in", ball.jacobian, ball.residual)
            matrix += limit
            coupling[:, 3:] -= limit
            root[3:, 3:] += limit
            gradient += pushed
            root_gradient[3:] -= pushed
    return Head(chi2, matrix, coupling, root, gradient, root_gradient, slack)
