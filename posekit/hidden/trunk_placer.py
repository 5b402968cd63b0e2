"""Placing the rigid parts: the figure's own torso and hips, laid onto the points of them that are known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from posekit.geometry import Array, fit_rotation, rotation_about, rotation_between, unit
from posekit.hidden.hip_closure import closing_angles
from posekit.hidden.lattices import circle, rotation_spacing, rotations
from posekit.hidden.occlusion_pattern import HIP_JOINTS, TORSO_JOINTS, JointState
from posekit.hidden.posture_rows import Index, PostureRows, judge_rows
from posekit.hidden.trunk_placements import EXACT_WITHIN_METRES, TrunkPlacements, Turn
from posekit.hidden.trunk_search import TrunkSearch

N_PELVIS_RINGS = 24
"""Rings of pelvis positions about the neck, and spins of the torso about each of their roots."""

HIP_COARSENING = 6
"""By how much the hips are turned in coarser steps where the torso turns as well."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TrunkPlacer(TrunkSearch):
    """Places the unknown joints of torso and hips."""

    def place(self, points: Array) -> TrunkPlacements:
        """Place them in every way that the rigid parts allow, on cores (C, P, 3); evenly where they turn."""
        trunks = TrunkPlacements.of(points)
        pelvis, *hips = HIP_JOINTS
        if any(self.pattern.states[joint] for joint in TORSO_JOINTS):
            trunks = self._turned(trunks, TORSO_JOINTS)
            alive, _ = judge_rows(self.pattern.torso_own, PostureRows.of(trunks.points))
            # Where only the torso turns, a near miss may be looked at more closely; otherwise it is gone.
            trunks = trunks if self._torso_alone() else trunks.take(alive)
        for joint in hips:
            if self.pattern.states[joint] == JointState.SEEN:
                trunks = self._lifted(trunks, pelvis, joint)
        if any(self.pattern.states[joint] == JointState.HIDDEN for joint in hips):
            trunks = self._turned(trunks, HIP_JOINTS)
        return trunks

    def _torso_alone(self) -> bool:
        return all(self.pattern.states[joint] == JointState.EXACT for joint in HIP_JOINTS)

    def _turned(self, trunks: TrunkPlacements, joints: tuple[int, ...]) -> TrunkPlacements:
        """Lay a rigid part on: nothing is free with two points beside the pivot, an angle with one, else all."""
        pivot = joints[0]
        states = self.pattern.states
        known = [k for k, joint in enumerate(joints) if k and states[joint] != JointState.HIDDEN]
        free = [k for k, joint in enumerate(joints) if k and states[joint] == JointState.HIDDEN]
        body = self.figure.neutral_points[list(joints)] - self.figure.neutral_points[pivot]
        turn = Turn(
            pivot=pivot,
            about=joints[known[0]] if known else None,
            free=tuple(joints[k] for k in free),
            body=body[free],
        )
        seen = trunks.points[:, [joints[k] for k in known]] - trunks.points[:, pivot, None]
        if len(known) >= 2:
            R = fit_rotation(body[known], seen)
            misfit = np.linalg.norm(np.einsum("nij,pj->npi", R, body[known]) - seen, axis=-1).max(axis=1)
            return replace(trunks.filled(R, turn), sure=trunks.sure & (misfit <= EXACT_WITHIN_METRES))
        loose = bool((trunks.spacing > 0.0).any())
        if known:
            n = self.sampling.circle // HIP_COARSENING if loose else self.sampling.circle
            axis = unit(seen[:, 0])
            first = rotation_between(np.broadcast_to(unit(body[known[0]]), axis.shape), axis)
            row = np.repeat(np.arange(len(trunks)), n)
            R = rotation_about(axis[row], np.tile(circle(n), len(trunks))) @ first[row]
            spacing = 2.0 * np.pi / n
        else:
            every = rotations(self.sampling.rotations // HIP_COARSENING if loose else self.sampling.rotations)
            row = np.repeat(np.arange(len(trunks)), len(every))
            R = np.tile(every, (len(trunks), 1, 1))
            spacing = float(rotation_spacing(len(every)))
        placed = trunks.take(row).filled(R, turn)
        offset = body[joints.index(HIP_JOINTS[0])]
        if HIP_JOINTS[0] in turn.free and self._hips_seen():
            if known:
                row, R = self._closing(trunks, pivot, offset, np.arange(len(trunks)), axis, first)
            else:
                row, R = self._closing_rings(trunks, pivot, offset)
            placed = placed.and_(trunks.take(row).uneven().filled(R, turn))
        return replace(
            placed,
            tried=np.bincount(placed.core[placed.even], minlength=len(trunks.tried)).astype(np.float64),
            spacing=np.maximum(trunks.spacing, spacing),
            sure=np.zeros(len(trunks.sure), dtype=bool),
            turn=turn if not loose and self._last(joints) else None,
        )

    def _hips_seen(self) -> bool:
        return all(self.pattern.states[joint] == JointState.SEEN for joint in HIP_JOINTS[1:])

    def _closing(
        self, trunks: TrunkPlacements, pivot: int, offset: Array, row: Index, axis: Array, first: Array
    ) -> tuple[Index, Array]:
        """Find the turns of a torso at which both hips, lifted from its pelvis, are as far apart as they must be.

        The hips' line has one length: nothing that is sampled meets it.

        Parameters
        ----------
        offset : array (3,)
            From the pivot to the pelvis in the torso's frame.
        row : int array (K,)
            The trunk of each circle.
        axis, first : array (K, 3), (K, 3, 3)
            The circles, and the torso's rotation at angle zero of each.

        Returns
        -------
        row, R
            Trunks, and rotations.
        """
        which, angle = closing_angles(
            self.figure,
            self.rays,
            self.frame[trunks.core[row]],
            trunks.points[row, pivot],
            axis,
            np.einsum("nij,j->ni", first, offset),
            self.sampling.circle,
        )
        return row[which], rotation_about(axis[which], angle) @ first[which]

    def _closing_rings(self, trunks: TrunkPlacements, pivot: int, offset: Array) -> tuple[Index, Array]:
        """Do the same where only the neck is known: on rings of pelvis positions, spun about each root."""
        z = np.array([0.0, 0.0, 1.0])
        tilt = np.pi * (np.arange(N_PELVIS_RINGS) + 0.5) / N_PELVIS_RINGS
        towards = np.stack([np.sin(tilt), np.zeros(N_PELVIS_RINGS), np.cos(tilt)], axis=1)
        ring = rotation_between(np.broadcast_to(unit(offset), towards.shape), towards)
        row, R = self._closing(
            trunks,
            pivot,
            offset,
            np.repeat(np.arange(len(trunks)), N_PELVIS_RINGS),
            np.broadcast_to(z, (len(trunks) * N_PELVIS_RINGS, 3)),
            np.tile(ring, (len(trunks), 1, 1)),
        )
        spin = np.tile(circle(N_PELVIS_RINGS), len(row))
        row, R = np.repeat(row, N_PELVIS_RINGS), np.repeat(R, N_PELVIS_RINGS, axis=0)
        return row, rotation_about(np.einsum("nij,j->ni", R, unit(offset)), spin) @ R

    def _last(self, joints: tuple[int, ...]) -> bool:
        """Whether nothing of the trunk hangs on the part that is turned."""
        return joints == HIP_JOINTS or self._torso_alone()

    def _lifted(self, trunks: TrunkPlacements, pelvis: int, joint: int) -> TrunkPlacements:
        """Lift a hip that is seen from the pelvis."""
        offset = self.figure.neutral_points[joint] - self.figure.neutral_points[pelvis]
        placed, _ = self.lifted_from(trunks, pelvis, joint, float(np.linalg.norm(offset)))
        return replace(placed, tried=np.bincount(placed.core, minlength=len(trunks.tried)).astype(np.float64))
