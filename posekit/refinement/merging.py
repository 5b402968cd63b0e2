"""Survivors that became one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.errors import InputError
from posekit.refinement.refined import Refined

WITHIN = 0.005
"""Metres: survivors none of whose joints are farther apart became one, unless told otherwise."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Merged:
    """Refined survivors of which none stand for the same posture.

    Parameters
    ----------
    refined : Refined
        The likeliest of each group, by frame.
    rows : int array (M,)
        Where they were among all.
    group : int array (N,)
        For every survivor, which of them stands for it; -1 where it was left out.
    """

    refined: Refined
    rows: NDArray[np.intp]
    group: NDArray[np.intp]

    def members(self) -> list[NDArray[np.intp]]:
        """List for each of them the survivors that it stands for, itself among them."""
        order = np.argsort(self.group, kind="stable")
        order = order[np.searchsorted(self.group[order], 0) :]
        return np.split(order, np.cumsum(np.bincount(self.group[order], minlength=len(self.rows)))[:-1])

    def codes(self, branches: Sequence[str]) -> list[list[str]]:
        """List for each of them the branch codes that it stands for, of all survivors' codes (N)."""
        if len(branches) != len(self.group):
            raise InputError(f"{len(branches)} branch codes for {len(self.group)} survivors; expected one each")
        return [[branches[int(row)] for row in rows] for rows in self.members()]


def merge(refined: Refined, *, within: float = WITHIN, keep: NDArray[np.bool_] | None = None) -> Merged:
    """Merge survivors of a frame that became one: all joints within a distance of those of a likelier one.

    The likeliest survivor takes in all that are near it, then the likeliest of the rest, and so on: the result does
    not depend on the survivors' order.

    Parameters
    ----------
    refined : Refined
    within : float
        Metres that no joint may be apart.
    keep : bool array (N,), optional
        Which survivors are looked at: those that the noise explains (`Refined.explained`).

    Raises
    ------
    InputError
        Where `within` is negative or not finite.
    """
    if not 0 <= within < np.inf:
        raise InputError(f"within is {within!r} m; expected zero or a positive length")
    chosen = np.isfinite(refined.chi2)
    if keep is not None:
        chosen &= keep
    rows = np.flatnonzero(chosen)
    joints = refined.joints[rows]
    # Ties are broken by where the joints are: by nothing that depends on the order.
    order = np.lexsort((*joints.reshape(len(rows), -1).T[:3], joints.sum(axis=(1, 2)), -refined.p[rows], refined.frame[rows]))
    rows, joints = rows[order], joints[order]
    leader = groups_of(refined.frame[rows], joints, within)
    leaders = np.flatnonzero(leader == np.arange(len(rows)))
    number = np.full(len(rows), -1)
    number[leaders] = np.arange(len(leaders))
    group = np.full(len(refined), -1)
    group[rows] = number[leader]
    return Merged(refined=refined.select(rows[leaders]), rows=rows[leaders], group=group)


def groups_of(frame: NDArray[np.intp], joints: Array, within: float) -> NDArray[np.intp]:
    """Find for each posture (N, P, 3) the first of its frame that stands for it; frames are together, the best first.

    In each round the first posture of every frame that is left takes in all that are near it.
    """
    leader = np.full(len(frame), -1)
    left = np.arange(len(frame))
    while left.size:
        first = np.flatnonzero(np.diff(frame[left], prepend=-1))
        mine = left[np.repeat(first, np.diff(np.append(first, len(left))))]
        apart = joints[left] - joints[mine]
        near = np.einsum("npi,npi->np", apart, apart).max(axis=1) <= within * within
        near |= mine == left
        leader[left[near]] = mine[near]
        left = left[~near]
    return leader
