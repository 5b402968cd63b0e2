"""Even, deterministic samples of circles, spheres and rotations."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from posekit.geometry import Array, rotation_from_quaternion

GOLDEN_RATIO = 0.6180339887498949
"""Less one: shifts lattices between each other."""

GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
"""Radians from one point of a Fibonacci lattice to the next."""

SPIRAL_PSI = 1.533751168755204288118041
"""The root of x^4 = x + 4: it turns the second plane of the spiral of `rotations` (Alexa 2022)."""


def zone(n: int, lower: Array, upper: Array, turn: Array | float = 0.0, phase: Array | float = 0.5) -> Array:
    r"""Spread n directions evenly over zones of the unit sphere.

    A Fibonacci lattice: :math:`x_i = a + (b - a)(i + 1/2)/n` along the axis, turned by the golden angle from one
    to the next. Zones of equal height have equal area (Archimedes), so each point stands for the same area.

    Parameters
    ----------
    n : int
        How many directions each zone gets.
    lower, upper : array (Z,)
        Heights a and b of each zone along its axis, between -1 and 1.
    turn : array (Z,) or float
        Radians by which each lattice is turned about its axis.
    phase : array (Z,) or float
        Between 0 and 1, where in its own slice each direction is: lattices of other phases lie between each other.

    Returns
    -------
    array (Z, n, 3)
        Unit vectors; the axis is the first coordinate.
    """
    step = (np.arange(n) + np.broadcast_to(np.asarray(phase), (len(lower),))[:, None]) / n
    x = lower[:, None] + (upper - lower)[:, None] * step
    across = np.sqrt(np.maximum(1.0 - x * x, 0.0))
    angle = np.arange(n) * GOLDEN_ANGLE + np.broadcast_to(np.asarray(turn), (len(lower),))[:, None]
    return np.stack([x, across * np.cos(angle), across * np.sin(angle)], axis=-1)


def circle(n: int) -> Array:
    """Spread n angles evenly over a full turn (n,), radians."""
    return 2.0 * np.pi * np.arange(n) / n


def rotations(n: int) -> Array:
    """Spread n rotations evenly over all there are (n, 3, 3): super-Fibonacci spirals (Alexa 2022)."""
    s = np.arange(n) + 0.5
    near, far = np.sqrt(s / n), np.sqrt(1.0 - s / n)
    alpha, beta = 2.0 * np.pi * s / math.sqrt(2.0), 2.0 * np.pi * s / SPIRAL_PSI
    x, y, z, w = near * np.sin(alpha), near * np.cos(alpha), far * np.sin(beta), far * np.cos(beta)
    return rotation_from_quaternion(np.stack([x, y, z, w], axis=-1))


def sphere_spacing(n: ArrayLike, part: Array | float = 1.0) -> Array:
    """Return the mean distance of neighbours, radians, of n points on a part (0 to 1) of the unit sphere."""
    return np.asarray(np.sqrt(4.0 * np.pi * np.asarray(part) / np.asarray(n)))


def rotation_spacing(n: int, part: Array | float = 1.0) -> Array:
    """Return the mean distance of neighbours, radians, of n samples of a part (0 to 1) of all rotations."""
    return np.asarray(np.cbrt(8.0 * np.pi**2 * np.asarray(part) / n))
