"""Seeking the ends of a set between its samples."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from posekit.cameras import Array
from posekit.occlusion.asking import Index, Mask
from posekit.occlusion.groups import largest
from posekit.occlusion.limb import LimbPlacer
from posekit.occlusion.placed import Placed

PROPOSALS = 6
"""Steps tried at once from each end."""

SHRINK = 0.7
"""Each round's step as a part of the last."""

AXES = np.concatenate([-np.eye(3), np.eye(3)])
"""Directions whose ends make the bounding box: lower, then upper."""


def proposals(rounds: int, *, both: bool) -> Array:
    """Return unit steps (rounds, PROPOSALS, 4): evenly around, turned from round to round; or in 4-space."""
    if both:
        steps = np.random.default_rng(0).standard_normal((rounds, PROPOSALS, 4))
        return np.asarray(steps / np.linalg.norm(steps, axis=-1, keepdims=True))
    turn = np.arange(rounds)[:, None] * 2.399963 + np.arange(PROPOSALS) * 2.0 * np.pi / PROPOSALS
    return np.tile(np.stack([np.cos(turn), np.sin(turn)], axis=-1), 2)


def seek_ends(
    placer: LimbPlacer,
    survivor: Index,
    rows: Placed,
    n: int,
    joint: int,
    representative: Array,
    passes: Callable[[Index, Placed], Mask],
    spacing: Array,
) -> tuple[Array, Array, Array]:
    """Walk from the outermost samples of each set further out while all checks pass.

    Parameters
    ----------
    survivor : int array (S,)
        Whose set each feasible row belongs to, in order.
    rows : Placed
    joint : int
        0 for the limb's middle, 1 for its end.
    representative : array (n, 3)
        From which the radius is measured; NaN where there is none.
    passes : callable
        Judges rows of survivors by every check of the limb.
    spacing : array (S,)
        Radians between the samples of each row's host: the first step.

    Returns
    -------
    lower, upper : array (n, 3)
        The box; NaN where a set is empty.
    radius : array (n,)
    """
    position = rows.end if joint else rows.middle
    apart = np.linalg.norm(position - representative[survivor], axis=1)
    values = [position @ axis for axis in AXES] + [np.where(np.isnan(apart), -np.inf, apart)]
    start, most = (
        np.stack(table, axis=1) for table in zip(*(largest(survivor, n, v) for v in values), strict=True)
    )
    who, goal = np.nonzero(start >= 0)
    here, best = rows.take(start[who, goal]), most[who, goal]
    step = spacing[start[who, goal]]
    rounds = placer.sampling.rounds
    steps = proposals(rounds, both=placer.both_hidden)
    for round_ in range(rounds):
        each = np.repeat(np.arange(len(who)), PROPOSALS)
        by = np.tile(steps[round_], (len(who), 1)) * (step[each] * SHRINK**round_)[:, None]
        tried = placer.moved(here.take(each), by)
        reached = _value(tried.end if joint else tried.middle, goal[each], representative[who[each]])
        further = np.flatnonzero(reached > best[each])  # NaN is not
        further = further[passes(who[each[further]], tried.take(further))]
        row, value = largest(each[further], len(who), reached[further])
        moved = np.flatnonzero(row >= 0)
        chosen = further[row[moved]]
        here = _replaced(here, moved, tried.take(chosen))
        best[moved] = value[moved]
    ends = np.full((n, len(AXES) + 1), np.nan)
    ends[who, goal] = best
    return -ends[:, :3], ends[:, 3:6], ends[:, 6]


def _value(position: Array, goal: Index, representative: Array) -> Array:
    along = np.einsum("si,si->s", position, AXES[np.minimum(goal, len(AXES) - 1)])
    apart = np.linalg.norm(position - representative, axis=1)
    return np.asarray(np.where(goal < len(AXES), along, apart))


def _replaced(rows: Placed, where: Index, by: Placed) -> Placed:
    merged = {}
    for name in ("host", "middle", "end", "branch", "excess", "seed"):
        values = getattr(rows, name).copy()
        values[where] = getattr(by, name)
        merged[name] = values
    return Placed(**merged)
