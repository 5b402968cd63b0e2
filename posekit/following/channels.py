"""Where the segments of a posture point."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array
from posekit.skeleton import JOINTS, TREE_SEGMENTS

# The joints at both ends of each segment, in tree order.
SEGMENT_STARTS: Final = np.array([start for start, _ in TREE_SEGMENTS])
SEGMENT_ENDS: Final = np.array([end for _, end in TREE_SEGMENTS])
N_JOINTS: Final = len(JOINTS)


def directions(joints: Array) -> tuple[Array, Array]:
    """Return the unit vectors (..., 13, 3) along the tree's segments and their lengths (..., 13); NaN if not known."""
    along = joints[..., SEGMENT_ENDS, :] - joints[..., SEGMENT_STARTS, :]
    length = np.linalg.norm(along, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = along / length[..., None]
    return np.where(np.isfinite(unit), unit, np.nan), length
