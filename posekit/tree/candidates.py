"""The candidate positions of every joint: one for each combination of near and far on its path from the root.

A node at level j of the tree chooses near (0) or far (1) for each of the first j joints after the root. These j bits
are the code of the node; the first joint has the highest bit. The position of a joint depends only on the bits of the
joints on its path from the root. Therefore the 8192 leaves contain only 86 different positions, besides the root.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Camera
from posekit.geometry import Array, Ints
from posekit.skeleton import JOINTS, PARENTS

OPEN, NO_SOLUTION, COINCIDENT, BEHIND, MISSING = range(5)
#: Reasons for branches without a position; the joint's name is appended. No check judges these branches.
UNJUDGED: Final = {
    NO_SOLUTION: "no-solution",
    COINCIDENT: "coincident",
    BEHIND: "behind-camera",
    MISSING: "missing",
}

#: Levels of the tree below the root.
DEPTH: Final = len(JOINTS) - 1


@lru_cache(maxsize=64)
def path_of(joint: int) -> tuple[int, ...]:
    """Return the joints on the path from the root to a joint, in order, without the root."""
    return () if joint <= 0 else (*path_of(PARENTS[joint]), joint)


@lru_cache(maxsize=1024)
def support_of(points: tuple[int, ...]) -> tuple[int, ...]:
    """Return the joints whose near-far choices determine the positions of given points, in ascending order."""
    return tuple(sorted({joint for point in points if point < len(JOINTS) for joint in path_of(point)}))


@lru_cache(maxsize=512)
def bits(level: int, joints: tuple[int, ...]) -> NDArray[np.int64]:
    """Return, for every code (2^level,) of a level, the integer that the bits of the given joints form."""
    codes = np.arange(1 << level, dtype=np.int64)
    picked = np.zeros_like(codes)
    for joint in joints:
        picked = (picked << 1) | ((codes >> (level - joint)) & 1)
    picked.flags.writeable = False
    return picked


#: Column of the first candidate of each joint in `Candidates.table`.
FIRST: Final = (0, *accumulate(1 << len(path_of(joint)) for joint in range(len(JOINTS))))

HEAD_COLUMN: Final = FIRST[-1]

#: Joints in groups, by the number of segments between a joint and the root.
GENERATIONS: Final = tuple(
    [joint for joint in range(1, len(JOINTS)) if len(path_of(joint)) == count] for count in range(1, 5)
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidates:
    """The candidate positions of all joints in F frames.

    Parameters
    ----------
    table : array (F, 87 + 5 + 1, 3)
        Positions, camera frame, metres. The candidates of each joint begin at column ``FIRST[joint]``. The last six
        columns are five head points and one column of NaN.
    state : int array (F, 87)
        `OPEN` if the branch of the candidate stays; otherwise the reason for pruning it, a key of `UNJUDGED`.
    excess : array (F, 87)
        Distance from the parent's position to the joint's ray minus the segment's length, metres. A positive value
        means that the segment is too short to reach the ray.
    """

    table: Array
    state: NDArray[np.int8]
    excess: Array

    @staticmethod
    def lifted(
        camera: Camera, image: Array, root: Array, lengths: Array, head: Array, slack: float
    ) -> Candidates:
        """Compute the candidates of every joint: its near and far position for each candidate of its parent.

        Parameters
        ----------
        camera : Camera
            Camera of the F frames.
        image : array (F, 14, 2)
            Image points. The positions of an unseen joint (NaN) and of its descendants stay unknown.
        root : array (F, 3)
            The neck, camera frame, metres.
        lengths : array (F, 17)
            Segment lengths, metres, in the order of `posekit.skeleton.SEGMENTS`.
        head : array (F, 5, 3)
            Head points, metres; NaN where not known.
        slack : float
            Largest distance by which a segment may be too short to reach its ray, metres. The segment then ends at the
            point of the ray nearest to its start.
        """
        frames = len(image)
        table = np.full((frames, HEAD_COLUMN + 6, 3), np.nan)
        table[:, HEAD_COLUMN:-1] = head
        state, excess = np.zeros((frames, HEAD_COLUMN), dtype=np.int8), np.zeros((frames, HEAD_COLUMN))
        table[:, 0] = root
        origin, direction = camera.rays(image)
        unseen = np.asarray(np.isnan(image).any(axis=2))
        for joints in GENERATIONS:
            start = np.stack([table[:, FIRST[PARENTS[j]] : FIRST[PARENTS[j] + 1]] for j in joints], axis=1)
            length = lengths[:, [joint - 1 for joint in joints], None]
            rays = origin[:, joints, None], direction[:, joints, None]
            lift = camera.lift(start, rays, length, tolerance=slack)
            found = np.where(lift.valid, OPEN, BEHIND)
            found[..., 1][lift.valid[..., 0] & ~lift.valid[..., 1]] = COINCIDENT
            found[(lift.excess > slack) & ~lift.valid.any(axis=-1)] = NO_SOLUTION
            unknown = np.isnan(start[..., 0]) | unseen[:, joints, None]
            found[unknown] = OPEN, MISSING
            points = np.where((found == OPEN)[..., None], lift.points, np.nan)
            points[unknown] = np.nan
            own = np.concatenate([np.arange(FIRST[joint], FIRST[joint + 1]) for joint in joints])
            table[:, own] = points.reshape(frames, -1, 3)
            state[:, own] = found.reshape(frames, -1)
            excess[:, own] = np.repeat(lift.excess.reshape(frames, -1), 2, axis=1)
        return Candidates(table=table, state=state, excess=excess)

    def column(self, level: int, point: int, code: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the columns (N,) of `table` for a joint or head point at N nodes, given their level and codes (N,)."""
        if point >= len(JOINTS):
            return np.full(len(code), HEAD_COLUMN + point - len(JOINTS))
        return FIRST[point] + bits(level, path_of(point))[code]

    def places(self, level: int, points: Sequence[int], frame: Ints, code: NDArray[np.int64]) -> Array:
        """Return positions (N, 19, 3) of joints and head points at N nodes, metres; NaN for those not in `points`."""
        width = self.table.shape[1]
        place = np.full((len(code), len(JOINTS) + 5), width - 1)
        for point in points:
            place[:, point] = self.column(level, point, code)
        place += frame[:, None] * width
        return np.take(self.table.reshape(-1, 3), place, axis=0)
