"""The one-dimensional search over the neck's depth: where the rigid parts come to close, and how far they may not.

The twin, for a camera that is known, of the search over the scale of one that is not (Taylor 2000, section 2.1;
`posekit.linkage.search`): there the pictures of one family differ in the scale s, here in how far the body is away.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.placement.body import Sight
from posekit.placement.closure import Closure, Rows

CELLS = 96
"""Cells of the grid over the angle whose cosine is the distance over its bound."""

PART = 64
"""Frames that are sampled at once."""

WORTH = 0.6
"""Misfit, in neck-pelvis lengths, above which a sampled minimum is not refined."""

STEEP = 3.0
"""Neck-pelvis lengths a radian by which a misfit may fall inside a cell: there it is looked at closer."""

FINER = 12
"""Into how many cells such a cell is cut, twice."""

GOLDEN = (np.sqrt(5.0) - 1) / 2
STEPS = 52
"""Golden sections: a cell to 1e-12 of a radian."""

HALVINGS = 48

ASIDE = 1e-7
"""Radians to both sides of a minimum at which the misfit must not be less."""

ROUNDING = 1e-13
"""Metres that rounding leaves of a misfit a few metres away."""

SAME = 1e-9
"""Relative difference in distance between two minima that are one."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Depths:
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


class Minima(NamedTuple):
    """Local minima of single branches: frame, distance and misfit of each (K,), frame by frame, best first."""

    frame: Rows
    distance: Array
    misfit: Array


def search(sight: Sight, frames: Rows, tolerance: Array) -> tuple[Closure, list[Depths]]:
    """Search the distance of the neck in some frames.

    The misfit r is the largest of the four errors of the distances that lift nothing, so that ``r <= tolerance`` is
    just where the check of rigid parts leaves some branch of the torso and the hips alive.

    Parameters
    ----------
    sight : Sight
        Of frames with a neck that is seen, and bounded above the nearest distance.
    frames : int array (n,)
        Which.
    tolerance : array (n,)
        Metres.

    Returns
    -------
    closure : Closure
    depths : list of Depths
        One for each of `frames`.
    """
    closure = Closure(sight)
    found: list[Depths] = []
    for start in range(0, len(frames), PART):
        found += _search(closure, sight, frames[start : start + PART], tolerance[start : start + PART])
    return closure, found


def _search(closure: Closure, sight: Sight, frames: Rows, tolerance: Array) -> list[Depths]:
    upper = sight.farthest[frames, 0]
    psi = _angles(closure, frames, upper)
    distance = upper[:, None] * np.cos(psi)
    distance[:, -1] = closure.nearest
    misfit = closure.all(frames, distance)
    envelope = misfit.min(axis=-1)
    minima = _minima(closure, frames, upper, psi, misfit)
    nodes, values = _nodes(distance, envelope, minima)
    edges = _intervals(closure, frames, nodes, values, tolerance)
    depths = []
    for k, frame in enumerate(frames):
        own = slice(*np.searchsorted(minima.frame, [k, k + 1]))
        at, residual = _distinct(minima.distance[own], minima.misfit[own])
        kept = residual <= max(tolerance[k], residual.min(initial=np.inf))
        depths.append(
            Depths(
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


def _angles(closure: Closure, frames: Rows, upper: Array) -> Array:
    """Lay the grid (n, G) over the angle, ascending: even, and finer where branches begin and end close together."""
    last = np.arccos(np.minimum(closure.nearest / upper, 1.0))[:, None]
    even = last * np.linspace(0, 1, CELLS + 1)
    breaks = closure.breaks(frames)
    with np.errstate(invalid="ignore"):
        possible = (breaks > closure.nearest) & (breaks < upper[:, None])
        # In place of breaks that a frame has not, the grid is made finer.
        spare = last * (np.arange(breaks.shape[1]) + 0.5) / breaks.shape[1]
        breaks = np.where(possible, np.arccos(breaks / upper[:, None]), spare)
    breaks = np.sort(breaks, axis=1)
    between = (breaks[:, 1:] + breaks[:, :-1]) / 2
    return np.sort(np.concatenate([even, breaks, between], axis=1), axis=1)


def _minima(closure: Closure, frames: Rows, upper: Array, psi: Array, misfit: Array) -> Minima:
    """Bracket the local minima of every branch on the grid, look closer where one may hide, and refine them."""
    known = (closure.known[frames] > 0)[:, None, None]
    found = [_brackets(psi, np.where(known & (misfit <= WORTH * closure.unit), misfit, np.inf))]
    step = np.diff(psi, axis=1)[..., None]
    hidden = known & (np.minimum(misfit[:, 1:], misfit[:, :-1]) <= STEEP * closure.unit * step)
    row, cell, branch = np.nonzero(hidden)
    low, high = psi[row, cell], psi[row, cell + 1]
    for _ in range(2):
        nodes = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, FINER + 1)
        values = closure.one(frames[row, None], branch[:, None], upper[row, None] * np.cos(nodes))
        inside = _brackets(nodes, values[..., None])
        found.append(_Brackets(row[inside.row], branch[inside.row], *inside[2:]))
        again = np.minimum(values[:, 1:], values[:, :-1]) <= STEEP * closure.unit * np.diff(nodes, axis=1)
        k, cell = np.nonzero(again)
        row, branch, low, high = row[k], branch[k], nodes[k, cell], nodes[k, cell + 1]
    row, branch, low, high, middle, value = (np.concatenate(parts) for parts in zip(*found, strict=True))
    brackets = _Brackets(row, branch, low, high, middle, value)
    best, least = _golden(closure, frames[row], upper[row], brackets)
    distance = upper[row] * np.cos(best)
    # What falls on beyond its bracket, or below which another branch runs, is no minimum of the envelope.
    true = least <= closure.least(frames[row], distance) + ROUNDING
    for angle in (best - ASIDE, best + ASIDE):
        true &= least <= closure.one(frames[row], branch, upper[row] * np.cos(angle)) + ROUNDING
    order = np.flatnonzero(true)[np.lexsort((least[true], row[true]))]
    return Minima(row[order], distance[order], least[order])


class _Brackets(NamedTuple):
    """Angles (K,) between which a branch of a frame has a local minimum, and the best that is known there."""

    row: Rows
    branch: Rows
    low: Array
    high: Array
    middle: Array
    value: Array


def _brackets(psi: Array, misfit: Array) -> _Brackets:
    """Find samples (n, G, B) that are no larger than those beside them."""
    beside = np.full((len(psi), 1, misfit.shape[2]), np.inf)
    lowest = misfit <= np.concatenate([beside, misfit[:, :-1]], axis=1)
    lowest &= misfit <= np.concatenate([misfit[:, 1:], beside], axis=1)
    row, cell, branch = np.nonzero(lowest & np.isfinite(misfit))
    return _Brackets(
        row,
        branch,
        psi[row, np.maximum(cell - 1, 0)],
        psi[row, np.minimum(cell + 1, psi.shape[1] - 1)],
        psi[row, cell],
        misfit[row, cell, branch],
    )


def _golden(closure: Closure, frame: Rows, upper: Array, brackets: _Brackets) -> tuple[Array, Array]:
    """Shrink brackets by golden sections (Kiefer 1953); return the best angle (K,) and the misfit there."""
    _, branch, low, high, best, least = brackets

    def value(angle: Array) -> Array:
        return closure.one(frame, branch, upper * np.cos(angle))

    inner, outer = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    f_inner, f_outer = value(inner), value(outer)
    for _ in range(STEPS):
        # Where a branch ends inside the bracket both may be infinite: keep the side of the best that is known.
        left = np.where(np.isinf(f_inner) & np.isinf(f_outer), best < inner, f_inner < f_outer)
        high, low = np.where(left, outer, high), np.where(left, low, inner)
        probe = np.where(left, high - GOLDEN * (high - low), low + GOLDEN * (high - low))
        f_probe = value(probe)
        inner, outer = np.where(left, probe, outer), np.where(left, inner, probe)
        f_inner, f_outer = np.where(left, f_probe, f_outer), np.where(left, f_inner, f_probe)
        better = f_probe < least
        best, least = np.where(better, probe, best), np.where(better, f_probe, least)
    return best, least


def _distinct(distance: Array, misfit: Array) -> tuple[Array, Array]:
    """Drop minima that another, better one is at: they are sorted by misfit."""
    kept: list[int] = []
    for k, at in enumerate(distance):
        if all(abs(at - distance[other]) > SAME * at for other in kept):
            kept.append(k)
    return distance[kept], misfit[kept]


def _nodes(distance: Array, envelope: Array, minima: Minima) -> tuple[list[Array], list[Array]]:
    """Put the minima among the samples: for each frame distances, ascending, and the misfit there."""
    nodes, values = [], []
    for k in range(len(distance)):
        own = slice(*np.searchsorted(minima.frame, [k, k + 1]))
        at = np.concatenate([distance[k], minima.distance[own]])
        value = np.concatenate([envelope[k], minima.misfit[own]])
        order = np.lexsort((value, at))
        nodes.append(at[order])
        values.append(value[order])
    return nodes, values


def _intervals(
    closure: Closure, frames: Rows, nodes: list[Array], values: list[Array], tolerance: Array
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
    for _ in range(HALVINGS):
        middle = (good + bad) / 2
        still = closure.least(frames[owner], middle) <= tolerance[owner]
        good, bad = np.where(still, middle, good), np.where(still, bad, middle)
    edge = dict(zip(crossing.tolist(), good.tolist(), strict=True))
    found = []
    for k, mask in enumerate(within):
        bounds = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
        pairs = []
        for first, last in zip(np.flatnonzero(bounds == 1), np.flatnonzero(bounds == -1) - 1, strict=True):
            low = edge.get(int(start[k] + first) - 1, float(nodes[k][first]))
            high = edge.get(int(start[k] + last), float(nodes[k][last]))
            pairs.append((low, high))
        found.append(_joined(np.array(pairs).reshape(-1, 2)))
    return found


def _joined(intervals: Array) -> Array:
    """Join intervals that touch."""
    if len(intervals) < 2:
        return intervals
    new = np.ones(len(intervals), dtype=np.bool_)
    new[1:] = intervals[1:, 0] > intervals[:-1, 1] * (1 + SAME)
    last = np.append(np.flatnonzero(new)[1:] - 1, len(intervals) - 1)
    joined: NDArray[np.float64] = np.stack([intervals[new, 0], intervals[last, 1]], axis=-1)
    return joined
