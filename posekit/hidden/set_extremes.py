"""Seeking how far a set of positions reaches, between and beyond its samples.

A box around samples alone is too small by up to their spacing. From the outermost samples random steps go further out,
each of which must pass all checks; steps grow after a success and shrink where none of those tried did.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from posekit.geometry import Array
from posekit.hidden.grouped_rows import largest
from posekit.hidden.lattices import GOLDEN_ANGLE
from posekit.hidden.limb_placements import LimbPlacements
from posekit.hidden.limb_placer import LimbPlacer
from posekit.hidden.posture_rows import Index, Mask

N_STEP_PROPOSALS = 6
"""Steps tried at once from each place, evenly around; and one more the way the last one went."""

N_WALK_STARTS, N_WALK_STARTS_FOUR_ANGLES = 4, 8
"""Places from which each end is sought, each far from those before it; with four free angles."""

START_SPACINGS, START_SPACINGS_FOUR_ANGLES = 1.6, 0.8
"""Spacings between them."""

STEP_GROWTH, STEP_SHRINKAGE = 1.3, 0.55
"""What a step is multiplied with after it succeeded, and after none did."""

MIN_STEP_RATIO = 0.004
"""Of the first step: where a walk ends."""

BOX_DIRECTIONS = np.concatenate([-np.eye(3), np.eye(3)])
"""Directions whose ends make the bounding box: lower, then upper."""

N_WALK_GOALS = len(BOX_DIRECTIONS) + 1
"""The ends of the box, and the distance from the representative."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SetExtremes:
    """How far n sets reach, and the placements that do.

    Parameters
    ----------
    reach : array (2, n, 7)
        For a limb's middle and end: less the lower, then the upper ends of the box, and the distance from the
        representative; -inf where a set is empty or was not asked about.
    group : int array (K,)
        The set of each placement.
    rows : LimbPlacements
        Those placements (K), the outermost that were found.
    """

    reach: Array
    group: Index
    rows: LimbPlacements


def reaches(placer: LimbPlacer, rows: LimbPlacements, group: Index, representatives: Array) -> Array:
    """Return how far each of S placements reaches towards every goal (2, 7, S); NaN without a representative."""
    table = np.empty((2, N_WALK_GOALS, len(group)))
    for joint, position in enumerate((rows.middle, rows.end)):
        table[joint, : len(BOX_DIRECTIONS)] = BOX_DIRECTIONS @ position.T
        table[joint, -1] = np.linalg.norm(position - representatives[joint, group], axis=1)
    return table


def seek_extremes(
    placer: LimbPlacer,
    group: Index,
    rows: LimbPlacements,
    representatives: Array,
    passes: Callable[[Index, LimbPlacements], Mask],
    wanted: Mask,
) -> SetExtremes:
    """Walk from the outermost samples of each set further out while all checks pass.

    Parameters
    ----------
    group : int array (S,)
        Which of n sets each feasible row belongs to, in order.
    rows : LimbPlacements
        The feasible samples (S) of the limb, from which the walks start.
    representatives : array (2, n, 3)
        Of the limb's middle and end: from which radii are measured; NaN where there is none.
    passes : callable
        Judges rows of sets by every check of the limb.
    wanted : bool array (2, n, 7)
        Which ends to seek.
    """
    n = wanted.shape[1]
    reach = np.full((2, n, N_WALK_GOALS), -np.inf)
    if not (len(group) and wanted.any()):
        return SetExtremes(reach=reach, group=group[:0], rows=rows.take(group[:0]))
    spacing = placer.spacing()[rows.trunk]
    levers = np.cumsum(placer.lengths)
    table = reaches(placer, rows, group, representatives)
    many, apart = N_WALK_STARTS, START_SPACINGS
    if placer.both_hidden:  # four angles are free: a set has more corners, and its samples are farther apart
        many, apart = N_WALK_STARTS_FOUR_ANGLES, START_SPACINGS_FOUR_ANGLES
    columns: list[tuple[Index, Index, Index]] = []
    mode = rows.branch @ np.array([2, 1])  # near and far are sets of their own
    for joint, goal in zip(*np.nonzero(wanted.any(axis=1)), strict=True):
        position = rows.end if joint else rows.middle
        for one in np.unique(mode):
            left = np.where((mode == one) & wanted[joint, group, goal], table[joint, goal], -np.inf)
            for _ in range(many if goal < len(BOX_DIRECTIONS) else 2):
                start, most = largest(group, n, left)
                some = np.flatnonzero((start >= 0) & np.isfinite(most))
                columns.append((some, start[some], np.full(len(some), joint * N_WALK_GOALS + goal)))
                near = np.linalg.norm(position - position[np.maximum(start, 0)][group], axis=1)
                left = np.where(near < apart * spacing * levers[joint], -np.inf, left)
    who, start, goal = (np.concatenate(column) for column in zip(*columns, strict=True))
    here = rows.take(start)
    best = table.reshape(2 * N_WALK_GOALS, -1)[goal, start]
    step, last = spacing[start].copy(), np.zeros((len(who), 4))
    for round_ in range(placer.sampling.rounds):
        walking = np.flatnonzero(step > MIN_STEP_RATIO * spacing[start])
        by = _around(len(walking), round_, both=placer.both_hidden)
        by = np.concatenate([by, last[walking, None]], axis=1)
        each = np.repeat(walking, by.shape[1])
        by = by.reshape(-1, 4)
        tried = placer.moved(here.take(each), by * step[each, None])
        value = _value(tried, goal[each], representatives, who[each])
        # The furthest first: where that passes the others need not be asked.
        order = np.flatnonzero(value > best[each])  # NaN is not
        first, _ = largest(each[order], len(who), value[order])
        ahead = order[first[first >= 0]]
        good = [ahead[passes(who[each[ahead]], tried.take(ahead))]]
        stuck = np.ones(len(who), dtype=bool)
        stuck[each[good[0]]] = False
        rest = np.setdiff1d(order[stuck[each[order]]], ahead)
        good.append(rest[passes(who[each[rest]], tried.take(rest))])
        passed = np.sort(np.concatenate(good))
        first, furthest = largest(each[passed], len(who), value[passed])
        moved = np.flatnonzero(first >= 0)
        chosen = passed[first[moved]]
        here = here.replaced(moved, tried.take(chosen))
        best[moved], last[moved] = furthest[moved], by[chosen]
        step[walking] *= STEP_SHRINKAGE
        step[moved] *= STEP_GROWTH / STEP_SHRINKAGE
    np.maximum.at(reach, (goal // N_WALK_GOALS, who, goal % N_WALK_GOALS), best)
    order = np.argsort(who, kind="stable")
    return SetExtremes(reach=reach, group=who[order], rows=here.take(order).with_seed(np.full(len(who), -1)))


def _around(n: int, round_: int, *, both: bool) -> Array:
    """Return unit steps (n, N_STEP_PROPOSALS, 4): evenly around, turned by the round; or scattered in 4-space."""
    if both:
        steps = np.random.default_rng(round_).standard_normal((N_STEP_PROPOSALS, 4))
        steps /= np.linalg.norm(steps, axis=-1, keepdims=True)
    else:
        turn = round_ * GOLDEN_ANGLE + np.arange(N_STEP_PROPOSALS) * 2.0 * np.pi / N_STEP_PROPOSALS
        steps = np.tile(np.stack([np.cos(turn), np.sin(turn)], axis=-1), 2)
    return np.broadcast_to(steps, (n, N_STEP_PROPOSALS, 4))


def _value(rows: LimbPlacements, goal: Index, representatives: Array, who: Index) -> Array:
    """Return how far rows have come towards their goals."""
    end = (goal >= N_WALK_GOALS).astype(np.intp)
    position = np.where(end[:, None] > 0, rows.end, rows.middle)
    axis = goal % N_WALK_GOALS
    along = np.einsum("si,si->s", position, BOX_DIRECTIONS[np.minimum(axis, len(BOX_DIRECTIONS) - 1)])
    away = np.linalg.norm(position - representatives[end, who], axis=1)
    return np.asarray(np.where(axis < len(BOX_DIRECTIONS), along, away))
