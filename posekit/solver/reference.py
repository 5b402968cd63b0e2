"""The solver in NumPy: the same residuals and steps as `solver.cpp`, computed for all starts at once.

Unknowns x (N, 43) are the 14 joint positions and the size: the logarithm of a common factor on all lengths. The bits of
`parts` select the unknowns that are free: bit 0 the trunk (six joints and the size), bits 1 to 4 the four limbs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.body.angles import ball_branch, limb_branch
from posekit.body.frames import trunk_frames
from posekit.geometry import Array, Flags, Ints, cross, dot, norm, turned_near, unit
from posekit.geometry.rotations import relative_rotation
from posekit.skeleton import LIMB_JOINTS, SEGMENTS
from posekit.solver import limits as lim
from posekit.solver.limits import Limits
from posekit.solver.problem import Problem

#: Index of the size among the unknowns.
SIZE: Final = 42

#: Added to every diagonal element of the normal matrix, 1/m^2, so that it stays regular if a joint is hidden.
FLOOR: Final = 1e-6

#: Step of the finite differences of limit residuals with respect to limb angles, radians.
ANGLE_STEP: Final = 1e-4

#: Smallest sine or cosine that divides derivatives of limb angles, which are infinite at a singularity.
LEAST_SINE: Final = 0.02

#: Smallest cosine that divides derivatives of pelvis angles.
LEAST_COSINE: Final = 0.05

#: Step of the finite differences of the caller's own residuals, metres.
PULL_STEP: Final = 1e-6

#: Damping of the first step and smallest damping, added to every diagonal element, 1/m^2.
#:
#: The damping is not a multiple of the diagonal. Image points and lengths make the diagonal large, so a multiple of it
#: would also block steps in the few directions that image points and lengths do not determine.
FIRST_DAMPING: Final = 30.0
LEAST_DAMPING: Final = 1.0

#: Largest damping at which a start can have converged, and damping above which a start is abandoned (1/m^2).
ARRIVED_DAMPING: Final = 3e3
MOST_DAMPING: Final = 1e6

#: A start has converged if the predicted decrease of chi2 in its next step is at most this.
PRECISION: Final = 1e-2

#: Start and end joints of the 17 segments, and the matrix (17, 14) that maps joint positions to segment vectors.
SEGMENT_STARTS, SEGMENT_ENDS = np.sort(SEGMENTS, axis=1).T
INCIDENCE: Final = np.eye(14)[SEGMENT_ENDS] - np.eye(14)[SEGMENT_STARTS]

#: Frames of `posekit.solver.problem.PROBLEM`.
Records = NDArray[np.void]

#: Caller's function that returns residuals (N, K), in standard deviations, of postures (N, 14, 3); zero for a posture
#: that fits.
Pull = Callable[[Array], Array]


class Normal:
    """Normal equations of N postures in C unknowns: the coordinates of F free joints, then the size.

    The attributes `chi2` (N,), `gradient` (N, C) and `matrix` (N, C, C) are the quadratic model of chi2. `beyond` (N,
    K) are the residuals of joint limits, zero within the limits; `slopes` (N, K, C - 1) are their derivatives.
    """

    def __init__(self, count: int, width: int) -> None:
        self.chi2, self.gradient, self.beyond = (
            np.zeros(count),
            np.zeros((count, width)),
            np.zeros((count, 0)),
        )
        self.matrix, self.slopes = np.zeros((count, width, width)), np.zeros((count, 0, width - 1))

    def add(self, r: Array, d: Array) -> None:
        """Add residuals (N, K) and their derivatives (N, K, L) with respect to the first L unknowns."""
        part = slice(0, d.shape[2])
        self.chi2 += dot(r, r)
        self.gradient[:, part] += (r[:, None] @ d)[:, 0]
        self.matrix[:, part, part] += np.swapaxes(d, 1, 2) @ d


def free_joints(parts: int) -> Ints:
    """Return the indices (F,), ascending, of the joints that the bits of `parts` select."""
    limbs = [joint for k in range(4) if parts >> (k + 1) & 1 for joint in LIMB_JOINTS[k][1:]]
    return np.sort([*range(6 * (parts & 1)), *limbs])


def evaluate(problem: Problem, which: Ints, x: Array, parts: int, pull: Pull | None = None) -> Normal:
    """Return the normal equations of N postures `x` (N, 43); `which` (N,) is the frame of each posture.

    chi2 is infinite if a seen joint is behind the camera, or if chi2 would be NaN.
    """
    records, joints, free = problem.records[which], x[:, :SIZE].reshape(-1, 14, 3), free_joints(parts)
    some, trunk = np.isin(SEGMENT_ENDS, free), parts & 1
    to_joints = np.concatenate([np.eye(14)[free], INCIDENCE[some]])[:, free]
    out = Normal(len(x), 3 * len(free) + 1)
    off, on_place, behind = image_terms(records, joints)
    off, on_place = off[..., free], on_place[..., free, :]
    # Robust (Geman & McClure): e / (1 + e / c^2), whose weight in the normal equations is the square of the factor.
    error = (off * off).sum(axis=1)
    keep = 1 / (1 + records["robust"][:, None] * error)
    r, d, bend = length_terms(records, x, some)
    w = trunk * records["size_weight"]
    out.chi2 += (keep * error).sum(axis=1) + dot(r, r) + (w * x[:, SIZE]) ** 2
    keep = (keep * keep)[..., None]
    on_joints, on_lines = keep * np.einsum("nkji,nkj->nji", on_place, off), r[..., None] * d
    out.gradient[:, :-1] = (to_joints.T @ np.concatenate([on_joints, on_lines], axis=1)).reshape(len(x), -1)
    on_joints = keep[..., None] * np.einsum("nkji,nkjl->njil", on_place, on_place)
    on_lines = d[..., None] * d[..., None, :] + bend
    out.matrix[:, :-1, :-1] = _laid(np.concatenate([on_joints, on_lines], axis=1), to_joints)
    # The diagonal element of a fixed size is one.
    on_size = np.where(w[:, None] > 0, -records["length_weight"][:, some], 0.0)
    shared = (to_joints[len(free) :].T @ (on_size[..., None] * d)).reshape(len(x), -1)
    out.matrix[:, -1, :-1] = out.matrix[:, :-1, -1] = shared
    out.matrix[:, -1, -1] = dot(on_size, on_size) + np.where(w > 0, w * w, 1.0)
    out.gradient[:, -1] = dot(on_size, r) + w * w * x[:, SIZE]
    weight = trunk * records["root_weight"]
    out.add(np.einsum("nki,ni->nk", weight, joints[:, 0] - records["root"]), weight)
    if problem.limits is not None:
        terms = zip(*limit_terms(problem.limits, joints, parts), strict=True)
        out.beyond, d = (records["limit_weight"][0] * np.concatenate(one, axis=1) for one in terms)
        out.slopes = d[:, :, free].reshape(*d.shape[:2], -1)
        out.add(out.beyond, out.slopes)
    if pull is not None:
        r = pull(joints)
        moved = joints[:, None] + PULL_STEP * np.eye(SIZE).reshape(-1, 14, 3)
        d = (pull(moved.reshape(-1, 14, 3)).reshape(len(x), SIZE, -1) - r[:, None]) / PULL_STEP
        out.add(r, np.where(r[:, None] != 0, d, 0.0).transpose(0, 2, 1))
    out.chi2[behind[:, free].any(axis=1) | np.isnan(out.chi2)] = np.inf
    return out


def _laid(blocks: Array, to_joints: Array) -> Array:
    """Assemble matrices (N, 3F, 3F) of F joints from blocks (N, P, 3, 3) of P points.

    A point is a joint position or a segment vector: a linear combination of joints with coefficients `to_joints` (P,
    F).
    """
    pairs = to_joints[:, :, None] * to_joints[:, None]
    laid = np.tensordot(blocks, pairs, (1, 0)).transpose(0, 3, 1, 4, 2)
    return np.asarray(laid.reshape(len(blocks), 3 * to_joints.shape[1], -1))


def image_terms(records: Records, joints: Array) -> tuple[Array, Array, Flags]:
    """Return image residuals (N, 2, 14), their derivatives (N, 2, 14, 3), and a mask of joints behind the camera."""
    weight, perspective = np.swapaxes(records["image"], 1, 2), bool(records["perspective"].any())
    depth = joints[..., 2:] if perspective else np.ones((len(joints), 14, 1))
    inverse = 1 / np.where(depth > 0, depth, 1.0)
    place = joints[..., :2] * inverse
    r = np.einsum("nijk,njk->nij", weight, place - records["ray"])
    on_depth = -perspective * np.einsum("nijk,njk->nij", weight, place)
    d = np.concatenate([weight, on_depth[..., None]], axis=3) * inverse[:, None]
    return r, d, (weight != 0).any(axis=(1, 3)) & ~(depth[..., 0] > 0)


def length_terms(records: Records, x: Array, some: Flags | slice = slice(None)) -> tuple[Array, Array, Array]:
    """Return log-length residuals (N, S) of segments, their derivatives (N, S, 3) and curvature (N, S, 3, 3).

    Derivatives are with respect to the vector from a segment's start to its end. The curvature is not zero, because
    moving an end sideways lengthens the segment to second order. Negative curvature is set to zero.
    """
    line = INCIDENCE[some] @ x[:, :SIZE].reshape(-1, 14, 3)
    square, w = dot(line, line), records["length_weight"][:, some]
    r = w * (0.5 * np.log(square) - records["log_length"][:, some] - x[:, SIZE:])
    across = np.eye(3) - line[..., None] * line[..., None, :] / square[..., None, None]
    return r, (w / square)[..., None] * line, (np.maximum(w * r, 0.0) / square)[..., None, None] * across


def limit_terms(limits: Limits, joints: Array, parts: int) -> Iterator[tuple[Array, Array]]:
    """Yield pairs: residuals of joint limits, radians, and their derivatives with respect to joint positions.

    If the trunk is free, the first pair (N, 3), (N, 3, 14, 3) belongs to the pelvis. Each free limb then has a pair (N,
    5), (N, 5, 14, 3). The fifth residual is zero; its derivatives add only curvature (see `_limb_slopes`).
    """
    frames = trunk_frames(joints, bool(limits.numbers["between_hips"]))
    if parts & 1:
        low, high = limits.numbers["pelvis"].T
        angles = turned_near(ball_branch(relative_rotation(*frames)) * lim.PELVIS_SIGNS, (low + high) / 2)
        r = angles - np.clip(angles, low, high)
        yield r, _pelvis_slopes(limits, joints, *frames, r != 0)
    for limb in range(4):
        if parts >> (limb + 1) & 1:
            R = frames[limb // 2]
            angles = limb_branch(R, *lim.limb_directions(joints, limb))
            r, writing = limits.residual(limb, angles)
            d, row = np.zeros((len(joints), 5, 14, 3)), np.flatnonzero(r.any(axis=1))
            if len(row):
                steps = (angles[row, None] + ANGLE_STEP * np.eye(4)).reshape(-1, 4)
                moved, _ = limits.residual(limb, steps, np.repeat(writing[row], 4))
                along = (moved.reshape(-1, 4, 4) - r[row, None]) / ANGLE_STEP
                along = np.where(r[row, :, None] != 0, np.swapaxes(along, 1, 2), 0.0)
                d[row] = _limb_slopes(limits, joints[row], R[row], limb, angles[row], along, r[row, 3])
            yield np.pad(r, ((0, 0), (0, 1))), d


def _put_turn(d: Array, limits: Limits, joints: Array, R: Array, torso: bool, w: Array) -> None:
    """Add to `d` the gradients, with respect to joint positions, of `w` dot the rotation vector of torso or hips."""
    forward, left, up = (R[:, None, :, k] for k in range(3))
    between = bool(limits.numbers["between_hips"])
    (a, b), (s, t) = ((0, 3), (1, 2)) if torso else ((4, 5), (0, 3) if between else (3, 4))
    first, second, normal = (-up, left, forward) if torso else (left, -up, -forward)
    line, other = (joints[:, None, end] - joints[:, None, start] for start, end in ((a, b), (s, t)))
    on_other = (dot(w, first) / dot(other, second))[..., None] * normal
    on_first = (cross(w, first) - dot(other, first)[..., None] * on_other) / dot(line, first)[..., None]
    for start, end, pull in ((a, b, on_first), (s, t, on_other)):
        d[:, :, end] += pull
        d[:, :, start] -= pull


def _pelvis_slopes(limits: Limits, joints: Array, torso: Array, hips: Array, some: Flags) -> Array:
    """Return the Jacobian (N, 3, 14, 3) of pelvis angles with respect to joint positions; zero where not `some`."""
    left, up = torso[:, :, 1], hips[:, :, 2]
    lean = dot(left, up)[:, None]
    square = np.maximum(1 - lean * lean, LEAST_COSINE**2)
    axes = ((left - lean * up) / square, unit(cross(left, up)), (up - lean * left) / square)
    w = np.where(some[..., None], lim.PELVIS_SIGNS[:, None] * np.stack(axes, axis=1), 0.0)
    d = np.zeros((len(joints), 3, 14, 3))
    _put_turn(d, limits, joints, hips, False, w)
    _put_turn(d, limits, joints, torso, True, -w)
    return d


def _limb_slopes(
    limits: Limits, joints: Array, frame: Array, limb: int, angles: Array, slopes: Array, bent: Array
) -> Array:
    """Convert the Jacobian (M, 4, 4) of a limb's residuals from its angles to joint positions (chain rule).

    Returns (M, 5, 14, 3). The last row is the curvature of the hinge's residual `bent` (M,), radians. The curvature
    matters if an elbow or knee is almost straight: moving wrist or ankle sideways in any direction bends the joint to
    second order.
    """
    start, middle, end = lim.STARTS[limb], lim.MIDDLES[limb], lim.ENDS[limb]
    upper, lower = (one[:, None] for one in lim.limb_directions(joints, limb))
    lengths = norm(joints[:, [middle, end]] - joints[:, [start, middle]])[:, :, None, None]
    trig = (np.moveaxis(f(angles), 1, 0)[..., None, None] for f in (np.cos, np.sin))
    (ca, cb, cg, ce), (sa, sb, sg, se) = trig
    # Directions in which the ends of both segments move with the angles.
    a = sa * frame[:, None, :, 2] - ca * frame[:, None, :, 0]
    b = cross(upper, a)
    f = -sg * a - cg * b
    e = cross(lower, f)
    on_a, on_b, on_f, on_e = np.moveaxis(slopes, 2, 0)[..., None]
    on_f = on_f / np.maximum(se, LEAST_SINE)
    on_a = (on_a + on_f * (cb * ce * sg + sb * se) - on_e * cb * cg) / np.maximum(cb, LEAST_SINE)
    on_b = on_b + on_f * ce * cg + on_e * sg
    bent = np.maximum((bent * slopes[:, 3, 3])[:, None, None] * ce, 0.0)
    turn = np.sqrt(bent / np.maximum(se, LEAST_SINE)) * f
    du = np.concatenate([on_a * a + on_b * b, -turn], axis=1) / lengths[:, 0]
    dl = np.concatenate([on_f * f + on_e * e, turn], axis=1) / lengths[:, 1]
    d = np.zeros((len(joints), 5, 14, 3))
    d[:, :, start], d[:, :, middle], d[:, :, end] = -du, du - dl, dl
    _put_turn(d[:, :4], limits, joints, frame, limb < 2, on_b * a - on_a * b + on_e * f - on_f * e)
    return d


def descend(
    problem: Problem,
    which: Ints,
    start: Array,
    parts: int,
    most: int,
    hopeless: Array,
    damping: Array,
    pull: Pull | None = None,
) -> tuple[Array, Array, Array]:
    """Minimise chi2 from N starts by Levenberg-Marquardt.

    A rejected step may violate joint limits that its start respects. The quadratic model of the next step includes
    these limits, because otherwise the next step would violate them again.

    Parameters
    ----------
    problem : Problem
        Data of the frames.
    which : int array (N,)
        Frame of each start.
    start : array (N, 43)
        Joint positions, camera frame, metres, and the logarithm of the size.
    parts : int
        Bits that select the free parts of the body: bit 0 the trunk, bits 1 to 4 the limbs.
    most : int
        Largest number of steps.
    hopeless : array (N,)
        A start whose chi2 exceeds this value is abandoned, unless its next step is predicted to reduce chi2 by at least
        half.
    damping : array (N,)
        Damping of the first step, 1/m^2: `FIRST_DAMPING`, or the final damping of an earlier descent. A start with
        infinite damping does not move.
    pull : callable, optional
        Function that returns further residuals (N, K) of postures (N, 14, 3).

    Returns
    -------
    x, chi2, damping : array (N, 43), (N,), (N,)
        Final unknowns, chi2 and damping of each start. Damping is infinite for a start that has converged or is
        abandoned.
    """
    column = np.append((3 * free_joints(parts)[:, None] + np.arange(3)).ravel(), SIZE)
    x, damping = np.array(start, dtype=np.float64), np.array(damping, dtype=np.float64)
    refused = np.zeros(len(x), dtype=np.bool_)
    here = evaluate(problem, which, x, parts, pull)
    # The model of the next step: the normal equations at x, and limits that a refused step has met.
    matrix, gradient = here.matrix.copy(), here.gradient.copy()
    live = np.flatnonzero(np.isfinite(here.chi2 + damping))
    for _ in range(most):
        slope, chi2, held = gradient[live], here.chi2[live], (damping[live] + FLOOR)[:, None]
        damped = matrix[live] + held[..., None] * np.eye(len(column))
        step = np.asarray(-np.linalg.solve(damped, slope[..., None])[..., 0], dtype=np.float64)
        gain = dot(step, held * step - slope)
        arrived = (gain <= PRECISION) & (damping[live] <= ARRIVED_DAMPING)
        stop = arrived | (damping[live] > MOST_DAMPING) | ((chi2 > hopeless[live]) & (gain < 0.5 * chi2))
        damping[live[stop]] = np.inf
        live, step, gain, chi2 = live[~stop], step[~stop], gain[~stop], chi2[~stop]
        if not len(live):
            break
        moved = x[live]
        moved[:, column] += step
        there = evaluate(problem, which[live], moved, parts, pull)
        better = there.chi2 <= chi2
        good, bad = live[better], live[~better]
        ratio = (chi2 - there.chi2)[better] / gain[better]
        factor = np.where(ratio > 0.75, 0.2, np.where(ratio < 0.25, 4.0, 1.0))
        damping[good] = np.maximum(damping[good] * factor, LEAST_DAMPING)
        x[good] = moved[better]
        for name, own in vars(here).items():
            own[good] = vars(there)[name][better]
        matrix[live], gradient[live] = here.matrix[live], here.gradient[live]
        r, d = there.beyond[~better], there.slopes[~better]
        met = (r != 0) & (here.beyond[bad] == 0) & np.isfinite(there.chi2[~better])[:, None]
        before = r - (d @ step[~better, :-1, None])[..., 0]
        before, d = np.where(before * r > 0, 0.0, before), np.where(met[..., None], d, 0.0)
        matrix[bad, :-1, :-1] += np.swapaxes(d, 1, 2) @ d
        gradient[bad, :-1] += (before[:, None] @ d)[:, 0]
        damping[bad] *= np.where(refused[bad] | ~met.any(axis=1), 16.0, 1.0)
        refused[live] = ~better
    return x, here.chi2, damping


def information(problem: Problem, which: Ints, x: Array, known: Array, parts: int = 31) -> Array:
    """Return the information matrices (N, C, C): the normal matrices plus weak priors of positions and rotations.

    `known` (3,) has three numbers: the prior information on the position of a seen joint and of a hidden joint, both in
    1/m^2, and the factor of the information on rotations (`posekit.solver.modes.TURN_INFORMATION`).
    """
    p, joints, free = problem.records[which], x[:, :SIZE].reshape(-1, 14, 3), free_joints(parts)
    H = evaluate(problem, which, x, parts).matrix + FLOOR * np.eye(3 * len(free) + 1)
    place = np.where((p["image"][:, free] != 0).any(axis=(2, 3)), known[0], known[1])
    H[:, :-1, :-1] += np.repeat(place, 3, axis=1)[:, None] * np.eye(3 * len(free))
    some = np.isin(SEGMENT_ENDS, free[free >= 6])
    line, ends = INCIDENCE[some] @ joints, joints[:, SEGMENT_ENDS[some]]
    ray = ends if problem.perspective else np.broadcast_to([0.0, 0.0, 1.0], ends.shape)
    turn = ray - (dot(ray, line) / dot(line, line))[..., None] * line
    depth = np.abs(ends[..., 2]) if problem.perspective else 1.0
    noise = np.sqrt((p["image"][:, SEGMENT_ENDS[some]] ** 2).sum(axis=(2, 3)) / 2 / dot(line, line))
    size = norm(turn)
    info = known[2] * noise / norm(ray) / depth / np.where(size > 0, size, 1.0)
    turns = info[..., None, None] * turn[..., None] * turn[..., None, :]
    H[:, :-1, :-1] += _laid(turns, INCIDENCE[some][:, free])
    return H


def covariance(problem: Problem, which: Ints, x: Array, known: Array) -> Array:
    """Return the covariances of the joints (N, 42, 42)."""
    return np.asarray(np.linalg.inv(information(problem, which, x, known))[:, :SIZE, :SIZE])


def log_determinants(problem: Problem, which: Ints, x: Array, known: Array) -> Array:
    """Return the logarithms (N,) of the determinants of the information matrices."""
    return np.asarray(np.linalg.slogdet(information(problem, which, x, known))[1])


def distinct(
    problem: Problem,
    group: Ints,
    which: Ints,
    x: Array,
    parts: int,
    within: Array,
    reach: float,
    level: float,
    known: Array,
) -> Flags:
    """Return a mask (N,) of the distinct bodies of each group; of bodies that are the same, keep the lowest chi2.

    The bodies `x` (N, 43) are sorted by group, then by chi2. Two bodies are the same if no joint of the body parts
    `parts`, relative to the neck, differs by more than `within` (N,) metres. They are also the same if no joint differs
    by more than `reach` metres and their difference d in all unknowns has :math:`d^T H d` below `level`, with H the
    information matrix.
    """
    keep = np.zeros(len(which), dtype=np.bool_)
    free = free_joints(parts)
    joints = x[:, :SIZE].reshape(-1, 14, 3)
    joints = (joints - joints[:, :1])[:, free]
    column = np.append((3 * free[:, None] + np.arange(3)).ravel(), SIZE)
    edges = np.flatnonzero(np.diff(group, prepend=-1, append=-1))
    every = information(problem, which, x, known, parts) if reach else np.empty(0)
    for a, b in pairwise(edges.tolist()):
        kept: list[int] = []
        for k in range(a, b):
            apart = joints[kept] - joints[k]
            far = np.sqrt(dot(apart, apart).max(axis=1)) if kept else np.empty(0)
            near = np.array(kept, dtype=np.intp)[far < reach]
            same = bool((far < within[k]).any())
            if not same and near.size:
                d = (x[k] - x[near])[:, column]
                same = bool((np.einsum("ni,nij,nj->n", d, every[near], d) < level).any())
            if not same:
                kept.append(k)
        keep[kept] = True
    return keep
