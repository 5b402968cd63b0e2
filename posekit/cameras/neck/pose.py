"""The poses of a rigid set of points behind their image: every local minimum of the weighted reprojection error."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import PinholeCamera
from posekit.cameras.head.fit import fit_reprojection
from posekit.cameras.head.perspective import HeadPlacement, Heads, look
from posekit.cameras.head.starts import affine_start, reversed_start
from posekit.geometry import Array, coordinate_rotation, cross
from posekit.least_squares import Damping, Stopping, scaled_equations

MIN_POINTS = 4
"""Points below which a pose is not determined: three leave up to four, none of which can be told from the others."""

POSE_DAMPING = Damping(initial=1e-3, largest=1e10, growth=8.0, decay=0.2, light=np.inf, gradual=False)

POSE_STOPPING = Stopping(steps=50, precision=1e-10, full_cost=1.0)
"""The search ends by the promised decrease of the squared error, in squared deviations or as a fraction of it."""

MIN_DEVIATION_PIXELS = 1e-12
"""Pixels: a deviation of zero is taken as this where residuals are weighed."""

MAX_NORMALIZED, MIN_SPREAD = 1e3, 1e-9
"""Normalised image coordinates beyond which a point is not in a picture, and spread below which points are one."""

TINY_EXTENT = 1e-12
"""Added to the squares of a flat part of size 1, and the least scale: points in one line have a start too."""

TILT_RADIANS = 0.35
"""Radians by which the best pose is tilted to look for another beside it."""

POSES_APART = 1e-2
"""Difference between two rotation matrices, and relative one in depth, above which two poses are two minima."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PartPoses:
    """The local minima of F frames, at most K each, best first; NaN, and infinite cost, where there is none.

    Parameters
    ----------
    R : array (F, K, 3, 3)
        Rotation from the body's frame to the camera's.
    origin : array (F, K, 3)
        The body's origin (the neck), camera frame, metres.
    cost : array (F, K)
        Sum of the squared residuals in standard deviations.
    rms : array (F, K)
        Root of the mean squared residual, pixels.
    covariance : array (F, K, 3, 3)
        Of the origin, to first order, metres squared.
    freedom : int array (F,)
        Measurements less unknowns: what the cost is on average if the deviations are right.
    """

    R: Array
    origin: Array
    cost: Array
    rms: Array
    covariance: Array
    freedom: NDArray[np.intp]

    def __post_init__(self) -> None:
        for field in fields(self):
            getattr(self, field.name).flags.writeable = False

    @property
    def found(self) -> NDArray[np.bool_]:
        """Whether there is one (F, K)."""
        return np.isfinite(self.cost)

    def deviation(self, direction: Array) -> Array:
        """Return the standard deviation of the origin along a direction (F, 3), metres (F, K)."""
        variance = np.einsum("fi,fkij,fj->fk", direction, self.covariance, direction)
        deviation: Array = np.sqrt(np.maximum(variance, 0.0))
        return deviation


def poses(camera: PinholeCamera, points: Array, image: Array, deviation: Array, offset: Array) -> PartPoses:
    """Find the poses of points known in the body's frame.

    Levenberg-Marquardt from scaled orthographic views (DeMenthon & Davis 1995) and their depth-reversed twins: a
    flat or distant body has two minima that look nearly alike.

    Parameters
    ----------
    camera : PinholeCamera
        With one K, or one a frame.
    points : array (P, 3)
        Body frame, metres.
    image : array (F, P, 2)
        Pixels; NaN where not seen.
    deviation : array (F, P)
        Standard deviation of each image point, pixels.
    offset : array (P,)
        Standard deviation, in metres, of what the image shows from the body's own point; added to the other.

    Returns
    -------
    Poses
        None in frames with fewer than `MIN_POINTS` points.
    """
    with np.errstate(all="ignore"):
        normalized = camera.normalize(image)
    total = len(image)
    number, seen = _usable(normalized)
    weight = seen / np.maximum(seen.sum(axis=1, keepdims=True), 1)
    centre = weight @ points
    body = np.where(seen[..., None], points - centre[:, None], 0.0)
    size = np.sqrt((weight[..., None] * body**2).sum(axis=(1, 2)))
    plane = np.where(seen[..., None], normalized[number], 0.0)
    K = np.broadcast_to(camera.K, (total, 3, 3))[number]
    heads = Heads(
        body / size[:, None, None],
        np.where(seen[..., None], image[number], 0.0),
        seen.astype(np.float64),
        K,
        camera.distortion,
        np.ones(len(number)),
    )
    first = affine_start(heads.points, plane, seen, known=True)
    depth = size / first.scale
    sigma = np.hypot(deviation[number], offset * (K[:, 0, 0] / depth)[:, None])
    weights = 1.0 / np.maximum(sigma, MIN_DEVIATION_PIXELS)
    starts = _starts(heads.points, plane - weight[:, None] @ plane, first)
    fits = [_fit(heads, weights, start) for start in starts]
    # Seen nearly face on, a flat part has its minima side by side, and all of these may lead to the same one.
    best = np.argmin([cost for _, cost, _, _ in fits], axis=0)
    picked = [np.stack([fit[0][k] for fit in fits])[best, np.arange(len(number))] for k in range(4)]
    fits += [_fit(heads, weights, start) for start in _tilted(HeadPlacement(*picked))]
    n = len(fits)
    every = np.tile(np.arange(len(number)), n)
    end = HeadPlacement(*(np.concatenate(parts) for parts in zip(*(fit[0] for fit in fits), strict=True)))
    cost, jacobian, residual = (np.concatenate([fit[k] for fit in fits]) for k in (1, 2, 3))
    R, origin, covariance = _origin(end, jacobian, centre[every], size[every])
    rms = np.sqrt((residual**2).sum(axis=1) / np.maximum(seen.sum(axis=1), 1)[every])

    def by_frame(values: Array) -> Array:
        shaped: Array = np.moveaxis(values.reshape(n, len(number), *values.shape[1:]), 0, 1)
        return shaped

    R, origin, covariance, cost, rms = (by_frame(values) for values in (R, origin, covariance, cost, rms))
    order = np.argsort(cost, axis=1, kind="stable")
    rows = np.arange(len(number))[:, None]
    R, origin, covariance = R[rows, order], origin[rows, order], covariance[rows, order]
    cost, rms = cost[rows, order], rms[rows, order]
    cost = np.where(_new(R, origin, cost), cost, np.inf)
    order = np.argsort(cost, axis=1, kind="stable")
    kept = np.isfinite(cost[rows, order])

    def spread(values: Array, fill: float) -> Array:
        shape = kept.shape + (1,) * (values.ndim - 2)
        out = np.full((total, *values.shape[1:]), fill)
        out[number] = np.where(kept.reshape(shape), values[rows, order], fill)
        return out

    freedom = np.zeros(total, dtype=np.intp)
    freedom[number] = 2 * seen.sum(axis=1) - 6
    return PartPoses(
        R=spread(R, np.nan),
        origin=spread(origin, np.nan),
        cost=spread(cost, np.inf),
        rms=spread(rms, np.nan),
        covariance=spread(covariance, np.nan),
        freedom=freedom,
    )


def _usable(normalized: Array) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return the frames that have enough points, in more than one place, and which points these see (n, P)."""
    seen = np.asarray(
        np.isfinite(normalized).all(axis=-1) & (np.abs(normalized) < MAX_NORMALIZED).all(axis=-1)
    )
    low = np.where(seen[..., None], normalized, np.inf).min(axis=1)
    high = np.where(seen[..., None], normalized, -np.inf).max(axis=1)
    usable = (seen.sum(axis=1) >= MIN_POINTS) & ((high - low).max(axis=1) > MIN_SPREAD)
    return np.flatnonzero(usable), seen[usable]


def _starts(points: Array, image: Array, first: HeadPlacement) -> list[HeadPlacement]:
    """Return where the search starts: the solid seen from afar, and its flat part, each with depths reversed too.

    Of a body that is nearly flat the first knows its thinnest direction by noise alone. The second leaves it out: the
    image of a plane is foreshortened in one direction, by tilting to the one side or to the other.
    """
    _, _, axes = np.linalg.svd(points, full_matrices=False)
    v = np.swapaxes(axes, -1, -2).copy()
    v[..., 2] = cross(v[..., 0], v[..., 1])
    flat = points @ v[..., :2]
    transposed = np.swapaxes(flat, -1, -2)
    affine = np.linalg.solve(transposed @ flat + TINY_EXTENT * np.eye(2), transposed @ image)
    U, values, W = np.linalg.svd(np.swapaxes(affine, -1, -2))
    scale = np.maximum(values[:, 0], TINY_EXTENT)
    cosine = values[:, 1] / scale
    starts = [first, reversed_start(points, first)]
    for side in (1.0, -1.0):
        tilted = np.zeros((len(points), 3, 2))
        tilted[:, :2] = U @ (np.stack([np.ones_like(cosine), cosine], axis=-1)[:, :, None] * np.eye(2))
        tilted[:, 2, 1] = side * np.sqrt(np.maximum(1 - cosine**2, 0.0))
        plane = tilted @ W
        normal = cross(plane[..., 0], plane[..., 1])
        R = np.concatenate([plane, normal[..., None]], axis=-1) @ np.swapaxes(v, -1, -2)
        starts.append(HeadPlacement(R, first.shift, scale, scale.copy()))
    return starts


def _tilted(placement: HeadPlacement) -> list[HeadPlacement]:
    """Tilt bodies by `TILT_RADIANS` to four sides, about axes across the line of sight."""
    turns = (
        coordinate_rotation(axis, np.asarray(tilt))
        for tilt in (TILT_RADIANS, -TILT_RADIANS)
        for axis in (0, 1)
    )
    return [placement._replace(R=turn @ placement.R) for turn in turns]


def _fit(heads: Heads, weights: Array, start: HeadPlacement) -> tuple[HeadPlacement, Array, Array, Array]:
    """Minimise; return the poses, the cost (infinite without one), the weighted jacobian and the plain residual."""
    end, found = fit_reprojection(heads, start, POSE_DAMPING, POSE_STOPPING, weights=weights)
    residual, jacobian, _ = look(heads, end)
    return end, found.cost, np.concatenate([weights, weights], axis=1)[..., None] * jacobian, residual


def _origin(end: HeadPlacement, jacobian: Array, centre: Array, size: Array) -> tuple[Array, Array, Array]:
    """Return rotations, the origins (M, 3) and their covariance: first order, by the derivative of each unknown."""
    depth = size / end.scale
    arm = -np.einsum("fij,fj->fi", end.R, centre)
    towards = np.concatenate([end.shift, np.ones_like(depth)[:, None]], axis=1)
    origin = arm + depth[:, None] * towards
    by = np.zeros((len(depth), 3, 6))
    x, y, z = arm.T
    by[:, 0, 1], by[:, 0, 2] = z, -y
    by[:, 1, 0], by[:, 1, 2] = -z, x
    by[:, 2, 0], by[:, 2, 1] = y, -x
    by[:, 0, 3] = by[:, 1, 4] = depth
    by[:, :, 5] = -(depth / end.scale)[:, None] * towards
    normal, _, unit = scaled_equations(np.zeros(jacobian.shape[:2]), jacobian)
    with np.errstate(all="ignore"):
        inverse = np.linalg.pinv(np.where(np.isfinite(normal), normal, 0.0), hermitian=True)
        by = by / unit[:, None]
        covariance = by @ inverse @ np.swapaxes(by, -1, -2)
    return end.R, origin, covariance


def _new(R: Array, origin: Array, cost: Array) -> NDArray[np.bool_]:
    """Tell which poses (F, K), sorted by cost, are not the same as a better one."""
    new = np.isfinite(cost)
    with np.errstate(invalid="ignore"):
        for k in range(1, cost.shape[1]):
            turned = np.abs(R[:, :k] - R[:, k, None]).max(axis=(-1, -2))
            moved = np.linalg.norm(origin[:, :k] - origin[:, k, None], axis=-1)
            same = (turned < POSES_APART) & (moved < POSES_APART * origin[:, k, None, 2])
            new[:, k] &= ~(same & new[:, :k]).any(axis=1)
    return new
