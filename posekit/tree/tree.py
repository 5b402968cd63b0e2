"""The binary interpretation tree (Lee & Chen 1985, section 3.1), grown level by level over many frames at once.

A node is a frame and a code. What a check says about it depends on the branches of the few joints that the check reads.
So each check is asked once for every different choice of those branches that is still alive, and its answer serves all
nodes that share it: given the torso, the four limbs are judged alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.cameras import Camera
from posekit.geometry import Array, Ints
from posekit.skeleton import JOINTS, POINT, POINTS, SEGMENTS
from posekit.tree.candidates import (
    DEPTH,
    FIRST,
    NO_SOLUTION,
    OPEN,
    UNJUDGED,
    Candidates,
    bits,
    path_of,
    support_of,
)

#: Frames grown together: enough to spread the overhead of NumPy, few enough to keep memory small.
FRAMES_AT_ONCE: Final = 500

#: Possible keys a node from which they are sorted instead of being looked up in a table.
SPARSE_FROM: Final = 64


class Pruned(NamedTuple):
    """Branches that one reason pruned at one level.

    Attributes
    ----------
    level : int
        Level; a branch stands for the 2^(13 - level) leaves below it.
    check, unit : str
        Name of the check and unit of its values.
    places : tuple of str
        What it judges.
    frame, code, place : int array (P,)
        The branches, and the first of `places` that is violated.
    value, lower, upper : array (P,)
        What was found there, and its bounds.
    """

    level: int
    check: str
    unit: str
    places: tuple[str, ...]
    frame: Ints
    code: NDArray[np.int64]
    place: Ints
    value: Array
    lower: Array
    upper: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Trees:
    """Remaining branches of the trees of F frames, by frame, then by code, and the reasons for pruning the others.

    Parameters
    ----------
    frame, code : int array (N,)
        Frame of each survivor, and its 13 branches: the first joint's the highest bit, 0 near, 1 far.
    joints : array (N, 14, 3)
        Positions, camera frame, metres; NaN where a joint was not seen, and beyond it.
    length_residual : array (N,)
        Metres by which the worst segment is too short for its image and was taken as tangent to its ray.
    losses : tuple of Pruned
        In the order in which branches were pruned.
    candidates : tuple of Candidates
        Positions of all branches, of `FRAMES_AT_ONCE` frames each.
    count : int
        F.
    """

    frame: Ints
    code: NDArray[np.int64]
    joints: Array
    length_residual: Array
    losses: tuple[Pruned, ...]
    candidates: tuple[Candidates, ...]
    count: int

    def __len__(self) -> int:
        """Return the number of survivors."""
        return len(self.code)

    @cached_property
    def branches(self) -> list[str]:
        """Each survivor's 13 branches as 0 (near) and 1 (far)."""
        return [f"{code:0{DEPTH}b}" for code in self.code.tolist()]

    @cached_property
    def rejected(self) -> list[dict[str, int]]:
        """Leaves of the full tree that were lost, by frame and reason; with the survivors they make 8192."""
        totals: list[dict[str, int]] = [{} for _ in range(self.count)]
        for loss in self.losses:
            weight, width = 1 << (DEPTH - loss.level), len(loss.places)
            number = np.bincount(loss.frame * width + loss.place)
            key = np.flatnonzero(number)
            for k, n in zip(key.tolist(), number[key].tolist(), strict=True):
                reason = f"{loss.check}/{loss.places[k % width]}"
                total = totals[k // width]
                total[reason] = total.get(reason, 0) + n * weight
        return totals

    @cached_property
    def levels(self) -> NDArray[np.int64]:
        """Survivors by level (F, 14): distinct beginnings of the remaining codes (section 4.1.B)."""
        out = np.zeros((self.count, DEPTH + 1), dtype=np.int64)
        for level in range(DEPTH + 1):
            key = (self.frame << level) | (self.code >> (DEPTH - level))  # ascending, as the survivors are
            new = np.diff(key, prepend=-1) > 0
            out[:, level] = np.bincount(self.frame[new], minlength=self.count)
        return out

    def pruned(self, frame: int) -> list[tuple[str, str, str, float, float, float, str]]:
        """List every pruned branch of a frame: its code, joint, reason, value, bounds and unit."""
        return [
            (
                f"{loss.code[k]:0{loss.level}b}",
                JOINTS[loss.level],
                f"{loss.check}/{loss.places[loss.place[k]]}",
                float(loss.value[k]),
                float(loss.lower[k]),
                float(loss.upper[k]),
                loss.unit,
            )
            for loss in self.losses
            for k in np.flatnonzero(loss.frame == frame)
        ]


def grow(
    camera: Camera,
    image: Array,
    root: Array,
    lengths: ArrayLike,
    checks: Sequence[Any],
    *,
    judge: Callable[[Any, Array], Any] | None = None,
    head: Array | None = None,
    tolerance: float = 0.0,
) -> Trees:
    """Grow the trees of F frames, pruning each branch at the first level where a check can judge it.

    Parameters
    ----------
    camera : Camera
        Lifts segments; its first axis counts frames.
    image : array (F, 14, 2)
        Image points in tree order; NaN where a joint was not seen.
    root : array (F, 3)
        The neck, camera frame, metres.
    lengths : array (17,) or (F, 17)
        Metres, in the order of `posekit.skeleton.SEGMENTS`.
    checks : sequence of checks
        Asked in this order at the first level where all their ``points`` are placed.
    judge : callable, optional
        ``judge(check, points (N, 19, 3))`` returns the check's judgement of postures with head points; NaN marks points
        that the check does not read. By default ``check.judge(points)``.
    head : array (F, 5, 3), optional
        Head points, metres. A check that reads head points is not asked in frames that lack them.
    tolerance : float
        Metres by which a segment may be too short for its image and count as tangent to its ray.

    Returns
    -------
    Trees
    """
    one: Any = camera
    ask = judge or (lambda check, points: check.judge(points))
    frames = len(image)
    lengths = np.broadcast_to(np.asarray(lengths, dtype=np.float64), (frames, len(SEGMENTS)))
    head = np.full((frames, 5, 3), np.nan) if head is None else head
    reads = [tuple(POINT[name] for name in getattr(check, "points", ()) or POINTS) for check in checks]
    levels = [max([1, *(point for point in points if point <= DEPTH)]) for points in reads]
    parts, losses, candidates = [], [], []
    for at in range(0, max(frames, 1), FRAMES_AT_ONCE):
        own = slice(at, at + FRAMES_AT_ONCE)
        found = Candidates.lifted(one.take(own), image[own], root[own], lengths[own], head[own], tolerance)
        frame, code = np.arange(len(image[own])), np.zeros(len(image[own]), dtype=np.int64)
        for level in range(1, DEPTH + 1):
            frame, code, lost = _branched(found, level, frame, code)
            for check, points, first in zip(checks, reads, levels, strict=True):
                if first == level and len(code):
                    frame, code, more = _asked(found, level, frame, code, check, points, ask)
                    lost += more
            losses += [one._replace(frame=one.frame + at) for one in lost]
        joints = found.places(DEPTH, range(len(JOINTS)), frame, code)[:, : len(JOINTS)]
        short = np.zeros(len(code))
        for joint in range(1, len(JOINTS)):
            short = np.fmax(short, found.excess[frame, found.column(DEPTH, joint, code)])
        parts.append((frame + at, code, joints, short))
        candidates.append(found)
    frame, code, joints, short = (np.concatenate([part[k] for part in parts]) for k in range(4))
    return Trees(
        frame=frame,
        code=code,
        joints=joints,
        length_residual=short,
        losses=tuple(losses),
        candidates=tuple(candidates),
        count=frames,
    )


def _branched(
    found: Candidates, joint: int, frame: Ints, code: NDArray[np.int64]
) -> tuple[Ints, NDArray[np.int64], list[Pruned]]:
    """Give every node a near and a far successor; those that the lift excludes are lost."""
    frame, code = np.repeat(frame, 2), np.repeat(code, 2) << 1
    code[1::2] |= 1
    column = FIRST[joint] + bits(joint, path_of(joint))[code]
    state = found.state[frame, column]
    lost = []
    for kind, name in UNJUDGED.items():
        dead = np.flatnonzero(state == kind)
        if dead.size:
            nothing = np.zeros(dead.size, dtype=np.intp)
            bounds = np.full(dead.size, -np.inf), np.full(dead.size, 0.0 if kind == NO_SOLUTION else np.inf)
            value = found.excess[frame[dead], column[dead]]
            place = (JOINTS[joint],)
            lost.append(Pruned(joint, name, "m", place, frame[dead], code[dead], nothing, value, *bounds))
    alive = state == OPEN
    return frame[alive], code[alive], lost


def _asked(
    found: Candidates,
    level: int,
    frame: Ints,
    code: NDArray[np.int64],
    check: Any,
    points: tuple[int, ...],
    ask: Callable[[Any, Array], Any],
) -> tuple[Ints, NDArray[np.int64], list[Pruned]]:
    """Ask a check about every distinct choice of its own branches; the nodes that it rejects are lost."""
    support = support_of(points)
    node, row = _distinct((frame << len(support)) | bits(level, support)[code])
    places = found.places(level, points, frame[node], code[node])
    of_head = [point for point in points if point > DEPTH]
    known = np.flatnonzero(np.isfinite(places[:, of_head]).all(axis=(1, 2)))
    if not known.size:
        return frame, code, []
    judgement = ask(check, places[known])
    value = np.asarray(judgement.value, dtype=np.float64)
    lower, upper = (np.broadcast_to(bound, value.shape) for bound in (judgement.lower, judgement.upper))
    violated = np.minimum(value - lower, upper - value) < -np.asarray(judgement.tolerance)
    rejected = np.zeros(len(node), dtype=np.bool_)
    rejected[known] = violated.any(axis=1)
    dead = rejected[row]
    if not dead.any():
        return frame, code, []
    place = np.zeros(len(node), dtype=np.intp)
    place[known] = violated.argmax(axis=1)
    spread = np.empty((3, len(node)))
    spread[:, known] = [each[np.arange(len(known)), place[known]] for each in (value, lower, upper)]
    at = row[dead]
    name = check.name
    named = tuple(judgement.places)
    lost = Pruned(level, name, check.unit, named, frame[dead], code[dead], place[at], *spread[:, at])
    return frame[~dead], code[~dead], [lost]


def _distinct(key: Ints) -> tuple[Ints, Ints]:
    """Return one node of each distinct key (N,), which is not negative, and which of them each node has."""
    width = int(key.max()) + 1
    if width > SPARSE_FROM * len(key):
        _, node, row = np.unique(key, return_index=True, return_inverse=True)
        return node, row
    table = np.full(width, -1)
    table[key] = np.arange(len(key))
    asked = np.flatnonzero(table >= 0)
    node = table[asked]
    table[asked] = np.arange(len(asked))
    return node, table[key]
