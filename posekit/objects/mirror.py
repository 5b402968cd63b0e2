"""Mirror images in depth: the same picture with near and far exchanged throughout (Taylor 2000, section 4)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array


def mirrored(
    depths: Array, parents: Sequence[int], tree: NDArray[np.integer], *, level: float
) -> NDArray[np.bool_]:
    """Find the postures (N,) whose mirror image is among them.

    Parameters
    ----------
    depths : array (N, J)
        Depths of the tree's joints; NaN where one is not known, which counts as level.
    parents : sequence of int (J,)
        The tree's; -1 for the root, which is the first.
    tree : int array (N,)
        Which frame and scale each posture is of: only those of one can be mirror images.
    level : float
        Difference in depth up to which neither end of a segment is nearer.
    """
    apart = depths[:, 1:] - depths[:, list(parents[1:])]
    turns = np.nan_to_num(np.where(np.abs(apart) <= level, 0.0, np.sign(apart))).astype(np.int64)
    powers = 3 ** np.arange(turns.shape[1], dtype=np.int64)
    base = 2 * 3 ** turns.shape[1] * tree.astype(np.int64)
    return np.isin(base - turns @ powers, base + turns @ powers)
