"""Every position that every joint can have: one lift for each way to reach it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array, Camera
from posekit.tree.bits import path_of


class Branch(IntEnum):
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
    place all 8192 leaves of the human tree.

    Parameters
    ----------
    positions : tuple of array (F, 2**depth, 3)
        By joint, camera frame, metres; index them with the bits of the joint's path.
    branches : tuple of int array (F, 2**depth)
        By joint: `Branch`.
    excess : tuple of array (F, 2**depth)
        By joint: metres by which the segment is too short for its image (positive; a tangent within the
        tolerance included) or reaches past its ray (negative).
    """

    positions: tuple[Array, ...]
    branches: tuple[NDArray[np.int8], ...]
    excess: tuple[Array, ...]

    def too_short(self, frame: int) -> tuple[int, float] | None:
        """Return the first joint of a frame that no branch reaches, and by how much (m) its segment is too short."""
        for joint, states in enumerate(self.branches):
            reached = np.isfinite(self.excess[joint][frame])
            if reached.any() and (states[frame][reached] == Branch.NO_SOLUTION).all():
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
) -> Candidates:
    """Lift every joint from every candidate of its parent.

    Parameters
    ----------
    camera : Camera
    root : array (F, 3)
        The root joint, camera frame, metres.
    image : array (F, J, 2)
        Image points; NaN where a joint was not seen: it and all beyond it stay unknown.
    parents : sequence of int (J,)
        Parent of each joint, before it in order; -1 for the root.
    lengths : array (J,)
        Length of the segment to each joint's parent, metres; the root's is ignored.
    tolerance : float
        Metres by which a segment may be too short for its image and count as tangent to its ray.
    """
    positions = [root[:, None, :]]
    branches = [np.zeros((len(root), 1), dtype=np.int8)]
    excess = [np.zeros((len(root), 1))]
    for joint in range(1, len(parents)):
        start = positions[parents[joint]]
        pixel = np.broadcast_to(image[:, joint, None, :], (*start.shape[:2], 2))
        lift = camera.lift(start, pixel, lengths[joint], tolerance=tolerance)
        unknown = np.isnan(start).any(axis=-1) | np.isnan(pixel).any(axis=-1)
        state = np.full(lift.valid.shape, Branch.OPEN, dtype=np.int8)
        state[~lift.valid] = Branch.BEHIND_CAMERA
        state[..., 1][lift.valid[..., 0] & ~lift.valid[..., 1]] = Branch.COINCIDENT
        state[(lift.excess > tolerance) & ~lift.valid.any(axis=-1)] = Branch.NO_SOLUTION
        state[unknown] = (Branch.OPEN, Branch.MISSING)
        points = np.where((state == Branch.OPEN)[..., None], lift.points, np.nan)
        width = 1 << len(path_of(joint, parents))
        positions.append(points.reshape(len(root), width, 3))
        branches.append(state.reshape(len(root), width))
        excess.append(np.repeat(lift.excess, 2, axis=1))
    return Candidates(positions=tuple(positions), branches=tuple(branches), excess=tuple(excess))
