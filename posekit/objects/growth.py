"""Trees of one frame of an object, at all scales that were taken for it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import ScaledOrthographicCamera
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.objects.mirror import mirrored
from posekit.objects.object_plan import ObjectPlan
from posekit.objects.object_tolerance import ObjectTolerance
from posekit.objects.spread import ImageSpread
from posekit.tree import Check, Leaves

AT_ONCE = 1 << 20
"""Leaves before pruning that are grown together."""

MAX_POSTURES = 1 << 14
"""The most postures of one frame: fourteen segments that nothing decides."""

LEVEL_DEPTH = 1e-7
"""Working units of depth below which neither end of a segment is nearer."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GrownObject:
    """What survived of one frame.

    Parameters
    ----------
    plan : ObjectPlan
        What was grown: the tree over the points that are seen.
    parts : tuple of (Leaves, int)
        Trees grown together, each with the number of its first scale.
    checks : list of Check
        Those that pruned them.
    tolerance : ObjectTolerance
        What it was judged with, working units.
    judged : str
        What that is called in the result.
    """

    plan: ObjectPlan
    parts: tuple[tuple[Leaves, int], ...]
    checks: list[Check]
    tolerance: ObjectTolerance
    judged: str

    @cached_property
    def postures(self) -> Array:
        """The tree's joints in all survivors (N, J, 3), working units."""
        return np.concatenate([leaves.postures() for leaves, _ in self.parts])

    @property
    def points(self) -> Array:
        """The points in all survivors (N, p, 3)."""
        return self.plan.spanned.points(self.postures)

    @property
    def hypothesis(self) -> NDArray[np.intp]:
        """The scale of each survivor (N,)."""
        return np.concatenate([leaves.frame.astype(np.intp) + first for leaves, first in self.parts])

    @property
    def branches(self) -> list[str]:
        """Near (0) or far (1), level by level."""
        return [code for leaves, _ in self.parts for code in leaves.branches()]

    @cached_property
    def flips(self) -> NDArray[np.int8]:
        """The nearer ends of the linkage's segments (N, S): 1 the first, -1 the second, 0 neither."""
        linkage = self.plan.linkage
        nodes = linkage.place_nodes(self.points)
        ends = np.array(linkage.segments)
        apart = nodes[:, ends[:, 1], 2] - nodes[:, ends[:, 0], 2]
        return np.where(np.abs(apart) <= LEVEL_DEPTH, 0, np.sign(apart)).astype(np.int8)

    @property
    def levels(self) -> tuple[tuple[str, int], ...]:
        """Each joint of the tree with the survivors of its level, all scales together."""
        counts = sum(leaves.counts().sum(axis=0) for leaves, _ in self.parts)
        return tuple(zip(self.plan.spanned.tree.joints, np.asarray(counts).tolist(), strict=True))

    @property
    def rejected(self) -> dict[str, int]:
        """Leaves lost to each reason, all scales together."""
        lost: Counter[str] = Counter()
        for leaves, _ in self.parts:
            for one in leaves.rejected():
                lost.update(one)
        return dict(lost)

    @property
    def margins(self) -> dict[str, Array]:
        """The worst margin of each survivor (N,), by check; NaN where it decided nothing."""
        margins: dict[str, Array] = {}
        for check in self.checks:
            margin = check.judge(self.postures[:, list(check.points)]).margin
            worst = np.where(np.isfinite(margin), margin, np.nan)
            least = np.fmin.reduce(worst, axis=1) if worst.size else np.full(len(worst), np.nan)
            margins[check.name] = np.fmin(margins.get(check.name, least), least)
        return margins

    @property
    def mirrored(self) -> NDArray[np.bool_]:
        """Survivors (N,) whose mirror image, near and far exchanged throughout, survives too."""
        return mirrored(
            self.postures[..., 2], self.plan.spanned.tree.parents, self.hypothesis, level=LEVEL_DEPTH
        )

    def exact(self, *, fitted: Collection[str]) -> bool:
        """Tell whether there is evidence that the image is exact: loops closed that need not have.

        In a survivor, or in a branch that something else pruned after the last of its loops had closed.

        Parameters
        ----------
        fitted : collection of str
            The constraints that the scale was chosen by.
        """
        level = self.plan.evidence_level(fitted=fitted)
        if level is None:
            return False
        if any(len(leaves.code) for leaves, _ in self.parts):
            return True
        others = (
            "closure",
            "midpoint",
            "coplanar",
            "collinear",
            "perpendicular",
            "no_solution",
            "coincident",
        )
        return any(
            group.level >= level and group.check not in others and len(group.code) > 0
            for leaves, _ in self.parts
            for group in leaves.pruned
        )


def grow(
    plan: ObjectPlan, image: Array, aspect: float, scales: Array, tolerance: ObjectTolerance, judged: str
) -> GrownObject:
    """Grow the trees of one frame.

    Parameters
    ----------
    plan : ObjectPlan
        The tree over the points that are seen.
    image : array (P, 2)
        Of all points of the object.
    aspect : float
        Width of a pixel over its height.
    scales : array (H,)
        Pixels a working unit.
    tolerance : ObjectTolerance
        In working units.
    judged : str
        What to call it.

    Raises
    ------
    InputError
        Where more postures survive than a result may hold.
    """
    spanned = plan.spanned
    place = spanned.place_image(image[list(plan.columns)][None])
    exact = judged == "exact"
    # Exact images have the same checks at all scales, which are grown together; what noise does depends on the scale.
    step = max(1, AT_ONCE // plan.hypotheses) if exact else 1
    checks: list[Check] = plan.checks(tolerance) if exact else []
    parts: list[tuple[Leaves, int]] = []
    count = 0
    for first in range(0, len(scales), step):
        camera = ScaledOrthographicCamera(scale=scales[first : first + step], aspect=aspect)
        n = len(np.asarray(camera.scale))
        seen = np.broadcast_to(place, (n, *place.shape[1:]))
        root = np.zeros((n, 3))
        root[:, :2] = camera.unproject(seen[:, 0])
        if not exact:
            spread = ImageSpread.of(spanned, camera.unproject(seen)[0], tolerance.point)
            checks = plan.checks(tolerance, spread)
        leaves = spanned.tree.grow(camera, root, seen, checks, tolerance=tolerance.tangent)
        count += len(leaves.code)
        if count > MAX_POSTURES:
            raise InputError(
                f"linkage {plan.linkage.name}: more than {MAX_POSTURES:,} postures at {len(scales)} scales; say which "
                "end is nearer of some segments (--nearer), or recover a part of the object"
            )
        parts.append((leaves, first))
    return GrownObject(plan=plan, parts=tuple(parts), checks=checks, tolerance=tolerance, judged=judged)
