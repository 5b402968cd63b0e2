"""The tree's steps in NumPy: what is always there, and what the compiled loops are checked against."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from posekit.tree.bits import path_of, select
from posekit.tree.candidates import BranchState
from posekit.tree.check import Check
from posekit.tree.leaves import Leaves, Pruned

UNJUDGED_NAMES = {
    BranchState.NO_SOLUTION: "no_solution",
    BranchState.COINCIDENT: "coincident",
    BranchState.BEHIND_CAMERA: "behind_camera",
    BranchState.MISSING: "missing",
}
"""How the reasons of branches that no check judged are named, before the joint's name."""


SPARSE_FROM = 32
"""Choices a node from which they are sorted: to look through a table of all that there might be would take longer."""

Indices = NDArray[np.int32]


def branch(leaves: Leaves, joint: int) -> Leaves:
    """Give every node its near and far successor and drop those that the lift already excludes."""
    frame = np.repeat(leaves.frame, 2)
    code = (np.repeat(leaves.code, 2) << 1) | np.tile(np.array([0, 1], dtype=np.int32), len(leaves.code))
    path = select(joint, path_of(joint, leaves.parents))[code]
    state = leaves.candidates.branches[joint][frame, path]
    excess = leaves.candidates.excess[joint][frame, path]
    open_ = state == BranchState.OPEN
    pruned = leaves.pruned
    for reason, name in UNJUDGED_NAMES.items():
        dead = state == reason
        if dead.any():
            pruned = (
                *pruned,
                Pruned(
                    level=joint,
                    frame=frame[dead],
                    code=code[dead],
                    check=name,
                    where=(leaves.joints[joint],),
                    unit="m",
                    place=np.zeros(int(dead.sum()), dtype=np.int8),
                    value=excess[dead],
                    lower=np.full(int(dead.sum()), -np.inf),
                    upper=np.full(int(dead.sum()), bound_of(reason)),
                ),
            )
    return leaves.keep(open_, frame, code, joint, pruned)


def bound_of(reason: BranchState) -> float:
    """Return the bound that a branch without a solution broke: its segment's excess must not be positive."""
    return 0.0 if reason is BranchState.NO_SOLUTION else np.inf


def apply(leaves: Leaves, check: Check) -> Leaves:
    """Ask a check about every distinct choice of its own branches, and drop the nodes it rejects."""
    if not len(leaves.code):
        return leaves
    nodes, row = choices(leaves, check)
    findings = check.judge_frames(leaves.positions(check.points, nodes), leaves.frame[nodes])
    violated = findings.violated
    rejected: NDArray[np.bool_] = np.logical_or.reduce(violated, axis=1)
    if not rejected.any():
        return leaves
    dead = rejected[row]
    dead_rows = row[dead]
    place = violated.argmax(axis=1)[dead_rows]
    shape = findings.value.shape
    pruned = Pruned(
        level=leaves.level,
        frame=leaves.frame[dead],
        code=leaves.code[dead],
        check=check.name,
        where=check.where,
        unit=check.unit,
        place=place.astype(np.int8),
        value=findings.value[dead_rows, place],
        lower=np.broadcast_to(findings.lower, shape)[dead_rows, place],
        upper=np.broadcast_to(findings.upper, shape)[dead_rows, place],
    )
    return leaves.keep(~dead, leaves.frame, leaves.code, leaves.level, (*leaves.pruned, pruned))


def choices(leaves: Leaves, check: Check) -> tuple[Indices, Indices]:
    """Find the distinct choices of a check's own branches among nodes (N,), of which there is one at least.

    Returns
    -------
    nodes : int array (R,)
        A node of each choice, frame by frame.
    row : int array (N,)
        Which choice each node has.
    """
    support = leaves.support(check.points)
    choice = select(leaves.level, support)[leaves.code]
    first = leaves.frame[0]
    key = (leaves.frame - first).astype(np.int64) << len(support) | choice
    width = int(leaves.frame[-1] - first + 1) << len(support)
    if width > SPARSE_FROM * len(key):
        _, found, inverse = np.unique(key, return_index=True, return_inverse=True)
        return found.astype(np.int32), inverse.ravel().astype(np.int32)
    table: Indices = np.full(width, -1, dtype=np.int32)
    table[key] = np.arange(len(key), dtype=np.int32)
    asked = np.flatnonzero(table >= 0)
    nodes = table[asked]  # a copy
    table[asked] = np.arange(len(asked), dtype=np.int32)
    return nodes, table[key]
