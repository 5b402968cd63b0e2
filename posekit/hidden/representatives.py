"""Choosing one completion of each survivor, near the middle of its sets."""

from __future__ import annotations

import numpy as np

from posekit.geometry import Array
from posekit.hidden.grouped_rows import mean
from posekit.hidden.limb_combinations import choose_combination
from posekit.hidden.pattern_batch import LimbSets, PatternBatch
from posekit.hidden.posture_rows import Mask, PostureRows, judge_rows

MAX_TRUNKS_TRIED = 8
"""Places of the trunk on which limbs are sought that pass together, the middle one first."""


def representatives(batch: PatternBatch) -> tuple[Array, Mask]:
    """Choose one trunk and one placement of each limb for every survivor, near the middle of the sets."""
    n, h = len(batch), len(batch.trunks)
    postures = batch.points.copy()
    found = np.zeros(n, dtype=bool)
    if not h:
        return postures, found
    usable = batch.allowed.copy()
    for limb_set in batch.allowed_sets:
        some = np.zeros((n, h), dtype=bool)
        some[limb_set.survivor, limb_set.rows.trunk] = True
        usable &= some
    cost = np.where(usable, _trunk_cost(batch), np.inf)
    order = np.argsort(cost, axis=1, kind="stable")
    costs = [_limb_cost(batch, limb_set) for limb_set in batch.allowed_sets]
    for attempt in range(min(MAX_TRUNKS_TRIED, h)):
        # Evenly down the list: the middle one, then others, the last one far from it.
        place = attempt * np.maximum(usable.sum(axis=1) - 1, 0) // max(min(MAX_TRUNKS_TRIED, h) - 1, 1)
        trunk = order[np.arange(n), place]
        left = np.flatnonzero(~found & usable[np.arange(n), trunk])
        if not len(left):
            continue
        index = np.full(n, -1)
        index[left] = np.arange(len(left))
        limbs, rows = [], []
        for limb_set, far in zip(batch.allowed_sets, costs, strict=True):
            here = np.flatnonzero(
                (index[limb_set.survivor] >= 0) & (limb_set.rows.trunk == trunk[limb_set.survivor])
            )
            limbs.append((index[limb_set.survivor[here]], limb_set.rows.take(here), far[here]))
            rows.append(here)
        base = batch.points[left].copy()
        base[:, list(batch.pattern.trunk_joints)] = batch.trunks.points[trunk[left]][
            :, list(batch.pattern.trunk_joints)
        ]
        chosen, ok = choose_combination(batch.pattern, base, limbs)
        for limb_set, here, row in zip(batch.allowed_sets, rows, chosen, strict=True):
            for joint in batch.pattern.free(limb_set.limb):
                base[ok, joint] = limb_set.position(joint)[here[row[ok]]]
        passed, _ = judge_rows(batch.pattern.relevant_checks, PostureRows.of(base[ok]))
        good = np.flatnonzero(ok)[passed]
        postures[left[good]] = base[good]
        found[left[good]] = True
    return postures, found


def _trunk_cost(batch: PatternBatch) -> Array:
    """Return how far each trunk's trunk is from the middle of the survivor's (N, H), square metres."""
    cost = np.zeros(batch.allowed.shape)
    count = np.maximum(batch.allowed.sum(axis=1), 1)[:, None]
    for joint in batch.pattern.trunk_joints:
        position = batch.trunks.points[:, joint]
        middle = batch.allowed @ position / count
        cost += ((position[None] - middle[:, None]) ** 2).sum(axis=-1)
    return cost


def _limb_cost(batch: PatternBatch, limb_set: LimbSets) -> Array:
    """Return how far each placement is from the middle of its set, square metres.

    The mean square distance to all others is that to their mean plus a constant, so the least is the medoid.
    Placements found by a closer look, or drawn out by the tolerance, are not counted as long as there are others.
    """
    even = (limb_set.rows.seed >= 0) & batch.even[limb_set.rows.trunk]
    cost = np.zeros(len(limb_set.survivor))
    for joint in batch.pattern.free(limb_set.limb):
        position = limb_set.position(joint)
        middle = mean(limb_set.survivor[even], len(batch), position[even])
        lone = mean(limb_set.survivor, len(batch), position)
        middle = np.where(np.isnan(middle), lone, middle)
        cost += ((position - middle[limb_set.survivor]) ** 2).sum(axis=1)
    return np.asarray(cost + np.where(limb_set.rows.excess > 0.0, 1e6 * (1.0 + limb_set.rows.excess), 0.0))
