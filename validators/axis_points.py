"""Points that no picture shows, but that rigid bodies of three points place: on the axes of a robot's joints.

A body with three points that are not on one line is placed by them, and with it the axes of the joints that it
carries. A point on such an axis belongs to the body on the other side too. So what is known of one body reaches the
next, though that may have one or two points of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, cross
from posekit.linkages.robot_linkage import Carried

MIN_SINE = 0.05
"""Of the least angle that three points make: below it their plane is too uncertain to place anything."""

SAME_PART = 0.02
"""Of the extent: two points of an axis that are nearer to each other do not show its direction."""

AXIS_PART = 0.25
"""Of the extent: how far along the axis a point is put."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AxisPoint:
    r"""A point on the axis of a joint, from three points of a body that carries it.

    :math:`p = a + \alpha (b - a) + \beta (c - a) + \gamma\,(b - a) \times (c - a)`, the same numbers in every
    configuration. Mirror images of a, b, c place it on the other side.

    Parameters
    ----------
    body : int
        The body that carries a, b and c.
    place : array (3,)
        Metres, in its frame.
    corners : tuple of 3 int
        a, b and c: points, or axis points before this one.
    numbers : tuple of 3 float
        The three coefficients; the last per metre.
    looseness : float
        How many times farther off it may be than points of the picture are.
    """

    body: int
    place: Array
    corners: tuple[int, int, int]
    numbers: tuple[float, float, float]
    looseness: float

    def among(self, column: Mapping[int, int]) -> AxisPoint:
        """Return the same with its corners renumbered."""
        a, b, c = self.corners
        return replace(self, corners=(column[a], column[b], column[c]))


def place_axis_point(points: Array, axis_point: AxisPoint) -> Array:
    """Place an axis point (N, 3) in postures given by the points before it (N, P, 3)."""
    a, b, c = (points[:, corner] for corner in axis_point.corners)
    alpha, beta, gamma = axis_point.numbers
    return np.asarray(a + alpha * (b - a) + beta * (c - a) + gamma * cross(b - a, c - a))


def find_axis_points(carried: Carried) -> tuple[AxisPoint, ...]:
    """Find the points on axes that the points of a robot place, from body to body as far as they reach.

    Parameters
    ----------
    carried : Carried
        Of the points that a picture shows.
    """
    found: list[AxisPoint] = []
    looseness = [1.0] * len(carried.names)
    model = carried.model
    extent = _extent(carried)
    added = True
    while added:
        added = False
        for joint, axis in carried.axes.items():
            for body in (joint, model.parents[joint]):
                if _shown(carried, joint, axis, extent):
                    break
                corners = _corners(carried, body)
                if corners is None:
                    continue
                along = _along(carried, joint, axis)
                at = (along[0] + AXIS_PART * extent if len(along) else 0.0) * axis
                place = at if body == joint else model.jointPlacements[joint].act(at)
                point = _axis_point(carried, body, place, corners, looseness)
                found.append(point)
                looseness.append(point.looseness)
                carried = Carried(model=model, names=carried.names, extra=(*carried.extra, (body, place)))
                added = True
    return tuple(found)


def _extent(carried: Carried) -> float:
    """Return the longest distance in a rigid body."""
    with np.errstate(invalid="ignore"):
        apart = np.linalg.norm(carried.place[:, :, None] - carried.place[:, None], axis=-1)
    return float(np.nanmax(apart, initial=0.0))


def _along(carried: Carried, joint: int, axis: Array) -> Array:
    """Return where on the axis of a joint points lie (metres, sorted)."""
    on = carried.on[joint] & carried.on[carried.model.parents[joint]]
    return np.sort(carried.place[joint, on] @ axis)


def _shown(carried: Carried, joint: int, axis: Array, extent: float) -> bool:
    """Tell whether an axis has two points that are well apart."""
    along = _along(carried, joint, axis)
    return len(along) > 1 and bool(along[-1] - along[0] > SAME_PART * extent)


def _corners(carried: Carried, body: int) -> tuple[int, int, int] | None:
    """Return the three points of a body that place it best, None where none do."""
    best, corners = MIN_SINE, None
    on: NDArray[np.intp] = np.flatnonzero(carried.on[body])
    for triple in combinations(on.tolist(), 3):
        a, b, c = carried.place[body, list(triple)]
        sides = np.linalg.norm([b - a, c - a, c - b], axis=1)
        sine = float(np.linalg.norm(cross(b - a, c - a)) / max(np.prod(np.sort(sides)[1:]), 1e-300))
        if sine > best * (1 + 1e-9):
            best, corners = sine, triple
    return corners


def _axis_point(
    carried: Carried, body: int, place: Array, corners: tuple[int, int, int], looseness: list[float]
) -> AxisPoint:
    a, b, c = carried.place[body, list(corners)]
    u, v = b - a, c - a
    normal = cross(u, v)
    alpha, beta, gamma = np.linalg.solve(np.stack([u, v, normal], axis=1), place - a)
    loose = [looseness[corner] for corner in corners]
    turned = abs(gamma) * (
        (loose[0] + loose[1]) * np.linalg.norm(v) + (loose[0] + loose[2]) * np.linalg.norm(u)
    )
    shifted = abs(1 - alpha - beta) * loose[0] + abs(alpha) * loose[1] + abs(beta) * loose[2]
    return AxisPoint(
        body=body,
        place=place,
        corners=corners,
        numbers=(float(alpha), float(beta), float(gamma)),
        looseness=float(shifted + turned),
    )
