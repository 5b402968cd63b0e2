"""Which bodies touch: asked one configuration at a time, of those that collide, and only when it is wanted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.cameras import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Contacts:
    """Pairs of bodies and their distances, a row each, in the order of the postures.

    Parameters
    ----------
    posture, pair : int array (M,)
        Which posture, and which of `names`.
    distance : array (M,)
        Metres; negative is the depth of penetration, but 0 of meshes that penetrate.
    violated : bool array (M,)
        Whether the pair is nearer than the contact margin.
    names : tuple of str
        The pairs that were checked, by their links.
    """

    posture: NDArray[np.intp]
    pair: NDArray[np.intp]
    distance: Array
    violated: NDArray[np.bool_]
    names: tuple[str, ...]

    def __len__(self) -> int:
        """Count the rows."""
        return len(self.posture)


def find_contacts(
    model: pin.Model,
    data: pin.Data,
    geometry: pin.GeometryModel,
    q: Array,
    rows: NDArray[np.intp],
    *,
    margins: Array,
    names: tuple[str, ...],
    nearest: bool = False,
) -> Contacts:
    """List the pairs that are nearer than their margin in some of the configurations.

    Parameters
    ----------
    model, data : pinocchio.Model, pinocchio.Data
    geometry : pinocchio.GeometryModel
    q : array (N, nq)
    rows : int array
        Which configurations are asked about.
    margins : array (P,)
        Metres, of each pair of the geometry: what coal calls the security margin.
    names : tuple of str (P,)
    nearest : bool
        List the nearest pair of every configuration asked about too, the first of those that are equally near. With
        meshes that takes long: each distance of two meshes is a millisecond, and all of them are asked.
    """
    geometry_data = geometry.createData()  # a fresh one: coal starts its search where the one before ended
    for request, margin in zip(geometry_data.collisionRequests, margins.tolist(), strict=True):
        request.security_margin = margin
    collide, measure = pin.computeCollision, pin.computeDistance
    pairs = range(len(names))
    posture: list[int] = []
    named: list[int] = []
    distance: list[float] = []
    violated: list[bool] = []
    for row, one in zip(rows.tolist(), q[rows], strict=True):
        pin.updateGeometryPlacements(model, data, geometry, geometry_data, one)
        asked = hits = [pair for pair in pairs if collide(geometry, geometry_data, pair)]
        if nearest and not hits and names:
            asked = [pin.computeDistances(geometry, geometry_data)]  # the index of the least
        for pair in asked:
            posture.append(row)
            named.append(pair)
            distance.append(measure(geometry, geometry_data, pair).min_distance)
            violated.append(bool(hits))
    return Contacts(
        posture=np.array(posture, dtype=np.intp),
        pair=np.array(named, dtype=np.intp),
        distance=np.array(distance, dtype=np.float64),
        violated=np.array(violated, dtype=np.bool_),
        names=names,
    )
