"""The models of one robot: with its own lengths, and with those of the postures that are judged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
import pinocchio as pin

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.robots import Robot
from posekit.robots.joint_map import JointMap, find_joint_map, load_joint_map
from posekit.robots.kinematics import Kinematics
from posekit.robots.pairs import set_pairs
from posekit.robots.scaling import RATIO_BOUNDS, model_lengths, scaled
from posekit.settings import ValidateSettings
from posekit.validators.robot.balance import Balance
from posekit.validators.robot.collision import SelfCollision
from posekit.validators.robot.feet import find_soles
from posekit.validators.robot.fitting import Fitter
from posekit.validators.robot.made_up import fitted_capsules
from posekit.validators.robot.ranges import load_joint_limits
from posekit.validators.robot.rigid_parts import rigid_segments
from posekit.validators.robot.settings import BODIES_FROM
from posekit.validators.robot.subject import Subject

SAME_LENGTH: Final = 1e-3
"""Metres within which a length is the model's own."""

PAIRS_FROM: Final = {
    "visual": "all but neighbours and what touches in the neutral posture",
    "capsules": "those that the stick figure's SRDF checks, but what touches in the neutral posture",
    "neutral posture": "all but neighbours and what touches in the neutral posture",
    "srdf": "the SRDF",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class JudgedModel:
    """One model, and what judges its configurations; tables and pools are made once, when they are needed.

    Parameters
    ----------
    subject : Subject
        The model with its geometry, and what was prepared for it once.
    kinematics : Kinematics or None
        The points of the joint map; None where the robot has none and only configurations are judged.
    settings : ValidateSettings
        What the judging was asked.
    """

    subject: Subject
    kinematics: Kinematics | None
    settings: ValidateSettings

    @cached_property
    def fitter(self) -> Fitter:
        """What makes configurations of postures."""
        if self.kinematics is None:
            raise InputError("the robot has no joint map; give one to judge postures")
        return Fitter(kinematics=self.kinematics, subject=self.subject, tolerance=self.settings.rigid)

    @cached_property
    def collision(self) -> SelfCollision:
        """What judges collisions."""
        return SelfCollision(subject=self.subject, contact_margin=self.settings.contact_margin)

    @cached_property
    def balance(self) -> Balance:
        """What judges balance."""
        corners = () if self.kinematics is None else find_soles(self.kinematics, self.subject.geometry)
        up = np.asarray(self.settings.up, dtype=np.float64)
        return Balance(model=self.subject.model, corners=corners, up=up / np.linalg.norm(up))


@dataclass(frozen=True, kw_only=True, eq=False)
class Models:
    """A robot's models.

    Parameters
    ----------
    robot : Robot
        The robot that is judged, as it was loaded.
    settings : ValidateSettings
        What the judging was asked.
    """

    robot: Robot
    settings: ValidateSettings

    @cached_property
    def joint_map(self) -> JointMap:
        """The joint map: the one given, or the built-in one whose frames the robot has."""
        given = self.settings.joint_map
        if isinstance(given, JointMap):
            return given
        return find_joint_map(self.robot.model) if given is None else load_joint_map(given)

    @cached_property
    def kinematics(self) -> Kinematics:
        """The robot's points, with its own lengths."""
        return self.joint_map.kinematics(self.robot.model)

    @cached_property
    def limits(self) -> tuple[Array, Array]:
        """The limits of q (nq,) that are judged by."""
        ranges = self.settings.ranges
        return load_joint_limits(ranges if isinstance(ranges, str) else ranges.name, self.robot.model)

    @cached_property
    def bodies(self) -> str:
        """What collides: ``urdf``, ``visual`` or ``capsules``."""
        if self.settings.bodies != "auto":
            return self.settings.bodies
        return "urdf" if self.robot.collision_pairs else "capsules"

    @cached_property
    def own(self) -> JudgedModel:
        """The model with its own lengths."""
        lower, upper = self.limits
        subject = Subject(model=self.robot.model, lower=lower, upper=upper, geometry=self._geometry)
        needed = "balance" in self.settings.check_names
        return JudgedModel(
            subject=subject, kinematics=self.known_kinematics if needed else None, settings=self.settings
        )

    def with_lengths(self, lengths: Mapping[str, float], behind: bool | None) -> JudgedModel:
        """Return the model with other segment lengths; the last one is kept."""
        key = (behind, *sorted(lengths.items()))
        if key not in self._kept:
            self._kept.clear()
            self._kept[key] = self._scaled(lengths, behind)
        return self._kept[key]

    def has_lengths(self, lengths: Mapping[str, float]) -> bool:
        """Tell whether lengths are the model's own, as far as no configuration changes them."""
        own, rigid = model_lengths(self.kinematics), self._rigid_segments
        return all(abs(lengths.get(name, own[name]) - own[name]) < SAME_LENGTH for name in rigid)

    def possible(self, lengths: Mapping[str, float]) -> dict[str, float]:
        """Return those of some lengths that the model can be scaled to: what has no size, or a giant's, is no body."""
        own, (low, high) = model_lengths(self.kinematics), RATIO_BOUNDS
        return {
            name: length
            for name, length in lengths.items()
            if not own.get(name, 0.0) > 0 or low < length / own[name] < high
        }

    @cached_property
    def _rigid_segments(self) -> tuple[str, ...]:
        return rigid_segments(self.kinematics)

    @cached_property
    def mapped(self) -> JudgedModel:
        """The model with its own lengths and its points."""
        lower, upper = self.limits
        subject = Subject(model=self.robot.model, lower=lower, upper=upper, geometry=self._geometry)
        return JudgedModel(subject=subject, kinematics=self.kinematics, settings=self.settings)

    def describe(self) -> dict[str, Any]:
        """List what decides the verdicts, as reports have it."""
        settings: dict[str, Any] = {
            "figure": self.robot.hash,
            "robot": self.robot.name,
            "checks": list(self.settings.check_names),
        }
        if "collision" in self.settings.check_names:
            settings |= {
                "bodies": BODIES_FROM[self.bodies],
                "pairs_from": PAIRS_FROM[self.robot.pairs_from if self.bodies == "urdf" else self.bodies],
                "pairs": list(self.own.subject.pair_names),
            }
            if self.settings.bodies != self.bodies == "capsules":
                settings["bodies_because"] = "no pair of the robot's own bodies can collide"
        return settings

    def _scaled(self, lengths: Mapping[str, float], behind: bool | None) -> JudgedModel:
        make_up = self.bodies == "capsules"
        result = scaled(self.kinematics, lengths, None if make_up else self._geometry, behind=behind)
        geometry = result.geometry
        if make_up and self._geometry is not None:
            geometry = fitted_capsules(result.kinematics)
        lower, upper = self.limits
        subject = Subject(model=result.kinematics.model, lower=lower, upper=upper, geometry=geometry)
        return JudgedModel(subject=subject, kinematics=result.kinematics, settings=self.settings)

    @cached_property
    def _kept(self) -> dict[tuple[object, ...], JudgedModel]:
        return {}

    @cached_property
    def known_kinematics(self) -> Kinematics | None:
        """The robot's points; None where no joint map fits it, and then it has no feet."""
        try:
            return self.kinematics
        except InputError:
            if self.settings.joint_map is not None:
                raise
            return None

    @cached_property
    def _geometry(self) -> pin.GeometryModel | None:
        """The bodies of the model with its own lengths."""
        if not {"collision", "balance"} & set(self.settings.check_names):
            return None
        if self.bodies == "capsules":
            # What is made up has no feet: for balance alone there is nothing to make.
            geometry = fitted_capsules(self.kinematics) if "collision" in self.settings.check_names else None
        elif self.bodies == "visual":
            geometry = self._visuals()
        else:
            geometry = self.robot.geometry
        if "collision" in self.settings.check_names and (
            geometry is None or not len(geometry.collisionPairs)
        ):
            raise InputError(
                f"{self.robot.source}: --bodies {self.bodies}: no pair of bodies can collide; expected two bodies at "
                "least; take --bodies capsules, or leave the check collision out"
            )
        return geometry

    def _visuals(self) -> pin.GeometryModel:
        if self.robot.visuals is None:
            raise InputError(
                f"{self.robot.source}: --bodies visual: it was loaded without them; load it with visuals=True"
            )
        geometry = self.robot.visuals.copy()
        geometry.removeAllCollisionPairs()
        set_pairs(self.robot.model, geometry, None)
        return geometry
