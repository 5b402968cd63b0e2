"""OpenCV's distortion models, all of them, in NumPy: what a lens does to an ideal image."""

from __future__ import annotations

import numpy as np

from posekit.cameras.calibrated import CalibratedCamera
from posekit.geometry import Array


def distort(camera: CalibratedCamera, normalized: Array) -> Array:
    r"""Apply a camera's distortion to ideal image coordinates.

    With :math:`r^2 = x^2 + y^2`, the radial factor is
    :math:`(1 + k_1 r^2 + k_2 r^4 + k_3 r^6) / (1 + k_4 r^2 + k_5 r^4 + k_6 r^6)`; tangential, thin prism and tilt
    follow (OpenCV's documentation of `calib3d`, "Detailed Description"). The fisheye model replaces r by
    :math:`\theta_d = \theta (1 + k_1 \theta^2 + k_2 \theta^4 + k_3 \theta^6 + k_4 \theta^8)`,
    :math:`\theta = \arctan r` (Kannala & Brandt 2006, as OpenCV's `fisheye` has it).

    Parameters
    ----------
    normalized : array (..., 2)
        x/z, y/z; NaN stays NaN.

    Returns
    -------
    array (..., 2)
        Distorted coordinates, before K.
    """
    return _fisheye(camera.distortion, normalized) if camera.fisheye else _lens(camera.distortion, normalized)


def project(camera: CalibratedCamera, points_cam: Array) -> Array:
    """Project points (..., 3) of the camera's frame, metres, to the file's own pixels (..., 2).

    NaN behind the camera, and beyond `fold_radius`, where the model says nothing about the lens.
    """
    depth = points_cam[..., 2:]
    normalized = points_cam[..., :2] / np.where(depth > 0, depth, np.nan)
    outside = ~(ray_radius(camera, normalized) <= fold_radius(camera))
    return np.where(outside[..., None], np.nan, to_pixels(camera.K, distort(camera, normalized)))


def to_pixels(K: Array, normalized: Array) -> Array:
    """Apply intrinsics, skew included, to image coordinates (..., 2)."""
    x, y = normalized[..., 0], normalized[..., 1]
    return np.stack([K[0, 0] * x + K[0, 1] * y + K[0, 2], K[1, 1] * y + K[1, 2]], axis=-1)


def from_pixels(K: Array, pixels: Array) -> Array:
    """Undo `to_pixels`."""
    y = (pixels[..., 1] - K[1, 2]) / K[1, 1]
    x = (pixels[..., 0] - K[0, 2] - K[0, 1] * y) / K[0, 0]
    return np.stack([x, y], axis=-1)


def ray_radius(camera: CalibratedCamera, normalized: Array) -> Array:
    """Return what the radial polynomial is in: r, or the angle to the optical axis where the lens is a fisheye."""
    radius = np.linalg.norm(normalized, axis=-1)
    return np.arctan(radius) if camera.fisheye else np.asarray(radius)


def fold_radius(camera: CalibratedCamera) -> float:
    r"""Return the `ray_radius` where the image turns back or breaks up; infinite where it never does.

    The first zero of the slope of the radial function, or of its denominator: beyond it a polynomial fitted to a
    lens is no lens.
    """
    k = np.zeros(8)
    k[: min(len(camera.distortion), 8)] = camera.distortion[:8]
    if camera.fisheye:
        slope = np.array([1.0, 3 * k[0], 5 * k[1], 7 * k[2], 9 * k[3]])
        return _first_root([slope])
    above = np.array([1.0, k[0], k[1], k[4]])
    below = np.array([1.0, k[5], k[6], k[7]])
    # d/dr (r N(q) / D(q)), q = r^2, is ((N + 2 q N') D - 2 q N D') / D^2.
    powers = np.arange(4)
    slope = np.convolve(above * (1 + 2 * powers), below) - np.convolve(above, below * 2 * powers)
    return _first_root([slope, below])


def _first_root(ascending: list[Array]) -> float:
    """Return the root of the smallest positive zero in r^2 of some polynomials that are 1 at zero."""
    smallest = 0.0
    for coefficients in ascending:
        # In 1 / r^2 the leading coefficient is one, however small the lens's own are.
        roots = np.roots(coefficients)
        real = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)]
        smallest = max(smallest, float(real.max(initial=0.0)))
    return float(1 / np.sqrt(smallest)) if smallest > 0 else np.inf


def _fisheye(distortion: Array, normalized: Array) -> Array:
    k = np.zeros(4)
    k[: len(distortion)] = distortion
    radius = np.linalg.norm(normalized, axis=-1)
    theta = np.arctan(radius)
    q = theta * theta
    bent = theta * (1 + q * (k[0] + q * (k[1] + q * (k[2] + q * k[3]))))
    factor = np.divide(bent, radius, out=np.ones_like(radius), where=radius > 0)
    return np.asarray(normalized * factor[..., None])


def _lens(distortion: Array, normalized: Array) -> Array:
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y = np.pad(
        distortion, (0, 14 - len(distortion))
    )
    x, y = normalized[..., 0], normalized[..., 1]
    q = x * x + y * y
    radial = (1 + q * (k1 + q * (k2 + q * k3))) / (1 + q * (k4 + q * (k5 + q * k6)))
    bent = np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (q + 2 * x * x) + q * (s1 + q * s2),
            y * radial + p1 * (q + 2 * y * y) + 2 * p2 * x * y + q * (s3 + q * s4),
        ],
        axis=-1,
    )
    if tau_x == 0 and tau_y == 0:
        return bent
    tilted = bent @ (tilt := _tilt(tau_x, tau_y))[:, :2].T + tilt[:, 2]
    return np.asarray(tilted[..., :2] / tilted[..., 2:])


def _tilt(tau_x: float, tau_y: float) -> Array:
    """Return the homography (3, 3) of a sensor tilted by two angles, radians (Scheimpflug; OpenCV's `calib3d`)."""
    cx, sx, cy, sy = np.cos(tau_x), np.sin(tau_x), np.cos(tau_y), np.sin(tau_y)
    turned_x = np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    turned_y = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    R = turned_y @ turned_x
    along = np.array([[R[2, 2], 0, -R[0, 2]], [0, R[2, 2], -R[1, 2]], [0, 0, 1]])
    homography: Array = along @ R
    return homography
