r"""The pose of the camera, or its focal length too, from six or more points of a head (Lee & Chen 1985, §2.1).

The squared reprojection error is minimised over the head's pose. With the points centred and of size 1,
:math:`q = R\,(p - c) / \sigma`, and the head's centre at depth :math:`z`, their perspective image is

.. math:: u = \frac{a + s\,q_{xy}}{1 + d\,q_z}, \qquad s = f \sigma / z, \quad d = \sigma / z,

where :math:`a` is the image of the centre. Written so, the unknowns :math:`R, a, s, d` are each seen in the
image and the limit of a far camera, :math:`d = 0`, is an ordinary place (the scaled orthographic projection),
while depth and f alone would run to infinity together. With f free there are seven unknowns; with a known camera
:math:`u` is the normalised image (f = 1), :math:`d = s`, and six.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from posekit.cameras.head_points import DEGENERATE_EXTENT, TABLE_A2, HeadPoints, degeneracy, head_points_cam
from posekit.cameras.lee_chen import LeeChenCamera
from posekit.cameras.pinhole import PinholeCamera
from posekit.errors import HeadError, refusal
from posekit.geometry import Array, Flags, Ints, Record, cross, rotation_from_vector

__all__ = ["TABLE_A2", "HeadPoints", "HeadPose", "calibrate", "dlt", "head_points_cam", "solve_pose"]

MAX_STEPS: Final = 60
#: Promised decrease of the squared error, as a fraction of it, that ends a fit: unknowns are then within about 1e-5 of
#: their standard deviation.
FIT_PRECISION: Final = 1e-10

#: The same after the last step: if f is hardly determined, the fit converges slowly.
NEARLY_SETTLED: Final = 1e-6

#: The same for a fit without one point: enough to judge it.
MISFIT_PRECISION: Final = 1e-3

#: Error of a residual, as a fraction of the image point's coordinates, that is rounding.
RESIDUAL_ROUNDING: Final = 4 * np.finfo(np.float64).eps

#: Error, as a fraction of the head's size in the image, from which the head with reversed depths is tried.
#:
#: Chosen on heads of 20 to 150 pixels with 1 to 5 pixels of noise: where the other starts missed the best known minimum
#: (4 of 400 heads of six points, 2 to 8 m away, at 5 pixels and f = 1000 pixels), the error was above this.
COARSE_ERROR: Final = 0.2

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


class HeadWarning(UserWarning):
    """A head point does not fit the others, in one frame or in more frames than accident explains."""


class Projection(NamedTuple):
    r"""Projection matrices :math:`P \sim \mathrm{diag}(f, f, 1)\,[R\,|\,t]` of F frames; NaN if not determined.

    Attributes
    ----------
    P : array (F, 3, 4)
        Scaled so that the third row's first three entries have length 1 and the determinant of the left part is
        positive.
    R : array (F, 3, 3)
        The rotation nearest to ``diag(1/f, 1/f, 1) P``: head to camera.
    t : array (F, 3)
        The head frame's origin in the camera frame, metres.
    f : array (F,)
        In the image's unit.
    in_front : bool array (F,)
        Whether all points are in front of the camera.
    """

    P: Array
    R: Array
    t: Array
    f: Array
    in_front: Flags


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
        Of one frame, if the image is (P, 2).

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

    As `calibrate`, with the reprojection error measured in pixels as the lens distorts them. A pixel that no ray
    reaches counts as not seen.

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
    usable = np.array([not reason for reason in reasons])
    places = np.broadcast_to(head.points, (len(points), *head.points.shape))
    with np.errstate(all="ignore"):
        found = _solve_linear(places, points, seen & usable[:, None])
    if np.ndim(image) == 2 and not found.in_front[0]:
        determined = np.isfinite(found.f[0])
        many = "the linear equations have many solutions; use calibrate, or add a head point"
        raise HeadError(reasons[0] or (BEHIND_CAMERA if determined else many))
    return found


class _Heads(NamedTuple):
    """F heads: centred points (F, P, 3) of size 1, image points (F, P, 2), 1 for seen points (F, P), and the camera."""

    points: Array
    image: Array
    seen: Array
    camera: PinholeCamera | LeeChenCamera | None

    def take(self, rows: Ints) -> _Heads:
        camera = None if self.camera is None else self.camera.take(rows)
        return _Heads(self.points[rows], self.image[rows], self.seen[rows], camera)

    @property
    def unknowns(self) -> int:
        return 7 if self.camera is None else 6

    @property
    def spread(self) -> Array:
        """Sum of the squared distances of the image points from their mean (F,)."""
        weight = self.seen[..., None]
        mean = (self.image * weight).sum(axis=1, keepdims=True) / weight.sum(axis=1, keepdims=True)
        return np.asarray((((self.image - mean) * weight) ** 2).sum(axis=(1, 2)))


#: Best placements (F, 13), their costs (F,), infinite if there is none, and whether they are minima (F,).
#:
#: A placement is R (9), shift a (2), scale s and slope d.
_Fit = tuple[Array, Array, Flags]


def _placement(R: Array, shift: Array, scale: Array, slope: Array) -> Array:
    return np.concatenate([R.reshape(-1, 9), shift, scale[:, None], slope[:, None]], axis=1)


def _parts(placement: Array) -> tuple[Array, Array, Array, Array]:
    return placement[:, :9].reshape(-1, 3, 3), placement[:, 9:11], placement[:, 11], placement[:, 12]


def _better(one: _Fit, other: _Fit) -> _Fit:
    """Choose the fits of lower cost, the first if they tie."""
    lower = other[1] < one[1]
    placement = np.where(lower[:, None], other[0], one[0])
    return placement, np.where(lower, other[1], one[1]), np.where(lower, other[2], one[2])


def _place(head: HeadPoints, image: ArrayLike, camera: PinholeCamera | LeeChenCamera | None) -> HeadPose:
    """Fit the head in every frame, reject impossible fits, and warn of misfits."""
    points, seen, reasons = _sighted(head, image)
    plane = points
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
    rows = np.flatnonzero([not reason for reason in reasons])
    centre, size, centred = _centred(head.points, seen[rows])
    own = None if camera is None else camera.take(rows)
    heads = _Heads(centred, points[rows], seen[rows].astype(np.float64), own)
    # Exact image points divide 0 by 0 where chances are compared; absurd ones overflow, and have no fit.
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        fitted, wrong = _best(heads, plane[rows])
        f, f_deviation, undetermined = _focal_length(heads, fitted)
        point, cost_without, chance = _misfits(heads, plane[rows], fitted)
    placement, cost, settled = fitted
    R, shift, scale, _ = _parts(placement)
    unit = f if camera is None else np.ones(len(rows))
    z = unit * size / scale
    centre_cam = np.concatenate([shift * (z / unit)[:, None], z[:, None]], axis=1)
    for k, row in enumerate(rows):
        reasons[row] = wrong[k] or undetermined[k]
        if reasons[row] and point[k] >= 0:
            name = head.names[point[k]]
            reasons[row] += f"; check head point {name} first, which does not fit the others"
    found = np.array([not reason for reason in reasons], dtype=np.bool_)
    residual = np.linalg.norm(_look(heads, placement)[0].reshape(*heads.image.shape), axis=-1)

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
        points_cam=head_points_cam(R_cam_head, t_cam_head, head),
        residuals=np.where(seen, whole(residual, settled), np.nan),
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
    weight = seen[..., None] / np.maximum(seen.sum(axis=-1), 1)[:, None, None]
    offset = (points - (weight * points).sum(axis=1, keepdims=True)) * np.sqrt(weight)
    along, across = np.linalg.svd(offset, compute_uv=False).T
    for frame in np.flatnonzero(across <= np.maximum(DEGENERATE_EXTENT * along, VANISHING_SPREAD)):
        reasons[frame] = reasons[frame] or "the image points lie on one line or in one point: check them"
    return points, seen, reasons


def _centred(points: Array, seen: Flags) -> tuple[Array, Array, Array]:
    """Return each frame's centre (F, 3) and size (F,) of the seen points, and the points relative to them."""
    weight = seen / seen.sum(axis=-1, keepdims=True)
    centre = weight @ points
    offset = np.where(seen[..., None], points - centre[:, None], 0.0)
    size = np.sqrt((weight[..., None] * offset**2).sum(axis=(1, 2)))
    return centre, size, offset / size[:, None, None]


def _look(heads: _Heads, placement: Array) -> tuple[Array, Array, Flags]:
    """Return residuals (F, 2P), their derivatives (F, 2P, 6 or 7), and whether all points are before the camera.

    The derivatives are by a rotation vector in the camera's frame, shift, scale, and slope if f is free.
    """
    R, shift, scale, slope = _parts(placement)
    q = heads.points @ np.swapaxes(R, -1, -2)
    x, y, z = q[..., 0], q[..., 1], q[..., 2]
    depth = 1.0 + slope[:, None] * z
    possible = (depth > 0).all(axis=-1) & (scale > 0)
    inverse = heads.seen / np.where(depth > 0, depth, 1.0)
    uv = (shift[:, None] + scale[:, None, None] * q[..., :2]) * inverse[..., None]
    J = np.zeros((*z.shape, 2, heads.unknowns))
    by_slope = -uv * (z * inverse)[..., None]
    near, bend = scale[:, None] * inverse, uv * (slope[:, None] * inverse)[..., None]
    J[..., 0] = np.stack([np.zeros_like(z), -near * z], axis=-1) - bend * y[..., None]
    J[..., 1] = np.stack([near * z, np.zeros_like(z)], axis=-1) + bend * x[..., None]
    J[..., 2] = np.stack([-near * y, near * x], axis=-1)
    J[..., 0, 3] = J[..., 1, 4] = inverse
    J[..., 5] = q[..., :2] * inverse[..., None]
    if heads.camera is None:
        J[..., 6] = by_slope
    else:
        J[..., 5] += by_slope
        J = heads.camera.jacobian(uv) @ J
        uv = heads.camera.project(np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1))
    residual = (uv - heads.image) * heads.seen[..., None]
    J = J * heads.seen[..., None, None]
    rows = 2 * z.shape[1]
    return residual.reshape(-1, rows), J.reshape(-1, rows, heads.unknowns), possible


def _fit(heads: _Heads, start: Array, precision: float = FIT_PRECISION) -> _Fit:
    """Minimise the sum of squared residuals from a start (Levenberg 1944; Marquardt 1963; damping: Nielsen 1999).

    A start with NaN, or with points behind the camera, gives no fit.
    """
    placement, total = start.copy(), len(start)
    floor = RESIDUAL_ROUNDING * np.sqrt(np.einsum("fpi,fpi->f", heads.image, heads.image))
    promise, damping, settled = np.full(total, np.nan), np.full(total, 1e-4), np.zeros(total, dtype=np.bool_)
    residual, J, possible = _look(heads, placement)
    cost = np.einsum("fi,fi->f", residual, residual)
    cost = np.where(possible & np.isfinite(cost), cost, np.inf)
    active = np.flatnonzero(np.isfinite(cost))
    residual, J = residual[active], J[active]
    for _ in range(MAX_STEPS if active.size else 0):
        some, old, weight, noise = heads.take(active), cost[active], damping[active], floor[active]
        scale = np.linalg.norm(J, axis=1)
        scale = np.where(scale > 0, scale, 1.0)
        scaled = J / scale[:, None]
        normal, gradient = np.swapaxes(scaled, 1, 2) @ scaled, np.einsum("fpi,fp->fi", scaled, residual)
        damped = normal + weight[:, None, None] * np.eye(heads.unknowns)
        step = -np.linalg.solve(damped, gradient[..., None])[..., 0]
        gain = -np.einsum("fi,fi->f", step, 2 * gradient + np.einsum("fij,fj->fi", normal, step))
        trial = _moved(some, placement[active], step / scale)
        there, J_there, possible = _look(some, trial)
        new = np.where(possible, np.einsum("fi,fi->f", there, there), np.inf)
        rounding = noise * np.sqrt(old)
        better = new <= old + rounding
        done = (gain <= np.maximum(precision * old, noise**2)) & (weight <= 1e-4)
        ratio = np.clip((old - new + rounding) / np.maximum(gain + rounding, 1e-300), 0.0, 1.0)
        falls = np.maximum(1.0 - (2.0 * ratio - 1.0) ** 3, 0.03)
        damping[active] = np.maximum(weight * np.where(better, falls, 10.0), 1e-13)
        placement[active[better]], cost[active[better]] = trial[better], new[better]
        residual[better], J[better] = there[better], J_there[better]
        promise[active] = gain
        exact = (noise > 0) & (cost[active] <= noise**2)
        settled[active] = done | exact | (damping[active] > 1e8)
        left = ~settled[active]
        active, residual, J = active[left], residual[left], J[left]
        if not active.size:
            break
    # Products of many rotations drift from orthonormal by a few roundings; one Newton step corrects them.
    R = _parts(placement)[0]
    placement[:, :9] = (1.5 * R - 0.5 * R @ np.swapaxes(R, -1, -2) @ R).reshape(-1, 9)
    return placement, cost, settled | (promise <= NEARLY_SETTLED * cost)


def _moved(heads: _Heads, placement: Array, step: Array) -> Array:
    """Add steps (F, 6 or 7)."""
    R, shift, scale, slope = _parts(placement)
    scale = scale + step[:, 5]
    slope = slope + step[:, 6] if heads.camera is None else scale
    return _placement(rotation_from_vector(step[:, :3]) @ R, shift + step[:, 3:5], scale, slope)


def _best(heads: _Heads, plane: Array) -> tuple[_Fit, list[str]]:
    """Fit from the best starts, and tell where the mirror image of the head fits better.

    From the scaled orthographic view a known camera misses no minimum; with f free, the linear solution is tried, too.
    Coarse image points have a second minimum, the head with its depths reversed: it is tried as well.
    """
    best = _fit(heads, _affine_start(heads, plane))
    if heads.camera is None:
        best = _better(_fit(heads, _direct_start(heads, plane)), best)
    coarse = np.flatnonzero(np.isfinite(best[1]) & (best[1] > COARSE_ERROR**2 * heads.spread))
    if coarse.size:
        some, old = heads.take(coarse), (best[0][coarse], best[1][coarse], best[2][coarse])
        again = _better(old, _fit(some, _reversed_start(some.points, old[0])))
        for all_of, new in zip(best, again, strict=True):
            all_of[coarse] = new
    unsettled = "no pose was found from either start: check the image points and the focal length"
    reasons = ["" if settled else unsettled for settled in best[2]]
    if heads.camera is not None:
        # A head behind the camera looks like its mirror image in front.
        mirrored = heads._replace(points=heads.points * [1.0, 1.0, -1.0])
        floor = ROUNDING_ERROR**2 * heads.spread
        behind = _fit(mirrored, _affine_start(mirrored, plane))[1]
        ratio = np.maximum(behind, floor) / np.maximum(best[1], floor)
        freedom = 2 * heads.seen.sum(axis=-1) - heads.unknowns
        for frame in np.flatnonzero(ratio ** (freedom / 2) < BETTER_BEHIND):
            reasons[frame] = BEHIND_CAMERA
    return best, reasons


def _affine_start(heads: _Heads, image: Array) -> Array:
    """Fit a scaled orthographic view: the limit of a distant camera (DeMenthon & Davis 1995)."""
    weight = (heads.seen / heads.seen.sum(axis=-1, keepdims=True))[..., None]
    centre, middle = (weight * heads.points).sum(axis=1), (weight * image).sum(axis=1)
    space = np.where(weight > 0, heads.points - centre[:, None], 0.0)
    offset = np.where(weight > 0, image - middle[:, None], 0.0)
    transposed = np.swapaxes(space, -1, -2)
    normal = transposed @ space + FLAT_EXTENT * np.eye(3)
    affine = np.swapaxes(np.linalg.solve(normal, transposed @ offset), -1, -2)
    left, values, right = np.linalg.svd(affine, full_matrices=False)
    axes = left @ right
    R = np.concatenate([axes, cross(axes[:, 0], axes[:, 1])[:, None]], axis=1)
    scale = values.mean(axis=-1)
    shift = middle - scale[:, None] * np.einsum("fij,fj->fi", axes, centre)
    return _placement(R, shift, scale, np.zeros(len(R)) if heads.camera is None else scale)


def _reversed_start(points: Array, placement: Array) -> Array:
    """Turn heads (F, P, 3) so that they look nearly the same with their depths reversed (Necker 1832).

    The head is mirrored in the plane across its thinnest direction, then along the optical axis: together a
    rotation. A flat head would look exactly the same from afar.
    """
    thinnest = np.linalg.svd(points, full_matrices=False)[2][:, 2]
    mirror = np.eye(3) - 2 * thinnest[:, :, None] * thinnest[:, None, :]
    R, *rest = _parts(placement)
    return _placement(np.diag([1.0, 1.0, -1.0]) @ R @ mirror, *rest)


def _direct_start(heads: _Heads, image: Array) -> Array:
    """Take the placement from the linear equations, f being free.

    NaN if the equations do not determine it or it has points on both sides of the camera.
    """
    seen = heads.seen > 0
    direct = _solve_linear(heads.points, image, seen)
    depth = direct.t[:, 2]
    side = np.sign(depth)
    ahead = (np.einsum("fi,fpi->fp", direct.R[:, 2], heads.points) + depth[:, None]) * side[:, None]
    # A head behind the camera looks like one turned by half a turn about the optical axis, its depths reversed.
    R = direct.R * np.stack([side, side, np.ones_like(side)], axis=-1)[..., None]
    shift, scale = direct.f[:, None] * direct.t[:, :2] / depth[:, None], direct.f / np.abs(depth)
    usable = ((ahead > 0) | ~seen).all(axis=-1)
    return np.where(usable[:, None], _placement(R, shift, scale, 1 / depth), np.nan)


def _solve_linear(points: Array, image: Array, seen: Flags) -> Projection:
    """Solve the linear equations of F heads of points (F, P, 3) and image points (F, P, 2) that are `seen` (F, P)."""
    (space, to_space), (plane, to_plane) = _normalised(points, seen), _normalised(image, seen)
    space = np.where(seen[..., None], space, 0.0)
    u, v = plane[..., 0, None], plane[..., 1, None]
    zero = np.zeros_like(space)
    rows = np.concatenate(
        [np.concatenate([space, zero, -u * space], -1), np.concatenate([zero, space, -v * space], -1)], axis=1
    )
    finite = np.isfinite(rows).all(axis=(1, 2))
    _, values, vectors = np.linalg.svd(np.where(finite[:, None, None], rows, 0.0), full_matrices=False)
    determined = finite & (values[:, 10] > RANK_RATIO * values[:, 0])
    from_plane = np.linalg.inv(np.where(finite[:, None, None], to_plane, np.eye(3)))
    P = from_plane @ vectors[:, -1].reshape(-1, 3, 4) @ to_space
    P /= np.linalg.norm(P[:, 2:, :3], axis=-1, keepdims=True)
    P *= np.where(np.linalg.det(P[:, :, :3]) < 0, -1.0, 1.0)[:, None, None]
    depth = np.einsum("fi,fpi->fp", P[:, 2, :3], points) + P[:, 2, 3:]
    in_front = ((depth > 0) | ~seen).all(axis=-1)
    determined &= np.isfinite(P).all(axis=(1, 2))
    P[~determined] = np.eye(3, 4)  # the SVD below refuses NaN
    f = np.sqrt((P[:, :2, :3] ** 2).sum(axis=(1, 2)) / 2)
    unscaled = P.copy()
    unscaled[:, :2] /= f[:, None, None]
    left, _, right = np.linalg.svd(unscaled[:, :, :3])
    R, t = left @ right, unscaled[:, :, 3].copy()
    for array in (P, R, t, f):
        array[~determined] = np.nan
    return Projection(P, R, t, f, in_front & determined)


def _normalised(points: Array, seen: Flags) -> tuple[Array, Array]:
    """Move points (F, P, D) to mean 0 and mean distance sqrt(D); return them homogeneous, and the matrix."""
    dimension = points.shape[-1]
    weight = seen / seen.sum(axis=-1, keepdims=True)
    centre = np.einsum("fp,fpi->fi", weight, points)
    distance = (weight * np.linalg.norm(points - centre[:, None], axis=-1)).sum(axis=-1)
    scale = np.sqrt(dimension) / distance
    matrix = np.zeros((len(points), dimension + 1, dimension + 1))
    matrix[:, range(dimension), range(dimension)] = scale[:, None]
    matrix[:, :-1, -1] = -scale[:, None] * centre
    matrix[:, -1, -1] = 1.0
    normalised = scale[:, None, None] * (points - centre[:, None])
    return np.concatenate([normalised, np.ones((*points.shape[:2], 1))], axis=-1), matrix


def _focal_length(heads: _Heads, fitted: _Fit) -> tuple[Array, Array, list[str]]:
    """Return f, its standard deviation, and why it is not determined; a known camera's own f."""
    placement, cost, settled = fitted
    if heads.camera is not None:
        known = heads.camera.f if isinstance(heads.camera, LeeChenCamera) else heads.camera.K[0, 0]
        return np.full(len(cost), known), np.zeros(len(cost)), [""] * len(cost)
    J = _look(heads, placement)[1]
    unit = np.linalg.norm(J, axis=1)
    scaled = J / np.where(unit > 0, unit, 1.0)[:, None]
    normal = np.swapaxes(scaled, 1, 2) @ scaled
    normal[~settled] = np.eye(heads.unknowns)
    values, vectors = np.linalg.eigh(normal)
    freedom = 2 * heads.seen.sum(axis=-1) - heads.unknowns
    variance = (vectors[:, -1] ** 2 / np.maximum(values, np.finfo(np.float64).tiny)).sum(axis=-1)
    deviation = np.sqrt(cost / freedom * variance) / unit[:, -1]
    *_, scale, slope = _parts(placement)
    reasons = np.select(
        [
            ~settled,  # the fit has a reason of its own
            values[:, 0] <= DETERMINED_EIGENVALUE,
            slope <= -CLEARLY_SIGMAS * deviation,
            slope <= 0,
        ],
        [
            "",
            "the image does not determine f: other cameras give the same; give f",
            BEHIND_CAMERA,
            "the perspective is too weak to determine f (the head is far away); give f",
        ],
        "",
    )
    return scale / slope, np.abs(scale / slope**2) * deviation, reasons.tolist()


def _misfits(heads: _Heads, plane: Array, fitted: _Fit) -> tuple[Ints, Array, Array]:
    r"""Name the point that does not fit: row (F,), -1 if all fit; squared error without it (F,); chance (F,).

    A head is fitted again without each of its points. If one point alone is wrong, the squared error falls to
    that of measuring. For normal errors of unknown size, and one point chosen beforehand,
    :math:`F = \frac{(S - S_j)/2}{S_j / m}` follows Fisher's distribution with 2 and m degrees of freedom, m being those
    without the point, and so :math:`P(F > x) = (S_j/S)^{m/2}` (the mean-shift outlier test of Cook & Weisberg 1982, for
    a pair of observations). All P points are examined, hence the factor P (Bonferroni).
    """
    placement, total, settled = fitted
    floor = ROUNDING_ERROR**2 * heads.spread
    frames, points = np.nonzero((heads.seen > 0) & (settled & (total > floor))[:, None])
    without = heads.take(frames)
    seen = without.seen.copy()
    seen[np.arange(len(points)), points] = 0.0
    without = without._replace(seen=seen)
    # The placement of all points is the start or, if the misfit leads it far astray, the orthographic view.
    starts = [placement[frames], _affine_start(without, plane[frames])]
    costs = []
    for start in starts:
        residual, _, possible = _look(without, start)
        costs.append(np.where(possible, np.einsum("fi,fi->f", residual, residual), np.inf))
    start = np.where((costs[1] < costs[0])[:, None], starts[1], starts[0])
    left = np.full(heads.seen.shape, np.inf)
    left[frames, points] = np.maximum(_fit(without, start, MISFIT_PRECISION)[1], floor[frames])
    point, cost = left.argmin(axis=-1), left.min(axis=-1)
    n = heads.seen.sum(axis=-1)
    freedom = 2 * (n - 1) - heads.unknowns
    chance = np.minimum(n * (cost / total) ** (freedom / 2), 1.0)
    chance = np.where(np.isfinite(cost), chance, 1.0)
    named = chance <= FALSE_ALARMS
    return np.where(named, point, -1), np.where(named, cost, np.nan), chance


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
