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
    """Normal equations of N postures: chi2 (N,), matrices (N, 43, 43) and gradients (N, 43)."""

    def __init__(self, count: int) -> None:
        self.chi2 = np.zeros(count)
        self.matrix, self.gradient = np.zeros((count, WIDTH, WIDTH)), np.zeros((count, WIDTH))

    def add(self, r: Array, d: Array, columns: slice) -> None:
        """Add residuals (N, K) with derivatives (N, K, C) along some unknowns."""
        self.chi2 += dot(r, r)
        self.gradient[:, columns] += np.einsum("nkc,nk->nc", d, r)
        self.matrix[:, columns, columns] += np.einsum("nkc,nkd->ncd", d, d)


def evaluate(
    problems: Records, limits: Limits | None, x: Array, parts: int, pull: Pull | None = None
) -> tuple[Array, Array, Array]:
    """Return chi2 (N,), and the matrices (N, 43, 43) and gradients (N, 43) of the normal equations."""
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
        for row, terms, slopes in _limit_rows(limits, joints, parts):
            weight = problems["limit_weight"][row, None]
            r, d = terms * weight, slopes * weight[..., None]
            out.chi2[row] += dot(r, r)
            out.gradient[row] += np.einsum("mkc,mk->mc", d, r)
            out.matrix[row] += d.transpose(0, 2, 1) @ d
    if pull is not None:
        r = pull(joints)
        moved = np.repeat(x[:, None, :SIZE], SIZE, axis=1) + PULL_STEP * np.eye(SIZE)
        slopes = (pull(moved.reshape(-1, 14, 3)).reshape(len(x), SIZE, -1) - r[:, None]) / PULL_STEP
        out.add(r, np.where(r[:, None] != 0, slopes, 0.0).transpose(0, 2, 1), slice(0, SIZE))
    return np.where(np.isnan(out.chi2), np.inf, out.chi2), out.matrix, out.gradient


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
    joints = x[:, :SIZE].reshape(-1, 14, 3)
    for s, pair in enumerate(SEGMENTS):
        a, b = sorted(pair)
        if not free[b]:
            continue
        ends = [(b, 1.0), (a, -1.0)] if free[a] else [(b, 1.0)]
        line, w = joints[:, b] - joints[:, a], problems["length_weight"][:, s]
        q = dot(line, line)
        r = w * (0.5 * np.log(q) - problems["log_length"][:, s] - x[:, SIZE])
        t, bend = (w / q)[:, None] * line, np.maximum(w * r, 0.0) / q
        block = t[:, :, None] * t[:, None, :] + bend[:, None, None] * np.eye(3)
        block -= (bend / q)[:, None, None] * line[:, :, None] * line[:, None, :]
        along = np.where(sized, w, 0.0)
        out.chi2 += r * r
        for i, sign in ends:
            own = slice(3 * i, 3 * i + 3)
            out.gradient[:, own] += sign * t * r[:, None]
            out.matrix[:, own, SIZE] -= sign * along[:, None] * t
            out.matrix[:, SIZE, own] -= sign * along[:, None] * t
            for k, other in ends:
                out.matrix[:, own, 3 * k : 3 * k + 3] += sign * other * block
        out.gradient[:, SIZE] -= along * r
        out.matrix[:, SIZE, SIZE] += along * along


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


def _limit_rows(limits: Limits, joints: Array, parts: int) -> list[tuple[Ints, Array, Array]]:
    """Return violated limits: rows (M,), radians beyond (M, K), and derivatives (M, K, 43)."""
    between = bool(limits.numbers["between_hips"])
    torso, hips = lim.torso_frame(joints), lim.hips_frame(joints, between)
    out = []
    if parts & 1:
        angles = lim.pelvis_angles(torso, hips) * lim.PELVIS_SIGNS
        low, high = limits.numbers["pelvis"].T
        angles -= 2 * np.pi * np.round((angles - (low + high) / 2) / (2 * np.pi))
        r = angles - np.clip(angles, low, high)
        row = np.flatnonzero((r != 0).any(axis=1))
        d = np.zeros((len(row), 3, 14, 3))
        if len(row):
            R, up = torso[row], hips[row, 2]
            x, y, z = -np.einsum("nki,ni->kn", R, up)
            h = np.sqrt(x * x + z * z)
            safe = np.where(h > 0, h, 1.0)
            axis = np.where(h > 0, -z / safe, 1.0)[:, None] * R[:, 0] + (x / safe)[:, None] * R[:, 2]
            square = np.maximum(h, LEAST_COSINE)[:, None] ** 2
            along = ((R[:, 1] + y[:, None] * up) / square, axis, (up + y[:, None] * R[:, 1]) / square)
            for k in range(3):
                w = np.where(r[row, k, None] != 0, lim.PELVIS_SIGNS[k] * along[k], 0.0)
                _put_turn(d[:, k], joints[row], False, between, w)
                _put_turn(d[:, k], joints[row], True, between, -w)
        out.append((row, r[row], _padded(d)))
    for limb in range(4):
        if not parts >> (limb + 1) & 1:
            continue
        frame = torso if limb < 2 else hips
        angles = lim.limb_angles(frame, *lim.limb_directions(joints, limb))
        r, writing = limits.residual(limb, angles)
        row = np.flatnonzero((r != 0).any(axis=1))
        d = np.zeros((len(row), 4, 14, 3))
        if len(row):
            slopes = np.empty((len(row), 4, 4))
            for k in range(4):
                moved = angles[row].copy()
                moved[:, k] += ANGLE_STEP
                slopes[:, :, k] = (limits.residual(limb, moved, writing[row])[0] - r[row]) / ANGLE_STEP
            slopes[r[row] == 0] = 0.0
            _put_limb(d, joints[row], frame[row], limb, angles[row], slopes, bool(parts & 1), between)
        out.append((row, r[row], _padded(d)))
    return [one for one in out if len(one[0])]


def _put_limb(
    d: Array, joints: Array, frame: Array, limb: int, angles: Array, slopes: Array, trunk: bool, mid: bool
) -> None:
    """Turn slopes (M, 4, 4) along a limb's four angles into derivatives d (M, 4, 14, 3) along joints."""
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


def _padded(d: Array) -> Array:
    """Append the size's zero column: (M, K, 14, 3) to (M, K, 43)."""
    flat = d.reshape(*d.shape[:2], SIZE)
    return np.concatenate([flat, np.zeros((*d.shape[:2], 1))], axis=2)


def descend(
    problems: Records,
    limits: Limits | None,
    which: Ints,
    start: Array,
    parts: int,
    most: int,
    precision: float,
    hopeless: Array,
    pull: Pull | None = None,
) -> tuple[Array, Array, Ints]:
    """Minimise chi2 from N starts by Levenberg-Marquardt.

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
        What is free.
    most : int
        Largest number of steps.
    precision : float
        Decrease of chi2 below which a start has arrived.
    hopeless : array (N,)
        A start whose chi2 is above this is given up if its step promises less than half of it.
    pull : callable, optional
        Further residuals of whole bodies.

    Returns
    -------
    x, chi2, steps : array (N, 43), (N,), int array (N,)
    """
    free = free_joints(parts)
    column = np.flatnonzero(np.append(np.repeat(free, 3), bool(parts & 1)))
    diagonal = np.arange(len(column))
    x, damping = np.array(start, dtype=np.float64), np.full(len(start), 1e-4)
    steps, live = np.zeros(len(start), dtype=np.int64), np.arange(len(start))
    chi2, H, g = evaluate(problems[which], limits, x, parts, pull)
    for _ in range(most):
        live = live[np.isfinite(chi2[live])]
        if not len(live):
            break
        matrix = H[live][:, column[:, None], column]
        slope = g[live][:, column]
        added = np.asarray(np.einsum("nii->ni", matrix) * damping[live, None] + FLOOR)
        matrix[:, diagonal, diagonal] += added
        step = np.asarray(-np.linalg.solve(matrix, slope[..., None])[..., 0], dtype=np.float64)
        gain = -dot(step, slope) + dot(added, step * step)
        stop = (
            ((gain <= precision) & (damping[live] <= 0.1))
            | (damping[live] > 1e6)
            | ((chi2[live] > hopeless[live]) & (gain < 0.5 * chi2[live]))
        )
        live, step, gain = live[~stop], step[~stop], gain[~stop]
        if not len(live):
            break
        steps[live] += 1
        there = x[live].copy()
        there[:, column] += step
        value, matrix, slope = evaluate(problems[which[live]], limits, there, parts, pull)
        better = value <= chi2[live]
        ratio = np.where(better, (chi2[live] - np.where(better, value, 0.0)) / gain, 0.0)
        factor = np.where(ratio > 0.75, 0.1, np.where(ratio < 0.25, 4.0, 1.0))
        damping[live] = np.where(better, np.maximum(damping[live] * factor, 1e-12), damping[live] * 8)
        good = live[better]
        x[good], chi2[good], H[good], g[good] = there[better], value[better], matrix[better], slope[better]
    return x, chi2, steps


def information(problems: Records, limits: Limits | None, which: Ints, x: Array, known: Array) -> Array:
    """Return the information (N, 43, 43) on the unknowns: the matrix, and what is `known` besides the residuals.

    `known` (3,) are the information on any place and on a hidden joint about its mode, one over square metres, and the
    factor of the information on turns (`posekit.solver.modes.TURN_INFORMATION`).
    """
    _, H, _ = evaluate(problems[which], limits, x, 31)
    p, joints, index = problems[which], x[:, :SIZE].reshape(-1, 14, 3), np.arange(SIZE)
    seen = (p["image"] != 0).any(axis=(2, 3))
    H[:, index, index] += np.repeat(np.where(seen, known[0], known[1]), 3, axis=1)
    perspective = p["perspective"] > 0
    for start, end in (*zip(lim.STARTS, lim.MIDDLES, strict=True), *zip(lim.MIDDLES, lim.ENDS, strict=True)):
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


def log_determinants(problems: Records, limits: Limits | None, which: Ints, x: Array, known: Array) -> Array:
    """Return the logarithms of the determinants of the information (N,)."""
    H = information(problems, limits, which, x, known) + FLOOR * np.eye(WIDTH)
    return np.asarray(np.linalg.slogdet(H)[1])


def separate(
    problems: Records,
    limits: Limits | None,
    which: Ints,
    x: Array,
    known: Array,
    within: float,
    reach: float,
    level: float,
) -> Flags:
    """Return which bodies (N,), by frame and the best first, differ from all that are kept before them.

    Bodies are one if no joint, relative to the neck, is farther than `within` apart; or none farther than `reach`, and
    :math:`d^T H d` of their difference is below `level`.
    """
    keep = np.zeros(len(which), dtype=np.bool_)
    joints = x[:, :SIZE].reshape(-1, 14, 3)
    joints = joints - joints[:, :1]
    edges = np.flatnonzero(np.diff(which, prepend=-1, append=-1))
    every = information(problems, limits, which, x, known)
    for a, b in pairwise(edges.tolist()):
        kept: list[int] = []
        for k in range(a, b):
            apart = joints[kept] - joints[k]
            far = np.sqrt(dot(apart, apart).max(axis=1)) if kept else np.empty(0)
            near = np.array(kept, dtype=np.intp)[far < reach]
            same = bool((far < within).any())
            if not same and near.size:
                d = x[k] - x[near]
                same = bool((np.einsum("ni,nij,nj->n", d, every[near], d) < level).any())
            if not same:
                kept.append(k)
        keep[kept] = True
    return keep


def distinct(group: Ints, points: Array, within: float) -> Flags:
    """Return which rows (N,), best first in each group, have a joint farther than `within` from all kept before."""
    keep = np.zeros(len(group), dtype=np.bool_)
    edges = np.flatnonzero(np.diff(group, prepend=-1, append=-1))
    for a, b in pairwise(edges.tolist()):
        kept: list[int] = []
        for k in range(a, b):
            apart = points[kept] - points[k]
            if not kept or (np.einsum("npi,npi->np", apart, apart).max(axis=1) >= within**2).all():
                kept.append(k)
        keep[kept] = True
    return keep
