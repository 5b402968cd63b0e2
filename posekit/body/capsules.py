"""The figure's collision bodies, as capsules laid along lines between its points."""

from __future__ import annotations

from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin

from posekit.errors import FigureError
from posekit.geometry import Array, cross, unit
from posekit.skeleton import HEAD, JOINT

CAPSULE_AXES: dict[str, tuple[tuple[int, ...], tuple[int, ...]]] = {
    "torso": ((JOINT["neck"],), (JOINT["pelvis"],)),
    "head": ((JOINT["neck"],), HEAD),
    "hips": ((JOINT["right_hip"],), (JOINT["left_hip"],)),
    **{
        f"{side}_{part}": ((JOINT[f"{side}_{start}"],), (JOINT[f"{side}_{end}"],))
        for side in ("right", "left")
        for part, start, end in (
            ("upper_arm", "shoulder", "elbow"),
            ("forearm", "elbow", "wrist"),
            ("thigh", "hip", "knee"),
            ("shank", "knee", "ankle"),
        )
    },
}
"""For each link with a capsule: the points whose mean starts its axis, and those whose mean ends it."""

OFF_AXIS = 1e-9
"""Metres by which a capsule's ends may lie beside the line of its link."""


@dataclass(frozen=True, kw_only=True)
class Capsule:
    """One rigid capsule of the figure.

    Parameters
    ----------
    link : str
        The URDF link.
    start, end : tuple of int
        Points whose means start and end the axis.
    center : float
        Metres from the start to the capsule's middle, along the axis.
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
        """The points that place the capsule."""
        return self.start + self.end

    def place(self, points: Array) -> tuple[Array, Array]:
        """Lay the capsule along a posture's own points.

        Parameters
        ----------
        points : array (N, len(self.points), 3)
            Metres, in the order of `self.points`.

        Returns
        -------
        middle, axis : array (N, 3)
            The capsule's middle (m) and the unit direction of its axis.
        """
        n = len(self.start)
        start = points[:, 0] if n == 1 else points[:, :n].mean(axis=1)
        end = points[:, n] if len(self.end) == 1 else points[:, n:].mean(axis=1)
        axis = unit(end - start)
        return start + self.center * axis, axis


def read_capsules(
    model: pin.Model, geometry: pin.GeometryModel, neutral: Array
) -> tuple[tuple[Capsule, ...], tuple[tuple[int, int], ...]]:
    """Read the capsules and the pairs to check from Pinocchio's geometry model.

    Parameters
    ----------
    neutral : array (19, 3)
        The figure's points at the neutral configuration, metres.

    Returns
    -------
    capsules, pairs
        The capsules, and index pairs into them.

    Raises
    ------
    FigureError
        Where a body is missing, is not a capsule, has no positive size, or lies beside its link's line.
    """
    data, geometry_data = model.createData(), geometry.createData()
    pin.updateGeometryPlacements(model, data, geometry, geometry_data, pin.neutral(model))
    capsules = []
    for body, placement in zip(geometry.geometryObjects, geometry_data.oMg, strict=True):
        link = model.frames[body.parentFrame].name
        if link not in CAPSULE_AXES:
            raise FigureError(
                f"link {link!r} has a collision body; expected one on {', '.join(CAPSULE_AXES)} only"
            )
        shape = body.geometry
        if not isinstance(shape, coal.Capsule):
            raise FigureError(
                f"link {link!r}: its collision body is a {type(shape).__name__}; expected a capsule, spelled as a "
                "cylinder with collision_checking"
            )
        if not (np.isfinite(shape.radius) and shape.radius > 0 and shape.halfLength > 0):
            raise FigureError(
                f"link {link!r}: its capsule has radius {shape.radius:g} and half length {shape.halfLength:g} m; "
                "expected both positive"
            )
        start, end = (neutral[list(points)].mean(axis=0) for points in CAPSULE_AXES[link])
        axis = (end - start) / np.linalg.norm(end - start)
        middle = placement.translation - start
        center = float(middle @ axis)
        beside = np.linalg.norm(middle - center * axis)
        tilt = np.linalg.norm(cross(placement.rotation[:, 2], axis)) * shape.halfLength
        if max(beside, tilt) > OFF_AXIS:
            raise FigureError(
                f"link {link!r}: its capsule lies {max(beside, tilt):.3g} m beside the line between its joints; "
                "expected it on that line"
            )
        capsules.append(
            Capsule(
                link=link,
                start=CAPSULE_AXES[link][0],
                end=CAPSULE_AXES[link][1],
                center=center,
                half_length=float(shape.halfLength),
                radius=float(shape.radius),
            )
        )
    missing = sorted(set(CAPSULE_AXES) - {capsule.link for capsule in capsules})
    if missing or len(capsules) != len(CAPSULE_AXES):
        raise FigureError(
            f"{len(capsules)} collision bodies were loaded, expected one each on {', '.join(CAPSULE_AXES)}; "
            f"missing: {', '.join(missing) or 'none, one is there twice'}"
        )
    return tuple(capsules), tuple((pair.first, pair.second) for pair in geometry.collisionPairs)
