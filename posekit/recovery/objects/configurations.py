"""Configurations of a robot within its limits whose points are a posture's."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import refusal
from posekit.geometry import Array, best_rotation, cross_matrix, quaternion_from_rotation
from posekit.recovery.objects.linkage import Linkage

#: Postures of a frame whose configurations are sought.
MAX_CERTIFIED: Final = 64

#: Random configurations, and those of them, nearest to a posture, from which its configuration is sought.
N_SHAPES, N_STARTS = 512, 4


class Placement:
    """A robot's points in configurations, laid on a posture by the best rotation and translation.

    The base is eliminated so that least squares has the joints as unknowns alone (variable projection, Golub & Pereyra
    1973).
    """

    def __init__(self, robot: Any, linkage: Linkage) -> None:
        import pinocchio as pin

        model = robot.model
        self.pin, self.model, self.data = pin, model, model.createData()
        self.ids = [model.getFrameId(name) for name in linkage.points]
        for name, number in zip(linkage.points, self.ids, strict=True):
            if number >= model.nframes:
                got = f"{name}, no link or joint of {robot.name}"
                raise refusal(
                    f"linkage {linkage.name}", "points", got, "frames of its robot", "leave urdf out"
                )
        self.free = model.nqs[1] == 7
        self.first = 6 if self.free else 0
        self.neutral = pin.neutral(model)
        lower, upper = np.full(model.nv, -np.pi), np.full(model.nv, np.pi)
        for joint in range(2 if self.free else 1, model.njoints):
            if model.nqs[joint] == 1:
                at, to = model.idx_qs[joint], model.idx_vs[joint]
                lower[to], upper[to] = robot.lower[at] - self.neutral[at], robot.upper[at] - self.neutral[at]
        self.lower = lower[self.first :]
        self.upper = np.maximum(upper[self.first :], self.lower + 1e-9)

    def configuration(self, x: Array) -> Array:
        """Return q at joint displacements x from neutral, the base at rest."""
        return np.asarray(
            self.pin.integrate(self.model, self.neutral, np.concatenate([np.zeros(self.first), x]))
        )

    def points(self, x: Array) -> Array:
        """Return the points (P, 3), metres."""
        self.pin.framesForwardKinematics(self.model, self.data, self.configuration(x))
        return np.array([self.data.oMf[k].translation for k in self.ids])

    def off(self, x: Array, target: Array, known: NDArray[np.bool_]) -> Array:
        """Return the distances (3 P,) from a posture."""
        return laid(self.points(x)[known], target[known])[0].ravel()

    def slope(self, x: Array, target: Array, known: NDArray[np.bool_]) -> Array:
        """Return the derivative of `off`; turning the base is no change (Kaufman 1975)."""
        pin = self.pin
        pin.computeJointJacobians(self.model, self.data, self.configuration(x))
        left, R = laid(self.points(x)[known], target[known])
        whole = [
            pin.getFrameJacobian(self.model, self.data, k, pin.LOCAL_WORLD_ALIGNED)[:3, self.first :]
            for k in self.ids
        ]
        J = R @ np.array(whole)[known]
        J = (J - J.mean(axis=0)).reshape(-1, len(x))
        turn = np.concatenate([cross_matrix(p) for p in left + target[known] - target[known].mean(axis=0)])
        return np.asarray(J - turn @ np.linalg.lstsq(turn, J, rcond=None)[0])


def laid(points: Array, target: Array) -> tuple[Array, Array]:
    """Lay points (..., P, 3) on a target (P, 3): the remaining distances, and the rotations."""
    centred = points - points.mean(axis=-2, keepdims=True)
    goal = target - target.mean(axis=0)
    R, _ = best_rotation(np.einsum("pi,...pj->...ij", goal, centred))
    return centred @ np.swapaxes(R, -1, -2) - goal, R


def configurations_of(
    robot: Any, linkage: Linkage, points: Array, frame: NDArray[np.intp], allowed: Array
) -> dict[str, Any]:
    """Seek configurations within the robot's limits, from random ones whose points lie nearest to each posture."""
    from scipy.optimize import least_squares

    place, factor = Placement(robot, linkage), linkage.unit or 1.0
    low, high = np.maximum(place.lower, -np.pi), np.minimum(place.upper, np.pi)
    shapes = np.random.default_rng(0).uniform(low, high, (N_SHAPES, len(low)))
    placed = np.array([place.points(x) for x in shapes])
    q, distance = np.full((len(points), robot.model.nq), np.nan), np.full(len(points), np.nan)
    for row in range(len(points)):
        if (frame[:row] == frame[row]).sum() >= MAX_CERTIFIED:
            continue
        target = points[row] * factor
        known = np.isfinite(target).all(axis=1)
        near = (laid(placed[:, known], target[known])[0] ** 2).sum(axis=(1, 2))
        bounds, given = (place.lower, place.upper), (target, known)
        for start in shapes[np.argsort(near)[:N_STARTS]]:
            x = least_squares(place.off, start, place.slope, bounds, args=given, xtol=1e-13, max_nfev=40).x
            off = float(np.linalg.norm(place.off(x, *given).reshape(-1, 3), axis=1).max())
            if not off >= distance[row]:
                q[row], distance[row] = place.configuration(x), off
                if place.free:
                    at = place.points(x)[known]
                    _, R = laid(at, target[known])
                    q[row, :3] = target[known].mean(axis=0) - R @ at.mean(axis=0)
                    q[row, 3:7] = quaternion_from_rotation(R)
            if off <= allowed[row]:
                break
    return {"q": q, "distance": distance, "certified": distance <= allowed}
