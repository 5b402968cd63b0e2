"""Every position that every joint can have: one lift for each way to reach it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from itertools import accumulate, pairwise

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Camera, PinholeCamera
from posekit.cameras.camera import COINCIDENT_METRES, Lift
from posekit.geometry import Array
from posekit.tree.bits import path_of


class BranchState(IntEnum):
    """What became of a near or far choice before anything judged it."""

    OPEN = 0
    NO_SOLUTION = 1
    COINCIDENT = 2
    BEHIND_CAMERA = 3
    MISSING = 4


@dataclass(frozen=True, kw_only=True)
class Candidates:
    """The candidate positions of all joints in F frames.

    A joint at depth d of the skeleton has at most 2^d positions, one for each choice along its path: 86 lifts
    place all 8192 leaves of the human tree. All are in one table, a joint's from column ``first[joint]`` on.

    Parameters
    ----------
    first : tuple of int (J + 1,)
        Where each joint's candidates start, and the last's end.
    table : array (F, T + G + 1, 3)
        Positions, camera frame, metres; beyond the joints' the points that were given, and NaN for all that were not.
    states : int array (F, T)
        `BranchState`.
    reach : array (F, T)
        Metres by which the segment is too short for its image (positive; a tangent within the tolerance included) or
        reaches past its ray (negative).
    """

    first: tuple[int, ...]
    table: Array
    states: NDArray[np.int8]
    reach: Array

    @staticmethod
    def start(root: Array, parents: Sequence[int], given: Array | None) -> Candidates:
        """Make the table for roots (F, 3) and given points (F, G, 3); the other joints are yet to be lifted."""
        n = len(root)
        first = (0, *accumulate(1 << len(path_of(joint, parents)) for joint in range(len(parents))))
        known = np.empty((n, 0, 3)) if given is None else given
        table = np.empty((n, first[-1] + known.shape[1] + 1, 3))
        table[:, 0], table[:, first[-1] : -1], table[:, -1] = root, known, np.nan
        return Candidates(
            first=first,
            table=table,
            states=np.zeros((n, first[-1]), dtype=np.int8),
            reach=np.zeros((n, first[-1])),
        )

    @cached_property
    def positions(self) -> tuple[Array, ...]:
        """Positions by joint, (F, 2**depth, 3) each; index them with the bits of the joint's path."""
        return tuple(self.table[:, a:b] for a, b in pairwise(self.first))

    @cached_property
    def branches(self) -> tuple[NDArray[np.int8], ...]:
        """`BranchState` by joint, (F, 2**depth) each."""
        return tuple(self.states[:, a:b] for a, b in pairwise(self.first))

    @cached_property
    def excess(self) -> tuple[Array, ...]:
        """How much too short the segments are by joint, (F, 2**depth) each, metres."""
        return tuple(self.reach[:, a:b] for a, b in pairwise(self.first))

    def too_short(self, frame: int) -> tuple[int, float] | None:
        """Return the first joint of a frame that no branch reaches, and by how much (m) its segment is too short."""
        for joint, states in enumerate(self.branches):
            reached = np.isfinite(self.excess[joint][frame])
            if reached.any() and (states[frame][reached] == BranchState.NO_SOLUTION).all():
                return joint, float(self.excess[joint][frame][reached].min())
        return None


def lift_all(
    camera: Camera,
    root: Array,
    image: Array,
    *,
    parents: Sequence[int],
    lengths: Array,
    tolerance: float,
    given: Array | None = None,
) -> Candidates:
    """Lift every joint from every candidate of its parent.

    Parameters
    ----------
    camera : Camera
        What projects and lifts; its first axis counts frames.
    root : array (F, 3)
        The root joint, camera frame, metres.
    image : array (F, J, 2)
        Image points; NaN where a joint was not seen: it and all beyond it stay unknown.
    parents : sequence of int (J,)
        Parent of each joint, before it in order; -1 for the root.
    lengths : array (J,) or (J, F, 1)
        Length of the segment to each joint's parent, metres, maybe of each frame; the root's is ignored.
    tolerance : float
        Metres by which a segment may be too short for its image and count as tangent to its ray.
    given : array (F, G, 3), optional
        Further points, known beforehand, metres.
    """
    n = len(root)
    empty = Candidates.start(root, parents, given)
    first, table, states, reach = empty.first, empty.table, empty.states, empty.reach
    rays = None
    if isinstance(camera, PinholeCamera):
        rays = rays_of(camera, image).transpose(1, 2, 0)[..., None]
    unseen = np.asarray(np.isnan(image).any(axis=-1))
    for joint in range(1, len(parents)):
        parent, own = parents[joint], slice(first[joint], first[joint + 1])
        start = table[:, first[parent] : first[parent + 1]]
        if rays is None:
            pixel = np.broadcast_to(image[:, joint, None, :], (*start.shape[:2], 2))
            lift = camera.lift(start, pixel, lengths[joint], tolerance=tolerance)
        else:
            lift = _meet(rays[joint], start, lengths[joint], tolerance)
        valid = lift.valid
        state = np.where(valid, np.int8(BranchState.OPEN), np.int8(BranchState.BEHIND_CAMERA))
        state[..., 1][valid[..., 0] & ~valid[..., 1]] = BranchState.COINCIDENT
        none = ~(valid[..., 0] | valid[..., 1])
        state[(lift.excess > tolerance) & none] = BranchState.NO_SOLUTION
        unknown = np.isnan(start).any(axis=-1) | unseen[:, joint, None]
        state[unknown] = (BranchState.OPEN, BranchState.MISSING)
        lift.points[state != BranchState.OPEN] = np.nan
        width = own.stop - own.start
        table[:, own] = lift.points.reshape(n, width, 3)
        states[:, own] = state.reshape(n, width)
        reach[:, own] = np.repeat(lift.excess, 2, axis=1)
    return empty


def rays_of(camera: PinholeCamera, image: Array) -> Array:
    """Return the directions (F, J, 3), of unit length, in which image points (F, J, 2) are seen."""
    normalized = camera.normalize(image)
    x, y = normalized[..., 0], normalized[..., 1]
    size = np.sqrt(x * x + y * y + 1.0)
    return np.stack([x / size, y / size, 1.0 / size], axis=-1)


def _meet(ray: Array, start: Array, length: Array | float, tolerance: float) -> Lift:
    """Meet rays (3, F, 1) from the optical centre with the spheres of segments' ends.

    As `posekit.cameras.camera.meet_sphere`, coordinate by coordinate: each ray is made once, for all the starts (F, W,
    3) of its frame, and arrays of three numbers a row are slow.
    """
    x, y, z = ray
    sx, sy, sz = start[..., 0], start[..., 1], start[..., 2]
    along = sx * x + sy * y + sz * z
    hx, hy, hz = sx - along * x, sy - along * y, sz - along * z
    height = np.sqrt(hx * hx + hy * hy + hz * hz)
    excess = height - length
    half = np.sqrt(np.maximum((length - height) * (length + height), 0.0))
    tangent = half <= COINCIDENT_METRES
    half[tangent] = 0.0
    depth = np.empty((*along.shape, 2))
    np.subtract(along, half, out=depth[..., 0])
    np.add(along, half, out=depth[..., 1])
    reachable = excess <= max(tolerance, 0.0)
    valid = depth > 0.0
    valid[..., 0] &= reachable
    valid[..., 1] &= reachable & ~tangent
    points = np.empty((*depth.shape, 3))
    for k in range(3):
        np.multiply(depth, ray[k, ..., None], out=points[..., k])
    return Lift(points, valid, excess)
