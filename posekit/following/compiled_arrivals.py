"""The cheapest ways from the ends of paths to survivors, by compiled loops: the same as `reference_arrivals` finds."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.compiled import path_kernels as kernels
from posekit.compiled.compiling import compiled
from posekit.following.beam import Beam
from posekit.following.channels import NextSurvivors
from posekit.following.floors import Arrivals, Floors
from posekit.following.motion_model import MotionModel
from posekit.following.states import States
from posekit.following.transitions import RESTING_NU
from posekit.geometry import Array

CHANNEL_ORDER: Final = np.array(
    [0, 3, 12, 13, 8, 9, 10, 11, 6, 7, 1, 2, 4, 5, 25, 26, 23, 24, 21, 22, 19, 20, 14, 15, 16, 17, 18]
)
"""Channels as they are asked: first those that most often tell that a survivor is too far off."""

CHANNEL_RANKS: Final = np.argsort(CHANNEL_ORDER)
"""Where each channel is in that order."""


def find(
    states: States,
    to: NextSurvivors,
    floors: Floors,
    *,
    model: MotionModel,
    beam: Beam,
    width: int,
) -> Arrivals:
    """Find the cheapest way from each last survivor to each new one: see `reference_arrivals.find`."""
    loops: Any = compiled(kernels)
    channels = to.channels
    order = np.lexsort((states.cost + floors.turns, states.group))
    group = states.group[order]
    first = np.flatnonzero(np.diff(group, prepend=group[0] - 1))
    floor = np.minimum.reduceat(floors.ends[order], first)
    ahead = np.argsort(floors.to, kind="stable")
    since = to.time - states.time
    since = np.where(np.isfinite(since), since, np.inf)
    give = [model.spread * np.sqrt(each.variance) for each in (states, channels)]
    ends = _laid(
        loops,
        order,
        CHANNEL_ORDER,
        states.position,
        channels.centre,
        since**-2.0,
        states.variance,
        model.reach(since),
        give[0],
    )
    known = channels.known.astype(np.float64)
    survivors = _laid(
        loops, ahead, CHANNEL_ORDER, channels.value, channels.centre, channels.variance, give[1], known
    )
    joints = np.flatnonzero(np.isfinite(np.asarray(model.acceleration)) & floors.moving)
    weight = floors.heading.weight / np.asarray(model.acceleration)[:, None] ** 2
    noise = weight * floors.heading.variance
    heading = _laid(loops, order, joints, floors.heading.place, channels.centre, weight, noise)
    cost = np.empty((2, width + 1))
    came, went = np.empty(cost.shape, np.int64), np.empty(cost.shape, np.int64)
    count, most = loops.arrive(
        np.append(first, len(order)),
        np.argsort(floor, kind="stable"),
        floor,
        states.fresh[order[first]],
        states.cost[order],
        floors.turns[order],
        floors.alike,
        ends,
        heading,
        survivors,
        to.cost[ahead],
        floors.to[ahead],
        floors.to_turns[ahead],
        to.fresh[ahead],
        CHANNEL_RANKS[joints],
        _narrowness(model.usual),
        _narrowness(model.at_rest),
        model.nu,
        RESTING_NU,
        float(beam.slack),
        cost,
        came,
        went,
    )
    kinds = [slice(None, n) for n in count.tolist()]
    return Arrivals(
        order[np.concatenate([came[k, some] for k, some in enumerate(kinds)])],
        ahead[np.concatenate([went[k, some] for k, some in enumerate(kinds)])],
        np.concatenate([cost[k, some] for k, some in enumerate(kinds)]),
        float(most.min()),
    )


def _narrowness(scale: Array) -> Array:
    """Return one over the squares of scales (27,), in the order in which channels are asked."""
    with np.errstate(divide="ignore"):
        return np.asarray(scale[CHANNEL_ORDER] ** -2.0)


def _laid(
    loops: Any,
    rows: NDArray[np.intp],
    channels: NDArray[np.intp],
    place: Array,
    centre: Array,
    *numbers: Array,
) -> Array:
    """Lay out vectors (27, S, 3) and numbers (27, S), row by row, channel by channel: (R, C, 3 + M)."""
    laid = np.empty((len(rows), len(channels), 3 + len(numbers)))
    loops.lay(rows, channels, np.ascontiguousarray(place), centre, np.stack(numbers), laid)
    return laid
