"""Configurations of an object's postures: found within the limits, or undecided with the reason."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.geometry import Array, quaternion_from_rotation
from posekit.objects.drawn_views import draw_configurations
from posekit.robots import Robot
from posekit.robots.descent import KinematicProblem, descend
from posekit.robots.ik import REFERENCE_PULL, InverseKinematics, Reach, Solution
from posekit.robots.kinematics import Kinematics, body_points
from posekit.robots.starts import lay

MAX_POSTURES_CERTIFIED = 256
"""Postures of one frame whose configurations are looked for: some milliseconds each."""


SEARCH_TOLERANCE_METRES = 1e-3
"""Metres that the solver's own search must come near to; what it found is then refined."""

MAX_UNDECIDED_RETRIED = 32
"""How many of those that are still undecided are tried once more."""

N_RANDOM_SHAPES, N_SHAPES_ALIGNED, N_RESTARTS = 2048, 48, 12
"""Random configurations that are compared with a posture by its distances, then laid on it, then started from."""


class ObjectCertificate(NamedTuple):
    """Configurations of N postures.

    Attributes
    ----------
    q : array (N, nq)
        Within the limits; the best that was found. NaN where none was looked for.
    distance : array (N,)
        The largest distance of a known point from the posture's, metres.
    certified : list of bool
        Whether that is within the tolerance. Where it is not nothing is proved: another start may do.
    reasons : list of str
        Empty where certified.
    """

    q: Array
    distance: Array
    certified: list[bool]
    reasons: list[str]


class Certifier:
    """Solves for the configurations of one robot.

    Parameters
    ----------
    robot : Robot
        Free-flying.
    names : sequence of str
        The frames that the points are.
    """

    def __init__(self, robot: Robot, names: tuple[str, ...]) -> None:
        self.robot = robot
        self.kinematics = Kinematics(model=robot.model, points=body_points(names))
        self._solvers: dict[float, InverseKinematics] = {}

    def certify(self, points: Array, *, tolerance: float) -> ObjectCertificate:
        """Find configurations that place points (N, P, 3), metres, NaN unknown, within a tolerance in metres."""
        rough = max(tolerance, SEARCH_TOLERANCE_METRES)
        if rough not in self._solvers:
            self._solvers[rough] = InverseKinematics(kinematics=self.kinematics, tolerance=rough)
        n, nq = len(points), self.robot.model.nq
        q, distance = np.full((n, nq), np.nan), np.full(n, np.nan)
        reasons = [
            f"undecided: configurations of the first {MAX_POSTURES_CERTIFIED} postures alone were looked for"
        ] * n
        if n:
            with np.errstate(over="ignore"):  # the damping after a step that made things far worse
                solution = self._solvers[rough].solve(points[:MAX_POSTURES_CERTIFIED])
            q[:MAX_POSTURES_CERTIFIED] = solution.q
            distance[:MAX_POSTURES_CERTIFIED] = np.nanmax(solution.residual, axis=1)
            rows = np.flatnonzero(distance > tolerance)
            if rows.size:
                self._descend(points, q, distance, rows, q[rows][:, None])
            # Those still off start anew, from random shapes whose points are about as far apart, laid on them.
            rows = np.flatnonzero(distance > tolerance)[:MAX_UNDECIDED_RETRIED]
            if rows.size:
                self._descend(points, q, distance, rows, self._starts(points[rows]))
            reasons[:MAX_POSTURES_CERTIFIED] = [self._reason(solution, k) for k in range(len(solution.q))]
        certified = (distance <= tolerance).tolist()
        reasons = ["" if sure else reason for sure, reason in zip(certified, reasons, strict=True)]
        return ObjectCertificate(q, distance, certified, reasons)

    def _descend(
        self, points: Array, q: Array, distance: Array, rows: NDArray[np.intp], starts: Array
    ) -> None:
        """Descend on some rows from several starts (n, k, nq); what does better is taken over, in place."""
        n, k, nq = starts.shape
        goals = np.repeat(points[rows], k, axis=0)
        space = self.kinematics.space
        found = starts.reshape(n * k, nq)
        for _ in range(2):  # the second time what the points do not determine is drawn to where it is
            problem = KinematicProblem(
                targets=goals,
                weights=np.ones(goals.shape[:2]),
                lower=space.lower,
                upper=space.upper,
                reference=found,
                pull=REFERENCE_PULL,
            )
            found = descend(self.kinematics, problem, found).q
        apart = np.linalg.norm(self.kinematics.positions(found) - goals, axis=2)
        worst = np.nanmax(apart, axis=1).reshape(n, k)
        best = (np.arange(n), worst.argmin(axis=1))
        closer = worst[best] < distance[rows]
        q[rows[closer]] = found.reshape(n, k, nq)[best][closer]
        distance[rows[closer]] = worst[best][closer]

    def _starts(self, points: Array) -> Array:
        """Find configurations (N, N_RESTARTS, nq) whose points lie best on postures (N, P, 3), the base laid."""
        q, shapes, lengths = self._shapes
        first, second = np.triu_indices(points.shape[1], 1)
        gap = np.linalg.norm(points[:, first] - points[:, second], axis=2)
        known = np.isfinite(gap).astype(np.float64)
        gap = np.nan_to_num(gap)
        # Sum of squared differences of the known distances, less what is the same for all shapes: d^2 - 2 g d.
        misfit = known @ (lengths**2).T - 2 * gap @ lengths.T
        near = np.argpartition(misfit, N_SHAPES_ALIGNED, axis=1)[:, :N_SHAPES_ALIGNED].reshape(-1)
        weights = np.isfinite(points[..., 0]).astype(np.float64).repeat(N_SHAPES_ALIGNED, axis=0)
        R, t, left = lay(shapes[near], np.nan_to_num(points).repeat(N_SHAPES_ALIGNED, axis=0), weights)
        laid = q[near]
        laid[:, :3], laid[:, 3:7] = t, quaternion_from_rotation(R, shorter=False)
        best = np.argsort(left.reshape(-1, N_SHAPES_ALIGNED), axis=1, kind="stable")[:, :N_RESTARTS]
        return np.take_along_axis(laid.reshape(len(points), N_SHAPES_ALIGNED, -1), best[..., None], axis=1)

    @cached_property
    def _shapes(self) -> tuple[Array, Array, Array]:
        """Random configurations (M, nq) with the base at rest, their points and the distances of these."""
        q = draw_configurations(self.robot, N_RANDOM_SHAPES, np.random.default_rng(0))
        q[:, :7] = pin.neutral(self.robot.model)[:7]
        shapes = self.kinematics.positions(q)
        first, second = np.triu_indices(shapes.shape[1], 1)
        return q, shapes, np.linalg.norm(shapes[:, first] - shapes[:, second], axis=2)

    def _reason(self, solution: Solution, k: int) -> str:
        """Say what the nearest configuration lacks."""
        worst = int(np.nanargmax(solution.residual[k]))
        off = f"{self.kinematics.names[worst]} is {float(solution.residual[k, worst]):.3g} m off"
        if solution.reach[k] != Reach.LIMITS:
            return f"undecided: no configuration was found, with limits or without; {off} in the nearest"
        space, free = self.kinematics.space, solution.unlimited_q[k]
        lower, upper = space.lower[space.bounded_q], space.upper[space.bounded_q]
        beyond = np.maximum(lower - free[space.bounded_q], free[space.bounded_q] - upper)
        at = int(np.argmax(beyond))
        name = self.robot.configuration_names[int(space.bounded_q[at])]
        return (
            f"undecided: no configuration within the limits was found; without them {name} is "
            f"{float(free[space.bounded_q[at]]):.4g}, outside [{lower[at]:.4g}, {upper[at]:.4g}]; {off} in the nearest"
        )
