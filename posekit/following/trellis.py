"""All paths through the survivors of a sequence at once: the cheapest, and what the survivors of each frame share.

Every end of a path carries where the body is and how fast it moves, as far as its survivors say, and goes on to every
survivor of the next frame, or passes it over. While there are few, all paths are kept apart and the cheapest of all is
found. Of more, those that end in the same survivor go on as the cheapest of them moves: Viterbi's algorithm (Forney
1973, "The Viterbi algorithm", Proc. IEEE 61:268-278) with a filter for each survivor (Raheli, Polydoros & Tzou 1995,
"Per-survivor processing", IEEE Trans. Commun. 43:354-364). The sums over all paths give the probability of each
survivor, given all frames (Rabiner 1989, "A tutorial on hidden Markov models", Proc. IEEE 77:257-286, equations 18 to
27).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.following.beam import Beam
from posekit.following.channels import N_JOINTS
from posekit.following.kalman import MIN_DEVIATION_METRES, MovingJoints, density_of
from posekit.following.motion_model import MotionModel
from posekit.following.survivor_frame import SurvivorFrame
from posekit.following.transitions import absence, passing_cost, step_costs
from posekit.geometry import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Stage:
    """How the S ends of paths after a frame came about, from the P before it.

    Parameters
    ----------
    survivor : int32 array (S,)
        The survivor that each is at; -1 where it passed the frame over.
    parent : int32 array (S,)
        Which of the ends before is on the cheapest way to each.
    cost : float32 array (P, S)
        Of every step, with what the survivor costs itself; infinite where there is none.
    forward : array (S,)
        Log of the sum of the likelihoods of all paths to each, but for a constant.
    """

    survivor: NDArray[np.int32]
    parent: NDArray[np.int32]
    cost: NDArray[np.float32]
    forward: Array


class Trellis:
    """The frames so far.

    Parameters
    ----------
    model : MotionModel
        What steps cost.
    beam : Beam
        What is looked at.

    Attributes
    ----------
    stages : list of Stage
        Of the frames that are kept.
    cheapest : array (S,)
        What the cheapest path to each end costs.
    dropped : float
        The cheapest of the ways that were not followed, or merged with a cheaper one; infinite if there were none.
    """

    def __init__(self, model: MotionModel, beam: Beam) -> None:
        self.model, self.beam = model, beam
        self.stages: list[Stage] = []
        nothing = np.zeros((1, N_JOINTS, 3))
        self.ends = MovingJoints.measured(
            nothing, np.zeros((1, N_JOINTS, 3, 3)), np.zeros((1, N_JOINTS), dtype=np.bool_)
        )
        self.cheapest = np.zeros(1)
        self.forward = np.zeros(1)
        self.dropped = np.inf
        self._last = np.nan

    def push(self, frame: SurvivorFrame) -> None:
        """Go on by one frame."""
        to, chosen, own, left = self._survivors(frame)
        seconds = 1.0 if np.isnan(self._last) else frame.time - self._last
        self._last = frame.time
        count = len(self.ends)
        weight = self.model.weight if frame.deviation[chosen].any() else 1.0
        ways = step_costs(self.ends, to, seconds, self.model, weight=weight) + own
        passed = np.full((count, 1), self._passing(to, own, weight))
        total = self.cheapest[:, None] + np.concatenate([ways, passed], axis=1)
        near = total <= total.min() + self.beam.slack
        lost = float(total[~near].min(initial=np.inf))
        parent, target, into = self._kept(total, near)
        others = near.copy()
        others[parent, target] = False
        lost = min(lost, float(total[others].min(initial=np.inf)))
        self.dropped = min(self.dropped, left + float(self.cheapest.min()), lost)
        step = np.full((count, len(parent)), np.inf)
        rows, columns = np.nonzero(near)
        step[rows, into[rows, columns]] = (total - self.cheapest[:, None])[rows, columns]
        self.cheapest = total[parent, target]
        forward = _log_sum(self.forward[:, None] - step, axis=0)
        self.forward = forward - forward.max()
        led = self.ends.take(parent).after(seconds, density_of(self.model.acceleration))
        here = target < len(to)
        moved = led.take(np.flatnonzero(here))
        at = target[here]
        moved = moved.given(to.place[at], to.of_place[at], to.known[at])
        self.ends = MovingJoints.joined(moved, led.take(np.flatnonzero(~here)))
        self.stages.append(
            Stage(
                survivor=np.append(chosen, -1)[target].astype(np.int32),
                parent=parent.astype(np.int32),
                cost=step.astype(np.float32),
                forward=self.forward,
            )
        )

    def _kept(
        self, total: Array, near: NDArray[np.bool_]
    ) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
        """Choose the ways (S, N + 1) that become ends of their own.

        Returns
        -------
        parent, target : int array (E,)
            Of each end that is kept, those that pass over last.
        into : int array (S, N + 1)
            The end that each way becomes: of those to the same survivor that are not kept, the cheapest.
        """
        targets = total.shape[1]
        most = max(1, self.beam.width // targets) if near.sum() > self.beam.width else len(total)
        masked = np.where(near, total, np.inf)
        order = np.argsort(masked, axis=0, kind="stable")[:most]
        kept = np.isfinite(np.take_along_axis(masked, order, axis=0))
        place, target = np.nonzero(kept)
        by_target = np.lexsort((place, target))
        place, target = place[by_target], target[by_target]
        parent = order[place, target]
        into = np.full(total.shape, -1, dtype=np.intp)
        first = np.searchsorted(target, np.arange(targets))
        into[:] = np.minimum(first, len(target) - 1)[None]
        into[parent, target] = np.arange(len(parent))
        return parent, target, into

    def _passing(self, to: MovingJoints, own: Array, weight: float) -> float:
        """Return what it costs to pass a frame over: as noisy as its likeliest survivor is."""
        if not len(to):
            return self.model.skip
        one = int(np.argmin(own))
        return passing_cost(to.of_place[one], to.known[one], self.model, weight=weight)

    def _survivors(self, frame: SurvivorFrame) -> tuple[MovingJoints, NDArray[np.intp], Array, float]:
        """Return the survivors that are looked at: as ends, which they are, what they cost, and the cheapest other."""
        known = np.asarray(np.isfinite(frame.joints).all(axis=2))
        own = self.model.ranking * frame.cost + absence(known)
        chosen, left = self.beam.likeliest(np.where(known.any(axis=1), own, np.inf))
        seen = known[chosen]
        ends = MovingJoints.measured(
            np.where(seen[..., None], frame.joints[chosen], 0.0),
            frame.covariance[chosen] + MIN_DEVIATION_METRES**2 * np.eye(3),
            seen,
        )
        return ends, chosen, own[chosen], left

    def forget(self) -> None:
        """Leave out the oldest frame: what came of it is kept."""
        self.stages.pop(0)

    def path(self) -> tuple[float, NDArray[np.intp]]:
        """Return the cheapest path: what it costs, and the survivors, -1 for frames passed over."""
        end = int(np.argmin(self.cheapest))
        cost = float(self.cheapest[end])
        path = np.empty(len(self.stages), dtype=np.intp)
        for k in range(len(self.stages) - 1, -1, -1):
            path[k] = self.stages[k].survivor[end]
            end = int(self.stages[k].parent[end])
        return cost, path

    def marginals(self, at: int = -1, among: NDArray[np.bool_] | None = None) -> list[Array]:
        """Return the probability of every end (S,) of each frame, given all frames.

        Parameters
        ----------
        at : int
            A frame.
        among : bool array (S,), optional
            The ends that paths may go through there; all if not given.
        """
        stages, found = self.stages, list[Array]()
        forward = [stage.forward for stage in stages]
        if among is not None:
            forward = [*forward[:at], np.where(among, forward[at], -np.inf)]
            for stage in stages[at + 1 :]:
                after = _log_sum(forward[-1][:, None] - stage.cost, axis=0)
                forward.append(after - after.max())
        backward = np.zeros(len(forward[-1]))
        for k in range(len(stages) - 1, -1, -1):
            both = forward[k] + backward
            share = np.exp(both - both.max())
            found.append(share / share.sum())
            if among is not None and k == at:
                backward = np.where(among, backward, -np.inf)
            backward = _log_sum(backward - stages[k].cost, axis=1)
            backward -= backward.max()
        return found[::-1]


def _log_sum(values: Array, axis: int) -> Array:
    """Return the logarithm of a sum of exponentials."""
    most = np.asarray(values.max(axis=axis, keepdims=True))
    most = np.where(np.isfinite(most), most, 0.0)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(np.exp(values - most).sum(axis=axis)) + most.squeeze(axis))
