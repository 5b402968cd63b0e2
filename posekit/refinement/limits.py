r"""Soft limits: how far limbs, hips and head are outside their joints' ranges, and how that changes.

Inside the limits the residual is zero; outside it is the distance, in standard deviations, by which the segment's
direction would have to turn to be inside. An axial rotation outside by v costs no more than
:math:`\sin\varepsilon \sin v` of the lower segment, at a bend of :math:`\varepsilon`: a straight limb has none to be
judged. Likewise the first angle of an upper segment that points along the abduction axis.

With the angles of `posekit.figure.angles` the tangents of the upper direction d are the directions in which
:math:`\alpha` and :math:`\beta` carry it, :math:`a = \partial d / \cos\beta\, \partial\alpha` and
:math:`b = \partial d / \partial\beta`; those of the lower one :math:`f = \partial / \sin\varepsilon\,\partial\gamma`
and :math:`e = \partial / \partial\varepsilon`. The other Euler branch has the same four, up to sign.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.refinement.anatomy import Bounds
from posekit.refinement.small import cross, dot

LEAST = 0.05
"""Cosine of the second angle down to which its tangent is taken as it is in derivatives."""

BRANCHES = ((0, 1.0), (1, 1.0), (0, -1.0), (1, -1.0))
"""Euler branch, and side of the hinge."""


class Limbs(NamedTuple):
    """Directions of limbs and their tangents; the four angles of the first branch.

    Attributes
    ----------
    tangents : array (4, 2, 2, 3, N)
        Of upper and lower segment, camera frame: a, b and f, e.
    angles : array (4, 4, N)
        By limb: alpha, beta, gamma, epsilon, radians; cos beta >= 0, epsilon >= 0.
    cos_beta, sin_bend, cos_bend : array (4, N)
    """

    tangents: Array
    angles: Array
    cos_beta: Array
    sin_bend: Array
    cos_bend: Array


class Active(NamedTuple):
    """Residuals of M limbs that are outside their limits.

    Attributes
    ----------
    limb, row : int array (M,)
    residual : array (4, M)
    jacobian : array (4, 7, M)
        Along a, b, f, e, and the parent's rotation vector (camera frame).
    crossed : int array (4, M)
        1 above the upper limit, -1 below the lower, 0 inside.
    """

    limb: NDArray[np.intp]
    row: NDArray[np.intp]
    residual: Array
    jacobian: Array
    crossed: NDArray[np.int8]


def limbs(directions: Array, parent: Array) -> Limbs:
    """Find tangents and angles of limbs (4, 2, 3, N) on their parents (4, 3, 3, N)."""
    upper, lower = directions[:, 0], directions[:, 1]
    x, y, z = (dot(parent[:, :, k], upper) for k in range(3))
    h = np.hypot(x, z)
    level = h > 0
    safe = np.where(level, h, 1.0)
    sin_a, cos_a = np.where(level, -x / safe, 0.0), np.where(level, -z / safe, 1.0)
    tangents = np.empty((4, 2, 2, 3, upper.shape[2]))
    a, b = tangents[:, 0, 0], tangents[:, 0, 1]
    forward, left, up = parent[:, :, 0], parent[:, :, 1], parent[:, :, 2]
    a[...] = sin_a[:, None] * up - cos_a[:, None] * forward
    b[...] = (sin_a * y)[:, None] * forward + h[:, None] * left + (cos_a * y)[:, None] * up
    across_a, across_b, cos_e = dot(a, lower), dot(b, lower), dot(upper, lower)
    sin_e = np.hypot(across_a, across_b)
    bent = sin_e > 0
    safe = np.where(bent, sin_e, 1.0)
    # The lower direction after alpha and beta is (-a.d, b.d, .): gamma is the angle of (a.d, -b.d).
    cos_g, sin_g = np.where(bent, across_a / safe, 1.0), np.where(bent, -across_b / safe, 0.0)
    tangents[:, 1, 0] = -sin_g[:, None] * a - cos_g[:, None] * b
    tangents[:, 1, 1] = (cos_e * cos_g)[:, None] * a - (cos_e * sin_g)[:, None] * b - sin_e[:, None] * upper
    angles = np.stack(
        [np.arctan2(sin_a, cos_a), np.arctan2(y, h), np.arctan2(sin_g, cos_g), np.arctan2(sin_e, cos_e)], axis=1
    )
    return Limbs(tangents, angles, h, sin_e, cos_e)


def outside(angles: Array, bounds: Bounds) -> Array:
    """Return by how much angles (B, K, N) are above (positive) or below their limits, to the nearer turn."""
    lower, upper = bounds.lower[..., None], bounds.upper[..., None]
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    away = angles - middle
    away -= 2 * np.pi * np.round(away / (2 * np.pi))
    return away - np.clip(away, -half, half)


def limb_residuals(
    found: Limbs, bounds: Bounds, deviation: float, watch: NDArray[np.int8] | None = None
) -> tuple[Array, Active | None]:
    """Judge limbs by their four angles; the branch that violates the limits least counts.

    Parameters
    ----------
    found : Limbs
    bounds : Bounds
        (4, 4).
    deviation : float
        Radians.
    watch : int array (4, 4, N), optional
        By limb and angle, limits that a step would pass: 1 the upper, -1 the lower, 0 none. Their residuals are
        negative inside, and do not count in the cost.

    Returns
    -------
    cost : array (N,)
        Sum of squared residuals.
    active : Active or None
        The limbs that are outside or watched; None where there are none.
    """
    cost: Array = np.zeros(found.angles.shape[2])
    outer = outside(found.angles, bounds).any(axis=1)
    limb, row = np.nonzero(outer if watch is None else outer | watch.any(axis=1))
    if not limb.size:
        return cost, None
    lower, upper = bounds.lower[limb].T, bounds.upper[limb].T
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    angles = found.angles[limb, :, row].T
    weight = np.ones_like(angles)
    weight[0], weight[2] = found.cos_beta[limb, row], found.sin_bend[limb, row]
    best = np.full(len(limb), np.inf)
    away, side, euler = np.zeros_like(angles), np.ones(len(limb)), np.zeros(len(limb))
    for branch, hinge in BRANCHES:
        if not _possible(bounds, branch, hinge):
            continue
        other = angles.copy()
        if branch:
            other[0] += np.pi
            other[1] = np.pi - other[1]
        if branch ^ int(hinge < 0):
            other[2] += np.pi
        other[3] *= hinge
        other -= middle
        other -= 2 * np.pi * np.round(other / (2 * np.pi))
        beyond = other - np.clip(other, -half, half)
        total = ((_shortened(beyond) * weight) ** 2).sum(axis=0)
        better = total < best
        best = np.where(better, total, best)
        away = np.where(better, other, away)
        side, euler = np.where(better, hinge, side), np.where(better, branch, euler)
    beyond = away - np.clip(away, -half, half)
    over, watched = beyond, np.zeros(len(limb), dtype=np.bool_)
    if watch is not None:
        sign = watch[limb, :, row].T
        inside = (beyond == 0) & (sign != 0)
        over, watched = np.where(inside, away - sign * half, beyond), inside.any(axis=0)
    keep = (best > 0) | watched
    if not keep.any():
        return cost, None
    limb, row, over, beyond, weight = limb[keep], row[keep], over[:, keep], beyond[:, keep], weight[:, keep]
    side, euler = side[keep], euler[keep]
    residual = _shortened(over) * weight / deviation
    np.add.at(cost, row, np.where(beyond != 0, residual * residual, 0.0).sum(axis=0))
    crossed = np.sign(beyond).astype(np.int8)
    return cost, Active(limb, row, residual, _rows(found, limb, row, over, side, euler) / deviation, crossed)


def _shortened(over: Array) -> Array:
    """Return angles outside the limits as they are judged: the sines of first angle and axial rotation."""
    out = over.copy()
    out[[0, 2]] = np.sin(np.clip(over[[0, 2]], -np.pi / 2, np.pi / 2))
    return out


def _rows(found: Limbs, limb: NDArray[np.intp], row: NDArray[np.intp], over: Array, side: Array, euler: Array) -> Array:
    """Differentiate the residuals, in radians (4, 7, M)."""
    tangents = found.tangents[limb, :, :, :, row]
    (a, b), (f, e) = (tangents[:, k].transpose(1, 2, 0) for k in range(2))
    cos_b, sin_b = found.cos_beta[limb, row], np.sin(found.angles[limb, 1, row])
    gamma = found.angles[limb, 2, row]
    cos_g, sin_g = np.cos(gamma), np.sin(gamma)
    sin_e, cos_e = found.sin_bend[limb, row], found.cos_bend[limb, row]
    m = len(limb)
    alpha, beta, rotation, bend = np.zeros((4, 7, m))
    alpha[0], alpha[4:] = 1.0, -b
    beta[1], beta[4:] = 1.0, a
    per_alpha = alpha / np.maximum(cos_b, LEAST)
    rotation[2], rotation[4:] = 1.0, -e
    rotation += per_alpha * (cos_b * cos_e * sin_g + sin_b * sin_e) + beta * (cos_e * cos_g)
    bend[3], bend[4:] = 1.0, f
    bend += beta * sin_g - per_alpha * (cos_b * cos_g)
    out = np.zeros((4, 7, m))
    near = np.abs(over) < np.pi / 2
    sine, cosine = np.sin(np.clip(over, -np.pi / 2, np.pi / 2)), np.where(near, np.cos(over), 0.0)
    outside_of = over != 0
    out[0] = outside_of[0] * (cosine[0] * alpha - sine[0] * sin_b * beta)
    out[1] = outside_of[1] * np.where(euler > 0, -1.0, 1.0) * beta
    out[2] = outside_of[2] * (cosine[2] * rotation + sine[2] * cos_e * bend)
    out[3] = outside_of[3] * side * bend
    return out


def _possible(bounds: Bounds, branch: int, hinge: float) -> bool:
    """Return whether any limb's limits reach into a branch."""
    if branch and not (np.abs(bounds.lower[:, 1]) > np.pi / 2).any() and not (bounds.upper[:, 1] > np.pi / 2).any():
        return False
    return bool((bounds.upper[:, 3] > 0).any() if hinge > 0 else (bounds.lower[:, 3] < 0).any())


class Ball(NamedTuple):
    """Residuals of a ball joint, and how they change with its parent's and its own rotation vector.

    Attributes
    ----------
    residual : array (3, N)
    jacobian : array (3, 3, N) or None
        Along the child's rotation vector, camera frame; the parent's has the opposite sign. None where all are zero.
    crossed : int array (3, N)
        1 above the upper limit, -1 below the lower, 0 inside.
    """

    residual: Array
    jacobian: Array | None
    crossed: NDArray[np.int8]

    @property
    def cost(self) -> Array:
        """Sum of squared residuals of what is outside (N,)."""
        return np.asarray(np.where(self.crossed != 0, self.residual**2, 0.0).sum(axis=0))


def ball_residuals(
    parent: Array, child: Array, bounds: Bounds, deviation: float, watch: NDArray[np.int8] | None = None
) -> Ball:
    """Judge the three angles of a part (3, 3, N) on its parent (3, 3, N); `watch` (3, N) as for limbs."""
    up = child[:, 2]
    x, y, z = (-dot(parent[:, k], up) for k in range(3))
    h = np.hypot(x, z)
    safe = np.where(h > 0, h, 1.0)
    sin_a, cos_a = np.where(h > 0, -x / safe, 0.0), np.where(h > 0, -z / safe, 1.0)
    axis = cos_a * parent[:, 0] - sin_a * parent[:, 2]
    side = cross(up, axis)
    gamma = np.arctan2(dot(side, child[:, 0]), dot(axis, child[:, 0]))
    angles = np.stack([np.arctan2(sin_a, cos_a), np.arctan2(y, h), gamma])
    beyond = outside(angles[None], bounds)[0]
    over = beyond
    if watch is not None:
        lower, upper = bounds.lower[0, :, None], bounds.upper[0, :, None]
        over = np.where((beyond == 0) & (watch != 0), angles - np.where(watch > 0, upper, lower), beyond)
    active = over != 0
    if not active.any():
        return Ball(over, None, beyond.astype(np.int8))
    cos_b = np.maximum(h, LEAST)
    left = parent[:, 1]
    square = cos_b * cos_b
    jacobian = np.stack([(left + y * up) / square, axis, (up + y * left) / square])
    return Ball(over / deviation, jacobian * active[:, None] / deviation, np.sign(beyond).astype(np.int8))
