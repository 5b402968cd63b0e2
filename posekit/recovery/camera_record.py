"""What a result says about the camera of each frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from posekit.cameras import lee_chen
from posekit.formats.own import LeeChenModel, OpenCVModel, View
from posekit.recovery.fit_camera import CameraFit


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraRecords:
    """The camera of each frame, described when it is asked for: f, rotation, position, residual; lengths in metres.

    For a `lee-chen` camera these are the paper's (Table 2): [R] and the image plane's origin in the head's
    frame. For an `opencv` camera with extrinsics they are the camera's in the world, without extrinsics the
    head's R_cam_head and the optical centre in the head's frame. The residual is the root mean square
    reprojection error of the head, in image units. None where it is not known.
    """

    view: View
    fit: CameraFit

    def __getitem__(self, frame: int) -> dict[str, Any]:
        """Describe the camera of one frame."""
        return _record(self.view, self.fit, frame)


def _record(view: View, fit: CameraFit, k: int) -> dict[str, Any]:
    model, pose = view.camera, fit.pose
    seen = pose is not None and not pose.reasons[k]
    record: dict[str, Any] = {"f": None, "rotation": None, "position": None, "residual": None}
    if pose is not None and seen:
        R, t = pose.R_cam_head[k], pose.t_cam_head[k]
        record["residual"] = float(pose.rms[k])
        record["rotation"], record["position"] = R.tolist(), (-R.T @ t).tolist()
        if isinstance(model, LeeChenModel):
            f = float(pose.f[k])
            record["f"] = f
            record["rotation"] = lee_chen.rotation_to_paper(R).tolist()
            record["position"] = lee_chen.camera_position(R, t, f).tolist()
    if isinstance(model, LeeChenModel) and model.f is not None:
        record["f"] = model.f
    if isinstance(model, OpenCVModel) and model.R is not None and model.t is not None:
        record["rotation"] = model.R.tolist()
        record["position"] = (-np.asarray(model.R).T @ model.t).tolist()
    return record
