"""The tree's bookkeeping as plain loops: they read, count and move, and calculate nothing of bodies.

Every function here also runs as it is, slowly.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from posekit.cameras.camera import COINCIDENT_METRES
from posekit.geometry import Array

IS_OPEN, NO_SOLUTION, COINCIDENT_ENDS, BEHIND_CAMERA, IS_MISSING = range(5)
"""The values of `posekit.tree.candidates.BranchState`, as plain numbers."""

GROUP_COLUMN, OF_FRAME, CODE_OF_LOST, PLACE_COLUMN = range(4)
"""Columns of a lost node: who rejected it, its frame and code, and the place of the check."""

Ints = NDArray[np.int32]
Bytes = NDArray[np.int8]


def lift(
    begin: int,
    end: int,
    rays: Array,
    unseen: NDArray[np.bool_],
    parents: NDArray[np.int64],
    first: NDArray[np.int64],
    lengths: Array,
    tolerance: float,
    table: Array,
    states: Bytes,
    reach: Array,
) -> None:
    """Lift all joints of some frames, as `posekit.tree.candidates` does with a pinhole camera, to the last bit.

    Parameters
    ----------
    begin, end : int
        The frames.
    rays : array (F, J, 3)
        Unit directions in which the joints are seen.
    unseen : bool array (F, J)
        Where a joint was not seen.
    parents : array (J,)
        The joint that each hangs on; -1 for the root.
    lengths : array (J, F)
        Lengths of the segments to each joint's parent, metres.
    first : int array (J + 1,)
        The column of each joint's first candidate, and of the first after the last's.
    tolerance : float
        Metres by which a segment may be too short for its image and count as tangent to its ray.
    table, states, reach
        Of `Candidates`: filled; the root is there.
    """
    widest = max(tolerance, 0.0)
    for f in range(begin, end):
        for j in range(1, len(parents)):
            x, y, z, length = rays[f, j, 0], rays[f, j, 1], rays[f, j, 2], lengths[j, f]
            start = first[parents[j]]
            for w in range(first[parents[j] + 1] - start):
                sx, sy, sz = table[f, start + w, 0], table[f, start + w, 1], table[f, start + w, 2]
                along = sx * x + sy * y + sz * z
                hx, hy, hz = sx - along * x, sy - along * y, sz - along * z
                height = np.sqrt(hx * hx + hy * hy + hz * hz)
                excess = height - length
                half = np.sqrt(np.maximum((length - height) * (length + height), 0.0))
                tangent = half <= COINCIDENT_METRES
                if tangent:
                    half = 0.0
                reachable = excess <= widest
                near, far = along - half, along + half
                near_valid = reachable and near > 0.0
                far_valid = reachable and far > 0.0 and not tangent
                a = first[j] + 2 * w
                if unseen[f, j] or np.isnan(sx) or np.isnan(sy) or np.isnan(sz):
                    states[f, a], states[f, a + 1] = IS_OPEN, IS_MISSING
                elif excess > tolerance and not (near_valid or far_valid):
                    states[f, a], states[f, a + 1] = NO_SOLUTION, NO_SOLUTION
                else:
                    states[f, a] = IS_OPEN if near_valid else BEHIND_CAMERA
                    states[f, a + 1] = (
                        IS_OPEN if far_valid else COINCIDENT_ENDS if near_valid else BEHIND_CAMERA
                    )
                for b in range(2):
                    depth = far if b == 1 else near
                    if states[f, a + b] != IS_OPEN:
                        depth = np.nan
                    table[f, a + b, 0], table[f, a + b, 1], table[f, a + b, 2] = (
                        depth * x,
                        depth * y,
                        depth * z,
                    )
                    reach[f, a + b] = excess


def sort(lost: Ints, groups: int) -> tuple[Ints, Ints, Bytes, NDArray[np.int64]]:
    """Sort lost nodes (M, 4) by who rejected them, else left in order.

    Returns
    -------
    frame, code, place : int array (M,)
    start : int array (groups + 1,)
        Where each group's start and the last ends.
    """
    start = np.zeros(groups + 1, np.int64)
    for i in range(len(lost)):
        start[lost[i, GROUP_COLUMN] + 1] += 1
    for g in range(groups):
        start[g + 1] += start[g]
    at = start.copy()
    frame, code = np.empty(len(lost), np.int32), np.empty(len(lost), np.int32)
    place = np.empty(len(lost), np.int8)
    for i in range(len(lost)):
        k = at[lost[i, GROUP_COLUMN]]
        at[lost[i, GROUP_COLUMN]] += 1
        frame[k], code[k], place[k] = lost[i, OF_FRAME], lost[i, CODE_OF_LOST], lost[i, PLACE_COLUMN]
    return frame, code, place, start


COMPILED_TYPES = {
    "lift": (
        "(i8, i8, f8[:, :, ::1], b1[:, ::1], i8[::1], i8[::1], f8[:, ::1], f8, "
        "f8[:, :, ::1], i1[:, ::1], f8[:, ::1])"
    ),
    "sort": "(i4[:, ::1], i8)",
}
"""The kernels, in the order in which they need each other, with the types they take."""
