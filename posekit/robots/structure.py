"""How a model is built between its mapped joints: its spine, its girdles and its limbs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from posekit.geometry import Array
from posekit.robots.body_point import BodyPoint, frame_index
from posekit.robots.kinematics import Kinematics
from posekit.skeleton import SIDES

LIMB_SEGMENTS = tuple(
    (f"{side}_{start}", f"{side}_{end}")
    for side in SIDES
    for start, end in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))
)
SHOULDER_PAIR = ("right_shoulder", "left_shoulder")
HIP_PAIR = ("right_hip", "left_hip")
GIRDLE_ANCHORS: Mapping[tuple[str, str], tuple[str, ...]] = {
    SHOULDER_PAIR: ("neck", "pelvis"),
    HIP_PAIR: ("pelvis",),
}
"""Pairs of points, and the points of the trunk from which their place is measured."""

SAME_PLACE_METRES = 1e-6
"""Metres within which the origins of joints are one place."""


class SpineCarriers(NamedTuple):
    """The joints between pelvis and neck, and the bodies on which they sit."""

    joints: tuple[int, ...]
    carriers: tuple[int, ...]


class GirdleCarriers(NamedTuple):
    """What carries a shoulder or a hip.

    The joint that is moved to move the point (0: the point's offset is), the body in which it sits, and the bodies
    that grow with the girdle.
    """

    joint: int
    carrier: int
    bodies: tuple[int, ...]


class BodyStructure:
    """The parts of a model, found once: stretching changes no part's joints.

    Parameters
    ----------
    model : pinocchio.Model
        The robot's.
    points : mapping
        Points by name; see `JointMap.kinematics`.

    Attributes
    ----------
    limb_bodies : dict
        For each segment of a limb, the bodies that lie between its joints.
    spine : Spine
        What lies between pelvis and neck.
    girdles : dict
        For each pair of `GIRDLE_ANCHORS`, what carries its two points; none where a point is absent or a mean.
    """

    def __init__(self, model: pin.Model, points: Mapping[str, BodyPoint]) -> None:
        self.model, self.points = model, points
        self.frames = frame_index(model)
        self.limb_bodies = self._find_limb_bodies()
        self.spine = self._find_spine()
        kinematics = Kinematics(model=model, points=tuple(points.values()))
        neutral = kinematics.positions(kinematics.neutral[None])[0]
        place = dict(zip(kinematics.names, neutral, strict=True))
        self.girdles = {
            pair: tuple(self._find_girdle(name, anchors, place) for name in pair)
            for pair, anchors in GIRDLE_ANCHORS.items()
        }

    def body(self, name: str) -> int | None:
        """Return the joint that carries a point; none where it is absent, or a mean of several places."""
        point = self.points.get(name)
        if point is None or len(point.sites) != 1:
            return None
        return int(self.model.frames[self.frames[point.sites[0].frame]].parentJoint)

    def _find_spine(self) -> SpineCarriers:
        neck, pelvis = self.body("neck"), self.body("pelvis")
        if neck is None or pelvis is None:
            return SpineCarriers((), ())
        taken = {body for bodies in self.limb_bodies.values() for body in bodies}
        joints = [joint for joint in self._path(neck, pelvis) if int(self.model.parents[joint]) not in taken]
        carriers = {int(self.model.parents[joint]) for joint in joints}
        carriers |= {
            body for name, body in (("neck", neck), ("pelvis", pelvis)) if np.any(self._offset(name))
        }
        return SpineCarriers(tuple(joints), tuple(sorted(carriers - taken - {0})))

    def _find_girdle(
        self, name: str, anchors: tuple[str, ...], place: Mapping[str, Array]
    ) -> GirdleCarriers | None:
        """Find what carries a shoulder or a hip: from the spine, or the pelvis, out to the point."""
        body = self.body(name)
        if body is None:
            return None
        origins = self._origins()
        trunk = set(self.spine.carriers) | {0}
        for anchor in anchors:
            carrier = self.body(anchor)
            trunk |= set(self._ancestors(carrier)[1:]) if carrier is not None else set()
        pelvis = self.body("pelvis")
        if pelvis is not None and name.endswith("hip"):
            trunk.add(pelvis)
        chain = []
        for joint in self._ancestors(body):
            if joint in trunk:
                break
            chain.append(joint)
        fixed = [place[anchor] for anchor in anchors if anchor in place]
        movable = [
            joint
            for joint in chain
            if all(np.linalg.norm(origins[joint] - point) > SAME_PLACE_METRES for point in fixed)
        ]
        near = [joint for joint in chain if np.linalg.norm(origins[joint] - place[name]) <= SAME_PLACE_METRES]
        bodies = [joint for joint in chain if joint not in near]
        if not chain or not movable or (np.any(self._offset(name)) and not near and len(chain) == 1):
            return GirdleCarriers(0, body, tuple(bodies))
        joint = movable[-1]
        carrier = int(self.model.parents[joint])
        if name.endswith("hip") and carrier > 0:
            bodies.append(carrier)
        return (
            GirdleCarriers(joint, carrier, tuple(bodies))
            if carrier > 0
            else GirdleCarriers(0, body, tuple(bodies))
        )

    def _origins(self) -> Array:
        """Return the joints' origins at the neutral configuration (njoints, 3)."""
        data = self.model.createData()
        pin.forwardKinematics(self.model, data, pin.neutral(self.model))
        return np.array([placement.translation for placement in data.oMi])

    def _find_limb_bodies(self) -> dict[tuple[str, str], tuple[int, ...]]:
        """List, for each segment of a limb, the bodies that lie between its joints."""
        taken: set[int] = set()
        bodies: dict[tuple[str, str], tuple[int, ...]] = {}
        for start, end in LIMB_SEGMENTS:
            first, last = self.body(start), self.body(end)
            found: list[int] = []
            if first is not None and last is not None and first in self._ancestors(last):
                path = self._ancestors(last)[: self._ancestors(last).index(first) + 1]
                found = [body for body in path[1:] if body not in taken]
                if np.any(self._offset(end)) and last not in taken:
                    found.append(last)
            taken |= set(found)
            bodies[start, end] = tuple(found)
        return bodies

    def _path(self, a: int, b: int) -> list[int]:
        """List the joints whose placements lie between two bodies."""
        up_a, up_b = self._ancestors(a), self._ancestors(b)
        return [joint for joint in up_a if joint not in up_b] + [joint for joint in up_b if joint not in up_a]

    def _ancestors(self, joint: int) -> list[int]:
        """List a joint and those that carry it, up to the root."""
        chain = [joint]
        while chain[-1] > 0:
            chain.append(int(self.model.parents[chain[-1]]))
        return chain

    def _offset(self, name: str) -> Array:
        """Return where a point lies in its joint's frame."""
        site = self.points[name].sites[0]
        placement = self.model.frames[self.frames[site.frame]].placement
        return np.asarray(placement.rotation @ np.asarray(site.offset) + placement.translation)
