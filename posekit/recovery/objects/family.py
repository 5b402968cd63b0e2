"""The family of postures behind one uncalibrated image: a scale, and one sign for each segment (Taylor 2000, §2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import CameraError, refusal
from posekit.geometry import FARTHEST_COORDINATE, Array, Record, read_only
from posekit.recovery.objects.linkage import Linkage

#: Relative difference between a scale and a segment's bound, below which the segment has no depth.
AT_BOUND: Final = 1e-12

#: Coefficients of incidence matrices below this value are rounding errors; exact coefficients are sums of halves.
ZERO_COEFFICIENT: Final = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class LinkageFamily(Record):
    r"""All postures of a linkage that have the same image in a scaled orthographic camera.

    At scale s, the depths of a segment's two ends differ by :math:`dZ = \sqrt{l^2 - (\Delta u^2 + \Delta v^2)/s^2}`
    (Taylor 2000, eq. 2). A *flip* is the sign of this difference: it states which end of the segment is nearer. S
    segments have 2^S combinations of flips. The square root is real if :math:`s \ge \sqrt{\Delta u^2 + \Delta v^2}/l`
    (eq. 3, where the paper prints the inverse fraction).

    Parameters
    ----------
    linkage : Linkage
    image : array (P, 2)
        Image points, pixels; unseen points are NaN.
    aspect : float
        Ratio of a pixel's width to its height. The coordinate u is multiplied by it; the scale s applies to v.

    Raises
    ------
    InputError
        If the image has another shape, or shows no segment.
    """

    linkage: Linkage
    image: Array
    aspect: float = 1.0

    def __post_init__(self) -> None:
        where, count = f"linkage {self.linkage.name}", len(self.linkage.points)
        self._set("image", read_only(self.image))
        if self.image.shape != (count, 2) or (np.abs(self.image) > FARTHEST_COORDINATE).any():
            got, expected = f"shape {self.image.shape}", f"({count}, 2) pixels"
            raise refusal(where, "image", got, expected, "give each point once")
        if not self.aspect > 0:
            raise refusal(where, "aspect", f"{self.aspect:g}", "a positive number", error=CameraError)
        if not self.seen.any():
            raise refusal(where, "image", "no segment with both ends", "at least one", "add image points")

    @cached_property
    def place(self) -> Array:
        """Image of the nodes (N, 2), square pixels."""
        return self.linkage.place_nodes(self.image * np.array([self.aspect, 1.0]))

    @cached_property
    def extent(self) -> Array:
        """Length of each segment's image (S,), pixels; NaN if an end is not seen."""
        ends = np.array(self.linkage.segments)
        return np.asarray(np.linalg.norm(self.place[ends[:, 1]] - self.place[ends[:, 0]], axis=1))

    @property
    def seen(self) -> NDArray[np.bool_]:
        """True for segments seen at both ends (S,)."""
        return np.isfinite(self.extent)

    @property
    def bounds(self) -> Array:
        """Smallest scale that each segment allows (S,), pixels per unit of length."""
        return np.asarray(self.extent / self.linkage.lengths)

    @property
    def minimum_scale(self) -> float:
        """Smallest scale that all segments allow; the default scale of Taylor (2000, §3.1)."""
        return float(np.nanmax(self.bounds))

    @property
    def bounding_segment(self) -> str:
        """Name of the segment that determines the smallest scale of the whole linkage."""
        return self.linkage.segment_names[int(np.nanargmax(self.bounds))]

    def foreshortening(self, s: ArrayLike) -> Array:
        """Return dZ >= 0 of each segment (..., S) at scales (...), units of length (Taylor 2000, eq. 2).

        Raises
        ------
        CameraError
            If a scale is below its lower bound; the message names the bound and the segment that determines it.
        """
        scale = np.asarray(s, dtype=np.float64)
        bound = self.minimum_scale
        if not (scale >= bound * (1 - AT_BOUND)).all():
            low = float(scale[~(scale >= bound * (1 - AT_BOUND))].flat[0])
            needs = f"at least {bound:.9g}, which {self.bounding_segment} needs"
            raise refusal("", "scale", f"{low:.9g}", needs, "give a larger scale", error=CameraError)
        apart = self.extent / scale[..., None]
        lengths = self.linkage.lengths
        # (l - e) (l + e), because near the bound the difference of squares would lose half the digits.
        return np.sqrt(np.maximum((lengths - apart) * (lengths + apart), 0.0))

    def points(self, s: ArrayLike, flips: ArrayLike) -> Array:
        """Return the points (..., P, 3), units of length: x, y from the image, depth relative to the first point.

        Parameters
        ----------
        s : float or array (...)
            Scales, pixels per unit of length.
        flips : array (..., S)
            1 if the first end of a segment is nearer, -1 if the second end is nearer, 0 if the segment has no depth.

        Notes
        -----
        If the depths around a loop are inconsistent, they are averaged; the segments of the loop then differ a little
        from their lengths.
        """
        signed = np.where(self.seen, np.asarray(flips, dtype=np.float64) * self.foreshortening(s), 0.0)
        return self.placed(s, np.where(self.incidence.placed, signed @ self.incidence.depth.T, np.nan))

    def placed(self, s: ArrayLike, depth: Array) -> Array:
        """Return the points (..., P, 3), units of length, at scales (...) and depths of the nodes (..., N)."""
        nodes = with_depth(self.place / np.asarray(s, dtype=np.float64)[..., None, None], depth)
        return nodes[..., : len(self.linkage.points), :]

    def flips_of(self, points: ArrayLike) -> NDArray[np.int8]:
        """Return the flips (..., S) of postures (..., P, 3); 0 for segments whose ends have the same depth."""
        nodes = self.linkage.place_nodes(np.asarray(points, dtype=np.float64))
        ends = np.array(self.linkage.segments)
        return np.sign(nodes[..., ends[:, 1], 2] - nodes[..., ends[:, 0], 2]).astype(np.int8)

    def flat_groups(self) -> Iterator[tuple[str, int, list[int]]]:
        """Yield the kind, the dimension (2 or 1) and the seen nodes of each coplanar or collinear group."""
        groups = [("coplanar", 2, group) for group in self.linkage.coplanar]
        groups += [("collinear", 1, group) for group in self.linkage.collinear]
        for kind, rank, group in groups:
            nodes = [node for node in group if self.incidence.placed[node]]
            if len(nodes) >= rank + 2:
                yield kind, rank, nodes

    @cached_property
    def incidence(self) -> Incidence:
        """Incidence matrices of the segments that are seen."""
        return Incidence.of(self.linkage, self.seen)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Incidence(Record):
    r"""Incidence matrices of the graph whose nodes are the linkage's nodes, and whose edges are its (seen) segments.

    The signed foreshortenings :math:`\sigma_i dZ_i` and the depths Z of the points satisfy :math:`A Z = \sigma dZ`,
    where a row of A has -1 and 1 in the columns of a segment's ends (halves for a midpoint). The matrix B solves this
    for the depths: :math:`Z = B (\sigma dZ)`. A third matrix C gives the gaps of loops: all loops close if :math:`C
    (\sigma dZ) = 0`. A basis of linearly independent segments determines all depths: :math:`Z = T (\sigma dZ)`.

    Parameters
    ----------
    depth : array (N, S)
        Matrix B, for depths relative to the first node of each connected component. If loops do not close, it is a
        least-squares solution.
    tree : array (N, S)
        Matrix T, for depths computed from the segments of the basis alone.
    basis : int array (K,)
        Linearly independent segments that determine all depths; each other segment closes a loop.
    loops : array (L, S)
        Matrix C, with one row for each loop; the largest coefficient of a row is 1.
    part : int array (N,)
        Number of each node's connected component; the relative depth of different components is unknown.
    placed : bool array (N,)
        True for the nodes of the connected component with the most segments.
    """

    depth: Array
    tree: Array
    basis: NDArray[np.intp]
    loops: Array
    part: NDArray[np.intp]
    placed: NDArray[np.bool_]

    @staticmethod
    def of(linkage: Linkage, seen: NDArray[np.bool_]) -> Incidence:
        """Return the incidence matrices of a linkage; `seen` (S,) marks segments with both ends in the image."""
        from scipy.sparse.csgraph import connected_components

        weights = linkage.place_nodes(np.eye(len(linkage.points)))
        ends, kept = np.array(linkage.segments), np.flatnonzero(seen)
        A = weights[ends[:, 1]] - weights[ends[:, 0]]
        graph = np.zeros((len(linkage.nodes),) * 2)
        graph[tuple(ends[kept].T)] = 1
        # A midpoint belongs to the piece of its ends if its segment is seen.
        for end, middle, whole in linkage.halves:
            graph[end, middle] = seen[whole]
        _, part = connected_components(graph, directed=False)
        largest = int(np.bincount(part[ends[kept, 0]], minlength=part.max() + 1).argmax())
        basis: list[int] = []
        for number in kept.tolist():
            if np.linalg.matrix_rank(A[[*basis, number]], tol=ZERO_COEFFICIENT) > len(basis):
                basis.append(number)
        chords = np.setdiff1d(kept, basis)

        def depths(segments: Sequence[int] | NDArray[np.intp]) -> Array:
            found = np.zeros((len(weights), len(A)))
            found[:, segments] = weights @ np.linalg.pinv(A[segments])
            for piece in range(part.max() + 1):
                nodes = np.flatnonzero(part == piece)
                found[nodes] -= found[nodes[0]]
            found[np.abs(found) < ZERO_COEFFICIENT] = 0.0
            return found

        tree = depths(basis)
        # Coefficients are sums of halves.
        loops = (
            np.eye(len(A))[chords] - np.round(4096 * (tree[ends[chords, 1]] - tree[ends[chords, 0]])) / 4096
        )
        loops /= np.abs(loops).max(axis=1, keepdims=True)
        return Incidence(
            depth=depths(kept),
            tree=tree,
            basis=np.array(basis),
            loops=loops,
            part=part,
            placed=part == largest,
        )


def with_depth(place: Array, depth: Array) -> Array:
    """Return points (..., N, 3) with coordinates x, y (..., N, 2) and depths (..., N)."""
    return np.concatenate([np.broadcast_to(place, (*depth.shape, 2)), depth[..., None]], axis=-1)


def off_flat(points: Array, rank: int) -> Array:
    """Return the distances (..., N, 3 - rank) of points (..., N, 3) from their best plane (rank 2) or line (rank 1).

    For complex points, the plane is fitted to the real parts: the derivative of the residual does not depend on the
    derivative of the best plane.
    """
    centred = points - points.mean(axis=-2, keepdims=True)
    _, axes = np.linalg.eigh(np.swapaxes(centred.real, -1, -2) @ centred.real)
    return np.asarray(centred @ axes[..., : 3 - rank])
