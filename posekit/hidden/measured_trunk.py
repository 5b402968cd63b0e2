"""Placing the trunk of a body that was measured: a hidden joint is wherever the checks would let a seen one be.

Spines bend and clavicles move, so that three points of a torso do not give the fourth. A joint of it that was not seen
is somewhere on the sphere about its parent, and what is asked of distances inside torso and hips, with what was
measured allowed for, leaves a part of that. In the limit of many samples the region of a hidden joint is the set of
places in which it could have been seen without a check being violated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from posekit.geometry import Array, frame_along
from posekit.hidden.lattices import GOLDEN_ANGLE, GOLDEN_RATIO, sphere_spacing, zone
from posekit.hidden.occlusion_pattern import HIP_JOINTS, TORSO_JOINTS, JointState
from posekit.hidden.posture_rows import Index, PostureRows, judge_rows
from posekit.hidden.trunk_placements import TrunkPlacements, thinning
from posekit.hidden.trunk_search import TrunkSearch
from posekit.skeleton import PARENTS, segment_name

PELVIS_JOINT: Final = HIP_JOINTS[0]

MOST_STARTS: Final = 240
"""Places of the trunk of a core, at most, on which the next joint is placed."""

MOST_TRUNKS: Final = 600
"""Places of the trunk of a core on which it is asked whether limbs that were seen reach their rays."""

FEWEST_AROUND, FEWEST_ABOUT = 32, 16
"""Places of a joint about each place of its parent at least, and on a circle."""

TINY_METRES: Final = 1e-12
"""Metres: stands for zero where something is divided by a length."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredTrunkPlacer(TrunkSearch):
    """Places the unknown joints of torso and hips one after the other, in tree order."""

    def place(self, points: Array) -> TrunkPlacements:
        """Place them on cores (C, P, 3) wherever the trunk's own checks pass."""
        trunks = TrunkPlacements.of(points)
        if not self.pattern.trunk_joints:
            return trunks
        passed, cores = np.ones(len(points)), len(points)
        known = {joint for joint in range(points.shape[1]) if joint not in self.pattern.unknown}
        for joints in self._order():
            known.update(joints)
            before = trunks.take(thinning(trunks.core, MOST_STARTS))
            hidden = self.pattern.states[joints[0]] == JointState.HIDDEN
            if len(joints) > 1:
                trunks, row, spacing = self._from_hips(before)
            elif not hidden:
                trunks, row, spacing = self._lifted(before, *joints)
            elif joints[0] in HIP_JOINTS[1:] and sum(HIP_JOINTS) - joints[0] - PELVIS_JOINT in known:
                trunks, row, spacing = self._about_hips(before, *joints)
            else:
                trunks, row, spacing = self._around(before, *joints)
            decided = self.pattern.decided_by(joints, known)
            alive, _ = judge_rows(decided, PostureRows.of(trunks.points))
            tried = np.bincount(before.core[row], minlength=cores)
            trunks = replace(trunks.take(alive), spacing=np.maximum(trunks.spacing, spacing))
            left = np.bincount(trunks.core, minlength=cores)
            # A lift has one place near and one far: one that passes is the whole of what hangs on its trunk.
            passed *= left / np.maximum(tried if hidden else tried / 2.0, 1)
        kept = trunks.take(thinning(trunks.core, MOST_TRUNKS))
        count = np.bincount(kept.core, minlength=cores)
        return replace(
            kept, tried=count / np.clip(passed, 1e-12, 1.0), sure=np.zeros(cores, dtype=bool), turn=None
        )

    def _order(self) -> list[tuple[int, ...]]:
        """Return the unknown joints in an order in which each finds its parent, and what decides most comes first."""
        states, hips = self.pattern.states, HIP_JOINTS[1:]
        seen = [(joint,) for joint in hips if states[joint] == JointState.SEEN]
        hidden = [(joint,) for joint in hips if states[joint] == JointState.HIDDEN]
        closed = states[PELVIS_JOINT] == JointState.HIDDEN and len(seen) == len(hips)
        first = [HIP_JOINTS] if closed else [(PELVIS_JOINT,), *seen]
        order = [*first, *((joint,) for joint in TORSO_JOINTS[1:-1]), *hidden]
        return [joints for joints in order if joints[0] in self.pattern.trunk_joints]

    def _length(self, joint: int, other: int | None = None) -> float:
        return self.figure.lengths[segment_name((PARENTS[joint] if other is None else other, joint))]

    def _around(self, trunks: TrunkPlacements, joint: int) -> tuple[TrunkPlacements, Index, float]:
        """Put a joint all around its parent: fewer places about each where a core has many."""
        count = len(trunks)
        n = max(self.sampling.trunk_sphere // _most(trunks.core), FEWEST_AROUND)
        # Lattices of one core lie between each other: together they are finer than one.
        number, whole = np.arange(count), np.ones(count)
        phase = np.asarray(np.mod(number * GOLDEN_RATIO + 0.5, 1.0), dtype=np.float64)
        turn = np.asarray(number * GOLDEN_ANGLE, dtype=np.float64)
        local = zone(n, -whole, whole, turn, phase)
        row = np.repeat(number, n)
        placed = trunks.take(row)
        placed.points[:, joint] = placed.points[:, PARENTS[joint]] + self._length(joint) * local.reshape(
            -1, 3
        )
        return placed, row, float(sphere_spacing(n * _most(trunks.core)))

    def _lifted(self, trunks: TrunkPlacements, joint: int) -> tuple[TrunkPlacements, Index, float]:
        """Lift a joint that was seen from its parent."""
        return *self.lifted_from(trunks, PARENTS[joint], joint, self._length(joint)), 0.0

    def _about_hips(self, trunks: TrunkPlacements, joint: int) -> tuple[TrunkPlacements, Index, float]:
        """Turn a hip about pelvis and other hip: a pelvis is bone, and keeps its shape however it was measured."""
        other = sum(HIP_JOINTS) - joint - PELVIS_JOINT
        start, end = trunks.points[:, PELVIS_JOINT], trunks.points[:, other]
        n = max(self.sampling.trunk_sphere // _most(trunks.core), FEWEST_ABOUT)
        row = np.repeat(np.arange(len(trunks)), n)
        angle = (np.tile(np.arange(n) / n, len(trunks)) + row * GOLDEN_RATIO) * 2.0 * np.pi
        center, radius, across = _circle(start, end, self._length(joint), self._length(joint, other))
        placed = trunks.take(row)
        placed.points[:, joint] = _on_circle(center[row], radius[row], across[row], angle)
        return placed, row, 2.0 * np.pi / (n * np.sqrt(_most(trunks.core)))

    def _from_hips(self, trunks: TrunkPlacements) -> tuple[TrunkPlacements, Index, float]:
        """Put a hidden pelvis on the hips that are seen, at every depth of the first.

        The second is as far from it as hips are, and the pelvis on the circle about both where it is as far from the
        neck as it must be: three distances hold, which no place that is tried of the pelvis alone would meet.
        """
        _, right, left = HIP_JOINTS
        n = max(self.sampling.hip_depths // _most(trunks.core), FEWEST_ABOUT)
        neck = trunks.points[:, PARENTS[PELVIS_JOINT]]
        foot, height = self.rays.foot(right, self.frame[trunks.core], neck)
        reach = self._length(PELVIS_JOINT) + self._length(right) + self.tolerance
        half = np.sqrt(np.maximum(reach**2 - np.where(np.isfinite(height), height, np.inf) ** 2, 0.0))
        row = np.repeat(np.flatnonzero(half > 0.0), n)
        along = ((np.tile(np.arange(n) + 0.5, len(row) // n)) / n * 2.0 - 1.0) * half[row]
        frame = self.frame[trunks.core[row]]
        first = foot[row] + along[:, None] * self.rays.direction[frame, right]
        lift = self.rays.lift(left, frame, first, self._length(left, right), self.tolerance)
        which, branch = np.nonzero(lift.valid)
        row, first, second = row[which], first[which], lift.points[which, branch]
        center, radius, across = _circle(first, second, self._length(right), self._length(left))
        away = neck[row] - center
        flat = np.einsum("nij,ni->nj", across, away)
        far = np.linalg.norm(flat, axis=1)
        # |center + radius u - neck| is the length from neck to pelvis; the nearest u where none has it.
        wanted = (radius**2 + (away**2).sum(axis=1) - self._length(PELVIS_JOINT) ** 2) / np.maximum(
            2.0 * radius * far, TINY_METRES
        )
        turn = np.arccos(np.clip(wanted, -1.0, 1.0)) * np.array([[-1.0], [1.0]])
        angle = (np.arctan2(flat[:, 1], flat[:, 0]) + turn).reshape(-1)
        row, first, second = (np.concatenate([each, each]) for each in (row, first, second))
        center, radius, across = (np.concatenate([each, each]) for each in (center, radius, across))
        pelvis = _on_circle(center, radius, across, angle)
        off = np.abs(np.linalg.norm(pelvis - neck[row], axis=1) - self._length(PELVIS_JOINT))
        good = np.flatnonzero(off <= self.tolerance)
        good = good[np.argsort(row[good], kind="stable")]
        placed = trunks.take(row[good])
        for joint, positions in ((PELVIS_JOINT, pelvis), (right, first), (left, second)):
            placed.points[:, joint] = positions[good]
        return placed, row[good], 2.0 * reach / n / self._length(PELVIS_JOINT)


def _circle(start: Array, end: Array, near: float, far: float) -> tuple[Array, Array, Array]:
    """Return the circles of points at distances from two points: centres (N, 3), radii (N,), directions (N, 3, 2)."""
    axis = end - start
    apart = np.maximum(np.linalg.norm(axis, axis=1), TINY_METRES)
    axis = axis / apart[:, None]
    along = (apart**2 + near**2 - far**2) / (2.0 * apart)
    radius = np.sqrt(np.maximum(near**2 - along**2, 0.0))
    return start + along[:, None] * axis, radius, frame_along(axis)[..., 1:]


def _on_circle(center: Array, radius: Array, across: Array, angle: Array) -> Array:
    """Return the points (N, 3) at angles on the circles of `_circle`."""
    turned = np.cos(angle)[:, None] * across[..., 0] + np.sin(angle)[:, None] * across[..., 1]
    return np.asarray(center + radius[:, None] * turned)


def _most(group: Index) -> int:
    """Count the largest group, at least one."""
    return int(np.bincount(group, minlength=1).max(initial=1))


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
