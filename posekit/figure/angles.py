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

from posekit.cameras import Array

FREE = 1e-6
"""Sine below which an angle is free: the limb is straight, or points along the abduction axis.

Turning a free angle to its limit moves the limb's end by less than this times its length.
"""

WORTH = 1e-5
"""Radians by which turning the free first angle must bring a limb nearer its limits, else it stays as it is."""


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
        middle = (self.lower + self.upper) / 2
        turn = 2 * np.pi
        return middle + np.mod(angles - middle + np.pi, turn) - np.pi

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
    branches = _direction_branches(upper)
    pinned = _along_abduction_axis(upper)
    if pinned.any():
        turned = branches.copy()
        turned[:, :, 0] = np.where(pinned, two.sign[0] * two.clip(0, 0.0), np.nan)[:, None]
        branches = np.concatenate([branches, turned], axis=1)
    return _least_violating(branches * two.sign, two, as_they_are=2)


def limb_angles(upper: Array, lower: Array, limits: Limits) -> Array:
    r"""Find the four angles of a ball joint and the hinge below it.

    Two Euler branches times two signs of the hinge are tried. Where the limb is straight the axial rotation
    is free, and taken nearest to zero inside its limits; where the upper segment lies along the abduction
    axis the first angle is free, and is used to bring the axial rotation inside.

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
        candidates += _hinge_branches(lower, branches[:, k, 0], branches[:, k, 1], limits)
    as_they_are = len(candidates)
    pinned = _along_abduction_axis(upper)
    if pinned.any():
        for k in range(2):
            beta = branches[:, k, 1]
            alpha = np.where(pinned, _free_alpha(lower, beta, limits), np.nan)
            candidates += _hinge_branches(lower, alpha, beta, limits)
    return _least_violating(np.stack(candidates, axis=1), limits, as_they_are=as_they_are)


def _hinge_branches(lower: Array, alpha: Array, beta: Array, limits: Limits) -> list[Array]:
    """Return the four angles (N, 4) of a limb for each sign of its hinge, given the first two."""
    local = _into_ball(lower, alpha, beta)
    bend = np.arctan2(np.hypot(local[:, 0], local[:, 1]), -local[:, 2])
    straight = np.sin(bend) < FREE
    branches = []
    for side in (1.0, -1.0):
        gamma = np.arctan2(-side * local[:, 1], -side * local[:, 0])
        angles = limits.nearest_turn(np.stack([alpha, beta, gamma, side * bend], axis=-1) * limits.sign)
        # A straight limb's axial rotation is noise unless it lies inside the limits as it is.
        angles[:, 2] = np.where(straight, limits.clip(2, angles[:, 2]), angles[:, 2])
        branches.append(angles)
    return branches


def _along_abduction_axis(upper: Array) -> NDArray[np.bool_]:
    """Return where a direction (N, 3) leaves the first angle free."""
    free: NDArray[np.bool_] = np.hypot(upper[:, 0], upper[:, 2]) < FREE
    return free


def _direction_branches(upper: Array) -> Array:
    """Return both (alpha, beta) of a direction, (N, 2, 2)."""
    alpha = np.arctan2(-upper[:, 0], -upper[:, 2])
    beta = np.arctan2(upper[:, 1], np.hypot(upper[:, 0], upper[:, 2]))
    first = np.stack([alpha, beta], axis=-1)
    second = np.stack([alpha + np.pi, np.pi - beta], axis=-1)
    return np.stack([first, second], axis=1)


def _into_ball(lower: Array, alpha: Array, beta: Array) -> Array:
    """Turn directions into the frame reached after alpha and beta: (R_y(alpha) R_x(beta))^T lower."""
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    x, y, z = lower[:, 0], lower[:, 1], lower[:, 2]
    forward = sa * x + ca * z
    return np.stack([ca * x - sa * z, cb * y + sb * forward, -sb * y + cb * forward], axis=-1)


def _free_alpha(lower: Array, beta: Array, limits: Limits) -> Array:
    """Use the free first angle, else zero, to bring the axial rotation inside its limits.

    At beta = +-90 deg, R_y(alpha) R_x(beta) R_z(gamma) depends on gamma -+ alpha alone.
    """
    alpha = np.full(len(beta), limits.sign[0] * limits.clip(0, 0.0))
    local = _into_ball(lower, alpha, beta)
    side = limits.sign[3] * np.sign(limits.lower[3] + limits.upper[3])
    gamma = np.arctan2(-side * local[:, 1], -side * local[:, 0])
    gamma = limits.nearest_turn(np.stack([alpha, beta, gamma, alpha], axis=-1) * limits.sign)[:, 2]
    correction = (limits.clip(2, gamma) - gamma) * limits.sign[2]
    moved = alpha + np.sign(np.sin(beta)) * correction
    return limits.sign[0] * limits.clip(0, limits.sign[0] * moved)


def _least_violating(candidates: Array, limits: Limits, *, as_they_are: int | None = None) -> Array:
    """Choose among branches (N, B, K) the one that violates the limits least; the first of equals.

    Those after the first `as_they_are` have a free angle turned, and must be better by `WORTH`.
    """
    angles = limits.nearest_turn(candidates)
    violation = limits.violation(angles)
    if as_they_are is not None:
        violation[:, as_they_are:] += WORTH
    best = np.argmin(np.where(np.isnan(violation), np.inf, violation), axis=1)
    return np.take_along_axis(angles, best[:, None, None], axis=1)[:, 0]
