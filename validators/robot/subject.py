"""What is judged: a model with the limits of its joints, its collision bodies and what they are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.geometry import Array

CENTIMETRES_A_DEGREE = 0.01
"""Metres that count as one degree: what one degree moves the end of a limb of 57 cm."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Subject:
    """A model, the limits that it is judged by, and its collision bodies.

    Parameters
    ----------
    model : pinocchio.Model
        The kinematic model of Pinocchio.
    lower, upper : array (nq,)
        Limits, radians and metres.
    geometry : pinocchio.GeometryModel or None
        Bodies with the pairs to check; None where collisions are not asked about.
    """

    model: pin.Model
    lower: Array
    upper: Array
    geometry: pin.GeometryModel | None = None

    @cached_property
    def data(self) -> pin.Data:
        """What Pinocchio writes to while it places the model's bodies."""
        return self.model.createData()

    @cached_property
    def joints(self) -> tuple[int, ...]:
        """The joints with one variable that has a limit, in Pinocchio's order."""
        model = self.model
        at = [(joint, model.idx_qs[joint]) for joint in range(1, model.njoints) if model.nqs[joint] == 1]
        return tuple(joint for joint, k in at if np.isfinite(self.lower[k]) or np.isfinite(self.upper[k]))

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(str(self.model.names[joint]) for joint in self.joints)

    @cached_property
    def index(self) -> NDArray[np.intp]:
        """Where they stand in q."""
        return np.array([self.model.idx_qs[joint] for joint in self.joints], dtype=np.intp)

    @cached_property
    def slides(self) -> NDArray[np.bool_]:
        """Which of them slide: their numbers are metres, the others' degrees."""
        kinds = (self.model.joints[joint].shortname() for joint in self.joints)
        return np.array([kind.startswith("JointModelP") for kind in kinds], dtype=np.bool_)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """The unit of each: ``deg`` or ``m``."""
        return tuple("m" if slides else "deg" for slides in self.slides)

    @cached_property
    def to_unit(self) -> Array:
        """By what q is multiplied to be in that unit."""
        return np.where(self.slides, 1.0, 180.0 / np.pi)

    @cached_property
    def velocity_index(self) -> NDArray[np.intp]:
        """Where they stand in v."""
        return np.array([self.model.idx_vs[joint] for joint in self.joints], dtype=np.intp)

    @cached_property
    def pair_names(self) -> tuple[str, ...]:
        """The pairs of bodies that are checked, by their links: ``torso-right_forearm``."""
        if self.geometry is None:
            return ()
        links = [str(self.model.frames[body.parentFrame].name) for body in self.geometry.geometryObjects]
        return tuple(f"{links[pair.first]}-{links[pair.second]}" for pair in self.geometry.collisionPairs)
