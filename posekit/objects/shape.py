"""What else is known of an object's shape: sets in a plane or on a line, segments at right angles (Taylor, §2.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posekit.geometry import Array
from posekit.linkages import SpanningTree
from posekit.tree import Check, Findings, Place


def shape_checks(spanned: SpanningTree, *, tolerance: float) -> list[Check]:
    """Make the checks of a linkage's coplanar and collinear sets and perpendicular pairs.

    Parameters
    ----------
    spanned : SpanningTree
        Groups with a midpoint that is not in its tree are passed over.
    tolerance : float
        How far a point may be beside the plane or line, and the foot of a segment's end beside its start.
    """
    linkage = spanned.linkage
    groups = [
        *(("coplanar", group, 2) for group in linkage.coplanar),
        *(("collinear", group, 1) for group in linkage.collinear),
    ]
    found: list[Check] = []
    for name, group, rank in groups:
        if set(group) <= set(spanned.nodes):
            where = "-".join(linkage.nodes[node] for node in group)
            points = tuple(spanned.joint(node) for node in group)
            found.append(
                Flat(name=name, places=(Place(name=where),), points=points, rank=rank, tolerance=tolerance)
            )
    for first, second in linkage.perpendicular:
        nodes = (*linkage.segments[first], *linkage.segments[second])
        if set(nodes) <= set(spanned.nodes):
            where = f"{linkage.segment_names[first]}_{linkage.segment_names[second]}"
            points = tuple(spanned.joint(node) for node in nodes)
            found.append(Perpendicular(places=(Place(name=where),), points=points, tolerance=tolerance))
    return found


@dataclass(frozen=True, kw_only=True)
class Flat(Check):
    """Root mean square distance of points from their best plane (rank 2) or line (rank 1)."""

    name: str
    places: tuple[Place, ...]
    points: tuple[int, ...]
    rank: int
    tolerance: float
    unit: str = "m"

    def judge(self, points: Array) -> Findings:
        """Compare with zero; see `posekit.tree.Check`."""
        value = np.full((len(points), 1), np.nan)
        known = np.isfinite(points).all(axis=(1, 2))
        centred = points[known] - points[known].mean(axis=1, keepdims=True)
        sizes = np.linalg.svd(centred, compute_uv=False)
        value[known, 0] = np.sqrt((sizes[:, self.rank :] ** 2).sum(axis=1) / len(self.points))
        return Findings(
            value=value, lower=np.array([-np.inf]), upper=np.array([0.0]), tolerance=self.tolerance
        )


@dataclass(frozen=True, kw_only=True)
class Perpendicular(Check):
    """The shorter of two segments projected on the other: zero where they are at right angles."""

    places: tuple[Place, ...]
    points: tuple[int, ...]
    tolerance: float
    name: str = "perpendicular"
    unit: str = "m"

    def judge(self, points: Array) -> Findings:
        """Compare with zero; see `posekit.tree.Check`."""
        a, b = points[:, 1] - points[:, 0], points[:, 3] - points[:, 2]
        longer = np.maximum(np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1))
        value = np.abs(np.einsum("ni,ni->n", a, b) / longer)[:, None]
        return Findings(
            value=value, lower=np.array([-np.inf]), upper=np.array([0.0]), tolerance=self.tolerance
        )
