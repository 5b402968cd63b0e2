"""Which pairs of bodies are checked for collision: those that an SRDF leaves, or those that can come together."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from posekit.robots.geometry import link_of
from posekit.robots.srdf import Srdf

Pair = tuple[int, int]


def set_pairs(model: pin.Model, geometry: pin.GeometryModel, srdf: Srdf | None) -> None:
    """Give a geometry model its pairs.

    With an SRDF: all pairs of bodies on different joints but those it takes out. Without: all but those of
    neighbours, and those that touch in the neutral posture.
    """
    geometry.addAllCollisionPairs()
    pairs = [(pair.first, pair.second) for pair in geometry.collisionPairs]
    if srdf is not None:
        links = [link_of(model, body) for body in geometry.geometryObjects]
        kept = [(a, b) for a, b in pairs if srdf.checks(links[a], links[b])]
    else:
        near = _neighbours(model, geometry)
        joints = [body.parentJoint for body in geometry.geometryObjects]
        touching = _touching(model, geometry)
        kept = [
            pair
            for pair, touches in zip(pairs, touching, strict=True)
            if not touches and frozenset((joints[pair[0]], joints[pair[1]])) not in near
        ]
    geometry.removeAllCollisionPairs()
    for a, b in kept:
        geometry.addCollisionPair(pin.CollisionPair(a, b))


def neutral_inside_limits(model: pin.Model) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the neutral configuration, each hinge and slide moved to the nearest of its limits where it is outside."""
    q = pin.neutral(model)
    for joint in range(1, model.njoints):
        if model.nqs[joint] == 1:
            k = model.idx_qs[joint]
            q[k] = np.clip(q[k], model.lowerPositionLimit[k], model.upperPositionLimit[k])
    return np.asarray(q)


def _neighbours(model: pin.Model, geometry: pin.GeometryModel) -> set[frozenset[int]]:
    """Return pairs of joints with bodies, one above the other, with no body between them.

    A hip of three hinges has two links without a body between pelvis and thigh, which are neighbours all the
    same.
    """
    carrying = {body.parentJoint for body in geometry.geometryObjects}
    near = set()
    for joint in carrying:
        above = joint
        while above:
            above = model.parents[above]
            if above in carrying:
                near.add(frozenset((joint, above)))
                break
    return near


def _touching(model: pin.Model, geometry: pin.GeometryModel) -> list[bool]:
    """Ask coal which of the pairs touch in the neutral posture; the data are made after the pairs."""
    data, geometry_data = model.createData(), geometry.createData()
    pin.computeCollisions(model, data, geometry, geometry_data, neutral_inside_limits(model), False)
    return [result.isCollision() for result in geometry_data.collisionResults]
