r"""The direct linear transformation: a projection matrix from six or more points.

Every point gives two equations that are linear in the twelve entries of :math:`P` (Abdel-Aziz & Karara 1971;
Lee & Chen 1985, eqs. 2-3). The right singular vector of the smallest singular value solves them in the least
squares sense, after points and image are normalised (Hartley 1997).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.cameras.head.points import HeadPoints
from posekit.cameras.head.sighting import sight
from posekit.errors import HeadError
from posekit.geometry import Array

RANK_RATIO = 1e-10
"""Second smallest singular value, as a fraction of the largest, below which a second solution exists.

Six points and the camera can lie so (all but two in a plane, and these two in line with the camera, for one).
Rounding leaves 1e-15, measured points 1e-4 and more.
"""

BEHIND_CAMERA = (
    "the points fit only a head behind the camera, as those of a mirrored image do: y must point down in the "
    "image, and left and right must be the person's own"
)


class LinearSolution(NamedTuple):
    """What the linear equations give, for F heads; NaN where `determined` is false."""

    P: Array
    R: Array
    t: Array
    f: Array
    determined: NDArray[np.bool_]
    in_front: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Projection:
    r"""Projection matrices and the cameras in them, one a frame.

    The camera has square pixels and its principal point at the image's origin:
    :math:`P \sim \mathrm{diag}(f, f, 1)\,[R\,|\,t]`.

    Attributes
    ----------
    P : array (F, 3, 4)
        Scaled so that the third row's first three entries have length 1, and points in front of the camera a
        positive third coordinate.
    R : array (F, 3, 3)
        The rotation (orthonormal, determinant 1) nearest to ``diag(1/f, 1/f, 1) P``: head to camera.
    t : array (F, 3)
        The head frame's origin in the camera frame, metres.
    f : array (F,)
        In the image's unit.
    found : bool array (F,)
        Whether there is a camera; all of the above are NaN where not.
    reasons : tuple of str
        Why not; empty where found.
    """

    P: Array
    R: Array
    t: Array
    f: Array
    found: NDArray[np.bool_]
    reasons: tuple[str, ...]

    def __post_init__(self) -> None:
        for array in (self.P, self.R, self.t, self.f, self.found):
            array.flags.writeable = False

    def require(self) -> Projection:
        """Return self, or raise `HeadError` for the first frame without a camera."""
        require(self.reasons)
        return self


def dlt(head: HeadPoints, image: ArrayLike) -> Projection:
    """Solve for the projection matrix and take the camera out of it.

    Nothing keeps the matrix a camera's: with coarse image points the result is far off (the printed digits of
    Table A.2 give a camera 4 cm away). `posekit.cameras.head.calibrate` starts from it and does better.

    Parameters
    ----------
    head : HeadPoints
        P points, metres.
    image : array (P, 2) or (F, P, 2)
        x right, y down, measured from the principal point; NaN where a point is not seen.

    Returns
    -------
    Projection
        Of one frame, where the image is (P, 2).

    Raises
    ------
    HeadError
        Where the image does not fit the head, or the only frame of an image (P, 2) gives no camera.
    """
    image_points, seen, reasons = sight(head, image)
    usable = np.array([not reason for reason in reasons], dtype=np.bool_)
    points = np.broadcast_to(head.points, (*seen.shape, 3))
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # absurd image points: not determined
        direct = solve(points[usable], image_points[usable], seen[usable])
    for frame, determined, in_front in zip(
        np.flatnonzero(usable), direct.determined, direct.in_front, strict=True
    ):
        if not determined:
            reasons[frame] = (
                "the linear equations have many solutions (as where all points but two are in a plane "
                "and these two in line with the camera); use calibrate, or add a head point"
            )
        elif not in_front:
            reasons[frame] = BEHIND_CAMERA
    found = np.array([not reason for reason in reasons], dtype=np.bool_)
    full = [np.full((len(found), *array.shape[1:]), np.nan) for array in direct[:4]]
    for target, array in zip(full, direct[:4], strict=True):
        target[found] = array[found[usable]]
    result = Projection(P=full[0], R=full[1], t=full[2], f=full[3], found=found, reasons=tuple(reasons))
    return result.require() if np.ndim(image) == 2 else result


def require(reasons: tuple[str, ...]) -> None:
    """Raise `HeadError` with the first reason there is."""
    for frame, reason in enumerate(reasons):
        if reason:
            raise HeadError(f"frame {frame}: {reason}" if len(reasons) > 1 else reason)


def solve(points: Array, image: Array, seen: NDArray[np.bool_]) -> LinearSolution:
    """Solve for F heads of points (F, P, 3), image points (F, P, 2), those that are `seen` (F, P)."""
    space, to_space = _normalise(points, seen)
    plane, to_plane = _normalise(image, seen)
    space = np.where(seen[..., None], space, 0.0)
    u, v = plane[..., 0, None], plane[..., 1, None]
    zero = np.zeros_like(space)
    rows = np.concatenate(
        [np.concatenate([space, zero, -u * space], -1), np.concatenate([zero, space, -v * space], -1)], axis=1
    )
    _, values, vectors = np.linalg.svd(rows, full_matrices=False)
    determined = values[:, 10] > RANK_RATIO * values[:, 0]
    P = np.linalg.inv(to_plane) @ vectors[:, -1].reshape(-1, 3, 4) @ to_space
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
    R = left @ right
    t = unscaled[:, :, 3].copy()
    for array in (P, R, t, f):
        array[~determined] = np.nan
    return LinearSolution(P, R, t, f, determined, in_front & determined)


def _normalise(points: Array, seen: NDArray[np.bool_]) -> tuple[Array, Array]:
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
