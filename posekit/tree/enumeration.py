"""All leaves of the tree by plain enumeration: what the tree itself is checked against."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Camera
from posekit.geometry import Array


def enumerate_leaves(
    camera: Camera,
    root: Array,
    image: Array,
    *,
    parents: tuple[int, ...],
    lengths: Array,
    tolerance: float = 0.0,
) -> tuple[Array, NDArray[np.intp]]:
    """Lift all joints for every string of branches, each on its own: 2^(J-1) leaves, nothing shared or pruned.

    Parameters
    ----------
    camera : Camera
        What projects and lifts; its first axis counts frames.
    root : array (3,)
        The root joint, camera frame, metres.
    image : array (J, 2)
        Image points of one frame, all seen.
    parents, lengths
        As `posekit.tree.InterpretationTree` has them.
    tolerance : float
        Metres, as for the tree.

    Returns
    -------
    leaves : array (L, J, 3)
        The leaves all of whose segments have a solution, in the order of their codes.
    codes : int array (L,)
        Their codes.
    """
    n = len(parents)
    branches = np.array(list(product((0, 1), repeat=n - 1)))
    leaves = np.full((len(branches), n, 3), np.nan)
    leaves[:, 0] = root
    alive = np.ones(len(branches), dtype=bool)
    for joint in range(1, n):
        start = leaves[:, parents[joint]]
        pixel = np.broadcast_to(image[joint], (1, len(branches), 2))
        lift = camera.lift(start[None], pixel, lengths[joint], tolerance=tolerance)
        choice = branches[:, joint - 1]
        rows = np.arange(len(branches))
        leaves[:, joint] = lift.points[0, rows, choice]
        alive &= lift.valid[0, rows, choice]
    return leaves[alive], np.flatnonzero(alive)
