r"""Closed-form joint angles: every branch of the decomposition, the one inside the limits taken.

A ball joint of the figure is three revolutes, :math:`R = R_y(\alpha) R_x(\beta) R_z(\gamma)` in the parent's
frame (x forward, y left, z up); a hinge below it turns about y by :math:`\varepsilon`. A limb hangs along -z,
so that its upper segment points along
:math:`R(-e_z) = (-\sin\alpha \cos\beta, \sin\beta, -\cos\alpha \cos\beta)`.

Angles here are the URDF joints' own: each is the rotation above times the sign of the joint's axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, cross, other_branch, turned_near
from posekit.geometry.rotations import TIED_ANGLES_RADIANS

FREE_ANGLE_SINE = 1e-6
"""Sine below which an angle is free: the limb is straight, or points along the abduction axis.

Turning a free angle to its limit moves the limb's end by less than this times its length.
"""

STRAIGHT_LIMB_SINE = 1e-10
"""Sine below which a limb's bend is rounding, and its axial rotation is none."""

N_LIMB_ANGLES = 4
"""Angles of a whole limb: three of its ball joint and one of its hinge."""

NEGLIGIBLE_VIOLATION_RADIANS = 1e-5
"""Radians outside the limits that are not worth turning a free angle for: under the range check's tolerance."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Signs and limits of consecutive revolutes.

    Parameters
    ----------
    sign : array (K,)
        +1 or -1: the URDF axis is sign times the coordinate axis of the formula.
    lower, upper : array (K,)
        Radians.
    """

    sign: Array
    lower: Array
    upper: Array

    def clip(self, k: int, angle: Array | float) -> Array:
        """Bring the k-th angle into its limits."""
        return np.clip(angle, self.lower[k], self.upper[k])

    def nearest_turn(self, angles: Array) -> Array:
        """Add full turns so that each angle (..., K) lies within half a turn of the middle of its limits."""
        return turned_near(angles, (self.lower + self.upper) / 2)

    def cost(self, angles: Array) -> Array:
        """Return how far outside the limits branches (..., K) are, radians, to choose among them.

        Of a whole limb (K = 4) the axial rotation counts by how far it turns the lower segment: little, where
        the limb is almost straight.
        """
        outside = np.maximum(np.maximum(self.lower - angles, angles - self.upper), 0.0)
        if len(self.sign) == N_LIMB_ANGLES:
            outside[..., 2] *= np.abs(np.sin(angles[..., 3]))
        return np.asarray(outside.max(axis=-1))

    def violation(self, angles: Array) -> Array:
        """Return how far the worst of the angles (..., K) is outside its limits, radians; 0 inside."""
        outside = np.maximum(self.lower - angles, angles - self.upper)
        worst: Array = np.maximum(outside, 0.0).max(axis=-1)
        return worst


def ball_angles(R: Array, limits: Limits) -> Array:
    """Decompose rotations (N, 3, 3) of a part in its parent's frame into three angles (N, 3), radians.

    Both Euler branches are tried; the one inside the limits is taken, else the one that violates them least.
    """
    branches = _direction_branches(-R[:, :, 2])
    candidates = []
    for k in range(2):
        alpha, beta = branches[:, k, 0], branches[:, k, 1]
        # From what is left after alpha and beta: where alpha is free (beta = +-90 deg), gamma makes up for it.
        left = _into_ball(R[:, :, 0], alpha, beta)
        candidates.append(np.stack([alpha, beta, np.arctan2(left[:, 1], left[:, 0])], axis=-1))
    return _least_violating(np.stack(candidates, axis=1) * limits.sign, limits)


def direction_angles(upper: Array, limits: Limits) -> Array:
    """Find the first two angles (N, 2) of a ball joint from its limb's direction (N, 3), parent's frame.

    The axial rotation is left free: with only the upper segment known, nothing constrains it.
    """
    two = Limits(sign=limits.sign[:2], lower=limits.lower[:2], upper=limits.upper[:2])
    angles = _least_violating(_direction_branches(upper) * two.sign, two)
    angles[:, 0] = np.where(_along_abduction_axis(upper), two.clip(0, angles[:, 0]), angles[:, 0])
    return angles


def limb_angles(upper: Array, lower: Array, limits: Limits) -> Array:
    r"""Find the four angles of a ball joint and the hinge below it.

    Two Euler branches times two signs of the hinge are tried. Where the limb is straight the axial rotation
    is free, and where the upper segment lies along the abduction axis the first angle is: where none of the
    four is inside the limits, the free angles are used to bring one inside.

    Parameters
    ----------
    upper, lower : array (N, 3)
        Unit directions of the two segments in the parent's frame.
    limits : Limits
        Of the four revolutes: ball joint, then hinge.

    Returns
    -------
    array (N, 4)
        Radians; NaN where a direction is NaN.
    """
    branches = _direction_branches(upper)
    candidates = []
    for k in range(2):
        alpha, beta = branches[:, k, 0], branches[:, k, 1]
        local = _into_ball(lower, alpha, beta)
        candidates += [_hinge_branch(local, alpha, beta, side, limits) for side in (1.0, -1.0)]
    angles = _least_violating(np.stack(candidates, axis=1), limits)
    free = _along_abduction_axis(upper) | _along(upper, lower)
    free &= limits.violation(angles) > NEGLIGIBLE_VIOLATION_RADIANS
    if free.any():
        angles[free] = _turn_free_angles(upper[free], lower[free], angles[free], limits)
    return angles


def _hinge_branch(local: Array, alpha: Array, beta: Array, side: float, limits: Limits) -> Array:
    """Return the four angles (N, 4) for one sign of the hinge; `local` is the lower segment after two turns."""
    across = np.hypot(local[:, 0], local[:, 1])
    gamma = np.where(across < STRAIGHT_LIMB_SINE, 0.0, np.arctan2(-side * local[:, 1], -side * local[:, 0]))
    epsilon = side * np.arctan2(across, -local[:, 2])
    return limits.nearest_turn(np.stack([alpha, beta, gamma, epsilon], axis=-1) * limits.sign)


def _turn_free_angles(upper: Array, lower: Array, angles: Array, limits: Limits) -> Array:
    r"""Bring limbs (N) inside their limits by their free angles, where that helps.

    A straight limb's axial rotation is put into its limits. At beta = +-90 deg,
    :math:`R_y(\alpha) R_x(\beta) R_z(\gamma)` depends on :math:`\gamma \mp \alpha` alone: if both can be inside
    their limits, then also with one of the two at a limit, or with alpha at zero.
    """
    branches, pinned, straight = (
        _direction_branches(upper),
        _along_abduction_axis(upper),
        _along(upper, lower),
    )
    sign, low, high = limits.sign, limits.lower, limits.upper
    candidates = [angles]
    for k in range(2):
        beta = branches[:, k, 1]
        at_zero = _into_ball(lower, np.zeros(len(beta)), beta)
        for side in (1.0, -1.0):
            gamma = np.arctan2(-side * at_zero[:, 1], -side * at_zero[:, 0])
            turned = [sign[0] * limits.clip(0, 0.0), sign[0] * low[0], sign[0] * high[0]]
            turned += [np.sign(np.sin(beta)) * (sign[2] * bound - gamma) for bound in (low[2], high[2])]
            for alpha in (branches[:, k, 0], *(np.where(pinned, alpha, np.nan) for alpha in turned)):
                branch = _hinge_branch(_into_ball(lower, alpha, beta), alpha, beta, side, limits)
                branch[:, 2] = np.where(straight, limits.clip(2, branch[:, 2]), branch[:, 2])
                candidates.append(branch)
    return _least_violating(np.stack(candidates, axis=1), limits)


def _along(upper: Array, lower: Array) -> NDArray[np.bool_]:
    """Return where two directions (N, 3) lie on one line: a straight or folded limb."""
    return np.asarray(np.linalg.norm(cross(upper, lower), axis=-1) < FREE_ANGLE_SINE)


def _along_abduction_axis(upper: Array) -> NDArray[np.bool_]:
    """Return where a direction (N, 3) leaves the first angle free."""
    return np.asarray(np.hypot(upper[:, 0], upper[:, 2]) < FREE_ANGLE_SINE)


def _direction_branches(upper: Array) -> Array:
    """Return both (alpha, beta) of a direction, (N, 2, 2)."""
    alpha = np.arctan2(-upper[:, 0], -upper[:, 2])
    beta = np.arctan2(upper[:, 1], np.hypot(upper[:, 0], upper[:, 2]))
    first = np.stack([alpha, beta], axis=-1)
    return np.stack([first, other_branch(first)], axis=1)


def _into_ball(lower: Array, alpha: Array, beta: Array) -> Array:
    """Turn directions into the frame reached after alpha and beta: (R_y(alpha) R_x(beta))^T lower."""
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    x, y, z = lower[:, 0], lower[:, 1], lower[:, 2]
    forward = sa * x + ca * z
    return np.stack([ca * x - sa * z, cb * y + sb * forward, -sb * y + cb * forward], axis=-1)


def _least_violating(candidates: Array, limits: Limits) -> Array:
    """Choose among branches (N, B, K) the one that violates the limits least, of those that tie the first."""
    angles = limits.nearest_turn(candidates)
    violation = limits.cost(angles)
    violation = np.where(np.isnan(violation), np.inf, violation)
    least = violation.min(axis=1, keepdims=True)
    best = np.argmax(violation <= least + np.where(least > 0, TIED_ANGLES_RADIANS, 0.0), axis=1)
    return np.take_along_axis(angles, best[:, None, None], axis=1)[:, 0]
