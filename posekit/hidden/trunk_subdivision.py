"""A closer look at a turn of the trunk: which of its samples, and of their neighbourhoods, are feasible."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from posekit.geometry import Array
from posekit.hidden.limb_placer import NEAR_MISS, LimbPlacer
from posekit.hidden.occlusion_pattern import LimbChain, OcclusionPattern
from posekit.hidden.posture_rows import Index, Mask, PostureRows, judge_rows
from posekit.hidden.trunk_placements import EXACT_WITHIN_METRES, N_SUBSAMPLES, TrunkPlacements, thinning

N_BEST_MISSES = 6
"""Near misses of a core that are looked into once more while nothing feasible is found."""

N_SUBDIVISIONS = 3
"""How often they are; and how often the neighbourhoods of the ends of an arc are split."""

MAX_CORE_SAMPLES = 240
"""Samples of a core that are looked into at all."""

MakePlacer = Callable[[LimbChain, TrunkPlacements], LimbPlacer]


def trunk_misses(pattern: OcclusionPattern, trunks: TrunkPlacements, placer: MakePlacer) -> Array:
    """Return how far each trunk (H,) is from being feasible, radians: 0 where its own checks and lifted limbs pass."""
    _, miss = judge_rows([*pattern.torso_own, *pattern.hips_own], PostureRows.of(trunks.points))
    for limb in pattern.limbs:
        left = np.flatnonzero(np.isfinite(miss))
        miss[left] = np.maximum(miss[left], placer(limb, trunks.take(left)).miss())
    return miss


def subdivided(pattern: OcclusionPattern, trunks: TrunkPlacements, placer: MakePlacer) -> TrunkPlacements:
    """Keep what is feasible, with the neighbourhoods of feasible samples and of near misses split more finely."""
    miss = trunk_misses(pattern, trunks, placer)
    cores = len(trunks.tried)
    least = np.full(cores, np.inf)
    np.minimum.at(least, trunks.core, miss)
    if trunks.turn is None:
        return replace(trunks.take(miss == 0.0), miss=least)
    # That no place is left is proven only where every sample excludes the whole arc around it.
    proven = np.ones(cores, dtype=bool)
    proven[trunks.core[~_proven(pattern, trunks, placer)]] = False
    spacing = trunks.spacing[trunks.core]
    near = (miss < NEAR_MISS * spacing) | _edges_and_dips(trunks, miss)[0]
    at = _nearest(trunks.core, np.where(near, np.minimum(miss, np.pi), np.inf), MAX_CORE_SAMPLES)
    looked, parent = trunks.split(at, spacing[at])
    miss, width = trunk_misses(pattern, looked, placer), spacing[at][parent] * trunks.turn.finer
    np.minimum.at(least, looked.core, miss)
    found = looked.take(miss == 0.0)
    for _ in range(N_SUBDIVISIONS):
        edge, dip = _edges_and_dips(looked, miss)
        empty = np.bincount(found.core, minlength=cores) == 0
        dip |= empty[looked.core] & (miss > 0.0)
        at = np.union1d(
            _nearest(
                looked.core,
                np.where(dip & (miss < NEAR_MISS * trunks.spacing[looked.core]), miss, np.inf),
                N_BEST_MISSES,
            ),
            _nearest(looked.core, np.where(edge, 0.0, np.inf), MAX_CORE_SAMPLES),
        )
        if not len(at):
            break
        looked, parent = looked.uneven().split(at, width[at])
        miss, width = trunk_misses(pattern, looked, placer), width[at][parent] * trunks.turn.finer
        np.minimum.at(least, looked.core, miss)
        found = found.and_(looked.take(miss == 0.0))
    return replace(
        found,
        tried=trunks.tried * N_SUBSAMPLES,
        spacing=trunks.spacing * trunks.turn.finer,
        sure=proven,
        miss=least,
    )


def _edges_and_dips(trunks: TrunkPlacements, miss: Array) -> tuple[Mask, Mask]:
    """Find, on circles whose rows are in order, the ends of feasible arcs and the least misses between them."""
    edge, dip = np.zeros(len(trunks), dtype=bool), np.zeros(len(trunks), dtype=bool)
    if trunks.turn is not None and trunks.turn.about is not None:
        same = trunks.core[1:] == trunks.core[:-1]
        changes = ((miss[1:] == 0.0) != (miss[:-1] == 0.0)) & same
        edge[1:] |= changes
        edge[:-1] |= changes
        dip[:] = miss > 0.0
        dip[1:] &= ~same | (miss[1:] <= miss[:-1])
        dip[:-1] &= ~same | (miss[:-1] <= miss[1:])
    return edge, dip


def thinned(trunks: TrunkPlacements, most: int) -> TrunkPlacements:
    """Keep at most so many even places a core, evenly, and those found by a closer look: the ends of arcs."""
    count = np.bincount(trunks.core[trunks.even], minlength=len(trunks.tried))
    even = np.flatnonzero(trunks.even)
    step = ~trunks.even
    step[even[thinning(trunks.core[even], most)]] = True
    # Each then stands for so much more of the circle or of the rotations.
    fewer = np.maximum(count / most, 1.0)
    # On a circle spacing grows with what each sample stands for, among rotations with its cube root.
    power = 1.0 if trunks.turn is not None and trunks.turn.about is not None else 1.0 / 3.0
    kept = trunks.take(step)
    return replace(kept, tried=kept.tried / fewer, spacing=kept.spacing * fewer**power)


def _nearest(core: Index, miss: Array, most: int) -> Index:
    """Return the rows of least miss, at most so many a core, rows in order; infinite ones are left out."""
    order = np.lexsort((miss, core))
    order = order[np.isfinite(miss[order])]
    count = np.bincount(core[order], minlength=int(core.max(initial=0)) + 1)
    rank = np.arange(len(order)) - (np.cumsum(count) - count)[core[order]]
    return np.sort(order[rank < most])


def _proven(pattern: OcclusionPattern, trunks: TrunkPlacements, placer: MakePlacer) -> Mask:
    """Tell which samples of a circle prove their whole arc impossible: a limb is too short by more than it turns."""
    proven = np.zeros(len(trunks), dtype=bool)
    turn = trunks.turn
    if turn is None or turn.about is None:
        return proven
    for limb in pattern.limbs:
        if placer(limb, trunks).tolerance > EXACT_WITHIN_METRES:
            return np.zeros(len(trunks), dtype=bool)
        far = float(np.linalg.norm(turn.body[turn.free.index(limb.base)])) if limb.base in turn.free else 0.0
        proven |= placer(limb, trunks).too_short() > far * trunks.spacing[trunks.core] / 2.0
    return proven
