"""Inverse kinematics: configurations within the joint limits that reach joint positions, for a batch of postures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from posekit.errors import refusal
from posekit.geometry import Array, Ints, align, mean_known
from posekit.robots.urdf import need
from posekit.skeleton import JOINTS, N_TRUNK_JOINTS, POINTS

if TYPE_CHECKING:
    from posekit.robots.robot import Robot

#: Distance (m) from their targets within which all known points must be; otherwise other starts are tried.
MET: Final = 1e-3
#: Weight of the squared distance from the start, m^2/rad^2. It selects one of the configurations that have the same
#: points.
PULL: Final = 1e-10
#: Largest number of steps of a search.
STEPS: Final = 40
#: Relative decrease of the cost below which a search ends.
PRECISION: Final = 1e-4
#: Decrease of the cost (m^2) below which a search ends in any case. Distances are then below a nanometre.
LEAST: Final = 1e-19
#: Number of postures that are searched at once. Their Jacobians have about 15 MB.
BLOCK: Final = 256
#: Damping of Levenberg-Marquardt: first, smallest and largest value, and factors after a good and a bad step.
DAMPING: Final = (1e-3, 1e-12, 1e6, 0.1, 8.0)
#: Smallest scale of the damping, m^2/rad^2. It bounds the steps of joints that move no point.
FLOOR: Final = 1e-6
#: Number of other starts: the middle of the limits, then random configurations.
SEEDS: Final = 4


class _Problem:
    """The least-squares problem of one robot: targets (N, P, 3), metres, of the P joint-map points in N postures."""

    def __init__(self, robot: Robot, joints: Array) -> None:
        model = robot.model
        columns = [POINTS.index(name) for name in robot.joint_map]
        padded = np.pad(joints, ((0, 0), (0, len(POINTS) - len(JOINTS)), (0, 0)), constant_values=np.nan)
        self.robot, self.model, self.kinematics = robot, model, robot.kinematics
        self.targets = padded[:, columns]
        self.known = np.asarray(np.isfinite(self.targets).all(axis=2))
        self.trunk = [k for k, column in enumerate(columns) if column < N_TRUNK_JOINTS]
        # Indices in q and v of the joints with limits: hinges and slides.
        single = np.array(model.nqs) == 1
        self.at_q, self.at_v = np.array(model.idx_qs)[single], np.array(model.idx_vs)[single]
        # A mimicking joint moves with its target: v = S u, where u are the entries of v of all other joints.
        follow = np.eye(model.nv)
        for mimic in robot.mimics:
            one, other = (model.idx_vs[model.getJointId(name)] for name in (mimic.joint, mimic.target))
            follow[one] = mimic.multiplier * follow[other]
        self.free = np.flatnonzero(follow.any(axis=0))
        self.follow = follow[:, self.free]

    def gaps(self, positions: Array, rows: Ints) -> Array:
        """Return the vectors (n, P, 3) from targets to points, metres; zero for unknown targets."""
        return np.where(self.known[rows, :, None], positions - self.targets[rows], 0.0)

    def away(self, q: Array, start: Array) -> Array:
        """Return the differences (n, nv) of hinges and slides from the start, ordered as v; zero for other joints."""
        out = np.zeros((len(q), self.model.nv))
        out[:, self.at_v] = q[:, self.at_q] - start[:, self.at_q]
        return out

    def cost(self, q: Array, start: Array, rows: Ints) -> Array:
        """Return half the sum (n,) of the squared distances and the weighted squared difference from the start, m^2."""
        gap = self.gaps(self.kinematics.positions(q), rows)
        return np.asarray((gap**2).sum(axis=(1, 2)) + PULL * (self.away(q, start) ** 2).sum(axis=1)) / 2

    def step(self, q: Array, start: Array, rows: Ints, damping: Array) -> Array:
        """Return damped Gauss-Newton steps (n, nv).

        A joint at a limit does not move if the gradient pushes it outward (Bertsekas 1982).
        """
        positions, jacobian = self.kinematics.jacobians(q)
        gap = self.gaps(positions, rows).reshape(len(q), -1)
        J = (jacobian * self.known[rows, :, None, None]).reshape(len(q), gap.shape[1], -1)
        S, away = self.follow, self.away(q, start)
        gradient = ((gap[:, None] @ J)[:, 0] + PULL * away) @ S
        J = J @ S
        H = J.transpose(0, 2, 1) @ J + PULL * S.T @ S
        lowest, highest = np.zeros((2, len(q), self.model.nv), dtype=np.bool_)
        lowest[:, self.at_v] = q[:, self.at_q] <= self.robot.lower[self.at_q]
        highest[:, self.at_v] = q[:, self.at_q] >= self.robot.upper[self.at_q]
        held = (lowest[:, self.free] & (gradient > 0)) | (highest[:, self.free] & (gradient < 0))
        moving = ~held
        H = H * moving[:, :, None] * moving[:, None]
        diagonal = np.arange(len(self.free))
        H[:, diagonal, diagonal] += damping[:, None] * (H[:, diagonal, diagonal] + FLOOR) + held
        return -np.linalg.solve(H, (moving * gradient)[..., None])[..., 0] @ S.T

    def moved(self, q: Array, step: Array) -> Array:
        """Return the configurations (n, nq) after steps (n, nv), clipped to the limits."""
        out = np.array([pin.integrate(self.model, a, b) for a, b in zip(q, step, strict=True)])
        return self.inside(out.reshape(len(q), self.model.nq))

    def inside(self, q: Array) -> Array:
        """Clip configurations (n, nq) to the limits, and set mimicking joints."""
        return self.robot.with_mimics(np.clip(q, self.robot.lower, self.robot.upper))

    def worst(self, q: Array) -> Array:
        """Return the largest distance of a known point from its target (N,), metres."""
        gaps = self.gaps(self.kinematics.positions(q), np.arange(len(q)))
        return np.asarray(np.linalg.norm(gaps, axis=2).max(axis=1, initial=0.0))

    def laid(self, q: Array) -> Array:
        """Repeat a configuration (nq,) for each posture; place the root where the trunk fits its targets best."""
        out = np.tile(q, (len(self.targets), 1))
        if not self.robot.free_flyer:
            return out
        points, targets = self.kinematics.positions(q[None])[:, self.trunk], self.targets[:, self.trunk]
        found = align(points, targets, scale=False)
        gap = np.nan_to_num(mean_known((targets - points).transpose(0, 2, 1)))
        root, fixed = pin.XYZQUATToSE3(np.array(q[:7])), self.model.jointPlacements[1]
        for row, (R, t) in enumerate(zip(found.rotation, found.translation, strict=True)):
            # Fewer than three known points determine no rotation.
            T = pin.SE3(R, t) if np.isfinite(R).all() else pin.SE3(np.eye(3), gap[row])
            out[row, :7] = pin.SE3ToXYZQUAT(fixed.actInv(T * fixed * root))
        return out


def solve(robot: Robot, joints: ArrayLike, *, start: ArrayLike | None = None) -> tuple[Array, Array]:
    r"""Find configurations within the limits whose joint-map points are nearest to given joint positions.

    Minimise :math:`\tfrac12 \sum_p |p(q) - y_p|^2` by Levenberg-Marquardt on the configuration manifold, for all
    postures at once. Here p(q) are points of the robot and :math:`y_p` their targets. If a known point is farther than
    `MET` from its target, the search is repeated from other starts.

    Parameters
    ----------
    robot : Robot
    joints : array (14, 3) or (N, 14, 3)
        Metres, world; NaN is unknown.
    start : array (N, nq), optional
        Configurations near the solution; by default the neutral configuration. Robot joints that the targets do not
        determine stay near this start.

    Returns
    -------
    q : array (N, nq)
        Mimicking joints have the values that their URDF elements ``<mimic>`` state.
    distance : array (N,)
        Largest distance of a known joint from its target, metres; NaN if no joint is known.

    Raises
    ------
    InputError
        If the robot is not a humanoid, or an array has another shape.
    """
    given = np.asarray(joints, dtype=np.float64)
    given = given[None] if given.ndim == 2 else given
    if given.ndim != 3 or given.shape[1:] != (len(JOINTS), 3):
        raise refusal("", "joints", f"shape {given.shape}", f"(N, {len(JOINTS)}, 3)", "order them as JOINTS")
    lacking = "no joints whose names stand for shoulders, elbows, hips and knees of both sides"
    need(robot.source, robot.joint_map, "", lacking, "a humanoid", "give a joint map (posekit.joint_map/1)")
    problem = _Problem(robot, given)
    first = problem.laid(robot.neutral) if start is None else problem.inside(robot.checked(start, "start"))
    q, cost = _descend(problem, first, first, np.arange(len(given)))
    worst = problem.worst(q)
    for seed in range(SEEDS):
        unmet = np.flatnonzero(worst > MET)
        if not unmet.size:
            break
        found, new = _descend(problem, problem.laid(_seed(robot, seed))[unmet], first[unmet], unmet)
        better = new < cost[unmet]
        q[unmet[better]], cost[unmet[better]] = found[better], new[better]
        worst = problem.worst(q)
    return q, np.where(problem.known.any(axis=1), worst, np.nan)


def _descend(problem: _Problem, q: Array, start: Array, rows: Ints) -> tuple[Array, Array]:
    """Minimise the cost of the postures `rows` from a start (n, nq); return configurations and costs (n,), m^2."""
    q, damping = q.copy(), np.full(len(q), DAMPING[0])
    cost = problem.cost(q, start, rows)
    for first in range(0, len(q), BLOCK):
        active = np.arange(first, min(first + BLOCK, len(q)))
        for _ in range(STEPS):
            here, at = rows[active], start[active]
            moved = problem.moved(q[active], problem.step(q[active], at, here, damping[active]))
            new = problem.cost(moved, at, here)
            better = new < cost[active]
            settled = better & (cost[active] - new < PRECISION * cost[active] + LEAST)
            q[active[better]], cost[active[better]] = moved[better], new[better]
            damping[active] = np.clip(damping[active] * np.where(better, *DAMPING[3:]), *DAMPING[1:3])
            active = active[~settled & (damping[active] < DAMPING[2])]
            if not active.size:
                break
    return q, cost


def _seed(robot: Robot, seed: int) -> Array:
    """Return another initial configuration (nq,): the middle of the limits, or a random configuration inside them."""
    q = robot.neutral.copy()
    bounded = np.flatnonzero(np.isfinite(robot.lower) & np.isfinite(robot.upper))
    low, high = np.maximum(robot.lower[bounded], -np.pi), np.minimum(robot.upper[bounded], np.pi)
    share = np.random.default_rng(seed).uniform(0.2, 0.8, len(bounded)) if seed else 0.5
    q[bounded] = low + share * (high - low)
    return np.array(robot.with_mimics(q[None])[0])
