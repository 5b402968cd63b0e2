"""Placing the trunk of a body that was measured: a hidden joint is wherever the checks would let a seen one be.

Spines bend and clavicles move, so that three points of a torso do not give the fourth. A joint of it that was not seen is
somewhere on the sphere about its parent, and what is asked of distances inside torso and hips, with what was measured
allowed for, leaves a part of that. In the limit of many samples the region of a hidden joint is the set of places in
which it could have been seen without a check being violated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from posekit.body import Figure
from posekit.geometry import Array, rotation_about
from posekit.hidden.hip_closure import closing_angles
from posekit.hidden.lattices import GOLDEN_ANGLE, sphere_spacing, zone
from posekit.hidden.occlusion_pattern import HIP_JOINTS, TORSO_JOINTS, JointState, OcclusionPattern
from posekit.hidden.posture_rows import Index, PostureRows, judge_rows
from posekit.hidden.rays import Rays
from posekit.hidden.sampling import OcclusionSampling
from posekit.hidden.trunk_placements import TrunkPlacements
from posekit.skeleton import PARENTS, segment_name

PELVIS: Final = HIP_JOINTS[0]

N_PELVIS_RINGS: Final = 40
"""Rings of the sphere about the neck on which a hidden pelvis is sought: 2 cm apart on a body."""

MOST_TRUNKS: Final = 600
"""Places of the trunk of a core on which it is asked whether limbs that were seen reach their rays."""

N_PELVIS_ANGLES: Final = 48
"""Angles of each ring from which it is sought where the hips close."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredTrunkPlacer:
    """Places the unknown joints of torso and hips one after the other, in tree order.

    Parameters
    ----------
    pattern : OcclusionPattern
        Which joints are seen and hidden, and the checks that read them.
    figure : Figure
        The person.
    rays : Rays
        The rays of the joints that are seen.
    frame : int array (C,)
        The frame of each core: which row of the rays.
    tolerance : float
        Metres by which a segment may be too short for its image.
    sampling : OcclusionSampling
        How finely spheres are sampled.
    """

    pattern: OcclusionPattern
    figure: Figure
    rays: Rays
    frame: Index
    tolerance: float
    sampling: OcclusionSampling

    def place(self, points: Array) -> TrunkPlacements:
        """Place them on cores (C, P, 3) wherever the trunk's own checks pass."""
        trunks = TrunkPlacements.of(points)
        passed = np.ones(len(points))
        known = {joint for joint in range(points.shape[1]) if joint not in self.pattern.unknown}
        for joint in self._order():
            known.add(joint)
            hidden = self.pattern.states[joint] == JointState.HIDDEN
            most = self.sampling.trunks if hidden else self.sampling.trunk_sphere
            before = trunks.take(thinning(trunks.core, most))
            if not hidden:
                trunks, row = self._lifted(before, joint)
            elif joint == PELVIS and self._hips_seen():
                trunks, row = self._closing(before)
            else:
                trunks, row = self._around(before, joint)
            alive, _ = judge_rows(self.pattern.decided_by(joint, known), PostureRows.of(trunks.points))
            trunks = trunks.take(alive)
            tried = np.bincount(before.core[row], minlength=len(points))
            left = np.bincount(trunks.core, minlength=len(points))
            # A lift has one place near and one far: one that passes is the whole of what hangs on its trunk.
            passed *= left / np.maximum(tried if hidden else tried / 2.0, 1)
            if hidden:
                closed = joint == PELVIS and self._hips_seen()
                n = N_PELVIS_RINGS**2 if closed else self._directions(before, joint)
                spacing = float(sphere_spacing(n))
                trunks = replace(trunks, spacing=np.maximum(trunks.spacing, spacing))
        left = np.bincount(trunks.core, minlength=len(points))
        kept = trunks.take(thinning(trunks.core, MOST_TRUNKS))
        count = np.bincount(kept.core, minlength=len(points))
        open_ = bool(self.pattern.trunk_joints)
        return replace(
            kept,
            tried=count / np.clip(passed, 1e-12, 1.0) if open_ else kept.tried,
            sure=np.zeros(len(points), dtype=bool) if open_ else kept.sure,
        )

    def _order(self) -> list[int]:
        """Return the unknown joints in an order in which each finds its parent, and what decides most comes first."""
        pelvis, *hips = HIP_JOINTS
        seen = [joint for joint in hips if self.pattern.states[joint] == JointState.SEEN]
        hidden = [joint for joint in hips if joint not in seen]
        order = [pelvis, *seen, *TORSO_JOINTS[1:-1], *hidden]
        return [joint for joint in order if joint in self.pattern.trunk_joints]

    def _hips_seen(self) -> bool:
        return all(self.pattern.states[joint] == JointState.SEEN for joint in HIP_JOINTS[1:])

    def _closing(self, trunks: TrunkPlacements) -> tuple[TrunkPlacements, Index]:
        """Put the pelvis where both hips, lifted from it, are as far apart as they must be: no sample would meet that."""
        length, count = self._length(PELVIS), len(trunks)
        height = 2.0 * (np.arange(N_PELVIS_RINGS) + 0.5) / N_PELVIS_RINGS - 1.0
        offset = np.stack([np.sqrt(1.0 - height**2), np.zeros(N_PELVIS_RINGS), height], axis=1)
        row = np.repeat(np.arange(count), N_PELVIS_RINGS)
        axis = np.broadcast_to([0.0, 0.0, 1.0], (len(row), 3))
        center = trunks.points[row, PARENTS[PELVIS]]
        offset = length * np.tile(offset, (count, 1))
        which, angle = closing_angles(
            self.figure, self.rays, self.frame[trunks.core[row]], center, axis, offset, N_PELVIS_ANGLES
        )
        order = np.argsort(which, kind="stable")
        which, angle = which[order], angle[order]
        placed = trunks.take(row[which])
        turned = np.einsum("nij,nj->ni", rotation_about(axis[which], angle), offset[which])
        placed.points[:, PELVIS] = center[which] + turned
        return placed, row[which]

    def _length(self, joint: int) -> float:
        return self.figure.lengths[segment_name((PARENTS[joint], joint))]

    def _directions(self, trunks: TrunkPlacements, joint: int) -> int:
        """How many places are tried about each parent: fewer where a core has many."""
        crowd = int(np.bincount(trunks.core, minlength=1).max(initial=1))
        return max(self.sampling.trunk_sphere // crowd, 64)

    def _around(self, trunks: TrunkPlacements, joint: int) -> tuple[TrunkPlacements, Index]:
        """Put a joint all around its parent."""
        n, count = self._directions(trunks, joint), len(trunks)
        whole = np.ones(count)
        # Lattices of one core are turned against each other: together they are finer than one.
        local = zone(n, -whole, whole, np.arange(count) * GOLDEN_ANGLE, (np.arange(count) + 0.5) / count)
        row = np.repeat(np.arange(count), n)
        placed = trunks.take(row)
        placed.points[:, joint] = placed.points[:, PARENTS[joint]] + self._length(joint) * local.reshape(-1, 3)
        return placed, row

    def _lifted(self, trunks: TrunkPlacements, joint: int) -> tuple[TrunkPlacements, Index]:
        """Lift a joint that was seen from its parent."""
        lift = self.rays.lift(
            joint,
            self.frame[trunks.core],
            trunks.points[:, PARENTS[joint]],
            self._length(joint),
            self.tolerance,
        )
        row, branch = np.nonzero(lift.valid)
        placed = trunks.take(row)
        placed.points[:, joint] = lift.points[row, branch]
        return placed, row


def thinning(group: Index, most: int) -> Index:
    """Choose at most so many rows of each group, evenly; `group` is in order."""
    count = np.bincount(group, minlength=1)
    first = np.cumsum(count) - count
    rank: Index = np.arange(len(group)) - first[group]
    many = np.maximum(count, 1)[group]
    return np.flatnonzero((many <= most) | ((rank + 1) * most // many > rank * most // many))


def thinned_between_ends(trunks: TrunkPlacements, joints: Sequence[int], most: int) -> TrunkPlacements:
    """Keep at most so many places of each core, evenly, and those beside them that reach farthest along an axis."""
    if not len(trunks):
        return trunks
    kept = np.zeros(len(trunks), dtype=bool)
    kept[thinning(trunks.core, most)] = True
    for joint in joints:
        for axis in range(3):
            order = np.lexsort((trunks.points[:, joint, axis], trunks.core))
            ends = np.flatnonzero(np.diff(trunks.core[order]))
            kept[order[np.concatenate([[0], ends, ends + 1, [len(order) - 1]])]] = True
    cores = len(trunks.tried)
    share = np.bincount(trunks.core[kept], minlength=cores) / np.maximum(
        np.bincount(trunks.core, minlength=cores), 1
    )
    return replace(trunks.take(kept), tried=trunks.tried * share)
