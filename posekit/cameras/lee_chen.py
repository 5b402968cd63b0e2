r"""The camera of the 1985 paper, converted at this boundary and nowhere else.

Its frame is left-handed: x right, y up, z away from the camera, with the origin *on the image plane*, f in
front of the centre of projection, so that :math:`x' = f x / (z + f)` (Lee & Chen 1985, eqs. 1-6).
Inside posekit the same camera is a `PinholeCamera` with intrinsics ``diag(f, f, 1)``: y turns over, z gains
f. Both directions are exact.
"""

from __future__ import annotations

import numpy as np

from posekit.cameras.pinhole import PinholeCamera
from posekit.errors import CameraError
from posekit.geometry import Array

UP_FLIP: Array = np.array([1.0, -1.0, 1.0])


def pinhole(f: float | Array) -> PinholeCamera:
    """Make the pinhole camera of lens-to-image-plane distance f, one or one a frame (F,), metres."""
    distances = np.asarray(f, dtype=np.float64)
    if not (np.isfinite(distances) & (distances > 0)).all():
        raise CameraError(f"f must be positive and finite; got {distances.tolist()}")
    K = np.zeros((*distances.shape, 3, 3))
    K[..., 0, 0] = K[..., 1, 1] = distances
    K[..., 2, 2] = 1.0
    return PinholeCamera(K=K)


def image_from_paper(image: Array) -> Array:
    """Turn the paper's image points (y up) into posekit's (y down), and back: it is its own inverse."""
    return image * UP_FLIP[:2]


def points_from_paper(points: Array, f: float | Array) -> Array:
    """Turn points (F, ..., 3) of the paper's camera frame into OpenCV's; f one, or one a frame (F,)."""
    return points * UP_FLIP + _forward(f, points.ndim)


def points_to_paper(points: Array, f: float | Array) -> Array:
    """Turn points (F, ..., 3) of OpenCV's camera frame into the paper's; f one, or one a frame (F,)."""
    return (points - _forward(f, points.ndim)) * UP_FLIP


def rotation_to_paper(R: Array) -> Array:
    """Turn R_cam_head of OpenCV's frame into the matrix [R] that the paper prints (Table 2b).

    Its columns are the right-handed camera's axes, right, up and backward, in the head's coordinates.
    """
    return np.stack([R[..., 0, :], -R[..., 1, :], -R[..., 2, :]], axis=-1)


def camera_position(R: Array, t: Array, f: float | Array) -> Array:
    """Return the paper's camera position (Table 2c): the image plane's origin in the head's coordinates.

    R (..., 3, 3) and t (..., 3) take the head's frame to OpenCV's camera frame; f one, or one a frame.
    """
    position: Array = np.einsum("...ji,...j->...i", R, _forward(f, t.ndim) - t)
    return position


def transformation_matrix(R: Array, t: Array, f: float | Array) -> Array:
    """Return the paper's matrix [T] (..., 4, 3) of eq. (1), scaled as in Table 2a.

    ``(x, y, z, 1) [T] = (X, Y, H)`` takes a point of the head's frame to its image ``(X / H, Y / H)``, y up.
    """
    rows = np.concatenate([R, t[..., None]], axis=-1)
    distances = np.asarray(f, dtype=np.float64)[..., None]
    return np.stack([rows[..., 0, :], -rows[..., 1, :], rows[..., 2, :] / distances], axis=-1)


def _forward(f: float | Array, ndim: int) -> Array:
    """Shape (0, 0, f) so that f's frames stand before the axes of an array of `ndim` axes."""
    distances = np.asarray(f, dtype=np.float64)
    distances = distances.reshape(*distances.shape, *(1,) * max(ndim - distances.ndim, 1))
    forward: Array = distances * np.array([0.0, 0.0, 1.0])
    return forward
