"""The search for the cheapest path: every end of a path goes to every survivor of the next frame, or passes it over.

Viterbi's algorithm on pairs of survivors: of the paths that end in the same two survivors only the cheapest can be part
of the best, since what follows depends on no more than these (Forney 1973, "The Viterbi algorithm", Proc. IEEE
61:268-278). Where a joint is unknown in some frames, its velocity is that of its last two known places, which the
cheaper path carries on: then the best path may be missed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.following.arrivals import arrivals
from posekit.following.beam import Beam
from posekit.following.channels import N_JOINTS, Channels, NextSurvivors, channels_of
from posekit.following.motion_model import MotionModel
from posekit.following.states import States
from posekit.following.survivor_frame import SurvivorFrame
from posekit.geometry import Array

MISSING_JOINT_COST: Final = 5.0
"""Cost of each joint that a survivor does not know and another of its frame does.

Without it a survivor would be the cheaper the less of it is known, since unknown joints make no steps.
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class PathStep:
    """How the ends of paths after a frame came about.

    Parameters
    ----------
    parent : int array (S,)
        Which end each continues.
    survivor : int array (S,)
        The survivor that it went to; -1 where it passed the frame over.
    dropped : float
        The cheapest of the ends that were not followed; infinite if all were.
    """

    parent: NDArray[np.intp]
    survivor: NDArray[np.intp]
    dropped: float


def advance(
    states: States,
    frame: SurvivorFrame,
    model: MotionModel,
    beam: Beam,
    *,
    fresh: NDArray[np.bool_] | None = None,
) -> tuple[States, PathStep]:
    """Go on by one frame.

    Parameters
    ----------
    states : States
        The ends of the paths so far.
    frame : SurvivorFrame
        The next frame, with N survivors.
    model : MotionModel
        How bodies move: what steps and turns cost.
    beam : Beam
        Which paths are followed.
    fresh : bool array (N,), optional
        Survivors that make a path fresh.
    """
    skipped = states.cost + model.skip
    channels = channels_of(frame.joints, frame.deviation)
    own = model.ranking * frame.cost + _absence(channels)
    usable, dropped = beam.cheapest(np.where(channels.known.any(axis=0), own, np.inf))
    dropped += float(states.cost.min())
    if not len(usable):
        # No survivor can be taken: every path passes the frame over.
        least = 0 if np.isfinite(states.interval).any() else len(frame) + 1
        rows, lost = beam.keep(skipped, states.fresh, least=least)
        passed = replace(states, cost=skipped).take(rows)
        return passed, PathStep(parent=rows, survivor=np.full(len(rows), -1), dropped=min(dropped, lost))
    if len(usable) < len(frame):
        channels = channels.take(usable)
    new = np.zeros(len(usable), dtype=np.bool_) if fresh is None else fresh[usable]
    to = NextSurvivors(channels=channels, time=frame.time, cost=own[usable], fresh=new)
    came, went, cost, left_out = arrivals(states, to, model=model, beam=beam)
    # Paths without a velocity cost next to nothing: until some path has one, all survivors are followed. From then on
    # the beam is no wider than it is said to be.
    seen = np.isfinite(states.time[:N_JOINTS]).any(axis=1) & channels.known[:N_JOINTS].any(axis=1)
    still = not (np.isfinite(states.interval).any() or (len(came) and seen.any()))
    rows, lost = beam.keep(
        np.concatenate([cost, skipped]),
        np.concatenate([states.fresh[came] | new[went], states.fresh]),
        least=len(frame) + 1 if still else 0,
    )
    moved, stayed = rows[rows < len(cost)], rows[rows >= len(cost)] - len(cost)
    came, went = came[moved], went[moved]
    after = _move(states.take(came), channels.take(went), cost[moved], frame.time, new[went])
    # Paths that end in the same survivor make the same steps from there on; fresh ones are kept apart.
    after = replace(after, group=states.group.max() + 1 + 2 * went + after.fresh)
    if len(stayed):
        after = States.join(after, replace(states, cost=skipped).take(stayed))
    return after, PathStep(
        parent=np.concatenate([came, stayed]),
        survivor=np.concatenate([usable[went], np.full(len(stayed), -1)]),
        dropped=min(dropped, left_out, lost),
    )


def trace(steps: Sequence[PathStep], end: int) -> NDArray[np.intp]:
    """Return the survivors of the path that ends in a state, the first frame's first; -1 for frames passed over."""
    path = np.empty(len(steps), dtype=np.intp)
    for k in range(len(steps) - 1, -1, -1):
        path[k] = steps[k].survivor[end]
        end = int(steps[k].parent[end])
    return path


def _absence(channels: Channels) -> Array:
    """Charge survivors (N,) for what others of their frame know."""
    known = channels.known
    return np.asarray(MISSING_JOINT_COST * (known.any(axis=1, keepdims=True) & ~known).sum(axis=0))


def _move(old: States, to: Channels, cost: Array, time: float, new: NDArray[np.bool_]) -> States:
    """Return the states after steps to survivors: what these do not know is carried on."""
    joints = slice(N_JOINTS)
    since = time - old.time[joints]
    had = np.isfinite(since)
    velocity = np.where(had, 1.0 / np.where(had, since, 1.0), 0.0)[..., None] * (
        to.value[joints] - old.position[joints]
    )
    if to.known.all():
        position, at, variance = to.value, np.full(to.known.shape, time), to.variance
        interval, earlier = since, old.variance[joints]
    else:
        three, known = to.known[..., None], to.known[joints]
        position = np.where(three, to.value, old.position)
        at = np.where(to.known, time, old.time)
        variance = np.where(to.known, to.variance, old.variance)
        velocity = np.where(three[joints], velocity, old.velocity)
        interval = np.where(known, since, old.interval)
        earlier = np.where(known, old.variance[joints], old.earlier_variance)
    return States(
        cost=cost,
        group=old.group,
        fresh=old.fresh | new,
        position=position,
        time=at,
        variance=variance,
        velocity=velocity,
        interval=interval,
        earlier_variance=earlier,
    )
