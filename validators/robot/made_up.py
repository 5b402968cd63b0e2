"""Bodies for models that have none: capsules along the segments between the mapped joints, or the visual bodies.

The radii are the stick figure's (`posekit/urdf/stick_figure.urdf`: the core of each part, not its skin) in
proportion to the segment's length: a thigh that is a tenth longer is a tenth thicker. What no mapped joint marks the
end of (hands, feet, a head without a face) gets no body.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from posekit.body import load_figure
from posekit.geometry import Array
from posekit.robots.body_point import frame_index
from posekit.robots.kinematics import Kinematics
from posekit.robots.pairs import neutral_inside_limits
from posekit.skeleton import SIDES

SHORTEST_METRES: Final = 1e-3
"""Metres: a part of a segment that is shorter gets no capsule of its own."""


class Segment(NamedTuple):
    """A part of the body: its name, the mapped joints at its ends, and the stick figure's link of that part."""

    name: str
    start: str
    end: str


CAPSULE_SEGMENTS: Final = (
    Segment("torso", "neck", "pelvis"),
    Segment("hips", "right_hip", "left_hip"),
    *(
        Segment(f"{side}_{part}", f"{side}_{start}", f"{side}_{end}")
        for side in SIDES
        for part, start, end in (
            ("upper_arm", "shoulder", "elbow"),
            ("forearm", "elbow", "wrist"),
            ("thigh", "hip", "knee"),
            ("shank", "knee", "ankle"),
        )
    ),
)


class Shape(NamedTuple):
    """A capsule of the stick figure in parts of its segment's length: where its axis starts and ends, its radius."""

    start: float
    end: float
    radius: float


class Part(NamedTuple):
    """What one body carries of a segment, in parts of its length, and the joint of that body."""

    start: float
    end: float
    joint: int


def fitted_capsules(kinematics: Kinematics) -> pin.GeometryModel:
    """Make capsules along a model's segments, with the pairs that the stick figure's SRDF checks.

    A segment with joints inside it (a spine) is cut where they are: each body carries its own part. Pairs that touch
    in the neutral configuration are left out. Bodies are named after their part and belong to the link that carries
    them.

    Parameters
    ----------
    kinematics : Kinematics
        The model and its points, named after the skeleton's joints.
    """
    model, shapes = kinematics.model, _shapes()
    geometry = pin.GeometryModel()
    place = dict(zip(kinematics.names, kinematics.positions(kinematics.neutral[None])[0], strict=True))
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    parts_of: list[str] = []
    for segment in CAPSULE_SEGMENTS:
        if segment.start not in place or segment.end not in place:
            continue
        a, b, shape = place[segment.start], place[segment.end], shapes[segment.name]
        length = float(np.linalg.norm(b - a))
        parts = _parts(kinematics, data, segment, shape) if length > SHORTEST_METRES else []
        for k, part in enumerate(parts):
            name = segment.name if len(parts) == 1 else f"{segment.name}_{k + 1}"
            start, end = a + part.start * (b - a), a + part.end * (b - a)
            _add(geometry, model, data, name, part.joint, (start, end), shape.radius * length)
            parts_of.append(segment.name)
    _set_pairs(model, geometry, parts_of)
    return geometry


def _parts(kinematics: Kinematics, data: pin.Data, segment: Segment, shape: Shape) -> list[Part]:
    """Cut a segment where the joints between its ends are."""
    model = kinematics.model
    frames = frame_index(model)
    points = {point.name: point for point in kinematics.points}
    place = dict(zip(kinematics.names, kinematics.positions(kinematics.neutral[None])[0], strict=True))
    ends = [
        int(model.frames[frames[points[name].sites[0].frame]].parentJoint)
        for name in (segment.start, segment.end)
    ]
    up, down = (_ancestors(model, joint) for joint in ends)
    common = next(joint for joint in up if joint in down)
    one, other = up[: up.index(common)], down[: down.index(common)]
    bodies = [*one, common, *reversed(other)]
    cuts = [*one, *reversed(other)]  # the joint between each body and the next
    a, along = place[segment.start], place[segment.end] - place[segment.start]
    at = [float((data.oMi[joint].translation - a) @ along / (along @ along)) for joint in cuts]
    edges = np.clip([0.0, *at, 1.0], shape.start, shape.end)
    least = SHORTEST_METRES / float(np.linalg.norm(along))
    return [
        Part(float(start), float(end), joint)
        for start, end, joint in zip(edges[:-1], edges[1:], bodies, strict=True)
        if end - start > least
    ]


def _ancestors(model: pin.Model, joint: int) -> list[int]:
    chain = [joint]
    while chain[-1] > 0:
        chain.append(int(model.parents[chain[-1]]))
    return chain


def _add(
    geometry: pin.GeometryModel,
    model: pin.Model,
    data: pin.Data,
    name: str,
    joint: int,
    ends: tuple[Array, Array],
    radius: float,
) -> None:
    """Lay a capsule between two places of the world at neutral, on the body of a joint."""
    axis = ends[1] - ends[0]
    length = float(np.linalg.norm(axis))
    rotation = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis / length).toRotationMatrix()
    placement = data.oMi[joint].actInv(pin.SE3(rotation, (ends[0] + ends[1]) / 2))
    links = [k for k, frame in enumerate(model.frames) if frame.parentJoint == joint]
    link = next((k for k in links if model.frames[k].type == pin.FrameType.BODY), links[0])
    geometry.addGeometryObject(pin.GeometryObject(name, joint, link, placement, coal.Capsule(radius, length)))


def _set_pairs(model: pin.Model, geometry: pin.GeometryModel, parts_of: list[str]) -> None:
    """Give the pairs that the stick figure checks, but those that touch at neutral."""
    figure = load_figure()
    links = [capsule.link for capsule in figure.capsules]
    checked = {frozenset((links[i], links[j])) for i, j in figure.collision_pairs}
    geometry.addAllCollisionPairs()
    data, geometry_data = model.createData(), geometry.createData()
    pin.computeCollisions(model, data, geometry, geometry_data, neutral_inside_limits(model), False)
    kept = [
        (pair.first, pair.second)
        for pair, result in zip(geometry.collisionPairs, geometry_data.collisionResults, strict=True)
        if frozenset((parts_of[pair.first], parts_of[pair.second])) in checked and not result.isCollision()
    ]
    geometry.removeAllCollisionPairs()
    for a, b in kept:
        geometry.addCollisionPair(pin.CollisionPair(a, b))


def _shapes() -> Mapping[str, Shape]:
    """Return the stick figure's capsules in parts of their segments' lengths."""
    figure = load_figure()
    points = figure.neutral_points
    shapes = {}
    for capsule in figure.capsules:
        start, end = (points[list(ends)].mean(axis=0) for ends in (capsule.start, capsule.end))
        length = float(np.linalg.norm(end - start))
        first, last = capsule.center - capsule.half_length, capsule.center + capsule.half_length
        shapes[capsule.link] = Shape(first / length, last / length, capsule.radius / length)
    return shapes
