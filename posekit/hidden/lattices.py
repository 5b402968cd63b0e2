"""Even, deterministic samples of circles, spheres and rotations."""

from __future__ import annotations

import math

import numpy as np

from posekit.body.frames import cross
from posekit.geometry import Array

GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
"""Radians from one point of a Fibonacci lattice to the next."""

SPIRAL_PSI = 1.533751168755204288118041
"""The root of x^4 = x + 4: it turns the second plane of the spiral of `rotations` (Alexa 2022)."""


def zone(n: int, lower: Array, upper: Array, turn: Array | float = 0.0) -> Array:
    r"""Spread n directions evenly over zones of the unit sphere.

    A Fibonacci lattice: :math:`x_i = a + (b - a)(i + 1/2)/n` along the axis, turned by the golden angle from one
    to the next. Zones of equal height have equal area (Archimedes), so each point stands for the same area.

    Parameters
    ----------
    n : int
    lower, upper : array (Z,)
        Heights a and b of each zone along its axis, between -1 and 1.
    turn : array (Z,) or float
        Radians by which each lattice is turned about its axis.

    Returns
    -------
    array (Z, n, 3)
        Unit vectors; the axis is the first coordinate.
    """
    step = (np.arange(n) + 0.5) / n
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
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def basis(axis: Array) -> Array:
    """Complete unit vectors (..., 3) to rotations (..., 3, 3) whose first column they are.

    Without a branch that jumps but for the sign of z (Duff et al. 2017).
    """
    x, y, z = axis[..., 0], axis[..., 1], axis[..., 2]
    sign = np.where(z >= 0.0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    first = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=-1)
    second = np.stack([b, sign + y * y * a, -y], axis=-1)
    return np.stack([axis, first, second], axis=-1)


def turned(axis: Array, angle: Array) -> Array:
    """Return the rotations (..., 3, 3) by an angle (...), radians, about unit vectors (..., 3) (Rodrigues)."""
    x, y, z = axis[..., 0], axis[..., 1], axis[..., 2]
    zero = np.zeros_like(x)
    K = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*x.shape, 3, 3)
    sine, cosine = np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    return np.asarray(np.eye(3) + sine * K + (1.0 - cosine) * (K @ K))


def onto(start: Array, end: Array) -> Array:
    """Return the shortest rotations (..., 3, 3) that turn unit vectors (..., 3) into others."""
    axis = cross(start, end)
    sine = np.linalg.norm(axis, axis=-1)
    cosine = np.einsum("...i,...i->...", start, end)
    safe = np.where(sine[..., None] > 0.0, axis / np.where(sine, sine, 1.0)[..., None], basis(start)[..., 1])
    return turned(safe, np.arctan2(sine, cosine))


def sphere_spacing(n: int, part: Array | float = 1.0) -> Array:
    """Return the mean distance of neighbours, radians, of n points on a part (0 to 1) of the unit sphere."""
    return np.asarray(np.sqrt(4.0 * np.pi * np.asarray(part) / n))


def rotation_spacing(n: int, part: Array | float = 1.0) -> Array:
    """Return the mean distance of neighbours, radians, of n samples of a part (0 to 1) of all rotations."""
    return np.asarray(np.cbrt(8.0 * np.pi**2 * np.asarray(part) / n))
