"""Seeking the ends of a set between its samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from posekit.cameras import Array
from posekit.occlusion.asking import Index, Mask
from posekit.occlusion.groups import largest
from posekit.occlusion.lattices import GOLDEN_ANGLE
from posekit.occlusion.limb import LimbPlacer
from posekit.occlusion.placed import Placed

PROPOSALS = 6
"""Steps tried at once from each place, evenly around; and one more the way the last one went."""

STARTS = 3
"""Places from which each end is sought, each far from those before it."""

APART = 2.5
"""Spacings between them."""

LONGER, SHORTER = 1.3, 0.55
"""What a step is multiplied with after it succeeded, and after none did."""

AXES = np.concatenate([-np.eye(3), np.eye(3)])
"""Directions whose ends make the bounding box: lower, then upper."""


def seek_ends(
    placer: LimbPlacer,
    survivor: Index,
    rows: Placed,
    n: int,
    representatives: Sequence[Array],
    passes: Callable[[Index, Placed], Mask],
    spacing: Array,
) -> Array:
    """Walk from the outermost samples of each set further out while all checks pass.

    Parameters
    ----------
    survivor : int array (S,)
        Whose set each feasible row belongs to, in order.
    rows : Placed
    representatives : sequence of 2 arrays (n, 3)
        Of the limb's middle and end: from which radii are measured; NaN where there is none.
    passes : callable
        Judges rows of survivors by every check of the limb.
    spacing : array (S,)
        Radians between the samples of each row's host: the first step.

    Returns
    -------
    array (2, n, 7)
        For middle and end: less the lower, then the upper ends of the box, and the radius; -inf where a set is empty.
    """
    goals = len(AXES) + 1
    joints = [k for k, joint in enumerate(placer.limb.free) if joint in placer.plan.free(placer.limb)]
    ends = np.full((2, n, goals), -np.inf)
    starts: list[tuple[Index, Index, Index]] = []
    levers = np.cumsum(placer.lengths)
    for joint in joints:
        position = rows.end if joint else rows.middle
        away = np.linalg.norm(position - representatives[joint][survivor], axis=1)
        values = [position @ axis for axis in AXES] + [np.where(np.isnan(away), -np.inf, away)]
        for k, value in enumerate(values):
            left = value
            for _ in range(STARTS):
                start, most = largest(survivor, n, left)
                some = np.flatnonzero((start >= 0) & np.isfinite(most))
                starts.append((some, start[some], np.full(len(some), joint * goals + k)))
                first = position[np.maximum(start, 0)][survivor]
                near = np.linalg.norm(position - first, axis=1) < APART * spacing * levers[joint]
                left = np.where(near, -np.inf, left)
    who, start, goal = (np.concatenate(column) for column in zip(*starts, strict=True))
    here, step = rows.take(start), spacing[start].copy()
    best = _value(here, goal, representatives, who)
    last = np.zeros((len(who), 4))
    for round_ in range(placer.sampling.rounds):
        by = np.concatenate([_around(len(who), round_, both=placer.both_hidden), last[:, None]], axis=1)
        each = np.repeat(np.arange(len(who)), by.shape[1])
        tried = placer.moved(here.take(each), by.reshape(-1, 4) * step[each, None])
        reached = _value(tried, goal[each], representatives, who[each])
        further = np.flatnonzero(reached > best[each])  # NaN is not
        further = further[passes(who[each[further]], tried.take(further))]
        row, value = largest(each[further], len(who), reached[further])
        moved = row >= 0
        chosen = further[row[moved]]
        here = here.replaced(np.flatnonzero(moved), tried.take(chosen))
        best[moved] = value[moved]
        last[moved] = by.reshape(-1, 4)[chosen]
        step *= np.where(moved, LONGER, SHORTER)
    np.maximum.at(ends, (goal // goals, who, goal % goals), best)
    return ends


def _around(n: int, round_: int, *, both: bool) -> Array:
    """Return unit steps (n, PROPOSALS, 4): evenly around, turned from round to round; or scattered in 4-space."""
    if both:
        steps = np.random.default_rng(round_).standard_normal((n, PROPOSALS, 4))
        return np.asarray(steps / np.linalg.norm(steps, axis=-1, keepdims=True))
    turn = round_ * GOLDEN_ANGLE + np.arange(PROPOSALS) * 2.0 * np.pi / PROPOSALS
    steps = np.tile(np.stack([np.cos(turn), np.sin(turn)], axis=-1), 2)
    return np.broadcast_to(steps, (n, PROPOSALS, 4))


def _value(rows: Placed, goal: Index, representatives: Sequence[Array], who: Index) -> Array:
    """Return how far rows have come towards their goals: along an axis, or away from the representative."""
    goals = len(AXES) + 1
    end = (goal >= goals)[:, None]
    position = np.where(end, rows.end, rows.middle)
    middle = np.where(end, representatives[1][who], representatives[0][who])
    axis = goal % goals
    along = np.einsum("si,si->s", position, AXES[np.minimum(axis, len(AXES) - 1)])
    return np.asarray(np.where(axis < len(AXES), along, np.linalg.norm(position - middle, axis=1)))
