"""The one-dimensional search over the neck's depth: where the rigid parts come to close, and how far they may not.

The twin, for a camera that is known, of the search over the scale of one that is not (Taylor 2000,
section 2.1; `posekit.linkages.scale_search`): there the pictures of one family differ in the
scale s, here in how far the body is away.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from posekit.cameras.neck.body import NeckRays
from posekit.cameras.neck.closure import RigidClosure, Rows
from posekit.cameras.neck.minima import MisfitSamples, minima_of
from posekit.geometry import Array, runs

N_CELLS = 96
"""Cells of the grid over the angle whose cosine is the distance over its bound."""

BLOCK_FRAMES = 64
"""Frames that are sampled at once."""

N_HALVINGS = 48

SAME_DISTANCE = 1e-9
"""Relative difference in distance between two minima that are one."""


@dataclass(frozen=True, kw_only=True, eq=False)
class NeckDepths:
    """What the search found for one frame; distances are of the neck along its ray, metres.

    Parameters
    ----------
    lower, upper : float
        The nearest distance searched, and the farthest at which all segments have a solution.
    segment : str
        The segment that is too short for its image beyond `upper`.
    known : int
        How many of the four distances are seen: with none nothing but the bounds is told.
    minima : array (M,)
        Local minima of the misfit over all branches, best first: those within the tolerance, and always the best.
    residual : array (M,)
        Misfit there, metres.
    intervals : array (I, 2)
        Where the misfit is within the tolerance, ascending.
    curve, curve_residual : array (C,)
        The misfit against the distance: the least over all branches; infinite where no branch has a solution.
    """

    lower: float
    upper: float
    segment: str
    known: int
    minima: Array
    residual: Array
    intervals: Array
    curve: Array
    curve_residual: Array

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                value.flags.writeable = False


def search(sight: NeckRays, frames: Rows, tolerance: Array) -> tuple[RigidClosure, list[NeckDepths]]:
    """Search the distance of the neck in some frames.

    The misfit r is the largest of the four errors of the distances that lift nothing, so that ``r <= tolerance`` is
    just where the check of rigid parts leaves some branch of the torso and the hips alive.

    Parameters
    ----------
    sight : NeckRays
        Of frames with a neck that is seen, and bounded above the nearest distance.
    frames : int array (n,)
        Which.
    tolerance : array (n,)
        Metres.

    Returns
    -------
    closure : RigidClosure
    depths : list of Depths
        One for each of `frames`.
    """
    closure = RigidClosure(sight)
    found: list[NeckDepths] = []
    for start in range(0, len(frames), BLOCK_FRAMES):
        found += _search(
            closure, sight, frames[start : start + BLOCK_FRAMES], tolerance[start : start + BLOCK_FRAMES]
        )
    return closure, found


def _search(closure: RigidClosure, sight: NeckRays, frames: Rows, tolerance: Array) -> list[NeckDepths]:
    upper = sight.farthest[frames, 0]
    psi = _angles(closure, frames, upper)
    distance = upper[:, None] * np.cos(psi)
    distance[:, -1] = closure.nearest
    misfit = closure.all(frames, distance)
    envelope = misfit.min(axis=-1)
    minima = minima_of(closure, frames, upper, psi, misfit)
    gaps = _gaps(closure, frames, distance, misfit <= tolerance[:, None, None], tolerance)
    nodes, values = _nodes(distance, envelope, minima, gaps)
    edges = _intervals(closure, frames, nodes, values, tolerance)
    depths = []
    for k, frame in enumerate(frames):
        own = slice(*np.searchsorted(minima.frame, [k, k + 1]))
        at, residual = _distinct(minima.distance[own], minima.misfit[own])
        kept = residual <= max(tolerance[k], residual.min(initial=np.inf))
        depths.append(
            NeckDepths(
                lower=closure.nearest,
                upper=float(upper[k]),
                segment=sight.segment(int(frame)),
                known=int(closure.known[frame]),
                minima=at[kept] if closure.known[frame] else np.empty(0),
                residual=residual[kept] if closure.known[frame] else np.empty(0),
                intervals=edges[k],
                curve=distance[k, ::-1].copy(),
                curve_residual=envelope[k, ::-1].copy(),
            )
        )
    return depths


def _angles(closure: RigidClosure, frames: Rows, upper: Array) -> Array:
    """Lay the grid (n, G) over the angle, ascending: even, and finer where branches begin and end close together."""
    last = np.arccos(np.minimum(closure.nearest / upper, 1.0))[:, None]
    even = last * np.linspace(0, 1, N_CELLS + 1)
    breaks = closure.breaks(frames)
    with np.errstate(invalid="ignore"):
        possible = (breaks > closure.nearest) & (breaks < upper[:, None])
        # In place of breaks that a frame has not, the grid is made finer.
        spare = last * (np.arange(breaks.shape[1]) + 0.5) / breaks.shape[1]
        breaks = np.where(possible, np.arccos(breaks / upper[:, None]), spare)
    breaks = np.sort(breaks, axis=1)
    between = (breaks[:, 1:] + breaks[:, :-1]) / 2
    return np.sort(np.concatenate([even, breaks, between], axis=1), axis=1)


def _distinct(distance: Array, misfit: Array) -> tuple[Array, Array]:
    """Drop minima that another, better one is at: they are sorted by misfit."""
    kept: list[int] = []
    for k, at in enumerate(distance):
        if all(abs(at - distance[other]) > SAME_DISTANCE * at for other in kept):
            kept.append(k)
    return distance[kept], misfit[kept]


def _gaps(
    closure: RigidClosure, frames: Rows, distance: Array, within: NDArray[np.bool_], tolerance: Array
) -> MisfitSamples:
    """Find gaps between one branch that leaves the tolerance and another that enters it, inside one cell.

    Returns samples, unsorted: the ends of each gap, and its middle.
    """
    inside = np.asarray(within.any(axis=-1))
    torn = inside[:, :-1] & inside[:, 1:] & ~(within[:, :-1] & within[:, 1:]).any(axis=-1)
    row, cell = np.nonzero(torn)
    far, near, limit = distance[row, cell], distance[row, cell + 1], tolerance[row]
    ends = []
    for start, other, branches in ((far, near, within[row, cell]), (near, far, within[row, cell + 1])):
        good, bad = start, other
        for _ in range(N_HALVINGS):
            middle = (good + bad) / 2
            still = ((closure.all(frames[row], middle[:, None])[:, 0] <= limit[:, None]) & branches).any(
                axis=-1
            )
            good, bad = np.where(still, middle, good), np.where(still, bad, middle)
        ends.append(good)
    gap = ends[0] > ends[1]
    row, high, low = row[gap], ends[0][gap], ends[1][gap]
    at = np.concatenate([high, low, (high + low) / 2])
    row = np.tile(row, 3)
    return MisfitSamples(row, at, closure.least(frames[row], at))


def _nodes(
    distance: Array, envelope: Array, minima: MisfitSamples, gaps: MisfitSamples
) -> tuple[list[Array], list[Array]]:
    """Put the minima and the gaps among the samples: for each frame distances, ascending, and the misfit there."""
    nodes, values = [], []
    for k in range(len(distance)):
        own = slice(*np.searchsorted(minima.frame, [k, k + 1]))
        torn = gaps.frame == k
        at = np.concatenate([distance[k], minima.distance[own], gaps.distance[torn]])
        value = np.concatenate([envelope[k], minima.misfit[own], gaps.misfit[torn]])
        order = np.lexsort((value, at))
        nodes.append(at[order])
        values.append(value[order])
    return nodes, values


def _intervals(
    closure: RigidClosure, frames: Rows, nodes: list[Array], values: list[Array], tolerance: Array
) -> list[Array]:
    """Find where the misfit is within the tolerance: each edge is bisected between two samples."""
    within = [value <= limit for value, limit in zip(values, tolerance, strict=True)]
    start = np.cumsum([0, *map(len, nodes)])
    flat, inside = np.concatenate(nodes), np.concatenate(within)
    crossing = np.flatnonzero(inside[1:] != inside[:-1])
    crossing = crossing[~np.isin(crossing + 1, start)]  # not from one frame to the next
    owner = np.searchsorted(start, crossing, side="right") - 1
    good = np.where(inside[crossing], flat[crossing], flat[crossing + 1])
    bad = np.where(inside[crossing], flat[crossing + 1], flat[crossing])
    for _ in range(N_HALVINGS):
        middle = (good + bad) / 2
        still = closure.least(frames[owner], middle) <= tolerance[owner]
        good, bad = np.where(still, middle, good), np.where(still, bad, middle)
    edge = dict(zip(crossing.tolist(), good.tolist(), strict=True))
    found = []
    for k, mask in enumerate(within):
        pairs = []
        for first, stop in runs(mask):
            low = edge.get(int(start[k]) + first - 1, float(nodes[k][first]))
            high = edge.get(int(start[k]) + stop - 1, float(nodes[k][stop - 1]))
            pairs.append((low, high))
        found.append(_joined(np.array(pairs).reshape(-1, 2)))
    return found


def _joined(intervals: Array) -> Array:
    """Join intervals that touch."""
    if len(intervals) < 2:
        return intervals
    new = np.ones(len(intervals), dtype=np.bool_)
    new[1:] = intervals[1:, 0] > intervals[:-1, 1] * (1 + SAME_DISTANCE)
    last = np.append(np.flatnonzero(new)[1:] - 1, len(intervals) - 1)
    joined: NDArray[np.float64] = np.stack([intervals[new, 0], intervals[last, 1]], axis=-1)
    return joined
