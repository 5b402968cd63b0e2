"""The frames of torso, hips and head in a posture given by its points.

Each is a rotation R_cam_part whose columns are the part's URDF axes (x forward, y left, z up). The paper's
torso axes (y down, z left, x forward) are the same three directions, named otherwise.
"""

from __future__ import annotations

import numpy as np

from posekit.geometry import Array, cross, perpendicular, unit


def torso_frame(neck: Array, right_shoulder: Array, left_shoulder: Array, pelvis: Array) -> Array:
    """Return the torso's frame: down is neck to pelvis, left the shoulders' line square to it.

    Lee and Chen 1985, §3.1.

    Parameters
    ----------
    neck, right_shoulder, left_shoulder, pelvis : array (..., 3)
        Points in the camera frame.

    Returns
    -------
    array (..., 3, 3)
        R_cam_torso; NaN where a point is, or where the points are on one line.
    """
    down = unit(pelvis - neck)
    across = left_shoulder - right_shoulder
    left = unit(perpendicular(across, down))
    return np.stack([cross(down, left), left, -down], axis=-1)


def hips_frame(pelvis: Array, right_hip: Array, left_hip: Array) -> Array:
    """Return the hips' frame: left is the hips' line, down points from the pelvis square to it.

    Parameters
    ----------
    pelvis, right_hip, left_hip : array (..., 3)
        Points in the camera frame.

    Returns
    -------
    array (..., 3, 3)
        R_cam_hips; NaN where a point is, or where the points are on one line.
    """
    left = unit(left_hip - right_hip)
    down = unit(perpendicular(right_hip - pelvis, left))
    return np.stack([cross(down, left), left, -down], axis=-1)
