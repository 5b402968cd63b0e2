"""The frames of torso, hips and head in a posture given by its points.

Each is a rotation R_cam_part whose columns are the part's URDF axes (x forward, y left, z up). The paper's
torso axes (y down, z left, x forward) are the same three directions, named otherwise.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array, cross, perpendicular, unit

MIDDLE_PELVIS_PART: Final = 0.1
"""Of the hips' distance: a pelvis that is nearer to the line between them counts as between them.

Lengths that are off by 2 % put a pelvis there that is in the middle, and a plane from so short a way would turn by 30
degrees with a joint that is off by a centimetre. Pelvis joints of skeletons that have one are half the hips' distance
away.
"""


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


def hips_frame(pelvis: Array, right_hip: Array, left_hip: Array, neck: Array | None = None) -> Array:
    """Return the hips' frame: left is the hips' line, down points from the pelvis square to it.

    A pelvis between the hips has no plane with them: then down is from the neck to the pelvis, square to the hips'
    line. This is smooth wherever the spine is not along that line; how far the pelvis is flexed it does not tell.

    Parameters
    ----------
    pelvis, right_hip, left_hip : array (..., 3)
        Points in the camera frame.
    neck : array (..., 3), optional
        Of a figure whose pelvis is between its hips (`Figure.pelvis_between_hips`).

    Returns
    -------
    array (..., 3, 3)
        R_cam_hips; NaN where a point is, or where the points are on one line.
    """
    left = unit(left_hip - right_hip)
    down = unit(perpendicular(right_hip - pelvis if neck is None else pelvis - neck, left))
    return np.stack([cross(down, left), left, -down], axis=-1)
