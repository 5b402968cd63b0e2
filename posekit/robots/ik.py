"""Inverse kinematics with limits: points of any model to configurations, for a batch of postures."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.robots.descent import KinematicProblem
from posekit.robots.kinematics import Kinematics
from posekit.robots.search import KinematicSearchResult, PostureSearch, unlimited
from posekit.robots.start_tables import make_tables
from posekit.robots.starts import SearchStarts

IK_TOLERANCE_METRES = 1e-3
"""Metres: a posture is met when none of its known points is farther off."""

RESTART_METRES = 1e-3
"""Metres: where a point is farther off, other starts are tried."""

REFERENCE_PULL = 1e-10
"""m^2/rad^2: strong enough to choose among postures that place the points alike, too weak to move a point."""

JUMP_RATIO = 2.0
"""Times the largest distance (or the precision) of the last search beyond which a frame is searched for anew."""

MAX_TARGET_METRES = 1e6
"""Metres beyond which a target is taken for a mistake."""

MIN_TOTAL_WEIGHT = 1e-300
"""Keeps weights that are all zero from being divided by zero."""

AT_LIMIT = 1e-9
"""Radians or metres within which a joint stands at its limit."""


class Reach(IntEnum):
    """Why a posture is met, or is not.

    Attributes
    ----------
    MET
        Every known point is within the tolerance, inside the limits.
    LIMITS
        Not found inside the limits, as far as the starts tell; without limits it is met.
    LENGTHS
        Not found even without limits: the model has other lengths, or other joints.
    """

    MET = 0
    LIMITS = 1
    LENGTHS = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """Configurations and how well they place the points.

    Parameters
    ----------
    q : array (N, nq)
        Inside the limits, exactly.
    residual : array (N, P)
        Distance of each point from its target, metres; NaN where the target is unknown.
    iterations : int array (N,)
        Steps of all joints together, all starts counted.
    converged : bool array (N,)
        Whether the search ended at a minimum, not for want of steps.
    at_limit : bool array (N, nq)
        Joints that stand at a limit.
    reach : int array (N,)
        A `Reach` each.
    unlimited_q : array (N, nq)
        Where `reach` is not MET, the best configuration near q without limits: where it is outside them says which
        joints are the reason. Elsewhere q.
    unlimited_residual : array (N, P)
        Its residual, metres.
    """

    q: Array
    residual: Array
    iterations: NDArray[np.intp]
    converged: NDArray[np.bool_]
    at_limit: NDArray[np.bool_]
    reach: NDArray[np.intp]
    unlimited_q: Array
    unlimited_residual: Array

    def __post_init__(self) -> None:
        for value in vars(self).values():
            value.flags.writeable = False


@dataclass(frozen=True, kw_only=True, eq=False)
class InverseKinematics:
    """Inverse kinematics of one model; its tables of starts are sampled once.

    Parameters
    ----------
    kinematics : Kinematics
        The model and the points to be placed.
    lower, upper : array (nq,), optional
        Limits of revolute and prismatic joints, radians and metres; the model's unless told otherwise. Free-flyers
        and continuous joints have none: their entries are not read.
    tolerance : float
        Metres; see `Reach`.
    precision : float
        Metres: where a point is farther off, other starts are tried. A looser one is quicker on postures that the
        model cannot reach, but may leave a posture in a worse configuration than need be.

    Raises
    ------
    InputError
        Where limits have another shape, are NaN, or lower is above upper; where tolerance or precision is not
        positive.
    """

    kinematics: Kinematics
    lower: ArrayLike | None = None
    upper: ArrayLike | None = None
    tolerance: float = IK_TOLERANCE_METRES
    precision: float = RESTART_METRES

    def __post_init__(self) -> None:
        for name, value in (("tolerance", self.tolerance), ("precision", self.precision)):
            if not 0 < value < np.inf:
                raise InputError(f"{name} is {value:g} m; expected positive and finite")
        _ = self._limits

    def solve(
        self, targets: ArrayLike, *, weights: ArrayLike | None = None, start: ArrayLike | None = None
    ) -> Solution:
        """Find configurations that place the points on their targets, inside the limits.

        From `start` if there is one; else, and where that is not met to the precision, from the tables: trunk,
        limbs, then all joints together by damped least squares, other limbs and other trunks where needed. What
        the points do not determine (the axial rotation of a straight limb) stays near `start`, else near the
        neutral configuration. The same input gives the same answer.

        Parameters
        ----------
        targets : array (N, P, 3)
            Metres, the model's world; NaN is unknown. What cannot be reached is no error: see `Solution`.
        weights : array (P,) or (N, P), optional
            Of squared distances, relative to each other; a point of weight 0 is not looked at. All 1 unless told
            otherwise.
        start : array (nq,) or (N, nq), optional
            Configurations to start from, and to stay near where the points do not tell.

        Returns
        -------
        Solution

        Raises
        ------
        InputError
            Where an array has another shape, a target is infinite or beyond 1000 km, a weight is negative or not
            finite, or a start is not a configuration.
        """
        problem = self._problem(targets, weights)
        if not len(problem.targets):
            return self._explain(problem, self._search.descend(problem, problem.reference))
        if start is None:
            return self._explain(problem, self._search.everywhere(problem))
        given = np.asarray(start, dtype=np.float64)
        n, nq = len(problem.targets), self.kinematics.space.nq
        if given.shape not in ((nq,), (n, nq)):
            raise InputError(f"start has shape {given.shape}; expected ({nq},) or ({n}, {nq})")
        given = np.broadcast_to(given, (n, nq))
        self.kinematics.space.check(given)
        problem = problem._replace(reference=np.clip(given, problem.lower, problem.upper))
        found = self._search.descend(problem, problem.reference)
        unmet = np.flatnonzero(found.worst > self._search.tolerance)
        if unmet.size:
            found.improve(unmet, self._search.everywhere(problem.take(unmet)))
        return self._explain(problem, found)

    def solve_sequence(
        self,
        targets: ArrayLike,
        *,
        sequence: ArrayLike | None = None,
        weights: ArrayLike | None = None,
    ) -> Solution:
        """Find configurations frame by frame, each from the one before; many sequences side by side.

        The tables are used for a sequence's first frame, and where frames are met ever worse than that: a joint may
        have run into a limit that another way round avoids.

        Parameters
        ----------
        targets : array (T, P, 3)
            Metres; of each sequence, frames in order of time.
        sequence : array (T,), optional
            Which sequence a frame belongs to; all to one unless told otherwise.
        weights : array (P,) or (T, P), optional
            Of squared distances, as `solve` takes them.

        Returns
        -------
        Solution
            In the order of the frames.

        Raises
        ------
        InputError
            See `solve`.
        """
        problem = self._problem(targets, weights)
        n = len(problem.targets)
        which = np.zeros(n, dtype=np.intp) if sequence is None else np.asarray(sequence)
        if which.shape != (n,):
            raise InputError(f"sequence has shape {which.shape}; expected ({n},), one entry a frame")
        frames = _frames(which)
        reference = problem.reference.copy()
        parts: list[KinematicSearchResult] = []
        level = np.zeros(len(frames[0]) if frames else 0)
        for k, rows in enumerate(frames):
            here = problem.take(rows)
            level = np.maximum(level[: len(rows)], self._search.tolerance)
            if k == 0:
                found = self._search.everywhere(here)
                again = np.arange(len(rows))
            else:
                # Sequences that have ended stood last in the frame before: see _frames.
                before = parts[-1].q[: len(rows)]
                reference[rows] = before
                here = here._replace(reference=before)
                found = self._search.descend(here, before)
                again = np.flatnonzero(found.worst > JUMP_RATIO * level)
                if again.size:
                    found.improve(again, self._search.everywhere(here.take(again)))
            level = np.minimum(level, found.worst)
            level[again] = found.worst[again]
            parts.append(found)
        order = np.argsort(np.concatenate(frames)) if frames else np.zeros(0, dtype=np.intp)
        joined = (
            KinematicSearchResult(*(np.concatenate(arrays)[order] for arrays in zip(*parts, strict=True)))
            if parts
            else self._search.descend(problem, reference)
        )
        return self._explain(problem._replace(reference=reference), joined)

    @cached_property
    def _limits(self) -> tuple[Array, Array]:
        space = self.kinematics.space
        limits = []
        for name, given, own in (("lower", self.lower, space.lower), ("upper", self.upper, space.upper)):
            limit = own.copy()
            if given is not None:
                array = np.asarray(given, dtype=np.float64)
                if array.shape != (space.nq,):
                    raise InputError(f"{name} has shape {array.shape}; expected ({space.nq},)")
                limit[space.bounded_q] = array[space.bounded_q]
            limits.append(limit)
        lower, upper = limits
        wrong = ~(lower[space.bounded_q] <= upper[space.bounded_q])
        if wrong.any():
            at = int(space.bounded_q[np.argmax(wrong)])
            raise InputError(
                f"q[{at}]: lower limit {lower[at]:g} and upper limit {upper[at]:g}; expected lower <= upper"
            )
        return lower, upper

    @cached_property
    def _search(self) -> PostureSearch:
        tables = make_tables(self.kinematics, *self._limits)
        starts = SearchStarts(kinematics=self.kinematics, tables=tables)
        return PostureSearch(starts=starts, tolerance=min(self.precision, self.tolerance))

    def _problem(self, targets: ArrayLike, weights: ArrayLike | None) -> KinematicProblem:
        """Check what is asked for."""
        goal = np.asarray(targets, dtype=np.float64)
        count = len(self.kinematics.points)
        if goal.ndim != 3 or goal.shape[1:] != (count, 3):
            raise InputError(
                f"targets have shape {goal.shape}; expected (N, {count}, 3), the points "
                f"{', '.join(self.kinematics.names[:20])}"
            )
        if (np.abs(goal) > MAX_TARGET_METRES).any():
            raise InputError(
                f"a target is at {np.nanmax(np.abs(goal)):g} m; expected at most {MAX_TARGET_METRES:g}; give metres, "
                "and NaN for what is unknown"
            )
        each = np.ones(count) if weights is None else np.asarray(weights, dtype=np.float64)
        if each.shape not in ((count,), goal.shape[:2]):
            raise InputError(f"weights have shape {each.shape}; expected ({count},) or {goal.shape[:2]}")
        if not (np.isfinite(each) & (each >= 0)).all():
            raise InputError("weights must be finite and not negative")
        lower, upper = self._limits
        rest = np.clip(self.kinematics.neutral, lower, upper)
        return KinematicProblem(
            targets=goal,
            weights=np.broadcast_to(
                each / max(float(each.max(initial=0.0)), MIN_TOTAL_WEIGHT), goal.shape[:2]
            ),
            lower=lower,
            upper=upper,
            reference=np.tile(rest, (len(goal), 1)),
            pull=REFERENCE_PULL,
        )

    def _explain(self, problem: KinematicProblem, found: KinematicSearchResult) -> Solution:
        """Tell whether limits or lengths are the reason where a posture is not met."""
        q, space = found.q, self.kinematics.space
        reach = np.full(len(q), Reach.MET, dtype=np.intp)
        loose_q = q.copy()
        unmet = np.flatnonzero(found.worst > self.tolerance)
        if unmet.size:
            loose = self._search.descend(unlimited(problem.take(unmet), q[unmet]), q[unmet])
            loose_q[unmet] = loose.q
            reach[unmet] = np.where(loose.worst <= self.tolerance, Reach.LIMITS, Reach.LENGTHS)
        at_limit = np.zeros(q.shape, dtype=np.bool_)
        at = space.bounded_q
        at_limit[:, at] = (q[:, at] <= problem.lower[at] + AT_LIMIT) | (
            q[:, at] >= problem.upper[at] - AT_LIMIT
        )
        return Solution(
            q=q,
            residual=np.linalg.norm(self.kinematics.positions(q) - problem.targets, axis=2),
            iterations=found.steps,
            converged=found.settled,
            at_limit=at_limit,
            reach=reach,
            unlimited_q=loose_q,
            unlimited_residual=np.linalg.norm(self.kinematics.positions(loose_q) - problem.targets, axis=2),
        )


def solve(
    kinematics: Kinematics,
    targets: ArrayLike,
    *,
    weights: ArrayLike | None = None,
    start: ArrayLike | None = None,
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
    tolerance: float = IK_TOLERANCE_METRES,
) -> Solution:
    """Solve once: `InverseKinematics` with these limits, and its `solve`; keep the object to solve often."""
    solver = InverseKinematics(kinematics=kinematics, lower=lower, upper=upper, tolerance=tolerance)
    return solver.solve(targets, weights=weights, start=start)


def solve_sequence(
    kinematics: Kinematics,
    targets: ArrayLike,
    *,
    sequence: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
    tolerance: float = IK_TOLERANCE_METRES,
) -> Solution:
    """Solve sequences once: `InverseKinematics` with these limits, and its `solve_sequence`."""
    solver = InverseKinematics(kinematics=kinematics, lower=lower, upper=upper, tolerance=tolerance)
    return solver.solve_sequence(targets, sequence=sequence, weights=weights)


def _frames(which: NDArray[np.generic]) -> list[NDArray[np.intp]]:
    """List the rows of every sequence's first frame, of their second, …; the longest sequences first in each."""
    _, member, lengths = np.unique(which, return_inverse=True, return_counts=True)
    by_member = np.split(np.argsort(member, kind="stable"), np.cumsum(lengths)[:-1]) if len(which) else []
    longest = sorted(by_member, key=len, reverse=True)
    most = len(longest[0]) if longest else 0
    return [np.array([rows[k] for rows in longest if len(rows) > k]) for k in range(most)]
