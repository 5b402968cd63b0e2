"""Coordinate frames of the torso and the hips, computed from a posture's points.

A frame is the rotation matrix from torso or hips to the camera, R_cam_torso or R_cam_hips. Its columns are the axes of
torso or hips in camera coordinates: x forward, y left, z up. Lee and Chen (1985) name the torso's axes differently: x
forward, y down, z left.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array, cross, perpendicular, unit
from posekit.skeleton import HIPS, JOINT, TORSO

#: Height of the pelvis above the line between the hips, as a fraction of the distance between the hips. Below it the
#: pelvis counts as between the hips.
#:
#: Length errors of 2 % move a pelvis that is between the hips by this height. A plane through hips and pelvis would
#: then rotate by 30 degrees for a joint error of 1 cm. In skeletons with a pelvis joint above the hips, the height is
#: half the distance between the hips.
MIDDLE_PELVIS_PART: Final = 0.1


def torso_frame(neck: Array, right_shoulder: Array, left_shoulder: Array, pelvis: Array) -> Array:
    """Return the torso's frame: down is from neck to pelvis; left is the shoulder line made perpendicular to down.

    Lee and Chen 1985, §3.1.

    Parameters
    ----------
    neck, right_shoulder, left_shoulder, pelvis : array (..., 3)
        Points in the camera frame.

    Returns
    -------
    array (..., 3, 3)
        Rotation matrix R_cam_torso; NaN if a point is NaN or the points are on one line.
    """
    down = unit(pelvis - neck)
    left = unit(perpendicular(left_shoulder - right_shoulder, down))
    return np.stack([cross(down, left), left, -down], axis=-1)


def hips_frame(pelvis: Array, right_hip: Array, left_hip: Array, neck: Array | None = None) -> Array:
    """Return the hips' frame: left is from right to left hip; down is from pelvis to hips, made perpendicular to left.

    If the pelvis lies between the hips, the three points define no plane. Down is then from the neck to the pelvis,
    made perpendicular to left. The frame then varies continuously, unless the line from neck to pelvis is parallel to
    the line between the hips. It does not determine the flexion of the pelvis.

    Parameters
    ----------
    pelvis, right_hip, left_hip : array (..., 3)
        Points in the camera frame.
    neck : array (..., 3), optional
        Given only if the figure's pelvis is between its hips (`Figure.pelvis_between_hips`).

    Returns
    -------
    array (..., 3, 3)
        Rotation matrix R_cam_hips; NaN if a point is NaN or the points are on one line.
    """
    left = unit(left_hip - right_hip)
    down = unit(perpendicular(right_hip - pelvis if neck is None else pelvis - neck, left))
    return np.stack([cross(down, left), left, -down], axis=-1)


def trunk_frames(points: Array, middle_pelvis: bool = False) -> tuple[Array, Array]:
    """Return the frames R_cam_torso and R_cam_hips (N, 3, 3) of postures (N, 14 or more, 3).

    `middle_pelvis` states whether the pelvis is between the hips; see `hips_frame`.
    """
    hips = (*HIPS, "neck") if middle_pelvis else HIPS
    torso_points, hips_points = ([points[:, JOINT[joint]] for joint in part] for part in (TORSO, hips))
    return torso_frame(*torso_points), hips_frame(*hips_points)
