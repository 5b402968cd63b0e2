"""The solver in NumPy: the same residuals, and the same steps, as `solver.cpp`, for all starts at once.

Unknowns x (N, 43) are the 14 joint positions and the logarithm of the shared size. `parts` says which are free: bit 0
the trunk (six joints and the size), bits 1 to 4 the limbs.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, Flags, Ints, cross, dot
from posekit.skeleton import SEGMENTS
from posekit.solver import limits as lim
from posekit.solver.limits import Limits

#: Records of `posekit.solver.problem.PROBLEM`, one a frame.
Records = NDArray[np.void]

SIZE: Final = 42
WIDTH: Final = 43
#: Added to every diagonal element, one over square metres: a joint that is not seen has none of its own.
FLOOR: Final = 1e-6

#: Radians by which limb angles are moved to differentiate what is judged of them.
ANGLE_STEP: Final = 1e-4

#: Sine or cosine down to which the angles' derivatives follow the directions at a pole.
LEAST_SINE: Final = 0.02

#: The same for the pelvis.
LEAST_COSINE: Final = 0.05

#: Metres by which joints are moved to differentiate residuals of the caller's own.
PULL_STEP: Final = 1e-6

#: Damping of a first step and the least one, added to every diagonal element, one over square metres.
#:
#: All directions are damped alike: a share of the diagonal, which image and lengths make stiff, would also hold the few
#: directions that these leave open.
FIRST_DAMPING: Final = 30.0
LEAST_DAMPING: Final = 1.0

#: Damping up to which a small gain means that a start has arrived, and above which no step is tried.
ARRIVED_DAMPING: Final = 3e3
MOST_DAMPING: Final = 1e6

#: Decrease of chi2 below which a start has arrived.
PRECISION: Final = 1e-2

#: Ends of the 17 segments, and the matrix (17, 14) that takes joints to segments.
SEGMENT_STARTS, SEGMENT_ENDS = np.sort(SEGMENTS, axis=1).T
INCIDENCE: Final = np.eye(14)[SEGMENT_ENDS] - np.eye(14)[SEGMENT_STARTS]

#: Limits in their order: three of the pelvis and four a limb, then the turn of four limbs about straight joints.
ROWS: Final = 19

#: Residuals (N, K), standard deviations, of postures (N, 14, 3): zero where nothing pulls.
Pull = Callable[[Array], Array]


def free_joints(parts: int) -> Flags:
    """Return which joints (14,) the parts free."""
    free = np.zeros(14, dtype=np.bool_)
    free[:6] = bool(parts & 1)
    for limb in range(4):
        free[[lim.MIDDLES[limb], lim.ENDS[limb]]] = bool(parts >> (limb + 1) & 1)
    return free


class Normal:
    """Normal equations of N postures.

    chi2 (N,), matrices (N, 43, 43) and gradients (N, 43), and limits beyond their ends: residuals (N, 19), zero within,
    with derivatives (N, 19, 43).
    """

    def __init__(self, count: int) -> None:
        self.chi2 = np.zeros(count)
        self.matrix, self.gradient = np.zeros((count, WIDTH, WIDTH)), np.zeros((count, WIDTH))
        self.beyond, self.slopes = np.zeros((count, ROWS)), np.zeros((count, ROWS, WIDTH))

    def add(self, r: Array, d: Array, columns: slice = slice(None)) -> None:
        """Add residuals (N, K) with derivatives (N, K, C) along some unknowns."""
        self.chi2 += dot(r, r)
        self.gradient[:, columns] += np.einsum("nkc,nk->nc", d, r)
        self.matrix[:, columns, columns] += d.transpose(0, 2, 1) @ d

    def put(self, rows: Ints, other: Normal, of: Flags | Ints | slice = slice(None)) -> None:
        """Overwrite the postures `rows` with the postures `of` of another instance."""
        for name, own in vars(self).items():
            own[rows] = getattr(other, name)[of]


def evaluate(
    problems: Records, limits: Limits | None, x: Array, parts: int, pull: Pull | None = None
) -> Normal:
    """Return the normal equations at x (N, 43); chi2 is infinite where it is not defined."""
    joints, free, out = x[:, :SIZE].reshape(-1, 14, 3), free_joints(parts), Normal(len(x))
    for j in np.flatnonzero(free).tolist():
        _image_terms(out, problems, joints[:, j], j)
    if parts & 1:
        weight = problems["root_weight"]
        out.add(np.einsum("nki,ni->nk", weight, joints[:, 0] - problems["root"]), weight, slice(0, 3))
        w = problems["size_weight"]
        out.add((w * x[:, SIZE])[:, None], w[:, None, None], slice(SIZE, WIDTH))
    _length_terms(out, problems, x, free, np.where(parts & 1, problems["size_weight"] > 0, False))
    # A size that is not varied keeps a unit on the diagonal.
    out.matrix[:, SIZE, SIZE] += problems["size_weight"] == 0
    if limits is not None:
        r, d = (one * problems["limit_weight"][0] for one in limit_rows(limits, joints, parts))
        out.beyond, out.slopes = r[:, :ROWS], d[:, :ROWS]
        out.add(r, d)
    if pull is not None:
        r = pull(joints)
        moved = np.repeat(x[:, None, :SIZE], SIZE, axis=1) + PULL_STEP * np.eye(SIZE)
        slopes = (pull(moved.reshape(-1, 14, 3)).reshape(len(x), SIZE, -1) - r[:, None]) / PULL_STEP
        out.add(r, np.where(r[:, None] != 0, slopes, 0.0).transpose(0, 2, 1), slice(0, SIZE))
    out.chi2[np.isnan(out.chi2)] = np.inf
    return out


def _image_terms(out: Normal, problems: Records, joint: Array, j: int) -> None:
    """Add the image point of one joint (N, 3); chi2 is infinite if it is behind the camera."""
    weight, perspective = problems["image"][:, j], problems["perspective"] > 0
    seen = (weight[:, 0, 0] != 0) | (weight[:, 1, 1] != 0)
    z = np.where(perspective, joint[:, 2], 1.0)
    inverse = 1 / np.where(z > 0, z, 1.0)
    place = joint[:, :2] * inverse[:, None]
    r = np.einsum("nik,nk->ni", weight, place - problems["ray"][:, j])
    d = np.empty((len(r), 2, 3))
    d[..., :2] = weight * inverse[:, None, None]
    d[..., 2] = -np.where(perspective, inverse, 0.0)[:, None] * np.einsum("nik,nk->ni", weight, place)
    # Robust (Geman & McClure): e / (1 + e / c^2), whose weight in the normal equations is the square of the factor.
    square = problems["robust"]
    keep = np.where(square > 0, square / np.where(square > 0, square + dot(r, r), 1.0), 1.0)
    out.chi2 += (keep - keep * keep) * dot(r, r) + np.where(seen & ~(z > 0), np.inf, 0.0)
    out.add(keep[:, None] * r, keep[:, None, None] * d, slice(3 * j, 3 * j + 3))


def _length_terms(out: Normal, problems: Records, x: Array, free: Flags, sized: Flags) -> None:
    """Add the 17 log-lengths; the curvature of a segment that turns is kept where it is positive."""
    some = free[SEGMENT_ENDS]
    line = INCIDENCE[some] @ x[:, :SIZE].reshape(-1, 14, 3)
    q, w = dot(line, line), problems["length_weight"][:, some]
    r = w * (0.5 * np.log(q) - problems["log_length"][:, some] - x[:, SIZE:])
    bend = np.sqrt(np.maximum(w * r, 0.0) / q)[..., None, None]
    across = np.eye(3) - line[..., None] * line[..., None, :] / q[..., None, None]
    # For each segment: its own derivative, and its turns in three directions.
    rows = np.concatenate([(w / q)[..., None, None] * line[..., None, :], bend * across], axis=2)
    d = np.zeros((*rows.shape[:3], WIDTH))
    d[..., :SIZE] = np.einsum("sj,nski->nskji", INCIDENCE[some] * free, rows).reshape(*rows.shape[:3], SIZE)
    d[:, :, 0, SIZE] = -np.where(sized[:, None], w, 0.0)
    residual = np.zeros(rows.shape[:3])
    residual[..., 0] = r
    out.add(residual.reshape(len(x), -1), d.reshape(len(x), -1, WIDTH))


def _pull(way: Array, other: Array, w: Array) -> tuple[Array, Array]:
    """Return how a part's turn, weighted with w (M, 3), changes with its first axis and the other direction."""
    length = np.sqrt(dot(way, way))
    first = way / length[:, None]
    lean = dot(first, other)
    off = other - lean[:, None] * first
    across = np.sqrt(dot(off, off))
    normal = cross(first, off / across[:, None])
    along = dot(w, first)
    on_first = (cross(w, first) - (along * lean / across)[:, None] * normal) / length[:, None]
    return on_first, (along / across)[:, None] * normal


def _put_turn(out: Array, joints: Array, torso: bool, between: bool, w: Array) -> None:
    """Add the derivative (M, 14, 3) of a part's turn, weighted with w, to `out`."""
    down, left, hips = (0, 3), (1, 2), (4, 5)
    first, other = (down, left) if torso else (hips, down if between else (3, 4))
    ways = [joints[:, b] - joints[:, a] for a, b in (first, other)]
    pulls = _pull(ways[0], ways[1], w)
    for (a, b), pull in zip((first, other), pulls, strict=True):
        out[:, b] += pull
        out[:, a] -= pull


def limit_rows(limits: Limits, joints: Array, parts: int) -> tuple[Array, Array]:
    """Return limits beyond their ends: radians (N, 23), zero within, and derivatives (N, 23, 43); see `ROWS`."""
    between = bool(limits.numbers["between_hips"])
    torso, hips = lim.torso_axes(joints), lim.hips_axes(joints, between)
    r, d = np.zeros((len(joints), ROWS + 4)), np.zeros((len(joints), ROWS + 4, WIDTH))
    if parts & 1:
        angles = lim.pelvis_angles(torso, hips) * lim.PELVIS_SIGNS
        low, high = limits.numbers["pelvis"].T
        angles -= 2 * np.pi * np.round((angles - (low + high) / 2) / (2 * np.pi))
        r[:, :3] = angles - np.clip(angles, low, high)
        row = np.flatnonzero((r[:, :3] != 0).any(axis=1))
        if len(row):
            d[row, :3, :SIZE] = _pelvis_slopes(
                joints[row], torso[row], hips[row, 2], r[row, :3] != 0, between
            )
    for limb in range(4):
        if not parts >> (limb + 1) & 1:
            continue
        frame, own = torso if limb < 2 else hips, slice(3 + 4 * limb, 7 + 4 * limb)
        angles = lim.limb_angles(frame, *lim.limb_directions(joints, limb))
        r[:, own], writing = limits.residual(limb, angles)
        row = np.flatnonzero((r[:, own] != 0).any(axis=1))
        if len(row):
            slopes = np.empty((len(row), 4, 4))
            for k in range(4):
                moved = angles[row].copy()
                moved[:, k] += ANGLE_STEP
                slopes[:, :, k] = (limits.residual(limb, moved, writing[row])[0] - r[row, own]) / ANGLE_STEP
            slopes[r[row, own] == 0] = 0.0
            bent = np.maximum(r[row, own][:, 3] * slopes[:, 3, 3], 0.0)
            found = _limb_slopes(
                joints[row], frame[row], limb, angles[row], slopes, bent, bool(parts & 1), between
            )
            d[row, own, :SIZE], d[row, ROWS + limb, :SIZE] = found[:, :4], found[:, 4]
    return r, d


def _pelvis_slopes(joints: Array, torso: Array, up: Array, beyond: Flags, between: bool) -> Array:
    """Return derivatives (M, 3, 42) of those of the pelvis's angles that are beyond their ends (M, 3)."""
    d = np.zeros((len(joints), 3, 14, 3))
    x, y, z = -np.einsum("nki,ni->kn", torso, up)
    h = np.sqrt(x * x + z * z)
    safe = np.where(h > 0, h, 1.0)
    axis = np.where(h > 0, -z / safe, 1.0)[:, None] * torso[:, 0] + (x / safe)[:, None] * torso[:, 2]
    square = np.maximum(h, LEAST_COSINE)[:, None] ** 2
    along = ((torso[:, 1] + y[:, None] * up) / square, axis, (up + y[:, None] * torso[:, 1]) / square)
    for k in range(3):
        w = np.where(beyond[:, k, None], lim.PELVIS_SIGNS[k] * along[k], 0.0)
        _put_turn(d[:, k], joints, False, between, w)
        _put_turn(d[:, k], joints, True, between, -w)
    return d.reshape(-1, 3, SIZE)


def _limb_slopes(
    joints: Array, frame: Array, limb: int, angles: Array, slopes: Array, bent: Array, trunk: bool, mid: bool
) -> Array:
    """Turn slopes (M, 4, 4) along a limb's four angles into derivatives (M, 5, 42) along joints.

    The last one is the limb's turn about a joint that is almost straight and `bent` beyond its end: how far it is bent
    grows on all sides, as the length of a segment that turns.
    """
    d = np.zeros((len(joints), 5, 14, 3))
    start, middle, end = lim.STARTS[limb], lim.MIDDLES[limb], lim.ENDS[limb]
    upper, lower = joints[:, middle] - joints[:, start], joints[:, end] - joints[:, middle]
    u, _ = lim.limb_directions(joints, limb)
    (ca, cg, ce), (sa, sg, se) = (f(angles[:, [0, 2, 3]]).T for f in (np.cos, np.sin))
    y = dot(frame[:, 1], u)
    cb = np.sqrt(np.maximum(1 - y * y, 0.0))
    a = sa[:, None] * frame[:, 2] - ca[:, None] * frame[:, 0]
    b = (sa * y)[:, None] * frame[:, 0] + cb[:, None] * frame[:, 1] + (ca * y)[:, None] * frame[:, 2]
    f = -sg[:, None] * a - cg[:, None] * b
    e = (ce * cg)[:, None] * a - (ce * sg)[:, None] * b - se[:, None] * u
    for k in range(4):
        s = slopes[:, k]
        on_c, on_e = s[:, 2] / np.maximum(se, LEAST_SINE), s[:, 3]
        on_a = (s[:, 0] + on_c * (cb * ce * sg + y * se) - on_e * cb * cg) / np.maximum(cb, LEAST_SINE)
        on_b = s[:, 1] + on_c * ce * cg + on_e * sg
        du = (on_a[:, None] * a + on_b[:, None] * b) / np.sqrt(dot(upper, upper))[:, None]
        dl = (on_c[:, None] * f + on_e[:, None] * e) / np.sqrt(dot(lower, lower))[:, None]
        d[:, k, middle] += du - dl
        d[:, k, end] += dl
        if trunk:
            d[:, k, start] -= du
            w = on_b[:, None] * a - on_a[:, None] * b + on_e[:, None] * f - on_c[:, None] * e
            _put_turn(d[:, k], joints, limb < 2, mid, w)
    turn = np.sqrt(np.maximum(bent * ce, 0.0) / np.maximum(se, LEAST_SINE))[:, None] * f
    du, dl = (turn / np.sqrt(dot(one, one))[:, None] for one in (upper, lower))
    d[:, 4, middle] -= du + dl
    d[:, 4, end] += dl
    if trunk:
        d[:, 4, start] += du
    return d.reshape(-1, 5, SIZE)


def descend(
    problems: Records,
    limits: Limits | None,
    which: Ints,
    start: Array,
    parts: int,
    most: int,
    hopeless: Array,
    damping: Array,
    pull: Pull | None = None,
) -> tuple[Array, Array, Array]:
    """Minimise chi2 from N starts by Levenberg-Marquardt.

    A refused step has met limits that are not violated where it started. They hold for the next step, too; otherwise
    it would run into them again.

    Parameters
    ----------
    problems : records (F,) of `posekit.solver.problem.PROBLEM`
        The frames.
    limits : Limits, optional
        Joint ranges.
    which : int array (N,)
        The frame of each start.
    start : array (N, 43)
        Joints, camera frame, metres, and the logarithm of the size.
    parts : int
        Parts of the body that are free, as bits.
    most : int
        Largest number of steps.
    hopeless : array (N,)
        A start whose chi2 is above this is given up if its step promises less than half of it.
    damping : array (N,)
        Damping of the first step: `FIRST_DAMPING`, or that of an earlier descent's end; infinite for no step.
    pull : callable, optional
        Further residuals of whole bodies.

    Returns
    -------
    x, chi2, damping : array (N, 43), (N,), (N,)
        Damping is infinite where a start has arrived or is given up.
    """
    free = free_joints(parts)
    column = np.flatnonzero(np.append(np.repeat(free, 3), bool(parts & 1)))
    x, damping = np.array(start, dtype=np.float64), np.array(damping, dtype=np.float64)
    refused = np.zeros(len(x), dtype=np.bool_)
    here = evaluate(problems[which], limits, x, parts, pull)
    # The model of the next step: what is here, and limits that a refused step has met.
    matrix, gradient = here.matrix.copy(), here.gradient.copy()
    live = np.flatnonzero(np.isfinite(here.chi2 + damping))
    for _ in range(most):
        slope, chi2 = gradient[live][:, column], here.chi2[live]
        damped = matrix[live][:, column[:, None], column] + (damping[live, None, None] + FLOOR) * np.eye(
            len(column)
        )
        step = np.asarray(-np.linalg.solve(damped, slope[..., None])[..., 0], dtype=np.float64)
        gain = dot(step, (damping[live, None] + FLOOR) * step - slope)
        arrived = (gain <= PRECISION) & (damping[live] <= ARRIVED_DAMPING)
        stop = arrived | (damping[live] > MOST_DAMPING) | ((chi2 > hopeless[live]) & (gain < 0.5 * chi2))
        damping[live[stop]] = np.inf
        live, step, gain, chi2 = live[~stop], step[~stop], gain[~stop], chi2[~stop]
        if not len(live):
            break
        moved = np.zeros((len(live), WIDTH))
        moved[:, column] = step
        there = evaluate(problems[which[live]], limits, x[live] + moved, parts, pull)
        better = there.chi2 <= chi2
        good, bad = live[better], live[~better]
        ratio = (chi2 - there.chi2)[better] / gain[better]
        factor = np.where(ratio > 0.75, 0.2, np.where(ratio < 0.25, 4.0, 1.0))
        damping[good] = np.maximum(damping[good] * factor, LEAST_DAMPING)
        x[good] += moved[better]
        here.put(good, there, better)
        r, d = there.beyond[~better], there.slopes[~better]
        met = (r != 0) & (here.beyond[bad] == 0) & np.isfinite(there.chi2[~better])[:, None]
        before = r - np.einsum("nkc,nc->nk", d, moved[~better])
        before, d = np.where(before * r > 0, 0.0, before), np.where(met[..., None], d, 0.0)
        matrix[live], gradient[live] = here.matrix[live], here.gradient[live]
        matrix[bad] += d.transpose(0, 2, 1) @ d
        gradient[bad] += np.einsum("nkc,nk->nc", d, before)
        damping[bad] *= np.where(refused[bad] | ~met.any(axis=1), 16.0, 1.0)
        refused[live] = ~better
    return x, here.chi2, damping


def information(
    problems: Records, limits: Limits | None, which: Ints, x: Array, known: Array, parts: int = 31
) -> Array:
    """Return the information (N, 43, 43) on the unknowns: the matrix, and what is `known` besides the residuals.

    `known` (3,) has three numbers: the information on the place of any joint, and of a hidden joint, both in 1/m^2; and
    the factor of the information on turns (`posekit.solver.modes.TURN_INFORMATION`).
    """
    H = evaluate(problems[which], limits, x, parts).matrix
    p, joints, index = problems[which], x[:, :SIZE].reshape(-1, 14, 3), np.arange(SIZE)
    seen = (p["image"] != 0).any(axis=(2, 3))
    H[:, index, index] += np.repeat(np.where(seen, known[0], known[1]), 3, axis=1)
    limbs = [k for k in range(4) if parts >> (k + 1) & 1]
    segments = [pair for k in limbs for pair in pairwise((lim.STARTS[k], lim.MIDDLES[k], lim.ENDS[k]))]
    perspective = p["perspective"] > 0
    for start, end in segments:
        line = joints[:, end] - joints[:, start]
        square = dot(line, line)
        ray = np.where(perspective[:, None], joints[:, end], [0.0, 0.0, 1.0])
        turn = ray - (dot(ray, line) / square)[:, None] * line
        size = np.sqrt(dot(turn, turn))
        depth = np.where(perspective, np.abs(joints[:, end, 2]), 1.0)
        weight = np.sqrt((p["image"][:, end] ** 2).sum(axis=(1, 2)) / 2 / square)
        info = known[2] * weight * size / np.sqrt(dot(ray, ray)) / depth
        turn = turn / np.where(size > 0, size, 1.0)[:, None]
        block = info[:, None, None] * turn[:, :, None] * turn[:, None, :]
        for a, b, sign in ((start, start, 1), (end, end, 1), (start, end, -1), (end, start, -1)):
            H[:, 3 * a : 3 * a + 3, 3 * b : 3 * b + 3] += sign * block
    return H


def covariance(problems: Records, limits: Limits | None, which: Ints, x: Array, known: Array) -> Array:
    """Return the covariances of the joints (N, 42, 42)."""
    H = information(problems, limits, which, x, known) + FLOOR * np.eye(WIDTH)
    return np.asarray(np.linalg.inv(H)[:, :SIZE, :SIZE])


def log_determinants(problems: Records, limits: Limits | None, which: Ints, x: Array, known: Array) -> Array:
    """Return the logarithms of the determinants of the information (N,)."""
    H = information(problems, limits, which, x, known) + FLOOR * np.eye(WIDTH)
    return np.asarray(np.linalg.slogdet(H)[1])


def distinct(
    problems: Records,
    limits: Limits | None,
    group: Ints,
    which: Ints,
    x: Array,
    parts: int,
    within: Array,
    reach: float,
    level: float,
    known: Array,
) -> Flags:
    """Return which bodies (N,), the best first in each group, differ from all that are kept before them.

    Bodies are one if none of the joints of `parts`, relative to the neck, is farther than `within` (N,) apart; or none
    farther than `reach`, and :math:`d^T H d` of their difference is below `level`.
    """
    keep = np.zeros(len(which), dtype=np.bool_)
    joints = x[:, :SIZE].reshape(-1, 14, 3)
    joints = (joints - joints[:, :1])[:, free_joints(parts)]
    edges = np.flatnonzero(np.diff(group, prepend=-1, append=-1))
    every = information(problems, limits, which, x, known, parts) if reach else np.empty(0)
    for a, b in pairwise(edges.tolist()):
        kept: list[int] = []
        for k in range(a, b):
            apart = joints[kept] - joints[k]
            far = np.sqrt(dot(apart, apart).max(axis=1)) if kept else np.empty(0)
            near = np.array(kept, dtype=np.intp)[far < reach]
            same = bool((far < within[k]).any())
            if not same and near.size:
                d = x[k] - x[near]
                same = bool((np.einsum("ni,nij,nj->n", d, every[near], d) < level).any())
            if not same:
                kept.append(k)
        keep[kept] = True
    return keep
