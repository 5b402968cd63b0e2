"""The figure's collision capsules, whose axes lie on lines between its points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from posekit.errors import FigureError, refusal, shown
from posekit.geometry import Array, cross, unit
from posekit.skeleton import HEAD, JOINT, PARTS

if TYPE_CHECKING:
    import pinocchio as pin

#: By link with a capsule: the points whose mean is the start of the capsule's axis, and the points whose mean is its
#: end.
CAPSULE_AXES: Final[dict[str, tuple[tuple[int, ...], tuple[int, ...]]]] = {
    **{part: ((JOINT[start],), (JOINT[end],)) for part, (start, end) in PARTS.items()},
    "head": ((JOINT["neck"],), HEAD),
}

#: Largest accepted distance of a capsule's ends from the line between its points.
OFF_AXIS_METRES: Final = 1e-9


@dataclass(frozen=True, kw_only=True)
class Capsule:
    """One rigid capsule of the figure.

    Parameters
    ----------
    link : str
        The URDF link.
    start, end : tuple of int
        Indices of points. The axis goes from the mean of the `start` points to the mean of the `end` points.
    center : float
        Distance along the axis from the mean of the `start` points to the capsule's middle, metres.
    half_length : float
        Half the length of the capsule's axis, metres.
    radius : float
        Metres.
    """

    link: str
    start: tuple[int, ...]
    end: tuple[int, ...]
    center: float
    half_length: float
    radius: float

    @property
    def points(self) -> tuple[int, ...]:
        """Indices of the points that determine the capsule's position."""
        return self.start + self.end

    def place(self, points: Array) -> tuple[Array, Array]:
        """Compute the capsule's middle and axis in postures.

        Parameters
        ----------
        points : array (N, 19, 3)
            Postures, metres; unknown points are NaN.

        Returns
        -------
        middle, axis : array (N, 3)
            The capsule's middle (m) and the unit direction of its axis; NaN if one of its points is unknown.
        """
        start = points[:, list(self.start)].mean(axis=1)
        axis = unit(points[:, list(self.end)].mean(axis=1) - start)
        return start + self.center * axis, axis


def read_capsules(
    model: pin.Model, geometry: pin.GeometryModel, neutral: Array, source: str
) -> tuple[tuple[Capsule, ...], tuple[tuple[int, int], ...]]:
    """Read the capsules, and the pairs to check for collision, from Pinocchio's geometry model.

    Parameters
    ----------
    neutral : array (19, 3)
        The figure's points at the neutral configuration, metres.
    source : str
        The URDF's name, for errors.

    Returns
    -------
    capsules, pairs
        The capsules, and the pairs to check for collision as indices of `capsules`.

    Raises
    ------
    FigureError
        If a link has no capsule, a size is not positive, or an axis is not on the line between the link's points.
    """
    import coal
    import pinocchio as pin

    data, geometry_data = model.createData(), geometry.createData()
    pin.updateGeometryPlacements(model, data, geometry, geometry_data, pin.neutral(model))
    capsules = []
    links = [model.frames[body.parentFrame].name for body in geometry.geometryObjects]
    if sorted(links) != sorted(CAPSULE_AXES):
        expected = f"one body on each of {', '.join(CAPSULE_AXES)}"
        raise refusal(
            source, "collision bodies", f"bodies on {', '.join(links)}", expected, error=FigureError
        )
    for link, body, placement in zip(links, geometry.geometryObjects, geometry_data.oMg, strict=True):
        shape, field = body.geometry, f"link {shown(link)}, collision"
        if not isinstance(shape, coal.Capsule):
            remedy = "write a cylinder and name it in collision_checking"
            raise refusal(source, field, type(shape).__name__, "a capsule", remedy, error=FigureError)
        if not (np.isfinite(shape.radius) and shape.radius > 0 and shape.halfLength > 0):
            got = f"radius {shape.radius:g} and half length {shape.halfLength:g} m"
            raise refusal(source, field, got, "positive numbers", error=FigureError)
        start, end = (neutral[list(points)].mean(axis=0) for points in CAPSULE_AXES[link])
        axis = (end - start) / np.linalg.norm(end - start)
        middle = placement.translation - start
        center = float(middle @ axis)
        beside = np.linalg.norm(middle - center * axis)
        tilt = np.linalg.norm(cross(placement.rotation[:, 2], axis)) * shape.halfLength
        if max(beside, tilt) > OFF_AXIS_METRES:
            got = f"a capsule {max(beside, tilt):.3g} m beside the line between its joints"
            raise refusal(source, field, got, "a capsule on the line between its joints", error=FigureError)
        size = {"half_length": float(shape.halfLength), "radius": float(shape.radius)}
        first, last = CAPSULE_AXES[link]
        capsules.append(Capsule(link=link, start=first, end=last, center=center, **size))
    return tuple(capsules), tuple((pair.first, pair.second) for pair in geometry.collisionPairs)


def grown(capsules: Sequence[Capsule], old: Array, new: Array) -> tuple[Capsule, ...]:
    """Scale capsules from a figure with the neutral points `old` (19, 3) to a figure with the neutral points `new`.

    The position, length and radius of a capsule scale with the length of its link. The exception is the torso's radius,
    which scales with the width of the shoulders.
    """
    shoulders = float(np.linalg.norm(new[1] - new[2]) / np.linalg.norm(old[1] - old[2]))
    found = []
    for one in capsules:
        before, after = (
            np.linalg.norm(points[list(one.end)].mean(axis=0) - points[list(one.start)].mean(axis=0))
            for points in (old, new)
        )
        ratio = float(after / before)
        found.append(
            replace(
                one,
                center=one.center * ratio,
                half_length=one.half_length * ratio,
                radius=one.radius * (shoulders if one.link == "torso" else ratio),
            )
        )
    return tuple(found)
