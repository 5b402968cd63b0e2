"""Configurations of a robot, within its joint limits, whose points coincide with the points of a recovered posture."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import refusal
from posekit.geometry import Array, best_rotation, cross_matrix, quaternion_from_rotation
from posekit.recovery.objects.linkage import Linkage

#: Largest number of postures of a frame for which configurations are computed.
MAX_CERTIFIED: Final = 64

#: Number of random configurations, and number of those nearest to a posture from which the search starts.
N_SHAPES, N_STARTS = 512, 4


def configurations_of(
    robot: Any, linkage: Linkage, points: Array, frame: NDArray[np.intp], allowed: Array
) -> dict[str, Any]:
    """Find a configuration for each posture by least squares, starting from the nearest of many random configurations.

    The best rotation and translation of the base are computed from the joint values, so that the joint values are the
    only unknowns (variable projection, Golub & Pereyra 1973).
    """
    import pinocchio as pin
    from scipy.optimize import least_squares

    model, factor = robot.model, linkage.unit or 1.0
    data, neutral = model.createData(), pin.neutral(model)
    ids = [model.getFrameId(name) for name in linkage.points]
    if max(ids) >= model.nframes:
        got = f"{linkage.points[int(np.argmax(ids))]}, no link or joint of {robot.name}"
        raise refusal(f"linkage {linkage.name}", "points", got, "frames of its robot", "leave urdf out")
    single = [j for j in range(1, model.njoints) if model.nqs[j] == 1]
    at_q, at_v = np.array(model.idx_qs)[single], np.array(model.idx_vs)[single]
    lower, upper = np.full(model.nv, -np.pi), np.full(model.nv, np.pi)
    lower[at_v], upper[at_v] = robot.lower[at_q] - neutral[at_q], robot.upper[at_q] - neutral[at_q]
    base = 6 if robot.free_flyer else 0
    lower, upper = bounds = lower[base:], np.maximum(upper[base:], lower[base:] + 1e-9)

    def configuration(x: Array) -> Array:
        return np.asarray(pin.integrate(model, neutral, np.concatenate([np.zeros(base), x])))

    def placed(x: Array) -> Array:
        pin.framesForwardKinematics(model, data, configuration(x))
        return np.array([data.oMf[k].translation for k in ids])

    def off(x: Array, target: Array, known: NDArray[np.bool_]) -> Array:
        return laid(placed(x)[known], target[known])[0].ravel()

    def slope(x: Array, target: Array, known: NDArray[np.bool_]) -> Array:
        """Return the Jacobian of `off`, without the part that a rotation of the base cancels (Kaufman 1975)."""
        pin.computeJointJacobians(model, data, configuration(x))
        left, R = laid(placed(x)[known], target[known])
        every = [pin.getFrameJacobian(model, data, k, pin.LOCAL_WORLD_ALIGNED)[:3, base:] for k in ids]
        J = R @ np.array(every)[known]
        J = (J - J.mean(axis=0)).reshape(-1, len(x))
        turn = np.concatenate([cross_matrix(p) for p in left + target[known] - target[known].mean(axis=0)])
        return np.asarray(J - turn @ np.linalg.lstsq(turn, J, rcond=None)[0])

    shapes = np.random.default_rng(0).uniform(
        np.maximum(lower, -np.pi), np.minimum(upper, np.pi), (N_SHAPES, len(lower))
    )
    tried = np.array([placed(x) for x in shapes])
    q, distance = np.full((len(points), model.nq), np.nan), np.full(len(points), np.nan)
    for row, target in enumerate(points * factor):
        if (frame[:row] == frame[row]).sum() >= MAX_CERTIFIED:
            continue
        known = np.isfinite(target).all(axis=1)
        near = (laid(tried[:, known], target[known])[0] ** 2).sum(axis=(1, 2))
        for start in shapes[np.argsort(near)[:N_STARTS]]:
            found = least_squares(off, start, slope, bounds, args=(target, known), xtol=1e-13, max_nfev=40)
            most = float(np.linalg.norm(found.fun.reshape(-1, 3), axis=1).max())
            if not most >= distance[row]:
                q[row], distance[row] = configuration(found.x), most
                if base:
                    at = placed(found.x)[known]
                    R = laid(at, target[known])[1]
                    q[row, :3] = target[known].mean(axis=0) - R @ at.mean(axis=0)
                    q[row, 3:7] = quaternion_from_rotation(R)
            if most <= allowed[row]:
                break
    return {"q": q, "distance": distance, "certified": distance <= allowed}


def laid(points: Array, target: Array) -> tuple[Array, Array]:
    """Fit points (..., P, 3) rigidly to a target (P, 3); return remaining differences (..., P, 3) and rotations."""
    centred = points - points.mean(axis=-2, keepdims=True)
    goal = target - target.mean(axis=0)
    R, _ = best_rotation(np.einsum("pi,...pj->...ij", goal, centred))
    return centred @ np.swapaxes(R, -1, -2) - goal, R
