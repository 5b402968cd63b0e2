"""Branch codes: which near-far choices a node stands for, and how to pick some of them out.

A node at level j is an integer of j bits; the bit of joint 1 is the highest, 0 is near and 1 is far. A
joint's position depends only on the bits of the path that leads to it, a check only on those of the joints it
reads.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Codes = NDArray[np.int32]


def path_of(joint: int, parents: Sequence[int]) -> tuple[int, ...]:
    """Return the joints whose branches place a joint, in the order of the path; the root's is empty."""
    path: tuple[int, ...] = ()
    while joint > 0:
        path = (joint, *path)
        joint = parents[joint]
    return path


@lru_cache(maxsize=1024)
def support_of(points: tuple[int, ...], parents: tuple[int, ...]) -> tuple[int, ...]:
    """Return the joints on whose branches the positions of some points depend, in tree order."""
    joints = {joint for point in points if point < len(parents) for joint in path_of(point, parents)}
    return tuple(sorted(joints))


@lru_cache(maxsize=512)
def select(level: int, joints: tuple[int, ...]) -> Codes:
    """Return a table of all codes at a level to the bits of some joints, the first joint's the highest.

    Parameters
    ----------
    level : int
        Number of bits of a code.
    joints : tuple of int
        Each between 1 and `level`.

    Returns
    -------
    int array (2**level,)
    """
    codes = np.arange(1 << level, dtype=np.int32)
    picked = np.zeros_like(codes)
    for joint in joints:
        picked = (picked << 1) | ((codes >> (level - joint)) & 1)
    picked.flags.writeable = False
    return picked
