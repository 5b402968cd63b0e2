"""The binary interpretation tree (Lee & Chen 1985, §3.1), grown level by level over many frames at once.

A node holds no positions, only its frame and its branch code. What a check says about a node depends on the
branches of the few joints that the check reads; so each check is asked once for every different choice of
*those* branches that is still alive, and its answer serves all nodes that share it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array, Camera
from posekit.tree.bits import path_of, select
from posekit.tree.candidates import Branch, lift_all
from posekit.tree.check import Check
from posekit.tree.leaves import Leaves, Pruned

UNJUDGED = {
    Branch.NO_SOLUTION: "no_solution",
    Branch.COINCIDENT: "coincident",
    Branch.BEHIND_CAMERA: "behind_camera",
    Branch.MISSING: "missing",
}
"""How the reasons of branches that no check judged are named, before the joint's name."""


@dataclass(frozen=True, kw_only=True)
class InterpretationTree:
    """The tree of one articulated object.

    Parameters
    ----------
    joints : tuple of str (J,)
        Names, the root first, each after its parent.
    parents : tuple of int (J,)
        Parent of each joint; -1 for the root.
    lengths : array (J,)
        Length of the segment to each joint's parent, metres; the root's is ignored.
    """

    joints: tuple[str, ...]
    parents: tuple[int, ...]
    lengths: Array

    def grow(
        self,
        camera: Camera,
        root: Array,
        image: Array,
        checks: Sequence[Check],
        *,
        given: Array | None = None,
        tolerance: float = 0.0,
    ) -> Leaves:
        """Grow the tree over F frames, pruning each branch at the first level where a check can judge it.

        Parameters
        ----------
        camera : Camera
            Projects and lifts; its first axis counts frames.
        root : array (F, 3)
            The root joint, camera frame, metres.
        image : array (F, J, 2)
            Image points; NaN where a joint was not seen.
        checks : sequence of Check
            Asked in this order at each level.
        given : array (F, G, 3), optional
            Further points, known beforehand, that checks may read as points J, J + 1, …; unknown where absent.
        tolerance : float
            Metres by which a segment may be too short for its image and count as tangent to its ray.

        Returns
        -------
        Leaves
            What survived, and why the rest did not.
        """
        candidates = lift_all(
            camera, root, image, parents=self.parents, lengths=self.lengths, tolerance=tolerance
        )
        leaves = Leaves.start(self.joints, self.parents, candidates, given, root)
        for joint in range(1, len(self.joints)):
            leaves = self._branch(leaves, joint)
            for check in checks:
                if self._level(check) == joint:
                    leaves = apply(leaves, check)
        return leaves

    def prune(self, leaves: Leaves, checks: Sequence[Check]) -> Leaves:
        """Judge leaves by further checks: the motion model's, after the physical ones."""
        for check in checks:
            leaves = apply(leaves, check)
        return leaves

    def _level(self, check: Check) -> int:
        """Return the first level at which all joints that a check reads are known, at least 1."""
        return max([1, *(point for point in check.points if point < len(self.joints))])

    def _branch(self, leaves: Leaves, joint: int) -> Leaves:
        """Give every node its near and far successor and drop those that the lift already excludes."""
        frame = np.repeat(leaves.frame, 2)
        code = (np.repeat(leaves.code, 2) << 1) | np.tile(np.array([0, 1], dtype=np.int32), len(leaves.code))
        path = select(joint, path_of(joint, self.parents))[code]
        state = leaves.candidates.branches[joint][frame, path]
        excess = leaves.candidates.excess[joint][frame, path]
        open_ = state == Branch.OPEN
        pruned = leaves.pruned
        for branch, reason in UNJUDGED.items():
            dead = state == branch
            if dead.any():
                pruned = (
                    *pruned,
                    Pruned(
                        level=joint,
                        frame=frame[dead],
                        code=code[dead],
                        check=reason,
                        where=(self.joints[joint],),
                        unit="m",
                        place=np.zeros(int(dead.sum()), dtype=np.int8),
                        value=excess[dead],
                        lower=np.full(int(dead.sum()), -np.inf),
                        upper=np.full(int(dead.sum()), tolerance_bound(branch)),
                    ),
                )
        return leaves.keep(open_, frame, code, joint, pruned)


def tolerance_bound(branch: Branch) -> float:
    """Return the bound that a branch without a solution broke: its segment's excess must not be positive."""
    return 0.0 if branch is Branch.NO_SOLUTION else np.inf


def apply(leaves: Leaves, check: Check) -> Leaves:
    """Ask a check about every distinct choice of its own branches, and drop the nodes it rejects."""
    if not len(leaves.code):
        return leaves
    support = leaves.support(check.points)
    choice = select(leaves.level, support)[leaves.code]
    key = leaves.frame.astype(np.int64) << len(support) | choice
    representative = np.full(leaves.n_frames << len(support), -1, dtype=np.int32)
    representative[key] = np.arange(len(key), dtype=np.int32)
    asked = np.flatnonzero(representative >= 0)
    nodes = representative[asked]
    findings = check.judge(leaves.positions(check.points, nodes))
    violated = findings.violated
    rejected: NDArray[np.bool_] = np.logical_or.reduce(violated, axis=1)
    if not rejected.any():
        return leaves
    row_of_key = representative
    row_of_key[asked] = np.arange(len(asked), dtype=np.int32)
    row = row_of_key[key]
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
