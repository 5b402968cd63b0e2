"""The head's pose and the camera from the head's image points (Lee & Chen 1985, §2.1)."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.cameras import PinholeCamera
from posekit.cameras.head.blocks import estimate_blocks
from posekit.cameras.head.dlt import require
from posekit.cameras.head.misfit import beyond_chance
from posekit.cameras.head.points import HeadPoints, head_points_cam
from posekit.cameras.head.sighting import HeadSighting, sight
from posekit.cameras.lee_chen import pinhole
from posekit.errors import HeadError
from posekit.geometry import Array


class HeadWarning(UserWarning):
    """A head point does not fit the others, in one frame or in more frames than accident explains."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HeadPose:
    """The pose of a head in F frames; one frame is a batch of one.

    Attributes
    ----------
    head : HeadPoints
        The points that were placed.
    found : bool array (F,)
        Whether a frame gives a pose. Where not, R, t, f and the points are NaN; residuals, rms and misfit are
        kept of fits that were refused, and NaN or None where there was nothing to fit.
    reasons : tuple of str
        Why a frame gives none; empty where it does.
    R_cam_head : array (F, 3, 3)
        Rotation from the head's frame to the camera's (OpenCV: x right, y down, z forward).
    t_cam_head : array (F, 3)
        The head frame's origin in the camera frame, metres.
    f : array (F,)
        The focal length, in the image's unit; K's own (f_x) where K is known.
    f_deviation : array (F,)
        The standard deviation of f, from the residuals to first order; 0 where f is known. A head far away
        hardly shows f: compare the two before using it.
    points_cam : array (F, P, 3)
        All points of the head, seen or not, in the camera frame, metres.
    residuals : array (F, P)
        Distance between a point's projection and its image point, in the image's unit; NaN if not seen.
    rms : array (F,)
        Root of the mean squared residual of the points seen.
    misfit : tuple of str or None
        The point that does not fit the others, None where all do. Of sound heads with normal errors one in
        two hundred has one by accident; a warning is given only of more than that.
    rms_without : array (F,)
        `rms` when the head is fitted without the misfit; NaN where there is none.
    """

    head: HeadPoints
    found: NDArray[np.bool_]
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

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def point(self, name: str) -> Array:
        """Return where one point of the head is, (F, 3), camera frame, metres."""
        return self.points_cam[:, self.head.index(name)]

    def require(self) -> HeadPose:
        """Return self, or raise `HeadError` for the first frame that gives no pose."""
        require(self.reasons)
        return self


def calibrate(
    head: HeadPoints, image: ArrayLike, f: ArrayLike | None = None, *, threads: int = 1
) -> HeadPose:
    r"""Find the head's pose and f in the image plane of a camera with square pixels.

    The squared reprojection error is minimised over rotations, translations and, where it is not given, f.
    Two starts are tried and the better result is taken: the direct linear transformation, and the scaled
    orthographic view. A point that does not fit the rest is named in a `HeadWarning`
    (`posekit.cameras.head.misfit`).

    Parameters
    ----------
    head : HeadPoints
        P points, metres.
    image : array (P, 2) or (F, P, 2)
        Image points: x right, y down, measured from the principal point, in f's unit; NaN where not seen.
        Those of the paper's camera are turned over by `posekit.cameras.lee_chen.image_from_paper`.
    f : float or array (F,), optional
        The focal length, where it is known.
    threads : int
        How many may be used, where there are thousands of frames.

    Returns
    -------
    HeadPose
        Of one frame, where the image is (P, 2).

    Raises
    ------
    HeadError
        Where the image does not fit the head, or the only frame of an image (P, 2) gives no pose: too few
        points, points that are degenerate, a head behind the camera, or f left undetermined.
    CameraError
        Where f is not positive and finite.

    Examples
    --------
    >>> from posekit.cameras.head import TABLE_A2
    >>> image = TABLE_A2.points[:, [2, 1]] * [-0.0125, -0.0125] / (1 - TABLE_A2.points[:, :1] / 4)
    >>> calibrate(TABLE_A2, image).f.round(9)
    array([0.05])
    """
    camera = None if f is None else pinhole(np.asarray(f, dtype=np.float64))
    return _place(head, image, camera, threads)


def solve_pose(head: HeadPoints, image: ArrayLike, camera: PinholeCamera, *, threads: int = 1) -> HeadPose:
    """Find the head's pose in the pixels of a known camera (perspective-n-point).

    As `calibrate`, with the reprojection error measured in distorted pixels.

    Parameters
    ----------
    head : HeadPoints
        P points, metres.
    image : array (P, 2) or (F, P, 2)
        Pixels; NaN where a point is not seen.
    camera : PinholeCamera
        Its K one for all frames or one a frame. A pixel that no ray reaches through its distortion counts
        as not seen.
    threads : int
        As `calibrate`.

    Returns
    -------
    HeadPose
        Of one frame, where the image is (P, 2).

    Raises
    ------
    HeadError
        As `calibrate`, and where K is one a frame but not of these frames.
    """
    return _place(head, image, camera, threads)


def _place(head: HeadPoints, image: ArrayLike, camera: PinholeCamera | None, threads: int) -> HeadPose:
    """Place the head, refuse a single frame that gives no pose, and warn of misfits."""
    sighting = sight(head, image)
    known = None
    if camera is not None:
        sighting, normalized = _normalize(head, sighting, camera)
        known = (camera, normalized)
    # Exact image points divide 0 by 0 where chances are compared; absurd ones overflow, and have no fit.
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        estimated = estimate_blocks(head, sighting, known, threads)
    seen = sighting.seen.sum(axis=-1)
    pose = HeadPose(
        head=head,
        found=np.array([not reason for reason in estimated.reasons], dtype=np.bool_),
        reasons=tuple(estimated.reasons),
        R_cam_head=estimated.R,
        t_cam_head=estimated.t,
        f=estimated.f,
        f_deviation=estimated.f_deviation,
        points_cam=head_points_cam(estimated.R, estimated.t, head),
        residuals=np.where(sighting.seen, estimated.residuals, np.nan),
        rms=np.sqrt(estimated.cost / seen),
        misfit=tuple(head.names[point] if point >= 0 else None for point in estimated.misfit),
        rms_without=np.sqrt(estimated.cost_without / (seen - 1)),
    )
    if np.ndim(image) == 2:
        pose.require()
    _warn(pose, beyond_chance(estimated.chance))
    return pose


def _normalize(head: HeadPoints, sighting: HeadSighting, camera: PinholeCamera) -> tuple[HeadSighting, Array]:
    """Return the normalised image points (F, P, 2), and the sighting without pixels that no ray reaches."""
    frames = len(sighting.image)
    if camera.K.ndim == 3 and len(camera.K) != frames:
        raise HeadError(
            f"the camera has K for {len(camera.K)} frames, the image has {frames}; give one K, or one a frame"
        )
    with np.errstate(all="ignore"):  # far outside the image the distortion's polynomial overflows to NaN
        normalized = camera.normalize(sighting.image)
    reached = sighting.seen & np.isfinite(normalized).all(axis=-1)
    if (reached < sighting.seen).any():
        sighting = sight(head, np.where(reached[..., None], sighting.image, np.nan))
    return sighting, np.where(reached[..., None], normalized, 0.0)


def _warn(pose: HeadPose, beyond: NDArray[np.bool_]) -> None:
    """Name every point that does not fit in frames that are `beyond` chance, once, with its worst frame."""
    misfit = np.array([name or "" for name in pose.misfit], dtype=np.str_)
    misfit[~beyond] = ""
    for index, name in enumerate(pose.head.names):
        frames = np.flatnonzero(misfit == name)
        if not frames.size:
            continue
        worst = frames[pose.rms[frames].argmax()]
        where = (
            f" in {frames.size} of {misfit.size} frames, most in frames[{worst}]" if misfit.size > 1 else ""
        )
        warnings.warn(
            f"head point {name} does not fit the others{where}: residual {pose.residuals[worst, index]:.4g}, "
            f"rms {pose.rms[worst]:.4g} with it and {pose.rms_without[worst]:.4g} without (image units); "
            "check its place on the head and in the image, or leave it out",
            HeadWarning,
            stacklevel=4,
        )
