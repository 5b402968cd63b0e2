"""Other postures from which a search starts: the limbs in question turned sideways, or nearer to hanging.

Where a limb bends the wrong way in its own plane, nothing says to which side it is better turned out of it: a search
that starts there stays in that plane, and both sides are tried.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.body.frames import hips_frame, torso_frame
from posekit.geometry import Array, rotation_about, unit
from posekit.skeleton import HIPS, JOINT, LIMB_JOINTS, SIDES, TORSO

REST_BEND: Final = np.radians(20.0)
"""Radians by which elbows and knees of hanging limbs are bent: inside all ranges."""

TOWARD_REST: Final = (0.5, 1.0)
"""How far other starts are from the posture on the way to hanging limbs."""


SIDEWAYS_ANGLES: Final = (0.4, -0.4)
"""Radians by which the lower segments of other starts are turned outward."""


def sideways(points: Array, limbs: NDArray[np.bool_], angle: float) -> Array:
    """Turn the lower segments of limbs (N, 4) of postures (N, 19, 3) outward by an angle (radians)."""
    out = points.copy()
    for limb, (_, middle, end) in enumerate(LIMB_JOINTS):
        rows = np.flatnonzero(limbs[:, limb])
        forward = _part_frame(points[rows], limb)[:, :, 0]
        outward = 1.0 if limb % 2 else -1.0
        turn = rotation_about(forward, np.full(len(rows), outward * angle))
        lower = points[rows, end] - points[rows, middle]
        out[rows, end] = points[rows, middle] + (turn @ lower[..., None])[..., 0]
    return out


def toward_rest(points: Array, limbs: NDArray[np.bool_], share: float) -> Array:
    """Bring limbs of postures (N, 19, 3) nearer to hanging: the directions of their segments, lengths as they are.

    Parameters
    ----------
    points : array (N, 19, 3)
        Metres.
    limbs : bool array (N, 4)
        Which of `posekit.skeleton.LIMB_JOINTS`.
    share : float
        How far: 1 is hanging.

    Returns
    -------
    array (N, 19, 3)
    """
    out = points.copy()
    for limb, joints in enumerate(LIMB_JOINTS):
        rows = np.flatnonzero(limbs[:, limb])
        R = _part_frame(points[rows], limb)
        forward = np.sin(REST_BEND) * (1 if limb < len(SIDES) else -1)
        rest = (-R[:, :, 2], forward * R[:, :, 0] - np.cos(REST_BEND) * R[:, :, 2])
        for start, end, hanging in zip(joints[:-1], joints[1:], rest, strict=True):
            vector = points[rows, end] - points[rows, start]
            length = np.linalg.norm(vector, axis=-1, keepdims=True)
            direction = unit((1 - share) * vector / length + share * hanging)
            out[rows, end] = out[rows, start] + length * direction
    return out


def _part_frame(points: Array, limb: int) -> Array:
    """Return the frames (N, 3, 3) of the parts on which a limb hangs."""
    if limb < len(SIDES):
        return torso_frame(*(points[:, JOINT[name]] for name in TORSO))
    neck, pelvis, right, left = (points[:, JOINT[name]] for name in ("neck", *HIPS))
    return hips_frame(pelvis, right, left, neck)
