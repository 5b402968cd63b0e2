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
    q : array (N, nq)
    rows : int array
        Which configurations are asked about.
    margins : array (P,)
        Metres, of each pair of the geometry: what coal calls the security margin.
    names : tuple of str (P,)
    nearest : bool
        List the nearest pair of every configuration asked about too. With meshes that takes long: each distance of
        two meshes is a millisecond, and all of them are asked.
    """
    data, geometry_data = model.createData(), geometry.createData()
    for request, margin in zip(geometry_data.collisionRequests, margins.tolist(), strict=True):
        request.security_margin = margin
    pairs = range(len(names))
    found: list[tuple[int, int, float, bool]] = []
    for row in rows.tolist():
        pin.updateGeometryPlacements(model, data, geometry, geometry_data, q[row])
        hits = [pair for pair in pairs if pin.computeCollision(geometry, geometry_data, pair)]
        depth = {pair: _distance(geometry, geometry_data, pair) for pair in hits}
        if nearest and not hits:
            depth = {pair: _distance(geometry, geometry_data, pair) for pair in pairs}
            least = min(depth, key=lambda pair: depth[pair], default=None)
            depth = {} if least is None else {least: depth[least]}
        found += [(row, pair, distance, pair in hits) for pair, distance in depth.items()]
    columns = list(zip(*found, strict=True)) if found else [(), (), (), ()]
    return Contacts(
        posture=np.array(columns[0], dtype=np.intp),
        pair=np.array(columns[1], dtype=np.intp),
        distance=np.array(columns[2], dtype=np.float64),
        violated=np.array(columns[3], dtype=np.bool_),
        names=names,
    )


def _distance(geometry: pin.GeometryModel, geometry_data: pin.GeometryData, pair: int) -> float:
    return float(pin.computeDistance(geometry, geometry_data, pair).min_distance)
