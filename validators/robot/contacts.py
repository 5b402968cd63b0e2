"""Which bodies touch: asked one configuration at a time, of those that collide, and only when it is wanted."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import repeat
from typing import Final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.validators.robot.near_pairs import NearPairs
from posekit.validators.robot.subject import Subject

INSIDE_METRES: Final = 1e-6
"""Metres of penetration of two meshes from which their surfaces cross beyond doubt, so that their distance is nil."""


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
    subject: Subject,
    geometry: pin.GeometryModel,
    q: Array,
    rows: NDArray[np.intp],
    *,
    margins: Array,
    nearest: bool = False,
    meshes: NDArray[np.bool_] | None = None,
    near: NearPairs | None = None,
) -> Contacts:
    """List the pairs that are nearer than their margin in some of the configurations.

    Parameters
    ----------
    subject : Subject
        The model, and what its pairs are called.
    geometry : pinocchio.GeometryModel
        Its bodies.
    q : array (N, nq)
        Configurations in Pinocchio's order.
    rows : int array
        Which configurations are asked about.
    margins : array (P,)
        Metres, of each pair of the geometry: what coal calls the security margin.
    nearest : bool
        List the nearest pair of every configuration asked about too, the first of those that are equally near. With
        meshes that takes long: each distance of two meshes is a millisecond, and all of them are asked.
    meshes : bool array (P,), optional
        Which pairs are of two meshes: coal's distance of two whose triangles cross is 0, which needs no search where
        its own bound says that they do. Primitives have a depth, which is asked for.
    near : NearPairs, optional
        What tells pairs that need not be asked. It pays where asking is dear: with meshes.
    """
    model, names, data = subject.model, subject.pair_names, subject.data
    geometry_data = geometry.createData()  # a fresh one: coal starts its search where the one before ended
    for request, margin in zip(geometry_data.collisionRequests, margins.tolist(), strict=True):
        request.security_margin = margin
    collide, measure = pin.computeCollision, pin.computeDistance
    pairs: Sequence[int] = range(len(names))
    posture: list[int] = []
    named: list[int] = []
    distance: list[float] = []
    violated: list[bool] = []
    crossing = (
        {}
        if meshes is None
        else {k: -INSIDE_METRES - float(margins[k]) for k in np.flatnonzero(meshes).tolist()}
    )
    results = geometry_data.collisionResults
    chosen = q[rows]
    candidates: Iterable[Sequence[int]] = (
        repeat(pairs) if near is None else (np.flatnonzero(some).tolist() for some in near.of(chosen))
    )
    for row, one, possible in zip(rows.tolist(), chosen, candidates, strict=False):
        pin.updateGeometryPlacements(model, data, geometry, geometry_data, one)
        asked = hits = [pair for pair in possible if collide(geometry, geometry_data, pair)]
        if nearest and not hits and names:
            asked = [pin.computeDistances(geometry, geometry_data)]  # the index of the least
        for pair in asked:
            posture.append(row)
            named.append(pair)
            if hits and pair in crossing and results[pair].distance_lower_bound < crossing[pair]:
                distance.append(0.0)
            else:
                distance.append(measure(geometry, geometry_data, pair).min_distance)
            violated.append(bool(hits))
    return Contacts(
        posture=np.array(posture, dtype=np.intp),
        pair=np.array(named, dtype=np.intp),
        distance=np.array(distance, dtype=np.float64),
        violated=np.array(violated, dtype=np.bool_),
        names=names,
    )
