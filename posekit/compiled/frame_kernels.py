"""Whole trees as one plain loop, for `posekit.compiled.compiling`: a frame's nodes never leave a core's cache.

Every function here also runs as it is, slowly. `screen` is left to be filled in: by the kernels of the checks' rules
(`posekit.tree.Rule`). What it is not sure of ends the frame, which is then grown by NumPy (`posekit.tree.plain`).

A node is a row of integers: its code, then which of its candidates each joint has (the branches of the joint's path,
the last the lowest bit).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.compiled.tree_kernels import (
    CODE_OF_LOST,
    GROUP_COLUMN,
    IS_OPEN,
    OF_FRAME,
    PLACE_COLUMN,
    Bytes,
    Ints,
    lift,
)
from posekit.compiled.verdicts import NO_VIOLATION, NOT_CLEAR
from posekit.geometry import Array

CODE_COLUMN, PATH_COLUMNS = 0, 1
"""Columns of a node's row."""

UNJUDGED_STATES = 4
"""States of nodes that no check judges: at every level the first groups, before those of the checks."""

FRAME_SHIFT, PLACE_OFFSET = 8, 2
"""A verdict that is remembered: the number of the frame, shifted, and the place with an offset."""

FRAME_GROWN, FRAME_LEFT, FRAME_FULL = range(3)
"""What becomes of a frame: it is grown, it is left, or there is no room for it."""

N_ALIVE, N_LOST, N_PRESUMED, N_UNSURE = range(4)
"""What rows are counted of: leaves, lost nodes, what is presumed, and frames that are left."""

Table = NDArray[np.int64]


MAX_POINTS, MAX_PRESUMED = 16, 16
"""Points that a rule may read, and numbers that it may presume."""

PRESUMED_AT, ROOM_AT, NUMBERS_AT = 48, 64, 128
"""Where in its one array a screen writes what is presumed, has room for what it needs, and where numbers begin."""


def screen(kind: int, w: Array, at: int) -> Any:
    """Tell what is clear in one posture: the first place violated, `NO_VIOLATION` or `NOT_CLEAR`.

    Parameters
    ----------
    kind : int
        As the rule says.
    w : array
        The posture's points, x, y, z each, metres; what is to be confirmed is put to `PRESUMED_AT`; from `ROOM_AT` to
        before `NUMBERS_AT` all may be overwritten.
    at : int
        Where the numbers of the rule begin.
    """
    return NOT_CLEAR


def screens(rules: Table, of: Table, points: Array, w: Array, places: Bytes, presumed: Array) -> Any:
    """Screen many postures by some rules.

    Parameters
    ----------
    rules : int array (C, 2)
        Which screen is asked, as `screen` takes it, and where in `w` its numbers begin.
    of : int array (C, K)
        The points that each reads, -1 behind the last.
    points : array (N, P, 3)
        The points of each posture, metres.
    w : array
        As `screen` takes it, with the rules' numbers from `NUMBERS_AT` on.
    places : int array (N, C)
        Filled.
    presumed : array (M, W)
        Filled from the top, W numbers for every place violated.

    Returns
    -------
    int
        How many places were violated.
    """
    count = 0
    for i in range(points.shape[0]):
        for c in range(rules.shape[0]):
            for p in range(of.shape[1]):
                if of[c, p] >= 0:
                    for k in range(3):
                        w[3 * p + k] = points[i, of[c, p], k]
            places[i, c] = screen(rules[c, 0], w, rules[c, 1])
            if places[i, c] >= 0:
                for k in range(presumed.shape[1]):
                    presumed[count, k] = w[PRESUMED_AT + k]
                count += 1
    return count


def grow(
    begin: int,
    end: int,
    lifts: bool,
    rays: Array,
    unseen: NDArray[np.bool_],
    parents: Table,
    first: Table,
    lengths: Array,
    tolerance: float,
    table: Array,
    states: Bytes,
    reach: Array,
    levels: Table,
    checks: Table,
    tips: Table,
    places: Table,
    w: Array,
    memory: Table,
    base: int,
    starts: Table,
    stems: Ints,
    span: Table,
    nodes: Ints,
    alive: Ints,
    lost: Ints,
    presumed: Array,
    asked: Table,
    unsure: Table,
    used: Table,
) -> Any:
    """Grow the trees of the frames from one to before another, as far as there is room for what becomes of them.

    They are grown from any level to any other, and the first and the last may be asked about by some of their checks.

    Parameters
    ----------
    begin, end : int
        The first frame, and the one after the last.
    lifts : bool
        Whether joints are to be lifted, with what follows; else they are by now.
    rays, unseen, parents, first, lengths, tolerance, table, states, reach
        As `posekit.compiled.tree_kernels.lift` takes them.
    levels : int array (J + 1,)
        Which checks are of which level: from one entry to before the next.
    checks : int array (C, 7)
        Of each check: kind of its screen; how many numbers it presumes; how many tips and points; where its verdicts
        are remembered; where its numbers begin; its number among all, those without a screen too.
    tips : int array (C, S, 3)
        What decides what a check says: columns of a node, the bits of each that count, and by how many these are
        shifted, so that their sum tells all choices apart.
    places : int array (C, P, 2)
        Of each of its points the joint, or -1 where it was given, and the column of its first candidate.
    w : array
        As `screen` takes it, with the numbers of all rules.
    memory : int array
        Room for verdicts. Not to be used again for other frames of the same numbers.
    base, starts, stems : int, int array (B + 1,), int array (S,)
        Codes of the nodes to begin with: those of the frame f begin at ``starts[f - base]``.
    span : int array (4,)
        The level of those nodes, and the check that they are first asked about; the level of the nodes to end with, and
        the check before which they are done.
    nodes : int array (2 * N * (1 + J),)
        Room for the nodes of two levels, row by row.
    alive : int array (A, 2)
        Filled: frame and code of the leaves.
    lost : int array (L, 4)
        Filled: nodes without a position or rejected, frame by frame.
    presumed, asked : array (Q, W), int array (Q,)
        Filled: what is to be confirmed, and by which check.
    unsure : int array (U,)
        Filled: frames that were not grown.
    used : int array (4,)
        Changed: how many rows of `alive`, `lost`, `presumed` and `unsure` are filled.

    Returns
    -------
    int
        The first frame for which there was no room; `end` if there was.
    """
    n_joints = parents.shape[0]
    wide = PATH_COLUMNS + n_joints
    half = nodes.shape[0] // 2
    n_alive, n_lost, n_presumed, n_unsure = used[N_ALIVE], used[N_LOST], used[N_PRESUMED], used[N_UNSURE]
    for f in range(begin, end):
        if lifts:
            lift(f, f + 1, rays, unseen, parents, first, lengths, tolerance, table, states, reach)
        here, there, status = 0, half, FRAME_GROWN
        stem, count = starts[f - base], starts[f - base + 1] - starts[f - base]
        if count * wide > half:
            return f
        for i in range(count):
            node, code = here + i * wide, stems[stem + i]
            nodes[node + CODE_COLUMN], nodes[node + PATH_COLUMNS] = code, 0
            for k in range(1, n_joints):
                nodes[node + PATH_COLUMNS + k] = 0
                if k <= span[0]:
                    nodes[node + PATH_COLUMNS + k] = nodes[node + PATH_COLUMNS + parents[k]] << 1 | (
                        code >> (span[0] - k) & 1
                    )
        # At the level to begin with nodes are only asked about, and mostly there is nothing to ask.
        skips = 1 if span[2] > span[0] and span[1] == levels[span[0] + 1] else 0
        for level in range(span[0] + skips, span[2] + 1):
            begins = level == span[0]
            fork = 0 if begins else 1
            first_check = span[1] if begins else levels[level]
            last_check = span[3] if level == span[2] else levels[level + 1]
            many = count << fork
            if many * wide > half or n_lost + many > lost.shape[0]:
                status = FRAME_FULL
                break
            child, kept = there, 0
            parent = PATH_COLUMNS + parents[level]
            for i in range(many):
                node, side = here + (i >> fork) * wide, i & 1
                path, code, state = 0, nodes[node + CODE_COLUMN], IS_OPEN
                if not begins:
                    path, code = nodes[node + parent] << 1 | side, code << 1 | side
                    state = states[f, first[level] + path]
                where, group = NO_VIOLATION, 0
                if state != IS_OPEN:
                    where, group = 0, (level - 1) * UNJUDGED_STATES + state - 1
                else:
                    for k in range(PATH_COLUMNS, PATH_COLUMNS + level + 1):
                        nodes[child + k] = nodes[node + k]
                    nodes[child + CODE_COLUMN] = code
                    if not begins:
                        nodes[child + PATH_COLUMNS + level] = path
                    for c in range(first_check, last_check):
                        choice = checks[c, 4]
                        for s in range(checks[c, 2]):
                            tip = nodes[child + tips[c, s, 0]]
                            choice += (tip & tips[c, s, 1]) << tips[c, s, 2]
                        if memory[choice] >> FRAME_SHIFT == f - begin + 1:
                            where = (memory[choice] & ((1 << FRAME_SHIFT) - 1)) - PLACE_OFFSET
                        else:
                            for p in range(checks[c, 3]):
                                column = places[c, p, 1]
                                if places[c, p, 0] >= 0:
                                    column += nodes[child + PATH_COLUMNS + places[c, p, 0]]
                                for k in range(3):
                                    w[3 * p + k] = table[f, column, k]
                            where = screen(checks[c, 0], w, checks[c, 5])
                            memory[choice] = (f - begin + 1) << FRAME_SHIFT | (where + PLACE_OFFSET)
                            if where >= 0 and checks[c, 1] > 0:
                                if n_presumed == presumed.shape[0]:
                                    status = FRAME_FULL
                                    break
                                for k in range(checks[c, 1]):
                                    presumed[n_presumed, k] = w[PRESUMED_AT + k]
                                asked[n_presumed] = c
                                n_presumed += 1
                            elif where == NOT_CLEAR:
                                status = FRAME_LEFT
                                break
                        if where >= 0:
                            group = (n_joints - 1) * UNJUDGED_STATES + checks[c, 6]
                            break
                if status != FRAME_GROWN:
                    break
                if where >= 0:
                    lost[n_lost, GROUP_COLUMN], lost[n_lost, OF_FRAME] = group, f
                    lost[n_lost, CODE_OF_LOST], lost[n_lost, PLACE_COLUMN] = code, where
                    n_lost += 1
                else:
                    child += wide
                    kept += 1
            if status != FRAME_GROWN:
                break
            here, there, count = there, here, kept
        if status == FRAME_GROWN and n_alive + count > alive.shape[0]:
            status = FRAME_FULL
        if status == FRAME_FULL:
            return f
        if status == FRAME_LEFT:
            unsure[n_unsure] = f
            n_unsure += 1
            n_lost, n_presumed = used[N_LOST], used[N_PRESUMED]
        else:
            for i in range(count):
                alive[n_alive, 0], alive[n_alive, 1] = f, nodes[here + i * wide + CODE_COLUMN]
                n_alive += 1
        used[N_ALIVE], used[N_LOST], used[N_PRESUMED], used[N_UNSURE] = n_alive, n_lost, n_presumed, n_unsure
    return end


COMPILED_TYPES = {
    "lift": "",
    "screen": "",
    "screens": "(i8[:, ::1], i8[:, ::1], f8[:, :, ::1], f8[::1], i1[:, ::1], f8[:, ::1])",
    "grow": (
        "(i8, i8, b1, f8[:, :, ::1], b1[:, ::1], i8[::1], i8[::1], f8[:, ::1], f8, f8[:, :, ::1], i1[:, ::1], "
        "f8[:, ::1], i8[::1], i8[:, ::1], i8[:, :, ::1], i8[:, :, ::1], f8[::1], i8[::1], i8, i8[::1], i4[::1], "
        "i8[::1], i4[::1], i4[:, ::1], i4[:, ::1], f8[:, ::1], i8[::1], i8[::1], i8[::1])"
    ),
}
"""The kernels, in the order in which they need each other, with the types they take."""
