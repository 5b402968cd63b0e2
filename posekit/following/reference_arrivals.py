"""The cheapest ways from the ends of paths to survivors, all pairs at once in matrix products, block by block."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.compiled.path_kernels import TIGHT_COST
from posekit.following.beam import Beam
from posekit.following.channels import N_CHANNELS, NextSurvivors
from posekit.following.floors import Arrivals, Floors
from posekit.following.motion_model import MotionModel
from posekit.following.states import States
from posekit.following.transitions import Target, step_costs, turn_costs
from posekit.geometry import Array

MAX_BLOCK_NUMBERS: Final = 1 << 21
"""Numbers of one matrix held at once: 16 MB."""

N_PROBED_ENDS: Final = 8
"""Ends of paths whose turns are charged first: the cheapest of them bounds what is worth looking at."""


def find(
    states: States,
    to: NextSurvivors,
    floors: Floors,
    *,
    model: MotionModel,
    beam: Beam,
    width: int,
) -> Arrivals:
    """Find the cheapest way from each last survivor to each new one.

    Of paths of either kind, fresh or not, at least the `width` cheapest are among those found, if they are within the
    beam's slack.

    Parameters
    ----------
    states : States
        The ends of the paths so far.
    to : NextSurvivors
        The survivors of the frame.
    floors : Floors
        What each way costs at least.
    model : MotionModel
        What steps and turns cost.
    beam : Beam
        Its slack is how much dearer than the cheapest a way may be.
    width : int
        How many ways of each kind are found at least.
    """
    search = _ArrivalSearch(to, floors, model, beam, width)
    groups = _groups(states, floors)
    sizes = np.cumsum([0, *(len(group) for group in groups)])
    for start, end in _blocks(sizes, max(1, MAX_BLOCK_NUMBERS // (N_CHANNELS * len(to)))):
        rows = np.concatenate(groups[start:end])
        begins = sizes[start:end] - sizes[start]
        search.add(states.take(rows), rows, begins)
    return search.found()


class _ArrivalSearch:
    """What was found, and what a path may cost at most to be wanted."""

    def __init__(
        self,
        to: NextSurvivors,
        floors: Floors,
        model: MotionModel,
        beam: Beam,
        width: int,
    ) -> None:
        self.target, self.own, self.new = Target.of(to.channels, to.time), to.cost, to.fresh
        self.floors = floors
        self.model, self.slack, self.width = model, beam.slack, width
        self.most = np.full(2, np.inf)
        self.dropped = np.inf
        self.parts: list[tuple[NDArray[np.intp], NDArray[np.intp], Array]] = []
        self.cheapest = [np.empty(0), np.empty(0)]

    def add(self, part: States, rows: NDArray[np.intp], begins: NDArray[np.intp]) -> None:
        """Go on from some groups of ends, `rows` of all, each of which begins at one of `begins`."""
        lowest = self.floors.ends[rows].min()
        near = np.flatnonzero(lowest + self.floors.to <= self.most.max() + TIGHT_COST)
        if len(near) < len(self.own):
            self.dropped = min(self.dropped, float(self.most.max()))
        if not len(near):
            return
        target, new = self.target.take(near), self.new[near]
        lengths = np.diff(np.append(begins, len(part)))
        if self.floors.alike:
            total = np.repeat(step_costs(part.take(begins), target, self.model), lengths, axis=0)
        else:
            total = step_costs(part, target, self.model)
        total += part.cost[:, None] + self.own[near]
        if self.floors.moving:
            low = self.floors.turns[rows][:, None] + self.floors.to_turns[near]
            self._add_turns(total, low, part, target, new)
        least = np.minimum.reduceat(total, begins, axis=0)
        fresh = part.fresh[begins][:, None] | new
        self._tighten(least, fresh)
        group, to = np.nonzero(least <= self.most[fresh.astype(int)] + TIGHT_COST)
        away = np.isfinite(least)
        away[group, to] = False
        self.dropped = min(self.dropped, float(least[away].min(initial=np.inf)))
        self.parts.append(
            (rows[_cheapest(total, least, begins, lengths, group, to)], near[to], least[group, to])
        )

    def _add_turns(
        self, total: Array, low: Array, part: States, target: Target, new: NDArray[np.bool_]
    ) -> None:
        """Add to costs (S, N) those of turns wherever a path can be wanted; elsewhere what they are at least, `low`."""
        fresh = part.fresh[:, None] | new
        total += low
        for kind in np.unique(fresh).astype(int).tolist():
            lowest = np.where(fresh == kind, total, np.inf).min(axis=1)
            probes = np.argsort(lowest)[:N_PROBED_ENDS]
            probed = total[probes] - low[probes] + turn_costs(part.take(probes), target, self.model)
            cheapest = probed[fresh[probes] == kind].min(initial=np.inf)
            self.most[kind] = min(self.most[kind], cheapest + self.slack)
        close = total <= self.most[fresh.astype(int)] + TIGHT_COST
        ends, survivors = np.flatnonzero(close.any(axis=1)), np.flatnonzero(close.any(axis=0))
        if len(ends):
            both = np.ix_(ends, survivors)
            total[both] += turn_costs(part.take(ends), target.take(survivors), self.model) - low[both]

    def _tighten(self, least: Array, fresh: NDArray[np.bool_]) -> None:
        """Lower what paths of either kind may cost, by those that were found (G, N)."""
        for kind in (0, 1):
            costs = np.concatenate([self.cheapest[kind], least[(fresh == kind) & np.isfinite(least)]])
            if len(costs) > self.width:
                costs = np.partition(costs, self.width)[: self.width + 1]
                self.most[kind] = min(self.most[kind], float(costs.max()))
            if len(costs):
                self.most[kind] = min(self.most[kind], float(costs.min()) + self.slack)
            self.cheapest[kind] = costs

    def found(self) -> Arrivals:
        """Return what was found."""
        came, went, cost = (np.concatenate(each) for each in zip(*self.parts, strict=True))
        return Arrivals(came, went, cost, self.dropped)


def _groups(states: States, floors: Floors) -> list[NDArray[np.intp]]:
    """Return the ends in each last survivor, the one with the lowest floor first."""
    order = np.argsort(states.group, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(states.group[order])) + 1)
    lowest = [float(floors.ends[group].min()) for group in groups]
    return [groups[k] for k in np.argsort(lowest, kind="stable").tolist()]


def _blocks(ends: NDArray[np.intp], size: int) -> list[tuple[int, int]]:
    """Cut what is grouped into blocks of whole groups, as near to a size as they allow."""
    blocks, start = [], 0
    for k in range(1, len(ends)):
        if k == len(ends) - 1 or ends[k + 1] - ends[start] > size:
            blocks.append((start, k))
            start = k
    return blocks


def _cheapest(
    total: Array,
    least: Array,
    begins: NDArray[np.intp],
    lengths: NDArray[np.intp],
    group: NDArray[np.intp],
    to: NDArray[np.intp],
) -> NDArray[np.intp]:
    """Return the first row of costs (S, N) in each group of rows that has the least cost in a column."""
    count = lengths[group]
    start = np.cumsum(count) - count
    rows = np.arange(int(count.sum())) + np.repeat(begins[group] - start, count)
    pair = np.repeat(np.arange(len(group)), count)
    found = np.flatnonzero(total[rows, to[pair]] == least[group, to][pair])
    _, first = np.unique(pair[found], return_index=True)
    return np.asarray(rows[found[first]])
