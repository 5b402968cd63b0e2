"""Postures to configurations: the model with the postures' lengths, inverse kinematics with limits and without."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.robots.descent import MAX_STEPS, KinematicProblem, descend
from posekit.robots.ik import REFERENCE_PULL, InverseKinematics
from posekit.robots.kinematics import Kinematics
from posekit.validators.robot.branches import Branches
from posekit.validators.robot.flips import Flip, find_flips
from posekit.validators.robot.joint_range import beyond_limits
from posekit.validators.robot.subject import CENTIMETRES_A_DEGREE, Subject

EXACT_METRES = 1e-4
"""Metres: a fit this close is the posture, and limits that cost no more than this are not the reason for a misfit."""

STRICT_METRES = 1e-3
"""Metres: the closest that the first search is asked to come."""

LESS_DEGREES = 0.01
"""Degrees by which another way to bend must be less outside the limits to be preferred."""

SHAKEN_STARTS = 12
"""Starts around the best fit so far, in each round."""

FEW_STEPS = 25
"""Steps of the search from such a start: what comes near goes on from there in the next round."""

ROUND_DEVIATIONS = (0.5, 1.0, 0.5, 1.0)
"""Standard deviation of the joints of such starts, radians or metres, round by round."""

Bools = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """Configurations that come near postures.

    Parameters
    ----------
    q : array (N, nq)
        Inside the limits.
    residual : array (N, P)
        Distances of its points from the posture's, metres; NaN where the posture's are unknown.
    free_q, free_residual : array (N, nq), (N, P)
        The same without limits, of all branches the one that is least outside them.
    kept_off : array (N,)
        Metres by which the limits keep some point farther off; 0 where that is not more than `EXACT_METRES`.
    """

    q: Array
    residual: Array
    free_q: Array
    free_residual: Array
    kept_off: Array

    @property
    def suffers(self) -> Bools:
        """Whether the limits keep some point farther off (N,)."""
        return np.asarray(self.kept_off > 0)

    @property
    def judged_q(self) -> Array:
        """The configuration that stands for the posture: the free one where the limits keep the other off."""
        return np.where(self.suffers[:, None], self.free_q, self.q)

    @property
    def judged_residual(self) -> Array:
        """Its distances from the posture's points."""
        return np.where(self.suffers[:, None], self.free_residual, self.residual)


@dataclass(frozen=True, kw_only=True, eq=False)
class Fitter:
    """Fits one model, inside one set of limits.

    Parameters
    ----------
    kinematics : Kinematics
        The model with the postures' lengths, and its points.
    subject : Subject
        Its limits.
    tolerance : float
        Metres: a fit inside the limits that is as close is not searched for anew, unless it suffers from them.
    """

    kinematics: Kinematics
    subject: Subject
    tolerance: float

    def fit(self, targets: Array, sequence: NDArray[np.intp] | None = None) -> Fit:
        """Fit postures.

        A free fit starts from the limited one. Where it comes closer, it is turned into the branch that is least
        outside the limits, and the limited search starts again: from there, then from places around the best fit,
        round after round. Only what is left after that is said to suffer from the limits.

        Parameters
        ----------
        targets : array (N, P, 3)
            Metres; NaN is unknown.
        sequence : int array (N,), optional
            Which sequence in time a posture belongs to: then each starts from the one before.
        """
        first = (
            self._solver.solve(targets)
            if sequence is None
            else self._solver.solve_sequence(targets, sequence=sequence)
        )
        q, free_q = first.q.copy(), first.q.copy()
        rows = np.flatnonzero(_worst(self._residual(q, targets)) > EXACT_METRES)
        rows = self._refit_free(targets, q, free_q, rows)
        for start in range(-1, len(ROUND_DEVIATIONS)):
            if not rows.size:
                break
            few = targets[rows]
            other = self._inside(few, free_q[rows]) if start < 0 else self._from_around(few, q[rows], start)
            better = self._cost(other, few) < self._cost(q[rows], few)
            q[rows[better]] = other[better]
            rows = rows[self._gain(targets, q, free_q, rows) > EXACT_METRES]
        rows = self._refit_free(targets, q, free_q, rows)
        kept_off = np.zeros(len(q))
        kept_off[rows] = self._gain(targets, q, free_q, rows)
        return Fit(
            q=q,
            residual=self._residual(q, targets),
            free_q=free_q,
            free_residual=self._residual(free_q, targets),
            kept_off=kept_off,
        )

    def seen(self, targets: Array) -> Bools:
        """Tell which limited joints move a known point (N, K): the others are not determined by the posture."""
        known = np.isfinite(targets).all(axis=2)
        moves = self.kinematics.moved_by[:, self.subject.velocity_index]
        return np.asarray((known.astype(np.intp) @ moves.astype(np.intp)) > 0)

    @cached_property
    def flips(self) -> tuple[Flip, ...]:
        """The limbs that can be bent in two ways."""
        return find_flips(self.kinematics)

    @cached_property
    def branches(self) -> Branches:
        """The model's other configurations for the same placement."""
        return Branches(subject=self.subject)

    @cached_property
    def _solver(self) -> InverseKinematics:
        return InverseKinematics(
            kinematics=self.kinematics,
            lower=self.subject.lower,
            upper=self.subject.upper,
            tolerance=max(self.tolerance, STRICT_METRES),
        )

    def _refit_free(
        self, targets: Array, q: Array, free_q: Array, rows: NDArray[np.intp]
    ) -> NDArray[np.intp]:
        """Fit some rows without limits, in place; return those that come closer so than inside the limits."""
        if not rows.size:
            return rows
        free_q[rows] = self._without_limits(targets[rows], q[rows])
        rows = rows[self._gain(targets, q, free_q, rows) > EXACT_METRES]
        self._bend_otherwise(targets, free_q, rows)
        return rows

    def _gain(self, targets: Array, q: Array, free_q: Array, rows: NDArray[np.intp]) -> Array:
        """Return by how much, at most, a point of a limited fit is farther off than the free fit's (R,), metres."""
        few = targets[rows]
        return _worst(self._residual(q[rows], few) - self._residual(free_q[rows], few))

    def _bend_otherwise(self, targets: Array, free_q: Array, rows: NDArray[np.intp]) -> None:
        """Take over, in place, free fits with a limb bent the other way: as near, and less outside the limits."""
        for flip in self.flips:
            if not rows.size:
                return
            few = targets[rows]
            other = self._without_limits(few, flip.apply(free_q[rows]))
            worse = _worst(self._residual(other, few) - self._residual(free_q[rows], few)) > EXACT_METRES
            better = ~worse & (self._outside(other) < self._outside(free_q[rows]) - LESS_DEGREES)
            free_q[rows[better]] = other[better]

    def _without_limits(self, targets: Array, start: Array) -> Array:
        """Descend without limits, to the branch that is least outside them."""
        unlimited = np.full(self.kinematics.space.nq, np.inf)
        problem = self._problem(targets, start, -unlimited, unlimited)
        return self.branches.nearest_to_limits(descend(self.kinematics, problem, start).q)

    def _outside(self, q: Array) -> Array:
        """Return by how much the joint that is farthest outside its limits is (N,), degrees; sliding ones as such."""
        each = np.where(self.subject.slides, CENTIMETRES_A_DEGREE, 1.0)
        return np.asarray((beyond_limits(self.subject, q) / each).max(axis=1, initial=0.0))

    def _from_around(self, targets: Array, q: Array, start: int) -> Array:
        """Start from places around the best fit: the same steps from each posture, whatever else is in the batch."""
        at = self.kinematics.space.bounded_q
        steps = np.random.default_rng(start).normal(0.0, ROUND_DEVIATIONS[start], (SHAKEN_STARTS, len(at)))
        starts, goals = np.repeat(q, SHAKEN_STARTS, axis=0), np.repeat(targets, SHAKEN_STARTS, axis=0)
        starts[:, at] += np.tile(steps, (len(q), 1))
        found = self._inside(goals, starts, FEW_STEPS)
        best = np.argmin(self._cost(found, goals).reshape(len(q), SHAKEN_STARTS), axis=1)
        return np.asarray(found.reshape(len(q), SHAKEN_STARTS, -1)[np.arange(len(q)), best])

    def _inside(self, targets: Array, start: Array, steps: int = MAX_STEPS) -> Array:
        """Descend inside the limits."""
        space = self.kinematics.space
        lower, upper = np.full(space.nq, -np.inf), np.full(space.nq, np.inf)
        lower[space.bounded_q] = self.subject.lower[space.bounded_q]
        upper[space.bounded_q] = self.subject.upper[space.bounded_q]
        start = np.clip(start, lower, upper)
        return descend(self.kinematics, self._problem(targets, start, lower, upper), start, steps).q

    def _problem(self, targets: Array, reference: Array, lower: Array, upper: Array) -> KinematicProblem:
        return KinematicProblem(
            targets=targets,
            weights=np.ones(targets.shape[:2]),
            lower=lower,
            upper=upper,
            reference=reference,
            pull=REFERENCE_PULL,
        )

    def _residual(self, q: Array, targets: Array) -> Array:
        return np.asarray(np.linalg.norm(self.kinematics.positions(q) - targets, axis=2))

    def _cost(self, q: Array, targets: Array) -> Array:
        return np.asarray(np.nansum(self._residual(q, targets) ** 2, axis=1))


def _worst(distances: Array) -> Array:
    """Return the largest known distance of each posture (N,); 0 where none is known."""
    return np.asarray(np.where(np.isfinite(distances), distances, 0.0).max(axis=1, initial=0.0))
