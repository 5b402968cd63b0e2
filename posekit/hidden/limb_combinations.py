"""Choosing one way for each hidden limb such that all checks between them pass."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from posekit.geometry import Array
from posekit.hidden.grouped_rows import offsets
from posekit.hidden.limb_placements import LimbPlacements
from posekit.hidden.occlusion_pattern import OcclusionPattern
from posekit.hidden.posture_rows import Index, Mask, PostureRows, judge_rows

N_WAYS_TRIED: dict[int, tuple[int, ...]] = {1: (1, 48), 2: (1, 6, 48), 3: (1, 5, 16), 4: (1, 4, 9)}
"""Ways tried of each limb, by how many limbs there are: the middle one first, more where it fails."""


def choose_combination(
    pattern: OcclusionPattern,
    base: Array,
    limbs: Sequence[tuple[Index, LimbPlacements, Array]],
) -> tuple[list[Index], Mask]:
    """Choose a way for each open limb of n survivors.

    The cost of a choice is how far down its limbs' lists it is; the cheapest that passes is taken.

    Parameters
    ----------
    base : array (n, P, 3)
        Their points, known ones and those of the chosen trunk.
    limbs : sequence of (survivor (S,), LimbPlacements of S rows, cost (S,))
        By limb of the pattern: each row's survivor, in order, and how far it is from the middle of its set.

    Returns
    -------
    rows : list of int array (n,)
        By limb: the row chosen; -1 where none is.
    found : bool array (n,)
    """
    n, m = len(base), len(limbs)
    ranked = []
    found = np.zeros(n, dtype=bool)
    left = np.ones(n, dtype=bool)
    for survivor, _, cost in limbs:
        order = np.lexsort((cost, survivor))
        start = offsets(survivor, n)
        ranked.append((order, start))
        left &= np.diff(start) > 0
    chosen = [np.full(n, -1) for _ in limbs]
    for tried in N_WAYS_TRIED.get(m, (1,)):
        open_ = np.flatnonzero(left)
        if not len(open_):
            break
        # Every so many places down the list: near the middle and far from it.
        candidates = []
        for order, start in ranked:
            count = np.diff(start)[open_]
            place = np.arange(tried)[None, :] * count[:, None] // tried
            candidates.append(order[start[open_][:, None] + place])
        allowed = np.ones((len(open_), *(tried,) * m), dtype=bool)
        for check in pattern.several:
            which = pattern.limbs_of(check)
            shape = (len(open_), *(tried,) * len(which))
            grid = np.indices(shape).reshape(len(shape), -1)
            columns: dict[int, tuple[Array, Index | None]] = {}
            for k, limb in enumerate(which):
                row = candidates[limb][grid[0], grid[1 + k]]
                placed = limbs[limb][1]
                for joint, table in zip(pattern.limbs[limb].free, (placed.middle, placed.end), strict=True):
                    if joint in pattern.free(pattern.limbs[limb]):
                        columns[joint] = (table, row)
            passed, _ = judge_rows([check], PostureRows.of(base, open_[grid[0]]).with_(columns))
            spread = [len(open_), *(tried if limb in which else 1 for limb in range(m))]
            allowed &= passed.reshape(spread)
        rank = np.indices((tried,) * m)
        total = np.where(allowed, (rank**2).sum(axis=0), np.iinfo(np.int64).max).reshape(len(open_), -1)
        best = total.argmin(axis=1)
        ok = np.flatnonzero(allowed.reshape(len(open_), -1)[np.arange(len(open_)), best])
        places = np.unravel_index(best[ok], (tried,) * m)
        for limb in range(m):
            chosen[limb][open_[ok]] = candidates[limb][ok, places[limb]]
        found[open_[ok]] = True
        left[open_[ok]] = False
    return chosen, found
