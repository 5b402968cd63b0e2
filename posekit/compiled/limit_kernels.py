"""Soft limits as plain loops over postures, for `posekit.refinement.limits`, which has the formulas.

Arrays come as refinement has them, with the batch as their last axis.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from posekit.geometry import Array

FULL_TURN = 2.0 * math.pi

LEAST_COSINE = 0.05
"""Cosine down to which a second angle's tangent is taken as it is, as `posekit.refinement.limits.MIN_COSINE`."""


def within_half_turn(angle: Any) -> Any:
    """Return an angle less its full turns."""
    return angle - FULL_TURN * np.rint(angle / FULL_TURN)


def past(away: Any, half: Any) -> Any:
    """Return by what an angle is outside a range about zero; NaN where it is not known."""
    if away > half:
        return away - half
    if away < -half:
        return away + half
    return away - away


def least_branches(
    angles: Array,
    weight: Array,
    bounds: Array,
    branches: Array,
    away: Array,
    chosen: Array,
) -> None:
    """Write down of limbs, angles (4, M), those from the middle of their ranges in the branch that is least outside.

    Bounds are middles and halves (2, 4, M), branches are Euler branch and side of the hinge (B, 2); what is chosen is
    written as the cost, the side and the Euler branch (3, M).
    """
    for m in range(angles.shape[1]):
        best, side, euler = math.inf, 1.0, 0.0
        for k in range(4):
            away[k, m] = 0.0
        for b in range(len(branches)):
            branch, hinge = branches[b, 0], branches[b, 1]
            first, second, third = angles[0, m], angles[1, m], angles[2, m]
            if branch > 0:
                first += math.pi
                second = math.pi - second
            if (branch > 0) != (hinge < 0):
                third += math.pi
            first = within_half_turn(first - bounds[0, 0, m])
            second = within_half_turn(second - bounds[0, 1, m])
            third = within_half_turn(third - bounds[0, 2, m])
            fourth = within_half_turn(angles[3, m] * hinge - bounds[0, 3, m])
            one, three = past(first, bounds[1, 0, m]), past(third, bounds[1, 2, m])
            one = one / math.sqrt(1.0 + one * one) * weight[0, m]
            three = three / math.sqrt(1.0 + three * three) * weight[2, m]
            two = past(second, bounds[1, 1, m]) * weight[1, m]
            four = past(fourth, bounds[1, 3, m]) * weight[3, m]
            total = one * one + two * two + three * three + four * four
            if total < best:
                best, side, euler = total, hinge, branch
                away[0, m], away[1, m], away[2, m], away[3, m] = first, second, third, fourth
        chosen[0, m], chosen[1, m], chosen[2, m] = best, side, euler


def judge_balls(
    parent: Array, child: Array, bounds: Array, watch: Array, beyond: Array, over: Array, jacobian: Array
) -> Any:
    """Write down what is judged of the three angles of parts (3, 3, N) on their parents; return whether any is felt.

    Bounds are middles and halves (2, 3); `watch` is (3, N), zero where nothing is watched.
    """
    felt = False
    for n in range(parent.shape[2]):
        ux, uy, uz = child[0, 2, n], child[1, 2, n], child[2, 2, n]
        x = -(parent[0, 0, n] * ux + parent[1, 0, n] * uy + parent[2, 0, n] * uz)
        y = -(parent[0, 1, n] * ux + parent[1, 1, n] * uy + parent[2, 1, n] * uz)
        z = -(parent[0, 2, n] * ux + parent[1, 2, n] * uy + parent[2, 2, n] * uz)
        h = math.sqrt(x * x + z * z)
        sine, cosine = 0.0 if h == 0.0 else -x / h, 1.0 if h == 0.0 else -z / h
        ax = cosine * parent[0, 0, n] - sine * parent[0, 2, n]
        ay = cosine * parent[1, 0, n] - sine * parent[1, 2, n]
        az = cosine * parent[2, 0, n] - sine * parent[2, 2, n]
        fx, fy, fz = child[0, 0, n], child[1, 0, n], child[2, 0, n]
        turned = (uy * az - uz * ay) * fx + (uz * ax - ux * az) * fy + (ux * ay - uy * ax) * fz
        least = h if math.isnan(h) else max(h, LEAST_COSINE)
        square = least * least
        for k in range(3):
            angle = math.atan2(sine, cosine)
            if k == 1:
                angle = math.atan2(y, h)
            if k == 2:
                angle = math.atan2(turned, ax * fx + ay * fy + az * fz)
            away = within_half_turn(angle - bounds[0, k])
            out = past(away, bounds[1, k])
            beyond[k, n] = out
            if out == 0.0 and watch[k, n] != 0.0:
                out = away - watch[k, n] * bounds[1, k]
            over[k, n] = out
            is_felt = out != 0.0
            felt = felt or is_felt
            for i in range(3):
                left, up = parent[i, 1, n], child[i, 2, n]
                slope = (left + y * up) / square if k == 0 else (up + y * left) / square
                if k == 1:
                    slope = ax if i == 0 else ay if i == 1 else az
                jacobian[k, i, n] = slope if is_felt else 0.0
    return felt


COMPILED_TYPES = {
    "within_half_turn": "",
    "past": "",
    "least_branches": "(f8[:,::1], f8[:,::1], f8[:,:,::1], f8[:,::1], f8[:,::1], f8[:,::1])",
    "judge_balls": "(f8[:,:,::1], f8[:,:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[:,:,::1])",
}
"""The kernels, in the order in which they need each other, with the types of those that are called."""
