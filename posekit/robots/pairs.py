"""The pairs of bodies that are checked for collision."""

from __future__ import annotations

import re
from collections.abc import Collection

import numpy as np
import pinocchio as pin

from posekit.geometry import Array
from posekit.robots.bodies import link_of
from posekit.robots.capsules import PARTS
from posekit.robots.urdf import SrdfPairs

#: Pairs of parts that are checked.
Parts = Collection[frozenset[str]]


def set_pairs(model: pin.Model, geometry: pin.GeometryModel, srdf: SrdfPairs | None, parts: Parts) -> None:
    """Set the pairs of bodies to check.

    With an SRDF, all pairs of bodies on different joints that it leaves. Without, all pairs but those of neighbours,
    and those that touch in the neutral configuration. Of capsules that stand for a humanoid's parts, only the pairs in
    `parts` are checked.
    """
    geometry.addAllCollisionPairs()
    pairs = [(pair.first, pair.second) for pair in geometry.collisionPairs]
    if srdf is not None:
        links = [link_of(model, body) for body in geometry.geometryObjects]
        kept = [(a, b) for a, b in pairs if srdf.checked(links[a], links[b])]
    else:
        near, joints = _neighbours(model, geometry), [body.parentJoint for body in geometry.geometryObjects]
        names = [re.sub(r"_\d+$", "", body.name) for body in geometry.geometryObjects]
        data, geometry_data = model.createData(), geometry.createData()
        pin.computeCollisions(model, data, geometry, geometry_data, neutral_inside(model), False)
        kept = []
        for (a, b), result in zip(pairs, geometry_data.collisionResults, strict=True):
            ends = frozenset((names[a], names[b]))
            wanted = ends in parts if parts and ends <= PARTS.keys() else {joints[a], joints[b]} not in near
            if wanted and not result.isCollision():
                kept.append((a, b))
    geometry.removeAllCollisionPairs()
    for a, b in kept:
        geometry.addCollisionPair(pin.CollisionPair(a, b))


def neutral_inside(model: pin.Model) -> Array:
    """Return the neutral configuration (nq,), each joint of one entry moved to its nearest limit if outside."""
    q = np.array(pin.neutral(model))
    for joint in range(1, model.njoints):
        if model.nqs[joint] == 1:
            k = model.idx_qs[joint]
            q[k] = np.clip(q[k], model.lowerPositionLimit[k], model.upperPositionLimit[k])
    return q


def _neighbours(model: pin.Model, geometry: pin.GeometryModel) -> set[frozenset[int]]:
    """Return the pairs of joints that both have bodies and of which one carries the other directly.

    A hip of three hinges has two links without a body: pelvis and thigh are neighbours.
    """
    carrying = {body.parentJoint for body in geometry.geometryObjects}
    near = set()
    for joint in carrying:
        above = int(model.parents[joint])
        while above and above not in carrying:
            above = int(model.parents[above])
        near.add(frozenset((joint, above)))
    return near
