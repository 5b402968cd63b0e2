"""The interpretation tree of a linkage: what places its points, and what of it only closes loops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from posekit.cameras import ScaledOrthographicCamera
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.linkages.linkage import Linkage
from posekit.linkages.naming import find
from posekit.tree import Check, InterpretationTree, Leaves

MAX_SEGMENTS = 22
"""The most segments that are enumerated at once: 2^22 flips, four million."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SpanningTree:
    """The tree that lifts every point of a linkage once, and the segments that are left over.

    Its joints are nodes of the linkage in breadth-first order. A midpoint is a joint where a segment ends in it: it is
    half its own segment away from either end, so its choice is not free and must be checked
    (`posekit.validators.linkage.middle`).

    Parameters
    ----------
    linkage : Linkage
        The object whose points the tree lifts.
    tree : InterpretationTree
        Lengths in the linkage's own unit.
    nodes : tuple of int (J,)
        The linkage's node that each joint of the tree is.
    segments : tuple of int (J,)
        The segment that lifts each joint, whole or half; -1 for the root.
    chords : tuple of int
        The segments that lift nothing: each closes a loop, and must be checked.
    """

    linkage: Linkage
    tree: InterpretationTree
    nodes: tuple[int, ...]
    segments: tuple[int, ...]
    chords: tuple[int, ...]

    @property
    def n_flips(self) -> int:
        """Number of ways to flip all segments of the linkage, before any is excluded: 2^S."""
        return 1 << len(self.linkage.segments)

    def joint(self, node: int) -> int:
        """Return the joint of the tree that is a node of the linkage."""
        return self.nodes.index(node)

    def place_image(self, image: Array) -> Array:
        """Put the image points of a linkage (F, P, 2) in the tree's order (F, J, 2), midpoints added."""
        return self.linkage.place_nodes(image)[:, list(self.nodes)]

    def grow(
        self,
        camera: ScaledOrthographicCamera,
        image: Array,
        checks: Sequence[Check] = (),
        *,
        tolerance: float = 0.0,
    ) -> Leaves:
        """Grow the tree over F frames from its root at depth zero.

        Parameters
        ----------
        camera : ScaledOrthographicCamera
            Its scale in pixels a unit of the linkage's lengths.
        image : array (F, P, 2)
            Image points in the linkage's order, pixels.
        checks : sequence of Check
            Over joints of this tree; `posekit.validators.linkage.closure` makes those that it needs itself.
        tolerance : float
            By how much a segment may be too short for its image, in the unit of its lengths.
        """
        seen = self.place_image(image)
        root = np.zeros((len(seen), 3))
        root[:, :2] = camera.unproject(seen[:, 0])
        return self.tree.grow(camera, root, seen, checks, tolerance=tolerance)

    def points(self, postures: Array) -> Array:
        """Put postures of the tree (N, J, 3) in the linkage's order (N, P, 3), midpoints left out."""
        place = [self.nodes.index(point) for point in range(len(self.linkage.points))]
        return postures[:, place]


def span(linkage: Linkage, root: str | None = None) -> SpanningTree:
    """Span a linkage by a tree in breadth-first order.

    Parameters
    ----------
    linkage : Linkage
        The object whose points are to be lifted.
    root : str, optional
        The point to start from; by default the first.

    Returns
    -------
    SpanningTree

    Raises
    ------
    InputError
        Where there is no such point, or more than `MAX_SEGMENTS` segments would have to be enumerated.
    """
    edges = [
        *((a, b, number, 1.0) for number, (a, b) in enumerate(linkage.segments)),
        *((end, middle, whole, 0.5) for end, middle, whole in _used_halves(linkage)),
    ]
    neighbours: dict[int, list[tuple[int, int, float]]] = {}
    for a, b, number, share in edges:
        neighbours.setdefault(a, []).append((b, number, share))
        neighbours.setdefault(b, []).append((a, number, share))
    nodes = [0 if root is None else find(f"linkage {linkage.name}", root, linkage.nodes)]
    parents, segments, lengths = [-1], [-1], [0.0]
    lifted: list[tuple[int, float]] = []
    for joint, node in enumerate(nodes):  # grows while it is walked
        # Breadth first: the nearer a joint is to the root, the fewer segments its depth's error sums over.
        for other, number, share in neighbours.get(node, []):
            if other not in nodes:
                nodes.append(other)
                parents.append(joint)
                segments.append(number)
                lengths.append(share * float(linkage.lengths[number]))
                lifted.append((number, share))
    if len(nodes) - 1 > MAX_SEGMENTS:
        raise InputError(
            f"linkage {linkage.name}: {len(nodes) - 1} segments to enumerate, 2^{len(nodes) - 1} flips; "
            f"expected at most {MAX_SEGMENTS}: split the object, or give the flips and use its family"
        )
    # Two halves in one line are the whole: the midpoint's own check holds it.
    placed = {number for number, _ in lifted if (number, 1.0) in lifted or lifted.count((number, 0.5)) == 2}
    return SpanningTree(
        linkage=linkage,
        tree=InterpretationTree(
            joints=tuple(linkage.nodes[node] for node in nodes),
            parents=tuple(parents),
            lengths=np.array(lengths),
        ),
        nodes=tuple(nodes),
        segments=tuple(segments),
        chords=tuple(number for number in range(len(linkage.segments)) if number not in placed),
    )


def _used_halves(linkage: Linkage) -> list[tuple[int, int, int]]:
    """Return the halves of the segments in whose midpoint another segment ends."""
    used = {node for ends in linkage.segments for node in ends}
    return [half for half in linkage.halves if half[1] in used]
