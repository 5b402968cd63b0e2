"""How far capsules are from each other as plain loops: the formulas are `posekit.validators.collision`'s."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from posekit.geometry import Array


def clamp(value: Any) -> Any:
    """Bring a value into [-1, 1]."""
    return min(max(value, -1.0), 1.0)


def mean(w: Array, first: int, count: int) -> Any:
    """Return the mean of some points."""
    x, y, z = 0.0, 0.0, 0.0
    for i in range(3 * first, 3 * (first + count), 3):
        x += w[i]
        y += w[i + 1]
        z += w[i + 2]
    return x / count, y / count, z / count


def apart(
    gx: Any, gy: Any, gz: Any, ax: Any, ay: Any, az: Any, s: Any, bx: Any, by: Any, bz: Any, t: Any
) -> Any:
    """Return the squared distance between s on the one segment and t on the other."""
    x, y, z = gx + t * bx - s * ax, gy + t * by - s * ay, gz + t * bz - s * az
    return x * x + y * y + z * z


def least_apart(gx: Any, gy: Any, gz: Any, ax: Any, ay: Any, az: Any, bx: Any, by: Any, bz: Any) -> Any:
    """Return the squared distance between two segments: see `posekit.validators.collision.segment_distance`.

    From the middle of the one to that of the other (g), and from each middle to one end (a, b).
    """
    aa, bb = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz
    ab = ax * bx + ay * by + az * bz
    ag, bg = ax * gx + ay * gy + az * gz, bx * gx + by * gy + bz * gz
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    determinant = nx * nx + ny * ny + nz * nz
    s = 0.0
    if determinant > 1e-30 * aa * bb:
        mx, my, mz = gy * bz - gz * by, gz * bx - gx * bz, gx * by - gy * bx
        s = clamp((nx * mx + ny * my + nz * mz) / determinant)
    t = clamp((s * ab - bg) / bb)
    least = apart(gx, gy, gz, ax, ay, az, clamp((ag + t * ab) / aa), bx, by, bz, t)
    for end in (-1.0, 1.0):
        least = min(least, apart(gx, gy, gz, ax, ay, az, clamp((ag + end * ab) / aa), bx, by, bz, end))
        least = min(least, apart(gx, gy, gz, ax, ay, az, end, bx, by, bz, clamp((end * ab - bg) / bb)))
    return least


def axis_distances(points: Array, numbers: Array, distance: Array) -> None:
    """Measure the axes of two capsules in many postures.

    Parameters
    ----------
    points : array (N, P, 3)
        The points that place both, metres.
    numbers : array (9,)
        As `posekit.compiled.check_kernels.capsules` has them: center and half length of each, metres; what is fifth is
        not read; then how many points start and end each.
    distance : array (N,)
        Filled, metres; NaN where a point is not known, or an axis has no direction.
    """
    half_a, half_b = numbers[1], numbers[3]
    second = int(numbers[5]) + int(numbers[6])
    last = second + int(numbers[7])
    w = np.empty(3 * points.shape[1])
    for n in range(points.shape[0]):
        for p in range(points.shape[1]):
            for k in range(3):
                w[3 * p + k] = points[n, p, k]
        sx, sy, sz = mean(w, 0, int(numbers[5]))
        ex, ey, ez = mean(w, int(numbers[5]), int(numbers[6]))
        tx, ty, tz = mean(w, second, int(numbers[7]))
        fx, fy, fz = mean(w, last, int(numbers[8]))
        ux, uy, uz, vx, vy, vz = ex - sx, ey - sy, ez - sz, fx - tx, fy - ty, fz - tz
        long_a, long_b = math.sqrt(ux * ux + uy * uy + uz * uz), math.sqrt(vx * vx + vy * vy + vz * vz)
        distance[n] = math.nan
        if not (0.0 < long_a < math.inf and 0.0 < long_b < math.inf):
            continue
        ux, uy, uz, vx, vy, vz = (
            ux / long_a,
            uy / long_a,
            uz / long_a,
            vx / long_b,
            vy / long_b,
            vz / long_b,
        )
        gx = tx + numbers[2] * vx - (sx + numbers[0] * ux)
        gy = ty + numbers[2] * vy - (sy + numbers[0] * uy)
        gz = tz + numbers[2] * vz - (sz + numbers[0] * uz)
        distance[n] = math.sqrt(
            least_apart(
                gx, gy, gz, half_a * ux, half_a * uy, half_a * uz, half_b * vx, half_b * vy, half_b * vz
            )
        )


COMPILED_TYPES = {
    "clamp": "",
    "mean": "",
    "apart": "",
    "least_apart": "",
    "axis_distances": "(f8[:, :, ::1], f8[::1], f8[::1])",
}
"""The kernels, in the order in which they need each other, with the types of those that are called."""
