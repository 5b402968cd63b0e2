"""The local minima of the misfit over the neck's distance: every branch's, down to rounding."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from posekit.cameras.neck.closure import RigidClosure, Rows
from posekit.geometry import Array

WORTH_REFINING = 0.6
"""Misfit, in neck-pelvis lengths, above which a sampled minimum is not refined."""

STEEP_SLOPE = 3.0
"""Neck-pelvis lengths a radian by which a misfit may fall inside a cell: there it is looked at closer."""

N_FINER_CELLS = 12
"""Into how many cells such a cell is cut, twice."""

GOLDEN_SECTION = (np.sqrt(5.0) - 1) / 2
GOLDEN_STEPS = 52
"""Golden sections: a cell to 1e-12 of a radian."""

ASIDE_RADIANS = 1e-7
"""Radians to both sides of a minimum at which the misfit must not be less."""

ROUNDING_METRES = 1e-13
"""Metres that rounding leaves of a misfit a few metres away."""


class MisfitSamples(NamedTuple):
    """Distances that no grid would meet: frame, distance and misfit of each (K,)."""

    frame: Rows
    distance: Array
    misfit: Array


def minima_of(closure: RigidClosure, frames: Rows, upper: Array, psi: Array, misfit: Array) -> MisfitSamples:
    """Bracket the local minima of every branch on the grid, look closer where one may hide, and refine them.

    They come frame by frame, best first.
    """
    known = (closure.known[frames] > 0)[:, None, None]
    found = [_brackets(psi, np.where(known & (misfit <= WORTH_REFINING * closure.unit), misfit, np.inf))]
    step = np.diff(psi, axis=1)[..., None]
    hidden = known & (np.minimum(misfit[:, 1:], misfit[:, :-1]) <= STEEP_SLOPE * closure.unit * step)
    row, cell, branch = np.nonzero(hidden)
    low, high = psi[row, cell], psi[row, cell + 1]
    for _ in range(2):
        nodes = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, N_FINER_CELLS + 1)
        values = closure.one(frames[row, None], branch[:, None], upper[row, None] * np.cos(nodes))
        inside = _brackets(nodes, values[..., None])
        found.append(_Brackets(row[inside.row], branch[inside.row], *inside[2:]))
        again = np.minimum(values[:, 1:], values[:, :-1]) <= STEEP_SLOPE * closure.unit * np.diff(
            nodes, axis=1
        )
        k, cell = np.nonzero(again)
        row, branch, low, high = row[k], branch[k], nodes[k, cell], nodes[k, cell + 1]
    row, branch, low, high, middle, value = (np.concatenate(parts) for parts in zip(*found, strict=True))
    brackets = _Brackets(row, branch, low, high, middle, value)
    best, least = _golden(closure, frames[row], upper[row], brackets)
    distance = upper[row] * np.cos(best)
    # What falls on beyond its bracket, or below which another branch runs, is no minimum of the envelope.
    true = least <= closure.least(frames[row], distance) + ROUNDING_METRES
    for angle in (best - ASIDE_RADIANS, best + ASIDE_RADIANS):
        true &= least <= closure.one(frames[row], branch, upper[row] * np.cos(angle)) + ROUNDING_METRES
    order = np.flatnonzero(true)[np.lexsort((least[true], row[true]))]
    return MisfitSamples(row[order], distance[order], least[order])


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


def _golden(closure: RigidClosure, frame: Rows, upper: Array, brackets: _Brackets) -> tuple[Array, Array]:
    """Shrink brackets by golden sections (Kiefer 1953); return the best angle (K,) and the misfit there."""
    _, branch, low, high, best, least = brackets

    def value(angle: Array) -> Array:
        return closure.one(frame, branch, upper * np.cos(angle))

    inner, outer = high - GOLDEN_SECTION * (high - low), low + GOLDEN_SECTION * (high - low)
    f_inner, f_outer = value(inner), value(outer)
    for _ in range(GOLDEN_STEPS):
        # Where a branch ends inside the bracket both may be infinite: keep the side of the best that is known.
        left = np.where(np.isinf(f_inner) & np.isinf(f_outer), best < inner, f_inner < f_outer)
        high, low = np.where(left, outer, high), np.where(left, low, inner)
        probe = np.where(left, high - GOLDEN_SECTION * (high - low), low + GOLDEN_SECTION * (high - low))
        f_probe = value(probe)
        inner, outer = np.where(left, probe, outer), np.where(left, inner, probe)
        f_inner, f_outer = np.where(left, f_probe, f_outer), np.where(left, f_inner, f_probe)
        better = f_probe < least
        best, least = np.where(better, probe, best), np.where(better, f_probe, least)
    return best, least
