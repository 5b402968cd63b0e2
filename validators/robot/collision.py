"""Self-collision of any robot's configurations: verdicts in one call of Pinocchio's pool, pairs only on demand."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.body.pool import collides, make_pool
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.validators.collision import CONTACT_TOLERANCE
from posekit.validators.robot.contacts import Contacts, find_contacts
from posekit.validators.robot.near_pairs import NearPairs
from posekit.validators.robot.subject import Subject
from posekit.validators.suite import Judgement

NEAREST_PAIR = "nearest pair"


@dataclass(frozen=True, kw_only=True, eq=False)
class SelfCollision:
    """The bodies of a subject, and the margin that they must keep.

    Parameters
    ----------
    subject : Subject
        With geometry and its pairs.
    contact_margin : float
        Metres; negative allows that much penetration, between primitive shapes only.

    Raises
    ------
    InputError
        Where the margin is negative and a pair has a mesh: coal knows no depth of meshes.
    """

    subject: Subject
    contact_margin: float = 0.0

    def __post_init__(self) -> None:
        _ = self.margins

    @property
    def bodies(self) -> pin.GeometryModel:
        """The collision bodies, refused where the model has none."""
        if self.subject.geometry is None:
            raise InputError(
                "the model was loaded without collision bodies; expected some for the check collision"
            )
        return self.subject.geometry

    @cached_property
    def has_meshes(self) -> bool:
        """Whether some pair has a mesh: distances take a thousand times as long then."""
        return bool(self.with_mesh.any())

    @cached_property
    def with_mesh(self) -> NDArray[np.bool_]:
        """Which pairs have a mesh (P,)."""
        return np.asarray(self._meshes.any(axis=1))

    @cached_property
    def _meshes(self) -> NDArray[np.bool_]:
        """Which bodies of each pair are meshes (P, 2)."""
        geometry = self.bodies
        meshes = [isinstance(body.geometry, coal.BVHModelBase) for body in geometry.geometryObjects]
        both = [(meshes[pair.first], meshes[pair.second]) for pair in geometry.collisionPairs]
        return np.array(both, dtype=np.bool_).reshape(-1, 2)

    @cached_property
    def _near(self) -> NearPairs | None:
        """What spares asking pairs that are far apart, where asking is dear."""
        return NearPairs(self.subject.model, self.bodies, self.margins) if self.has_meshes else None

    @cached_property
    def margins(self) -> Array:
        """The security margin of each pair (P,), metres: less than the contact margin by what is rounding noise."""
        with_mesh = self.with_mesh
        if with_mesh.any() and self.contact_margin < 0:
            name = self.subject.pair_names[int(np.argmax(with_mesh))]
            raise InputError(
                f"--contact-margin {self.contact_margin:g} m: the pair {name} has a mesh, whose depth is not "
                "known; expected zero or a positive length; give capsules (--bodies capsules) to allow depth"
            )
        return np.where(with_mesh, self.contact_margin, self.contact_margin - CONTACT_TOLERANCE)

    def judge(self, q: Array, undecided: NDArray[np.bool_] | None = None) -> Judgement:
        """Judge configurations (N, nq); those of `undecided` (N,) are left out.

        There is one place, the nearest pair. Its value is a bound of the distance: at least the contact margin where
        nothing collides, at most that where something does; `contacts` measures.
        """
        if undecided is None:
            return self.judgement(self.hits(q))
        hit = np.zeros(len(q), dtype=np.bool_)
        hit[~undecided] = self.hits(q[~undecided])
        return self.judgement(hit, undecided)

    def hits(self, q: Array) -> NDArray[np.bool_]:
        """Tell which configurations (N, nq) collide."""
        if not len(q) or not len(self.margins):
            return np.zeros(len(q), dtype=np.bool_)
        return collides(self._pool, q.T)

    def judgement(self, hit: NDArray[np.bool_], undecided: NDArray[np.bool_] | None = None) -> Judgement:
        """Put into a judgement which configurations collide (N,), and about which nothing was asked (N,)."""
        value = np.full((len(hit), 1), self.contact_margin)
        if undecided is not None:
            value[undecided] = np.nan
        return Judgement(
            check="collision",
            where=(NEAREST_PAIR,),
            unit=("m",),
            value=value,
            lower=np.broadcast_to(self.contact_margin, value.shape),
            upper=np.broadcast_to(np.inf, value.shape),
            margin=value - self.contact_margin,
            violated=hit[:, None],
            by_pairs=True,
        )

    def contacts(self, q: Array, rows: NDArray[np.intp], *, nearest: bool = False) -> Contacts:
        """List the pairs that collide in some configurations; with `nearest` the nearest pair of the others too."""
        return find_contacts(
            self.subject,
            self.bodies,
            q,
            rows,
            margins=self.margins,
            nearest=nearest,
            meshes=np.asarray(self._meshes.all(axis=1)),
            near=self._near,
        )

    @cached_property
    def _pool(self) -> pin.GeometryPool:
        pool = make_pool(self.subject.model, self.bodies)
        for data in pool.getGeometryDatas():
            for request, margin in zip(data.collisionRequests, self.margins.tolist(), strict=True):
                request.security_margin = margin
        return pool
