"""Stretching a model, part by part, until its mapped joints lie at given distances."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
import pinocchio as pin

from posekit.geometry import Array, cross
from posekit.robots.body_point import BodyPoint
from posekit.robots.kinematics import Kinematics
from posekit.robots.scaled_shape import scale_object
from posekit.robots.structure import GIRDLE_ANCHORS, HIP_PAIR, SHOULDER_PAIR, BodyStructure, GirdleCarriers
from posekit.skeleton import JOINT, segment_name

EXACT_METRES = 1e-12
"""Metres within which all lengths are met."""

NUDGE_METRES = 0.02
"""Metres by which points that lie in one plane with the trunk are helped out of it."""

MAX_STEP_METRES = 0.05
"""Metres that a point moves at most in a step."""


class ModelStretching:
    """A model that is being scaled, and by what each of its bodies has been."""

    def __init__(self, kinematics: Kinematics, behind: bool | None) -> None:
        self.wanted_behind = behind
        self.model = kinematics.model.copy()
        self.points = {point.name: point for point in kinematics.points}
        self.stretched = np.tile(np.eye(3), (self.model.njoints, 1, 1))
        self.structure = BodyStructure(self.model, self.points)

    @property
    def kinematics(self) -> Kinematics:
        """The model as it is now, with its points."""
        return Kinematics(model=self.model, points=tuple(self.points.values()))

    def scale(self, wanted: Mapping[str, float]) -> None:
        """Bring every length nearer to what is wanted: exactly, where none depends on another."""
        self._scale_spine(wanted)
        for pair, anchors in GIRDLE_ANCHORS.items():
            self._place_pair(pair, anchors, wanted)
        place = self._place()
        for (start, end), bodies in self.structure.limb_bodies.items():
            name = segment_name((JOINT[start], JOINT[end]))
            if name in wanted and bodies:
                ratio = wanted[name] / float(np.linalg.norm(place[end] - place[start]))
                for body in bodies:
                    self._stretch(body, ratio * np.eye(3))
                self._stretch_offset(end, ratio)

    def behind(self) -> bool | None:
        """Tell on which side of the line from neck to pelvis the shoulders are; none where a point is absent."""
        place = self._place()
        posture = np.full((1, len(JOINT), 3), np.nan)
        for name, index in JOINT.items():
            posture[0, index] = place.get(name, np.full(3, np.nan))
        return shoulders_are_behind(posture)

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
        """Scale what lies between pelvis and neck by their distance, what else it carries across by the shoulders'."""
        place = self._place()
        if "neck" not in place or "pelvis" not in place:
            return
        line = place["neck"] - place["pelvis"]
        along = self._ratio("neck", "pelvis", place, wanted)
        across = self._ratio(*SHOULDER_PAIR, place, wanted)
        axis = line / float(np.linalg.norm(line))
        rotation, before = self._rotations(), self._spine_placements()
        hips = {girdle.carrier for girdle in self.structure.girdles[HIP_PAIR] if girdle is not None}
        for body in self.structure.spine.carriers:
            if body not in hips:
                own = rotation[body].T @ axis
                self._stretch(body, across * np.eye(3) + (along - across) * np.outer(own, own))
        for joint, translation in before.items():
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
        ratio = self._ratio(*pair, place, wanted)
        bodies = {
            body for girdle in self.structure.girdles[pair] if girdle is not None for body in girdle.bodies
        }
        before = self._spine_placements()
        for body in bodies:
            self._stretch(body, ratio * np.eye(3))
        for joint, translation in before.items():
            self.model.jointPlacements[joint].translation = translation
        place = self._place()
        links = [(pair[0], pair[1])] + [(point, anchor) for point in pair for anchor in anchors]
        given = []
        for a, b in links:
            name = segment_name((JOINT[a], JOINT[b]))
            if name in wanted and a in place and b in place:
                given.append((a, b, wanted[name]))
        new, missed = _fit(pair, place, given)
        if missed > EXACT_METRES and "neck" in place and "pelvis" in place:
            # Points in one plane cannot leave it by such steps: shoulders are helped forward, hips down.
            down = place["pelvis"] - place["neck"]
            aside = cross(down, place[pair[1]] - place[pair[0]]) if len(anchors) > 1 else down
            nudge = NUDGE_METRES * aside / max(float(np.linalg.norm(aside)), 1e-12)
            other, still = _fit(pair, {**place, **{name: place[name] + nudge for name in pair}}, given)
            new = other if still < missed else new
        if len(anchors) > 1 and self.wanted_behind is not None and "neck" in place and "pelvis" in place:
            new = _on_side(new, place, self.wanted_behind)
        rotation = self._rotations()
        for name, girdle in zip(pair, self.structure.girdles[pair], strict=True):
            if girdle is not None:
                self._move(name, girdle, rotation, new[name] - place[name])

    def _move(self, name: str, girdle: GirdleCarriers, rotation: Array, shift: Array) -> None:
        """Move a point in the world at the neutral configuration: the joint that carries it, or its offset."""
        if girdle.joint > 0:
            placement = self.model.jointPlacements[girdle.joint]
            placement.translation = placement.translation + rotation[girdle.carrier].T @ shift
            return
        site = self.points[name].sites[0]
        frame = self.model.frames[self.structure.frames[site.frame]]
        local = (rotation[girdle.carrier] @ frame.placement.rotation).T @ shift
        self._set_offset(name, np.asarray(site.offset) + local)

    def _ratio(self, a: str, b: str, place: Mapping[str, Array], wanted: Mapping[str, float]) -> float:
        name = segment_name((JOINT[a], JOINT[b]))
        if name not in wanted or a not in place or b not in place:
            return 1.0
        return wanted[name] / float(np.linalg.norm(place[a] - place[b]))

    def _spine_placements(self) -> dict[int, Array]:
        return {
            joint: self.model.jointPlacements[joint].translation.copy()
            for joint in self.structure.spine.joints
        }

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
        if self.structure.body(name) is not None:
            self._set_offset(name, ratio * np.asarray(self.points[name].sites[0].offset))

    def _set_offset(self, name: str, offset: Array) -> None:
        x, y, z = (float(value) for value in offset)
        site = replace(self.points[name].sites[0], offset=(x, y, z))
        self.points[name] = BodyPoint(name=name, sites=(site,))


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
        step *= min(1.0, MAX_STEP_METRES / float(np.abs(step).max()))
        for name, k in at.items():
            points[name] = points[name] + step[k : k + 3]
    return {name: points[name] for name in moving}, float(np.abs(misses).max(initial=0.0))


def _on_side(shoulders: dict[str, Array], place: Mapping[str, Array], behind: bool) -> dict[str, Array]:
    """Mirror the shoulders in the plane of spine and breadth, where they are on the other side: no length changes."""
    down = place["pelvis"] - place["neck"]
    forward = cross(down, shoulders["left_shoulder"] - shoulders["right_shoulder"])
    size = float(np.linalg.norm(forward))
    if size == 0:
        return shoulders
    forward = forward / size
    ahead = {name: float((point - place["neck"]) @ forward) for name, point in shoulders.items()}
    if (sum(ahead.values()) < 0) == behind:
        return shoulders
    return {name: point - 2 * ahead[name] * forward for name, point in shoulders.items()}


def shoulders_are_behind(postures: Array) -> bool | None:
    """Tell on which side of the line from neck to pelvis the shoulders of postures (N, 14, 3) lie; none where unseen.

    Lengths do not tell a torso from its mirror image, so `scaled` asks.
    """
    neck, pelvis = postures[:, JOINT["neck"]], postures[:, JOINT["pelvis"]]
    right, left = postures[:, JOINT["right_shoulder"]], postures[:, JOINT["left_shoulder"]]
    forward = np.einsum("ni,ni->n", cross(pelvis - neck, left - right), (left + right) / 2 - neck)
    known = forward[np.isfinite(forward)]
    return bool(np.median(known) < 0) if known.size else None
