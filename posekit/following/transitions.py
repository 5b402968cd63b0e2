r"""What it costs to go from the ends of paths to the survivors of the next frame: all pairs.

A vector of three coordinates with :math:`\nu` degrees of freedom and the scale matrix S has
:math:`-\log p = \tfrac{\nu + 3}{2} \log(1 + x^T S^{-1} x / \nu) + \tfrac12 \log |S|` plus a constant (Lange, Little &
Taylor 1989, "Robust statistical modeling using the t distribution", J. Am. Stat. Assoc. 84:881-896). The constant is
taken so that a joint that is where its motion takes it, all of which was known exactly when it was last seen, costs
nothing: no cost is negative, and one that was out of sight for long is not dearer for it.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.following.channels import N_JOINTS
from posekit.following.kalman import MovingJoints, density_of
from posekit.following.motion_model import MotionModel
from posekit.geometry import Array

MISSING_JOINT_COST: Final = 5.0
"""Cost of each joint that a survivor does not know and another of its frame does.

Without it a survivor would be the cheaper the less of it is known, since unknown joints make no steps.
"""

USUAL_INTERVAL_SECONDS: Final = 1 / 30
"""Seconds: for this step it is asked what noise makes it cost."""

PREDICTED_DEVIATIONS: Final = 2.0
"""How much larger than the acceleration's own the variance of a predicted place is, where points are exact."""


def step_costs(
    ends: MovingJoints, to: MovingJoints, seconds: float, model: MotionModel, *, weight: float
) -> Array:
    """Return what it costs to find survivors (N) where the motion of ends (S) leads: (S, N), infinite beyond the walls.

    Parameters
    ----------
    ends : MovingJoints
        As they were, `seconds` ago.
    to : MovingJoints
        The survivors.
    seconds : float
        Since the last frame.
    model : MotionModel
        What steps cost.
    weight : float
        What they count.
    """
    density = density_of(model.acceleration)
    led = ends.after(seconds, density)
    spread = [np.sqrt(np.trace(each.of_place, axis1=2, axis2=3)) for each in (ends, to)]
    cost = np.zeros((len(ends), len(to)))
    # Sums of logarithms are logarithms of products: of seven joints, so that they stay finite.
    for joints in (range(N_JOINTS // 2), range(N_JOINTS // 2, N_JOINTS)):
        wide, far = np.ones_like(cost), np.ones_like(cost)
        for j in joints:
            both = ends.known[:, j, None] & to.known[None, :, j]
            if not both.any():
                continue
            x = to.place[None, :, j] - led.place[:, None, j]
            S = led.of_place[:, None, j] + to.of_place[None, :, j]
            distance, size = _distance(
                x, S, density[j] * np.where(ends.known, led.since, 1.0)[:, j, None] ** 3 / 3
            )
            wide *= np.where(both, size, 1.0)
            far *= 1.0 + np.where(both, distance, 0.0) / model.nu
            moved = ((to.place[None, :, j] - ends.place[:, None, j]) ** 2).sum(axis=-1)
            reach = np.asarray(model.max_speed)[j] * led.since[:, j, None]
            reach = reach + model.spread * (spread[0][:, j, None] + spread[1][None, :, j])
            # At the wall itself rounding must not decide.
            cost[both & (moved > reach * reach * (1 + 1e-12) + 1e-12)] = np.inf
        cost += weight * ((model.nu + 3) / 2 * np.log(far) + 0.5 * np.log(wide))
    return cost


def _distance(x: Array, S: Array, scale: Array) -> tuple[Array, Array]:
    """Return x^T S^-1 x, and the determinant of S over scale cubed: no matrix is inverted."""
    a, d, f = S[..., 0, 0], S[..., 1, 1], S[..., 2, 2]
    b, c, e = S[..., 0, 1], S[..., 0, 2], S[..., 1, 2]
    A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
    size = a * A + b * B + c * C
    X, Y, Z = x[..., 0], x[..., 1], x[..., 2]
    own = A * X * X + (a * f - c * c) * Y * Y + (a * d - b * b) * Z * Z
    mixed = B * X * Y + C * X * Z + (b * c - a * e) * Y * Z
    return (own + 2 * mixed) / size, np.maximum(size / scale**3, 1.0)


def passing_cost(noise: Array, known: NDArray[np.bool_], model: MotionModel, *, weight: float) -> float:
    """Return what it costs to pass over a frame.

    That is `skip`, and what a step between two that are as noisy as its likeliest survivor costs on average.

    Parameters
    ----------
    noise : array (14, 3, 3)
        The covariance of each joint, square metres.
    known : bool array (14,)
        Which joints are.
    model : MotionModel
        What steps cost.
    weight : float
        What they count.
    """
    scale = density_of(model.acceleration) * USUAL_INTERVAL_SECONDS**3 / 3
    wide = np.log(np.linalg.det(PREDICTED_DEVIATIONS * (np.eye(3) + noise / scale[:, None, None])))
    return float(model.skip + weight * (_typical(model.nu) + 0.5 * wide)[known].sum())


def _typical(nu: float) -> float:
    """Return the mean of the Student term of three coordinates: nu + 3 over 2 times a difference of digammas."""
    return (nu + 3) / 2 * (_digamma((nu + 3) / 2) - _digamma(nu / 2))


def _digamma(x: float) -> float:
    step = 1e-4 * x
    return (math.lgamma(x + step) - math.lgamma(x - step)) / (2 * step)


def absence(known: NDArray[np.bool_]) -> Array:
    """Charge survivors (N, 14) for what others of their frame know."""
    return np.asarray(MISSING_JOINT_COST * (known.any(axis=0) & ~known).sum(axis=1))
