"""The search behind inverse kinematics: trunk, limbs, all together, and other starts where that did not do."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.robots.body_point import frame_index
from posekit.robots.descent import KinematicDescent, KinematicProblem, descend
from posekit.robots.joint_chain import beyond
from posekit.robots.kinematics import Kinematics
from posekit.robots.start_tables import ShapeTable
from posekit.robots.starts import SearchStarts

N_RETRIES = 6
"""Other shapes of a trunk or a limb that are tried where the first does not meet its own points."""

TRUNK_STEPS, LIMB_STEPS = 15, 25

ROUGH_PRECISION = 1e-4
"""Precision with which trunks and limbs are laid: what cannot be met is then given up early."""

N_TRUNKS = 16
"""Trunks among which others are tried where the posture is not met."""

MAX_TRUNKS_TRIED = 4
"""So many of them at most."""

DISTINCT_TRUNK = 0.05
"""Radians (of a joint, or of the base) or metres by which another trunk must differ."""


class KinematicSearchResult(NamedTuple):
    """The best that was found for each posture.

    Attributes
    ----------
    q : array (N, nq)
        Configurations in Pinocchio's order.
    cost : array (N,)
        As `KinematicDescent` has it, m^2.
    worst : array (N,)
        The largest distance of a known point of some weight from its target, metres.
    steps : int array (N,)
        How many steps all searches took together.
    settled : bool array (N,)
        Whether the search ended at a minimum.
    """

    q: Array
    cost: Array
    worst: Array
    steps: NDArray[np.intp]
    settled: NDArray[np.bool_]

    def improve(self, rows: NDArray[np.intp], other: KinematicSearchResult) -> None:
        """Take over, in place, what another search did better on some rows; its steps count in any case."""
        self.steps[rows] += other.steps
        better = other.cost < self.cost[rows]
        for mine, theirs in (
            (self.q, other.q),
            (self.cost, other.cost),
            (self.worst, other.worst),
            (self.settled, other.settled),
        ):
            mine[rows[better]] = theirs[better]


class _Part(NamedTuple):
    """A table's points alone, seen from what carries them: a smaller problem."""

    kinematics: Kinematics
    columns: NDArray[np.intp]
    points: NDArray[np.intp]


@dataclass(frozen=True, kw_only=True, eq=False)
class PostureSearch:
    """Searches for one model.

    Parameters
    ----------
    starts : SearchStarts
        Where searches begin.
    tolerance : float
        Metres: where no point is farther off, the search ends.
    """

    starts: SearchStarts
    tolerance: float

    @property
    def kinematics(self) -> Kinematics:
        """The model and its points."""
        return self.starts.kinematics

    def descend(self, problem: KinematicProblem, start: Array) -> KinematicSearchResult:
        """Search from one start, all joints together."""
        return self._found(descend(self.kinematics, problem, start), problem)

    def everywhere(self, problem: KinematicProblem) -> KinematicSearchResult:
        """Search from the tables of starts: trunk, limbs, then all joints; other trunks where that did not do."""
        trunk = self._trunk(problem)
        found = self.descend(problem, self._with_limbs(trunk, problem))
        rows = np.flatnonzero(found.worst > self.tolerance)
        if rows.size and self._trunk_part.columns.size:
            self._try_other_trunks(found, problem.take(rows), rows, trunk[rows])
        return found

    def _try_other_trunks(
        self, found: KinematicSearchResult, problem: KinematicProblem, rows: NDArray[np.intp], trunk: Array
    ) -> None:
        """Start from trunks that lie on their points as well, but otherwise: as a flat trunk does back to front.

        All points together cost no less than the trunk's alone: a trunk that costs more than the best posture found
        cannot lead to a better one.
        """
        space = self.kinematics.space
        starts = self.starts.trunks(problem.targets, N_TRUNKS)
        trunks, cost = self._descend_each(self._trunk_part, problem, starts, TRUNK_STEPS)
        order = np.argsort(cost, axis=0, kind="stable")
        tried, count = [trunk], np.zeros(len(rows), dtype=np.intp)
        for k in order:
            each = np.arange(len(rows))
            other = trunks[k, each]
            new = (cost[k, each] < found.cost[rows]) & (found.worst[rows] > self.tolerance)
            for before in tried:
                new &= np.abs(space.difference(before, other)).max(axis=1) > DISTINCT_TRUNK
            tried.append(other)
            some = np.flatnonzero(new & (count < MAX_TRUNKS_TRIED))
            count[some] += 1
            if some.size:
                few = problem.take(some)
                found.improve(rows[some], self.descend(few, self._with_limbs(other[some], few)))

    def _found(self, descent: KinematicDescent, problem: KinematicProblem) -> KinematicSearchResult:
        gap = np.linalg.norm(self.kinematics.positions(descent.q) - problem.targets, axis=2)
        counts = np.isfinite(gap) & (problem.weights > 0)
        worst = np.where(counts, gap, 0.0).max(axis=1, initial=0.0)
        return KinematicSearchResult(descent.q, descent.cost, worst, descent.steps, descent.settled)

    def _trunk(self, problem: KinematicProblem) -> Array:
        """Lay the trunk: the first candidate, and the best of the others where it does not meet its points."""
        first = self.starts.trunks(problem.targets, 1)
        if not self._trunk_part.columns.size:
            return np.asarray(first[0])
        q, cost = self._descend_part(self._trunk_part, problem, first, TRUNK_STEPS)
        rows = self._missed(cost)
        if rows.size:
            few = problem.take(rows)
            others = self.starts.trunks(few.targets, 1 + N_RETRIES)[1:]
            self._improve_part(self._trunk_part, few, others, TRUNK_STEPS, rows, q, cost)
        return q

    def _with_limbs(self, q: Array, problem: KinematicProblem) -> Array:
        """Lay the limbs on a trunk that stands: each by itself, other shapes where the first does not meet its points.

        Before all joints together are moved: a limb in the wrong shape would pull the trunk along.
        """
        q = q.copy()
        for index, part in enumerate(self._limb_parts):
            first = self.starts.limb(index, q, problem.targets, 1)
            q, cost = self._descend_part(part, problem, first, LIMB_STEPS)
            rows = self._missed(cost)
            if rows.size:
                few = problem.take(rows)
                others = self.starts.limb(index, q[rows], few.targets, 1 + N_RETRIES)[1:]
                self._improve_part(part, few, others, LIMB_STEPS, rows, q, cost)
        return q

    def _missed(self, cost: Array) -> NDArray[np.intp]:
        """List the rows that cost more than one point that is off by the tolerance."""
        return np.flatnonzero(cost > 0.5 * self.tolerance**2)

    def _improve_part(
        self,
        part: _Part,
        problem: KinematicProblem,
        starts: Array,
        steps: int,
        rows: NDArray[np.intp],
        q: Array,
        cost: Array,
    ) -> None:
        others, other_cost = self._descend_part(part, problem, starts, steps)
        better = other_cost < cost[rows]
        q[rows[better]], cost[rows[better]] = others[better], other_cost[better]

    def _descend_part(
        self, part: _Part, problem: KinematicProblem, starts: Array, steps: int
    ) -> tuple[Array, Array]:
        """Descend on a part's points from several starts (S, N, nq): the best q (N, nq) and its cost (N,)."""
        q, cost = self._descend_each(part, problem, starts, steps)
        best, rows = np.argmin(cost, axis=0), np.arange(cost.shape[1])
        return q[best, rows], cost[best, rows]

    def _descend_each(
        self, part: _Part, problem: KinematicProblem, starts: Array, steps: int
    ) -> tuple[Array, Array]:
        """Descend on a part's points from several starts (S, N, nq): every q (S, N, nq) and its cost (S, N)."""
        count, n = starts.shape[:2]
        targets = problem.targets[:, part.points]
        if part.kinematics.carrier:
            # The carrier stands still meanwhile, and it stands alike in all starts.
            rotation, origin = self.kinematics.joint_placements(starts[0], part.kinematics.carrier)
            targets = np.einsum("nji,npj->npi", rotation, targets - origin[:, None])
        small = KinematicProblem(
            targets=np.tile(targets, (count, 1, 1)),
            weights=np.tile(problem.weights[:, part.points], (count, 1)),
            lower=problem.lower,
            upper=problem.upper,
            reference=np.tile(problem.reference, (count, 1)),
            pull=problem.pull,
        )
        flat = starts.reshape(count * n, starts.shape[2])
        descent = descend(part.kinematics, small, flat, steps, part.columns, ROUGH_PRECISION)
        return descent.q.reshape(starts.shape), descent.cost.reshape(count, n)

    @cached_property
    def _trunk_part(self) -> _Part:
        free = [int(v) + k for v in self.kinematics.space.free_v for k in range(6)]
        return self._part(self.starts.tables.trunk, np.array(free, dtype=np.intp))

    @cached_property
    def _limb_parts(self) -> tuple[_Part, ...]:
        return tuple(self._part(table, np.zeros(0, dtype=np.intp)) for table in self.starts.tables.limbs)

    def _part(self, table: ShapeTable, free: NDArray[np.intp]) -> _Part:
        columns = np.concatenate([free, table.dofs])
        if not table.points.size:
            return _Part(self.kinematics, np.zeros(0, dtype=np.intp), table.points)
        points = tuple(self.kinematics.points[p] for p in table.points)
        model = self.kinematics.model
        # A mean may have a site on another limb: then it is seen from the world.
        frames = frame_index(model)
        bodies = {
            int(model.frames[frames[site.frame]].parentJoint) for point in points for site in point.sites
        }
        carried = set(beyond(model, table.carrier))
        carrier = table.carrier if bodies <= carried else 0
        part = Kinematics(model=model, points=points, carrier=carrier)
        return _Part(part, columns, table.points)


def unlimited(problem: KinematicProblem, reference: Array) -> KinematicProblem:
    """Return the same problem without limits, what the points do not determine near a reference (N, nq)."""
    return problem._replace(
        lower=np.full_like(problem.lower, -np.inf),
        upper=np.full_like(problem.upper, np.inf),
        reference=reference,
    )
