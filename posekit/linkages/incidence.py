"""How segments and points hang together, as matrices: depths from foreshortenings, and what closes a loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.linkages.consistency import components
from posekit.linkages.linkage import Linkage

ZERO_COEFFICIENT = 1e-9
"""Below it a coefficient of these matrices is rounding: all are small fractions."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Incidence:
    r"""The linear algebra of a linkage, or of as much of it as is seen.

    With the signed foreshortening :math:`\sigma_i\,dZ_i` of each segment from its first end to its second, the depths
    of the points solve :math:`A Z = \sigma\,dZ`, where a row of the incidence matrix A has -1 and 1 at the ends (halves
    where an end is a midpoint). A point's depth is :math:`Z = B (\sigma\,dZ)`; loops close where
    :math:`C (\sigma\,dZ) = 0`.

    Parameters
    ----------
    depth : array (N, S)
        B by node, relative to the first node of its piece; zero for segments that are not seen.
    loops : array (L, S)
        C: one row a loop, its largest coefficient 1.
    part : tuple of int (N,)
        Which piece each node belongs to; nodes of different pieces have no relative depth.
    root : int
        The node at depth zero: the first of the piece with the most segments.
    """

    depth: Array
    loops: Array
    part: tuple[int, ...]
    root: int

    @property
    def placed(self) -> NDArray[np.bool_]:
        """Which nodes have a depth relative to the root (N,)."""
        return np.array([number == self.part[self.root] for number in self.part])

    def spread(self, nodes: Sequence[int]) -> Array:
        """Return the rows of B for some nodes of one piece, less their mean: what their flatness depends on."""
        rows = self.depth[list(nodes)]
        centred: Array = rows - rows.mean(axis=0)
        centred[np.abs(centred) < ZERO_COEFFICIENT] = 0.0
        return centred


def incidence(linkage: Linkage, seen: Sequence[bool]) -> Incidence:
    """Build the matrices of a linkage of whose segments some are seen.

    Parameters
    ----------
    linkage : Linkage
        The object.
    seen : sequence of bool (S,)
        Whether each segment is seen at both ends.
    """
    n_points, n_nodes, n_segments = len(linkage.points), len(linkage.nodes), len(linkage.segments)
    weights = linkage.place_nodes(np.eye(n_points))
    kept = np.flatnonzero(seen)
    ends = np.array(linkage.segments)
    A = weights[ends[:, 1]] - weights[ends[:, 0]]
    # A midpoint is where its ends are as soon as one of them is placed and the segment is seen.
    edges = [linkage.segments[number] for number in kept]
    edges += [(end, middle) for end, middle, whole in linkage.halves if seen[whole]]
    pieces = components(n_nodes, edges)
    part = [0] * n_nodes
    for number, piece in enumerate(pieces):
        for node in piece:
            part[node] = number
    sizes = np.bincount([part[linkage.segments[number][0]] for number in kept], minlength=len(pieces))
    largest = int(sizes.argmax())
    root = pieces[largest][0]
    B = np.zeros((n_points, n_segments))
    B[:, kept] = np.linalg.pinv(A[kept])
    depth = weights @ B
    for piece in pieces:
        depth[piece] -= depth[piece[0]]
    depth[np.abs(depth) < ZERO_COEFFICIENT] = 0.0
    return Incidence(depth=depth, loops=_loops(A, kept), part=tuple(part), root=root)


def _loops(A: Array, kept: NDArray[np.intp]) -> Array:
    """Write each segment that depends on those before it by them: the left null space of A, loop by loop."""
    basis: list[int] = []
    chords: list[int] = []
    orthonormal = np.empty((0, A.shape[1]))
    for number in kept.tolist():
        rest = A[number] - (A[number] @ orthonormal.T) @ orthonormal
        rest -= (rest @ orthonormal.T) @ orthonormal  # once more, against rounding
        size = float(np.linalg.norm(rest))
        if size > ZERO_COEFFICIENT:
            basis.append(number)
            orthonormal = np.concatenate([orthonormal, rest[None] / size])
        else:
            chords.append(number)
    loops = np.zeros((len(chords), len(A)))
    if chords:
        loops[:, basis] = -np.linalg.lstsq(A[basis].T, A[chords].T, rcond=None)[0].T
        loops[np.arange(len(chords)), chords] = 1.0
        loops = np.round(loops * 4096) / 4096  # coefficients are sums of halves
        loops /= np.abs(loops).max(axis=1, keepdims=True)
    return loops
