"""Collision capsules along the segments of a humanoid, in place of meshes."""

from __future__ import annotations

import copy
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import coal
import numpy as np
import pinocchio as pin

from posekit.geometry import Array
from posekit.robots.bodies import build_bodies, first_link, link_of
from posekit.skeleton import PARTS

if TYPE_CHECKING:
    from posekit.robots.robot import Robot

#: Length below which a piece of a segment gets no capsule, metres.
SHORTEST: Final = 1e-3


def capsule_bodies(robot: Robot, figure: Robot) -> pin.GeometryModel:
    """Build the collision bodies of a robot with capsules in place of meshes.

    Each capsule lies along a segment between two points of the joint map. A segment that spans several joints, such as
    the spine, is cut at these joints, and each moving body carries one piece. The capsule of a piece has the name of
    its segment, with a number if the segment has several pieces.

    Parameters
    ----------
    robot : Robot
        The robot's boxes, spheres, cylinders and capsules are kept. A humanoid without collision bodies gets a capsule
        on every body part. A robot that is not a humanoid gets no capsule, because its shape is not known.
    figure : Robot
        The stick figure, which determines the proportions of the capsules.
    """
    model, plain, meshed = robot.model, copy.deepcopy(robot.tree), set[int]()
    for link in plain.findall("link"):
        for body in link.findall("collision"):
            if body.find("geometry/mesh") is not None:
                link.remove(body)
                frame = model.getFrameId(link.get("name", ""), pin.FrameType.BODY)
                meshed.add(model.frames[frame].parentJoint)
    geometry = build_bodies(model, plain, (), robot.source, "collision")
    data, place = _neutral(robot)
    only = meshed if meshed or geometry.ngeoms else range(model.njoints)
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
        # Two neighbouring bodies meet at the joint that is further from the root.
        places = [data.oMi[max(pair)].translation for pair in pairwise(carriers)]
        edges = [float((place - start) @ (end - start)) / length**2 for place in places]
        cuts = pairwise(np.clip([0.0, *edges, 1.0], first, last))
        least = SHORTEST / length
        pieces = [(joint, cut) for joint, cut in zip(carriers, cuts, strict=True) if np.ptp(cut) > least]
        for number, (joint, cut) in enumerate(pieces, 1):
            if joint in only:
                name = part if len(pieces) == 1 else f"{part}_{number}"
                a, b = (data.oMi[joint].actInv(start + share * (end - start)) for share in cut)
                turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), b - a)
                place_in_joint = pin.SE3(turn.toRotationMatrix(), (a + b) / 2)
                shape = coal.Capsule(radius * length, float(np.linalg.norm(b - a)))
                body = pin.GeometryObject(name, joint, first_link(model, joint), place_in_joint, shape)
                geometry.addGeometryObject(body)
    return geometry


def _proportions(figure: Robot) -> dict[str, tuple[float, float, float]]:
    """Return the start, the end and the radius of the figure's capsules, as fractions of their segment's length."""
    found, (data, place) = {}, _neutral(figure)
    for body in figure.geometry.geometryObjects:
        part = link_of(figure.model, body)
        if part in PARTS:
            start, end = (place[name] for name in PARTS[part])
            length = float(np.linalg.norm(end - start))
            middle = (data.oMi[body.parentJoint] * body.placement).translation - start
            centre, half = float(middle @ (end - start)) / length**2, body.geometry.halfLength / length
            found[part] = centre - half, centre + half, body.geometry.radius / length
    return found


def _neutral(robot: Robot) -> tuple[pin.Data, dict[str, Array]]:
    """Return Pinocchio's data and the joint-map points (3,), metres, at Pinocchio's neutral configuration."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, pin.neutral(robot.model))
    return data, {name: data.oMi[site.joint].act(site.offset) for name, site in robot.joint_map.items()}
