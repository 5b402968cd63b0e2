r"""The camera's pose, and its focal length if unknown, from six or more head points (Lee & Chen 1985, §2.1).

The squared reprojection error is minimised over the head's pose. Head points :math:`p` with centre :math:`c` and size
:math:`\sigma` are centred, scaled and rotated: :math:`q = R\,(p - c) / \sigma`. If the centre is at depth :math:`z`,
the perspective image of a point is

.. math:: u = \frac{a + s\,q_{xy}}{1 + d\,q_z}, \qquad s = f \sigma / z, \quad d = \sigma / z,

where :math:`a` is the image of the centre. The unknowns are :math:`R, a, s, d`. A camera at infinity has :math:`d = 0`,
which is the scaled orthographic projection. If z and f were the unknowns instead of s and d, both would diverge for a
distant camera. If f is unknown, there are seven unknowns: three of :math:`R`, two of :math:`a`, :math:`s` and
:math:`d`. If the camera is known, :math:`u` is the normalised image (f = 1) and :math:`d = s`, so there are six
unknowns. The camera's Jacobian then converts residuals to pixels.
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
from posekit.geometry import Array, Flags, Ints, Record, cross, rotation_from_vector

__all__ = ["TABLE_A2", "HeadPoints", "HeadPose", "HeadWarning", "solve_pose"]

MAX_STEPS: Final = 60
#: Relative decrease of the squared error that ends a fit. The error of the unknowns is then about 1e-5 of their
#: standard deviation.
FIT_PRECISION: Final = 1e-10

#: Relative decrease of the squared error that ends a fit without one of the points: sufficient to compare errors.
MISFIT_PRECISION: Final = 1e-3

#: Initial d of a head at half a metre from the camera, where a start from the scaled orthographic pose can fail.
NEAR_SLOPE: Final = 0.15

#: Initial, smallest and largest damping, as a fraction of the normal equations' diagonal. Above the largest damping no
#: step decreases the error.
DAMPING: Final = (1e-4, 1e-13, 1e8)

#: Rounding error of an image point, as a fraction of the head's size in the image.
ROUNDING_ERROR: Final = 1e-10

#: p-value below which a better fit of a head behind the camera is significant.
BETTER_BEHIND: Final = 1e-4

#: Probability that a point of a correct head with normal errors is reported as a misfit.
FALSE_ALARMS: Final = 5e-3

BEHIND_CAMERA: Final = (
    "the points fit only a head behind the camera, as in a mirrored image: y must point down in the "
    "image, and left and right must be the person's own"
)
WEAK: Final = "the image does not determine f (the head is far away, or mirrored); give f"
UNSETTLED: Final = "no pose was found from any start: check the image points and the focal length"


class HeadWarning(UserWarning):
    """Warning that a head point fits the other head points badly, in more frames than chance explains."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class HeadPose(Record):
    """The pose of a head in each of F frames.

    Attributes
    ----------
    head : HeadPoints
        The head points, in the head's own frame.
    reasons : tuple of str
        For each frame, the reason why it has no pose; an empty string if it has one. If a frame has no pose, its R, t,
        f and points are NaN.
    R_cam_head : array (F, 3, 3)
        Rotation from the head's frame to the camera's (OpenCV: x right, y down, z forward).
    t_cam_head : array (F, 3)
        The head frame's origin in the camera frame, metres.
    f : array (F,)
        The camera's focal length, in the unit of the image, or its estimate if the camera's f is None. The estimate is
        imprecise if the head is far away.
    points_cam : array (F, P, 3)
        All head points, seen or unseen, in the camera frame, metres.
    residuals : array (F, P)
        Distance between a point's projection and its image point, in the image's unit; NaN if not seen.
    rms : array (F,)
        Root of the mean squared residual of the seen points.
    misfit : tuple of str or None
        For each frame, the point that does not fit the other points; None if all points fit. If image points have
        normally distributed errors, one in two hundred frames has a misfit by chance. posekit warns only if the share
        of frames with a misfit is higher.
    """

    head: HeadPoints
    reasons: tuple[str, ...]
    R_cam_head: Array
    t_cam_head: Array
    f: Array
    points_cam: Array
    residuals: Array
    rms: Array
    misfit: tuple[str | None, ...]

    @property
    def found(self) -> Flags:
        """Whether each frame has a pose (F,)."""
        return np.array([not reason for reason in self.reasons], dtype=np.bool_)

    def point(self, name: str) -> Array:
        """Return the positions (F, 3) of one point of the head, camera frame, metres."""
        return np.asarray(self.points_cam[:, self.head.names.index(name)])


def solve_pose(head: HeadPoints, image: ArrayLike, camera: PinholeCamera | LeeChenCamera) -> HeadPose:
    r"""Estimate the head's pose from its image (perspective-n-point), and f if it is unknown.

    The fit minimises the reprojection error in the unit of the image points. Lens distortion is linearised at the image
    points. A `HeadWarning` names a point that does not fit the other points.

    Parameters
    ----------
    head : HeadPoints
        P points, metres.
    image : array (P, 2) or (F, P, 2)
        Image points; unseen points are NaN. A pixel to which no ray projects counts as unseen.
    camera : PinholeCamera or LeeChenCamera
        If its f is None, f is estimated; image points are then relative to the principal point, y down.

    Returns
    -------
    HeadPose
        The pose of each frame; an image of shape (P, 2) counts as one frame.

    Raises
    ------
    HeadError
        If the image's shape does not fit the head, or an image (P, 2) has no pose: its points are too few or
        degenerate, the head is behind the camera, or f is undetermined.

    Examples
    --------
    >>> image = TABLE_A2.points[:, [2, 1]] * [-0.0125, -0.0125] / (1 - TABLE_A2.points[:, :1] / 4)
    >>> solve_pose(TABLE_A2, image, LeeChenCamera(f=None)).f.round(9)
    array([0.05])
    """
    points = np.array(image, dtype=np.float64)
    points = points[None] if points.ndim == 2 else points
    count = len(head.names)
    if points.ndim != 3 or points.shape[1:] != (count, 2) or np.isinf(points).any():
        got = f"shape {np.shape(image)}{' with infinite numbers' if np.isinf(points).any() else ''}"
        expected = f"({count}, 2) or (F, {count}, 2): {', '.join(head.names)}"
        raise refusal("image points", "", got, expected, "give NaN for unseen points", error=HeadError)
    known_f = np.asarray(camera.K[0, 0] if isinstance(camera, PinholeCamera) else camera.f, dtype=np.float64)
    free = bool(np.isnan(known_f).all())
    if known_f.size not in (1, len(points)):
        got, expected = f"{known_f.size} values", f"{len(points)}, one a frame"
        raise refusal("camera", "f", got, expected, error=HeadError)
    with np.errstate(all="ignore"):  # far outside the image the lens's polynomial overflows to NaN
        plane = points if free else camera.normalize(points)
    seen = np.asarray(np.isfinite(plane).all(axis=-1))
    plane = np.where(seen[..., None], plane, 0.0)
    to_image = np.broadcast_to(np.eye(2), (*plane.shape, 2)) if free else camera.jacobian(plane)
    reasons = _degenerate(head, plane, seen)
    rows = np.flatnonzero([not reason for reason in reasons])
    centre, size, centred = _centred(head.points, seen[rows])
    problem = _Problem(centred, plane[rows], to_image[rows] * seen[rows, :, None, None], free)
    x, cost, residual = problem.best()
    R, shift, scale, slope = _parts(x)
    bad, why = (slope <= ROUNDING_ERROR, WEAK) if free else (problem.behind(cost), BEHIND_CAMERA)
    wrong = np.where(np.isfinite(cost), np.where(bad, why, ""), UNSETTLED)
    point, chance = problem.misfits(cost)
    misfit: list[str | None] = [None] * len(points)
    for k, row in enumerate(rows):
        reasons[row] = str(wrong[k])
        if chance[k] <= FALSE_ALARMS:
            misfit[row] = head.names[point[k]]
            if reasons[row]:
                reasons[row] += f"; check head point {misfit[row]} first, which does not fit the others"

    def whole(values: Array, kept: Flags) -> Array:
        """Expand the values of the kept frames to an array of all frames, with NaN for the other frames."""
        full = np.full((len(points), *values.shape[1:]), np.nan)
        full[rows[kept]] = values[kept]
        return full

    good, fitted = wrong == "", np.isfinite(cost)
    with np.errstate(divide="ignore", invalid="ignore"):  # rejected fits
        centre_cam = size[:, None] * np.concatenate([shift / scale[:, None], 1 / slope[:, None]], axis=1)
        f = scale / slope if free else np.broadcast_to(known_f, len(points))[rows]
    R_cam_head = whole(R, good)
    t_cam_head = whole(centre_cam - np.einsum("fij,fj->fi", R, centre), good)
    pose = HeadPose(
        head=head,
        reasons=tuple(reasons),
        R_cam_head=R_cam_head,
        t_cam_head=t_cam_head,
        f=whole(f, good),
        points_cam=head.points @ np.swapaxes(R_cam_head, -1, -2) + t_cam_head[:, None],
        residuals=np.where(seen, whole(np.linalg.norm(residual, axis=-1), fitted), np.nan),
        rms=np.sqrt(whole(cost, fitted) / np.maximum(seen.sum(axis=-1), 1)),
        misfit=tuple(misfit),
    )
    if np.ndim(image) == 2 and reasons[0]:
        raise HeadError(reasons[0])
    _warn(pose, chance[good], rows[good])
    return pose


def _degenerate(head: HeadPoints, plane: Array, seen: Flags) -> list[str]:
    """Return, for each frame, the reason why its points determine no camera; an empty string if they determine one."""
    reasons = [degeneracy(head.names, head.points, pattern) for pattern in seen]
    along, across = np.linalg.svd(_centred(plane, seen)[2], compute_uv=False).T
    for frame in np.flatnonzero(across <= DEGENERATE_EXTENT * along):
        reasons[frame] = reasons[frame] or "the image points lie on one line or in one point: check them"
    return reasons


def _centred(points: Array, seen: Flags) -> tuple[Array, Array, Array]:
    """Return the centre (F, D) and RMS size (F,) of the seen points (F, P, D), and the points centred and scaled."""
    weight = seen / np.maximum(seen.sum(axis=-1, keepdims=True), 1)
    centre = (weight[..., None] * points).sum(axis=1)
    offset = np.where(seen[..., None], points - centre[:, None], 0.0)
    size = np.sqrt((weight[..., None] * offset**2).sum(axis=(1, 2)))
    return centre, size, offset / np.where(size > 0, size, 1.0)[:, None, None]


def _parts(x: Array) -> tuple[Array, Array, Array, Array]:
    """Split poses (F, 13) into R, a, s and d of the formula of this module."""
    return x[:, :9].reshape(-1, 3, 3), x[:, 9:11], x[:, 11], x[:, 12]


def _pose(R: Array, shift: Array, scale: Array, slope: Array) -> Array:
    return np.concatenate([R.reshape(-1, 9), shift, scale[:, None], slope[:, None]], axis=1)


class _Problem(NamedTuple):
    """Least-squares problem of F heads.

    `points` (F, P, 3) are head points, centred and scaled to size 1. `plane` (F, P, 2) are normalised image points.
    `to_image` (F, P, 2, 2) is the Jacobian of the camera, zero for unseen points. `free` is true if f is unknown.
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
        """Number of residuals minus number of unknowns (F,)."""
        return np.asarray(2 * self.seen.sum(axis=-1) - (7 if self.free else 6))

    @property
    def rounding(self) -> Array:
        """Squared reprojection error (F,) that rounding of image points causes."""
        _, size, offset = _centred(self.plane, self.seen)
        spread = np.einsum("fpij,fpj->fpi", self.to_image, size[:, None, None] * offset)
        return np.asarray(ROUNDING_ERROR**2 * (spread**2).sum(axis=(1, 2)))

    def take(self, rows: Ints) -> _Problem:
        """Return the selected heads."""
        return _Problem(self.points[rows], self.plane[rows], self.to_image[rows], self.free)

    def look(self, x: Array) -> tuple[Array, Array, Array]:
        """Return squared errors (F,), residuals (F, P, 2) and their Jacobian (F, P, 2, 6 or 7) at poses `x`.

        The squared error is infinite if a point is behind the camera. The columns of the Jacobian are a rotation vector
        in the camera frame, the image a of the centre, s, and d if f is unknown.
        """
        R, shift, scale, slope = _parts(x)
        q = self.points @ np.swapaxes(R, -1, -2)
        depth = 1.0 + slope[:, None] * q[..., 2]
        possible = (depth > 0).all(axis=-1) & (scale > 0)
        inverse = 1 / np.where(depth > 0, depth, 1.0)[..., None]
        uv = (shift[:, None] + scale[:, None, None] * q[..., :2]) * inverse
        by_point = np.zeros((*q.shape[:2], 2, 3))
        by_point[..., 0, 0] = by_point[..., 1, 1] = scale[:, None]
        by_point[..., 2] = -slope[:, None, None] * uv
        by_point *= inverse[..., None]
        by_scale, by_slope = q[..., :2] * inverse, -uv * q[..., 2:] * inverse
        last = [by_scale, by_slope] if self.free else [by_scale + by_slope]
        turning = cross(np.broadcast_to(q[..., None, :], by_point.shape), by_point)
        by_shift = np.eye(2) * inverse[..., None]
        J = self.to_image @ np.concatenate([turning, by_shift, np.stack(last, axis=-1)], axis=-1)
        residual = np.einsum("fpij,fpj->fpi", self.to_image, uv - self.plane)
        cost = (residual**2).sum(axis=(1, 2))
        return np.where(possible & np.isfinite(cost), cost, np.inf), residual, J

    def fit(self, x: Array, precision: float = FIT_PRECISION) -> tuple[Array, Array, Array]:
        """Minimise the squared error from poses `x` by Levenberg-Marquardt; return poses, errors and residuals."""
        x, (cost, residual, J) = x.copy(), self.look(x)
        damping, rounding = np.full(len(x), DAMPING[0]), self.rounding * 1e-10
        active = np.flatnonzero(np.isfinite(cost))
        for _ in range(MAX_STEPS):
            if not active.size:
                break
            A = J[active].reshape(len(active), 2 * J.shape[1], -1)
            unit = np.linalg.norm(A, axis=1)
            A = A / np.where(unit > 0, unit, 1.0)[:, None]
            damped = np.swapaxes(A, 1, 2) @ A + damping[active, None, None] * np.eye(A.shape[2])
            gradient = np.swapaxes(A, 1, 2) @ residual[active].reshape(len(active), -1, 1)
            step = -np.linalg.solve(damped, gradient)[..., 0] / np.where(unit > 0, unit, 1.0)
            R, shift, scale, slope = _parts(x[active])
            turned = rotation_from_vector(step[:, :3]) @ R
            trial = _pose(turned, shift + step[:, 3:5], scale + step[:, 5], slope + step[:, -1])
            new, *there = self.take(active).look(trial)
            better = new <= cost[active]
            settled = better & (cost[active] - new <= precision * cost[active] + rounding[active])
            kept = active[better]
            x[kept], cost[kept] = trial[better], new[better]
            residual[kept], J[kept] = (values[better] for values in there)
            damping[active] = np.maximum(damping[active] * np.where(better, 0.03, 10.0), DAMPING[1])
            active = active[~settled & (damping[active] < DAMPING[2]) & (cost[active] > rounding[active])]
        return x, cost, residual

    def best(self) -> tuple[Array, Array, Array]:
        """Return the best fit from two starts: the scaled orthographic pose, and its depth reversal (Necker 1832).

        For noisy image points, the squared error has a second minimum near the reversed pose. The reversal mirrors the
        head along its thinnest direction and then along the optical axis; the two reflections together are a rotation.
        If f is unknown, a third fit starts with a head near the camera.
        """
        fits = [self.fit(self.start())]
        thinnest = np.linalg.svd(self.points, full_matrices=False)[2][:, 2]
        mirror = np.eye(3) - 2 * thinnest[:, :, None] * thinnest[:, None, :]
        R, shift, scale, slope = _parts(fits[0][0])
        fits.append(self.fit(_pose(np.diag([1.0, 1.0, -1.0]) @ R @ mirror, shift, scale, slope)))
        if self.free:
            near = self.start()
            near[:, -1] = NEAR_SLOPE
            fits.append(self.fit(near))
        which, each = np.argmin([cost for _, cost, _ in fits], axis=0), np.arange(len(self.points))
        x, cost, residual = (np.stack(values)[which, each] for values in zip(*fits, strict=True))
        return x, cost, residual

    def start(self) -> Array:
        """Return the scaled orthographic pose, the limit for a distant camera (DeMenthon & Davis 1995)."""
        middle, size, offset = _centred(self.plane, self.seen)
        centre, extent, space = _centred(self.points, self.seen)
        affine = np.swapaxes(np.linalg.pinv(space) @ offset, -1, -2)
        left, values, right = np.linalg.svd(affine, full_matrices=False)
        axes = left @ right
        R = np.concatenate([axes, cross(axes[:, 0], axes[:, 1])[:, None]], axis=1)
        scale = values.mean(axis=-1) * size / extent
        shift = middle - scale[:, None] * np.einsum("fij,fj->fi", axes, centre)
        return _pose(R, shift, scale, np.zeros(len(R)) if self.free else scale)

    def behind(self, cost: Array) -> Flags:
        """Return whether a mirrored head fits each frame (F,) better; the head is then behind the camera."""
        mirrored = self._replace(points=self.points * [1.0, 1.0, -1.0])
        other = mirrored.fit(mirrored.start())[1]
        ratio = np.maximum(other, self.rounding) / np.maximum(cost, self.rounding)
        return np.asarray(ratio ** (self.freedom / 2) < BETTER_BEHIND)

    def misfits(self, cost: Array) -> tuple[Ints, Array]:
        r"""Return the index (F,) of the head point that fits the others worst, and the p-value (F,) of its error.

        The fit is repeated without each point j, which reduces the squared error S to :math:`S_j`. For one point and
        normal errors of unknown variance, the p-value is :math:`(S_j/S)^{m/2}` (mean-shift outlier test, Cook &
        Weisberg 1982). Here m is the number of degrees of freedom without the point. All seen points are tested, so the
        p-value is multiplied by their number (Bonferroni).
        """
        frames, points = np.nonzero(self.seen & (np.isfinite(cost) & (cost > self.rounding))[:, None])
        without = self.take(frames)
        without.to_image[np.arange(len(points)), points] = 0.0
        left = np.full(self.seen.shape, np.inf)
        # A misfit can make the fit of all points useless, so each fit starts from the scaled orthographic pose.
        left[frames, points] = without.fit(without.start(), MISFIT_PRECISION)[1]
        least = np.maximum(left.min(axis=1), self.rounding)
        ratio = np.divide(least, cost, out=np.ones(len(cost)), where=np.isfinite(least) & np.isfinite(cost))
        chance = self.seen.sum(axis=-1) * ratio ** (self.freedom / 2 - 1)
        return left.argmin(axis=1), np.minimum(chance, 1.0)


def _warn(pose: HeadPose, chance: Array, rows: Ints) -> None:
    """Warn once for each head point that fits badly in more frames than chance explains; name its worst frame.

    The procedure of Benjamini & Hochberg (1995) selects the frames by their p-values, with the false discovery rate
    `FALSE_ALARMS`.
    """
    ordered = np.sort(chance)
    below = ordered[ordered <= FALSE_ALARMS * np.arange(1, len(chance) + 1) / max(len(chance), 1)]
    beyond = rows[chance <= below.max(initial=-1.0)]
    for index, name in enumerate(pose.head.names):
        frames = np.array([k for k in beyond if pose.misfit[k] == name], dtype=np.intp)
        if frames.size:
            worst = frames[pose.rms[frames].argmax()]
            many = f" in {frames.size} of {len(chance)} frames, most in frames[{worst}]"
            warnings.warn(
                f"head point {name} does not fit the others{many if len(chance) > 1 else ''}: residual "
                f"{pose.residuals[worst, index]:.4g}, rms {pose.rms[worst]:.4g} (image units); check its place on the "
                "head and in the image, or leave it out",
                HeadWarning,
                stacklevel=3,
            )
