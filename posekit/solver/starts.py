"""Initial positions for the solver: seen joints near and far on their rays, hidden joints in many directions."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.body.lengths import hips_points, torso_points
from posekit.geometry import Array, Flags, Ints, best_rotation, cross, dot, unit
from posekit.skeleton import PARENTS, SEGMENT_NAMES, SEGMENTS
from posekit.solver.limits import ENDS, MIDDLES, STARTS
from posekit.solver.problem import Problem

TRUNK: Final = 6
TRUNK_SEGMENTS: Final = tuple(k for k, pair in enumerate(SEGMENTS) if max(pair) < TRUNK)
#: Index of the segment from each joint's parent to the joint.
LIFTED: Final = {max(pair): k for k, pair in enumerate(SEGMENTS[:13])}

#: Distances at which an unknown neck starts, as fractions of the largest distance at which the trunk fits its image.
DEPTHS: Final = np.array([1.02, 0.95, 0.87, 0.78, 0.68])

#: Distance at which a neck starts if fewer than two joints of the trunk are seen.
UNSEEN_TRUNK_METRES: Final = 5.0


def sphere(count: int) -> Array:
    """Return unit vectors (count, 3) spread evenly over the sphere (Fibonacci lattice)."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + np.sqrt(5)) * k
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)


#: Directions (30, 3) in which a hidden joint starts from its neighbour.
DIRECTIONS: Final = sphere(30)

#: Offsets of hidden hips from the hips of a straight trunk, metres: a pelvis rotates by up to about 20 degrees.
HIP_PLACES: Final = np.concatenate([np.zeros((1, 3)), 0.08 * sphere(8)])


def lift(problem: Problem, frame: Ints, joint: int, start: Array, length: Array, far: Flags | bool) -> Array:
    """Return the near or the far positions (N, 3) of a joint on its ray, at `length` (N,) from `start` (N, 3).

    If a segment is too short to reach the ray, its end is the point of the ray nearest to its start.
    """
    o, d = (one[frame, joint] for one in problem.rays)
    foot = o + dot(start - o, d)[:, None] * d
    off = foot - start
    half = np.sqrt(np.maximum(length * length - dot(off, off), 0.0))
    return np.asarray(foot + np.where(far, half, -half)[:, None] * d)


def necks(problem: Problem) -> tuple[Ints, Array]:
    """Return frames (K,), ascending, and initial positions (K, 3) of their necks, metres."""
    rooted, p, (origins, directions) = problem.rooted, problem.records, problem.rays
    deep = (p["root_weight"][:, 2, 2] > 0) & problem.seen_joints[:, 0]
    known = rooted | deep | (not problem.perspective)
    # If only its depth is known, the neck is the point of its ray at that depth.
    root, origin, ray = (one[known] for one in (p["root"], origins[:, 0], directions[:, 0]))
    beside = origin + ((root - origin)[:, 2] / ray[:, 2])[:, None] * ray
    frames, places = [np.flatnonzero(known)], [np.where(rooted[known, None], root, beside)]
    open_ = np.flatnonzero(~known)
    if open_.size:
        d, seen = directions[open_], problem.seen_joints[open_]
        a, b = np.array([SEGMENTS[k] for k in TRUNK_SEGMENTS]).T
        sine = np.linalg.norm(cross(d[:, a], d[:, b]), axis=2)
        both = seen[:, a] & seen[:, b] & (sine > 1e-6)
        length = np.exp(p["log_length"][open_][:, TRUNK_SEGMENTS])
        farthest = np.where(both, length / np.where(both, sine, 1.0), np.inf).min(axis=1)
        farthest = np.where(np.isfinite(farthest), farthest, UNSEEN_TRUNK_METRES)
        # A hidden neck starts on the mean ray of the trunk.
        mean = np.einsum("fji,fj->fi", d[:, :TRUNK], seen[:, :TRUNK].astype(float))
        ray = np.where(seen[:, :1], d[:, 0], mean / np.maximum(np.linalg.norm(mean, axis=1), 1e-9)[:, None])
        frames.append(np.repeat(open_, len(DEPTHS)))
        places.append(((farthest[:, None] * DEPTHS)[..., None] * ray[:, None]).reshape(-1, 3))
    frame = np.concatenate(frames)
    order = np.argsort(frame, kind="stable")
    return frame[order], np.concatenate(places)[order]


def branches(
    problem: Problem, frame: Ints, joint: int, start: Array, ways: Array, hidden: Ints | int
) -> tuple[Ints, Array]:
    """Place a joint around its parent's positions `start` (N, 3); return rows of `start` (S,) and positions (S, 3).

    A seen joint is placed near and far on its ray. A hidden joint is placed once in each of the first `hidden`
    directions of `ways` (N, W, 3).
    """
    seen = problem.seen_joints[frame, joint]
    row = np.repeat(np.arange(len(frame)), np.where(seen, 2, hidden))
    way = np.arange(len(row)) - np.searchsorted(row, row)
    length = np.exp(problem.records["log_length"][frame[row], LIFTED[joint]])
    on_ray = lift(problem, frame[row], joint, start[row], length, way == 1)
    around = start[row] + length[:, None] * ways[row, way]
    return row, np.where(seen[row, None], on_ray, around)


def trunk_starts(problem: Problem) -> tuple[Ints, Array]:
    """Return frames (S,), ascending, and trunks (S, 6, 3) for every neck and every near-far choice of seen joints."""
    frame, neck = necks(problem)
    trunk = np.zeros((len(frame), TRUNK, 3))
    trunk[:, 0] = neck
    for joint in range(1, TRUNK):
        anywhere = np.zeros((len(frame), 2, 3))
        row, place = branches(problem, frame, joint, trunk[:, PARENTS[joint]], anywhere, 1)
        frame, trunk = frame[row], trunk[row]
        trunk[:, joint] = place
        if joint in (3, 5):  # a hidden pelvis is needed before the hips are lifted from it
            frame, trunk = _filled(problem, frame, trunk, slice(0 if joint == 3 else 4, joint + 1))
    return frame, trunk


def _filled(problem: Problem, frame: Ints, trunk: Array, part: slice) -> tuple[Ints, Array]:
    """Place the hidden joints of torso or hips by fitting a straight trunk of the person's lengths to seen joints.

    Fewer than three seen joints leave a rotation undetermined. The trunk is then fitted with many different rotations,
    each of which turns a point beside the trunk towards one of `DIRECTIONS`.
    """
    seen = np.arange(TRUNK) < part.start + np.zeros((len(frame), 1))
    seen[:, part] = problem.seen_joints[frame, part]
    whole = seen[:, : part.stop].all(axis=1)
    frames, trunks = [frame[whole]], [trunk[whole]]
    for pattern in np.unique(seen[~whole], axis=0):
        rows = np.flatnonzero((seen == pattern).all(axis=1))
        body = np.stack([_template(one) for one in np.exp(problem.records["log_length"][frame[rows]])])
        given = trunk[rows][:, pattern]
        source, target = body[:, pattern], given
        for turn in DIRECTIONS if pattern.sum() < 3 else np.zeros((1, 3)):
            if turn.any():
                centre = (given if pattern.any() else trunk[rows, :1]).mean(axis=1, keepdims=True)
                source = np.concatenate([body[:, pattern], body[:, :1] + [0.3, 0.1, 0.2]], axis=1)
                target = np.concatenate([given, centre + 0.3 * turn], axis=1)
            a, b = source.mean(axis=1, keepdims=True), target.mean(axis=1, keepdims=True)
            R, _ = best_rotation(np.einsum("rki,rkj->rij", target - b, source - a))
            laid = np.einsum("rij,rkj->rki", R, body - a) + b
            for aside in HIP_PLACES if part.start else HIP_PLACES[:1]:
                trunks.append(np.where(pattern[:, None], trunk[rows], laid + aside))
                frames.append(frame[rows])
    frame = np.concatenate(frames)
    order = np.argsort(frame, kind="stable")
    return frame[order], np.concatenate(trunks)[order]


def _template(lengths: Array) -> Array:
    """Return the joints (6, 3) of a straight trunk with given lengths (17,), metres."""
    named = dict(zip(SEGMENT_NAMES, lengths.tolist(), strict=True))
    torso, hips = torso_points(named), hips_points(named)
    return np.concatenate([torso, torso[3] + hips[1:]])


def limb_starts(problem: Problem, frame: Ints, trunk: Array, limb: int) -> tuple[Ints, Array]:
    """Return rows of trunks (S,), ascending, and initial positions (S, 2, 3) of elbow and wrist, or knee and ankle.

    Parameters
    ----------
    problem : Problem
        Data of the frames.
    frame : int array (T,)
        Frame of each trunk.
    trunk : array (T, 6, 3)
        Joint positions, metres.
    limb : int
        Index in `posekit.solver.limits.LIMBS`.
    """
    start, count = trunk[:, STARTS[limb]], len(DIRECTIONS)
    around = np.broadcast_to(DIRECTIONS, (len(frame), count, 3))
    row, middle = branches(problem, frame, MIDDLES[limb], start, around, count)
    # After a hidden middle joint, the lower segment continues straight, folds back, or is at a right angle.
    upper = unit(middle - start[row])
    side = unit(cross(upper, np.where(np.abs(upper[:, 1:2]) < 0.9, [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])))
    bent = np.stack([upper, -upper, side] * (count // 3), axis=1)
    seen = problem.seen_joints[frame[row], MIDDLES[limb]]
    around = np.where(seen[:, None, None], DIRECTIONS, bent)
    again, end = branches(problem, frame[row], ENDS[limb], middle, around, np.where(seen, count, 3))
    return row[again], np.stack([middle[again], end], axis=1)
