r"""How far depths may be off where image points are: little across a segment that is steep, much where it is level.

A segment of length l that is seen e long, both its ends off by p at most, has a depth between
:math:`\sqrt{l^2 - (e + 2p)^2}` and :math:`\sqrt{l^2 - (e - 2p)^2}`. That does not depend on its flip: the depths of two
points of the tree are off by no more than the sum over the segments between them, in all leaves alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from posekit.geometry import Array
from posekit.linkages import SpanningTree
from posekit.objects.shape import Perpendicular
from posekit.tree import Check, Findings, Place
from posekit.validators.linkage import Chord, NearerEnd


@dataclass(frozen=True, kw_only=True, eq=False)
class ImageSpread:
    """What image points that are not exact do to a tree at one scale.

    Parameters
    ----------
    parents : tuple of int (J,)
        The parent of each of the tree's joints; -1 for the root.
    edges : array (J,)
        By how much the depth across the segment to each joint's parent may be off, working units.
    beside : float
        By how much a point may be off in x and y.
    """

    parents: tuple[int, ...]
    edges: Array
    beside: float

    @staticmethod
    def of(spanned: SpanningTree, place: Array, beside: float) -> ImageSpread:
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
        return ImageSpread(parents=tree.parents, edges=edges, beside=beside)

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
class Loose(Check):
    """A check of points that may be off: its tolerance grows by what that changes.

    Parameters
    ----------
    check : Check
        Of the distance of two points, of a flip, or of a shape (`posekit.objects.shape`).
    spread : ImageSpread
        By how much the depths of points may be off.
    """

    check: Check
    spread: ImageSpread

    @property
    def name(self) -> str:
        """The check's."""
        return self.check.name

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """The check's."""
        return self.check.places

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
        return replace(findings, tolerance=findings.tolerance + self._more(points))

    def _more(self, points: Array) -> Array:
        """Return by how much the judged value may be off (N, 1)."""
        spread, joints = self.spread, self.points
        if isinstance(self.check, Chord):
            apart = points[:, 1] - points[:, 0]
            beside, depth = np.hypot(apart[:, 0], apart[:, 1]), np.abs(apart[:, 2])
            off = spread.between(*joints)
            farthest = np.hypot(beside + 2 * spread.beside, depth + off)
            nearest = np.hypot(np.maximum(beside - 2 * spread.beside, 0.0), np.maximum(depth - off, 0.0))
            now = np.hypot(beside, depth)
            return np.asarray(np.maximum(farthest - now, now - nearest)[:, None])
        if isinstance(self.check, NearerEnd):
            # Which end of a segment of the tree is nearer was chosen, not measured.
            chosen = spread.parents[joints[0]] == joints[1] or spread.parents[joints[1]] == joints[0]
            return np.array([[0.0 if chosen else spread.between(*joints)]])
        if isinstance(self.check, Perpendicular):
            a, b, c, d = joints
            return np.array([[spread.between(a, b) + spread.between(c, d) + 4 * spread.beside]])
        # The distance from the best plane or line, a root mean square, changes by no more than that of the shifts.
        shifts = [np.sqrt(np.mean([spread.between(a, b) ** 2 for b in joints])) for a in joints]
        return np.array([[spread.beside + min(shifts)]])
