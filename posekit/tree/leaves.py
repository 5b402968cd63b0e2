"""The living nodes of a tree over many frames, and the record of the branches that were pruned."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.tree.bits import Codes, path_of, select, support_of
from posekit.tree.candidates import Candidates


@dataclass(frozen=True, kw_only=True)
class Pruned:
    """P branches that one check pruned at one level, each with the finding that killed it.

    Parameters
    ----------
    level : int
        The tree's level; a pruned node stands for all 2^(J-1-level) leaves below it.
    frame, code : int array (P,)
        The frames and branch codes of the pruned nodes.
    check : str
        Who rejected it.
    where : tuple of str
        The check's places.
    unit : str
        Of value, lower and upper.
    place : int array (P,)
        Index into `where` of the first place that was violated.
    value, lower, upper : array (P,)
        What was found there, and the bounds.
    """

    level: int
    frame: NDArray[np.int32]
    code: Codes
    check: str
    where: tuple[str, ...]
    unit: str
    place: NDArray[np.int8]
    value: Array
    lower: Array
    upper: Array


Postponed = Callable[[], tuple[Array, Array, Array]]
"""Finds value, lower and upper (P,) of pruned branches."""


@dataclass(frozen=True, kw_only=True)
class Losses:
    """The same as `Pruned`, but value and bounds are found when they are first read.

    Parameters
    ----------
    level, frame, code, check, where, unit, place
        As of `Pruned`.
    measure : callable
        Finds value and bounds.
    """

    level: int
    frame: NDArray[np.int32]
    code: Codes
    check: str
    where: tuple[str, ...]
    unit: str
    place: NDArray[np.int8]
    measure: Postponed

    @cached_property
    def _found(self) -> tuple[Array, Array, Array]:
        return self.measure()

    @property
    def value(self) -> Array:
        """What was found (P,)."""
        return self._found[0]

    @property
    def lower(self) -> Array:
        """The lower bound (P,)."""
        return self._found[1]

    @property
    def upper(self) -> Array:
        """The upper bound (P,)."""
        return self._found[2]


@dataclass(frozen=True, kw_only=True)
class Leaves:
    """Living nodes at one level of the tree, sorted by frame, then by code.

    Parameters
    ----------
    joints, parents
        The tree's.
    candidates : Candidates
        Positions of all joints.
    given : array (F, G, 3)
        Points known beforehand.
    level : int
        How many joints beyond the root the codes cover.
    frame, code : int array (N,)
        Frame and branch code of each node.
    pruned : tuple of Pruned or Losses
        What was pruned so far, in order.
    """

    joints: tuple[str, ...]
    parents: tuple[int, ...]
    candidates: Candidates
    given: Array
    level: int
    frame: NDArray[np.int32]
    code: Codes
    pruned: tuple[Pruned | Losses, ...]

    @staticmethod
    def start(
        joints: tuple[str, ...],
        parents: tuple[int, ...],
        candidates: Candidates,
        given: Array | None,
        root: Array,
    ) -> Leaves:
        """Make the roots of F trees."""
        return Leaves(
            joints=joints,
            parents=parents,
            candidates=candidates,
            given=np.empty((len(root), 0, 3)) if given is None else given,
            level=0,
            frame=np.arange(len(root), dtype=np.int32),
            code=np.zeros(len(root), dtype=np.int32),
            pruned=(),
        )

    @property
    def n_frames(self) -> int:
        """Number of frames F."""
        return len(self.given)

    def keep(
        self,
        alive: NDArray[np.bool_],
        frame: NDArray[np.int32],
        code: Codes,
        level: int,
        pruned: tuple[Pruned | Losses, ...],
    ) -> Leaves:
        """Keep the nodes that are alive."""
        return self.at(level, frame[alive], code[alive], pruned)

    def at(
        self, level: int, frame: NDArray[np.int32], code: Codes, pruned: tuple[Pruned | Losses, ...] = ()
    ) -> Leaves:
        """Return other nodes of the same trees."""
        return Leaves(
            joints=self.joints,
            parents=self.parents,
            candidates=self.candidates,
            given=self.given,
            level=level,
            frame=frame,
            code=code,
            pruned=pruned,
        )

    def excess(self, joint: int) -> Array:
        """Return how much too short the segment to a joint is in each node (N,), metres."""
        path = select(self.level, path_of(joint, self.parents))[self.code]
        return self.candidates.excess[joint][self.frame, path]

    def support(self, points: Sequence[int]) -> tuple[int, ...]:
        """Return the joints on whose branches the positions of some points depend, in tree order."""
        return support_of(tuple(points), self.parents)

    def alike(self, points: Sequence[int]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Find the nodes that have some points in the same places: leaves of one tree share most of their limbs.

        Returns
        -------
        rows : int array (S,)
            The first node of each set of such nodes.
        place : int array (N,)
            The set of each node: what is true of ``rows[place]`` is true of the nodes, as far as these points go.
        """
        support = self.support(points)
        if support not in self._alike:
            choices = select(self.level, support)[self.code]
            sets = self.frame.astype(np.int64) << len(support) | choices
            _, rows, place = np.unique(sets, return_index=True, return_inverse=True)
            self._alike[support] = rows, place
        return self._alike[support]

    @cached_property
    def _alike(self) -> dict[tuple[int, ...], tuple[NDArray[np.intp], NDArray[np.intp]]]:
        return {}

    def positions(self, points: Sequence[int], nodes: NDArray[np.intp] | NDArray[np.int32]) -> Array:
        """Place some points in some nodes: (len(nodes), len(points), 3), camera frame, metres."""
        first, (frames, width) = self.candidates.first, self.candidates.table.shape[:2]
        code, row = self.code[nodes], self.frame[nodes] * np.intp(width)
        place = np.empty((len(nodes), len(points)), dtype=np.intp)
        for column, point in enumerate(points):
            beyond = point - len(self.joints)
            if beyond >= 0:  # it was given, or is not known: the table's last column
                place[:, column] = row + min(first[-1] + beyond, width - 1)
            else:
                path = select(self.level, path_of(point, self.parents))[code]
                np.add(row, path + first[point], out=place[:, column])
        return np.take(self.candidates.table.reshape(frames * width, 3), place, axis=0)

    def postures(self) -> Array:
        """Place all joints in all nodes: (N, J, 3), camera frame, metres; NaN where a joint is unknown."""
        frames, width = self.candidates.table.shape[:2]
        place = np.empty((len(self.code), len(self.joints)), dtype=np.intp)
        for joint, first in enumerate(self.candidates.first[:-1]):
            place[:, joint] = first + select(self.level, path_of(joint, self.parents))[self.code]
        place += self.frame[:, None] * np.intp(width)
        return np.take(self.candidates.table.reshape(frames * width, 3), place, axis=0)

    def length_residual(self) -> Array:
        """Return how much longer than the body's the longest drawn-out segment of each node is (N,), metres.

        Zero but where a segment was too short for its image and was taken as tangent to the ray.
        """
        worst = np.zeros(len(self.code))
        for joint in range(1, self.level + 1):
            worst = np.fmax(worst, self.excess(joint))
        return worst

    def branches(self) -> list[str]:
        """Write each node's code as a string of 0 (near) and 1 (far), the first joint's first."""
        return [f"{code:0{self.level}b}" if self.level else "" for code in self.code.tolist()]

    def counts(self) -> NDArray[np.int64]:
        """Count survivors per frame and level (F, J): distinct prefixes of the living leaves (§4.1.B)."""
        counts = np.zeros((self.n_frames, len(self.joints)), dtype=np.int64)
        first = np.ones(len(self.code), dtype=bool)
        first[1:] = self.frame[1:] != self.frame[:-1]
        for level in range(self.level + 1):
            prefix = self.code >> (self.level - level)
            new = first.copy()
            new[1:] |= prefix[1:] != prefix[:-1]
            counts[:, level] = np.bincount(self.frame[new], minlength=self.n_frames)
        return counts

    def offsets(self) -> NDArray[np.int64]:
        """Return where each frame's nodes start and the last ends (F + 1,)."""
        return np.searchsorted(self.frame, np.arange(self.n_frames + 1)).astype(np.int64)

    def rejected(self) -> list[dict[str, int]]:
        """Count, by frame and reason, the full tree's leaves that were lost; with the survivors, 2^(J-1)."""
        totals: list[dict[str, int]] = [{} for _ in range(self.n_frames)]
        depth = len(self.joints) - 1
        for group in self.pruned:
            weight = 1 << (depth - group.level)
            n_places = len(group.where)
            table = np.bincount(
                group.frame * n_places + group.place, minlength=self.n_frames * n_places
            ).reshape(-1, n_places)
            for frame, place in zip(*np.nonzero(table), strict=True):
                reason = f"{group.check}/{group.where[place]}"
                count = int(table[frame, place]) * weight
                totals[frame][reason] = totals[frame].get(reason, 0) + count
        return totals
