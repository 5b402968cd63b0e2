"""Survivors as what they are made of: one trunk and four limbs, each of them shared by many."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.skeleton import JOINTS, LIMB_JOINTS, N_TRUNK_JOINTS
from posekit.tree.distinct import distinct

Rows = NDArray[np.intp]


class Factors(NamedTuple):
    """N survivors of T different trunks, and of L different limbs of each kind, each on its trunk.

    Attributes
    ----------
    trunk : int array (T,)
        A survivor with each trunk.
    trunk_of : int array (N,)
        Each survivor's trunk.
    limb : tuple of 4 int arrays (L,)
        By kind, a survivor with each limb; sorted by trunk.
    limb_of : int array (4, N)
        Each survivor's limbs.
    """

    trunk: Rows
    trunk_of: Rows
    limb: tuple[Rows, ...]
    limb_of: Rows


def factor_postures(frames: Rows, postures: Array) -> Factors:
    """Find the different trunks of postures (N, 14, 3), frame by frame, and on each trunk its different limbs.

    A posture's leaves in the tree are nearly all ways of putting its limbs together: hundreds of survivors have a few
    trunks, and each trunk at most four of each limb.
    """
    n = len(postures)
    # Joints are compared to the last bit: leaves of one tree that share a trunk share its very numbers.
    places = postures[:, :N_TRUNK_JOINTS].reshape(n, 3 * N_TRUNK_JOINTS)
    key = np.concatenate([frames[:, None].astype(np.float64), places], axis=1)
    trunk, trunk_of = distinct(key)
    limb, limb_of = [], np.empty((4, n), dtype=np.intp)
    for kind, (_, middle, end) in enumerate(LIMB_JOINTS):
        own = np.concatenate(
            [trunk_of[:, None].astype(np.float64), postures[:, middle], postures[:, end]], axis=1
        )
        one, which = distinct(own)
        order = np.argsort(trunk_of[one], kind="stable")
        limb.append(one[order])
        rank = np.empty_like(order)
        rank[order] = np.arange(len(order))
        limb_of[kind] = rank[which]
    return Factors(trunk, trunk_of, tuple(limb), limb_of)


def whole_bodies(
    trunks: Array, limbs: Sequence[Array], trunk_of: NDArray[Any], limb_of: NDArray[Any]
) -> Array:
    """Put bodies (N, 14, 3) together from trunks (T, 6, 3) and, by kind, limbs (L, 2, 3).

    `trunk_of` (N,) and `limb_of` (4, N) say which of these each body has, as of `Factors`.
    """
    joints = np.empty((len(trunk_of), len(JOINTS), 3))
    joints[:, :N_TRUNK_JOINTS] = trunks[trunk_of]
    for (_, middle, end), some, which in zip(LIMB_JOINTS, limbs, limb_of, strict=True):
        joints[:, [middle, end]] = some[which]
    return joints


class LimbColumns(NamedTuple):
    """Limbs side by side: each of M columns has at most one of each kind, all on the same base.

    Attributes
    ----------
    base : int array (M,)
        The base of each column.
    of : tuple of 4 int arrays
        By kind, the column of each limb.
    """

    base: Rows
    of: tuple[Rows, ...]

    @property
    def used(self) -> NDArray[np.bool_]:
        """Where there is a limb (4, M)."""
        used = np.zeros((4, len(self.base)), dtype=np.bool_)
        for kind, columns in enumerate(self.of):
            used[kind, columns] = True
        return used


def columns_of(bases: Sequence[Rows], count: int) -> LimbColumns:
    """Set limbs side by side; `bases` are by kind the bases of its limbs, ascending, of `count`."""
    each = np.stack([np.bincount(base, minlength=count) for base in bases])
    width = each.max(axis=0, initial=0)
    begin = np.cumsum(width) - width
    first = np.cumsum(each, axis=1) - each
    of = tuple(begin[base] + np.arange(len(base)) - first[kind, base] for kind, base in enumerate(bases))
    return LimbColumns(np.repeat(np.arange(count), width), of)
