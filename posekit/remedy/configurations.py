r"""Configurations of a robot: the nearest within the limits of its joints and free of contact.

Of each configuration :math:`q_0` the step d on the manifold with least :math:`|d|^2` is sought so that
:math:`q_0 \oplus d` is inside the limits, and bodies keep their margin. Distances and normals are coal's: a body's
point moves by its joint's Jacobian, and a distance by the normal's part of that. Each step solves the linearised
problem with its bounds (`posekit.robots.limited_step`). Meshes have no depth: coal's contacts say where their triangles
cross and along which normals, and they are moved apart by these until none does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from posekit.body.measured import MeasuredPerson
from posekit.display.short_repr import ShortRepr
from posekit.geometry import Array
from posekit.remedy.nearest import bounded_forces
from posekit.remedy.record import Repaired, left_of, spans_of
from posekit.remedy.repair import repair
from posekit.robots.configuration_space import ConfigurationSpace
from posekit.robots.unit_quaternions import check_configurations
from posekit.skeleton import JOINTS
from posekit.validators import Validator
from posekit.validators.robot.collision import SelfCollision
from posekit.validators.robot.near_pairs import NearPairs
from posekit.validators.robot.subject import Subject

MOST_STEPS: Final = 60
"""Steps of one configuration."""

LONGEST_STEP: Final = 0.2
"""Radians, or metres, of one joint in one step."""

LOOKED_AT_METRES: Final = 0.03
"""Metres up to which a pair of bodies is watched."""

KEPT_APART_METRES: Final = 1e-5
"""Metres beyond their margin that bodies are moved apart, so that rounding does not reject them."""

MESH_STEP_METRES: Final = 2e-3
"""Metres by which meshes that cross are moved apart at least in one step."""

MOST_CONTACTS: Final = 8
"""Contacts of two meshes that are asked for."""

STRONGEST_PUSH: Final = 1e4
"""Radians squared a metre: how strongly a bound pushes at most, where two push against each other."""

SETTLED_STEP: Final = 1e-7
"""Radians, or metres, of a step that changes nothing any more."""


def repair_configurations(q: ArrayLike, validator: Validator) -> Repaired:
    """Find the nearest configurations within limits that are free of contact.

    Parameters
    ----------
    q : array (N, nq)
        In Pinocchio's order. What passes is returned as it is.
    validator : Validator
        Of a robot, or of the stick figure.

    Returns
    -------
    Repaired
        With `q`; spans have joints of the URDF as places.

    Raises
    ------
    InputError
        Where these are no configurations of the model.

    Examples
    --------
    >>> import pinocchio, posekit
    >>> from posekit.remedy import repair_configurations
    >>> panda = posekit.Validator("panda")
    >>> q = pinocchio.neutral(panda.robot.model)[None]
    >>> q[0, 10] = 0.5  # its fourth joint ends at -0.07
    >>> repaired = repair_configurations(q, panda)
    >>> bool(panda.check(q=repaired.q).valid.all()), round(float(repaired.q[0, 10]), 2)
    (True, -0.07)
    """
    subject, collision = validator.configured
    given = check_configurations(subject.model, q, "q")
    bad = np.flatnonzero(validator.check(q=given).invalid)
    out = given.copy()
    nearest = NearestConfiguration(subject=subject, collision=collision)
    for row in bad.tolist():
        out[row] = nearest.of(given[row])
    report = validator.check(q=out)
    left = np.flatnonzero(report.invalid)
    if validator.robot is None and left.size:
        out[left] = _as_postures(out[left], validator)
        report = validator.check(q=out)
    moved = np.abs(nearest.space.difference(given, out))
    names = [
        str(subject.model.names[joint])
        for joint in range(1, subject.model.njoints)
        for _ in range(subject.model.nvs[joint])
    ]
    slides = np.isin(nearest.space.slides, np.arange(subject.model.njoints))
    units = np.full(len(names), "rad", dtype=object)
    for joint in np.array(nearest.space.slides, dtype=int)[slides].tolist():
        units[subject.model.idx_vs[joint]] = "m"
    spans = [
        span
        for k, (name, unit) in enumerate(zip(names, units, strict=True))
        for span in spans_of("turned" if unit == "rad" else "shifted", moved[:, [k]], [name], unit)
    ]
    return Repaired(
        joints=np.zeros((len(out), 0, 3)),
        q=out,
        spans=tuple(sorted(spans, key=lambda span: -span.most)),
        left=left_of(report.judgements),
        valid=report.valid,
    )


def _as_postures(q: Array, validator: Validator) -> Array:
    """Repair configurations of a figure by their joints: its ranges may be more than limits of single angles."""
    figure = validator.figure
    points = figure.forward_kinematics(q)
    person = MeasuredPerson(lengths=figure.lengths, behind=figure.shoulder_offset < 0, noise=0.0)
    judge = Validator(figure, validator.settings.changed(strict=True))
    done = repair(points[:, : len(JOINTS)], judge, head=points[:, len(JOINTS) :], person=person)
    head = points[:, len(JOINTS) :] if done.head is None else done.head
    return figure.configurations(np.concatenate([done.joints, head], axis=1)).q


@dataclass(frozen=True, kw_only=True, eq=False)
class NearestConfiguration(ShortRepr):
    """Finds the nearest configurations of one model.

    Parameters
    ----------
    subject : Subject
        The model with its limits and bodies.
    collision : SelfCollision, optional
        Which pairs must keep which margin; none where it is not asked about.
    """

    subject: Subject
    collision: SelfCollision | None = None

    @cached_property
    def space(self) -> ConfigurationSpace:
        """The steps on the model's manifold."""
        return ConfigurationSpace(self.subject.model)

    def of(self, given: Array) -> Array:
        """Return the nearest legal configuration (nq,) that is found, else one with less that is wrong."""
        found, free = self._sought(given, outward=False)
        return found if free else self._sought(given, outward=True)[0]

    def _sought(self, given: Array, *, outward: bool) -> tuple[Array, bool]:
        """Seek a legal configuration (nq,) near one; tell whether it is. `outward` is away from contact alone at first.

        Meshes that cross have no depth: pulled back at each step, a configuration may never come out of them.
        """
        space, best, least = self.space, given, np.inf
        q = self._inside(given)
        for _ in range(MOST_STEPS):
            value, slope = self._contacts(q)
            back = space.difference(q[None], given[None])[0]
            if not (value < 0).any() and not self._hits(q):
                cost = float(back @ back)
                if cost < least:
                    best, least = q, cost
            pull = np.zeros_like(back) if outward and not np.isfinite(least) else back
            step = self._step(q, pull, value, slope)
            if np.abs(step).max(initial=0.0) < SETTLED_STEP:
                break
            q = self._inside(space.integrate(q[None], step[None])[0])
        return (best, True) if np.isfinite(least) else (q, False)

    def _step(self, q: Array, back: Array, value: Array, slope: Array) -> Array:
        """Step toward where the configuration was as far as bounds allow."""
        space = self.space
        width = space.nv
        bounded, at = self.subject.velocity_index, self.subject.index
        rows = np.zeros((2 * len(at), width))
        rows[np.arange(len(at)), bounded] = 1.0
        rows[np.arange(len(at)) + len(at), bounded] = -1.0
        room = np.concatenate([q[at] - self.subject.lower[at], self.subject.upper[at] - q[at]])
        near = room < LONGEST_STEP
        slopes = np.concatenate([slope, rows[near]])
        offset = np.concatenate([value, room[near]]) + slopes @ back
        force = bounded_forces((slopes @ slopes.T)[None], offset[None], STRONGEST_PUSH)[0]
        step = back + slopes.T @ force
        return np.asarray(step * min(1.0, LONGEST_STEP / max(np.abs(step).max(initial=0.0), 1e-300)))

    def _inside(self, q: Array) -> Array:
        out, at = q.copy(), self.subject.index
        out[at] = np.clip(out[at], self.subject.lower[at], self.subject.upper[at])
        return out

    def _hits(self, q: Array) -> bool:
        return self.collision is not None and bool(self.collision.hits(q[None])[0])

    def _contacts(self, q: Array) -> tuple[Array, Array]:
        """Return how far pairs that are near are beyond their margins, metres, and the derivatives (K, nv)."""
        found = [] if self.collision is None else list(self._pairs(q))
        value = np.array([one[0] for one in found])
        slope = np.array([one[1] for one in found]).reshape(-1, self.space.nv)
        return value, slope

    def _pairs(self, q: Array) -> Iterator[tuple[float, Array]]:
        subject, bodies = self.subject, self._kept_apart.bodies
        model, data, placed = subject.model, subject.data, self._placed
        pin.computeJointJacobians(model, data, q)
        pin.updateGeometryPlacements(model, data, bodies, placed, q)
        for pair in self._near_pairs(q).tolist():
            ends = bodies.collisionPairs[pair]
            first, second = (bodies.geometryObjects[k].parentJoint for k in (ends.first, ends.second))
            margin = float(self._kept_apart.margins[pair]) + KEPT_APART_METRES
            for distance, normal, a, b in self._apart(pair):
                if distance - margin < LOOKED_AT_METRES and np.isfinite(normal).all():
                    way = normal @ (self._moves(second, b) - self._moves(first, a))
                    yield distance - margin, way

    def _apart(self, pair: int) -> Iterator[tuple[float, Array, Array, Array]]:
        """Yield distances of a pair with their normals, from the first body to the second, and points on both."""
        bodies, placed = self._kept_apart.bodies, self._placed
        found = pin.computeDistance(bodies, placed, pair)
        distance = float(found.min_distance)
        if distance > 0 or not self._kept_apart.with_mesh[pair]:
            yield distance, np.array(found.normal), found.getNearestPoint1(), found.getNearestPoint2()
            return
        pin.computeCollision(bodies, placed, pair)
        for contact in placed.collisionResults[pair].getContacts():
            depth = max(abs(float(contact.penetration_depth)), MESH_STEP_METRES)
            yield -depth, np.array(contact.normal), np.array(contact.pos), np.array(contact.pos)

    def _moves(self, joint: int, point: Array) -> Array:
        """Return how a point of a joint's body moves (3, nv)."""
        model, data = self.subject.model, self.subject.data
        if joint == 0:
            return np.zeros((3, model.nv))
        jacobian = pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        arm = np.asarray(point) - data.oMi[joint].translation
        return np.asarray(jacobian[:3] - pin.skew(arm) @ jacobian[3:])

    def _near_pairs(self, q: Array) -> NDArray[np.intp]:
        return np.flatnonzero(self._balls.of(q[None])[0])

    @cached_property
    def _kept_apart(self) -> SelfCollision:
        """The pairs with their margins; read only where contact is asked about."""
        return self.collision or SelfCollision(subject=self.subject)

    @cached_property
    def _balls(self) -> NearPairs:
        kept = self._kept_apart
        return NearPairs(self.subject.model, kept.bodies, kept.margins + LOOKED_AT_METRES)

    @cached_property
    def _placed(self) -> pin.GeometryData:
        placed = self._kept_apart.bodies.createData()
        for request in placed.collisionRequests:
            request.num_max_contacts, request.enable_contact = MOST_CONTACTS, True
        return placed
