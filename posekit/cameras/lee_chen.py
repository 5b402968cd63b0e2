r"""The camera of Lee & Chen 1985. Only this module converts between the conventions of this paper and of posekit.

The paper's camera frame is left-handed: x right, y up, z away from the camera. Its origin is *on the image plane*, at
the distance f in front of the centre of projection, so :math:`x' = f x / (z + f)` (Lee & Chen 1985, eqs. 1-6).
posekit's camera frame has y down and its origin in the centre of projection; the intrinsics are ``diag(f, f, 1)``. The
conversion from the paper to posekit changes the sign of y and adds f to z.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from posekit.cameras.camera import Camera, per_frame, positive
from posekit.geometry import Array, from_metres

UP_FLIP: Array = np.array([1.0, -1.0, 1.0])


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class LeeChenCamera(Camera):
    """A perspective camera with image points in metres on the image plane, y down.

    Parameters
    ----------
    f : float or array (F,), optional
        Distance from the centre of projection to the image plane, metres, one number or one per frame; None if unknown.

    Raises
    ------
    CameraError
        If f is not finite and positive.
    """

    f: float | Array | None

    def __post_init__(self) -> None:
        self._set("f", positive("f", self.f))

    def project(self, points: Array) -> Array:
        """Project points (F, ..., 3), OpenCV camera frame, to the image plane (F, ..., 2); NaN behind the camera."""
        depth = points[..., 2:]
        return np.asarray(
            points[..., :2] / np.where(depth > 0, depth, np.nan) * per_frame("f", self.f, points.ndim)
        )

    def normalize(self, image: Array) -> Array:
        """Convert image points (F, ..., 2), metres, to (x/z, y/z)."""
        return np.asarray(image / per_frame("f", self.f, image.ndim))

    def jacobian(self, normalized: Array) -> Array:
        """Return the Jacobian (F, ..., 2, 2) of image points with respect to (x/z, y/z)."""
        distances = np.broadcast_to(per_frame("f", self.f, normalized.ndim), normalized.shape)
        return np.asarray(distances[..., None] * np.eye(2))

    def take(self, rows: Any) -> LeeChenCamera:
        """Return the camera of the selected frames."""
        return LeeChenCamera(f=self.f[rows]) if isinstance(self.f, np.ndarray) else self

    def fields(self, unit: str = "m") -> dict[str, Any]:
        """Return the camera as a mapping to write to a file, with f in `unit`."""
        return {"model": "lee-chen", "f": None if self.f is None else from_metres(self.f, unit).tolist()}


def image_from_paper(image: Array) -> Array:
    """Convert image points from Lee & Chen's convention (y up) to posekit's (y down), or back."""
    return image * UP_FLIP[:2]


def points_to_paper(points: Array, f: float | Array) -> Array:
    """Convert points (F, ..., 3) from OpenCV's camera frame to Lee & Chen's; f is a number or an array (F,)."""
    return (points - _forward(f, points.ndim)) * UP_FLIP


def rotation_to_paper(R: Array) -> Array:
    """Convert R_cam_head (..., 3, 3), from head to camera, to the matrix [R] of Lee & Chen (Table 2b).

    The columns of [R] are the camera's right, up and backward directions in the head's frame.
    """
    return np.stack([R[..., 0, :], -R[..., 1, :], -R[..., 2, :]], axis=-1)


def camera_position(R: Array, t: Array, f: float | Array) -> Array:
    """Return the camera position of Lee & Chen (Table 2c): the origin of the image plane, in the head's frame.

    R (..., 3, 3) and t (..., 3) map the head's frame to OpenCV's camera frame; f is a number or an array (F,).
    """
    return np.asarray(np.einsum("...ji,...j->...i", R, _forward(f, t.ndim) - t))


def transformation_matrix(R: Array, t: Array, f: float | Array) -> Array:
    """Return the projection matrix [T] (..., 4, 3) of Lee & Chen, eq. (1), scaled as in Table 2a.

    With ``(x, y, z, 1) [T] = (X, Y, H)``, the point (x, y, z) of the head's frame has the image ``(X / H, Y / H)``, y
    up.
    """
    rows = np.concatenate([R, t[..., None]], axis=-1)
    distances = np.asarray(f, dtype=np.float64)[..., None]
    return np.stack([rows[..., 0, :], -rows[..., 1, :], rows[..., 2, :] / distances], axis=-1)


def _forward(f: float | Array, ndim: int) -> Array:
    """Return (0, 0, f) in a shape that broadcasts against an array (F, ..., 3) with `ndim` axes."""
    distances = np.asarray(f, dtype=np.float64)
    distances = distances.reshape(*distances.shape, *(1,) * max(ndim - distances.ndim, 1))
    return np.asarray(distances * np.array([0.0, 0.0, 1.0]))
