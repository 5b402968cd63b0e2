"""Choosing one completion of each survivor, near the middle of its sets."""

from __future__ import annotations

import numpy as np

from posekit.geometry import Array
from posekit.hidden.asking import Mask, PostureRows, ask
from posekit.hidden.groups import mean
from posekit.hidden.party import Party, Way
from posekit.hidden.together import choose

HOSTS_TRIED = 8
"""Places of the trunk on which limbs are sought that pass together, the middle one first."""


def representatives(party: Party) -> tuple[Array, Mask]:
    """Choose one host and one placement of each limb for every survivor, near the middle of the sets."""
    n, h = len(party), len(party.hosts)
    postures = party.points.copy()
    found = np.zeros(n, dtype=bool)
    if not h:
        return postures, found
    usable = party.allowed.copy()
    for way in party.sets:
        some = np.zeros((n, h), dtype=bool)
        some[way.survivor, way.rows.host] = True
        usable &= some
    cost = np.where(usable, _trunk_cost(party), np.inf)
    order = np.argsort(cost, axis=1, kind="stable")
    costs = [_limb_cost(party, way) for way in party.sets]
    for attempt in range(min(HOSTS_TRIED, h)):
        # Evenly down the list: the middle one, then others, the last one far from it.
        place = attempt * np.maximum(usable.sum(axis=1) - 1, 0) // max(min(HOSTS_TRIED, h) - 1, 1)
        host = order[np.arange(n), place]
        left = np.flatnonzero(~found & usable[np.arange(n), host])
        if not len(left):
            continue
        index = np.full(n, -1)
        index[left] = np.arange(len(left))
        limbs, rows = [], []
        for way, far in zip(party.sets, costs, strict=True):
            here = np.flatnonzero((index[way.survivor] >= 0) & (way.rows.host == host[way.survivor]))
            limbs.append((index[way.survivor[here]], way.rows.take(here), far[here]))
            rows.append(here)
        base = party.points[left].copy()
        base[:, list(party.plan.trunk)] = party.hosts.points[host[left]][:, list(party.plan.trunk)]
        chosen, ok = choose(party.plan, base, limbs)
        for way, here, row in zip(party.sets, rows, chosen, strict=True):
            for joint in party.plan.free(way.limb):
                base[ok, joint] = way.position(joint)[here[row[ok]]]
        passed, _ = ask(party.plan.asked, PostureRows.of(base[ok]))
        good = np.flatnonzero(ok)[passed]
        postures[left[good]] = base[good]
        found[left[good]] = True
    return postures, found


def _trunk_cost(party: Party) -> Array:
    """Return how far each host's trunk is from the middle of the survivor's (N, H), square metres."""
    cost = np.zeros(party.allowed.shape)
    count = np.maximum(party.allowed.sum(axis=1), 1)[:, None]
    for joint in party.plan.trunk:
        position = party.hosts.points[:, joint]
        middle = party.allowed @ position / count
        cost += ((position[None] - middle[:, None]) ** 2).sum(axis=-1)
    return cost


def _limb_cost(party: Party, way: Way) -> Array:
    """Return how far each placement is from the middle of its set, square metres.

    The mean square distance to all others is that to their mean plus a constant, so the least is the medoid.
    Placements found by a closer look, or drawn out by the tolerance, are not counted as long as there are others.
    """
    even = (way.rows.seed >= 0) & party.even[way.rows.host]
    cost = np.zeros(len(way.survivor))
    for joint in party.plan.free(way.limb):
        position = way.position(joint)
        middle = mean(way.survivor[even], len(party), position[even])
        lone = mean(way.survivor, len(party), position)
        middle = np.where(np.isnan(middle), lone, middle)
        cost += ((position - middle[way.survivor]) ** 2).sum(axis=1)
    return np.asarray(cost + np.where(way.rows.excess > 0.0, 1e6 * (1.0 + way.rows.excess), 0.0))
