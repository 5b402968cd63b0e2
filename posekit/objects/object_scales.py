"""The scales at which an object's frame is recovered (Taylor 2000, section 2)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from posekit.errors import InputError
from posekit.formats.own import PER_METRE, Family, ScaledOrthographicModel, Unit
from posekit.geometry import Array
from posekit.linkages import search
from posekit.linkages.linkage_family import LinkageFamily as Solutions
from posekit.objects.object_plan import ObjectPlan
from posekit.objects.triangles import Triangles
from posekit.settings.scale import Scale, way_of

BOUND_ROUNDING = 1e-9
"""Of the bound: a scale that is below it by so little is at it."""

SAME_SCALE_RATIO = 1e-9
"""Of a scale: two minima so near each other are one hypothesis."""

MOST_SEGMENTS = 15
"""Segments of loops whose flips are all tried; of more, the scale comes from the rigid triangles alone."""

CLOSED_RESIDUAL = 1e-16
"""Residual (dimensionless) of a minimum that leaves nothing: these alone are taken where there are any."""

MOST_SCALES = 128
"""The most scales of one frame that are taken, the best first."""


def family_of(
    plan: ObjectPlan,
    image: Array,
    *,
    camera: ScaledOrthographicModel,
    scale: Scale | None,
    allowed: float,
    unit: Unit | None,
) -> Family:
    """Find the scales of one frame.

    Parameters
    ----------
    plan : ObjectPlan
        The tree over the points that are seen.
    image : array (P, 2)
        Of all points of the object.
    camera : ScaledOrthographicModel
        Its scale is the default; else the least that the lengths allow is.
    scale : Scale or None
        How to find s.
    allowed : float
        By how much a segment may be too short at a scale that is given, working units.
    unit : Unit or None
        For errors.

    Returns
    -------
    Family
        In pixels a metre, or a relative unit.

    Raises
    ------
    InputError
        Where the scale is below the bound: the segment that is too short, and the scale that it needs; where the
        object has no such constraint; where all of it is seen at one pixel.
    """
    back, per = plan.thing.back, 1.0 if unit is None else PER_METRE[unit]
    solutions = Solutions(linkage=plan.linkage, image=image[list(plan.columns)], aspect=camera.aspect)
    bound, segment = solutions.minimum_scale, solutions.bounding_segment
    if bound == 0:
        raise InputError(
            f"linkage {plan.linkage.name}: all its segments are seen end on; the image fixes no scale"
        )
    how, way = way_of(camera.scale, scale)
    minima, curve_s, curve = np.empty((0, 2)), np.empty(0), np.empty(0)
    if way.how == "constraints":
        minima, curve_s, curve = _constrained(plan, solutions, way.weights)
        closed = minima[:, 1] <= CLOSED_RESIDUAL
        chosen = _distinct(minima[closed if closed.any() else slice(None), 0])[:MOST_SCALES]
        if not len(chosen):
            how, chosen = f"min: {how} fixes no scale here", np.array([bound])
    elif way.how == "min":
        chosen = np.array([bound])
    else:
        s = float(way.value or 0.0) / back
        if way.how == "stature":
            height = plan.linkage.height
            if height is None:
                raise InputError(
                    f"--scale: stature: linkage {plan.linkage.name} has no height; add height to it, or give the scale"
                )
            s = float(way.value or 0.0) / height
        length = float(plan.linkage.lengths[solutions.bounding])
        lost = length * (bound / s - 1)
        if lost > allowed + BOUND_ROUNDING * length:
            name = "a unit of length" if unit is None else f"a {unit}"
            given, least = s * back / per, bound * back / per
            raise InputError(
                f"--scale: {given:.6g} pixels {name} is below {least:.6g}, which {segment} needs: it is "
                f"{100 * lost / length:.3g} % too short for its image; give at least {least:.6g}, or --scale min"
            )
        chosen = np.array([max(s, bound) if lost <= BOUND_ROUNDING * length else s])
    return Family(
        how=how,
        bound=bound * back,
        segment=segment,
        chosen=chosen * back,
        minima_s=minima[:, 0] * back,
        minima_residual=minima[:, 1],
        curve_s=curve_s * back,
        curve_residual=curve,
    )


def _constrained(
    plan: ObjectPlan, solutions: Solutions, weights: Mapping[str, float]
) -> tuple[Array, Array, Array]:
    """Search by constraints: over all flips, or where these are too many over the rigid triangles."""
    looped = int((np.abs(solutions.incidence.loops) > 0).any(axis=0).sum())
    if set(weights) == {"closure"} and looped > MOST_SEGMENTS:
        triangles = Triangles.of(solutions)
        if len(triangles):
            return triangles.minima(solutions.minimum_scale)
    found = search(solutions, weights, nearer=plan.nearer)
    return np.stack([found.s, found.residual], axis=-1), found.curve_s, found.curve_residual


def _distinct(scales: Array) -> Array:
    """Leave out scales that differ from one before by rounding; the order stays."""
    order = np.argsort(scales, kind="stable")
    new = np.diff(scales[order], prepend=-np.inf) > SAME_SCALE_RATIO * scales[order]
    group = np.cumsum(new)
    first = np.full(group.max(initial=0) + 1, len(scales))
    np.minimum.at(first, group, order)
    return np.asarray(scales[np.sort(first[1:])])
