"""OpenCV's distortion models on normalised image points, and their inverse by Newton's method."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array

#: Real numbers, or complex numbers for complex-step derivatives.
Numbers = NDArray[Any]

#: Numbers of coefficients of OpenCV's models: Brown's four or five, the rational model's eight, twelve with thin prism,
#: fourteen with a tilted sensor. The fisheye model has no coefficients or four.
COEFFICIENT_COUNTS: Final = (0, 4, 5, 8, 12, 14)

#: Largest accepted coefficient: far above any lens, and products of five coefficients remain finite.
MAX_COEFFICIENT: Final = 1e9

NEWTON_STEPS: Final = 30
FIXED_POINT_STEPS: Final = 10
#: Largest error of an undistorted point when it is distorted again (normalised; 1e-6 px at f = 1000 px).
CLOSE: Final = 1e-9


def distort(normalized: Array, distortion: Array, *, fisheye: bool = False) -> Array:
    r"""Apply lens distortion to ideal image points (x/z, y/z).

    With :math:`r^2 = x^2 + y^2`, the radial factor is :math:`(1 + k_1 r^2 + k_2 r^4 + k_3 r^6) / (1 + k_4 r^2 + k_5 r^4
    + k_6 r^6)`; tangential, thin prism and tilt terms are added as in OpenCV (documentation of `calib3d`, "Detailed
    Description"). The fisheye model replaces r by :math:`\theta_d = \theta (1 + k_1 \theta^2 + k_2 \theta^4 + k_3
    \theta^6 + k_4 \theta^8)`, :math:`\theta = \arctan r` (Kannala & Brandt 2006, as in OpenCV's `fisheye`).

    Parameters
    ----------
    normalized : array (..., 2)
        x/z, y/z; NaN stays NaN.
    distortion : array (n,)
        Coefficients in OpenCV's order, n one of `COEFFICIENT_COUNTS`.
    fisheye : bool
        Whether the coefficients belong to the fisheye model.

    Returns
    -------
    array (..., 2)
        Distorted normalised points, before K is applied.
    """
    x, y = _bent(normalized[..., 0], normalized[..., 1], distortion, fisheye)
    return np.stack([x, y], axis=-1)


def undistort(distorted: Array, distortion: Array, *, fisheye: bool = False) -> Array:
    """Invert `distort`; NaN if no ray inside `fold_radius` projects to the point.

    Newton's method tries three starts in turn, because no single start converges for all lenses. They are the result of
    a fixed-point iteration (as in OpenCV's `undistortPoints`), the point itself, and a point near the optical axis.
    """
    target = distorted.reshape(-1, 2)
    near, found = target, np.full_like(target, np.nan)
    with np.errstate(all="ignore"):  # iterations may diverge
        for _ in range(FIXED_POINT_STEPS):  # a quasi-Newton step with the slope on the axis, which is one
            near = near + target - distort(near, distortion, fisheye=fisheye)
        for start in (near, target, 0.1 * target):
            left = np.isnan(found[:, 0]) & np.isfinite(target).all(axis=-1)
            if left.any():
                found[left] = _newton(start[left], target[left], distortion, fisheye)
    return found.reshape(distorted.shape)


def lens_jacobian(normalized: Array, distortion: Array, *, fisheye: bool = False) -> Array:
    """Return the Jacobian (..., 2, 2) of `distort` by complex-step differentiation (Squire & Trapp 1998)."""
    tiny = 1e-100
    x, y = normalized[..., 0], normalized[..., 1]
    by_x = _bent(x + 1j * tiny, y + 0j, distortion, fisheye)
    by_y = _bent(x + 0j, y + 1j * tiny, distortion, fisheye)
    rows = [np.stack([by_x[k].imag, by_y[k].imag], axis=-1) / tiny for k in range(2)]
    return np.stack(rows, axis=-2)


def lens_radius(normalized: Array, *, fisheye: bool = False) -> Array:
    """Return the variable of the radial polynomial: r, or for a fisheye lens the angle to the optical axis, radians."""
    radius = np.linalg.norm(normalized, axis=-1)
    return np.asarray(np.arctan(radius) if fisheye else radius)


def fold_radius(distortion: Array, *, fisheye: bool = False) -> float:
    r"""Return the first `lens_radius` at which the distorted radius stops growing or has a pole; infinite if none.

    It is the first zero of the radial function's derivative or denominator. Beyond this radius, the fitted polynomial
    does not describe the lens.
    """
    if fisheye:
        k1, k2, k3, k4 = np.pad(distortion, (0, 4 - len(distortion)))
        return _first_root([np.array([1.0, 3 * k1, 5 * k2, 7 * k3, 9 * k4])])
    k = np.pad(distortion, (0, 14 - len(distortion)))
    above = np.array([1.0, k[0], k[1], k[4]])
    below = np.array([1.0, k[5], k[6], k[7]])
    # d/dr (r N(q) / D(q)), q = r^2, is ((N + 2 q N') D - 2 q N D') / D^2.
    powers = np.arange(4)
    slope = np.convolve(above * (1 + 2 * powers), below) - np.convolve(above, below * 2 * powers)
    return _first_root([slope, below])


def _first_root(ascending: list[Array]) -> float:
    """Return the smallest positive zero r of several polynomials in r^2, each of which is 1 at r = 0."""
    smallest = 0.0
    for coefficients in ascending:
        # The roots are found in 1 / r^2, where the leading coefficient is one even if the lens's coefficients are tiny.
        roots = np.roots(coefficients)
        real = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)]
        smallest = max(smallest, float(real.max(initial=0.0)))
    return float(1 / np.sqrt(smallest)) if smallest > 0 else np.inf


def _bent(x: Numbers, y: Numbers, distortion: Array, fisheye: bool) -> tuple[Numbers, Numbers]:
    """Return the distorted coordinates of undistorted ones x, y (...); each may be a real or a complex array."""
    q = x * x + y * y
    if fisheye:
        k = np.pad(distortion, (0, 4 - len(distortion)))
        radius = np.sqrt(q)
        theta = np.arctan(radius)
        p = theta * theta
        factor = theta * (1 + p * (k[0] + p * (k[1] + p * (k[2] + p * k[3]))))
        factor = np.divide(factor, radius, out=np.ones_like(factor), where=radius != 0)
        return x * factor, y * factor
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tx, ty = np.pad(distortion, (0, 14 - len(distortion)))
    radial = (1 + q * (k1 + q * (k2 + q * k3))) / (1 + q * (k4 + q * (k5 + q * k6)))
    bent_x = x * radial + 2 * p1 * x * y + p2 * (q + 2 * x * x) + q * (s1 + q * s2)
    bent_y = y * radial + p1 * (q + 2 * y * y) + 2 * p2 * x * y + q * (s3 + q * s4)
    if tx == 0 and ty == 0:
        return bent_x, bent_y
    H = _tilt(tx, ty)
    w = H[2, 0] * bent_x + H[2, 1] * bent_y + H[2, 2]
    return (
        (H[0, 0] * bent_x + H[0, 1] * bent_y + H[0, 2]) / w,
        (H[1, 0] * bent_x + H[1, 1] * bent_y + H[1, 2]) / w,
    )


def _tilt(tx: float, ty: float) -> Array:
    """Return the homography (3, 3) of a sensor tilted by two angles, radians (Scheimpflug; OpenCV's `calib3d`)."""
    cx, sx, cy, sy = np.cos(tx), np.sin(tx), np.cos(ty), np.sin(ty)
    turned_x = np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    turned_y = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    R = turned_y @ turned_x
    return np.asarray(np.array([[R[2, 2], 0, -R[0, 2]], [0, R[2, 2], -R[1, 2]], [0, 0, 1]]) @ R)


def _newton(x: Array, target: Array, distortion: Array, fisheye: bool) -> Array:
    for _ in range(NEWTON_STEPS):
        error = distort(x, distortion, fisheye=fisheye) - target
        if np.nanmax(np.abs(error), initial=0.0) < 1e-15:
            break
        J = lens_jacobian(x, distortion, fisheye=fisheye)
        a, b, c, d = J[:, 0, 0], J[:, 0, 1], J[:, 1, 0], J[:, 1, 1]
        step = np.stack([d * error[:, 0] - b * error[:, 1], a * error[:, 1] - c * error[:, 0]], axis=-1)
        x = x - step / (a * d - b * c)[:, None]
    off = np.abs(distort(x, distortion, fisheye=fisheye) - target).max(axis=-1)
    inside = lens_radius(x, fisheye=fisheye) <= fold_radius(distortion, fisheye=fisheye)
    return np.where(((off <= CLOSE) & inside)[:, None], x, np.nan)
