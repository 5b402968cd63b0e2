"""From the pixels of a real lens to those of an ideal one, for the models that `PinholeCamera` does not have."""

from __future__ import annotations

import numpy as np

from posekit.cameras.calibrated import CalibratedCamera
from posekit.cameras.lens import distort, fold_radius, from_pixels, ray_radius, to_pixels
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.safe_io import extra

CLOSE_PIXELS: float = 1e-6
"""Pixels by which a point may be off when it is projected back."""
MAX_STEPS = 30
_CRITERIA = (
    3,
    100,
    1e-12,
)  # TERM_CRITERIA_COUNT + TERM_CRITERIA_EPS: OpenCV's own default stops after 5 or 10
_SHIFT = 1e-6


def undistorted(pixels: Array, camera: CalibratedCamera) -> Array:
    """Undo a camera's distortion.

    OpenCV's fixed-point iteration (`undistortPoints`, `fisheye.undistortPoints`) gives a start, which stops early or
    diverges where the distortion is strong; Newton's method takes it to convergence, and every point is
    projected back to see that it is the one.

    Parameters
    ----------
    pixels : array (..., 2)
        The file's own pixels; NaN is missing.
    camera : CalibratedCamera
        Whose distortion it is.

    Returns
    -------
    array (..., 2)
        Pixels of an ideal camera with the same K; NaN where missing, and where no ray inside `fold_radius` reaches the
        pixel to 1e-6 px.

    Raises
    ------
    InputError
        Where the last axis is not two, or OpenCV is not installed.
    """
    given = np.asarray(pixels, dtype=np.float64)
    if given.shape[-1:] != (2,):
        raise InputError(f"pixels have shape {given.shape}; expected (..., 2)")
    flat = given.reshape(-1, 2)
    known = np.isfinite(flat).all(axis=-1)
    ideal = np.full_like(flat, np.nan)
    if known.any():
        ideal[known] = _undistorted(flat[known], camera)
    return ideal.reshape(given.shape)


def _undistorted(pixels: Array, camera: CalibratedCamera) -> Array:
    target = from_pixels(camera.K, pixels)
    if not camera.fisheye and not camera.distortion.any():
        return pixels.copy()
    with np.errstate(all="ignore"):  # where it diverges
        # Which start leads to the ray depends on the lens: OpenCV's, the pixel itself, the middle of the picture.
        found = np.full_like(target, np.nan)
        for start in (_start(target, camera), target, 0.1 * target):
            left = np.isnan(found[:, 0])
            if not left.any():
                break
            found[left] = _checked(_newton(start[left], target[left], camera), target[left], camera)
    return to_pixels(camera.K, found)


def _start(target: Array, camera: CalibratedCamera) -> Array:
    """Ask OpenCV; points are handed over without K, whose skew it does not know."""
    cv2 = extra("cv2", "opencv", "undoing this lens's distortion")
    points = np.ascontiguousarray(target[:, None, :])
    if camera.fisheye:
        k = np.zeros(4)
        k[: len(camera.distortion)] = camera.distortion
        start = cv2.fisheye.undistortPoints(points, np.eye(3), k, criteria=_CRITERIA)
    else:
        start = cv2.undistortPoints(points, np.eye(3), camera.distortion.copy(), criteria=_CRITERIA)
    values = np.asarray(start, dtype=np.float64).reshape(-1, 2)
    # -1e6 is how OpenCV's fisheye says that it did not converge.
    return np.where(np.isfinite(values) & (np.abs(values) < 1e5), values, 0.0)


def _newton(start: Array, target: Array, camera: CalibratedCamera) -> Array:
    x = start
    for _ in range(MAX_STEPS):
        error = distort(camera, x) - target
        if np.nanmax(np.abs(error), initial=0.0) < 1e-15:
            break
        columns = [
            (distort(camera, x + step) - distort(camera, x - step)) / (2 * _SHIFT)
            for step in _SHIFT * np.eye(2)
        ]
        (a, c), (b, d) = columns[0].T, columns[1].T
        determinant = a * d - b * c
        move = np.stack([d * error[:, 0] - b * error[:, 1], a * error[:, 1] - c * error[:, 0]], axis=-1)
        x = x - move / determinant[:, None]
    return x


def _checked(found: Array, target: Array, camera: CalibratedCamera) -> Array:
    off = np.abs(to_pixels(camera.K, distort(camera, found)) - to_pixels(camera.K, target)).max(axis=-1)
    good = (off <= CLOSE_PIXELS) & (ray_radius(camera, found) <= fold_radius(camera))
    return np.where(good[:, None], found, np.nan)
