"""Positions and Jacobians of points of a Pinocchio model, for a batch of configurations, in NumPy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.errors import InputError
from posekit.robot.configuration_space import ConfigurationSpace

ROWS = 256
"""Configurations worked on at once: their rotations and Jacobians stay in the processor's cache."""


MOVES = 1e-9
"""Metres per radian, or per metre, below which a joint does not move a point."""


@dataclass(frozen=True, kw_only=True)
class Site:
    """A place on a body: a frame's origin, or an offset in that frame.

    Parameters
    ----------
    frame : str
        A link, a joint or another frame of the model.
    offset : tuple of 3 float
        Metres, in the frame.
    weight : float
        Its share in a mean of several sites, relative to the others'.
    """

    frame: str
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    weight: float = 1.0


@dataclass(frozen=True, kw_only=True)
class BodyPoint:
    """A named point of a model: one site, or the weighted mean of several."""

    name: str
    sites: tuple[Site, ...]


class Placed(NamedTuple):
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

    Only joints that move a point are computed. Equal to Pinocchio's `framesForwardKinematics` and
    `getFrameJacobian(…, LOCAL_WORLD_ALIGNED)` up to rounding, at a fraction of the time for a batch.

    Parameters
    ----------
    model : pinocchio.Model
        See `ConfigurationSpace` for the joints it may have.
    points : sequence of BodyPoint
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
        _ = self._sites

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
    def moved_by(self) -> NDArray[np.bool_]:
        """Which entries of v move which points (P, nv): not those whose axis always goes through the point."""
        draws = np.random.default_rng(0).uniform(-1.0, 1.0, (4, self.space.nv))
        q = self.space.integrate(np.tile(pin.neutral(self.model), (4, 1)), draws)
        jacobians = self.place(q, np.arange(self.space.nv)).jacobians
        return np.asarray((np.abs(jacobians) > MOVES).any(axis=(0, 2)))

    def positions(self, q: Array) -> Array:
        """Place the points.

        Parameters
        ----------
        q : array (N, nq)

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
        for start in range(0, len(q), ROWS):
            rotation, origin = self._joints(q[start : start + ROWS])
            out[start : start + ROWS] = self._means(self._place(rotation, origin)).transpose(2, 0, 1)
        return out

    def placed(self, q: Array) -> Placed:
        r"""Place the points and differentiate them.

        A turning joint with world axis a through o moves a point p by :math:`a \times (p - o)`, a sliding one
        by a; a mean of sites moves by the mean.

        Parameters
        ----------
        q : array (N, nq)

        Returns
        -------
        Placed

        Raises
        ------
        InputError
            See `ConfigurationSpace.check`.
        """
        self.space.check(q)
        return self.place(q, np.arange(self.space.nv))

    def place(self, q: Array, columns: NDArray[np.intp]) -> Placed:
        """Do what `placed` does for some entries of v alone, on configurations that are known to be sound."""
        n, width = len(q), len(self.points)
        positions = np.empty((n, width, 3))
        jacobians = np.zeros((n, width * 3 * len(columns)))
        levers = self._levers(columns)
        for start in range(0, n, ROWS):
            rows = slice(start, start + ROWS)
            rotation, origin = self._joints(q[rows])
            sites = self._place(rotation, origin)
            positions[rows] = self._means(sites).transpose(2, 0, 1)
            block = jacobians[rows]
            for index, entries in self._entries(rotation, origin, sites, levers):
                block[:, index] = entries.T
        return Placed(positions, jacobians.reshape(n, width, 3, len(columns)))

    def joint_placements(self, q: Array, joint: int) -> tuple[Array, Array]:
        """Return the world rotations (N, 3, 3) and origins (N, 3) of a joint that carries a point; 0 is the world."""
        rotation, origin = np.empty((len(q), 3, 3)), np.empty((len(q), 3))
        for start in range(0, len(q), ROWS):
            rows = slice(start, start + ROWS)
            R, o = self._joints(q[rows])
            rotation[rows], origin[rows] = R[joint].transpose(2, 0, 1), o[joint].T
        return rotation, origin

    def _entries(
        self, rotation: Array, origin: Array, sites: Array, levers: _Levers
    ) -> list[tuple[NDArray[np.intp], Array]]:
        """Return where the Jacobian's entries go (K,) and what they are (K, N)."""
        axis = _turn(rotation[self._dofs.joint], self._dofs.axis[:, :, None])
        entries: list[tuple[NDArray[np.intp], Array]] = []
        if levers.turn.size:
            arm = np.einsum("ls,sin->lin", levers.shares, sites) if levers.mixed else sites[levers.first]
            a = axis[levers.turn]
            p = arm[levers.lever]
            total = levers.total[levers.lever]
            o = origin[self._dofs.joint[levers.turn]]
            p = p - (o if (total == 1).all() else o * total[:, None, None])
            for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
                entries.append((levers.turn_at + i * levers.stride, a[:, j] * p[:, k] - a[:, k] * p[:, j]))
        if levers.slide.size:
            a = axis[levers.slide] * levers.total[levers.slide_lever][:, None, None]
            entries += [(levers.slide_at + i * levers.stride, a[:, i]) for i in range(3)]
        return entries

    def _joints(self, q: Array) -> tuple[Array, Array]:
        """Return the joints' world rotations (J, 3, 3, N) and origins (J, 3, N)."""
        chain = self._chain
        n = len(q)
        rotation = np.zeros((self.model.njoints, 3, 3, n))
        origin = np.zeros((self.model.njoints, 3, n))
        rotation[self.carrier] = np.eye(3)[:, :, None]
        columns = np.ascontiguousarray(q.T)
        for level in chain.levels:
            parents = chain.parents[level.joints]
            local = np.broadcast_to(chain.rotation[level.joints][..., None], (len(level.joints), 3, 3, n))
            shift = np.broadcast_to(chain.translation[level.joints][..., None], (len(level.joints), 3, n))
            if level.turning.size:
                cos, sin = self._cos_sin(columns, level.joints[level.turning])
                local = local.copy()
                joints = level.joints[level.turning]
                local[level.turning] = (
                    chain.constant[joints][..., None]
                    + chain.sine[joints][..., None] * sin[:, None, None]
                    + chain.cosine[joints][..., None] * cos[:, None, None]
                )
            if level.sliding.size:
                joints = level.joints[level.sliding]
                shift = shift.copy()
                shift[level.sliding] += chain.slide[joints][..., None] * columns[chain.at[joints]][:, None]
            if level.flying.size:
                local, shift = local.copy(), shift.copy()
                for place in level.flying:
                    joint = level.joints[place]
                    at = chain.at[joint]
                    moved = _turn(chain.rotation[joint][None, ..., None], columns[at : at + 3][None])[0]
                    shift[place] += moved
                    local[place] = _matrix_product(
                        chain.rotation[joint][None, ..., None], _rotation(columns[at + 3 : at + 7])[None]
                    )[0]
            rotation[level.joints] = _matrix_product(rotation[parents], local)
            origin[level.joints] = origin[parents] + _turn(rotation[parents], shift)
        return rotation, origin

    def _cos_sin(self, columns: Array, joints: NDArray[np.intp]) -> tuple[Array, Array]:
        chain = self._chain
        at, continuous = chain.at[joints], chain.continuous[joints]
        if not continuous.any():
            return np.cos(columns[at]), np.sin(columns[at])
        cos, sin = columns[at], columns[np.where(continuous, at + 1, at)]
        keep = continuous[:, None]
        return np.where(keep, cos, np.cos(cos)), np.where(keep, sin, np.sin(sin))

    def _place(self, rotation: Array, origin: Array) -> Array:
        """Return the sites' world positions (S, 3, N)."""
        sites = self._sites
        return origin[sites.joint] + _turn(rotation[sites.joint], sites.offset[:, :, None])

    def _means(self, sites: Array) -> Array:
        """Return the points' positions (P, 3, N)."""
        if self._sites.single:
            return sites
        return np.asarray(np.einsum("ps,sin->pin", self._sites.weights, sites))

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
                if frame.parentJoint not in self._beyond:
                    raise InputError(
                        f"{where}: frame {site.frame!r} is not beyond joint {self.model.names[self.carrier]!r}; "
                        "expected a frame on a body that this joint carries"
                    )
                point.append(index)
                joint.append(frame.parentJoint)
                offset.append(frame.placement.rotation @ place + frame.placement.translation)
                weight.append(site.weight)
        weights = np.zeros((len(self.points), len(point)))
        weights[point, np.arange(len(point))] = weight
        weights /= weights.sum(axis=1, keepdims=True)
        return _Sites(
            point=np.array(point),
            joint=np.array(joint),
            offset=np.array(offset),
            weights=weights,
            single=len(point) == len(self.points),
        )

    @cached_property
    def _supports(self) -> NDArray[np.bool_]:
        """Which entries of v move which joint's body (njoints, nv)."""
        supports = np.zeros((self.model.njoints, self.space.nv), dtype=np.bool_)
        for joint in self._beyond[1:]:
            supports[joint] = supports[self.model.parents[joint]]
            first = self.model.idx_vs[joint]
            supports[joint, first : first + self.model.nvs[joint]] = True
        return supports

    @cached_property
    def _beyond(self) -> list[int]:
        """List the carrier and the joints beyond it, parents first."""
        beyond = [self.carrier]
        for joint in range(self.carrier + 1, self.model.njoints):
            if self.model.parents[joint] in beyond:
                beyond.append(joint)
        return beyond

    @cached_property
    def _dofs(self) -> _Dofs:
        """Read the axis of every entry of v in its joint's frame."""
        joint = np.zeros(self.space.nv, dtype=np.intp)
        axis = np.zeros((self.space.nv, 3))
        turning = np.zeros(self.space.nv, dtype=np.bool_)
        for index in range(1, self.model.njoints):
            first, count = self.model.idx_vs[index], self.model.nvs[index]
            joint[first : first + count] = index
            if count == 6:
                axis[first : first + 6] = np.tile(np.eye(3), (2, 1))
                turning[first + 3 : first + 6] = True
            else:
                axis[first], turning[first] = _axis(self.model, index)
        return _Dofs(joint=joint, axis=axis, turning=turning)

    @cached_property
    def _chain(self) -> _Chain:
        """Read the constants of the joints that carry a point, level by level from the root."""
        model, count = self.model, self.model.njoints
        needed = {self.carrier}
        for joint in self._sites.joint:
            j = int(joint)
            while j not in needed:
                needed.add(j)
                j = model.parents[j]
        depth = np.zeros(count, dtype=np.intp)
        for joint in self._beyond[1:]:
            depth[joint] = depth[model.parents[joint]] + 1
        rotation = np.array([model.jointPlacements[j].rotation for j in range(count)])
        translation = np.array([model.jointPlacements[j].translation for j in range(count)])
        constant, sine, cosine = np.zeros((3, count, 3, 3))
        slide = np.zeros((count, 3))
        turning, sliding, flying = np.zeros((3, count), dtype=np.bool_)
        for joint in range(1, count):
            if model.nvs[joint] == 6:
                flying[joint] = True
                continue
            axis, turns = _axis(model, joint)
            if turns:
                # Rodrigues: R = aa' + sin [a] + cos (1 - aa'), after the joint's placement.
                turning[joint] = True
                skew = np.cross(np.eye(3), axis)
                outer = np.outer(axis, axis)
                constant[joint] = rotation[joint] @ outer
                sine[joint] = rotation[joint] @ skew
                cosine[joint] = rotation[joint] @ (np.eye(3) - outer)
            else:
                sliding[joint] = True
                slide[joint] = rotation[joint] @ axis
        levels = []
        for d in range(1, int(depth.max(initial=0)) + 1):
            joints = np.array([j for j in self._beyond if depth[j] == d and j in needed], dtype=np.intp)
            if joints.size:
                levels.append(
                    _Level(
                        joints=joints,
                        turning=np.flatnonzero(turning[joints]),
                        sliding=np.flatnonzero(sliding[joints]),
                        flying=np.flatnonzero(flying[joints]),
                    )
                )
        return _Chain(
            parents=np.array([model.parents[j] for j in range(count)]),
            rotation=rotation,
            translation=translation,
            constant=constant,
            sine=sine,
            cosine=cosine,
            slide=slide,
            at=np.array([model.idx_qs[j] for j in range(count)]),
            continuous=np.array([model.nqs[j] == 2 for j in range(count)]),
            levels=tuple(levels),
        )

    def _levers(self, columns: NDArray[np.intp]) -> _Levers:
        """Pair the entries of v with what they carry of each point: all of it, or some sites of a mean."""
        key = columns.tobytes()
        cache = self._lever_cache
        if key not in cache:
            if len(cache) > 8:
                cache.clear()
            cache[key] = self._make_levers(columns)
        return cache[key]

    @cached_property
    def _lever_cache(self) -> dict[bytes, _Levers]:
        return {}

    def _make_levers(self, columns: NDArray[np.intp]) -> _Levers:
        sites, dofs = self._sites, self._dofs
        carried = self._supports[sites.joint]
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
                (turn if dofs.turning[v] else slide).append((lever, int(v), at))
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


def frame_index(model: pin.Model) -> dict[str, int]:
    """Return the frames by name; where a link and a joint share a name, the link."""
    index: dict[str, int] = {}
    for k in range(1, model.nframes):
        frame = model.frames[k]
        if frame.name not in index or frame.type == pin.FrameType.BODY:
            index[frame.name] = k
    return index


def find_frame(frames: dict[str, int], name: str, where: str) -> int:
    """Return a frame's index.

    Raises
    ------
    InputError
        Where there is no such frame; the nearest names are listed.
    """
    if name not in frames:
        near = get_close_matches(name, frames, n=3, cutoff=0.4) or list(frames)[:3]
        raise InputError(f"{where}: the model has no frame {name!r}; the nearest are {', '.join(near)}")
    return frames[name]


def body_points(frames: Sequence[str]) -> tuple[BodyPoint, ...]:
    """Make a point of each frame, named after it."""
    return tuple(BodyPoint(name=name, sites=(Site(frame=name),)) for name in frames)


class _Sites(NamedTuple):
    point: NDArray[np.intp]
    joint: NDArray[np.intp]
    offset: Array
    weights: Array
    single: bool


class _Dofs(NamedTuple):
    joint: NDArray[np.intp]
    axis: Array
    turning: NDArray[np.bool_]


class _Level(NamedTuple):
    joints: NDArray[np.intp]
    turning: NDArray[np.intp]
    sliding: NDArray[np.intp]
    flying: NDArray[np.intp]


class _Chain(NamedTuple):
    parents: NDArray[np.intp]
    rotation: Array
    translation: Array
    constant: Array
    sine: Array
    cosine: Array
    slide: Array
    at: NDArray[np.intp]
    continuous: NDArray[np.bool_]
    levels: tuple[_Level, ...]


class _Levers(NamedTuple):
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


def _axis(model: pin.Model, joint: int) -> tuple[Array, bool]:
    """Return a joint's axis in its own frame, and whether it turns about it (or slides along it)."""
    data = model.joints[joint].createData()
    q = np.zeros(model.nqs[joint])
    q[0] = float(model.nqs[joint] == 2)
    model.joints[joint].calc(data, q)
    column = np.asarray(data.S).reshape(6)
    turns = bool(np.abs(column[3:]).any())
    return (column[3:] if turns else column[:3]).copy(), turns


def _turn(rotation: Array, vector: Array) -> Array:
    """Rotate vectors (K, 3, N) by matrices (K, 3, 3, N)."""
    return np.asarray(
        rotation[:, :, 0] * vector[:, None, 0]
        + rotation[:, :, 1] * vector[:, None, 1]
        + rotation[:, :, 2] * vector[:, None, 2]
    )


def _matrix_product(a: Array, b: Array) -> Array:
    """Multiply matrices (K, 3, 3, N): the batch is last, so that every operation runs along it."""
    return np.asarray(
        a[:, :, 0, None] * b[:, None, 0] + a[:, :, 1, None] * b[:, None, 1] + a[:, :, 2, None] * b[:, None, 2]
    )


def _rotation(quaternion: Array) -> Array:
    """Turn unit quaternions (4, N), order x, y, z, w, into matrices (3, 3, N)."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
