"""Trees of many frames grown level by level, check by check: for checks without a rule, or that are not sure of one.

Checks with a screen (`posekit.tree.Screened`) are asked for what is clear, and their `judge` for the rest; the others
are judged.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from posekit.compiled import tree_kernels as kernels
from posekit.compiled.frame_kernels import REASONS
from posekit.compiled.verdicts import PASSED, UNSURE
from posekit.geometry import Array
from posekit.tree.blocks import Block
from posekit.tree.check import Check, Screened
from posekit.tree.layout import Places
from posekit.tree.leaves import Leaves

Indices = NDArray[np.int32]


def grow_steps(
    loops: Any,
    roots: Leaves,
    checks: Sequence[Sequence[Check]],
    places: Sequence[Sequence[Places]],
    frames: NDArray[np.int64],
) -> Block:
    """Grow the trees of some frames (F,), in order, whose joints are lifted.

    Parameters
    ----------
    loops : object
        The kernels of `posekit.compiled.tree_kernels`, maybe compiled.
    roots : Leaves
        Of all frames.
    checks, places : sequences of sequences
        By level.
    """
    candidates, joints = roots.candidates, len(roots.joints)
    nodes = np.zeros((2 + joints + 1, len(frames)), dtype=np.int32)
    nodes[kernels.FRAME] = frames
    lost: list[Indices] = [np.empty((0, 4), dtype=np.int32)]
    presumed: list[tuple[Check, Array]] = []
    group = (joints - 1) * REASONS
    for level, at in enumerate(checks):
        if level:
            parent, column = roots.parents[level], candidates.first[level]
            nodes, dead = loops.branch(nodes, level, parent, candidates.states, column)
            state = dead[:, kernels.WHY]
            lost.append(_of(dead, (level - 1) * REASONS + state - 1, np.zeros_like(state)))
        for check, where in zip(at, places[level], strict=True):
            if nodes.shape[1]:
                points, row = loops.pose(nodes, *where, candidates.table)
                verdicts = _verdicts(check, points, presumed)
                if verdicts.max() >= 0:
                    nodes, dead = loops.part(nodes, row, verdicts)
                    lost.append(_of(dead, np.full(len(dead), group), dead[:, kernels.WHY]))
            group += 1
    return Block(
        alive=np.ascontiguousarray(nodes[: kernels.CODE + 1].T),
        lost=loops.sort(np.concatenate(lost), group),
        presumed=presumed,
        unsure=np.empty(0, dtype=np.int64),
    )


def _of(dead: Indices, group: NDArray[Any], place: Indices) -> Indices:
    """Say of lost nodes (M, 3) who rejected them: group, frame, code and place (M, 4)."""
    return np.stack([group.astype(np.int32), dead[:, kernels.FRAME], dead[:, kernels.CODE], place], axis=-1)


def _verdicts(check: Check, points: Array, presumed: list[tuple[Check, Array]]) -> NDArray[np.int8]:
    """Return the first place that each posture (N, P, 3) violates; `PASSED` where there is none."""
    if not hasattr(check, "screen"):
        return _first_violated(check, points)
    places, more = cast(Screened, check).screen(points)
    if places.min() == UNSURE:
        unsure = np.flatnonzero(places == UNSURE)
        places[unsure] = _first_violated(check, points[unsure])
    if more is not None and len(more):
        presumed.append((check, more))
    return places


def _first_violated(check: Check, points: Array) -> NDArray[np.int8]:
    violated = check.judge(points).violated
    return np.where(violated.any(axis=1), violated.argmax(axis=1), PASSED).astype(np.int8)
