"""The binary interpretation tree (Lee & Chen 1985, section 3.1), grown level by level over many frames at once.

A node is identified by its frame and its code (see `posekit.tree.candidates`). A check reads only a few joints, so its
judgement depends on the near-far choices of few joints. A check judges each distinct combination of these choices once,
for all nodes that share the combination. The four limbs, for example, are judged independently of each other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, pairwise
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.cameras import Camera
from posekit.geometry import Array, Ints
from posekit.skeleton import JOINTS, POINT, SEGMENTS
from posekit.tree import steps
from posekit.tree.candidates import DEPTH, FIRST, NO_SOLUTION, UNJUDGED, Candidates, bits, path_of, support_of
from posekit.tree.steps import BRANCH, Step, step

#: Ratio of possible keys to nodes. Above it distinct keys are found by sorting, below it with a table of all keys.
SPARSE_FROM: Final = 64


class Pruned(NamedTuple):
    """Pruned branches.

    Attributes
    ----------
    level : int array (P,)
        Level of the branch; 2^(13 - level) leaves are below it.
    reason : int array (P,)
        Index in `Trees.reasons` of the first violated check and place.
    frame, code : int array (P,)
        Frame of the branch, and its code of `level` bits.
    value, lower, upper : array (P,)
        Value that violates the check, and the bounds of the check.
    """

    level: Ints
    reason: Ints
    frame: Ints
    code: NDArray[np.int64]
    value: Array
    lower: Array
    upper: Array

    @staticmethod
    def joined(parts: Sequence[Pruned]) -> Pruned:
        """Concatenate pruned branches."""
        return Pruned(*(np.concatenate(column) for column in zip(NOTHING, *parts, strict=True)))


NOTHING: Final = Pruned(*np.zeros((4, 0), dtype=np.int64), *np.zeros((3, 0)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Trees:
    """The survivors of the trees of F frames, and the pruned branches with their reasons.

    Parameters
    ----------
    frame, code : int array (N,)
        Frame of each survivor, and its branch as 13 bits: 0 near, 1 far. The first joint has the highest bit. Survivors
        are sorted by frame, then by code.
    joints : array (N, 14, 3)
        Positions, camera frame, metres; NaN for unseen joints and their descendants.
    length_residual : array (N,)
        Largest distance by which a segment of the survivor is too short to reach its ray, metres.
    losses : Pruned
        Pruned branches of each frame, in the order of pruning.
    reasons : tuple of (str, str)
        Name ``check/place`` of each reason, and the unit of the check's values.
    count : int
        F.
    """

    frame: Ints
    code: NDArray[np.int64]
    joints: Array
    length_residual: Array
    losses: Pruned
    reasons: tuple[tuple[str, str], ...]
    count: int

    def __len__(self) -> int:
        """Return the number of survivors."""
        return len(self.code)

    @cached_property
    def branches(self) -> NDArray[np.str_]:
        """The branch of each survivor (N,) as a string of 13 digits: 0 near, 1 far."""
        digits = np.uint32(ord("0")) + (self.code[:, None] >> np.arange(DEPTH)[::-1] & 1)
        return digits.astype(np.uint32).view(f"U{DEPTH}")[:, 0]

    @cached_property
    def rejected(self) -> list[dict[str, int]]:
        """Number of rejected leaves per frame and reason; rejected leaves and survivors of a frame sum to 8192."""
        width = max(len(self.reasons), 1)
        weight = 1 << (DEPTH - self.losses.level)
        number = np.bincount(self.losses.frame * width + self.losses.reason, weight, self.count * width)
        some = np.flatnonzero(number)
        names = [self.reasons[k][0] for k in (some % width).tolist()]
        counts = number[some].astype(int).tolist()
        ends = np.searchsorted(some, width * np.arange(self.count + 1)).tolist()
        return [dict(zip(names[a:b], counts[a:b], strict=True)) for a, b in pairwise(ends)]

    @cached_property
    def levels(self) -> NDArray[np.int64]:
        """Number of nodes at each level (F, 14) that have a survivor below them (Lee & Chen 1985, section 4.1.B)."""
        return ancestors(self.frame, self.code, self.count)

    def pruned(self, frame: int) -> list[tuple[str, str, str, float, float, float, str]]:
        """List every pruned branch of a frame: its code, joint, reason, value, bounds and unit."""
        own = np.flatnonzero(self.losses.frame == frame)
        return [
            (f"{code:0{level}b}", JOINTS[level], self.reasons[reason][0], *numbers, self.reasons[reason][1])
            for level, reason, _, code, *numbers in zip(
                *(one[own].tolist() for one in self.losses), strict=True
            )
        ]


def ancestors(frame: Ints, code: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Count the ancestors of leaves (N,) per frame and level (`count`, 14); leaves are sorted by frame and code."""
    # Each leaf adds a node at every level from the first branch that differs from the leaf before.
    first = np.zeros(len(code), dtype=np.intp)
    _, digits = np.frexp(code[1:] ^ code[:-1])
    first[1:] = np.where(frame[1:] == frame[:-1], DEPTH + 1 - digits, 0)
    added = np.bincount(frame * (DEPTH + 1) + first, minlength=count * (DEPTH + 1))
    return added.reshape(count, DEPTH + 1).cumsum(axis=1)


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
    """Grow the trees of F frames; a branch is pruned at the first level at which a check can reject it.

    Parameters
    ----------
    camera : Camera
        Camera of the F frames.
    image : array (F, 14, 2)
        Image points in the order of `posekit.skeleton.JOINTS`; NaN for unseen joints.
    root : array (F, 3)
        The neck, camera frame, metres.
    lengths : array (17,) or (F, 17)
        Segment lengths, metres, in the order of `posekit.skeleton.SEGMENTS`.
    checks : sequence of checks
        A check judges at the first level at which all its ``points`` (by default all joints) have positions. Checks of
        the same level judge in the order of this sequence.
    judge : callable, optional
        ``judge(check, points (N, 19, 3))`` returns the check's judgement of N postures; points that the check does not
        read are NaN. By default ``check.judge(points)``. If the callable has a method ``steps(check)``, this method
        returns the check as steps of the compiled tree (`posekit.tree.steps`), or None.
    head : array (F, 5, 3), optional
        Head points, metres. A check that reads head points does not judge a frame without head points.
    tolerance : float
        Largest distance by which a segment may be too short to reach its ray, metres. The segment then ends at the
        point of the ray nearest to its start.

    Returns
    -------
    Trees
    """
    ask = judge or (lambda check, points: check.judge(points))
    frames = len(image)
    lengths = np.broadcast_to(np.asarray(lengths, dtype=np.float64), (frames, len(SEGMENTS)))
    head = np.full((frames, 5, 3), np.nan) if head is None else head
    reasons: dict[tuple[str, str], int] = {}
    plan = _planned(checks, getattr(ask, "steps", None), head)
    found = Candidates.lifted(camera, image, root, lengths, head, tolerance)
    frame, code = np.arange(frames), np.zeros(frames, dtype=np.int64)
    losses = []
    for fast, run in groupby(plan, key=lambda planned: planned.steps is not None):
        if fast:
            frame, code, lost = _compiled(found, list(run), frame, code, reasons)
            losses.append(lost)
            continue
        for planned in run:
            frame, code, lost = _taken(found, planned, frame, code, reasons, ask)
            losses.append(lost)
    short = np.zeros(len(code))
    for joint in range(1, len(JOINTS)):
        short = np.fmax(short, found.excess[frame, found.column(DEPTH, joint, code)])
    return Trees(
        frame=frame,
        code=code,
        joints=found.places(DEPTH, range(len(JOINTS)), frame, code)[:, : len(JOINTS)],
        length_residual=short,
        losses=Pruned.joined(losses),
        reasons=tuple(reasons),
        count=frames,
    )


class _Planned(NamedTuple):
    """A check with its level, points and compiled steps; if `check` is None, the near-far branching at a joint."""

    level: int
    check: Any
    points: tuple[int, ...]
    steps: Sequence[Step] | None


def _planned(
    checks: Sequence[Any], form: Callable[[Any], Sequence[Step] | None] | None, head: Array
) -> list[_Planned]:
    """Return branchings and checks, sorted by level; checks that the C++ tree implements have compiled steps."""
    branch = [step(BRANCH, ())] if steps.compiled else None
    plan = [_Planned(level, None, (), branch) for level in range(1, DEPTH + 1)]
    for check in checks:
        points = tuple(POINT[name] for name in getattr(check, "points", ()) or JOINTS)
        if max(points) > DEPTH and not np.isfinite(head).any():
            continue  # the check reads head points, and no frame has any
        level = max([1, *(point for point in points if point <= DEPTH)])
        plan.append(_Planned(level, check, points, form(check) if steps.compiled and form else None))
    return sorted(plan, key=lambda planned: planned.level)


def _numbered(reasons: dict[tuple[str, str], int], names: Iterable[str], unit: str) -> Ints:
    """Return the indices (K,) of named reasons in `reasons`, after adding the names that are missing."""
    return np.array([reasons.setdefault((name, unit), len(reasons)) for name in names], dtype=np.int64)


def _branch_reasons(joint: int) -> list[str]:
    return [f"{name}/{JOINTS[joint]}" for name in UNJUDGED.values()]


def _compiled(
    found: Candidates,
    plan: Sequence[_Planned],
    frame: Ints,
    code: NDArray[np.int64],
    reasons: dict[tuple[str, str], int],
) -> tuple[Ints, NDArray[np.int64], Pruned]:
    """Apply consecutive steps of the compiled tree to nodes; return the remaining nodes and the pruned branches."""
    rows, limits = [], None
    for planned in plan:
        for one in planned.steps or ():
            places, unit = _branch_reasons(planned.level), "m"
            if planned.check is not None:
                places, unit = [f"{planned.check.name}/{place}" for place in one.places], planned.check.unit
            for place in places:
                reasons.setdefault((place, unit), len(reasons))
            rows.append((planned.level, reasons[places[0], unit], *one.numbers))
            limits = limits if one.limits is None else one.limits
    frame, code, whole, numbers = steps.compiled.grow(
        found.table, found.state, found.excess, limits, np.array(rows), frame, code
    )
    return frame, code, Pruned(*whole.reshape(-1, 4).T, *numbers.reshape(-1, 3).T)


def _taken(
    found: Candidates,
    planned: _Planned,
    frame: Ints,
    code: NDArray[np.int64],
    reasons: dict[tuple[str, str], int],
    ask: Callable[[Any, Array], Any],
) -> tuple[Ints, NDArray[np.int64], Pruned]:
    """Branch at one joint, or apply one check; return the remaining nodes and the pruned branches."""
    level, check = planned.level, planned.check
    if check is None:
        frame, code, reason, value, lower, upper = _branched(found, level, frame, code)
        rows = _numbered(reasons, _branch_reasons(level), "m")
    elif len(code):
        places, reason, value, lower, upper = _asked(found, planned, frame, code, ask)
        rows = _numbered(reasons, [f"{check.name}/{place}" for place in places], check.unit)
    else:
        return frame, code, NOTHING
    dead = np.flatnonzero(reason >= 0)
    at = np.full(len(dead), level)
    lost = Pruned(
        at,
        rows[reason[dead]] if len(dead) else at,
        frame[dead],
        code[dead],
        value[dead],
        lower[dead],
        upper[dead],
    )
    alive = reason < 0
    return frame[alive], code[alive], lost


def _branched(
    found: Candidates, joint: int, frame: Ints, code: NDArray[np.int64]
) -> tuple[Ints, NDArray[np.int64], Ints, Array, Array, Array]:
    """Give every node a near and a far child; return their reasons for pruning (-1 if kept), values and bounds."""
    frame, code = np.repeat(frame, 2), np.repeat(code, 2) << 1
    code[1::2] |= 1
    column = FIRST[joint] + bits(joint, path_of(joint))[code]
    state = found.state[frame, column].astype(np.int64)
    upper = np.where(state == NO_SOLUTION, 0.0, np.inf)
    return frame, code, state - 1, found.excess[frame, column], np.full(len(code), -np.inf), upper


def _asked(
    found: Candidates,
    planned: _Planned,
    frame: Ints,
    code: NDArray[np.int64],
    ask: Callable[[Any, Array], Any],
) -> tuple[tuple[str, ...], Ints, Array, Array, Array]:
    """Judge each distinct combination of the near-far choices that a check depends on.

    Return the places of the check, and for each node the index of the first violated place (-1 if none), its value and
    its bounds.
    """
    level, check, points, _ = planned
    support = support_of(points)
    node, row = _distinct((frame << len(support)) | bits(level, support)[code])
    places = found.places(level, points, frame[node], code[node])
    of_head = [point for point in points if point > DEPTH]
    known = np.flatnonzero(np.isfinite(places[:, of_head]).all(axis=(1, 2)))
    place, numbers = np.full(len(node), -1), np.full((3, len(node)), np.nan)
    named: tuple[str, ...] = ()
    if known.size:
        judgement = ask(check, places[known])
        named = tuple(judgement.places)
        value = np.asarray(judgement.value, dtype=np.float64)
        lower, upper = (np.broadcast_to(bound, value.shape) for bound in (judgement.lower, judgement.upper))
        violated = np.minimum(value - lower, upper - value) < -np.asarray(judgement.tolerance)
        fails = np.flatnonzero(violated.any(axis=1))
        first = violated[fails].argmax(axis=1)
        place[known[fails]] = first
        numbers[:, known[fails]] = [each[fails, first] for each in (value, lower, upper)]
    return named, place[row], *numbers[:, row]


def _distinct(key: Ints) -> tuple[Ints, Ints]:
    """Return an index of each distinct key and the inverse (N,), as `numpy.unique` does; keys are not negative."""
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
