"""From a view's camera and head to what the tree needs: a camera, the neck, and the head's points, per frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array, PinholeCamera, lee_chen
from posekit.errors import HeadError, InputError
from posekit.figure import Figure
from posekit.files import LeeChenModel, OpenCVModel, View
from posekit.head import HeadPoints, HeadPose, calibrate, solve_pose
from posekit.skeleton import HEAD, HEAD_POINTS


@dataclass(frozen=True, kw_only=True)
class CameraFit:
    """The camera of F frames, and where it sees neck and head.

    Parameters
    ----------
    camera : PinholeCamera
    root : array (F, 3)
        The neck, camera frame, metres; NaN where it is not known.
    head : array (F, 5, 3)
        The head's points; NaN where the head was not seen.
    pose : HeadPose or None
        The recovered head, where there was one to see.
    reasons : list of str
        For each frame why its neck is not known, or an empty text.
    """

    camera: PinholeCamera
    root: Array
    head: Array
    pose: HeadPose | None
    reasons: list[str]

    def frames(self, part: NDArray[np.intp]) -> PinholeCamera:
        """Return the camera of some frames."""
        K = self.camera.K
        return self.camera if K.ndim == 2 else PinholeCamera(K=K[part], distortion=self.camera.distortion)


def fit_camera(view: View, figure: Figure) -> CameraFit:
    """Find the camera from the head (§2.1), or the head from a known camera.

    A root that the view gives comes before the head's neck; the head then turns with the recovered rotation
    about that root.

    Raises
    ------
    InputError
        Where the camera's model cannot be used, or no frame's neck can be found.
    """
    n = len(view.time)
    names = ("neck", *HEAD_POINTS)
    points = {name: figure.head_points[k] for k, name in enumerate(names)} | dict(view.head_points or {})
    head_points = HeadPoints.from_mapping(points)
    image = np.concatenate([view.image[:, :1], view.head_image], axis=1)
    seen = np.isfinite(image).all(axis=-1).sum(axis=1) >= len(names)
    pose: HeadPose | None = None
    model = view.camera
    if isinstance(model, LeeChenModel):
        pose = calibrate(head_points, image, f=model.f) if seen.any() or model.f is None else None
        camera = lee_chen.pinhole(_recovered_f(pose) if model.f is None else model.f)
    elif isinstance(model, OpenCVModel):
        camera = PinholeCamera(K=model.K, distortion=model.distortion)
        pose = solve_pose(head_points, image, camera) if seen.any() else None
    else:
        raise InputError(
            "camera.model is scaled-orthographic; recover takes lee-chen and opencv cameras; give K"
        )
    root = view.root.copy()
    head = np.full((n, len(HEAD), 3), np.nan)
    reasons = [""] * n
    if pose is not None:
        neck = pose.points_cam[:, 0]
        unknown = np.isnan(root).any(axis=1)
        root[unknown] = neck[unknown]
        head = pose.points_cam[:, 1 : 1 + len(HEAD)] - neck[:, None] + root[:, None]
    if isinstance(model, LeeChenModel) and model.f is None and pose is not None:
        root[~pose.found] = (
            np.nan
        )  # a given root is of no use where f, which the head would tell, is not known
    for k in np.flatnonzero(np.isnan(root).any(axis=1)):
        why = (
            pose.reasons[k]
            if pose is not None and pose.reasons[k]
            else "its root is not given and its head is not seen"
        )
        reasons[k] = f"frames[{k}]: {why}"
    if n and all(reasons):
        raise HeadError(f"{reasons[0]}; give six head points in head_image (with the neck in image), or root")
    return CameraFit(camera=camera, root=root, head=head, pose=pose, reasons=reasons)


def _recovered_f(pose: HeadPose | None) -> Array:
    """Return f of each frame; 1 m, in frames that are not grown, where the head gave none."""
    if pose is None:
        raise HeadError("camera.f is null and no head is seen; give f, or six head points in head_image")
    return np.where(pose.found, pose.f, 1.0)
