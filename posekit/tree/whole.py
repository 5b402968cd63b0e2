"""Whole trees of blocks of frames, where every check has a rule (`posekit.compiled.frame_kernels`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.compiled import frame_kernels
from posekit.compiled import tree_kernels as kernels
from posekit.compiled.compiling import compiled
from posekit.compiled.frame_kernels import ALIVE, ASKED, GONE, MOST_PRESUMED, REASONS, UNKNOWN
from posekit.tree.blocks import Block
from posekit.tree.check import Check
from posekit.tree.layout import Programme

NODES, LEAVES, LOSSES, QUESTIONS = 256, 32, 96, 1
"""Rows to begin with: nodes of a level; then of each frame."""


def growing(
    programme: Programme, checks: Sequence[Check], lift: tuple[Any, ...]
) -> Callable[[tuple[int, int]], Block]:
    """Return what grows the trees of the frames from one to before another.

    Parameters
    ----------
    programme : Programme
    checks : sequence of Check
        Its checks.
    lift : tuple
        Whether joints are to be lifted and with what, as `posekit.compiled.frame_kernels.grow` takes it.
    """
    loops, sort = compiled(frame_kernels, programme.kernels), compiled(kernels).sort
    joints = len(programme.levels) - 1
    groups = (joints - 1) * REASONS + len(checks)

    def grow_block(frames: tuple[int, int]) -> Block:
        begin, end = frames
        n = end - begin
        nodes = np.empty(2 * NODES * (1 + joints), dtype=np.int32)
        alive = np.empty((LEAVES * n, 2), dtype=np.int32)
        lost = np.empty((LOSSES * n, 4), dtype=np.int32)
        presumed, asked = np.empty((QUESTIONS * n, MOST_PRESUMED)), np.empty(QUESTIONS * n, dtype=np.int64)
        unsure, used = np.empty(n, dtype=np.int64), np.zeros(4, dtype=np.int64)
        while begin < end:
            begin = loops.grow(
                begin,
                end,
                *lift,
                *programme.arrays,
                np.zeros(programme.verdicts, dtype=np.int64),
                nodes,
                alive,
                lost,
                presumed,
                asked,
                unsure,
                used,
            )
            if begin < end:
                # One of them was full: what it will be of the frames that are left nobody knows.
                nodes = np.empty(2 * len(nodes), dtype=np.int32)
                alive, lost = _longer(alive, used[ALIVE]), _longer(lost, used[GONE])
                presumed, asked = _longer(presumed, used[ASKED]), _longer(asked, used[ASKED])
        which = asked[: used[ASKED]]
        told = presumed[: used[ASKED]]
        return Block(
            alive=alive[: used[ALIVE]].copy(),
            lost=sort(lost[: used[GONE]], groups),
            presumed=[
                (checks[c], told[which == c][:, : programme.checks[c, 1]]) for c in np.unique(which).tolist()
            ],
            unsure=unsure[: used[UNKNOWN]].copy(),
        )

    return grow_block


def _longer(rows: NDArray[Any], used: int) -> NDArray[Any]:
    """Return an array with twice as many rows, and the same in those that are used."""
    new = np.empty((2 * len(rows), *rows.shape[1:]), dtype=rows.dtype)
    new[:used] = rows[:used]
    return new
