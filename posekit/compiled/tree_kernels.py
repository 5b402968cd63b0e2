"""The tree's bookkeeping as plain loops: they read, count and move, and calculate nothing of bodies.

Every function here also runs as it is, slowly. A node is a column of integers: its frame, its code, and which of its
candidates each joint has (the branches of the joint's path, the last the lowest bit; 0 for a point that was given).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from posekit.cameras.camera import COINCIDENT
from posekit.geometry import Array

OPEN, NO_SOLUTION, COINCIDENT_ENDS, BEHIND_CAMERA, MISSING = range(5)
"""The values of `posekit.tree.candidates.Branch`, as plain numbers."""

FRAME, CODE, PATHS = range(3)
"""Rows of a node's column."""

WHY = 2
"""Column of a lost node, after frame and code: its state, or the place of the check that rejected it."""

GROUP, OF_FRAME, LOST, PLACE = range(4)
"""Columns of a lost node in the end: who rejected it, frame, code and place."""

Ints = NDArray[np.int32]
Bytes = NDArray[np.int8]


def lift(
    begin: int,
    end: int,
    rays: Array,
    unseen: NDArray[np.bool_],
    parents: NDArray[np.int64],
    first: NDArray[np.int64],
    lengths: Array,
    tolerance: float,
    table: Array,
    states: Bytes,
    reach: Array,
) -> None:
    """Lift all joints of some frames, as `posekit.tree.candidates` does with a pinhole camera, to the last bit.

    Parameters
    ----------
    begin, end : int
        The frames.
    rays : array (F, J, 3)
    unseen : bool array (F, J)
    parents : array (J,)
    lengths : array (J, F)
    first : int array (J + 1,)
    tolerance : float
    table, states, reach
        Of `Candidates`: filled; the root is there.
    """
    widest = max(tolerance, 0.0)
    for f in range(begin, end):
        for j in range(1, len(parents)):
            x, y, z, length = rays[f, j, 0], rays[f, j, 1], rays[f, j, 2], lengths[j, f]
            start = first[parents[j]]
            for w in range(first[parents[j] + 1] - start):
                sx, sy, sz = table[f, start + w, 0], table[f, start + w, 1], table[f, start + w, 2]
                along = sx * x + sy * y + sz * z
                hx, hy, hz = sx - along * x, sy - along * y, sz - along * z
                height = np.sqrt(hx * hx + hy * hy + hz * hz)
                excess = height - length
                half = np.sqrt(np.maximum((length - height) * (length + height), 0.0))
                tangent = half <= COINCIDENT
                if tangent:
                    half = 0.0
                reachable = excess <= widest or (tangent and excess <= 0.0)
                near, far = along - half, along + half
                near_valid = reachable and near > 0.0
                far_valid = reachable and far > 0.0 and not tangent
                a = first[j] + 2 * w
                if unseen[f, j] or np.isnan(sx) or np.isnan(sy) or np.isnan(sz):
                    states[f, a], states[f, a + 1] = OPEN, MISSING
                elif excess > tolerance and not (near_valid or far_valid):
                    states[f, a], states[f, a + 1] = NO_SOLUTION, NO_SOLUTION
                else:
                    states[f, a] = OPEN if near_valid else BEHIND_CAMERA
                    states[f, a + 1] = OPEN if far_valid else COINCIDENT_ENDS if near_valid else BEHIND_CAMERA
                for b in range(2):
                    depth = far if b == 1 else near
                    if states[f, a + b] != OPEN:
                        depth = np.nan
                    table[f, a + b, 0], table[f, a + b, 1], table[f, a + b, 2] = (
                        depth * x,
                        depth * y,
                        depth * z,
                    )
                    reach[f, a + b] = excess


def branch(nodes: Ints, joint: int, parent: int, states: Bytes, first: int) -> tuple[Ints, Ints]:
    """Give nodes their two successors and part the open ones from the rest.

    Parameters
    ----------
    nodes : int array (2 + J + 1, N)
    joint, parent : int
        The new joint, and the one it hangs on.
    states : int array (F, T)
        What became of each candidate.
    first : int
        The column of the new joint's first candidate.

    Returns
    -------
    nodes : int array (2 + J + 1, M)
        The open ones.
    shut : int array (2N - M, 3)
        Frame, code and state of the others.
    """
    n = nodes.shape[1]
    source, shut = np.empty(2 * n, np.int32), np.empty((2 * n, 3), np.int32)
    alive = dead = 0
    for i in range(n):
        for b in range(2):
            state = states[nodes[FRAME, i], first + (nodes[PATHS + parent, i] << 1 | b)]
            if state == OPEN:
                source[alive] = i << 1 | b
                alive += 1
            else:
                shut[dead, FRAME], shut[dead, CODE], shut[dead, WHY] = (
                    nodes[FRAME, i],
                    nodes[CODE, i] << 1 | b,
                    state,
                )
                dead += 1
    longer = np.empty((nodes.shape[0], alive), np.int32)
    for k in range(PATHS + joint):
        for i in range(alive):
            longer[k, i] = nodes[k, source[i] >> 1]
    for i in range(alive):
        longer[CODE, i] = longer[CODE, i] << 1 | (source[i] & 1)
        longer[PATHS + joint, i] = longer[PATHS + parent, i] << 1 | (source[i] & 1)
    for k in range(PATHS + joint + 1, nodes.shape[0]):
        for i in range(alive):
            longer[k, i] = 0
    return longer, shut[:dead]


def pose(nodes: Ints, tips: Ints, bits: Ints, joints: Ints, first: Ints, table: Array) -> tuple[Array, Ints]:
    """Find the distinct choices of some branches among nodes that are sorted by frame, and place points in each.

    Parameters
    ----------
    nodes : int array (2 + J + 1, N)
    tips, bits : int array (S,)
        Joints whose paths, of each so many last branches, together are the branches in question.
    joints, first : int array (P,)
        Each point's joint, and the column of its first candidate.
    table : array (F, T, 3)
        All candidates.

    Returns
    -------
    points : array (R, P, 3)
    row : int array (N,)
        Which choice each node has.
    """
    n, width = nodes.shape[1], 1
    row = np.zeros(n, np.int32)
    for k in range(len(tips)):
        width <<= bits[k]
        mask = (1 << bits[k]) - 1
        for i in range(n):
            row[i] = row[i] << bits[k] | nodes[PATHS + tips[k], i] & mask
    chosen = np.empty(n, np.int32)
    last, at = np.full(width, -1, np.int32), np.empty(width, np.int32)
    count = 0
    for i in range(n):
        choice, f = row[i], nodes[FRAME, i]
        if last[choice] != f:
            last[choice], at[choice] = f, count
            chosen[count] = i
            count += 1
        row[i] = at[choice]
    points = np.empty((count, len(joints), 3))
    for k in range(count):
        i = chosen[k]
        f = nodes[FRAME, i]
        for p in range(len(joints)):
            column = first[p] + nodes[PATHS + joints[p], i]
            points[k, p, 0] = table[f, column, 0]
            points[k, p, 1] = table[f, column, 1]
            points[k, p, 2] = table[f, column, 2]
    return points, row


def part(nodes: Ints, row: Ints, places: Bytes) -> tuple[Ints, Ints]:
    """Part nodes by the verdict on their choice: those that passed, and frame, code and place of the others (M, 3)."""
    n = nodes.shape[1]
    source = np.empty(n, np.int32)
    lost = np.empty((n, 3), np.int32)
    alive = dead = 0
    for i in range(n):
        where = places[row[i]]
        if where < 0:
            source[alive] = i
            alive += 1
        else:
            lost[dead, FRAME], lost[dead, CODE], lost[dead, WHY] = nodes[FRAME, i], nodes[CODE, i], where
            dead += 1
    kept = np.empty((nodes.shape[0], alive), np.int32)
    for k in range(nodes.shape[0]):
        for i in range(alive):
            kept[k, i] = nodes[k, source[i]]
    return kept, lost[:dead]


def sort(lost: Ints, groups: int) -> tuple[Ints, Ints, Bytes, NDArray[np.int64]]:
    """Sort lost nodes (M, 4) by who rejected them, else left in order.

    Returns
    -------
    frame, code, place : int array (M,)
    start : int array (groups + 1,)
        Where each group's start and the last ends.
    """
    start = np.zeros(groups + 1, np.int64)
    for i in range(len(lost)):
        start[lost[i, GROUP] + 1] += 1
    for g in range(groups):
        start[g + 1] += start[g]
    at = start.copy()
    frame, code = np.empty(len(lost), np.int32), np.empty(len(lost), np.int32)
    place = np.empty(len(lost), np.int8)
    for i in range(len(lost)):
        k = at[lost[i, GROUP]]
        at[lost[i, GROUP]] += 1
        frame[k], code[k], place[k] = lost[i, OF_FRAME], lost[i, LOST], lost[i, PLACE]
    return frame, code, place, start


COMPILED = {
    "lift": (
        "(i8, i8, f8[:, :, ::1], b1[:, ::1], i8[::1], i8[::1], f8[:, ::1], f8, "
        "f8[:, :, ::1], i1[:, ::1], f8[:, ::1])"
    ),
    "branch": "(i4[:, ::1], i8, i8, i1[:, ::1], i8)",
    "pose": "(i4[:, ::1], i4[::1], i4[::1], i4[::1], i4[::1], f8[:, :, ::1])",
    "part": "(i4[:, ::1], i4[::1], i1[::1])",
    "sort": "(i4[:, ::1], i8)",
}
"""The kernels, in the order in which they need each other, with the types they take."""
