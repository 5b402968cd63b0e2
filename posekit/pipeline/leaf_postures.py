"""Postures of the leaves of trees, many at once."""

from __future__ import annotations

import numpy as np

from posekit.cameras import Array
from posekit.tree import Leaves
from posekit.tree.bits import path_of, select


def leaf_postures(leaves: Leaves) -> Array:
    """Place all joints of all leaves (N, J, 3), camera frame, metres: `Leaves.postures`, gathered in one go."""
    candidates = leaves.candidates
    frames, width = candidates.table.shape[:2]
    column = np.empty((1 << leaves.level, len(leaves.joints)), dtype=np.intp)
    for joint, first in enumerate(candidates.first[:-1]):
        column[:, joint] = first + select(leaves.level, path_of(joint, leaves.parents))
    place = column[leaves.code]
    place += leaves.frame[:, None] * np.intp(width)
    return np.take(candidates.table.reshape(frames * width, 3), place, axis=0)
