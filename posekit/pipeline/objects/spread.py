r"""How far depths may be off where image points are: little across a segment that is steep, much where it is level.

A segment of length l that is seen e long, both its ends off by p at most, has a depth between
:math:`\sqrt{l^2 - (e + 2p)^2}` and :math:`\sqrt{l^2 - (e - 2p)^2}`. That does not depend on its flip: the depths of two
points of the tree are off by no more than the sum over the segments between them, in all leaves alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from posekit.cameras import Array
from posekit.linkage import SpanningTree
from posekit.tree import Check, Findings


@dataclass(frozen=True, kw_only=True, eq=False)
class Spread:
    """What image points that are not exact do to a tree at one scale.

    Parameters
    ----------
    parents : tuple of int (J,)
    edges : array (J,)
        By how much the depth across the segment to each joint's parent may be off, working units.
    beside : float
        By how much a point may be off in x and y.
    """

    parents: tuple[int, ...]
    edges: Array
    beside: float

    @staticmethod
    def of(spanned: SpanningTree, place: Array, beside: float) -> Spread:
        """Make it of image points in the tree's order (J, 2), working units."""
        tree = spanned.tree
        parents = np.array(tree.parents[1:], dtype=np.intp)
        length = tree.lengths[1:]
        seen = np.linalg.norm(place[1:] - place[parents], axis=1)
        least, depth, most = (
            np.sqrt(np.maximum(length**2 - np.maximum(seen + off, 0.0) ** 2, 0.0))
            for off in (2 * beside, 0.0, -2 * beside)
        )
        edges = np.concatenate([[0.0], np.maximum(most - depth, depth - least)])
        return Spread(parents=tree.parents, edges=edges, beside=beside)

    def between(self, a: int, b: int) -> float:
        """Return by how much the depth between two joints may be off."""
        return float(self.edges[list(self._path(a) ^ self._path(b))].sum())

    def off(self, joints: Sequence[int]) -> float:
        """Return by how much each of some joints may be off, if one of them stays where it is."""
        if len(joints) == 2:
            return self.between(*joints) / 2 + self.beside
        return self.beside + min(max(self.between(a, b) for b in joints) for a in joints)

    def _path(self, joint: int) -> set[int]:
        path: set[int] = set()
        while joint > 0:
            path.add(joint)
            joint = self.parents[joint]
        return path


@dataclass(frozen=True, kw_only=True)
class Loose:
    """A check of points that may be off: its tolerance grows by what that changes.

    Parameters
    ----------
    check : Check
    spread : Spread
    distance : bool
        Whether it judges the distance of its two points; else something that changes by no more than they move.
    """

    check: Check
    spread: Spread
    distance: bool

    @property
    def name(self) -> str:
        """The check's."""
        return self.check.name

    @property
    def where(self) -> tuple[str, ...]:
        """The check's."""
        return self.check.where

    @property
    def unit(self) -> str:
        """The check's."""
        return self.check.unit

    @property
    def points(self) -> tuple[int, ...]:
        """The check's."""
        return self.check.points

    def judge(self, points: Array) -> Findings:
        """Judge with the larger tolerance; see `posekit.tree.Check`."""
        findings = self.check.judge(points)
        if not self.distance:
            return replace(findings, tolerance=findings.tolerance + self.spread.off(self.points))
        apart = points[:, 1] - points[:, 0]
        beside, depth = np.hypot(apart[:, 0], apart[:, 1]), np.abs(apart[:, 2])
        off = self.spread.between(*self.points)
        farthest = np.hypot(beside + 2 * self.spread.beside, depth + off)
        nearest = np.hypot(np.maximum(beside - 2 * self.spread.beside, 0.0), np.maximum(depth - off, 0.0))
        now = np.hypot(beside, depth)
        more = np.maximum(farthest - now, now - nearest)[:, None]
        return replace(findings, tolerance=findings.tolerance + more)
