r"""Soft limits: how far limbs, hips and head are outside their joints' ranges, and how that changes.

Inside the limits the residual is zero; outside it is about the distance, in standard deviations, by which the
segment's direction would have to turn to be inside. An axial rotation outside by v counts
:math:`\sin\varepsilon \; v / \sqrt{1 + v^2}` at a bend of :math:`\varepsilon`: a straight limb has none to be judged,
and no direction is farther from the allowed ones than the straight limb's. Likewise the first angle of an upper segment
that points along the abduction axis.

With the angles of `posekit.body.angles` the tangents of the upper direction d are the directions in which
:math:`\alpha` and :math:`\beta` carry it, :math:`a = \partial d / \cos\beta\, \partial\alpha` and
:math:`b = \partial d / \partial\beta`; those of the lower one :math:`f = \partial / \sin\varepsilon\,\partial\gamma`
and :math:`e = \partial / \partial\varepsilon`. The other Euler branch has the same four, up to sign. Angles are written
anew here, batch last, because their sines and cosines are what the tangents are made of; the tests hold them, and what
is inside, to the closed form's.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, cross, dot
from posekit.refinement.figure_numbers import Bounds

MIN_COSINE = 0.05
"""Cosine of the second angle down to which its tangent is taken as it is in derivatives."""

LIMB_BRANCHES = ((0, 1.0), (1, 1.0), (0, -1.0), (1, -1.0))
"""Euler branch, and side of the hinge."""

Signs = NDArray[np.int8]


class Limbs(NamedTuple):
    """Angles of limbs, the first Euler branch and the hinge's positive side, and what they come from.

    Attributes
    ----------
    angles : array (4, 4, N)
        By angle and limb: alpha, beta, gamma, epsilon, radians; cos beta >= 0, epsilon >= 0.
    cosines, sines : array (4, 4, N)
        Of the angles.
    a, b : array (4, 3, N)
        Tangents of the upper direction, camera frame.
    """

    angles: Array
    cosines: Array
    sines: Array
    a: Array
    b: Array


class Outside(NamedTuple):
    """M limbs that are outside their limits, or watched.

    Attributes
    ----------
    limb, row : int array (M,)
        Which limb of the figure each one is, and in which posture of the batch.
    over : array (4, M)
        Radians above the upper limit (positive) or below the lower; watched limits that are not reached count too.
    weight : array (4, M)
        What an angle counts for.
    side, euler : array (M,)
        Of the branch that is judged.
    crossed : int array (4, M)
        1 above the upper limit, -1 below the lower, 0 inside.
    """

    limb: NDArray[np.intp]
    row: NDArray[np.intp]
    over: Array
    weight: Array
    side: Array
    euler: Array
    crossed: Signs

    def residual(self) -> Array:
        """Return what is judged of each angle (4, M), radians."""
        return _shortened(self.over) * self.weight

    def cost(self) -> Array:
        """Return the squares of what is outside (M,)."""
        return np.asarray(np.where(self.crossed != 0, self.residual() ** 2, 0.0).sum(axis=0))


def limb_angles(directions: Array, parent: Array) -> Limbs:
    """Find the angles of limbs (4, 2, 3, N) on their parents (4, 3, 3, N)."""
    upper, lower = directions[:, 0], directions[:, 1]
    x, y, z = np.einsum("likn,lin->kln", parent, upper)
    square = x * x + z * z
    h = np.sqrt(square)
    angles, cosines, sines = np.empty((3, 4, *h.shape))
    level = h > 0
    inverse = 1.0 / np.where(level, h, 1.0)
    sines[0], cosines[0] = -x * inverse, np.where(level, -z * inverse, 1.0)
    sines[1], cosines[1] = y, h
    forward, left, up = (parent[:, :, k] for k in range(3))
    a = sines[0][:, None] * up - cosines[0][:, None] * forward
    b = (sines[0] * y)[:, None] * forward + h[:, None] * left + (cosines[0] * y)[:, None] * up
    # The lower direction after alpha and beta is (-a.d, b.d, .): gamma is the angle of (a.d, -b.d).
    across_a, across_b = dot(a, lower, axis=-2), -dot(b, lower, axis=-2)
    cosines[3] = dot(upper, lower, axis=-2)
    sines[3] = np.sqrt(across_a * across_a + across_b * across_b)
    bent = sines[3] > 0
    inverse = 1.0 / np.where(bent, sines[3], 1.0)
    cosines[2], sines[2] = np.where(bent, across_a * inverse, 1.0), across_b * inverse
    np.arctan2(sines, cosines, out=angles)
    return Limbs(angles, cosines, sines, a, b)


def tangents_of(found: Limbs, upper: Array) -> Array:
    """Return the tangents a, b and f, e of limbs (4, 2, 2, 3, N), camera frame."""
    cos_g, sin_g, cos_e, sin_e = found.cosines[2], found.sines[2], found.cosines[3], found.sines[3]
    out = np.empty((4, 2, 2, 3, upper.shape[2]))
    out[:, 0, 0], out[:, 0, 1] = found.a, found.b
    out[:, 1, 0] = -sin_g[:, None] * found.a - cos_g[:, None] * found.b
    out[:, 1, 1] = (
        (cos_e * cos_g)[:, None] * found.a - (cos_e * sin_g)[:, None] * found.b - sin_e[:, None] * upper
    )
    return out


def limb_limits(
    found: Limbs, bounds: Bounds, watch: Signs | None = None, free: NDArray[np.bool_] | None = None
) -> Outside | None:
    """Judge limbs by their four angles; the branch that violates the limits least counts.

    Parameters
    ----------
    found : Limbs
        The limbs, with the angles of every branch.
    bounds : Bounds
        (4, 4).
    watch : int array (4, 4, N), optional
        By angle and limb, limits that a step would pass: 1 the upper, -1 the lower, 0 none.
    free : bool array (4, N), optional
        Limbs that are not judged.

    Returns
    -------
    Outside or None
        None where all are inside and nothing is watched.
    """
    lower, upper = bounds.lower.T[..., None], bounds.upper.T[..., None]
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    outer = (np.abs(found.angles - middle) > half).any(
        axis=0
    )  # a full turn, or another branch, may bring them inside
    if free is not None:
        outer &= ~free
    limb, row = np.nonzero(outer if watch is None else outer | (watch != 0).any(axis=0))
    if not limb.size:
        return None
    middle, half = (array[:, limb, 0] for array in (middle, half))
    angles = found.angles[:, limb, row]
    weight = np.ones_like(angles)
    weight[0], weight[2] = found.cosines[1, limb, row], found.sines[3, limb, row]
    away, best, side, euler = least_branches(angles, weight, (middle, half), possible_branches(bounds))
    beyond = _beyond(away, half)
    over, watched = beyond, np.zeros(len(limb), dtype=np.bool_)
    if watch is not None:
        sign = watch[:, limb, row]
        inside = (beyond == 0) & (sign != 0)
        over, watched = np.where(inside, away - sign * half, beyond), inside.any(axis=0)
    keep = np.flatnonzero((best > 0) | watched)
    if not keep.size:
        return None
    crossed = np.sign(beyond[:, keep]).astype(np.int8)
    return Outside(limb[keep], row[keep], over[:, keep], weight[:, keep], side[keep], euler[keep], crossed)


Branches = list[tuple[int, float]]


def least_branches(
    angles: Array, weight: Array, bounds: tuple[Array, Array], possible: Branches
) -> tuple[Array, Array, Array, Array]:
    """Find the branch in which limbs, angles (4, M), are least outside.

    Parameters
    ----------
    angles, weight : array (4, M)
        Radians, and what each counts for.
    bounds : tuple of two arrays (4, M)
        Middles and halves of the ranges.
    possible : list of tuple of int and float
        Euler branches and sides of the hinge.

    Returns
    -------
    tuple of arrays (4, M), (M,), (M,), (M,)
        Angles from the middles, the sum of squares that is outside, side and Euler branch.
    """
    middle, half = bounds
    best = np.full(angles.shape[1], np.inf)
    away, side, euler = np.zeros_like(angles), np.ones(len(best)), np.zeros(len(best))
    for branch, hinge in possible:
        other = angles.copy()
        if branch:
            other[0] += np.pi
            other[1] = np.pi - other[1]
        if branch ^ int(hinge < 0):
            other[2] += np.pi
        other[3] *= hinge
        other -= middle
        other -= FULL_TURN * np.round(other / FULL_TURN)
        total = ((_shortened(_beyond(other, half)) * weight) ** 2).sum(axis=0)
        better = total < best
        best = np.where(better, total, best)
        away = np.where(better, other, away)
        side, euler = np.where(better, hinge, side), np.where(better, branch, euler)
    return away, best, side, euler


def limb_rows(found: Limbs, out: Outside, f: Array, e: Array) -> Array:
    """Differentiate what is judged (4, 7, M): along a, b, f, e, and the parent's rotation vector (camera frame).

    `f` and `e` (M, 3) are the tangents of the lower directions.
    """
    limb, row, over = out.limb, out.row, out.over
    a, b = found.a[limb, :, row].T, found.b[limb, :, row].T
    cos_b, cos_g, cos_e = (found.cosines[k, limb, row] for k in (1, 2, 3))
    sin_b, sin_g, sin_e = (found.sines[k, limb, row] for k in (1, 2, 3))
    alpha, beta, rotation, bend = np.zeros((4, 7, len(limb)))
    alpha[0], alpha[4:] = 1.0, -b
    beta[1], beta[4:] = 1.0, a
    per_alpha = alpha / np.maximum(cos_b, MIN_COSINE)
    rotation[2], rotation[4:] = 1.0, -e.T
    rotation += per_alpha * (cos_b * cos_e * sin_g + sin_b * sin_e) + beta * (cos_e * cos_g)
    bend[3], bend[4:] = 1.0, f.T
    bend += beta * sin_g - per_alpha * (cos_b * cos_g)
    judged = _shortened(over)
    slope = (1.0 + over * over) ** -1.5
    felt = over != 0
    rows = np.empty((4, 7, len(limb)))
    rows[0] = felt[0] * (slope[0] * alpha - judged[0] * sin_b * beta)
    rows[1] = felt[1] * np.where(out.euler > 0, -1.0, 1.0) * beta
    rows[2] = felt[2] * (slope[2] * rotation + judged[2] * cos_e * bend)
    rows[3] = felt[3] * out.side * bend
    return rows


FULL_TURN = 2 * np.pi


def _beyond(away: Array, half: Array) -> Array:
    return away - np.minimum(np.maximum(away, -half), half)


def _shortened(over: Array) -> Array:
    """Return angles outside the limits as they are judged: see the module, for first angle and axial rotation."""
    out = over.copy()
    judged = out[::2]
    judged /= np.sqrt(1.0 + judged * judged)
    return out


def possible_branches(bounds: Bounds) -> list[tuple[int, float]]:
    """Return the branches into which any limb's limits reach."""
    over_the_top = (np.abs(bounds.lower[:, 1]) > np.pi / 2).any() or (
        np.abs(bounds.upper[:, 1]) > np.pi / 2
    ).any()
    either = ((bounds.upper[:, 3] > 0).any(), (bounds.lower[:, 3] < 0).any())
    return [
        (branch, hinge)
        for branch, hinge in LIMB_BRANCHES
        if (over_the_top or not branch) and either[int(hinge < 0)]
    ]


class Ball(NamedTuple):
    """What is judged of a ball joint, radians.

    Attributes
    ----------
    residual : array (3, N)
        As `Outside.over`.
    jacobian : array (3, 3, N) or None
        Along the child's rotation vector, camera frame; the parent's has the opposite sign. None where all are zero.
    crossed : int array (3, N)
        1 above the upper limit, -1 below the lower, 0 inside.
    """

    residual: Array
    jacobian: Array | None
    crossed: Signs

    def cost(self) -> Array:
        """Return the squares of what is outside (N,)."""
        return np.asarray(np.where(self.crossed != 0, self.residual**2, 0.0).sum(axis=0))


def ball_limits(parent: Array, child: Array, bounds: Bounds, watch: Signs | None = None) -> Ball:
    """Judge the three angles of a part (3, 3, N) on its parent (3, 3, N); `watch` (3, N) as for limbs."""
    up = child[:, 2]
    x, y, z = -np.einsum("ikn,in->kn", parent, up)
    h = np.sqrt(x * x + z * z)
    inverse = 1.0 / np.where(h > 0, h, 1.0)
    sin_a, cos_a = -x * inverse, np.where(h > 0, -z * inverse, 1.0)
    axis = cos_a * parent[:, 0] - sin_a * parent[:, 2]
    forward = child[:, 0]
    sine, cosine = (
        np.stack([sin_a, y, dot(cross(up, axis, axis=-2), forward, axis=-2)]),
        np.stack([cos_a, h, dot(axis, forward, axis=-2)]),
    )
    lower, upper = bounds.lower[0, :, None], bounds.upper[0, :, None]
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    away = np.arctan2(sine, cosine) - middle
    away -= FULL_TURN * np.round(away / FULL_TURN)
    beyond = _beyond(away, half)
    over = beyond
    if watch is not None:
        over = np.where((beyond == 0) & (watch != 0), away - watch * half, beyond)
    crossed = np.sign(beyond).astype(np.int8)
    felt = over != 0
    if not felt.any():
        return Ball(over, None, crossed)
    cos_b = np.maximum(h, MIN_COSINE)
    left, square = parent[:, 1], cos_b * cos_b
    jacobian = np.stack([(left + y * up) / square, axis, (up + y * left) / square])
    return Ball(over, jacobian * felt[:, None], crossed)
