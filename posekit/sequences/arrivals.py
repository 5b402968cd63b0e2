"""The cheapest ways from the ends of paths to the survivors of a frame: what one stage of Viterbi's algorithm keeps."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.sequences.beam import Beam
from posekit.sequences.channels import N_CHANNELS
from posekit.sequences.motion_model import MotionModel
from posekit.sequences.states import States
from posekit.sequences.transitions import Target, step_costs, turn_costs

BLOCK: Final = 1 << 21
"""Numbers of one matrix held at once: 16 MB."""

PROBES: Final = 8
"""Ends of paths whose turns are charged first: the cheapest of them bounds what is worth looking at."""


class Arrivals(NamedTuple):
    """Paths that go on to a survivor, one for each pair of a last survivor and a new one.

    Attributes
    ----------
    came : int array (A,)
        The end that each continues.
    went : int array (A,)
        The new survivor.
    cost : array (A,)
    dropped : float
        The cheapest of those that were left out; infinite if none were.
    """

    came: NDArray[np.intp]
    went: NDArray[np.intp]
    cost: Array
    dropped: float


def arrivals(
    states: States, target: Target, own: Array, new: NDArray[np.bool_], *, model: MotionModel, beam: Beam
) -> Arrivals:
    """Find the cheapest way from each last survivor to each new one.

    Parameters
    ----------
    states : States
    target : Target
        N survivors.
    own : array (N,)
        What each costs itself.
    new : bool array (N,)
        Those that make a path fresh.
    model : MotionModel
    beam : Beam
        What of it is kept.
    """
    order = np.argsort(states.group, kind="stable")
    last = states.group[order]
    first = np.flatnonzero(np.diff(last, prepend=last[0] - 1))
    alike = _alike(states)
    moving = bool(np.isfinite(states.interval).any())
    bounds = np.full(2, np.inf)  # of paths that are not fresh, and of those that are
    came, went, cost, dropped = [], [], [], np.inf
    for start, end in _blocks(np.append(first, len(order)), max(1, BLOCK // (N_CHANNELS * len(own)))):
        part = states.take(order[start:end])
        begins = first[(first >= start) & (first < end)] - start
        lengths = np.diff(np.append(begins, len(part)))
        if alike:
            total = np.repeat(step_costs(part.take(begins), target, model), lengths, axis=0)
        else:
            total = step_costs(part, target, model)
        total += part.cost[:, None] + own
        if moving:
            _add_turns(total, part, target, new, bounds, model=model, slack=beam.slack)
        least = np.minimum.reduceat(total, begins, axis=0)
        fresh = part.fresh[begins][:, None] | new
        for kind in (0, 1):
            bounds[kind] = min(bounds[kind], least[fresh == kind].min(initial=np.inf) + beam.slack)
        group, to = np.nonzero(np.isfinite(least))
        kept, lost = beam.keep(least[group, to], fresh[group, to], least=0 if moving else len(own))
        dropped = min(dropped, lost)
        group, to = group[kept], to[kept]
        came.append(order[start:end][_cheapest(total, least, begins, lengths, group, to)])
        went.append(to)
        cost.append(least[group, to])
    return Arrivals(np.concatenate(came), np.concatenate(went), np.concatenate(cost), dropped)


def _alike(states: States) -> bool:
    """Tell whether all states in one last survivor make the same steps to come: whether it knew all that they know."""
    latest = np.fmax.reduce(states.time, axis=0)
    never = np.isnan(states.time).all(axis=1, keepdims=True)
    return bool(((states.time == latest) | never | np.isnan(latest)).all())


def _blocks(ends: NDArray[np.intp], size: int) -> list[tuple[int, int]]:
    """Cut what is grouped into blocks of whole groups, as near to a size as they allow."""
    blocks, start = [], 0
    for k in range(1, len(ends)):
        if k == len(ends) - 1 or ends[k + 1] - start > size:
            blocks.append((start, int(ends[k])))
            start = int(ends[k])
    return blocks


def _add_turns(
    total: Array,
    part: States,
    target: Target,
    new: NDArray[np.bool_],
    bounds: Array,
    *,
    model: MotionModel,
    slack: float,
) -> None:
    """Add to costs (S, N) those of turns, wherever a path can come out within the slack; elsewhere they stay too low.

    `bounds` are what a path may cost at most, of either kind: they are lowered by the turns of the cheapest ends.
    """
    fresh = part.fresh[:, None] | new
    for kind in np.unique(fresh).astype(int).tolist():
        lowest = np.where(fresh == kind, total, np.inf).min(axis=1)
        probes = np.argsort(lowest)[:PROBES]
        probed = total[probes] + turn_costs(part.take(probes), target, model)
        bounds[kind] = min(bounds[kind], probed[fresh[probes] == kind].min(initial=np.inf) + slack)
    close = total <= bounds[fresh.astype(int)]
    ends, survivors = np.flatnonzero(close.any(axis=1)), np.flatnonzero(close.any(axis=0))
    if len(ends):
        total[np.ix_(ends, survivors)] += turn_costs(part.take(ends), target.take(survivors), model)


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
