"""Trees grown by compiled loops: the same nodes, in the same order, as `posekit.tree.plain` gives.

Frames are taken in blocks that fit into a core's cache, on all cores that the process has. Checks with a screen
(`posekit.tree.Screened`) are asked for what is clear, and their `judge` for the rest; the others are judged. What was
found in pruned branches is not kept: `judge` is asked again where somebody wants to know.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array, Camera, PinholeCamera
from posekit.tree import kernels
from posekit.tree.bits import path_of
from posekit.tree.candidates import Branch, Candidates, lift_all, rays_of
from posekit.tree.check import PASSED, UNSURE, Check, Screened
from posekit.tree.compiled import compiled, n_threads
from posekit.tree.leaves import Leaves, Losses, Postponed
from posekit.tree.plain import UNJUDGED, bound_of

BLOCK = 500
"""Frames a block: their candidates are a megabyte."""

Indices = NDArray[np.int32]


class Places(NamedTuple):
    """Where the points of a check are.

    Attributes
    ----------
    tips, bits : int array (S,)
        Joints whose paths, of each so many last branches, decide.
    joints, first : int array (P,)
        Each point's joint, and the column of its first candidate.
    """

    tips: Indices
    bits: Indices
    joints: Indices
    first: Indices


@dataclass(frozen=True, kw_only=True, eq=False)
class Block:
    """What became of the trees of some frames.

    Parameters
    ----------
    alive : int array (2 + J + 1, N)
        The leaves.
    shut : dict of array (M, 3)
        Frame, code and state of nodes without a position, by level.
    lost : dict of array (M, 3)
        Frame, code and place of nodes that were rejected, by level and number of the check there.
    presumed : list of (check, array)
        What is to be confirmed.
    """

    alive: Indices
    shut: dict[int, Indices]
    lost: dict[tuple[int, int], Indices]
    presumed: list[tuple[Check, Array]]


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
    loops: Any = compiled(kernels)
    n = len(root)
    lift: Callable[[int, int], None] | None = None
    if isinstance(camera, PinholeCamera):
        candidates = Candidates.start(root, parents, given)
        lift = _lifting(loops, candidates, camera, image, parents, lengths, tolerance)
    else:
        candidates = lift_all(
            camera, root, image, parents=parents, lengths=lengths, tolerance=tolerance, given=given
        )
    roots = start(candidates)
    last = candidates.table.shape[1] - 1
    places = [
        [_places_of(tuple(c.points), roots.support(c.points), parents, candidates.first, last) for c in at]
        for at in checks
    ]
    blocks = [(k, min(k + BLOCK, n)) for k in range(0, n, BLOCK)]

    def one(frames: tuple[int, int]) -> Block:
        return _grow_block(loops, roots, lift, checks, places, frames)

    threads = min(n_threads(), len(blocks))
    if threads > 1:
        with ThreadPoolExecutor(threads) as pool:
            # Each in a copy of this context: what NumPy shall not warn of holds there too.
            waiting = [pool.submit(copy_context().run, one, block) for block in blocks]
            grown = [future.result() for future in waiting]
    else:
        grown = [one(block) for block in blocks]
    return _merged(roots, checks, grown) if _confirmed(grown) else None


def _lifting(
    loops: Any,
    candidates: Candidates,
    camera: PinholeCamera,
    image: Array,
    parents: tuple[int, ...],
    lengths: Array,
    tolerance: float,
) -> Callable[[int, int], None]:
    """Return what lifts the joints of some frames, from one to before another."""
    rays, unseen = (
        np.ascontiguousarray(each) for each in (rays_of(camera, image), np.isnan(image).any(axis=-1))
    )
    above, first = np.array(parents, dtype=np.int64), np.array(candidates.first, dtype=np.int64)
    # By joint and frame, though mostly every frame has the same.
    long = np.empty((len(parents), len(image)))
    long[:] = lengths.reshape(len(parents), -1)

    def lift(begin: int, end: int) -> None:
        loops.lift(
            begin,
            end,
            rays,
            unseen,
            above,
            first,
            long,
            float(tolerance),
            candidates.table,
            candidates.states,
            candidates.reach,
        )

    return lift


@lru_cache(maxsize=1024)
def _places_of(
    points: tuple[int, ...],
    support: tuple[int, ...],
    parents: tuple[int, ...],
    first: tuple[int, ...],
    last: int,
) -> Places:
    """Find the points of a check; the last column of candidates is a point that is not known."""
    joints = len(parents)
    tips: list[tuple[int, int]] = []
    known: set[int] = set()
    for joint in reversed(support):
        new = [one for one in path_of(joint, parents) if one not in known]
        if new:
            tips.append((joint, len(new)))
            known.update(new)
    columns = [(p, first[p]) if p < joints else (joints, min(first[-1] + p - joints, last)) for p in points]
    return Places(
        *(np.array([pair[k] for pair in tips], dtype=np.int32) for k in (0, 1)),
        *(np.array([pair[k] for pair in columns], dtype=np.int32) for k in (0, 1)),
    )


def _grow_block(
    loops: Any,
    roots: Leaves,
    lift: Callable[[int, int], None] | None,
    checks: Sequence[Sequence[Check]],
    places: Sequence[Sequence[Places]],
    frames: tuple[int, int],
) -> Block:
    """Grow the trees of the frames from one to before another."""
    candidates = roots.candidates
    if lift is not None:
        lift(*frames)
    rows = slice(*frames)
    nodes = np.zeros((2 + len(roots.joints) + 1, len(roots.frame[rows])), dtype=np.int32)
    nodes[kernels.FRAME] = roots.frame[rows]
    shut, lost = {}, {}
    presumed: list[tuple[Check, Array]] = []
    for level, at in enumerate(checks):
        if level:
            parent, column = roots.parents[level], candidates.first[level]
            nodes, dead = loops.branch(nodes, level, parent, candidates.states, column)
            if len(dead):
                shut[level] = dead
        for k, check in enumerate(at):
            if not nodes.shape[1]:
                break
            points, row = loops.pose(nodes, *places[level][k], candidates.table)
            verdicts = _verdicts(check, points, presumed)
            if verdicts.max() >= 0:
                nodes, lost[level, k] = loops.part(nodes, row, verdicts)
    return Block(alive=nodes, shut=shut, lost=lost, presumed=presumed)


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


def _confirmed(grown: Sequence[Block]) -> bool:
    """Ask each check about all that it presumed, at once."""
    presumed: dict[int, tuple[Check, list[Array]]] = {}
    for block in grown:
        for check, more in block.presumed:
            presumed.setdefault(id(check), (check, []))[1].append(more)
    return all(cast(Screened, check).confirm(np.concatenate(parts)) for check, parts in presumed.values())


def _merged(roots: Leaves, checks: Sequence[Sequence[Check]], grown: Sequence[Block]) -> Leaves:
    """Put blocks together: leaves and losses in the order of the plain path."""
    if not grown:
        return roots.at(len(checks) - 1, roots.frame, roots.code)
    pruned: list[Losses] = []
    for level, at in enumerate(checks):
        frame, code, state = _columns([block.shut[level] for block in grown if level in block.shut])
        for reason, name in UNJUDGED.items():
            rows = np.flatnonzero(state == int(reason))
            if len(rows):
                lost = roots.at(level, frame[rows], code[rows])
                place = np.zeros(len(rows), dtype=np.int8)
                measure = partial(_excess, lost, reason)
                pruned.append(_losses(lost, name, (roots.joints[level],), "m", place, measure))
        for k, check in enumerate(at):
            frame, code, why = _columns([block.lost[level, k] for block in grown if (level, k) in block.lost])
            if len(frame):
                lost, place = roots.at(level, frame, code), why.astype(np.int8)
                measure = partial(_judged, lost, check, place)
                pruned.append(_losses(lost, check.name, check.where, check.unit, place, measure))
    frame, code, _ = _columns([block.alive[:3].T for block in grown])
    return roots.at(len(checks) - 1, frame, code, tuple(pruned))


def _columns(parts: Sequence[Indices]) -> tuple[Indices, Indices, Indices]:
    """Put rows of three together and take their columns."""
    rows = np.concatenate([np.empty((0, 3), dtype=np.int32), *parts])
    first, second, third = np.ascontiguousarray(rows.T)
    return first, second, third


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


def _excess(lost: Leaves, reason: Branch) -> tuple[Array, Array, Array]:
    """Return by how much the segments of lost nodes are too short, and the bounds."""
    n = len(lost.code)
    return lost.excess(lost.level), np.full(n, -np.inf), np.full(n, bound_of(reason))
