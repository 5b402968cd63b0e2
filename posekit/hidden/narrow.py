"""A closer look at a turn of the trunk: which of its samples, and of their neighbourhoods, are feasible."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from posekit.geometry import Array
from posekit.hidden.asking import Index, Mask, PostureRows, ask
from posekit.hidden.hosts import EXACT_WITHIN, N_SUBSAMPLES, Hosts
from posekit.hidden.limb import NEAR_MISS, LimbPlacer
from posekit.hidden.plan import LimbChain, OcclusionPattern

N_BEST_MISSES = 6
"""Near misses of a core that are looked into once more while nothing feasible is found."""

N_SUBDIVISIONS = 3
"""How often; and how often the neighbourhoods of the ends of an arc are split."""

MAX_CORE_SAMPLES = 240
"""Samples of a core that are looked into at all."""

MakePlacer = Callable[[LimbChain, Hosts], LimbPlacer]


def survey(plan: OcclusionPattern, hosts: Hosts, placer: MakePlacer) -> Array:
    """Return how far each host (H,) is from being feasible, radians: 0 where its own checks and lifted limbs pass."""
    _, miss = ask([*plan.torso_own, *plan.hips_own], PostureRows.of(hosts.points))
    for limb in plan.limbs:
        left = np.flatnonzero(np.isfinite(miss))
        miss[left] = np.maximum(miss[left], placer(limb, hosts.take(left)).miss())
    return miss


def narrowed(plan: OcclusionPattern, hosts: Hosts, placer: MakePlacer) -> Hosts:
    """Keep what is feasible, with the neighbourhoods of feasible samples and of near misses split more finely."""
    miss = survey(plan, hosts, placer)
    cores = len(hosts.tried)
    least = np.full(cores, np.inf)
    np.minimum.at(least, hosts.core, miss)
    if hosts.turn is None:
        return replace(hosts.take(miss == 0.0), miss=least)
    proven = np.ones(cores, dtype=bool)
    proven[hosts.core[~_proven(plan, hosts, placer)]] = False
    spacing = hosts.spacing[hosts.core]
    near = (miss < NEAR_MISS * spacing) | _edges_and_dips(hosts, miss)[0]
    at = _nearest(hosts.core, np.where(near, np.minimum(miss, np.pi), np.inf), MAX_CORE_SAMPLES)
    looked, parent = hosts.children(at, spacing[at])
    miss, width = survey(plan, looked, placer), spacing[at][parent] * hosts.turn.finer
    np.minimum.at(least, looked.core, miss)
    found = looked.take(miss == 0.0)
    for _ in range(N_SUBDIVISIONS):
        edge, dip = _edges_and_dips(looked, miss)
        empty = np.bincount(found.core, minlength=cores) == 0
        dip |= empty[looked.core] & (miss > 0.0)
        at = np.union1d(
            _nearest(
                looked.core,
                np.where(dip & (miss < NEAR_MISS * hosts.spacing[looked.core]), miss, np.inf),
                N_BEST_MISSES,
            ),
            _nearest(looked.core, np.where(edge, 0.0, np.inf), MAX_CORE_SAMPLES),
        )
        if not len(at):
            break
        looked, parent = looked.uneven().children(at, width[at])
        miss, width = survey(plan, looked, placer), width[at][parent] * hosts.turn.finer
        np.minimum.at(least, looked.core, miss)
        found = found.and_(looked.take(miss == 0.0))
    return replace(
        found,
        tried=hosts.tried * N_SUBSAMPLES,
        spacing=hosts.spacing * hosts.turn.finer,
        sure=proven,
        miss=least,
    )


def _edges_and_dips(hosts: Hosts, miss: Array) -> tuple[Mask, Mask]:
    """Find, on circles whose rows are in order, the ends of feasible arcs and the least misses between them."""
    edge, dip = np.zeros(len(hosts), dtype=bool), np.zeros(len(hosts), dtype=bool)
    if hosts.turn is not None and hosts.turn.about is not None:
        same = hosts.core[1:] == hosts.core[:-1]
        changes = ((miss[1:] == 0.0) != (miss[:-1] == 0.0)) & same
        edge[1:] |= changes
        edge[:-1] |= changes
        dip[:] = miss > 0.0
        dip[1:] &= ~same | (miss[1:] <= miss[:-1])
        dip[:-1] &= ~same | (miss[:-1] <= miss[1:])
    return edge, dip


def thinned(hosts: Hosts, most: int) -> Hosts:
    """Keep at most so many even places a core, evenly, and those found by a closer look: the ends of arcs."""
    count = np.bincount(hosts.core[hosts.even], minlength=len(hosts.tried))
    before: Index = np.cumsum(hosts.even) - hosts.even
    rank: Index = before - before[np.searchsorted(hosts.core, hosts.core)]
    many = np.maximum(count, 1)[hosts.core]
    step = (many <= most) | ((rank + 1) * most // many > rank * most // many)
    # Each then stands for so much more of the circle or of the rotations.
    fewer = np.maximum(count / most, 1.0)
    power = 1.0 if hosts.turn is not None and hosts.turn.about is not None else 1.0 / 3.0
    kept = hosts.take(np.asarray(step | ~hosts.even))
    return replace(kept, tried=kept.tried / fewer, spacing=kept.spacing * fewer**power)


def _nearest(core: Index, miss: Array, most: int) -> Index:
    """Return the rows of least miss, at most so many a core, rows in order; infinite ones are left out."""
    order = np.lexsort((miss, core))
    order = order[np.isfinite(miss[order])]
    count = np.bincount(core[order], minlength=int(core.max(initial=0)) + 1)
    rank = np.arange(len(order)) - (np.cumsum(count) - count)[core[order]]
    return np.sort(order[rank < most])


def _proven(plan: OcclusionPattern, hosts: Hosts, placer: MakePlacer) -> Mask:
    """Tell which samples of a circle prove their whole arc impossible: a limb is too short by more than it turns."""
    proven = np.zeros(len(hosts), dtype=bool)
    turn = hosts.turn
    if turn is None or turn.about is None:
        return proven
    for limb in plan.limbs:
        if placer(limb, hosts).tolerance > EXACT_WITHIN:
            return np.zeros(len(hosts), dtype=bool)
        far = float(np.linalg.norm(turn.body[turn.free.index(limb.base)])) if limb.base in turn.free else 0.0
        proven |= placer(limb, hosts).too_short() > far * hosts.spacing[hosts.core] / 2.0
    return proven
