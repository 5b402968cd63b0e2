"""Survivors as what they are made of: one trunk and four limbs, each of them shared by many."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.refinement.anatomy import LIMBS
from posekit.refinement.distinct import distinct


class Factors(NamedTuple):
    """N survivors of T different trunks, with M rows of four limbs each: row m has one limb of each kind.

    Attributes
    ----------
    trunk : int array (T,)
        A survivor with each trunk.
    trunk_of : int array (N,)
        Each survivor's trunk.
    row_trunk : int array (M,)
        The trunk of each row.
    row_from : int array (4, M)
        For each limb of a row a survivor that has it.
    row_of : int array (4, N)
        For each limb of a survivor the row where it is.
    """

    trunk: NDArray[np.intp]
    trunk_of: NDArray[np.intp]
    row_trunk: NDArray[np.intp]
    row_from: NDArray[np.intp]
    row_of: NDArray[np.intp]


def factor_postures(frames: NDArray[np.intp], postures: Array) -> Factors:
    """Find the different trunks of postures (N, 14, 3), frame by frame, and on each trunk its different limbs.

    A posture's leaves in the tree are nearly all ways of putting its limbs together: hundreds of survivors have a few
    trunks, and each trunk at most four of each limb.
    """
    n = len(postures)
    key = np.concatenate([frames[:, None].astype(np.float64), postures[:, :6].reshape(n, 18)], axis=1)
    trunk, trunk_of = distinct(key)
    count = np.zeros((4, len(trunk)), dtype=np.intp)
    found = []
    for kind, (_, middle, end) in enumerate(LIMBS):
        own = np.concatenate(
            [trunk_of[:, None].astype(np.float64), postures[:, middle], postures[:, end]], axis=1
        )
        one, which = distinct(own)
        order = np.argsort(trunk_of[one], kind="stable")
        rank = np.empty(len(one), dtype=np.intp)
        count[kind] = np.bincount(trunk_of[one], minlength=len(trunk))
        first = np.cumsum(count[kind]) - count[kind]
        rank[order] = np.arange(len(one)) - first[trunk_of[one[order]]]
        found.append((one, which, rank))
    rows = count.max(axis=0) if n else np.zeros(len(trunk), dtype=np.intp)
    begin = np.cumsum(rows) - rows
    row_trunk = np.repeat(np.arange(len(trunk)), rows)
    row_from = np.repeat(trunk[row_trunk][None], 4, axis=0)
    row_of = np.empty((4, n), dtype=np.intp)
    for kind, (one, which, rank) in enumerate(found):
        place = begin[trunk_of[one]] + rank
        row_from[kind, place] = one
        row_of[kind] = place[which]
    return Factors(trunk, trunk_of, row_trunk, row_from, row_of)
