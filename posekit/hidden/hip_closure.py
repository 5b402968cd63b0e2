"""Where a circle of pelvis positions lets both hips reach their rays at the hips' own distance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from posekit.body import Figure
from posekit.geometry import Array, cross
from posekit.hidden.lattices import circle
from posekit.hidden.posture_rows import Index, Mask
from posekit.hidden.rays import Rays
from posekit.skeleton import HIPS, JOINT, segment_name

PELVIS_JOINT, RIGHT_HIP, LEFT_HIP = (JOINT[name] for name in HIPS)
N_BISECTIONS = 50
"""Bisections of the angle between two samples: 2^-50 of it is rounding."""


def closing_angles(
    figure: Figure, rays: Rays, frame: Index, center: Array, axis: Array, offset: Array, n: int
) -> tuple[Index, Array]:
    r"""Find the angles at which the hips, lifted from a pelvis on a circle, are as far apart as the figure's.

    The pelvis is at :math:`c + R_a(\theta)\,o`. For each of the four choices of near and far,
    :math:`g(\theta) = |r(\theta) - l(\theta)| - d` is sampled; where its sign changes, or its size has a minimum
    between samples, the root is closed in on. Where a ray goes out of reach the near and far branch of that hip
    are one: the edge of that interval is found as well and counts as a sample of both.

    Parameters
    ----------
    frame : int array (C,)
        The frame of each circle: which row of the rays.
    center, axis, offset : array (C, 3)
        Of each circle: the neck, the unit axis, and from the neck to the pelvis at angle zero; metres.
    n : int
        Samples of a circle. Two roots nearer than a sixteenth of a step may be missed.

    Returns
    -------
    which : int array (K,)
        The circle of each root.
    angle : array (K,)
        Radians.
    """
    reach = [figure.lengths[segment_name((PELVIS_JOINT, hip))] for hip in (RIGHT_HIP, LEFT_HIP)]
    apart = figure.lengths[segment_name((RIGHT_HIP, LEFT_HIP))]

    def pelvis(which: Index, angle: Array) -> Array:
        a, o = axis[which], offset[which]
        c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
        along = np.einsum("ni,ni->n", a, o)[:, None] * a
        return np.asarray(center[which] + along + (o - along) * c + cross(a, o) * s)

    def gap(which: Index, angle: Array) -> tuple[Array, Array]:
        """Return g (K, 4) of all choices, clamped where out of reach, and the slack of the worse ray (K,)."""
        start = pelvis(which, angle)
        lifts = [
            rays.lift(hip, frame[which], start, length, 0.0)
            for hip, length in zip((RIGHT_HIP, LEFT_HIP), reach, strict=True)
        ]
        right, left = (lift.points for lift in lifts)
        distance = np.linalg.norm(right[:, :, None] - left[:, None], axis=-1).reshape(-1, 4)
        slack = -np.maximum(lifts[0].excess, lifts[1].excess)
        return distance - apart, np.where(np.isnan(slack), -np.inf, slack)

    step = 2.0 * np.pi / n
    which = np.repeat(np.arange(len(center)), n + 1)
    angle = np.tile(np.append(circle(n), 2.0 * np.pi), len(center))
    value, slack = gap(which, angle)
    first = np.flatnonzero((which[1:] == which[:-1]) & (np.maximum(slack[1:], slack[:-1]) >= 0.0))
    lower, upper = angle[first].copy(), angle[first + 1].copy()
    which = which[first]
    bracket = which.copy()

    def within(at: Array) -> Mask:
        return np.asarray(gap(bracket, at)[1] >= 0.0)

    # Where one end is out of reach, draw it in to the edge of reach.
    lower = _edge(within, upper, lower, slack[first] < 0.0)
    upper = _edge(within, lower, upper, slack[first + 1] < 0.0)
    # Sixteen parts where |g| may have a minimum within: between two of the same sign, not far from zero.
    near = np.abs(np.concatenate([value[first], value[first + 1]], axis=1)).min(axis=1) < 4.0 * step
    part = np.where(near, 16, 1)
    which = np.repeat(which, part)
    low, width = np.repeat(lower, part), np.repeat((upper - lower) / part, part)
    low = low + width * (np.arange(len(low)) - np.repeat(np.cumsum(part) - part, part))
    g_low, g_high = gap(which, low)[0], gap(which, low + width)[0]
    row, choice = np.nonzero((g_low <= 0.0) != (g_high <= 0.0))
    which, low, high = which[row], low[row], (low + width)[row]
    sign = g_low[row, choice] <= 0.0
    for _ in range(N_BISECTIONS):
        half = (low + high) / 2.0
        same = (gap(which, half)[0][np.arange(len(half)), choice] <= 0.0) == sign
        low, high = np.where(same, half, low), np.where(same, high, half)
    return which, (low + high) / 2.0


def _edge(inside: Callable[[Array], Mask], good: Array, bad: Array, wanted: Mask) -> Array:
    """Move ends that are out of reach to the last angle within, in all rows where that is wanted."""
    good, end = good.copy(), bad.copy()
    for _ in range(N_BISECTIONS):
        half = (good + end) / 2.0
        ok = inside(half)
        good, end = np.where(ok, half, good), np.where(ok, end, half)
    return np.where(wanted, good, bad)
