"""The closed form from a posture's points to the figure's 22 angles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posekit.body.angles import Limits, ball_angles, direction_angles, limb_angles
from posekit.body.frames import hips_frame
from posekit.errors import FigureError
from posekit.geometry import Array, fit_rotation, relative_rotation, rotate_back, unit
from posekit.skeleton import DOFS, HEAD, JOINT, JOINTS, POINTS, SIDES


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosedForm:
    """Inverse kinematics of the stick figure, part by part.

    Parameters
    ----------
    limits : Limits
        Of all 22 angles: they choose among the branches.
    head_offsets : array (5, 3)
        From the neck to the head's points, head link's frame, metres.
    """

    limits: Limits
    head_offsets: Array

    def angles(self, points: Array, R_torso: Array) -> Array:
        """Find the 22 angles (N, 22) of postures (N, 19, 3) in the order of `posekit.skeleton.DOFS`, radians."""
        joint = {name: points[:, index] for name, index in JOINT.items()}
        R_hips = hips_frame(joint["pelvis"], joint["right_hip"], joint["left_hip"])
        angles = np.empty((len(points), len(DOFS)))
        angles[:, :3] = self.neck(R_torso, points[:, 0], points[:, HEAD])
        angles[:, 3:6] = self.pelvis(R_torso, R_hips)
        for k, (limb, R_parent) in enumerate(
            ((("shoulder", "elbow", "wrist"), R_torso), (("hip", "knee", "ankle"), R_hips))
        ):
            for i, side in enumerate(SIDES):
                start, middle, end = (joint[f"{side}_{name}"] for name in limb)
                first = 6 + 8 * k + 4 * i
                angles[:, first : first + 4] = self.limb(f"{side}_{limb[0]}", R_parent, start, middle, end)
        return angles

    def head_frame(self, neck: Array, head: Array) -> Array:
        """Lay the figure's head onto seen head points (N, 5, 3): R_cam_head (N, 3, 3), NaN where they are unknown."""
        return fit_rotation(self.head_offsets, head - neck[:, None])

    def neck(self, R_torso: Array, neck: Array, head: Array) -> Array:
        """Find flexion, bending and rotation of the neck (N, 3), radians, from the head's points (N, 5, 3)."""
        R_head = self.head_frame(neck, head)
        return ball_angles(relative_rotation(R_torso, R_head), self._limits_of("neck.flexion", 3))

    def pelvis(self, R_torso: Array, R_hips: Array) -> Array:
        """Find flexion, bending and rotation of the pelvis (N, 3), radians."""
        return ball_angles(relative_rotation(R_torso, R_hips), self._limits_of("pelvis.flexion", 3))

    def limb(self, joint: str, R_parent: Array, start: Array, middle: Array, end: Array | None) -> Array:
        """Find a limb's four angles (N, 4), radians; rotation and hinge NaN where its end (N, 3) is not known."""
        limits = self._limits_of(f"{joint}.flexion", 4)
        upper = rotate_back(R_parent, unit(middle - start))
        angles = np.full((len(start), 4), np.nan)
        angles[:, :2] = direction_angles(upper, limits)
        if end is not None:
            known = np.isfinite(end).all(axis=1)
            lower = rotate_back(R_parent, unit(end - middle))
            angles[known] = limb_angles(upper[known], lower[known], limits)
        return angles

    def _limits_of(self, first: str, count: int) -> Limits:
        k = DOFS.index(first)
        part = slice(k, k + count)
        return Limits(
            sign=self.limits.sign[part], lower=self.limits.lower[part], upper=self.limits.upper[part]
        )


def with_head(points: Array) -> Array:
    """Append unknown head points to postures (N, 14, 3); leave (N, 19, 3) as they are."""
    if points.ndim != 3 or points.shape[1] not in (len(JOINTS), len(POINTS)) or points.shape[2] != 3:
        raise FigureError(
            f"postures have shape {points.shape}; expected (N, {len(JOINTS)}, 3) or (N, {len(POINTS)}, 3)"
        )
    if points.shape[1] == len(POINTS):
        return points
    return np.concatenate([points, np.full((len(points), len(HEAD), 3), np.nan)], axis=1)
