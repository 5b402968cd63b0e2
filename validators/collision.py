"""Collision: arms, legs, torso and head must not penetrate each other (Lee & Chen 1985, §3.2.C).

Coal is the judge, through Pinocchio: for each pair of capsules a model of two free-flyers is kept, and a
batch of postures is one call. Only pairs that the closed form finds in contact, or nearly, are asked.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.body.capsules import Capsule
from posekit.body.pool import collides, make_pool
from posekit.compiled import screen_kinds as kernels
from posekit.compiled.compiling import compiled
from posekit.geometry import Array, cross
from posekit.skeleton import JOINTS
from posekit.tree import Check, Findings, Place, Rule

CONTACT_TOLERANCE = 1e-9
"""Metres of penetration below which the verdict would be rounding noise: not a collision."""

CLEAR_METRES = 1e-6
"""Metres between two capsules, by the closed form, from which coal need not be asked: a thousand times the rounding."""


def collision(figure: Figure, *, contact_margin: float = 0.0, exact: bool = False) -> list[Check]:
    """Make one check for each pair of capsules that the figure's SRDF leaves to be checked.

    They judge the posture itself: the figure's rigid capsules, laid along the posture's own segments.

    Parameters
    ----------
    figure : Figure
        The person's figure: lengths, capsules, limits.
    contact_margin : float
        Metres that two bodies must keep from each other; negative allows that much penetration (flesh).
    exact : bool
        Report the exact distance of every pair. Otherwise pairs that are proven clear report a lower bound.
        The verdicts are the same.
    """
    return [
        PairCollision(a=figure.capsules[i], b=figure.capsules[j], contact_margin=contact_margin, exact=exact)
        for i, j in figure.collision_pairs
    ]


@dataclass(frozen=True, kw_only=True, eq=False)
class PairCollision(Check):
    """The distance between two capsules of the figure."""

    a: Capsule
    b: Capsule
    contact_margin: float
    exact: bool
    name: str = "collision"
    unit: str = "m"
    slow = True
    of_configuration = True

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """The two links."""
        return (Place(bodies=(self.a.link, self.b.link)),)

    @property
    def needs_head(self) -> bool:
        """Whether one of the two is the head: how near an arm comes to it, a detector's points cannot tell."""
        return max(self.points) >= len(JOINTS)

    @cached_property
    def points(self) -> tuple[int, ...]:
        """The points that place the two capsules."""
        return self.a.points + self.b.points

    def judge(self, points: Array) -> Findings:
        """Measure the pairs, and ask coal about those that may be in contact; see `posekit.tree.Check`."""
        middle_a, axis_a, middle_b, axis_b = self._placed(points)
        gap = middle_b - middle_a
        half_a, half_b = self.a.half_length, self.b.half_length
        bound = np.sqrt(np.einsum("ni,ni->n", gap, gap)) - (half_a + half_b)
        near = ~np.isnan(bound) if self.exact else bound - self._radii <= self.contact_margin
        distance = bound.copy()
        distance[near] = segment_distance(gap[near], axis_a[near] * half_a, axis_b[near] * half_b)
        rejects = self._touching(points, distance)
        return self._findings(distance if self.exact else np.where(rejects, distance, bound), rejects)

    def judge_looped(self, points: Array) -> Findings:
        """Measure the pairs by a loop; see `posekit.tree.Check`."""
        if not self.exact:
            return self.judge(points)
        from posekit.compiled import capsule_kernels  # read by compiled loops alone

        distance = np.empty(len(points))
        loop = compiled(capsule_kernels).axis_distances
        loop(np.ascontiguousarray(points, dtype=np.float64), self.rule.numbers, distance)
        return self._findings(distance, self._touching(points, distance))

    def _touching(self, points: Array, distance: Array) -> NDArray[np.bool_]:
        """Ask coal about the pairs whose axes (N,) are so near that they may be in contact."""
        rejects = np.zeros(len(points), dtype=bool)
        # The closed form agrees with coal to a thousandth of this.
        asked = np.flatnonzero(distance <= max(self._radii + self.contact_margin, 0.0) + CLEAR_METRES)
        if asked.size:
            rejects[asked] = self._coal(*self._placed(points[asked]))
        return rejects

    def _findings(self, distance: Array, rejects: NDArray[np.bool_]) -> Findings:
        return Findings(
            value=(distance - self._radii)[:, None],
            lower=np.array([self.contact_margin]),
            upper=np.array([np.inf]),
            tolerance=CONTACT_TOLERANCE,
            rejects=rejects[:, None],
        )

    @property
    def _radii(self) -> float:
        return self.a.radius + self.b.radius

    def _placed(self, points: Array) -> tuple[Array, Array, Array, Array]:
        """Return middle and axis of both capsules."""
        split = len(self.a.points)
        return *self.a.place(points[:, :split]), *self.b.place(points[:, split:])

    def confirm(self, presumed: Array) -> bool:
        """Ask coal whether pairs that seem to penetrate do; see `posekit.tree.Check.confirm`."""
        return bool(collides(self._pool, presumed.T).all())

    @cached_property
    def rule(self) -> Rule:
        """The screen as numbers: shapes, reach, and how many points start and end each capsule."""
        a, b = self.a, self.b
        reach = a.radius + b.radius + self.contact_margin
        sizes = len(a.start), len(a.end), len(b.start), len(b.end)
        return Rule(
            kind=kernels.OF_CAPSULES,
            numbers=np.array(
                [a.center, a.half_length, b.center, b.half_length, reach, *sizes], dtype=np.float64
            ),
            presumed=kernels.CAPSULE_NUMBERS,
        )

    def _coal(self, middle_a: Array, axis_a: Array, middle_b: Array, axis_b: Array) -> NDArray[np.bool_]:
        q = np.empty((14, len(middle_a)))
        q[0:3], q[3:7] = middle_a.T, _z_onto(axis_a).T
        q[7:10], q[10:14] = middle_b.T, _z_onto(axis_b).T
        return collides(self._pool, q)

    @cached_property
    def _pool(self) -> pin.GeometryPool:
        """A pool of models of two capsules that fly freely."""
        model, geometry = pin.Model(), pin.GeometryModel()
        # Coal has no clearance in a pool: the radii carry it, and the tolerance, instead. Only their sum counts.
        radius = max(self.a.radius + self.b.radius + self.contact_margin - CONTACT_TOLERANCE, 0.0) / 2
        for capsule in (self.a, self.b):
            joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), capsule.link)
            shape = coal.Capsule(radius, 2 * capsule.half_length)
            geometry.addGeometryObject(pin.GeometryObject(capsule.link, joint, pin.SE3.Identity(), shape))
        geometry.addCollisionPair(pin.CollisionPair(0, 1))
        return make_pool(model, geometry)


def segment_distance(gap: Array, half_a: Array, half_b: Array) -> Array:
    r"""Return the distance between two segments, in closed form.

    Segment a is :math:`s\,h_a`, segment b is :math:`g + t\,h_b`, with s and t in [-1, 1]. The unconstrained
    minimum is clamped in s, t follows and is clamped, and s follows that (Ericson, Real-Time Collision
    Detection, 2005, §5.1.9). Where the segments are nearly parallel that minimum is ill-conditioned; the four
    ends, each against the other segment, are tried as well.

    Parameters
    ----------
    gap : array (N, 3)
        From a's middle to b's, metres.
    half_a, half_b : array (N, 3)
        From each middle to one end, metres.

    Returns
    -------
    array (N,)
    """
    aa, bb = np.einsum("ni,ni->n", half_a, half_a), np.einsum("ni,ni->n", half_b, half_b)
    ab = np.einsum("ni,ni->n", half_a, half_b)
    ag, bg = np.einsum("ni,ni->n", half_a, gap), np.einsum("ni,ni->n", half_b, gap)
    # Lagrange's identity: the products of cross products keep the digits that aa bb - ab^2 cancels.
    normal = cross(half_a, half_b)
    determinant = np.einsum("ni,ni->n", normal, normal)
    parallel = determinant <= 1e-30 * aa * bb
    along = np.einsum("ni,ni->n", normal, cross(gap, half_b)) / np.where(parallel, 1.0, determinant)
    s = np.where(parallel, 0.0, np.clip(along, -1.0, 1.0))
    t = np.clip((s * ab - bg) / bb, -1.0, 1.0)
    nearest = np.full(len(gap), np.inf)
    for end in (t, -np.ones_like(t), np.ones_like(t)):
        apart = gap + end[:, None] * half_b - np.clip((ag + end * ab) / aa, -1.0, 1.0)[:, None] * half_a
        nearest = np.minimum(nearest, np.einsum("ni,ni->n", apart, apart))
    for end in (-1.0, 1.0):
        apart = gap + np.clip((end * ab - bg) / bb, -1.0, 1.0)[:, None] * half_b - end * half_a
        nearest = np.minimum(nearest, np.einsum("ni,ni->n", apart, apart))
    return np.asarray(np.sqrt(nearest))


def _z_onto(axis: Array) -> Array:
    """Return unit quaternions (N, 4), x y z w, that turn z onto an axis or its opposite: capsules have no sign."""
    axis = np.where(axis[:, 2:] < 0, -axis, axis)
    w = 1.0 + axis[:, 2]
    q = np.stack([-axis[:, 1], axis[:, 0], np.zeros(len(axis)), w], axis=-1)
    return q / np.sqrt(2.0 * w)[:, None]
