"""Blocks of frames grown by compiled loops, as far as the next check without a compiled form, which NumPy then asks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.compiled import check_kernels, frame_kernels
from posekit.compiled import tree_kernels as kernels
from posekit.compiled.compiling import compiled
from posekit.compiled.frame_kernels import (
    MAX_PRESUMED,
    N_ALIVE,
    N_LOST,
    N_PRESUMED,
    N_UNSURE,
    UNJUDGED_STATES,
)
from posekit.geometry import Array
from posekit.tree.blocks import FrameBlock
from posekit.tree.check import Check
from posekit.tree.layout import Programme, Stretch
from posekit.tree.leaves import Leaves
from posekit.tree.plain import choices

NODE_ROWS, LEAF_ROWS, LOSS_ROWS, QUESTION_ROWS = 256, 32, 96, 1
"""Rows to begin with: nodes of a level; then of each frame."""

Rows = NDArray[np.int32]


def growing(
    programme: Programme, checks: Sequence[Check], roots: Leaves, lift: tuple[Any, ...]
) -> Callable[[tuple[int, int]], FrameBlock]:
    """Return what grows the trees of the frames from one to before another.

    Parameters
    ----------
    programme : Programme
        The checks laid out in arrays, as the compiled loops read them.
    checks : sequence of Check
        All checks, level by level.
    roots : Leaves
        Of all frames.
    lift : tuple
        Whether joints are to be lifted and with what, as `posekit.compiled.frame_kernels.grow` takes it.
    """
    joints = len(roots.joints)
    first_group = (joints - 1) * UNJUDGED_STATES

    def grow_block(frames: tuple[int, int]) -> FrameBlock:
        alive = np.zeros((frames[1] - frames[0], 2), dtype=np.int32)
        alive[:, 0] = np.arange(*frames)
        lost: list[Rows] = []
        presumed: list[tuple[Check, Array]] = []
        unsure: list[NDArray[np.int64]] = []
        lifting = lift
        for stretch in programme.stretches:
            if not stretch.empty:
                run = _Run(programme, stretch, frames, alive)
                run.grow(lifting, joints)
                lifting = (False, *lift[1:])
                alive = run.alive[: run.used[N_ALIVE]]
                lost.append(run.lost[: run.used[N_LOST]])
                presumed += run.questions(checks)
                unsure.append(run.unsure[: run.used[N_UNSURE]])
            if stretch.check is not None and len(alive):
                nodes = roots.at(stretch.level, alive[:, 0].copy(), alive[:, 1].copy())
                place = _first_violated(nodes, stretch.check)
                dead = place >= 0
                gone = np.empty((int(dead.sum()), 4), dtype=np.int32)
                gone[:, kernels.GROUP_COLUMN], gone[:, kernels.PLACE_COLUMN] = (
                    first_group + stretch.number,
                    place[dead],
                )
                gone[:, kernels.OF_FRAME : kernels.PLACE_COLUMN] = alive[dead]
                lost.append(gone)
                alive = np.ascontiguousarray(alive[~dead])
        left = np.concatenate([np.empty(0, dtype=np.int64), *unsure])
        everything = lost[0] if len(lost) == 1 else np.concatenate([np.empty((0, 4), dtype=np.int32), *lost])
        if len(left):
            everything = everything[~np.isin(everything[:, kernels.OF_FRAME], left)]
        return FrameBlock(
            alive=alive.copy(),
            lost=compiled(kernels).sort(np.ascontiguousarray(everything), first_group + len(checks)),
            presumed=presumed,
            unsure=np.sort(left),
        )

    return grow_block


class _Run:
    """One call of the loop over a block of frames, or several where it has too little room at first."""

    def __init__(self, programme: Programme, stretch: Stretch, frames: tuple[int, int], stem: Rows) -> None:
        n = frames[1] - frames[0]
        self.programme, self.span, self.frames = programme, stretch.span, frames
        self.codes = np.ascontiguousarray(stem[:, 1])
        self.starts = np.searchsorted(stem[:, 0], np.arange(frames[0], frames[1] + 1)).astype(np.int64)
        self.alive = np.empty((LEAF_ROWS * n, 2), dtype=np.int32)
        self.lost = np.empty((LOSS_ROWS * n, 4), dtype=np.int32)
        self.presumed = np.empty((QUESTION_ROWS * n, MAX_PRESUMED))
        self.asked = np.empty(QUESTION_ROWS * n, dtype=np.int64)
        self.unsure, self.used = np.empty(n, dtype=np.int64), np.zeros(4, dtype=np.int64)

    def grow(self, lift: tuple[Any, ...], joints: int) -> None:
        """Grow all frames; `lift` as the loop takes it."""
        loops = compiled(frame_kernels, check_kernels)
        nodes = np.empty(2 * NODE_ROWS * (1 + joints), dtype=np.int32)
        begin, end = self.frames
        while begin < end:
            begin = loops.grow(
                begin,
                end,
                *lift,
                *self.programme.arrays,
                np.zeros(self.programme.verdicts, dtype=np.int64),
                self.frames[0],
                self.starts,
                self.codes,
                self.span,
                nodes,
                self.alive,
                self.lost,
                self.presumed,
                self.asked,
                self.unsure,
                self.used,
            )
            if begin < end:
                # One of them was full: what it will be of the frames that are left nobody knows.
                nodes = np.empty(2 * len(nodes), dtype=np.int32)
                self.alive = _longer(self.alive, self.used[N_ALIVE])
                self.lost = _longer(self.lost, self.used[N_LOST])
                self.presumed, self.asked = (
                    _longer(each, self.used[N_PRESUMED]) for each in (self.presumed, self.asked)
                )

    def questions(self, checks: Sequence[Check]) -> list[tuple[Check, Array]]:
        """Return what is to be confirmed, by check."""
        table = self.programme.checks
        which, told = self.asked[: self.used[N_PRESUMED]], self.presumed[: self.used[N_PRESUMED]]
        return [(checks[table[c, 6]], told[which == c][:, : table[c, 1]]) for c in np.unique(which).tolist()]


def _first_violated(nodes: Leaves, check: Check) -> NDArray[np.int8]:
    """Return the first place that each node violates, negative where there is none."""
    asked, row = choices(nodes, check)
    violated = check.judge(nodes.positions(check.points, asked)).violated
    return np.where(violated.any(axis=1), violated.argmax(axis=1), -1).astype(np.int8)[row]


def _longer(rows: NDArray[Any], used: int) -> NDArray[Any]:
    """Return an array with twice as many rows, and the same in those that are used."""
    new = np.empty((2 * len(rows), *rows.shape[1:]), dtype=rows.dtype)
    new[:used] = rows[:used]
    return new
