"""Configurations of an object's postures: found within the limits, or undecided with the reason."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from posekit.cameras import Array
from posekit.robot import Robot
from posekit.robot.ik import InverseKinematics, Reach, Solution
from posekit.robot.kinematics import Kinematics, body_points

MOST = 256
"""Postures of one frame whose configurations are looked for: some milliseconds each."""


class Certificate(NamedTuple):
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

    def certify(self, points: Array, *, tolerance: float) -> Certificate:
        """Find configurations that place points (N, P, 3), metres, NaN unknown, within a tolerance in metres."""
        if tolerance not in self._solvers:
            self._solvers[tolerance] = InverseKinematics(kinematics=self.kinematics, tolerance=tolerance)
        n, nq = len(points), self.robot.model.nq
        q, distance = np.full((n, nq), np.nan), np.full(n, np.nan)
        reasons = [f"undecided: configurations of the first {MOST} postures alone were looked for"] * n
        if n:
            with np.errstate(over="ignore"):  # the damping after a step that made things far worse
                solution = self._solvers[tolerance].solve(points[:MOST])
            q[:MOST] = solution.q
            distance[:MOST] = np.nanmax(solution.residual, axis=1)
            reasons[:MOST] = [self._reason(solution, k) for k in range(len(solution.q))]
        certified = (distance <= tolerance).tolist()
        reasons = ["" if sure else reason for sure, reason in zip(certified, reasons, strict=True)]
        return Certificate(q, distance, certified, reasons)

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
