"""Trees grown by compiled loops: the same nodes, in the same order, as `posekit.tree.plain` gives.

Blocks of frames are grown on all cores that the process has, by one loop that asks the checks with a compiled form
(`posekit.tree.Rule`); those without one are asked in between (`posekit.tree.stretches`). Frames of which a rule is not
sure are grown by `posekit.tree.plain`. What was found in pruned branches is not kept: `judge` is asked again where
somebody wants to know.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextvars import copy_context
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import PinholeCamera
from posekit.compiled import tree_kernels as kernels
from posekit.compiled.compiling import compiled, n_threads
from posekit.compiled.frame_kernels import UNJUDGED_STATES
from posekit.geometry import Array
from posekit.tree import plain
from posekit.tree.blocks import FrameBlock, merged
from posekit.tree.check import Check
from posekit.tree.layout import programme_of
from posekit.tree.leaves import Leaves, Losses, Pruned
from posekit.tree.lifting import Lifting
from posekit.tree.stretches import growing

BLOCKS_PER_THREAD = 4
"""Blocks of frames for each of several threads: frames are not alike, and whoever is done takes the next."""

MIN_FRAMES, MAX_FRAMES = 50, 2000
"""Frames a block: with fewer, calls cost more than what they do; of more the losses fill the memory twice."""

PLAIN_FRAMES = 500
"""Frames a block that NumPy has a part in: their candidates are a megabyte."""

Task = TypeVar("Task")
Result = TypeVar("Result")


def grow(lifting: Lifting, checks: Sequence[Sequence[Check]]) -> Leaves | None:
    """Grow trees; see `posekit.tree.InterpretationTree.grow`.

    Parameters
    ----------
    lifting : Lifting
        The views, and the segments of the object in them.
    checks : sequence of sequences
        By level.

    Returns
    -------
    Leaves or None
        None where something that was presumed is not so.
    """
    lifts = isinstance(lifting.camera, PinholeCamera)
    roots = lifting.roots(lifted=not lifts)
    candidates = roots.candidates
    programme = programme_of(checks, lifting.parents, candidates.first, candidates.table.shape[1])
    lift = (lifts, *lifting.arrays(candidates))
    flat = [check for at in checks for check in at]
    least = MIN_FRAMES if len(programme.stretches) == 1 else PLAIN_FRAMES
    grown = _spread(growing(programme, flat, roots, lift), _blocks(roots.n_frames, least))
    left = np.concatenate([np.empty(0, dtype=np.int64), *(block.unsure for block in grown)])
    parts = [left[k : k + PLAIN_FRAMES] for k in range(0, len(left), PLAIN_FRAMES)]
    again = _spread(lambda frames: _grown_plainly(roots, checks, frames), parts)
    grown += again
    return merged(roots, checks, grown, ordered=not again) if _confirmed(grown) else None


def _blocks(n: int, least: int) -> list[tuple[int, int]]:
    """Part frames into blocks of about the same size, at least so large: several for each of several threads."""
    threads = n_threads()
    size = min(max(-(-n // (threads * BLOCKS_PER_THREAD)), least), MAX_FRAMES) if threads > 1 else MAX_FRAMES
    return [(k, min(k + size, n)) for k in range(0, n, size)]


def _spread(do: Callable[[Task], Result], tasks: Sequence[Task]) -> list[Result]:
    """Do tasks, on all threads that there may be."""
    threads = min(n_threads(), len(tasks))
    if threads < 2:
        return [do(task) for task in tasks]
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(threads) as pool:
        # Each in a copy of this context: what NumPy shall not warn of holds there too.
        waiting = [pool.submit(copy_context().run, do, task) for task in tasks]
        return [future.result() for future in waiting]


def _grown_plainly(roots: Leaves, checks: Sequence[Sequence[Check]], frames: NDArray[np.int64]) -> FrameBlock:
    """Grow the trees of some frames, whose joints are lifted, by NumPy alone."""
    leaves = roots.at(0, frames.astype(np.int32), np.zeros(len(frames), dtype=np.int32))
    groups = {name: int(reason) - 1 for reason, name in plain.UNJUDGED_NAMES.items()}
    lost = [np.empty((0, 4), dtype=np.int32)]
    number = (len(checks) - 1) * UNJUDGED_STATES
    for level, at in enumerate(checks):
        if level:
            leaves = plain.branch(leaves, level)
            lost += [_rows(one, (level - 1) * UNJUDGED_STATES + groups[one.check]) for one in leaves.pruned]
        for check in at:
            leaves = plain.apply(leaves.at(level, leaves.frame, leaves.code), check)
            lost += [_rows(one, number) for one in leaves.pruned]
            number += 1
        leaves = leaves.at(level, leaves.frame, leaves.code)
    return FrameBlock(
        alive=np.stack([leaves.frame, leaves.code], axis=1),
        lost=compiled(kernels).sort(np.concatenate(lost), number),
        presumed=[],
        unsure=np.empty(0, dtype=np.int64),
    )


def _rows(pruned: Pruned | Losses, group: int) -> NDArray[np.int32]:
    """Return who rejected nodes, their frame, code and place (M, 4)."""
    count = len(pruned.code)
    return np.stack([np.full(count, group), pruned.frame, pruned.code, pruned.place], axis=1).astype(np.int32)


def _confirmed(grown: Iterable[FrameBlock]) -> bool:
    """Ask each check about all that it presumed, at once."""
    presumed: dict[int, tuple[Check, list[Array]]] = {}
    for block in grown:
        for check, more in block.presumed:
            presumed.setdefault(id(check), (check, []))[1].append(more)
    return all(check.confirm(np.concatenate(parts)) for check, parts in presumed.values())
