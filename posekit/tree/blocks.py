"""Trees of some frames that a thread grew, and how they are put together: as the plain path has them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from posekit.compiled.frame_kernels import UNJUDGED_STATES
from posekit.geometry import Array
from posekit.tree.candidates import BranchState
from posekit.tree.check import Check
from posekit.tree.leaves import Leaves, Losses, Postponed
from posekit.tree.plain import UNJUDGED_NAMES, bound_of

Indices = NDArray[np.int32]
Sorted = tuple[Indices, Indices, NDArray[np.int8], NDArray[np.int64]]


@dataclass(frozen=True, kw_only=True, eq=False)
class FrameBlock:
    """What became of the trees of some frames.

    Parameters
    ----------
    alive : int array (N, 2)
        Frame and code of the leaves.
    lost : tuple of array
        Frame, code and place of lost nodes by who rejected them, and where each group starts: see
        `posekit.compiled.tree_kernels.sort`.
    presumed : list of (check, array)
        What is to be confirmed.
    unsure : int array (U,)
        Frames that were not grown.
    """

    alive: Indices
    lost: Sorted
    presumed: list[tuple[Check, Array]]
    unsure: NDArray[np.int64]


def merged(
    roots: Leaves, checks: Sequence[Sequence[Check]], grown: Sequence[FrameBlock], *, ordered: bool
) -> Leaves:
    """Put blocks together: leaves and losses in the order of the plain path, of blocks `ordered` by frame or not."""
    if not grown:
        return roots.at(len(checks) - 1, roots.frame, roots.code)
    pruned: list[Losses] = []
    joint_groups = (len(checks) - 1) * UNJUDGED_STATES
    first = 0
    for level, at in enumerate(checks):
        for reason, name in UNJUDGED_NAMES.items() if level else ():
            group = (level - 1) * UNJUDGED_STATES + int(reason) - 1
            for lost, place in _lost(roots, level, grown, group, ordered):
                where, measure = (roots.joints[level],), partial(_excess, lost, reason)
                pruned.append(_losses(lost, name, where, "m", place, measure))
        for k, check in enumerate(at):
            for lost, place in _lost(roots, level, grown, joint_groups + first + k, ordered):
                measure = partial(_judged, lost, check, place)
                pruned.append(_losses(lost, check.name, check.where, check.unit, place, measure))
        first += len(at)
    alive = np.concatenate([block.alive for block in grown])
    if not ordered:
        alive = alive[np.argsort(alive[:, 0], kind="stable")]
    frame, code = np.ascontiguousarray(alive.T)
    return roots.at(len(checks) - 1, frame, code, tuple(pruned))


def _lost(
    roots: Leaves, level: int, grown: Sequence[FrameBlock], group: int, ordered: bool
) -> Iterator[tuple[Leaves, NDArray[np.int8]]]:
    """Yield the nodes that one group lost, and the places, if there are any."""
    parts = []
    for block in grown:
        frame, code, place, start = block.lost
        part = slice(start[group], start[group + 1])
        if part.start < part.stop:
            parts.append((frame[part], code[part], place[part]))
    if not parts:
        return
    frame, code, place = parts[0]
    if len(parts) > 1:
        frame, code, place = (np.concatenate([part[k] for part in parts]) for k in range(3))
    if not ordered:
        order = np.argsort(frame, kind="stable")
        frame, code, place = frame[order], code[order], place[order]
    yield roots.at(level, frame, code), place


def _losses(
    lost: Leaves, check: str, where: tuple[str, ...], unit: str, place: NDArray[np.int8], measure: Postponed
) -> Losses:
    return Losses(
        level=lost.level,
        frame=lost.frame,
        code=lost.code,
        check=check,
        where=where,
        unit=unit,
        place=place,
        measure=measure,
    )


def _judged(lost: Leaves, check: Check, place: NDArray[np.int8]) -> tuple[Array, Array, Array]:
    """Judge lost nodes again: value and bounds at the first place that each violates."""
    findings = check.judge(lost.positions(check.points, np.arange(len(lost.code))))
    shape, rows = findings.value.shape, np.arange(len(lost.code))
    lower, upper = np.broadcast_to(findings.lower, shape), np.broadcast_to(findings.upper, shape)
    return findings.value[rows, place], lower[rows, place], upper[rows, place]


def _excess(lost: Leaves, reason: BranchState) -> tuple[Array, Array, Array]:
    """Return by how much the segments of lost nodes are too short, and the bounds."""
    n = len(lost.code)
    return lost.excess(lost.level), np.full(n, -np.inf), np.full(n, bound_of(reason))
