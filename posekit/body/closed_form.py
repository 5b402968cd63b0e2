"""The closed form from a posture's points to the figure's 22 angles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from posekit.body.angles import Limits, ball_angles, direction_angles, limb_angles
from posekit.body.frames import hips_frame
from posekit.errors import FigureError
from posekit.geometry import Array, fit_rotation, relative_rotation, rotate_back, rotation_about, unit
from posekit.skeleton import DOFS, HEAD, HIPS, JOINT, JOINTS, POINTS, SIDES, TORSO

HIP_FLEXIONS = tuple(DOFS.index(f"{side}_hip.flexion") for side in SIDES)
"""Where the hips' flexions stand among the angles."""


def freed(limits: Limits) -> Limits:
    """Return the limits of a figure whose pelvis is between its hips, whose joints tell no flexion of the pelvis.

    Some flexion of it inside its range must bring a thigh inside the hip's: against the spine that range is the sum of
    both. Turning the hips about their own line changes no other angle of a leg.
    """
    lower, upper, pelvis = limits.lower.copy(), limits.upper.copy(), DOFS.index("pelvis.flexion")
    for hip in HIP_FLEXIONS:
        ends = limits.sign[pelvis] * limits.sign[hip] * np.array([lower[pelvis], upper[pelvis]])
        lower[hip] += ends.min()
        upper[hip] += ends.max()
    return Limits(sign=limits.sign, lower=lower, upper=upper)


Alike = Callable[[Sequence[int]], tuple[NDArray[np.intp], NDArray[np.intp]]]
"""Finds postures with some points in the same places: one posture of each set, and the set of each posture."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosedForm:
    """Inverse kinematics of the stick figure, part by part.

    Parameters
    ----------
    limits : Limits
        Of all 22 angles: they choose among the branches. Where the neck turns the hips, those of the hips' flexion are
        of thighs against the spine: see `freed`.
    head_offsets : array (5, 3)
        From the neck to the head's points, head link's frame, metres.
    middle_pelvis : bool
        Whether the pelvis is between the hips, so that the neck turns them.
    """

    limits: Limits
    head_offsets: Array
    middle_pelvis: bool = False

    def with_limits(self, lower: Array, upper: Array) -> ClosedForm:
        """Return the same with other limits (22,) of the figure's angles, radians."""
        limits = Limits(sign=self.limits.sign, lower=lower, upper=upper)
        return replace(self, limits=freed(limits) if self.middle_pelvis else limits)

    @property
    def pelvis_turn(self) -> tuple[float, float]:
        """By how much the pelvis may be flexed, radians, in the sense of a hip's flexion."""
        pelvis, sign = DOFS.index("pelvis.flexion"), self.limits.sign
        ends = [
            limit[pelvis] * sign[pelvis] * sign[HIP_FLEXIONS[0]]
            for limit in (self.limits.lower, self.limits.upper)
        ]
        return min(ends), max(ends)

    @property
    def hips_joints(self) -> tuple[int, ...]:
        """The joints that place the hips' frame, in the order in which `posekit.body.frames.hips_frame` takes them."""
        return tuple(JOINT[name] for name in (*HIPS, "neck")[: 4 if self.middle_pelvis else 3])

    def rigid_kind(self, joints: tuple[int, ...]) -> int:
        """Name the rigid part of some joints as `posekit.compiled.rigid_kernels.rigid_frame` does."""
        return -len(joints) if self.middle_pelvis and joints == self.hips_joints else len(joints)

    def angles(self, points: Array, R_torso: Array, alike: Alike | None = None) -> Array:
        """Find the 22 angles (N, 22) of postures (N, 19, 3) in the order of `posekit.skeleton.DOFS`, radians.

        Parameters
        ----------
        points : array (N, 19, 3)
            Whole postures, metres.
        R_torso : array (N, 3, 3)
            Their torso frames (`posekit.body.frames.torso_frame`).
        alike : callable, optional
            Finds postures that have some points in the same places: a limb that many share is solved once.
        """
        R_hips = hips_frame(*(points[:, joint] for joint in self.hips_joints))
        angles = np.empty((len(points), len(DOFS)))
        trunk = tuple(JOINT[name] for name in (*TORSO, *HIPS))
        every = np.arange(len(points))

        def place(
            first: int, count: int, of: tuple[int, ...], solve: Callable[[NDArray[np.intp]], Array]
        ) -> None:
            rows, sets = (every, every) if alike is None else alike(of)
            angles[:, first : first + count] = solve(rows)[sets]

        place(0, 3, trunk, lambda rows: self.neck(R_torso[rows], points[rows, 0], points[rows][:, HEAD]))
        place(3, 3, trunk, lambda rows: self.pelvis(R_torso[rows], R_hips[rows]))
        for k, (limb, R_parent) in enumerate(
            ((("shoulder", "elbow", "wrist"), R_torso), (("hip", "knee", "ankle"), R_hips))
        ):
            for i, side in enumerate(SIDES):
                joints = tuple(JOINT[f"{side}_{name}"] for name in limb)
                place(
                    6 + 8 * k + 4 * i,
                    4,
                    (*trunk, *joints),
                    partial(self._limb_of, f"{side}_{limb[0]}", R_parent, points, joints),
                )
        if self.middle_pelvis:
            self._share_flexion(angles, R_torso, R_hips)
        return angles

    def _share_flexion(self, angles: Array, R_torso: Array, R_hips: Array) -> None:
        """Flex pelvises by the least that brings both hips inside their own limits (N, 22), where that is possible.

        How far a pelvis between the hips is flexed its joints do not tell, and turning the hips about their own line
        changes the first angle of each thigh alone.
        """
        low, high = self.pelvis_turn
        least, most = np.full(len(angles), low), np.full(len(angles), high)
        for k in HIP_FLEXIONS:
            flexion = np.where(np.isnan(angles[:, k]), 0.0, angles[:, k])
            least = np.maximum(least, flexion - (self.limits.upper[k] - high))
            most = np.minimum(most, flexion - (self.limits.lower[k] - low))
        turn = np.clip(0.0, np.minimum(least, most), np.maximum(least, most))
        rows = np.flatnonzero(turn)
        if not rows.size:
            return
        for k in HIP_FLEXIONS:
            angles[rows, k] -= turn[rows]
        y = np.broadcast_to(np.array([0.0, 1.0, 0.0]), (rows.size, 3))
        turned = R_hips[rows] @ rotation_about(y, self.limits.sign[HIP_FLEXIONS[0]] * turn[rows])
        angles[rows, 3:6] = self.pelvis(R_torso[rows], turned)

    def _limb_of(
        self, joint: str, R_parent: Array, points: Array, joints: tuple[int, ...], rows: NDArray[np.intp]
    ) -> Array:
        start, middle, end = (points[rows, each] for each in joints)
        return self.limb(joint, R_parent[rows], start, middle, end)

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
        known = np.zeros(len(start), dtype=bool) if end is None else np.isfinite(end).all(axis=1)
        if not known.all():
            angles[~known, :2] = direction_angles(upper[~known], limits)
        if end is not None:
            lower = rotate_back(R_parent[known], unit(end[known] - middle[known]))
            angles[known] = limb_angles(upper[known], lower, limits)
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
