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
from posekit.robots.bodies import build_bodies
from posekit.robots.joint_map import JointMap
from posekit.skeleton import SIDES

if TYPE_CHECKING:
    from posekit.robots.robot import Robot

#: Metres: a shorter part gets no capsule.
SHORTEST: Final = 1e-3

#: Start and end of a capsule's axis, and its radius, in shares of its segment's length.
Shape = tuple[float, float, float]

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

    Parameters
    ----------
    robot : Robot
        Its own primitive shapes stay. A humanoid without any body gets a capsule for every part.
    figure : Robot
        The stick figure, whose capsules are laid along the limbs of a humanoid.
    """
    model, plain, meshed = robot.model, copy.deepcopy(robot.tree), set[int]()
    for link in plain.findall("link"):
        for body in link.findall("collision"):
            if body.find("geometry/mesh") is not None:
                link.remove(body)
                frame = model.getFrameId(link.get("name", ""), pin.FrameType.BODY)
                meshed.add(int(model.frames[frame].parentJoint))
    geometry = build_bodies(model, plain, (), robot.source, "collision")
    only = meshed if meshed or len(geometry.geometryObjects) else None
    try:
        joint_map = robot.joint_map
    except InputError:  # no humanoid: nothing is known of its shape
        return geometry
    shapes = part_shapes(figure.model, figure.geometry, figure.joint_map)
    for body in limb_capsules(model, joint_map, shapes, only):
        geometry.addGeometryObject(body)
    return geometry


def limb_capsules(
    model: pin.Model, joint_map: JointMap, shapes: Mapping[str, Shape], only: set[int] | None
) -> list[pin.GeometryObject]:
    """Lay the stick figure's capsules along the segments between mapped joints.

    A segment with joints inside it, as a spine, is cut there; each body carries its own part.

    Parameters
    ----------
    model : pinocchio.Model
    joint_map : JointMap
    shapes : dict
        Capsule of each part in shares of its length; see `part_shapes`.
    only : set of int, optional
        Joints whose bodies get capsules; all by default.

    Returns
    -------
    list of pinocchio.GeometryObject
        Named after their part, with a number if there are several.
    """
    data = model.createData()
    q = pin.neutral(model)
    pin.forwardKinematics(model, data, q)
    place = dict(zip(joint_map.points, _neutral_points(data, joint_map), strict=True))
    bodies = []
    for part, ends in PARTS.items():
        if not place.keys() >= {*ends} or part not in shapes:
            continue
        a, along = place[ends[0]], place[ends[1]] - place[ends[0]]
        length = float(np.linalg.norm(along))
        carriers = _path(model, *(joint_map.points[name][0].joint for name in ends))
        first, last, radius = shapes[part]
        edges = [0.0]
        for one, other in pairwise(carriers):
            between = max(one, other)  # the joint between two bodies is the one further from the root
            edges.append(float((data.oMi[between].translation - a) @ along) / max(length, SHORTEST) ** 2)
        cuts = np.clip([*edges, 1.0], first, last)
        parts = [
            (joint, low, high)
            for joint, low, high in zip(carriers, cuts[:-1], cuts[1:], strict=True)
            if (high - low) * length > SHORTEST
        ]
        for number, (joint, low, high) in enumerate(parts):
            if only is None or joint in only:
                name = part if len(parts) == 1 else f"{part}_{number + 1}"
                begin, end = (data.oMi[joint].actInv(a + share * along) for share in (low, high))
                bodies.append(capsule(model, name, joint, begin, end, radius * length))
    return bodies


def part_shapes(model: pin.Model, geometry: pin.GeometryModel, joint_map: JointMap) -> dict[str, Shape]:
    """Return the capsules of the stick figure in shares of the lengths of their parts."""
    data, geometry_data = model.createData(), geometry.createData()
    pin.updateGeometryPlacements(model, data, geometry, geometry_data, pin.neutral(model))
    place = dict(zip(joint_map.points, _neutral_points(data, joint_map), strict=True))
    found = {}
    for body, M in zip(geometry.geometryObjects, geometry_data.oMg, strict=True):
        part = str(model.frames[body.parentFrame].name)
        if part in PARTS:
            start, end = (place[name] for name in PARTS[part])
            length = float(np.linalg.norm(end - start))
            centre = float((M.translation - start) @ (end - start)) / length**2
            half = body.geometry.halfLength / length
            found[part] = centre - half, centre + half, body.geometry.radius / length
    return found


def capsule(model: pin.Model, name: str, joint: int, a: Array, b: Array, radius: float) -> pin.GeometryObject:
    """Return a capsule between two places in a joint's frame, on the link of the joint."""
    length = float(np.linalg.norm(b - a))
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), (b - a) / length)
    links = [k for k, frame in enumerate(model.frames) if frame.parentJoint == joint]
    link = next((k for k in links if model.frames[k].type == pin.FrameType.BODY), links[0])
    placement = pin.SE3(turn.toRotationMatrix(), (a + b) / 2)
    return pin.GeometryObject(name, joint, link, placement, coal.Capsule(radius, length))


def _neutral_points(data: pin.Data, joint_map: JointMap) -> list[Array]:
    return [
        np.sum([site.share * data.oMi[site.joint].act(np.array(site.offset)) for site in sites], axis=0)
        for sites in joint_map.points.values()
    ]


def _path(model: pin.Model, one: int, other: int) -> list[int]:
    """List the joints whose bodies lead from one to another."""
    up, down = [one], [other]
    for chain in (up, down):
        while chain[-1]:
            chain.append(int(model.parents[chain[-1]]))
    common = next(joint for joint in up if joint in down)
    return [*up[: up.index(common)], common, *reversed(down[: down.index(common)])]
