"""Joint ranges and capsules as plain loops, for `posekit.tree.compiled`: screens that tell what is clear.

A screen says of a posture that it passes, or which place it violates first, where that is clear by more than any
rounding; else that it is unsure, and the check's own `judge` is asked (`posekit.tree.Screened`). So these formulas
decide nothing that the judge would decide otherwise, and need no care at singularities: there they are unsure.

Points are (N, P, 3), metres; places (N,) int8. Limits are rows of sign, lower, upper (radians), as
`posekit.figure.angles.Limits` has them, and the formulas are its module's.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.figure.angles import TIE
from posekit.tree import PASSED, UNSURE

Places = NDArray[np.int8]

CLEAR = 1e-9
"""Radians, or what is compared with them, within which nothing is clear: a million times the rounding."""

SINGULAR = 1e-5
"""Sine below which an angle is nearly free, and rounding is not small any more."""

SHORTEST = 1e-4
"""Metres below which a line between points, or what is left of one square to another, has no clear direction."""

CLEAR_GAP = 1e-6
"""Metres between two capsules from which they are clear of contact: a thousand times what the judge cares for."""

MOST_STEPS = 30
"""Newton's steps towards a rotation; six are usual."""


def unit(x: Any, y: Any, z: Any) -> Any:
    """Return a vector scaled to length one, and its length; NaN where it is too short, or beyond all numbers."""
    size = math.sqrt(x * x + y * y + z * z)
    if not SHORTEST < size < math.inf:
        return math.nan, math.nan, math.nan, size
    return x / size, y / size, z / size, size


def frame_of(lx: Any, ly: Any, lz: Any, dx: Any, dy: Any, dz: Any, R: Array) -> None:
    """Fill R with the columns down x left, left, -down."""
    R[0, 0], R[0, 1], R[0, 2] = dy * lz - dz * ly, lx, -dx
    R[1, 0], R[1, 1], R[1, 2] = dz * lx - dx * lz, ly, -dy
    R[2, 0], R[2, 1], R[2, 2] = dx * ly - dy * lx, lz, -dz


def torso(p: Array, R: Array) -> None:
    """Fill R with the torso's frame from neck, right and left shoulder and pelvis, the first four of p (P, 3)."""
    dx, dy, dz, _ = unit(p[3, 0] - p[0, 0], p[3, 1] - p[0, 1], p[3, 2] - p[0, 2])
    ax, ay, az = p[2, 0] - p[1, 0], p[2, 1] - p[1, 1], p[2, 2] - p[1, 2]
    along = ax * dx + ay * dy + az * dz
    lx, ly, lz, _ = unit(ax - along * dx, ay - along * dy, az - along * dz)
    frame_of(lx, ly, lz, dx, dy, dz, R)


def hips(p: Array, first: int, R: Array) -> None:
    """Fill R with the hips' frame from pelvis, right and left hip, three of p (P, 3)."""
    a, b, c = first, first + 1, first + 2
    lx, ly, lz, _ = unit(p[c, 0] - p[b, 0], p[c, 1] - p[b, 1], p[c, 2] - p[b, 2])
    ax, ay, az = p[b, 0] - p[a, 0], p[b, 1] - p[a, 1], p[b, 2] - p[a, 2]
    along = ax * lx + ay * ly + az * lz
    dx, dy, dz, _ = unit(ax - along * lx, ay - along * ly, az - along * lz)
    frame_of(lx, ly, lz, dx, dy, dz, R)


def outside(angle: Any, lower: Any, upper: Any) -> Any:
    """Return how far an angle is outside its limits, negative inside; NaN where it is unclear by how many turns."""
    middle = (lower + upper) / 2
    turn = (angle - middle + math.pi) % (2 * math.pi)
    if turn < CLEAR or turn > 2 * math.pi - CLEAR:
        return math.nan
    angle = middle + turn - math.pi
    return max(lower - angle, angle - upper)


def verdict(over: Array, cost: Array, count: int, tolerance: Array) -> Any:
    """Judge the branch (B, K) that a closed form would choose.

    Parameters
    ----------
    over : array (B, K)
        How far each angle of each branch is outside its limits.
    cost : array (B,)
        How far the branch is: the first that is inside is chosen, else the one with the least (`TIE`).
    count : int
        How many branches there are.
    tolerance : array (B, K)
        How far outside is no violation; infinite where the angle is not judged.
    """
    least = math.inf
    for b in range(count):
        if not abs(cost[b]) > CLEAR:  # NaN too
            return UNSURE
        least = min(least, cost[b])
    if least < 0:
        return PASSED
    chosen = -1
    for b in range(count):
        if abs(cost[b] - least - TIE) <= CLEAR:
            return UNSURE
        if chosen < 0 and cost[b] < least + TIE:
            chosen = b
    for k in range(over.shape[1]):
        beyond = over[chosen, k] - tolerance[chosen, k]
        if abs(beyond) <= CLEAR:
            return UNSURE
        if beyond > 0:
            return k
    return PASSED


def ball(R: Array, limits: Array, over: Array, cost: Array, allowed: Array) -> Any:
    """Judge the three angles of a rotation R (3, 3), `posekit.figure.angles.ball_angles`."""
    upper = -R[0, 2], -R[1, 2], -R[2, 2]
    if is_singular(upper):
        return UNSURE
    for b in range(2):
        alpha, beta = swing(upper, b)
        x, y, _ = into_ball(R[0, 0], R[1, 0], R[2, 0], alpha, beta)
        gamma = math.atan2(y, x)
        over[b, 0] = outside(alpha * limits[0, 0], limits[1, 0], limits[2, 0])
        over[b, 1] = outside(beta * limits[0, 1], limits[1, 1], limits[2, 1])
        over[b, 2] = outside(gamma * limits[0, 2], limits[1, 2], limits[2, 2])
        cost[b] = worst(over, b, 3)
    return verdict(over, cost, 2, allowed)


def into_ball(x: Any, y: Any, z: Any, alpha: Any, beta: Any) -> Any:
    """Turn a direction into the frame reached after alpha and beta."""
    ca, sa, cb, sb = math.cos(alpha), math.sin(alpha), math.cos(beta), math.sin(beta)
    forward = sa * x + ca * z
    return ca * x - sa * z, cb * y + sb * forward, -sb * y + cb * forward


def unknown(p: Array, first: int, last: int) -> Any:
    """Return whether a coordinate of some points is NaN."""
    for i in range(first, last):
        if math.isnan(p[i, 0] + p[i, 1] + p[i, 2]):
            return math.isnan(p[i, 0]) or math.isnan(p[i, 1]) or math.isnan(p[i, 2])
    return False


def transposed(A: Array, B: Array, C: Array) -> None:
    """Fill C with the product of A's transpose and B, all (3, 3)."""
    for i in range(3):
        for j in range(3):
            C[i, j] = A[0, i] * B[0, j] + A[1, i] * B[1, j] + A[2, i] * B[2, j]


def pelvis(points: Array, limits: Array, tolerance: float) -> Places:
    """Screen the pelvis: torso (4), then both hips; limits (3, 3), tolerance in radians."""
    places = np.empty(len(points), np.int8)
    over, cost, allowed = np.empty((2, 3)), np.empty(2), np.full((2, 3), tolerance)
    A, B, C = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for n in range(len(points)):
        p = points[n]
        if unknown(p, 0, 6):
            places[n] = PASSED
            continue
        torso(p, A)
        hips(p, 3, B)
        transposed(A, B, C)
        places[n] = ball(C, limits, over, cost, allowed)
    return places


def polar(C: Array, X: Array) -> Any:
    """Fill X with the rotation nearest to C (3, 3), by Newton's iteration (Higham 1986); say whether that is clear.

    Not where the determinant is negative or small: then the nearest orthogonal matrix is a reflection, or unclear.
    """
    size = 0.0
    for i in range(3):
        for j in range(3):
            size += C[i, j] * C[i, j]
    size = math.sqrt(size)
    if not (size > 0 and size < math.inf):
        return False
    for i in range(3):
        for j in range(3):
            X[i, j] = C[i, j] / size * math.sqrt(3.0)
    Y = np.empty((3, 3))
    for step in range(MOST_STEPS):
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            for j in range(3):
                c, d = (j + 1) % 3, (j + 2) % 3
                Y[i, j] = X[a, c] * X[b, d] - X[a, d] * X[b, c]
        determinant = X[0, 0] * Y[0, 0] + X[0, 1] * Y[0, 1] + X[0, 2] * Y[0, 2]
        if not determinant > (1e-5 if step == 0 else 0.0):
            return False
        change = 0.0
        for i in range(3):
            for j in range(3):
                new = (X[i, j] + Y[i, j] / determinant) / 2
                change = max(change, abs(new - X[i, j]))
                X[i, j] = new
        if change < 1e-13:
            return True
    return False


def neck(points: Array, offsets: Array, limits: Array, tolerance: float) -> Places:
    """Screen the neck: torso (4), then the head's points, whose offsets (5, 3) in the head are the figure's."""
    places = np.empty(len(points), np.int8)
    over, cost, allowed = np.empty((2, 3)), np.empty(2), np.full((2, 3), tolerance)
    A, B, C = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for n in range(len(points)):
        p = points[n]
        if unknown(p, 0, p.shape[0]):
            places[n] = PASSED
            continue
        torso(p, A)
        for i in range(3):
            for j in range(3):
                C[i, j] = 0.0
                for k in range(offsets.shape[0]):
                    C[i, j] += (p[4 + k, i] - p[0, i]) * offsets[k, j]
        if not polar(C, B):
            places[n] = UNSURE
            continue
        transposed(A, B, C)
        places[n] = ball(C, limits, over, cost, allowed)
    return places


def limb(points: Array, rigid: int, limits: Array, tolerance: float, unseen: float) -> Places:
    """Screen a limb.

    Parameters
    ----------
    points : array (N, P, 3)
        Its rigid part (4 points of the torso or 3 of the hips), then two or three joints.
    rigid : int
        Points of the rigid part.
    limits : array (3, 4)
    tolerance, unseen : float
        Radians, as `posekit.validators.joint_range.Limb` has them.
    """
    whole = points.shape[1] == rigid + 3
    count = 4 if whole else 2
    places = np.empty(len(points), np.int8)
    R = np.empty((3, 3))
    over, cost, allowed = np.empty((4, count)), np.empty(4), np.full((4, count), tolerance)
    for n in range(len(points)):
        p = points[n]
        if unknown(p, 0, rigid + 2):
            places[n] = PASSED  # nothing is judged
            continue
        places[n] = UNSURE
        if whole and unknown(p, rigid + 2, rigid + 3):
            continue
        if rigid == 4:
            torso(p, R)
        else:
            hips(p, 0, R)
        upper = direction(p, rigid, rigid + 1, R)
        if whole:
            lower = direction(p, rigid + 1, rigid + 2, R)
            used = limb_branches(upper, lower, limits, tolerance, unseen, over, cost, allowed)
        else:
            used = upper_branches(upper, limits, over, cost)
        places[n] = verdict(over, cost, used, allowed) if used else UNSURE
    return places


def direction(p: Array, a: int, b: int, R: Array) -> Any:
    """Return the direction from one point to another in the frame R."""
    x, y, z, _ = unit(p[b, 0] - p[a, 0], p[b, 1] - p[a, 1], p[b, 2] - p[a, 2])
    return (
        R[0, 0] * x + R[1, 0] * y + R[2, 0] * z,
        R[0, 1] * x + R[1, 1] * y + R[2, 1] * z,
        R[0, 2] * x + R[1, 2] * y + R[2, 2] * z,
    )


def swing(upper: Any, b: Any) -> Any:
    """Return the first two angles of a direction in one of its two branches."""
    ux, uy, uz = upper
    alpha, beta = math.atan2(-ux, -uz), math.atan2(uy, math.sqrt(ux * ux + uz * uz))
    if b == 1:
        return alpha + math.pi, math.pi - beta
    return alpha, beta


def is_singular(upper: Any) -> Any:
    """Return whether the first angle of a direction is nearly free, or the direction is not known."""
    return not upper[0] * upper[0] + upper[2] * upper[2] > SINGULAR * SINGULAR


def upper_branches(upper: Any, limits: Array, over: Array, cost: Array) -> Any:
    """Fill in the two branches of an upper segment; return how many they are, 0 where none is clear."""
    if is_singular(upper):
        return 0
    for b in range(2):
        alpha, beta = swing(upper, b)
        over[b, 0] = outside(alpha * limits[0, 0], limits[1, 0], limits[2, 0])
        over[b, 1] = outside(beta * limits[0, 1], limits[1, 1], limits[2, 1])
        cost[b] = worst(over, b, 2)
    return 2


def limb_branches(
    upper: Any,
    lower: Any,
    limits: Array,
    tolerance: float,
    unseen: float,
    over: Array,
    cost: Array,
    allowed: Array,
) -> Any:
    """Fill in branches of a limb, up to one that is inside; return how many they are, 0 where none is clear."""
    wx = upper[1] * lower[2] - upper[2] * lower[1]
    wy = upper[2] * lower[0] - upper[0] * lower[2]
    wz = upper[0] * lower[1] - upper[1] * lower[0]
    if is_singular(upper) or not wx * wx + wy * wy + wz * wz > SINGULAR * SINGULAR:
        return 0
    used = 0
    for b in range(2):
        alpha, beta = swing(upper, b)
        x, y, z = into_ball(lower[0], lower[1], lower[2], alpha, beta)
        bend = math.sqrt(x * x + y * y)
        loose = tolerance / bend
        if abs(loose - unseen) <= CLEAR * loose:
            return 0
        for side in (1.0, -1.0):
            gamma, hinge = math.atan2(-side * y, -side * x), side * math.atan2(bend, -z)
            over[used, 0] = outside(alpha * limits[0, 0], limits[1, 0], limits[2, 0])
            over[used, 1] = outside(beta * limits[0, 1], limits[1, 1], limits[2, 1])
            over[used, 2] = outside(gamma * limits[0, 2], limits[1, 2], limits[2, 2])
            over[used, 3] = outside(hinge * limits[0, 3], limits[1, 3], limits[2, 3])
            allowed[used, 2] = loose if loose <= unseen else math.inf
            # The axial rotation counts by how far it turns the lower segment.
            cost[used] = max(worst(over, used, 2), over[used, 2] * bend, over[used, 3])
            if math.isnan(worst(over, used, 4)):
                return 0
            used += 1
            if cost[used - 1] < -CLEAR:
                return used
    return used


def worst(over: Array, b: Any, count: Any) -> Any:
    """Return the largest of a branch's first excesses, NaN where one is."""
    most = over[b, 0]
    for k in range(1, count):
        if not over[b, k] <= most:
            most = over[b, k]
        if math.isnan(most):
            return most
    return most


def clamp(value: Any) -> Any:
    """Bring a value into [-1, 1]."""
    return min(max(value, -1.0), 1.0)


def end_of(p: Array, first: int, count: int) -> Any:
    """Return the mean of some points."""
    x, y, z = 0.0, 0.0, 0.0
    for i in range(first, first + count):
        x += p[i, 0]
        y += p[i, 1]
        z += p[i, 2]
    return x / count, y / count, z / count


def apart(
    gx: Any, gy: Any, gz: Any, ax: Any, ay: Any, az: Any, s: Any, bx: Any, by: Any, bz: Any, t: Any
) -> Any:
    """Return the squared distance between s on the one segment and t on the other."""
    x, y, z = gx + t * bx - s * ax, gy + t * by - s * ay, gz + t * bz - s * az
    return x * x + y * y + z * z


def capsules(points: Array, sizes: NDArray[np.int64], shape: Array, reach: float) -> tuple[Places, Array]:
    """Screen two capsules: they are clear of each other, or they penetrate, which coal must confirm.

    See `posekit.validators.collision` for the formulas.

    Parameters
    ----------
    points : array (N, P, 3)
        Those that place the one, then those of the other.
    sizes : int array (4,)
        How many points start and end each.
    shape : array (4,)
        Center and half length of each, metres.
    reach : float
        Both radii and the contact margin, metres.

    Returns
    -------
    places : int array (N,)
    placed : array (M, 14)
        Where the capsules are that seem to penetrate: position and quaternion of each.
    """
    places = np.empty(len(points), np.int8)
    placed = np.empty((len(points), 14))
    second, end_a, end_b = sizes[0] + sizes[1], sizes[0], sizes[0] + sizes[1] + sizes[2]
    half_a, half_b = shape[1], shape[3]
    aa, bb = half_a * half_a, half_b * half_b
    far, near, deep = half_a + half_b + reach + CLEAR_GAP, reach + CLEAR_GAP, reach - CLEAR_GAP
    count = 0
    for n in range(len(points)):
        p = points[n]
        if unknown(p, 0, p.shape[0]):
            places[n] = PASSED
            continue
        places[n] = UNSURE
        sx, sy, sz = end_of(p, 0, sizes[0])
        ex, ey, ez = end_of(p, end_a, sizes[1])
        ux, uy, uz, _ = unit(ex - sx, ey - sy, ez - sz)
        tx, ty, tz = end_of(p, second, sizes[2])
        fx, fy, fz = end_of(p, end_b, sizes[3])
        vx, vy, vz, _ = unit(fx - tx, fy - ty, fz - tz)
        sx, sy, sz = sx + shape[0] * ux, sy + shape[0] * uy, sz + shape[0] * uz
        tx, ty, tz = tx + shape[2] * vx, ty + shape[2] * vy, tz + shape[2] * vz
        gx, gy, gz = tx - sx, ty - sy, tz - sz
        squared = gx * gx + gy * gy + gz * gz
        if not squared < math.inf:
            continue
        if far > 0 and squared > far * far:
            places[n] = PASSED
            continue
        ax, ay, az, bx, by, bz = half_a * ux, half_a * uy, half_a * uz, half_b * vx, half_b * vy, half_b * vz
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
        if near > 0 and least > near * near:
            places[n] = PASSED
        elif deep > 0 and least < deep * deep:
            places[n] = 0
            placed[count, 0], placed[count, 1], placed[count, 2] = sx, sy, sz
            placed[count, 7], placed[count, 8], placed[count, 9] = tx, ty, tz
            onto(ux, uy, uz, placed[count, 3:7])
            onto(vx, vy, vz, placed[count, 10:14])
            count += 1
    return places, placed[:count]


def onto(x: Any, y: Any, z: Any, q: Array) -> None:
    """Fill q (4,) with the unit quaternion that turns z onto an axis or its opposite."""
    sign = -1.0 if z < 0 else 1.0
    w = 1.0 + sign * z
    size = math.sqrt(2.0 * w)
    q[0], q[1], q[2], q[3] = -sign * y / size, sign * x / size, 0.0, w / size


COMPILED = {
    "unit": "",
    "frame_of": "",
    "torso": "",
    "hips": "",
    "outside": "",
    "verdict": "",
    "into_ball": "",
    "worst": "",
    "swing": "",
    "is_singular": "",
    "ball": "",
    "unknown": "",
    "transposed": "",
    "polar": "",
    "direction": "",
    "upper_branches": "",
    "limb_branches": "",
    "clamp": "",
    "end_of": "",
    "apart": "",
    "onto": "",
    "pelvis": "(f8[:, :, ::1], f8[:, ::1], f8)",
    "neck": "(f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8)",
    "limb": "(f8[:, :, ::1], i8, f8[:, ::1], f8, f8)",
    "capsules": "(f8[:, :, ::1], i8[::1], f8[::1], f8)",
}
"""The kernels, in the order in which they need each other, with the types they take."""
