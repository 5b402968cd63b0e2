"""Survivors that became one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.refinement.refined import Refined

MERGE_DISTANCE_METRES = 0.005
"""Metres: survivors none of whose joints are farther apart became one, unless told otherwise."""

PROJECTION_AXIS = np.array([0.48, 0.6, 0.64])
"""A unit vector, not along an axis, on which joints are projected to find which postures may be near."""


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
        if not len(self.rows):
            return []
        order = np.argsort(self.group, kind="stable")
        order = order[np.searchsorted(self.group[order], 0) :]
        return np.split(order, np.cumsum(np.bincount(self.group[order], minlength=len(self.rows)))[:-1])

    def take(self, chosen: NDArray[np.intp]) -> Merged:
        """Return some of them (K,), in an order that ascends; survivors of the others count as left out."""
        number = np.full(len(self.rows) + 1, -1)
        number[chosen] = np.arange(len(chosen))
        return Merged(refined=self.refined.select(chosen), rows=self.rows[chosen], group=number[self.group])

    def codes(self, branches: Sequence[str]) -> list[list[str]]:
        """List for each of them the branch codes that it stands for, of all survivors' codes (N)."""
        if len(branches) != len(self.group):
            raise InputError(
                f"{len(branches)} branch codes for {len(self.group)} survivors; expected one each"
            )
        return [[branches[int(row)] for row in rows] for rows in self.members()]


def merge(
    refined: Refined,
    *,
    within: float = MERGE_DISTANCE_METRES,
    keep: NDArray[np.bool_] | None = None,
) -> Merged:
    """Merge survivors of a frame that became one: all joints within a distance of those of a likelier one.

    The likeliest survivor takes in all that are near it, then the likeliest of the rest, and so on: the result does
    not depend on the survivors' order.

    Parameters
    ----------
    refined : Refined
        Survivors of any number of frames, refined.
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
    shadow = joints @ PROJECTION_AXIS
    ties = (*shadow[:, 6:].T, shadow.mean(axis=1), refined.chi2[rows])
    order = np.lexsort((*ties, -refined.p[rows], refined.frame[rows]))
    rows, joints = rows[order], joints[order]
    leader = groups_of(refined.frame[rows], joints, within)
    stands = np.flatnonzero(leader == np.arange(len(rows)))
    number = np.full(len(rows), -1)
    number[stands] = np.arange(len(stands))
    group = np.full(len(refined), -1)
    group[rows] = number[leader]
    return Merged(refined=refined.select(rows[stands]), rows=rows[stands], group=group)


def groups_of(frame: NDArray[np.intp], joints: Array, within: float) -> NDArray[np.intp]:
    """Find for each posture (N, P, 3) the one of its frame that stands for it; the best come first in each frame.

    See `leaders_of_pairs`.
    """
    return leaders_of_pairs(len(frame), *_near(frame, joints, within))


def leaders_of_pairs(n: int, first: NDArray[np.intp], second: NDArray[np.intp]) -> NDArray[np.intp]:
    """Find for each of n, the best come first, the one that stands for it; pairs are near, the earlier first.

    One stands for itself unless one before it that does so is near; it goes to the first such.
    """
    open_ = np.zeros(n, dtype=np.bool_)
    open_[second] = True
    stands = ~open_
    while open_.any():
        # Those near one that stands for itself are taken in; those whose earlier neighbours are all taken stand.
        open_[second[stands[first] & open_[second]]] = False
        waiting = open_[first] & open_[second]
        held = np.zeros(n, dtype=np.bool_)
        held[second[waiting]] = True
        new = open_ & ~held
        stands |= new
        open_ &= ~new
    taken = stands[first] & ~stands[second]
    leader = np.where(stands, np.arange(n), n)
    np.minimum.at(leader, second[taken], first[taken])
    return leader


def _near(frame: NDArray[np.intp], joints: Array, within: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return pairs of postures of a frame, the earlier first, none of whose joints are farther apart.

    Only those are compared whose joints' projections on one direction, which differ by no more than the joints do, are
    that near.
    """
    n, count = len(frame), joints.shape[1]
    shadow = joints @ PROJECTION_AXIS
    key = shadow[:, count // 2 :].mean(axis=1)  # of the far ends of the body, which differ most
    order = np.lexsort((key, frame))
    spread = float(np.ptp(key)) + 2 * within + 1.0 if n else 1.0
    line = (key + frame * 2 * spread)[order]
    slack = 1e-9 * (1.0 + np.abs(line).max(initial=0.0))
    pairs = np.searchsorted(line, line + within + slack, side="right") - np.arange(n) - 1
    begin = np.repeat(np.arange(n), pairs)
    other = begin + 1 + np.arange(len(begin)) - np.repeat(np.cumsum(pairs) - pairs, pairs)
    a, b = order[begin], order[other]
    for joint in range(count - 1, -1, -1):
        maybe = np.abs(shadow[a, joint] - shadow[b, joint]) <= within + slack
        a, b = a[maybe], b[maybe]
    apart = joints[a] - joints[b]
    near = np.einsum("npi,npi->np", apart, apart).max(axis=1, initial=0.0) <= within * within
    a, b = a[near], b[near]
    return np.minimum(a, b), np.maximum(a, b)
