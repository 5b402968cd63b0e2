"""What a robot's joints let distances and volumes be: intervals that hold every configuration within the limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.geometry import Array, cross
from posekit.linkages.robot_linkage import Carried
from posekit.robots import Robot
from posekit.robots.kinematics import BodyPoint, BodySite, Kinematics, body_points, frame_index

Groups = NDArray[np.intp]
Invariant = Callable[[Array, Groups], Array]
Second = Callable[[float, float], float]

MAX_JOINTS = 3
"""The most joints between two points whose distance is bounded; there are grids over all but one of them."""

GRID_POINTS = {1: 1, 2: 512, 3: 64}
"""Points of the grid for each joint but the last, by how many joints there are."""

THIRDS_OF_TURN = np.array([-2.0, 0.0, 2.0]) * np.pi / 3
"""Three angles that determine A + B cos q + C sin q."""

ROUNDING_PART = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class Attainable:
    r"""Bounds of distances and signed volumes of a robot's points over all configurations within the limits.

    Both are invariants of the camera's unknown placement. As a function of one turning joint either is
    :math:`A + B \cos q + C \sin q`, of one sliding joint a parabola: its range over the limits is exact. Of several
    joints the last is taken so, and the others run over a grid with their limits on it; between grid points the
    function can be larger by no more than :math:`\frac12 \sum_{ij} M_{ij} \delta_i \delta_j`, with half the spacing
    :math:`\delta` and a bound M of its second derivatives (at the maximum the first vanish, or the joint is at a
    limit, which is on the grid). So no configuration within the limits is ever outside.

    Parameters
    ----------
    robot : Robot
        The robot that is judged, as it was loaded.
    names : tuple of str
        Frames of the robot, not the same place twice.
    extra : tuple of (int, array (3,))
        Further points, as `Carried` has them.
    """

    robot: Robot
    names: tuple[str, ...]
    extra: tuple[tuple[int, Array], ...] = ()

    @cached_property
    def carried(self) -> Carried:
        """Which bodies carry which points."""
        return Carried(model=self.robot.model, names=self.names, extra=self.extra)

    @cached_property
    def ranges(self) -> dict[int, tuple[float, float]]:
        """The limits of each turning and sliding joint; one circle where there are none, or more than one."""
        model, space = self.robot.model, self.carried.space
        ranges = {joint: (-np.pi, np.pi) for joint in space.turns}
        for joint in (*space.hinges, *space.slides):
            at = model.idx_qs[joint]
            lower, upper = float(model.lowerPositionLimit[at]), float(model.upperPositionLimit[at])
            whole = joint in space.hinges and not upper - lower < 2 * np.pi
            ranges[joint] = (-np.pi, np.pi) if whole else (lower, upper)
        return ranges

    def distances(self, joints: tuple[int, ...], pairs: Groups) -> tuple[Array, Array]:
        """Bound the distances of pairs of points (T, 2) between which there are some joints: (T,) each, metres."""
        E = self.extent(pairs)
        low, high = self._bounds(
            joints, pairs, _squared_distances, lambda i, j: 2 * i * j + 2 * E * max(i, j), E
        )
        low, high = np.maximum(low * (1 - ROUNDING_PART), 0.0), np.maximum(high * (1 + ROUNDING_PART), 0.0)
        return np.sqrt(low), np.sqrt(high)

    def volumes(self, joints: tuple[int, ...], quads: Groups) -> tuple[Array, Array]:
        """Bound six times the signed volumes of four points each (T, 4): (T,) each, m^3."""
        E = self.extent(quads)
        low, high = self._bounds(
            joints, quads, six_volumes, lambda i, j: 6 * i * j * E + 3 * max(i, j) * E * E, E
        )
        rounding = ROUNDING_PART * E**3
        return low - rounding, high + rounding

    def free(self, joints: tuple[int, ...], quads: Groups) -> Array:
        """Return the largest volume (T,) that is found where turning joints have no limits."""
        rng = np.random.default_rng(0)
        columns = [rng.uniform(*self._unlimited(joint), 64) for joint in joints]
        q = self.configurations(joints, np.stack(columns, axis=-1) if joints else np.zeros((1, 0)))
        return np.asarray(np.abs(six_volumes(self.kinematics.positions(q), quads)).max(axis=0))

    @cached_property
    def kinematics(self) -> Kinematics:
        """Where the points are."""
        return Kinematics(model=self.robot.model, points=self._points)

    @cached_property
    def _points(self) -> tuple[BodyPoint, ...]:
        """The frames, and the further points as offsets from a frame of their body."""
        model = self.robot.model
        home: dict[int, str] = {}
        for name, index in frame_index(model).items():
            home.setdefault(model.frames[index].parentJoint, name)
        points = list(body_points(self.names))
        for k, (body, at) in enumerate(self.extra):
            frame = model.frames[frame_index(model)[home[body]]]
            x, y, z = frame.placement.actInv(at).tolist()
            points.append(
                BodyPoint(name=f"{k} on {home[body]}", sites=(BodySite(frame=home[body], offset=(x, y, z)),))
            )
        return tuple(points)

    def extent(self, groups: Groups) -> float:
        """Return a length (m) that no two points of a group, nor one and an axis between them, are further apart."""
        return max(self._way(int(a), int(b)) for group in groups for a in group for b in group if a < b)

    def _way(self, a: int, b: int) -> float:
        """Return the way from one point to another along the bodies between them, joints at their farthest."""
        model, carried = self.robot.model, self.carried
        here, there = (int(np.argmax(carried.on[:, point])) for point in (a, b))
        way = float(np.linalg.norm(carried.place[here, a]) + np.linalg.norm(carried.place[there, b]))
        apart = carried.beyond[:, here] != carried.beyond[:, there]
        for joint in np.flatnonzero(apart):
            way += float(np.linalg.norm(model.jointPlacements[int(joint)].translation))
            if joint in carried.space.slides:
                way += max(abs(limit) for limit in self.ranges[int(joint)])
        return way

    def _unlimited(self, joint: int) -> tuple[float, float]:
        return self.ranges[joint] if joint in self.carried.space.slides else (-np.pi, np.pi)

    def configurations(self, joints: tuple[int, ...], values: Array) -> Array:
        """Return configurations (N, nq) that are neutral but for some joints' values (N, k)."""
        model = self.robot.model
        q = np.tile(pin.neutral(model), (len(values), 1))
        for column, joint in enumerate(joints):
            at = model.idx_qs[joint]
            if joint in self.carried.space.turns:
                q[:, at], q[:, at + 1] = np.cos(values[:, column]), np.sin(values[:, column])
            else:
                q[:, at] = values[:, column]
        return q

    def _bounds(
        self, joints: tuple[int, ...], groups: Groups, invariant: Invariant, second: Second, E: float
    ) -> tuple[Array, Array]:
        """Bound an invariant (T,), from the exact range over the last joint on a grid over the others."""
        used, columns = np.unique(groups, return_inverse=True)
        columns = columns.reshape(groups.shape)
        kinematics = Kinematics(
            model=self.robot.model, points=tuple(self._points[int(point)] for point in used)
        )
        if not joints:
            value = invariant(kinematics.positions(self.configurations((), np.zeros((1, 0)))), columns)[0]
            return value, value
        if not all(np.isfinite(self.ranges[joint]).all() for joint in joints):
            unbounded = np.full(len(groups), np.inf)
            return -unbounded, unbounded
        *others, last = joints
        count = GRID_POINTS[len(joints)]
        axes = [np.linspace(*self.ranges[joint], count) for joint in others]
        grid = np.array(list(product(*axes)), dtype=np.float64).reshape(count ** len(others), len(others))
        slides = last in self.carried.space.slides
        knots = np.linspace(*self.ranges[last], 3) if slides else THIRDS_OF_TURN
        values = np.stack(
            [
                invariant(
                    kinematics.positions(
                        self.configurations(joints, np.column_stack([grid, np.full(len(grid), knot)]))
                    ),
                    columns,
                )
                for knot in knots
            ]
        )
        low, high = (_parabola if slides else _circle)(values, self.ranges[last])
        steps = [np.ptp(self.ranges[joint]) / (count - 1) / 2 for joint in others]
        levers = [1.0 if joint in self.carried.space.slides else E for joint in others]
        gap = 0.5 * sum(
            second(i, j) * a * b
            for i, a in zip(levers, steps, strict=True)
            for j, b in zip(levers, steps, strict=True)
        )
        return low.min(axis=0) - gap, high.max(axis=0) + gap


def _squared_distances(points: Array, pairs: Groups) -> Array:
    apart = points[:, pairs[:, 1]] - points[:, pairs[:, 0]]
    return np.asarray(np.einsum("nti,nti->nt", apart, apart))


def six_volumes(points: Array, quads: Groups) -> Array:
    """Return (b - a) x (c - a) . (d - a) of quadruples (T, 4) of points (N, P, 3): (N, T)."""
    a, b, c, d = (points[:, quads[:, k]] for k in range(4))
    return np.asarray(np.einsum("nti,nti->nt", cross(b - a, c - a), d - a))


def _circle(values: Array, limits: tuple[float, float]) -> tuple[Array, Array]:
    """Return the range (G, T) of A + B cos q + C sin q within limits, given at three angles (3, G, T)."""
    lower, upper = limits
    A = values.mean(axis=0)
    B, C = (2 / 3 * np.tensordot(wave(THIRDS_OF_TURN), values, axes=1) for wave in (np.cos, np.sin))
    amplitude, phase = np.hypot(B, C), np.arctan2(C, B)
    at_ends = [A + B * np.cos(q) + C * np.sin(q) for q in limits]
    low, high = np.minimum(*at_ends), np.maximum(*at_ends)
    for sign in (1, -1):
        crest = phase if sign > 0 else phase + np.pi
        within = lower + np.mod(crest - lower, 2 * np.pi) <= upper
        top = A + sign * amplitude
        low, high = (
            np.where(within, pick(end, top), end) for pick, end in ((np.minimum, low), (np.maximum, high))
        )
    return low, high


def _parabola(values: Array, limits: tuple[float, float]) -> tuple[Array, Array]:
    """Return the range (G, T) of a parabola within limits, given at both and halfway (3, G, T)."""
    start, middle, end = values
    bend, slope = start + end - 2 * middle, (end - start) / 2
    low, high = np.minimum(start, end), np.maximum(start, end)
    with np.errstate(divide="ignore", invalid="ignore"):
        place = -slope / bend
        top = middle - slope * slope / (2 * bend)
    within = np.abs(place) <= 1  # False where there is no bend
    return np.where(within, np.minimum(low, top), low), np.where(within, np.maximum(high, top), high)
