r"""Where a camera sees points, and how the image moves with them.

.. math::

   \frac{\partial (u, v)}{\partial (x, y, z)} =
   \begin{pmatrix} f_x & c \\ 0 & f_y \end{pmatrix}
   \frac{\partial (x_d, y_d)}{\partial (x_n, y_n)}
   \begin{pmatrix} 1/z & 0 & -x/z^2 \\ 0 & 1/z & -y/z^2 \end{pmatrix}

for the pinhole camera, with the derivative of Brown's distortion in the middle; a constant for the scaled
orthographic one. Arrays inside have the batch as their last axis: every operation runs along it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Camera, PinholeCamera, ScaledOrthographicCamera
from posekit.cameras.pinhole import undistort
from posekit.errors import InputError
from posekit.geometry import Array, dot


@dataclass(frozen=True, kw_only=True, eq=False)
class Optics:
    """The camera of N postures.

    Parameters
    ----------
    perspective : bool
        A pinhole camera, else a scaled orthographic one.
    focal : array (3, N) or (3, 1)
        fx, skew and fy in pixels; for the orthographic camera pixels a metre in u, zero, and in v.
    centre : array (2, N) or (2, 1)
        Pixels.
    distortion : array (5,), optional
        Brown's coefficients as OpenCV orders them.
    """

    perspective: bool
    focal: Array
    centre: Array
    distortion: Array | None = None

    def take(self, rows: NDArray[np.intp] | slice) -> Optics:
        """Return the cameras of some postures."""
        if self.focal.shape[1] == 1:
            return self
        return replace(self, focal=self.focal[:, rows], centre=self.centre[:, rows])

    def project(self, points: Array) -> tuple[Array, Array]:
        """Project points and differentiate.

        Parameters
        ----------
        points : array (J, 3, N)
            Camera frame, metres.

        Returns
        -------
        image : array (J, 2, N)
            Pixels; NaN for points that are not in front of a pinhole camera.
        jacobian : array (J, 2, 3, N)
            Pixels a metre.
        """
        jacobian = np.zeros((len(points), 2, 3, points.shape[2]))
        fx, skew, fy = self.focal
        if not self.perspective:
            jacobian[:, 0, 0], jacobian[:, 1, 1] = fx, fy
            return points[:, :2] * self.focal[[0, 2]], jacobian
        depth = points[:, 2]
        inverse = 1.0 / np.where(depth > 0, depth, np.nan)
        x, y = points[:, 0] * inverse, points[:, 1] * inverse
        if self.distortion is None:
            jacobian[:, 0, 0], jacobian[:, 0, 1], jacobian[:, 1, 1] = (
                fx * inverse,
                skew * inverse,
                fy * inverse,
            )
            jacobian[:, 0, 2] = -(fx * x + skew * y) * inverse
            jacobian[:, 1, 2] = -fy * y * inverse
        else:
            (x_d, y_d), (xx, xy, yy) = _distorted(x, y, self.distortion)
            for row, (a, b) in enumerate(((fx * xx + skew * xy, fx * xy + skew * yy), (fy * xy, fy * yy))):
                jacobian[:, row, 0], jacobian[:, row, 1] = a * inverse, b * inverse
                jacobian[:, row, 2] = -(a * x + b * y) * inverse
            x, y = x_d, y_d
        image = np.stack([fx * x + skew * y + self.centre[0], fy * y + self.centre[1]], axis=1)
        return image, jacobian

    def image(self, points: Array) -> Array:
        """Project points (J, 3, N) to pixels (J, 2, N): `project` without the derivative."""
        fx, skew, fy = self.focal
        if not self.perspective:
            return np.asarray(points[:, :2] * self.focal[[0, 2]])
        depth = points[:, 2]
        inverse = 1.0 / np.where(depth > 0, depth, np.nan)
        x, y = points[:, 0] * inverse, points[:, 1] * inverse
        if self.distortion is not None:
            (x, y), _ = _distorted(x, y, self.distortion)
        return np.stack([fx * x + skew * y + self.centre[0], fy * y + self.centre[1]], axis=1)

    def rays(self, image: Array, start: Array) -> tuple[Array, Array]:
        """Return the rays (J, 3, N) of image points (J, 2, N), unit vectors, and their points nearest to `start`."""
        fx, skew, fy = self.focal
        ray, foot = np.zeros_like(start), start.copy()
        if not self.perspective:
            ray[:, 2] = 1.0
            foot[:, 0], foot[:, 1] = image[:, 0] / fx, image[:, 1] / fy
            return ray, foot
        y = (image[:, 1] - self.centre[1]) / fy
        x = (image[:, 0] - self.centre[0] - skew * y) / fx
        if self.distortion is not None:
            x, y = np.moveaxis(undistort(np.stack([x, y], axis=-1), self.distortion), -1, 0)
        inverse = 1.0 / np.sqrt(x * x + y * y + 1.0)
        ray[:, 0], ray[:, 1], ray[:, 2] = x * inverse, y * inverse, inverse
        foot = dot(ray, start, axis=-2)[:, None] * ray
        return ray, foot


def optics_of(camera: Camera, frame: NDArray[np.intp]) -> Optics:
    """Spread a camera, whose first axis may count frames, over postures seen in some frames (N,).

    Raises
    ------
    InputError
        Where the camera is neither pinhole nor scaled orthographic, or has another number of frames.
    """
    if isinstance(camera, PinholeCamera):
        K = camera.K if camera.K.ndim == 3 else camera.K[None]
        focal = np.stack([K[:, 0, 0], K[:, 0, 1], K[:, 1, 1]])
        centre = K[:, :2, 2].T
        optics = Optics(perspective=True, focal=focal, centre=centre, distortion=camera.distortion)
    elif isinstance(camera, ScaledOrthographicCamera):
        scale = np.atleast_1d(np.asarray(camera.scale))
        focal = np.stack([scale / camera.aspect, np.zeros_like(scale), scale])
        optics = Optics(perspective=False, focal=focal, centre=np.zeros((2, len(scale))))
    else:
        raise InputError(
            f"the camera is a {type(camera).__name__}; expected a PinholeCamera or a ScaledOrthographicCamera"
        )
    given = optics.focal.shape[1]
    if given > 1 and len(frame) and int(frame.max()) >= given:
        raise InputError(f"the camera has {given} frames, but a posture is of frame {int(frame.max())}")
    return optics.take(frame)


def project(camera: Camera, points: Array) -> tuple[Array, Array]:
    """Project points (F, P, 3) to pixels (F, P, 2), with the derivative (F, P, 2, 3), pixels a metre.

    See Also
    --------
    posekit.cameras.PinholeCamera.project
    """
    optics = optics_of(camera, np.arange(len(points)))
    image, jacobian = optics.project(np.ascontiguousarray(points.transpose(1, 2, 0)))
    return image.transpose(2, 0, 1), jacobian.transpose(3, 0, 1, 2)


def _distorted(
    x: Array, y: Array, distortion: Array
) -> tuple[tuple[Array, Array], tuple[Array, Array, Array]]:
    """Distort (x/z, y/z); with the derivative, which is symmetric: xx, xy, yy."""
    k1, k2, p1, p2, k3 = distortion
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3))
    x_d = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    y_d = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    xx = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x
    yy = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x
    xy = x * y * slope + 2 * p1 * x + 2 * p2 * y
    return (x_d, y_d), (xx, xy, yy)
