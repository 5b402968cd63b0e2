"""Collision capsules for humanoids without meshes, along their limbs."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import coal
import numpy as np
import pinocchio as pin

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.robots.bodies import build_bodies, link_of
from posekit.skeleton import SIDES

if TYPE_CHECKING:
    from posekit.robots.robot import Robot

#: Metres: a shorter part gets no capsule.
SHORTEST: Final = 1e-3

BODY: Final = pin.FrameType.BODY

#: Parts of a humanoid, named as the stick figure's links, and the joints at their ends.
PARTS: Final[Mapping[str, tuple[str, str]]] = {
    "torso": ("neck", "pelvis"),
    "hips": ("right_hip", "left_hip"),
    **{
        f"{side}_{part}": (f"{side}_{start}", f"{side}_{end}")
        for side in SIDES
        for part, start, end in (
            ("upper_arm", "shoulder", "elbow"),
            ("forearm", "elbow", "wrist"),
            ("thigh", "hip", "knee"),
            ("shank", "knee", "ankle"),
        )
    },
}


def capsule_bodies(robot: Robot, figure: Robot) -> pin.GeometryModel:
    """Build the collision bodies of a robot with capsules in place of meshes.

    Capsules are laid along the segments between mapped joints. A segment with joints inside it, as a spine, is cut
    there; each body carries its own part, named after the segment, with a number if there are several.

    Parameters
    ----------
    robot : Robot
        Its own primitive shapes stay. A humanoid without any body gets a capsule for every part.
    figure : Robot
        The stick figure, whose capsules are laid along the limbs in the same proportions.
    """
    model, plain, meshed = robot.model, copy.deepcopy(robot.tree), set[int]()
    for link in plain.findall("link"):
        for body in link.findall("collision"):
            if body.find("geometry/mesh") is not None:
                link.remove(body)
                frame = model.getFrameId(link.get("name", ""), BODY)
                meshed.add(int(model.frames[frame].parentJoint))
    geometry = build_bodies(model, plain, (), robot.source, "collision")
    try:
        place = _neutral_points(robot)
    except InputError:  # no humanoid: nothing is known of its shape
        return geometry
    only = meshed if meshed or geometry.ngeoms else range(model.njoints)
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    shapes = _proportions(figure)
    for part, joints in PARTS.items():
        if not place.keys() >= {*joints}:
            continue
        first, last, radius = shapes[part]
        start, end = (place[name] for name in joints)
        length = max(float(np.linalg.norm(end - start)), SHORTEST)
        up, down = (list(model.supports[robot.joint_map[name].joint]) for name in joints)
        common = len(set(up) & set(down))
        carriers = [*reversed(up[common:]), *down[common - 1 :]]
        # The joint between two bodies is the one further from the root.
        places = [data.oMi[max(pair)].translation for pair in pairwise(carriers)]
        edges = [float((place - start) @ (end - start)) / length**2 for place in places]
        cuts = pairwise(np.clip([0.0, *edges, 1.0], first, last))
        pieces = [
            (joint, cut) for joint, cut in zip(carriers, cuts, strict=True) if np.ptp(cut) * length > SHORTEST
        ]
        for number, (joint, cut) in enumerate(pieces, 1):
            if joint in only:
                name = part if len(pieces) == 1 else f"{part}_{number}"
                a, b = (data.oMi[joint].actInv(start + share * (end - start)) for share in cut)
                geometry.addGeometryObject(_capsule(model, name, joint, a, b, radius * length))
    return geometry


def _proportions(figure: Robot) -> dict[str, tuple[float, float, float]]:
    """Return the figure's capsules: start and end of the axis, and radius, in shares of their part's length."""
    model, geometry, place, found = figure.model, figure.geometry, _neutral_points(figure), {}
    data, geometry_data = model.createData(), pin.GeometryData(geometry)
    pin.updateGeometryPlacements(model, data, geometry, geometry_data, pin.neutral(model))
    for body, M in zip(geometry.geometryObjects, geometry_data.oMg, strict=True):
        part = link_of(model, body)
        if part in PARTS:
            start, end = (place[name] for name in PARTS[part])
            length = float(np.linalg.norm(end - start))
            centre = float((M.translation - start) @ (end - start)) / length**2
            half = body.geometry.halfLength / length
            found[part] = centre - half, centre + half, body.geometry.radius / length
    return found


def _neutral_points(robot: Robot) -> dict[str, Array]:
    """Return the mapped points at Pinocchio's neutral configuration, metres."""
    points = robot.kinematics.positions(pin.neutral(robot.model)[None])[0]
    return dict(zip(robot.joint_map, points, strict=True))


def _capsule(
    model: pin.Model, name: str, joint: int, a: Array, b: Array, radius: float
) -> pin.GeometryObject:
    """Return a capsule between two places in a joint's frame, on the link of the joint."""
    length = float(np.linalg.norm(b - a))
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), (b - a) / length)
    carried = (k for k, one in enumerate(model.frames) if one.parentJoint == joint and one.type == BODY)
    placement = pin.SE3(turn.toRotationMatrix(), (a + b) / 2)
    return pin.GeometryObject(name, joint, next(carried), placement, coal.Capsule(radius, length))
