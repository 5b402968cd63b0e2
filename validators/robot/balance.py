"""Static balance: the centre of mass over the support of the feet (McGhee & Frank 1968, Math. Biosci. 3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.geometry import Array, cross
from posekit.validators.robot.feet import Corner
from posekit.validators.suite import Judgement

ON_GROUND = 0.03
"""Metres above the lowest corner within which a corner of a foot stands on the ground."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Balance:
    """The masses and the soles of a model.

    Parameters
    ----------
    model : pinocchio.Model
        The kinematic model of Pinocchio.
    corners : sequence of Corner
        Of the soles; empty where there are none.
    up : array (3,)
        The unit vector against gravity, in the frame of the postures.
    """

    model: pin.Model
    corners: tuple[Corner, ...]
    up: Array

    def judge(self, q: Array, undecided: NDArray[np.bool_] | None = None) -> Judgement:
        """Judge configurations (N, nq): metres from the centre of mass to the edge of the support, positive inside.

        Undecided where the model has no masses or no feet, and in `undecided` (N,).
        """
        value = np.full(len(q), np.nan)
        mass = sum(float(inertia.mass) for inertia in self.model.inertias)
        if mass > 0 and self.corners:
            data = self.model.createData()
            ground = _plane(self.up)
            rows = range(len(q)) if undecided is None else np.flatnonzero(~undecided).tolist()
            for row in rows:
                centre = pin.centerOfMass(self.model, data, q[row], False)
                soles = np.array([data.oMi[corner.joint].act(corner.place) for corner in self.corners])
                height = soles @ self.up
                standing = soles[height <= height.min() + ON_GROUND]
                value[row] = inside_hull(standing @ ground, np.asarray(centre) @ ground)
        return Judgement(
            check="balance",
            where=("centre of mass",),
            unit=("m",),
            value=value[:, None],
            lower=np.zeros((len(q), 1)),
            upper=np.full((len(q), 1), np.inf),
            margin=value[:, None].copy(),
            violated=(value < 0)[:, None],
        )


def inside_hull(points: Array, place: Array) -> float:
    """Return how far a place (2,) is inside the edge of the hull of points (M, 2): negative outside."""
    hull = convex_hull(points)
    ends = np.roll(hull, -1, axis=0)
    along = ends - hull
    squared = np.maximum(np.einsum("ni,ni->n", along, along), 1e-300)
    t = np.clip(np.einsum("ni,ni->n", place - hull, along) / squared, 0.0, 1.0)
    distance = float(np.linalg.norm(hull + t[:, None] * along - place, axis=1).min())
    left = along[:, 0] * (place - hull)[:, 1] - along[:, 1] * (place - hull)[:, 0]
    return distance if len(hull) > 2 and bool((left >= 0).all()) else -distance


def convex_hull(points: Array) -> Array:
    """Return the corners (H, 2) of the hull of points (M, 2), counterclockwise (Andrew 1979)."""
    order = np.unique(points, axis=0)
    if len(order) < 3:
        return order
    half: list[list[Array]] = []
    for direction in (order, order[::-1]):
        chain: list[Array] = []
        for point in direction:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0:
                chain.pop()
            chain.append(point)
        half.append(chain[:-1])
    return np.array(half[0] + half[1])


def _turn(a: Array, b: Array, c: Array) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _plane(up: Array) -> Array:
    """Return two axes (3, 2) across a unit vector, a right-handed pair."""
    least = np.eye(3)[int(np.argmin(np.abs(up)))]
    x = cross(least, up)
    x /= np.linalg.norm(x)
    return np.stack([x, cross(up, x)], axis=1)
