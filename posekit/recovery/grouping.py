"""Grouping of macroscopically similar survivors (Lee & Chen 1985, §3.4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array


def group_postures(joints: Array, within: float) -> NDArray[np.intp]:
    """Group postures whose joints all lie within a distance of their group's representative.

    The first posture represents the first group; each following one joins the first group whose
    representative has every joint within the distance, or starts a group of its own. So every posture is
    that near to its representative, and no two representatives are that near to each other.

    Parameters
    ----------
    joints : array (N, J, 3)
        Postures of one frame, metres; NaN joints (unknown) are not compared.
    within : float
        Metres.

    Returns
    -------
    int array (N,)
        Group of each posture, numbered from 0 in order of first appearance; the representative of a group is
        its first member.
    """
    groups = np.full(len(joints), -1, dtype=np.intp)
    group = 0
    while (groups < 0).any():
        representative = int(np.argmax(groups < 0))
        apart = np.sqrt(((joints - joints[representative]) ** 2).sum(axis=-1))
        near = np.fmax.reduce(apart, axis=1, initial=0.0) <= within
        near[representative] = True
        groups[near & (groups < 0)] = group
        group += 1
    return groups


def representatives(groups: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the index of the first member of each group."""
    _, first = np.unique(groups, return_index=True)
    return np.asarray(first)
