"""Take a figure's points from their own world into a camera's frame."""

from __future__ import annotations

import numpy as np

from posekit.body import Figure
from posekit.body.frames import torso_frame
from posekit.cameras import PinholeCamera
from posekit.geometry import Array, quaternion_from_rotation
from posekit.skeleton import JOINTS, TORSO
from posekit.synthesis.camera_sphere import CameraPlacements
from posekit.synthesis.synthetic_scene import SyntheticScene
from posekit.synthesis.viewpoints import to_camera


def observe(
    figure: Figure,
    camera: PinholeCamera,
    points: Array,
    placements: CameraPlacements,
    *,
    q: Array | None = None,
    time: Array | None = None,
    size: tuple[int, int] | None = None,
    labels: tuple[str, ...] = (),
) -> SyntheticScene:
    """Make the scene of points that cameras see in F frames.

    Parameters
    ----------
    figure : Figure
        The person that is seen.
    camera : PinholeCamera
        One for all frames.
    points : array (F, 19, 3)
        World frame, metres; NaN where absent.
    placements : CameraPlacements
        Where each frame's camera stands (F).
    q : array (F, nq), optional
        Configurations in the world frame: only the torso's pose changes with the frame.
    time : array (F,), optional
        Seconds; without it frames are counted from 0.
    size : (int, int), optional
        Width and height of the picture, pixels.
    labels : tuple of str, optional
        A word on each frame, such as the action of a clip.

    Returns
    -------
    SyntheticScene
    """
    R_cam_world, position = placements
    points_cam = to_camera(points, R_cam_world, position)
    if q is None:
        q_cam = np.full((len(points), figure.model.nq), np.nan)
    else:
        torso = np.moveaxis(points_cam[:, : len(TORSO)], 1, 0)
        q_cam = np.concatenate([torso[0], quaternion_from_rotation(torso_frame(*torso)), q[:, 7:]], axis=1)
    return SyntheticScene(
        figure=figure,
        camera=camera,
        joints_cam=points_cam[:, : len(JOINTS)],
        head_cam=points_cam[:, len(JOINTS) :],
        time=np.arange(len(points), dtype=np.float64) if time is None else time,
        q=q_cam,
        R_cam_world=R_cam_world,
        t_cam_world=-np.einsum("fij,fj->fi", R_cam_world, position),
        size=size,
        labels=labels,
    )
