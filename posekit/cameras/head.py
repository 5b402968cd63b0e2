r"""The pose of the camera, or its focal length too, from six or more points of a head (Lee & Chen 1985, §2.1).

The squared reprojection error is minimised over the head's pose. With the points centred and of size 1,
:math:`q = R\,(p - c) / \sigma`, and the head's centre at depth :math:`z`, their perspective image is

.. math:: u = \frac{a + s\,q_{xy}}{1 + d\,q_z}, \qquad s = f \sigma / z, \quad d = \sigma / z,

where :math:`a` is the image of the centre. With the unknowns :math:`R, a, s, d` each
can be seen in the image, and a camera at infinity is the regular point :math:`d = 0`, the scaled orthographic
projection. With depth and f as unknowns both would run to infinity together. With f free there are seven
unknowns. With a known camera :math:`u` is the normalised image (f = 1), :math:`d = s`, and there are six; residuals
are then multiplied by the camera's derivatives at the image points, which makes them pixels.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from posekit.cameras.head_points import DEGENERATE_EXTENT, TABLE_A2, HeadPoints, degeneracy
from posekit.cameras.lee_chen import LeeChenCamera
from posekit.cameras.pinhole import PinholeCamera
from posekit.errors import HeadError, refusal
from posekit.geometry import Array, Flags, Ints, Record, best_rotation, cross, rotation_from_vector

__all__ = ["TABLE_A2", "HeadPoints", "HeadPose", "calibrate", "dlt", "solve_pose"]

MAX_STEPS: Final = 60
#: Promised decrease of the squared error, as a fraction of it, that ends a fit: unknowns are then within about 1e-5 of
#: their standard deviation.
FIT_PRECISION: Final = 1e-10

#: The same after the last step: if f is hardly determined, the fit converges slowly.
NEARLY_SETTLED: Final = 1e-6

#: The same for a fit without one point: enough to judge it.
MISFIT_PRECISION: Final = 1e-3

#: Damping, as a fraction of the normal equations' diagonal, at which no step decreases the error any more.
STUCK_DAMPING: Final = 1e8

#: Error of a residual, as a fraction of the image point's coordinates, that is rounding.
RESIDUAL_ROUNDING: Final = 4 * np.finfo(np.float64).eps

#: Standard deviations by which the perspective must be reversed to be an error of the image.
CLEARLY_SIGMAS: Final = 5.0

#: Chance below which a better fit of a head behind the camera is no accident.
BETTER_BEHIND: Final = 1e-4

#: Smallest eigenvalue of the normal equations, scaled to a unit diagonal, that determines all unknowns.
DETERMINED_EIGENVALUE: Final = 1e-12

#: Second smallest singular value of the linear equations over the largest below which they have a second solution.
#:
#: Six points and the camera can lie so (all but two in a plane, and these two in line with the camera, for one).
#: Rounding leaves 1e-15, measured points 1e-4 and more.
RANK_RATIO: Final = 1e-10

#: Probability that a head of sound points with normal errors has one of them named as a misfit.
FALSE_ALARMS: Final = 5e-3

#: Error, as a fraction of the head's size in the image, that is rounding and is not examined for misfits.
ROUNDING_ERROR: Final = 1e-10

#: Added to the squared extent of points of size 1, so that a flat remainder of a head has a start.
FLAT_EXTENT: Final = 1e-12

#: Spread of image points below which their squares underflow.
VANISHING_SPREAD: Final = 1e-100

BEHIND_CAMERA: Final = (
    "the points fit only a head behind the camera, as those of a mirrored image do: y must point down in the "
    "image, and left and right must be the person's own"
)


class Projection(NamedTuple):
    """Cameras of F frames by the linear equations; NaN if not determined.

    Attributes
    ----------
    R : array (F, 3, 3)
        Rotation from the head's frame to the camera's.
    t : array (F, 3)
        The head frame's origin in the camera frame, metres.
    f : array (F,)
        In the image's unit.
    in_front : bool array (F,)
        Whether all points are in front of the camera.
    """

    R: Array
    t: Array
    f: Array
    in_front: Flags


class HeadWarning(UserWarning):
    """A head point does not fit the others, in one frame or in more frames than accident explains."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class HeadPose(Record):
    """The pose of a head in F frames; one frame is a batch of one.

    Attributes
    ----------
    head : HeadPoints
        The points that were placed.
    found : bool array (F,)
        Whether a frame gives a pose. If not, R, t, f and the points are NaN; residuals, rms and misfit are
        kept of fits that were rejected.
    reasons : tuple of str
        Why a frame gives none; empty if it does.
    R_cam_head : array (F, 3, 3)
        Rotation from the head's frame to the camera's (OpenCV: x right, y down, z forward).
    t_cam_head : array (F, 3)
        The head frame's origin in the camera frame, metres.
    f : array (F,)
        The focal length, in the image's unit; a known camera's own.
    f_deviation : array (F,)
        The standard deviation of f, from the residuals to first order; 0 if f is known. A distant head
        hardly determines f: compare the two before using it.
    points_cam : array (F, P, 3)
        All points of the head, seen or not, in the camera frame, metres.
    residuals : array (F, P)
        Distance between a point's projection and its image point, in the image's unit; NaN if not seen.
    rms : array (F,)
        Root of the mean squared residual of the seen points.
    misfit : tuple of str or None
        The point that does not fit the others, None if all do. Of sound heads with normal errors one in
        two hundred has one by accident; a warning is given only for more than that.
    rms_without : array (F,)
        `rms` of the fit without the misfit; NaN if there is none.
    """

    head: HeadPoints
    found: Flags
    reasons: tuple[str, ...]
    R_cam_head: Array
    t_cam_head: Array
    f: Array
    f_deviation: Array
    points_cam: Array
    residuals: Array
    rms: Array
    misfit: tuple[str | None, ...]
    rms_without: Array

    def point(self, name: str) -> Array:
        """Return one point of the head (F, 3), camera frame, metres."""
        return np.asarray(self.points_cam[:, self.head.index(name)])

    def require(self) -> HeadPose:
        """Return self, or raise `HeadError` for the first frame without a pose."""
        for frame, reason in enumerate(self.reasons):
            if reason:
                raise HeadError(f"frame {frame}: {reason}" if len(self.reasons) > 1 else reason)
        return self


def calibrate(head: HeadPoints, image: ArrayLike, f: ArrayLike | None = None) -> HeadPose:
    r"""Find the head's pose, and f unless it is given, in the image plane of a camera with square pixels.

    A point that does not fit the rest is named in a `HeadWarning`.

    Parameters
    ----------
    head : HeadPoints
        P points, metres.
    image : array (P, 2) or (F, P, 2)
        Image points: x right, y down, relative to the principal point, in f's unit; NaN if not seen.
        `posekit.cameras.lee_chen.image_from_paper` converts those of the paper's camera.
    f : float or array (F,), optional
        The focal length, if it is known.

    Returns
    -------
    HeadPose
        It has no axis of frames if the image is (P, 2).

    Raises
    ------
    HeadError
        If the image does not fit the head, or the only frame of an image (P, 2) gives no pose: too few
        points, points that are degenerate, a head behind the camera, or f left undetermined.
    CameraError
        If f is not positive and finite.

    Examples
    --------
    >>> image = TABLE_A2.points[:, [2, 1]] * [-0.0125, -0.0125] / (1 - TABLE_A2.points[:, :1] / 4)
    >>> calibrate(TABLE_A2, image).f.round(9)
    array([0.05])
    """
    return _place(head, image, None if f is None else LeeChenCamera(f=np.asarray(f, dtype=np.float64)))


def solve_pose(head: HeadPoints, image: ArrayLike, camera: PinholeCamera | LeeChenCamera) -> HeadPose:
    """Find the head's pose in the image of a known camera (perspective-n-point).

    As `calibrate`, with the reprojection error measured in pixels, to first order of the lens at the image points. A
    pixel that no ray reaches counts as not seen.

    Parameters
    ----------
    head : HeadPoints
        P points, metres.
    image : array (P, 2) or (F, P, 2)
        Image points; NaN if not seen.
    camera : PinholeCamera or LeeChenCamera
        The camera.
    """
    return _place(head, image, camera)


def dlt(head: HeadPoints, image: ArrayLike) -> Projection:
    """Solve the linear equations of a projection matrix (Abdel-Aziz & Karara 1971; Lee & Chen 1985, eqs. 2-3).

    Every point gives two equations that are linear in the twelve entries of P. The right singular vector of the
    smallest singular value solves them in the least squares sense, after points and image are normalised (Hartley
    1997). Nothing keeps P a camera's: with coarse image points the result is far off (the printed digits of
    Table A.2 give a camera 4 cm away). `calibrate` starts from it and does better.

    Parameters
    ----------
    head : HeadPoints
        P points, metres.
    image : array (P, 2) or (F, P, 2)
        As for `calibrate`.

    Returns
    -------
    Projection
        NaN in frames without a solution.

    Raises
    ------
    HeadError
        If the image does not fit the head, or the only frame of an image (P, 2) determines no camera.
    """
    points, seen, reasons = _sighted(head, image)
    seen &= np.array([not reason for reason in reasons])[:, None]
    with np.errstate(all="ignore"):  # frames without points
        centre, size, centred = _centred(head.points, seen)
        found = _solve_linear(centred, points, seen)
        t = size[:, None] * found.t - np.einsum("fij,fj->fi", found.R, centre)
    if np.ndim(image) == 2 and not found.in_front[0]:
        determined = np.isfinite(found.f[0])
        many = "the linear equations have many solutions; use calibrate, or add a head point"
        raise HeadError(reasons[0] or (BEHIND_CAMERA if determined else many))
    return found._replace(t=t)


def _place(head: HeadPoints, image: ArrayLike, camera: PinholeCamera | LeeChenCamera | None) -> HeadPose:
    """Fit the head in every frame, reject impossible fits, and warn of misfits."""
    points, seen, reasons = _sighted(head, image)
    plane, to_image = points, np.broadcast_to(np.eye(2), (*points.shape, 2))
    if camera is not None:
        if isinstance(camera, LeeChenCamera) and np.size(np.asarray(camera.f)) not in (1, len(points)):
            got, expected = f"{np.size(np.asarray(camera.f))} values", f"{len(points)}, one a frame"
            raise refusal("camera", "f", got, expected, error=HeadError)
        with np.errstate(all="ignore"):  # far outside the image the lens's polynomial overflows to NaN
            plane = camera.normalize(points)
        reached = seen & np.isfinite(plane).all(axis=-1)
        if (reached < seen).any():
            points, seen, reasons = _sighted(head, np.where(reached[..., None], points, np.nan))
        plane = np.where(seen[..., None], plane, 0.0)
        to_image = camera.jacobian(plane)
    rows = np.flatnonzero([not reason for reason in reasons])
    centre, size, centred = _centred(head.points, seen[rows])
    heads = _Heads(centred, plane[rows], to_image[rows] * seen[rows, :, None, None], camera is None)
    # Exact image points divide 0 by 0 where chances are compared; absurd ones overflow, and have no fit.
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        placement, cost, settled, wrong = _best(heads)
        residual, J, _ = _look(heads, placement)
        point, cost_without, chance = _misfits(heads, placement, cost, settled)
        R, shift, scale, slope = _parts(placement)
        if camera is None:
            f = scale / slope
            f_deviation, undetermined = _focal_length(J, cost, settled, placement)
        else:
            own = camera.f if isinstance(camera, LeeChenCamera) else camera.K[0, 0]
            f = np.broadcast_to(np.asarray(own, dtype=np.float64), len(points))[rows]
            f_deviation, undetermined = np.zeros(len(rows)), [""] * len(rows)
        centre_cam = size[:, None] * np.concatenate([shift / scale[:, None], 1 / slope[:, None]], axis=1)
    for k, row in enumerate(rows):
        reasons[row] = wrong[k] or undetermined[k]
        if reasons[row] and point[k] >= 0:
            name = head.names[point[k]]
            reasons[row] += f"; check head point {name} first, which does not fit the others"
    found = np.array([not reason for reason in reasons], dtype=np.bool_)

    def whole(values: Array, kept: Flags) -> Array:
        """Spread values of the fitted frames over all frames, NaN elsewhere."""
        full = np.full((len(points), *values.shape[1:]), np.nan)
        full[rows[kept]] = values[kept]
        return full

    R_cam_head = whole(R, found[rows])
    t_cam_head = whole(centre_cam - np.einsum("fij,fj->fi", R, centre), found[rows])
    count = np.maximum(seen.sum(axis=-1), 2)
    pose = HeadPose(
        head=head,
        found=found,
        reasons=tuple(reasons),
        R_cam_head=R_cam_head,
        t_cam_head=t_cam_head,
        f=whole(f, found[rows]),
        f_deviation=whole(f_deviation, found[rows]),
        points_cam=head.points @ np.swapaxes(R_cam_head, -1, -2) + t_cam_head[:, None],
        residuals=np.where(seen, whole(np.linalg.norm(residual, axis=-1), settled), np.nan),
        rms=np.sqrt(whole(cost, settled) / count),
        misfit=tuple(head.names[int(k)] if k >= 0 else None for k in whole(point.astype(float), settled)),
        rms_without=np.sqrt(whole(cost_without, settled) / (count - 1)),
    )
    if np.ndim(image) == 2:
        pose.require()
    _warn(pose, np.nan_to_num(whole(chance, settled), nan=1.0))
    return pose


def _sighted(head: HeadPoints, image: ArrayLike) -> tuple[Array, Flags, list[str]]:
    """Return image points (F, P, 2), 0 if not seen, seen points (F, P), and why a frame determines no camera."""
    points = np.array(image, dtype=np.float64)
    points = points[None] if points.ndim == 2 else points
    count = len(head.names)
    if points.ndim != 3 or points.shape[1:] != (count, 2) or np.isinf(points).any():
        got = f"shape {np.shape(image)}{' with infinite numbers' if np.isinf(points).any() else ''}"
        expected = f"({count}, 2) or (F, {count}, 2): {', '.join(head.names)}"
        raise refusal("image points", "", got, expected, "give NaN for unseen points", error=HeadError)
    seen = np.asarray(np.isfinite(points).all(axis=-1), dtype=np.bool_)
    points[~seen] = 0.0
    patterns, which = np.unique(seen, axis=0, return_inverse=True)
    by_pattern = [degeneracy(head.names, head.points, pattern) for pattern in patterns]
    reasons = [by_pattern[pattern] for pattern in which.ravel()]
    offset = _centred(points, seen)[2]
    along, across = np.linalg.svd(offset, compute_uv=False).T
    for frame in np.flatnonzero(across <= np.maximum(DEGENERATE_EXTENT * along, VANISHING_SPREAD)):
        reasons[frame] = reasons[frame] or "the image points lie on one line or in one point: check them"
    return points, seen, reasons


def _centred(points: Array, seen: Flags) -> tuple[Array, Array, Array]:
    """Return each frame's centre (F, D) and size (F,) of the seen points (F, P, D), and the points relative to them."""
    weight = seen / np.maximum(seen.sum(axis=-1, keepdims=True), 1)
    centre = (weight[..., None] * points).sum(axis=1)
    offset = np.where(seen[..., None], points - centre[:, None], 0.0)
    size = np.sqrt((weight[..., None] * offset**2).sum(axis=(1, 2)))
    return centre, size, offset / np.where(size > 0, size, 1.0)[:, None, None]


class _Heads(NamedTuple):
    """F heads to fit.

    Centred points (F, P, 3) of size 1, normalised image points (F, P, 2), the derivatives (F, P, 2, 2) of the image by
    them (0 for unseen points), and whether f is free.
    """

    points: Array
    plane: Array
    to_image: Array
    free: bool

    @property
    def seen(self) -> Flags:
        return np.asarray(self.to_image.any(axis=(-2, -1)))

    @property
    def freedom(self) -> Array:
        """Number of residuals less the number of unknowns (F,)."""
        return np.asarray(2 * self.seen.sum(axis=-1) - (7 if self.free else 6))

    @property
    def spread(self) -> Array:
        """Sum of the squared distances of the image points from their mean (F,)."""
        _, size, offset = _centred(self.plane, self.seen)
        return _squares(_times(self.to_image, size[:, None, None] * offset))

    def take(self, rows: Ints) -> _Heads:
        return _Heads(self.points[rows], self.plane[rows], self.to_image[rows], self.free)


def _squares(residual: Array) -> Array:
    """Return the sum of squares of each frame (F,)."""
    return np.asarray(np.einsum("fpi,fpi->f", residual, residual))


def _times(matrices: Array, vectors: Array) -> Array:
    return np.asarray(np.einsum("fpij,fpj->fpi", matrices, vectors))


def _placement(R: Array, shift: Array, scale: Array, slope: Array) -> Array:
    """Write placements as rows (F, 13): R, the image a of the centre, s and d."""
    return np.concatenate([R.reshape(-1, 9), shift, scale[:, None], slope[:, None]], axis=1)


def _parts(placement: Array) -> tuple[Array, Array, Array, Array]:
    return placement[:, :9].reshape(-1, 3, 3), placement[:, 9:11], placement[:, 11], placement[:, 12]


def _look(heads: _Heads, placement: Array) -> tuple[Array, Array, Flags]:
    """Return residuals (F, P, 2), their derivatives (F, P, 2, 6 or 7), and whether all points are before the camera.

    The derivatives are by a rotation vector in the camera's frame, shift, scale, and slope if f is free.
    """
    R, shift, scale, slope = _parts(placement)
    q = heads.points @ np.swapaxes(R, -1, -2)
    depth = 1.0 + slope[:, None] * q[..., 2]
    possible = (depth > 0).all(axis=-1) & (scale > 0)
    inverse = 1 / np.where(depth > 0, depth, 1.0)[..., None]
    uv = (shift[:, None] + scale[:, None, None] * q[..., :2]) * inverse
    by_point = np.zeros((*q.shape[:2], 2, 3))
    by_point[..., 0, 0] = by_point[..., 1, 1] = scale[:, None]
    by_point[..., 2] = -slope[:, None, None] * uv
    by_point *= inverse[..., None]
    by_shift = np.eye(2) * inverse[..., None]
    by_scale, by_slope = q[..., :2] * inverse, -uv * q[..., 2:] * inverse
    last = [by_scale, by_slope] if heads.free else [by_scale + by_slope]
    turning = cross(np.broadcast_to(q[..., None, :], by_point.shape), by_point)
    J = np.concatenate([turning, by_shift, *(column[..., None] for column in last)], axis=-1)
    return _times(heads.to_image, uv - heads.plane), heads.to_image @ J, possible


def _fit(heads: _Heads, start: Array, precision: float = FIT_PRECISION) -> tuple[Array, Array, Flags]:
    """Minimise the sum of squared residuals from a start (Levenberg 1944; Marquardt 1963; damping: Nielsen 1999).

    Return placements, their costs (infinite if the start is NaN or has points behind the camera), and whether they are
    minima.
    """
    placement, unknowns = start.copy(), 7 if heads.free else 6
    rounding = RESIDUAL_ROUNDING**2 * _squares(_times(heads.to_image, heads.plane))
    residual, J, possible = _look(heads, placement)
    cost = _squares(residual)
    cost = np.where(possible & np.isfinite(cost), cost, np.inf)
    damping, gain = np.full(len(start), 1e-4), np.where(np.isfinite(cost), np.inf, 0.0)
    for _ in range(MAX_STEPS):
        open_ = (gain > np.maximum(precision * cost, rounding)) | (damping > 1e-4)
        rows = np.flatnonzero(open_ & np.isfinite(cost) & (damping < STUCK_DAMPING) & (cost > rounding))
        if not rows.size:
            break
        A = J[rows].reshape(len(rows), -1, unknowns)
        unit = np.linalg.norm(A, axis=1)
        A = A / np.where(unit > 0, unit, 1.0)[:, None]
        gradient = np.einsum("fpi,fp->fi", A, residual[rows].reshape(len(rows), -1))
        normal = np.swapaxes(A, 1, 2) @ A
        damped = normal + damping[rows, None, None] * np.eye(unknowns)
        step = -np.linalg.solve(damped, gradient[..., None])[..., 0]
        gain[rows] = -np.einsum("fi,fi->f", step, 2 * gradient + np.einsum("fij,fj->fi", normal, step))
        trial = _moved(placement[rows], step / np.where(unit > 0, unit, 1.0))
        there, J_there, possible = _look(heads.take(rows), trial)
        new = np.where(possible, _squares(there), np.inf)
        ratio = np.clip((cost[rows] - new + rounding[rows]) / (gain[rows] + rounding[rows]), 0.0, 1.0)
        better = new <= cost[rows] + rounding[rows]
        falls = np.maximum(1.0 - (2.0 * ratio - 1.0) ** 3, 0.03)
        damping[rows] = np.maximum(damping[rows] * np.where(better, falls, 10.0), 1e-13)
        kept = rows[better]
        placement[kept], cost[kept] = trial[better], new[better]
        residual[kept], J[kept] = there[better], J_there[better]
    settled = np.isfinite(cost) & (
        (gain <= NEARLY_SETTLED * cost + rounding) | (damping >= STUCK_DAMPING) | (cost <= rounding)
    )
    return placement, cost, settled


def _moved(placement: Array, step: Array) -> Array:
    """Add steps (F, 6 or 7); with a known camera, slope and scale are one."""
    R, shift, scale, slope = _parts(placement)
    turned = rotation_from_vector(step[:, :3]) @ R
    return _placement(turned, shift + step[:, 3:5], scale + step[:, 5], slope + step[:, -1])


def _best(heads: _Heads) -> tuple[Array, Array, Flags, list[str]]:
    """Fit from every start, and tell where the mirror image of the head fits better.

    The scaled orthographic view is one start. Coarse image points have a second minimum, the head with its depths
    reversed. With f free, the linear solution is a third.
    """
    fits = [_fit(heads, _affine_start(heads))]
    fits.append(_fit(heads, _reversed_start(heads.points, fits[0][0])))
    if heads.free:
        fits.append(_fit(heads, _direct_start(heads)))
    which = np.argmin([cost for _, cost, _ in fits], axis=0)
    each = np.arange(len(which))
    placement, cost, settled = (np.stack(values)[which, each] for values in zip(*fits, strict=True))
    unsettled = "no pose was found from any start: check the image points and the focal length"
    reasons = ["" if minimum else unsettled for minimum in settled]
    if not heads.free:
        # A head behind the camera looks like its mirror image in front.
        mirrored = heads._replace(points=heads.points * [1.0, 1.0, -1.0])
        floor = ROUNDING_ERROR**2 * heads.spread
        behind = _fit(mirrored, _affine_start(mirrored))[1]
        ratio = np.maximum(behind, floor) / np.maximum(cost, floor)
        for frame in np.flatnonzero(ratio ** (heads.freedom / 2) < BETTER_BEHIND):
            reasons[frame] = BEHIND_CAMERA
    return placement, cost, settled, reasons


def _affine_start(heads: _Heads) -> Array:
    """Fit a scaled orthographic view: the limit of a distant camera (DeMenthon & Davis 1995)."""
    middle, size, offset = _centred(heads.plane, heads.seen)
    centre, extent, space = _centred(heads.points, heads.seen)
    transposed = np.swapaxes(space, -1, -2)
    normal = transposed @ space + FLAT_EXTENT * np.eye(3)
    affine = np.swapaxes(np.linalg.solve(normal, transposed @ offset), -1, -2)
    left, values, right = np.linalg.svd(affine, full_matrices=False)
    axes = left @ right
    R = np.concatenate([axes, cross(axes[:, 0], axes[:, 1])[:, None]], axis=1)
    scale = values.mean(axis=-1) * size / extent
    shift = middle - scale[:, None] * np.einsum("fij,fj->fi", axes, centre)
    return _placement(R, shift, scale, np.zeros(len(R)) if heads.free else scale)


def _reversed_start(points: Array, placement: Array) -> Array:
    """Turn heads (F, P, 3) so that they look nearly the same with their depths reversed (Necker 1832).

    The head is mirrored in the plane across its thinnest direction, then along the optical axis: together a
    rotation. A flat head would look exactly the same from afar.
    """
    thinnest = np.linalg.svd(points, full_matrices=False)[2][:, 2]
    mirror = np.eye(3) - 2 * thinnest[:, :, None] * thinnest[:, None, :]
    R, *rest = _parts(placement)
    return _placement(np.diag([1.0, 1.0, -1.0]) @ R @ mirror, *rest)


def _direct_start(heads: _Heads) -> Array:
    """Take the placement from the linear equations, f being free.

    NaN if the equations do not determine it; its fit fails if it has points on both sides of the camera.
    """
    R, t, f, _ = _solve_linear(heads.points, heads.plane, heads.seen)
    depth = t[:, 2]
    side = np.sign(depth)
    # A head behind the camera looks like one turned by half a turn about the optical axis, its depths reversed.
    R = R * np.stack([side, side, np.ones_like(side)], axis=-1)[..., None]
    return _placement(R, (f / depth)[:, None] * t[:, :2], f / np.abs(depth), 1 / depth)


def _solve_linear(points: Array, image: Array, seen: Flags) -> Projection:
    """Solve the linear equations of F heads of centred points (F, P, 3) and image points (F, P, 2), `seen` (F, P)."""
    middle, size, plane = _centred(image, seen)
    space = np.concatenate([points, np.ones_like(points[..., :1])], axis=-1) * seen[..., None]
    zero = np.zeros_like(space)
    u, v = plane[..., :1], plane[..., 1:]
    rows = np.concatenate(
        [np.concatenate([space, zero, -u * space], -1), np.concatenate([zero, space, -v * space], -1)], axis=1
    )
    _, values, vectors = np.linalg.svd(rows, full_matrices=False)
    P = vectors[:, -1].reshape(-1, 3, 4)
    P[:, :2] = size[:, None, None] * P[:, :2] + middle[..., None] * P[:, 2:]
    P *= (np.sign(np.linalg.det(P[:, :, :3])) / np.linalg.norm(P[:, 2, :3], axis=-1))[:, None, None]
    depth = np.einsum("fi,fpi->fp", P[:, 2, :3], points) + P[:, 2, 3:]
    f = np.sqrt((P[:, :2, :3] ** 2).sum(axis=(1, 2)) / 2)
    P[:, :2] /= f[:, None, None]
    P[~(values[:, 10] > RANK_RATIO * values[:, 0])] = np.nan
    R, t = best_rotation(P[:, :, :3])[0], P[:, :, 3]
    determined = np.isfinite(t).all(axis=1)
    return Projection(R, t, np.where(determined, f, np.nan), determined & ((depth > 0) | ~seen).all(axis=-1))


def _focal_length(J: Array, cost: Array, settled: Flags, placement: Array) -> tuple[Array, list[str]]:
    """Return the standard deviation of a free f, and why f is not determined."""
    A = np.where(settled[:, None, None], J.reshape(len(J), 2 * J.shape[1], 7), 0.0)
    unit = np.linalg.norm(A, axis=1)
    A = A / np.where(unit > 0, unit, 1.0)[:, None]
    values, vectors = np.linalg.eigh(np.swapaxes(A, 1, 2) @ A)
    variance = (vectors[:, -1] ** 2 / np.maximum(values, np.finfo(np.float64).tiny)).sum(axis=-1)
    freedom = J.any(axis=-1).sum(axis=(1, 2)) - 7
    deviation = np.sqrt(cost / freedom * variance) / unit[:, -1]
    *_, scale, slope = _parts(placement)
    reasons = np.select(
        [
            ~settled,  # the fit has a reason of its own
            values[:, 0] <= DETERMINED_EIGENVALUE,
            slope <= -CLEARLY_SIGMAS * deviation,
            slope <= ROUNDING_ERROR,
        ],
        [
            "",
            "the image does not determine f: other cameras give the same; give f",
            BEHIND_CAMERA,
            "the perspective is too weak to determine f (the head is far away); give f",
        ],
        "",
    )
    return np.abs(scale / slope**2) * deviation, reasons.tolist()


def _misfits(heads: _Heads, placement: Array, cost: Array, settled: Flags) -> tuple[Ints, Array, Array]:
    r"""Name the point that does not fit: row (F,), -1 if all fit; squared error without it (F,); chance (F,).

    A head is fitted again without each of its points. If a single point is wrong, leaving it out reduces the squared
    error to that of measuring. For normal errors of unknown size, and one point chosen beforehand, :math:`F = \frac{(S
    - S_j)/2}{S_j / m}` follows Fisher's distribution with 2 and m degrees of freedom, m being those without the point,
    and so :math:`P(F > x) = (S_j/S)^{m/2}` (the mean-shift outlier test of Cook & Weisberg 1982, for a pair of
    observations). All P points are examined, hence the factor P (Bonferroni).
    """
    floor = ROUNDING_ERROR**2 * heads.spread
    frames, points = np.nonzero(heads.seen & (settled & (cost > floor))[:, None])
    without = heads.take(frames)
    without.to_image[np.arange(len(points)), points] = 0.0
    # A misfit can lead the fit of all points far astray, hence the start from the orthographic view.
    left = np.full(heads.seen.shape, np.inf)
    left[frames, points] = np.maximum(
        _fit(without, _affine_start(without), MISFIT_PRECISION)[1], floor[frames]
    )
    point, least = left.argmin(axis=-1), left.min(axis=-1)
    chance = np.minimum(heads.seen.sum(axis=-1) * (least / cost) ** (heads.freedom / 2 - 1), 1.0)
    chance = np.where(np.isfinite(least), chance, 1.0)
    named = chance <= FALSE_ALARMS
    return np.where(named, point, -1), np.where(named, least, np.nan), chance


def _warn(pose: HeadPose, chance: Array) -> None:
    """Warn once of every point that does not fit in more frames than accident explains, with its worst frame.

    The k smallest of the chances (F,) count, for the largest k with the k-th at most k / F of `FALSE_ALARMS` (Benjamini
    & Hochberg 1995).
    """
    ordered = np.sort(chance)
    below = ordered[ordered <= FALSE_ALARMS * np.arange(1, len(chance) + 1) / max(len(chance), 1)]
    beyond = chance <= below.max(initial=-1.0)
    for index, name in enumerate(pose.head.names):
        frames = np.flatnonzero(beyond & [misfit == name for misfit in pose.misfit])
        if frames.size:
            worst = frames[pose.rms[frames].argmax()]
            many = f" in {frames.size} of {len(chance)} frames, most in frames[{worst}]"
            where = many if len(chance) > 1 else ""
            warnings.warn(
                f"head point {name} does not fit the others{where}: residual {pose.residuals[worst, index]:.4g}, "
                f"rms {pose.rms[worst]:.4g} with it and {pose.rms_without[worst]:.4g} without (image units); "
                "check its place on the head and in the image, or leave it out",
                HeadWarning,
                stacklevel=4,
            )
