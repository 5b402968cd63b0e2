"""What is grown for frames that show the same points of an object: its tree, and the checks that prune it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.linkages import Linkage, Midpoint, SpanningTree, span
from posekit.linkages.consistency import components
from posekit.objects.articulated import ArticulatedObject
from posekit.objects.object_tolerance import ObjectTolerance
from posekit.objects.shape import shape_checks
from posekit.objects.spread import ImageSpread, Loose
from posekit.tree import Check
from posekit.validators import linkage as validators


@dataclass(frozen=True, kw_only=True, eq=False)
class ObjectPlan:
    """The tree over the points that are seen.

    Parameters
    ----------
    thing : ArticulatedObject
        The object, with its robot where it has one.
    linkage : Linkage
        As much of it as is seen, in working units.
    columns : tuple of int
        The object's point that each point of `linkage` is.
    segments : tuple of int
        The object's segment that each segment of `linkage` is.
    nearer : mapping
        Flips given by hand: segment to nearer end.
    """

    thing: ArticulatedObject
    linkage: Linkage
    columns: tuple[int, ...]
    segments: tuple[int, ...]
    nearer: Mapping[str, str]

    @staticmethod
    def of(thing: ArticulatedObject, seen: NDArray[np.bool_], nearer: Mapping[str, str]) -> ObjectPlan:
        """Make the plan for frames that show some points (P,).

        Raises
        ------
        InputError
            Where what is seen falls apart without a point that is not; where there are too many flips.
        """
        linkage, columns, segments = seen_part(thing.working, seen)
        kept = set(linkage.segment_names)
        choices = {}
        for name, end in nearer.items():
            number = thing.linkage.segment(name)
            if thing.linkage.segment_names[number] in kept:
                choices[thing.linkage.segment_names[number]] = end
        plan = ObjectPlan(thing=thing, linkage=linkage, columns=columns, segments=segments, nearer=choices)
        _ = plan.spanned
        return plan

    @cached_property
    def spanned(self) -> SpanningTree:
        """The tree; its root is the first point that is seen."""
        return span(self.linkage)

    @property
    def hypotheses(self) -> int:
        """How many leaves the tree has before any is pruned."""
        return 1 << (len(self.spanned.nodes) - 1)

    def evidence_level(self, *, fitted: Collection[str]) -> int | None:
        """Return the level at which all loops have closed and all that is known of the shape holds.

        Exactly, they do so only if the image is exact.

        Parameters
        ----------
        fitted : collection of str
            The constraints that the scale was chosen by: a single loop that was made to close shows nothing.

        Returns
        -------
        int or None
            None where there is nothing that would show it.
        """
        closing = validators.closure(self.spanned)
        if "closure" in fitted and len(closing) == 1:
            closing = []
        shape = [check for check in shape_checks(self.spanned, tolerance=0.0) if check.name not in fitted]
        return max((max(check.points) for check in [*closing, *shape]), default=None)

    def checks(self, tolerance: ObjectTolerance, spread: ImageSpread | None = None) -> list[Check]:
        """Make the checks: loops, shape, flips given by hand, limits of the robot.

        Parameters
        ----------
        tolerance : ObjectTolerance
            By how much loops and shapes may be off, working units.
        spread : ImageSpread, optional
            How far depths may be off; absent where the image is exact.
        """
        spanned = self.spanned
        closing = validators.closure(spanned, tolerance=tolerance.rigid)
        others = [
            *shape_checks(spanned, tolerance=tolerance.rigid),
            *validators.nearer(self.nearer, joints=spanned.tree.joints, segments=self.linkage.segment_names),
        ]
        off: float | Callable[[Sequence[int]], float] = tolerance.point
        if spread is not None:
            # A midpoint has the depths of its halves' ends, however far these are off.
            closing = [
                check if isinstance(check, validators.MiddleOfEnds) else Loose(check=check, spread=spread)
                for check in closing
            ]
            others = [Loose(check=check, spread=spread) for check in others]
            off = spread.off
        limits = self.thing.limits
        return [
            *closing,
            *others,
            *([] if limits is None else limits.checks(spanned.tree.joints, tolerance=off)),
        ]

    def place(self, points: Array) -> Array:
        """Put points of the seen part (N, p, 3) among all of the object's (N, P, 3), NaN elsewhere."""
        placed = np.full((len(points), len(self.thing.linkage.points), 3), np.nan)
        placed[:, list(self.columns)] = points
        return placed


def seen_part(linkage: Linkage, seen: NDArray[np.bool_]) -> tuple[Linkage, tuple[int, ...], tuple[int, ...]]:
    """Leave out the points of a linkage that are not seen, with their segments.

    Raises
    ------
    InputError
        Where the rest falls apart: the missing points join it.
    """
    if seen.all():
        return linkage, tuple(range(len(linkage.points))), tuple(range(len(linkage.segments)))
    missing = ", ".join(name for name, there in zip(linkage.points, seen, strict=True) if not there)
    middles = [m for m in linkage.midpoints if seen[list(m.ends)].all()]
    kept_middles = {linkage.nodes.index(middle.name) for middle in middles}
    nodes = [
        node
        for node in range(len(linkage.nodes))
        if node in kept_middles or (node < len(seen) and seen[node])
    ]
    new = {node: number for number, node in enumerate(nodes)}
    segments = [k for k, (a, b) in enumerate(linkage.segments) if a in new and b in new]
    renumbered = {old: number for number, old in enumerate(segments)}
    edges = [(new[linkage.segments[k][0]], new[linkage.segments[k][1]]) for k in segments]
    halves = [(new[m.ends[k]], new[linkage.nodes.index(m.name)]) for m in middles for k in (0, 1)]
    parts = components(len(nodes), [*edges, *halves])
    if not segments:
        raise InputError(
            f"linkage {linkage.name}: no segment is seen at both ends (not seen: {missing}); add image points"
        )
    if len(parts) > 1:
        groups = [", ".join(linkage.nodes[nodes[k]] for k in part[:6]) for part in parts[:3]]
        raise InputError(
            f"linkage {linkage.name}: {missing} not seen, and without the rest falls apart into "
            f"({') and ('.join(groups)}); add image points, or drop the frame"
        )
    columns = tuple(int(column) for column in np.flatnonzero(seen))
    part = replace(
        linkage,
        points=tuple(linkage.points[column] for column in columns),
        segments=tuple(edges),
        lengths=linkage.lengths[segments],
        midpoints=tuple(Midpoint(name=m.name, ends=(new[m.ends[0]], new[m.ends[1]])) for m in middles),
        coplanar=tuple(
            group
            for group in (tuple(new[k] for k in old if k in new) for old in linkage.coplanar)
            if len(group) >= 4
        ),
        perpendicular=tuple(
            (renumbered[a], renumbered[b]) for a, b in linkage.perpendicular if {a, b} <= set(renumbered)
        ),
        collinear=tuple((new[a], new[b], new[c]) for a, b, c in linkage.collinear if {a, b, c} <= set(new)),
    )
    return part, columns, tuple(segments)
