"""Positions and Jacobians of points of a Pinocchio model, for a batch of configurations, in NumPy."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.geometry.batch_last import matrix_vector
from posekit.robots.body_point import BodyPoint, BodySite, body_points, find_frame, frame_index
from posekit.robots.configuration_space import ConfigurationSpace
from posekit.robots.joint_chain import JointChain

__all__ = ["BodyPoint", "BodySite", "Kinematics", "PlacedPoints", "body_points", "find_frame", "frame_index"]

BLOCK_CONFIGURATIONS = 256
"""Configurations worked on at once: their rotations and Jacobians stay in the processor's cache."""

MOVING_RATE = 1e-9
"""Metres per radian, or per metre, below which a joint does not move a point."""

N_DRAWS = 4
"""Configurations, away from special ones, at which it is looked what moves."""


class PlacedPoints(NamedTuple):
    """Where points are and how they move.

    Attributes
    ----------
    positions : array (N, P, 3)
        Metres, world.
    jacobians : array (N, P, 3, nv)
        Their derivative along `ConfigurationSpace.integrate`: m/rad, and m/m.
    """

    positions: Array
    jacobians: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Kinematics:
    """Forward kinematics of some points of a model.

    Only joints that lead to a point are computed. Equal to Pinocchio's `framesForwardKinematics` and
    `getFrameJacobian(…, LOCAL_WORLD_ALIGNED)` up to rounding.

    Parameters
    ----------
    model : pinocchio.Model
        See `ConfigurationSpace` for the joints it may have.
    points : sequence of BodyPoint
        The points that are placed, by name.
    carrier : int
        The joint in whose body's frame positions and Jacobians are expressed, and beyond which alone joints are
        moved; the world unless told otherwise.

    Raises
    ------
    InputError
        Where a frame is not in the model (the nearest names are given), an offset is not finite, weights are not
        positive, or a joint is of an unknown kind.
    """

    model: pin.Model
    points: tuple[BodyPoint, ...]
    carrier: int = 0
    space: ConfigurationSpace = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", tuple(self.points))
        object.__setattr__(self, "space", ConfigurationSpace(self.model))
        names = [point.name for point in self.points]
        if not names:
            raise InputError(f"model {self.model.name!r}: no points were given; name at least one")
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"model {self.model.name!r}: point {name!r} is given twice; name it once")
        _ = self._sites, self._chain

    @property
    def names(self) -> tuple[str, ...]:
        """The points' names."""
        return tuple(point.name for point in self.points)

    @cached_property
    def neutral(self) -> Array:
        """The model's neutral configuration (nq,)."""
        q = np.asarray(pin.neutral(self.model), dtype=np.float64)
        q.flags.writeable = False
        return q

    @cached_property
    def generic(self) -> Array:
        """A few configurations in no special position (4, nq): what does not move at them never does."""
        draws = np.random.default_rng(0).uniform(-1.0, 1.0, (N_DRAWS, self.space.nv))
        return self.space.integrate(np.tile(self.neutral, (N_DRAWS, 1)), draws)

    @cached_property
    def moved_by(self) -> NDArray[np.bool_]:
        """Which entries of v move which points (P, nv): not those whose axis always goes through the point."""
        jacobians = self.place(self.generic, np.arange(self.space.nv)).jacobians
        return np.asarray((np.abs(jacobians) > MOVING_RATE).any(axis=(0, 2)))

    def positions(self, q: Array) -> Array:
        """Place the points.

        Parameters
        ----------
        q : array (N, nq)
            Configurations in Pinocchio's order.

        Returns
        -------
        array (N, P, 3)
            Metres, world.

        Raises
        ------
        InputError
            See `ConfigurationSpace.check`.
        """
        self.space.check(q)
        out = np.empty((len(q), len(self.points), 3))
        for start in range(0, len(q), BLOCK_CONFIGURATIONS):
            rows = slice(start, start + BLOCK_CONFIGURATIONS)
            out[rows] = self._means(self._place(*self._chain.place(q[rows]))).transpose(2, 0, 1)
        return out

    def placed(self, q: Array) -> PlacedPoints:
        r"""Place the points and differentiate them.

        A turning joint with world axis a through o moves a point p by :math:`a \times (p - o)`, a sliding one
        by a; a mean of sites moves by the mean.

        Parameters
        ----------
        q : array (N, nq)
            Configurations in Pinocchio's order.

        Returns
        -------
        PlacedPoints

        Raises
        ------
        InputError
            See `ConfigurationSpace.check`.
        """
        self.space.check(q)
        return self.place(q, np.arange(self.space.nv))

    def place(self, q: Array, columns: NDArray[np.intp]) -> PlacedPoints:
        """Do what `placed` does for some entries of v alone, on configurations that are known to be sound."""
        n, width = len(q), len(self.points)
        positions = np.empty((n, width, 3))
        jacobians = np.zeros((n, width * 3 * len(columns)))
        levers = self._levers(columns)
        for start in range(0, n, BLOCK_CONFIGURATIONS):
            rows = slice(start, start + BLOCK_CONFIGURATIONS)
            rotation, origin = self._chain.place(q[rows])
            sites = self._place(rotation, origin)
            positions[rows] = self._means(sites).transpose(2, 0, 1)
            block = jacobians[rows]
            for index, entries in self._entries(rotation, origin, sites, levers):
                block[:, index] = entries.T
        return PlacedPoints(positions, jacobians.reshape(n, width, 3, len(columns)))

    def joint_placements(self, q: Array, joint: int) -> tuple[Array, Array]:
        """Return the rotations (N, 3, 3) and origins (N, 3) of a joint that leads to a point; 0 is the world."""
        rotation, origin = np.empty((len(q), 3, 3)), np.empty((len(q), 3))
        for start in range(0, len(q), BLOCK_CONFIGURATIONS):
            rows = slice(start, start + BLOCK_CONFIGURATIONS)
            R, o = self._chain.place(q[rows])
            rotation[rows], origin[rows] = R[joint].transpose(2, 0, 1), o[joint].T
        return rotation, origin

    def _entries(
        self, rotation: Array, origin: Array, sites: Array, levers: _Levers
    ) -> Iterator[tuple[NDArray[np.intp], Array]]:
        """Yield where the Jacobian's entries go (K,) and what they are (K, N)."""
        chain = self._chain
        axis = matrix_vector(rotation[chain.dof_joint], chain.dof_axis[:, :, None])
        if levers.turn.size:
            arm = np.einsum("ls,sin->lin", levers.shares, sites) if levers.mixed else sites[levers.first]
            a = axis[levers.turn]
            o = origin[chain.dof_joint[levers.turn]]
            p = arm[levers.lever] - (o * levers.total[levers.lever][:, None, None] if levers.mixed else o)
            for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
                yield levers.turn_at + i * levers.stride, a[:, j] * p[:, k] - a[:, k] * p[:, j]
        if levers.slide.size:
            a = axis[levers.slide] * levers.total[levers.slide_lever][:, None, None]
            for i in range(3):
                yield levers.slide_at + i * levers.stride, a[:, i]

    def _place(self, rotation: Array, origin: Array) -> Array:
        """Return the sites' positions (S, 3, N)."""
        sites = self._sites
        return origin[sites.joint] + matrix_vector(rotation[sites.joint], sites.offset[:, :, None])

    def _means(self, sites: Array) -> Array:
        """Return the points' positions (P, 3, N)."""
        if self._sites.single:
            return sites
        return np.asarray(np.einsum("ps,sin->pin", self._sites.weights, sites))

    @cached_property
    def _chain(self) -> JointChain:
        chain = JointChain(self.model, self._sites.joint, self.carrier)
        for site, joint in zip(
            (site for point in self.points for site in point.sites), self._sites.joint, strict=True
        ):
            if int(joint) not in chain.beyond:
                raise InputError(
                    f"model {self.model.name!r}: frame {site.frame!r} is not beyond joint "
                    f"{self.model.names[self.carrier]!r}; expected a frame on a body that this joint carries"
                )
        return chain

    @cached_property
    def _sites(self) -> _Sites:
        """Read the points' sites; every frame's name is looked up here, as Pinocchio crashes on unknown ones."""
        frames = frame_index(self.model)
        point, joint, offset, weight = [], [], [], []
        for index, body_point in enumerate(self.points):
            where = f"model {self.model.name!r}: point {body_point.name!r}"
            if not body_point.sites:
                raise InputError(f"{where} has no frame; expected at least one")
            for site in body_point.sites:
                frame = self.model.frames[find_frame(frames, site.frame, where)]
                place = np.asarray(site.offset, dtype=np.float64)
                if place.shape != (3,) or not np.isfinite(place).all():
                    raise InputError(f"{where}: offset {site.offset}; expected three finite numbers, metres")
                if not 0 < site.weight < np.inf:
                    raise InputError(f"{where}: weight {site.weight:g}; expected positive and finite")
                point.append(index)
                joint.append(frame.parentJoint)
                offset.append(frame.placement.rotation @ place + frame.placement.translation)
                weight.append(site.weight)
        weights = np.zeros((len(self.points), len(point)))
        weights[point, np.arange(len(point))] = weight
        weights /= weights.sum(axis=1, keepdims=True)
        single = len(point) == len(self.points)
        return _Sites(np.array(joint), np.array(offset), weights, single)

    @cached_property
    def _lever_cache(self) -> dict[bytes, _Levers]:
        return {}

    def _levers(self, columns: NDArray[np.intp]) -> _Levers:
        """Pair the entries of v with what they carry of each point: all of it, or some sites of a mean."""
        key = columns.tobytes()
        if key not in self._lever_cache:
            self._lever_cache[key] = self._make_levers(columns)
        return self._lever_cache[key]

    def _make_levers(self, columns: NDArray[np.intp]) -> _Levers:
        sites, chain = self._sites, self._chain
        carried = chain.supports[sites.joint]
        shares: list[Array] = []
        known: dict[tuple[int, bytes], int] = {}
        turn: list[tuple[int, int, int]] = []
        slide: list[tuple[int, int, int]] = []
        for point in range(len(self.points)):
            for place, v in enumerate(columns):
                share = np.where(carried[:, v], sites.weights[point], 0.0)
                if not share.any():
                    continue
                lever = known.setdefault((point, share.tobytes()), len(shares))
                if lever == len(shares):
                    shares.append(share)
                at = point * 3 * len(columns) + place
                (turn if chain.dof_turns[v] else slide).append((lever, int(v), at))
        table = np.array(shares).reshape(len(shares), len(sites.joint))
        turns = np.array(turn, dtype=np.intp).reshape(-1, 3)
        slides = np.array(slide, dtype=np.intp).reshape(-1, 3)
        return _Levers(
            shares=table,
            first=np.argmax(table > 0, axis=1) if len(table) else np.zeros(0, dtype=np.intp),
            mixed=not sites.single,
            total=table.sum(axis=1),
            lever=turns[:, 0],
            turn=turns[:, 1],
            turn_at=turns[:, 2],
            slide_lever=slides[:, 0],
            slide=slides[:, 1],
            slide_at=slides[:, 2],
            stride=len(columns),
        )


class _Sites(NamedTuple):
    """S sites: their joints, their places in the joints' frames, their weights (P, S) in the points."""

    joint: NDArray[np.intp]
    offset: Array
    weights: Array
    single: bool


class _Levers(NamedTuple):
    """What the Jacobian's entries are made of.

    A lever is a point's sites that one joint carries, by their weights `shares` (L, S), which add up to `total`;
    where every point has one site (not `mixed`), it is that one, `first`. Each entry of v (`turn`, `slide`) that
    moves a lever (`lever`, `slide_lever`) fills three entries of the flat Jacobian, from `turn_at` or `slide_at`
    in steps of `stride`.
    """

    shares: Array
    first: NDArray[np.intp]
    mixed: bool
    total: Array
    lever: NDArray[np.intp]
    turn: NDArray[np.intp]
    turn_at: NDArray[np.intp]
    slide_lever: NDArray[np.intp]
    slide: NDArray[np.intp]
    slide_at: NDArray[np.intp]
    stride: int
