"""Frames made from those around them: interpolated as rigid pieces, or smoothed."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, best_rotation, rotation_between, runs, unit, vector_from_rotation
from posekit.remedy.pieces import (
    N_PIECES,
    N_UNKNOWNS,
    PIECE_OF_POINT,
    TORSO_AND_HIPS,
    columns_of,
    moved,
    vectors_of,
)

Bools = NDArray[np.bool_]

BLOCK_FRAMES: Final = 240
"""Frames that are smoothed at once."""

SMOOTHING_ORDER: Final = np.array([1.0, -3.0, 3.0, -1.0])
"""Third differences: motion whose acceleration changes evenly is left as it is."""


def turn_between(start: Array, end: Array) -> Array:
    """Return the turns of pieces that bring one posture (19, 3) nearest to another: unknowns (36,)."""
    step = np.zeros(N_UNKNOWNS)
    step[:3] = end[0] - start[0]
    before, after = vectors_of(start[None])[0], vectors_of(end[None])[0]
    for piece in range(N_PIECES):
        mine = [k for k in range(1, len(start)) if PIECE_OF_POINT[k] == piece]
        known = [k for k in mine if np.isfinite(before[k]).all() and np.isfinite(after[k]).all()]
        if not known:
            continue
        if len(known) == 1:
            R = rotation_between(unit(before[known]), unit(after[known]))[0]
        else:
            R = best_rotation(np.einsum("ki,kj->ij", after[known], before[known])[None])[0][0]
        step[columns_of(piece)] = vector_from_rotation(R[None])[0]
    return step


def interpolated(points: Array, bad: Bools) -> Array:
    """Put postures (T, 19, 3) between the good frames around them; those at an end of the clip stay.

    Each piece of the body turns evenly, and the neck moves evenly, from the one good frame to the other.
    """
    out = points.copy()
    good = ~bad & np.isfinite(points[:, list(TORSO_AND_HIPS)]).all(axis=(1, 2))
    for first, after in runs(~good):
        before = first - 1
        if before < 0 or after >= len(points) or not bad[first:after].any():
            continue
        there, back = (turn_between(points[a], points[b]) for a, b in ((before, after), (after, before)))
        share = (np.arange(first, after) - before)[:, None] / (after - before)
        count = after - first
        ahead = moved(np.repeat(points[before][None], count, axis=0), share * there)
        behind = moved(np.repeat(points[after][None], count, axis=0), (1 - share) * back)
        out[first:after] = (1 - share[..., None]) * ahead + share[..., None] * behind
    return out


def smoothed(values: Array, loose: Bools, strength: float) -> Array:
    r"""Smooth columns (T, K) where they may move, the other frames as they are.

    Minimises :math:`|y - x|^2 + \lambda |D^3 y|^2` over the loose frames (Whittaker 1923; Eilers 2003, *A perfect
    smoother*, Anal Chem 75:3631).

    Parameters
    ----------
    values : array (T, K)
        What is smoothed.
    loose : bool array (T,)
        Which frames may move.
    strength : float
        The :math:`\lambda`.
    """
    out = values.copy()
    rows = np.flatnonzero(loose)
    for shift in (0, BLOCK_FRAMES // 2):
        for block in np.split(rows, np.searchsorted(rows, np.arange(shift, len(values), BLOCK_FRAMES))):
            if block.size:
                out[block] = _block(out, values[block], block, strength)
    return out


def _block(current: Array, target: Array, rows: NDArray[np.intp], strength: float) -> Array:
    """Smooth some frames, with those around them as they are now."""
    width = len(SMOOTHING_ORDER)
    low, high = max(rows[0] - width + 1, 0), min(rows[-1] + width, len(current))
    window, count = current[low:high].copy(), high - low
    if count < width:
        return target
    difference = np.zeros((count - width + 1, count))
    for k, factor in enumerate(SMOOTHING_ORDER):
        difference[np.arange(count - width + 1), np.arange(count - width + 1) + k] = factor
    own = difference[:, rows - low]
    window[rows - low] = 0.0
    normal = np.eye(len(rows)) + strength * own.T @ own
    return np.asarray(np.linalg.solve(normal, target - strength * own.T @ (difference @ window)))
