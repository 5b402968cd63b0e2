"""Trees grown by compiled loops: the same nodes, in the same order, as `posekit.tree.plain` gives.

Where every check has a rule (`posekit.tree.Rule`) one loop grows whole trees, frame by frame, blocks of frames on all
cores that the process has; frames of which a rule is not sure, and all where a check has none, are grown step by step
(`posekit.tree.steps`). What was found in pruned branches is not kept: `judge` is asked again where somebody wants to
know.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Camera, PinholeCamera
from posekit.compiled import tree_kernels as kernels
from posekit.compiled.compiling import compiled, n_threads
from posekit.geometry import Array
from posekit.tree.blocks import Block, merged
from posekit.tree.candidates import Candidates, lift_all, rays_of
from posekit.tree.check import Check, Screened
from posekit.tree.layout import Places, places_of, programme_of
from posekit.tree.leaves import Leaves
from posekit.tree.steps import grow_steps
from posekit.tree.whole import growing

SHARES = 4
"""Blocks of frames for each of several threads: frames are not alike, and whoever is done takes the next."""

LEAST, MOST = 50, 2000
"""Frames a block: with fewer, calls cost more than what they do; of more the losses fill the memory twice."""

BLOCK = 500
"""Frames a block that is grown step by step: their candidates are a megabyte."""

Task = TypeVar("Task")
Result = TypeVar("Result")


def grow(
    start: Callable[[Candidates], Leaves],
    camera: Camera,
    root: Array,
    image: Array,
    checks: Sequence[Sequence[Check]],
    *,
    lengths: Array,
    parents: tuple[int, ...],
    given: Array | None,
    tolerance: float,
) -> Leaves | None:
    """Grow trees; see `posekit.tree.InterpretationTree.grow`.

    Parameters
    ----------
    start : callable
        Makes the roots of the trees.
    checks : sequence of sequences
        By level.

    Returns
    -------
    Leaves or None
        None where something that was presumed is not so.
    """
    n = len(root)
    pinhole = camera if isinstance(camera, PinholeCamera) else None
    if pinhole is not None:
        candidates = Candidates.start(root, parents, given)
    else:
        candidates = lift_all(
            camera, root, image, parents=parents, lengths=lengths, tolerance=tolerance, given=given
        )
    lift = _lifting(candidates, pinhole, image, parents, lengths, tolerance)
    roots = start(candidates)
    columns = candidates.table.shape[1]
    places = [[places_of(tuple(c.points), parents, candidates.first, columns) for c in at] for at in checks]
    programme = programme_of(checks, places)
    grown: list[Block] = []
    left: NDArray[np.int64] = np.arange(n)
    if programme is not None:
        flat = [check for at in checks for check in at]
        grown = _spread(growing(programme, flat, lift), _blocks(n))
        left = np.concatenate([np.empty(0, dtype=np.int64), *(block.unsure for block in grown)])
    parts = [left[k : k + BLOCK] for k in range(0, len(left), BLOCK)]
    stepwise = _spread(_stepping(roots, checks, places, lift if programme is None else None), parts)
    ordered = programme is None or not stepwise
    grown += stepwise
    return merged(roots, checks, grown, ordered=ordered) if _confirmed(grown) else None


def _blocks(n: int) -> list[tuple[int, int]]:
    """Part frames into blocks of about the same size: several for each of several threads."""
    threads = n_threads()
    size = min(max(-(-n // (threads * SHARES)), LEAST), MOST) if threads > 1 else MOST
    return [(k, min(k + size, n)) for k in range(0, n, size)]


def _spread(do: Callable[[Task], Result], tasks: Sequence[Task]) -> list[Result]:
    """Do tasks, on all threads that there may be."""
    threads = min(n_threads(), len(tasks))
    if threads < 2:
        return [do(task) for task in tasks]
    with ThreadPoolExecutor(threads) as pool:
        # Each in a copy of this context: what NumPy shall not warn of holds there too.
        waiting = [pool.submit(copy_context().run, do, task) for task in tasks]
        return [future.result() for future in waiting]


def _lifting(
    candidates: Candidates,
    camera: PinholeCamera | None,
    image: Array,
    parents: tuple[int, ...],
    lengths: Array,
    tolerance: float,
) -> tuple[Any, ...]:
    """Return what the kernels lift joints with, and whether they shall: where there is no camera they are by now."""
    # By joint and frame, though mostly every frame has the same.
    long = np.empty((len(parents), len(image)))
    long[:] = lengths.reshape(len(parents), -1)
    return (
        camera is not None,
        np.empty((0, 0, 3)) if camera is None else np.ascontiguousarray(rays_of(camera, image)),
        np.ascontiguousarray(np.isnan(image).any(axis=-1)),
        np.array(parents, dtype=np.int64),
        np.array(candidates.first, dtype=np.int64),
        long,
        float(tolerance),
        candidates.table,
        candidates.states,
        candidates.reach,
    )


def _stepping(
    roots: Leaves,
    checks: Sequence[Sequence[Check]],
    places: Sequence[Sequence[Places]],
    lift: tuple[Any, ...] | None,
) -> Callable[[NDArray[np.int64]], Block]:
    """Return what grows trees of some frames step by step, and lifts their joints if they are not yet."""
    loops = compiled(kernels)

    def grow_block(frames: NDArray[np.int64]) -> Block:
        if lift is not None and lift[0]:
            loops.lift(frames[0], frames[-1] + 1, *lift[1:])
        return grow_steps(loops, roots, checks, places, frames)

    return grow_block


def _confirmed(grown: Iterable[Block]) -> bool:
    """Ask each check about all that it presumed, at once."""
    presumed: dict[int, tuple[Check, list[Array]]] = {}
    for block in grown:
        for check, more in block.presumed:
            presumed.setdefault(id(check), (check, []))[1].append(more)
    return all(cast(Screened, check).confirm(np.concatenate(parts)) for check, parts in presumed.values())
