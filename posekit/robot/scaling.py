"""A model with the segment lengths of a person: joint placements, geometry and centres of mass move along."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
import pinocchio as pin

from posekit.cameras import Array
from posekit.errors import InputError
from posekit.intake import nearest
from posekit.robot.kinematics import BodyPoint, Kinematics, frame_index
from posekit.robot.scaled_shape import scale_object
from posekit.skeleton import JOINT, SEGMENT_NAMES, SEGMENTS, SIDES, segment_name

LIMBS = tuple(
    (f"{side}_{start}", f"{side}_{end}")
    for side in SIDES
    for start, end in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))
)
GIRDLES = (
    (("right_shoulder", "left_shoulder"), ("neck", "pelvis")),
    (("right_hip", "left_hip"), ("pelvis",)),
)
"""Pairs of points that are placed by their distances to each other and to the points of the trunk."""

PASSES = 30
EXACT = 1e-12
"""Metres within which all lengths are met: no further pass."""

STUCK = 1e-10
"""Metres by which a pass must change the largest miss: where it does not, the lengths cannot be met."""

ALREADY = 1e-9
"""Relative difference of a length below which it is left alone."""

AWAY = 0.02
"""Metres by which points that lie in one plane with the trunk are helped out of it."""

LONGEST = 0.05
"""Metres that a point moves at most in a step."""

BOUNDS = (0.05, 20.0)
"""Ratios of a new length to the model's that are believed; beyond them the unit is wrong."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scaled:
    """A model with other lengths.

    Parameters
    ----------
    kinematics : Kinematics
        The new model and its points: offsets of points have moved along.
    geometry : pinocchio.GeometryModel or None
        The new geometry, where one was given.
    lengths : mapping
        The distances between mapped points at the neutral configuration, metres, by segment name.
    residual : mapping
        By how much a demanded length was missed (what it has become minus what was asked for), metres. Not zero where
        the model's structure does not allow it, or where no torso has such lengths.
    """

    kinematics: Kinematics
    geometry: pin.GeometryModel | None
    lengths: Mapping[str, float]
    residual: Mapping[str, float]


def segment_lengths(postures: Array) -> dict[str, float]:
    """Return the median length of each of the 17 segments over postures (N, 14, 3) or (N, 19, 3), metres.

    Segments that are never seen whole are left out.
    """
    lengths = {}
    for name, (a, b) in zip(SEGMENT_NAMES, SEGMENTS, strict=True):
        distance = np.linalg.norm(postures[:, a] - postures[:, b], axis=-1)
        known = distance[np.isfinite(distance)]
        if known.size:
            lengths[name] = float(np.median(known))
    return lengths


def model_lengths(kinematics: Kinematics) -> dict[str, float]:
    """Return the distances between a model's mapped joints at its neutral configuration, metres, by segment name."""
    place = dict(zip(kinematics.names, kinematics.positions(kinematics.neutral[None])[0], strict=True))
    return {
        segment_name(segment): float(np.linalg.norm(place[a] - place[b]))
        for segment in SEGMENTS
        for a, b in [(_joint(segment[0]), _joint(segment[1]))]
        if a in place and b in place
    }


def scaled(
    kinematics: Kinematics, lengths: Mapping[str, float], geometry: pin.GeometryModel | None = None
) -> Scaled:
    """Copy a model so that its mapped segments have given lengths at the neutral configuration.

    What lies between the two joints of a limb's segment is scaled by one ratio: the distance then has that ratio
    in every configuration. The spine, from pelvis to neck, is scaled likewise; what else its bodies carry is
    scaled along the spine by that ratio and across it by the shoulders'. Shoulders and hips are then set to the
    place that their distances give. Hands, feet and head keep their size; masses and inertias stay, centres of
    mass move with their body.

    Parameters
    ----------
    kinematics : Kinematics
        From `JointMap.kinematics`: its points are named after the joints.
    lengths : mapping
        Metres, by segment name ``a-b``, a before b in tree order. Segments that are not named, or whose joints the
        model has not, are not asked for.
    geometry : pinocchio.GeometryModel, optional
        Scaled with it.

    Returns
    -------
    Scaled

    Raises
    ------
    InputError
        Where a segment is unknown, or a length is not positive or beyond 20 times the model's, up or down.
    """
    own = model_lengths(kinematics)
    wanted = _check(lengths, own)
    work = _Work(kinematics)
    if any(abs(length / own[name] - 1) > ALREADY for name, length in wanted.items()):
        last = math.inf
        for _ in range(PASSES):
            work.scale(wanted)
            reached = model_lengths(work.kinematics)
            missed = max(abs(reached[name] - length) for name, length in wanted.items())
            if missed < EXACT or abs(last - missed) < STUCK:
                break
            last = missed
    new_geometry = None if geometry is None else work.geometry(geometry)
    reached = model_lengths(work.kinematics)
    return Scaled(
        kinematics=work.kinematics,
        geometry=new_geometry,
        lengths=MappingProxyType(reached),
        residual=MappingProxyType({name: reached[name] - length for name, length in wanted.items()}),
    )


class _Work:
    """A model that is being scaled, and by what each of its bodies has been."""

    def __init__(self, kinematics: Kinematics) -> None:
        self.model = kinematics.model.copy()
        self.points = {point.name: point for point in kinematics.points}
        self.stretched = np.tile(np.eye(3), (self.model.njoints, 1, 1))
        self.frames = frame_index(self.model)
        self.limb_bodies = self._find_limb_bodies()

    @property
    def kinematics(self) -> Kinematics:
        return Kinematics(model=self.model, points=tuple(self.points.values()))

    def scale(self, wanted: Mapping[str, float]) -> None:
        """Bring every length nearer to what is wanted: exactly, where none depends on another."""
        self._scale_spine(wanted)
        for pair, anchors in GIRDLES:
            self._place_pair(pair, anchors, wanted)
        place = self._place()
        for (start, end), bodies in self.limb_bodies.items():
            name = segment_name((JOINT[start], JOINT[end]))
            if name in wanted and bodies:
                ratio = wanted[name] / float(np.linalg.norm(place[end] - place[start]))
                for body in bodies:
                    self._stretch(body, ratio * np.eye(3))
                self._stretch_offset(end, ratio)

    def geometry(self, geometry: pin.GeometryModel) -> pin.GeometryModel:
        """Copy a geometry model and stretch it with the bodies."""
        copy = geometry.copy()
        for body in copy.geometryObjects:
            linear = self.stretched[body.parentJoint]
            if not np.array_equal(linear, np.eye(3)):
                scale_object(body, linear)
        return copy

    def _place(self) -> dict[str, Array]:
        kinematics = self.kinematics
        return dict(zip(kinematics.names, kinematics.positions(kinematics.neutral[None])[0], strict=True))

    def _rotations(self) -> Array:
        """Return the joints' world rotations at the neutral configuration (njoints, 3, 3)."""
        data = self.model.createData()
        pin.forwardKinematics(self.model, data, pin.neutral(self.model))
        return np.array([placement.rotation for placement in data.oMi])

    def _scale_spine(self, wanted: Mapping[str, float]) -> None:
        neck, pelvis = self._body("neck"), self._body("pelvis")
        if neck is None or pelvis is None:
            return
        place, rotation = self._place(), self._rotations()
        line = place["neck"] - place["pelvis"]
        length = float(np.linalg.norm(line))
        along = wanted.get("neck-pelvis", length) / length
        across = along
        shoulders = "right_shoulder-left_shoulder"
        if shoulders in wanted:
            width = float(np.linalg.norm(place["right_shoulder"] - place["left_shoulder"]))
            across = wanted[shoulders] / width
        taken = {body for bodies in self.limb_bodies.values() for body in bodies}
        path = self._path(neck, pelvis)
        carriers = {int(self.model.parents[joint]) for joint in path}
        ends = {
            body
            for name, body in (("neck", neck), ("pelvis", pelvis))
            if np.linalg.norm(self._offset(name)) > 0
        }
        before = {joint: self.model.jointPlacements[joint].translation.copy() for joint in path}
        for body in sorted((carriers | ends) - taken - {0}):
            axis = rotation[body].T @ line / length
            self._stretch(body, across * np.eye(3) + (along - across) * np.outer(axis, axis))
        for joint, translation in before.items():
            if int(self.model.parents[joint]) not in taken:
                self.model.jointPlacements[joint].translation = along * translation
        for name in ("neck", "pelvis"):
            self._stretch_offset(name, along)

    def _place_pair(
        self, pair: tuple[str, str], anchors: tuple[str, ...], wanted: Mapping[str, float]
    ) -> None:
        """Set two points to where their distances to the anchors and to each other put them."""
        place = self._place()
        if not all(name in place for name in pair):
            return
        links = [(pair[0], pair[1])] + [(point, anchor) for point in pair for anchor in anchors]
        given = []
        for a, b in links:
            name = segment_name((JOINT[a], JOINT[b]))
            if name in wanted and a in place and b in place:
                given.append((a, b, wanted[name]))
        new, missed = _fit(pair, place, given)
        if missed > EXACT and "neck" in place and "pelvis" in place:
            # Points in one plane cannot leave it by such steps: shoulders are helped forward, hips down.
            down = place["pelvis"] - place["neck"]
            aside = np.cross(down, place[pair[1]] - place[pair[0]]) if len(anchors) > 1 else down
            nudge = AWAY * aside / max(float(np.linalg.norm(aside)), 1e-12)
            other, still = _fit(pair, {**place, **{name: place[name] + nudge for name in pair}}, given)
            new = other if still < missed else new
        for name in pair:
            self._move(name, new[name] - place[name])

    def _move(self, name: str, shift: Array) -> None:
        """Move a point in the world at the neutral configuration: its joint's placement, or its offset."""
        body = self._body(name)
        if body is None or not np.any(np.abs(shift) > 0):
            return
        rotation = self._rotations()
        parent = int(self.model.parents[body])
        if np.any(self._offset(name)):
            site = self.points[name].sites[0]
            frame = self.model.frames[self.frames[site.frame]]
            local = (rotation[body] @ frame.placement.rotation).T @ shift
            self._set_offset(name, np.asarray(site.offset) + local)
        elif parent > 0:
            placement = self.model.jointPlacements[body]
            placement.translation = placement.translation + rotation[parent].T @ shift

    def _stretch(self, body: int, linear: Array) -> None:
        """Apply a linear map to what a body carries: joints, frames, centre of mass, geometry."""
        model = self.model
        for joint in model.children[body]:
            placement = model.jointPlacements[joint]
            placement.translation = linear @ placement.translation
        for frame in model.frames:
            if frame.parentJoint == body:
                frame.placement.translation = linear @ frame.placement.translation
        model.inertias[body].lever = linear @ model.inertias[body].lever
        self.stretched[body] = linear @ self.stretched[body]

    def _stretch_offset(self, name: str, ratio: float) -> None:
        """Scale a point's own offset in its frame, which is the map's and not the model's."""
        if self._body(name) is not None:
            self._set_offset(name, ratio * np.asarray(self.points[name].sites[0].offset))

    def _set_offset(self, name: str, offset: Array) -> None:
        x, y, z = (float(value) for value in offset)
        site = replace(self.points[name].sites[0], offset=(x, y, z))
        self.points[name] = BodyPoint(name=name, sites=(site,))

    def _find_limb_bodies(self) -> dict[tuple[str, str], tuple[int, ...]]:
        """List, for each segment of a limb, the bodies that lie between its joints."""
        taken: set[int] = set()
        bodies: dict[tuple[str, str], tuple[int, ...]] = {}
        for start, end in LIMBS:
            first, last = self._body(start), self._body(end)
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

    def _body(self, name: str) -> int | None:
        """Return the joint that carries a point; none where it is absent, or a mean of several places."""
        point = self.points.get(name)
        if point is None or len(point.sites) != 1:
            return None
        return int(self.model.frames[self.frames[point.sites[0].frame]].parentJoint)

    def _offset(self, name: str) -> Array:
        """Return where a point lies in its joint's frame."""
        site = self.points[name].sites[0]
        placement = self.model.frames[self.frames[site.frame]].placement
        return np.asarray(placement.rotation @ np.asarray(site.offset) + placement.translation)


def _fit(
    moving: tuple[str, ...], place: Mapping[str, Array], given: Iterable[tuple[str, str, float]]
) -> tuple[dict[str, Array], float]:
    """Move points as little as it takes to have given distances: Gauss-Newton with the shortest step.

    Returns the points and the largest miss, metres.
    """
    points = dict(place)
    at = {name: 3 * k for k, name in enumerate(moving)}
    links = list(given)
    misses = np.zeros(len(links))
    for last in (False,) * 50 + (True,):
        rows = np.zeros((len(links), 3 * len(at)))
        for k, (a, b, length) in enumerate(links):
            gap = points[a] - points[b]
            distance = float(np.linalg.norm(gap))
            misses[k] = length - distance
            for name, sign in ((a, 1.0), (b, -1.0)):
                if name in at and distance > 0:
                    rows[k, at[name] : at[name] + 3] += sign * gap / distance
        if last or np.abs(misses).max(initial=0.0) < 1e-15:
            break
        step = np.linalg.lstsq(rows, misses, rcond=1e-6)[0]
        step *= min(1.0, LONGEST / float(np.abs(step).max()))
        for name, k in at.items():
            points[name] = points[name] + step[k : k + 3]
    return {name: points[name] for name in moving}, float(np.abs(misses).max(initial=0.0))


def _check(lengths: Mapping[str, float], own: Mapping[str, float]) -> dict[str, float]:
    """Refuse unknown segments and impossible lengths; keep those that the model has."""
    wanted = {}
    for name, given in lengths.items():
        if name not in SEGMENT_NAMES:
            raise InputError(f"lengths: {name!r} is not a segment; {nearest(name, SEGMENT_NAMES)}")
        length = float(given)
        if not (math.isfinite(length) and length > 0):
            raise InputError(f"lengths: {name} is {length:g} m; expected positive and finite")
        if name not in own or own[name] <= 0:
            continue
        if not BOUNDS[0] < length / own[name] < BOUNDS[1]:
            raise InputError(
                f"lengths: {name} is {length:g} m, the model's is {own[name]:g}; expected {BOUNDS[0]:g} to "
                f"{BOUNDS[1]:g} times that; give metres"
            )
        wanted[name] = length
    return wanted


def _joint(index: int) -> str:
    return tuple(JOINT)[index]
