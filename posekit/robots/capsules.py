"""Collision capsules for robots without meshes: along the limbs of a humanoid, or from joint to joint."""

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

#: Radius over length of a capsule between two joints; the stick figure's limbs have 0.09 to 0.15.
RADIUS_SHARE: Final = 0.12
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
        Its own primitive shapes stay. If it has no bodies at all, every part gets a capsule.
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
        shapes = part_shapes(figure.model, figure.geometry, figure.joint_map)
        made = limb_capsules(model, robot.joint_map, shapes, only)
    except InputError:  # no humanoid
        made = []
    rest = only - {body.parentJoint for body in made} if only is not None else set() if made else None
    for body in (*made, *chain_capsules(model, rest)):
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


def chain_capsules(model: pin.Model, only: set[int] | None) -> list[pin.GeometryObject]:
    """Lay capsules from each joint to the middle of the joints that it carries.

    The last body of a chain reaches from its joint to twice its centre of mass. If the joints carried surround the
    joint, as hips surround a pelvis, the capsule lies between the two farthest of them.
    """
    bodies = []
    for joint in range(1, model.njoints):
        if only is not None and joint not in only:
            continue
        carried = [model.jointPlacements[child].translation for child in model.children[joint]]
        start, end = np.zeros(3), np.mean(carried, axis=0) if carried else 2 * model.inertias[joint].lever
        if len(carried) > 1:
            gaps = np.linalg.norm(np.array(carried)[:, None] - np.array(carried)[None], axis=2)
            i, j = np.unravel_index(np.argmax(gaps), gaps.shape)
            if gaps.max() > 2 * np.linalg.norm(end):
                start, end = carried[i], carried[j]
        length = float(np.linalg.norm(end - start))
        if length > SHORTEST:
            bodies.append(capsule(model, str(model.names[joint]), joint, start, end, RADIUS_SHARE * length))
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
