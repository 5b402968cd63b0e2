"""The frames of torso and hips in a posture given by its points.

Each is a rotation R_cam_part with the part's URDF axes (x forward, y left, z up) as columns. The paper's
torso axes (y down, z left, x forward) are the same three directions under other names.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array, cross, perpendicular, unit
from posekit.skeleton import HIPS, JOINT, TORSO

#: Height of the pelvis over the hips' line, as a fraction of the hips' distance, below which it is between them.
#:
#: Lengths with an error of 2 % move a pelvis in the middle that far, and a plane through so short a distance would turn
#: by 30 degrees with a joint that is off by a centimetre. Pelvis joints of skeletons that have one are half the hips'
#: distance away.
MIDDLE_PELVIS_PART: Final = 0.1


def torso_frame(neck: Array, right_shoulder: Array, left_shoulder: Array, pelvis: Array) -> Array:
    """Return the torso's frame: down is neck to pelvis, left the shoulders' line made perpendicular to it.

    Lee and Chen 1985, §3.1.

    Parameters
    ----------
    neck, right_shoulder, left_shoulder, pelvis : array (..., 3)
        Points in the camera frame.

    Returns
    -------
    array (..., 3, 3)
        R_cam_torso; NaN if a point is, or if the points are on one line.
    """
    down = unit(pelvis - neck)
    left = unit(perpendicular(left_shoulder - right_shoulder, down))
    return np.stack([cross(down, left), left, -down], axis=-1)


def hips_frame(pelvis: Array, right_hip: Array, left_hip: Array, neck: Array | None = None) -> Array:
    """Return the hips' frame: left is the hips' line, down points from the pelvis perpendicular to it.

    A pelvis between the hips spans no plane with them. Then down is the direction from the neck to the pelvis, made
    perpendicular to the hips' line. This is smooth unless the spine is along that line; the flexion of the pelvis is
    not determined.

    Parameters
    ----------
    pelvis, right_hip, left_hip : array (..., 3)
        Points in the camera frame.
    neck : array (..., 3), optional
        For a figure whose pelvis is between its hips (`Figure.pelvis_between_hips`).

    Returns
    -------
    array (..., 3, 3)
        R_cam_hips; NaN if a point is, or if the points are on one line.
    """
    left = unit(left_hip - right_hip)
    down = unit(perpendicular(right_hip - pelvis if neck is None else pelvis - neck, left))
    return np.stack([cross(down, left), left, -down], axis=-1)


def trunk_frames(points: Array, middle_pelvis: bool = False) -> tuple[Array, Array]:
    """Return R_cam_torso and R_cam_hips (N, 3, 3) of postures (N, 14 or more, 3).

    `middle_pelvis` tells whether the pelvis is between the hips: see `hips_frame`.
    """
    hips = (*HIPS, "neck") if middle_pelvis else HIPS
    torso_points, hips_points = ([points[:, JOINT[joint]] for joint in part] for part in (TORSO, hips))
    return torso_frame(*torso_points), hips_frame(*hips_points)
