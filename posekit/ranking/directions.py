r"""Postures as unit vectors in the frame of the torso. Unlike angles, unit vectors have no singularities.

The torso's axes are x forward, y left and z from the pelvis to the neck. The vectors are the left and the down axis of
the hips, the directions of the eight limb segments, and the direction against gravity if it is known.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from posekit.geometry import Array, cross, dot, perpendicular, unit
from posekit.skeleton import JOINT, SIDES, segment_name

#: Joints (start, end) of upper arm, forearm, thigh and shank of the right side, then of the left side.
LIMB_SEGMENTS: Final = tuple(
    (JOINT[f"{side}_{start}"], JOINT[f"{side}_{end}"])
    for side in SIDES
    for start, end in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))
)

STARTS, ENDS = np.array(LIMB_SEGMENTS).T

#: The eleven directions; `up` is the last.
DIRECTION_NAMES: Final = ("hips.left", "hips.down", *map(segment_name, LIMB_SEGMENTS), "up")

UP_INDEX: Final = len(DIRECTION_NAMES) - 1

#: Distance of the pelvis from the line between the hips over the distance between the hips (dimensionless). Below it
#: the pelvis does not determine the hips' down axis.
FLAT_PELVIS: Final = 0.1

#: Smoothing constant c of `log_room` (dimensionless). With noise of a few pixels, or a few per cent in the lengths,
#: slopes below ten degrees cannot be distinguished.
LEAST_COSINE: Final = 0.2

#: Mean of one segment's term of `log_room` over uniformly distributed directions.
USUAL_LOG_ROOM: Final = 1 - 0.5 * math.log(1 + LEAST_COSINE**2) - LEAST_COSINE * math.atan(1 / LEAST_COSINE)


def directions(joints: Array, up: Array | None = None) -> Array:
    """Return the unit vectors that describe postures.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Any right-handed frame; NaN where a joint is not known.
    up : array (3,), optional
        Unit vector against gravity, in the same frame.

    Returns
    -------
    array (N, 11, 3), or (N, 10, 3) without `up`
        Unit vectors in the torso's frame, in the order of `DIRECTION_NAMES`. A vector is NaN if one of its joints is
        unknown; all vectors are NaN if the neck, a shoulder or the pelvis is unknown.
    """
    neck, right, left, pelvis, right_hip, left_hip = np.moveaxis(joints[:, :6], 1, 0)
    down = unit(pelvis - neck)
    left_axis = unit(perpendicular(left - right, down))
    axes = np.stack([cross(down, left_axis), left_axis, -down], axis=1)
    line = left_hip - right_hip
    hips_left = unit(line)
    hips_down = perpendicular(right_hip - pelvis, hips_left)
    flat = np.asarray(dot(hips_down, hips_down) < FLAT_PELVIS**2 * dot(line, line))
    hips_down = np.where(flat[:, None], np.nan, unit(hips_down))
    parts = [hips_left[:, None], hips_down[:, None], unit(joints[:, ENDS] - joints[:, STARTS])]
    if up is not None:
        parts.append(np.broadcast_to(up, (len(joints), 1, 3)))
    return np.asarray(np.concatenate(parts, axis=1) @ axes.transpose(0, 2, 1))


def log_room(joints: Array) -> Array:
    r"""Return the sum (N,) over limb segments of log(solid angle of directions / image area), minus its mean.

    Directions of a segment are points of the unit sphere. A solid angle :math:`d\omega` of them has the image area
    :math:`dA = |\cos\theta|\, d\omega`, with :math:`\theta` the angle between segment and ray. The same area of the
    image corresponds to more directions if the segment is parallel to the image than if it points to the camera.
    Because noise blurs directions, :math:`\sqrt{\cos^2\theta + c^2}` with c = `LEAST_COSINE` replaces
    :math:`|\cos\theta|`.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Camera frame, any unit. If a joint is not in front of the camera, all rays of its posture are assumed parallel
        to z. A segment with an unknown end contributes 0.
    """
    parallel = np.asarray((joints[:, :, 2] <= 0).any(axis=1))[:, None, None]
    along = joints[:, ENDS] - joints[:, STARTS]
    ray = np.where(parallel, np.array([0.0, 0.0, 1.0]), joints[:, ENDS])
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine_square = dot(along, ray) ** 2 / (dot(along, along) * dot(ray, ray))
    each = -0.5 * np.log(cosine_square + LEAST_COSINE**2) - USUAL_LOG_ROOM
    return np.asarray(np.nan_to_num(each).sum(axis=1))
