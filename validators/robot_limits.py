"""Limits of any robot's joints, judged from where its points are: what no configuration can place is rejected.

Necessary conditions alone: distances and signed volumes of a few points must be attainable within the limits (see
`posekit.validators.attainable`). A posture that passes them all may still have no configuration; one that has a
configuration passes them all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, cross
from posekit.linkages.robot_linkage import Carried
from posekit.robots import Robot
from posekit.tree import Check, Findings, Place
from posekit.validators.attainable import MAX_JOINTS, Attainable, six_volumes
from posekit.validators.axis_points import AxisPoint, find_axis_points, place_axis_point

AT_ONCE = 8
"""Volumes that one check asks, those with the narrowest intervals: more of one joint say the same again."""

MAX_RANGE_PART = 0.999
"""Of the whole range: an interval that is wider says nothing."""

FLAT_PART = 1e-6
"""Of the extent squared: three points with less area between them are on one line."""

Looseness = Callable[[Sequence[int]], float]

MOST_VOLUMES = 2
"""The most joints between four points whose volume is bounded."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Interval:
    """The attainable interval of one invariant.

    Parameters
    ----------
    joints : tuple of str
        The joints between the points; none inside a rigid body.
    points : tuple of int
        Two points, for their distance, or four, for their signed volume.
    lower, upper : float
        Metres; of a volume, six times its size over `length` squared.
    length : float
        The way between the points of a volume at its longest, metres; 1 of a distance.
    share : float
        Width of the interval relative to the widest that there could be.
    """

    joints: tuple[str, ...]
    points: tuple[int, ...]
    lower: float
    upper: float
    length: float
    share: float


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotLimits:
    """What the limits of a robot's joints say about some of its points.

    Parameters
    ----------
    robot : Robot
        The robot that is judged, as it was loaded.
    names : tuple of str
        Frames of the robot: the points of its linkage (`posekit.linkages.robot_linkage.linkage_of`).

    Raises
    ------
    InputError
        Where a name is no frame of the robot.

    Examples
    --------
    >>> from posekit.robots import load_robot
    >>> limits = RobotLimits(robot=load_robot("panda", geometry=False), names=("panda_joint3", "panda_joint5"))
    >>> [interval] = limits.distances
    >>> interval.joints, round(interval.lower, 3), round(interval.upper, 3)
    (('panda_joint4',), 0.39, 0.475)
    """

    robot: Robot
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        _ = self.axis_points

    @cached_property
    def axis_points(self) -> tuple[AxisPoint, ...]:
        """Points on axes that rigid bodies place: numbered after the robot's own."""
        return find_axis_points(Carried(model=self.robot.model, names=self.names))

    @cached_property
    def distances(self) -> tuple[Interval, ...]:
        """Distances with one to three joints between, where the interval is narrower than rigid lengths make it.

        Between points on axes, inside a rigid body too.
        """
        attainable, found = self._attainable, []
        for joints, pairs in self._by_joints(2, range(MAX_JOINTS + 1), self._count).items():
            low, high = attainable.distances(joints, pairs)
            for pair, lower, upper in zip(pairs.tolist(), low.tolist(), high.tolist(), strict=True):
                if not joints and max(pair) < len(self.names):
                    continue  # a segment, or a chord, of the linkage itself
                least, most = self._implied(*pair)
                share = (min(upper, most) - max(lower, least)) / max(most - least, 1e-12)
                if share < MAX_RANGE_PART:
                    found.append(self._interval(joints, pair, lower, upper, 1.0, share))
        return tuple(found)

    @cached_property
    def volumes(self) -> tuple[Interval, ...]:
        """Signed volumes with up to two joints between: they tell a posture from its mirror image."""
        attainable, found = self._attainable, []
        for joints, quads in self._by_joints(4, range(MOST_VOLUMES + 1), len(self.names)).items():
            solid = quads[~self._flat(quads)]
            if not len(solid):
                continue
            low, high = attainable.volumes(joints, solid)
            free = attainable.free(joints, solid)
            length = attainable.extent(solid)
            for quad, lower, upper, size in zip(
                solid.tolist(), low.tolist(), high.tolist(), free.tolist(), strict=True
            ):
                # Volumes that are always nothing (planar fingers) say as much as those with one sign.
                widest = max(size, 1e-3 * length**3)
                share = (min(upper, widest) - max(lower, -widest)) / (2 * widest)
                if share < MAX_RANGE_PART:
                    found.append(
                        self._interval(joints, quad, lower / length**2, upper / length**2, length, share)
                    )
        return tuple(found)

    def checks(self, order: Sequence[str], *, tolerance: float | Looseness) -> list[Check]:
        """Make the checks that prune a tree over the points.

        Parameters
        ----------
        order : sequence of str
            Joints of the tree; those that are none of the points are passed over.
        tolerance : float or callable
            Metres by which a point may be off; or what returns that for some joints of the tree, given together.
        """
        place = {self.names.index(name): at for at, name in enumerate(order) if name in self.names}
        groups: dict[tuple[int, tuple[str, ...]], list[Interval]] = {}
        for kind in (self.distances, self.volumes):
            fresh: dict[tuple[int, tuple[str, ...]], list[Interval]] = {}
            for interval in kind:
                needed = self._needed(interval.points)
                if all(point in place for point in needed if point < len(self.names)):
                    level = max(place[point] for point in needed if point < len(self.names))
                    fresh.setdefault((level, interval.joints), []).append(interval)
            for key, intervals in fresh.items():
                best = sorted(intervals, key=lambda interval: interval.share)
                groups.setdefault(key, []).extend(best[:AT_ONCE])
        return [
            self._check(intervals, joints, place, tolerance)
            for (_, joints), intervals in sorted(
                groups.items(), key=lambda item: (item[0][0], len(item[0][1]))
            )
        ]

    def _check(
        self,
        intervals: Sequence[Interval],
        joints: tuple[str, ...],
        place: Mapping[int, int],
        tolerance: float | Looseness,
    ) -> WithinIntervals:
        """Put intervals of one level and the same joints into one check."""
        needed = self._needed([point for interval in intervals for point in interval.points])
        column = {point: k for k, point in enumerate(needed)}
        shown = [point for point in needed if point < len(self.names)]
        looseness = [
            1.0 if point < len(self.names) else self.axis_points[point - len(self.names)].looseness
            for point in needed
        ]

        def allowed(interval: Interval) -> float:
            joints = [place[point] for point in self._needed(interval.points) if point < len(self.names)]
            off = tolerance(joints) if callable(tolerance) else tolerance
            return off * sum(looseness[column[point]] for point in interval.points)

        return WithinIntervals(
            name="robot_limits" if joints else "rigid_body",
            places=tuple(
                Place(name="+".join(joints) or self._body(interval.points)) for interval in intervals
            ),
            points=tuple(place[point] for point in shown),
            axis_points=tuple(
                point.among(column)
                for point in (self.axis_points[k - len(self.names)] for k in needed[len(shown) :])
            ),
            intervals=tuple(intervals),
            columns=tuple(tuple(column[point] for point in interval.points) for interval in intervals),
            tolerance=np.array([allowed(interval) for interval in intervals]),
        )

    def _needed(self, points: Sequence[int]) -> list[int]:
        """Return the points, and those that place the ones on axes among them, in order."""
        needed: set[int] = set()
        waiting = list(points)
        while waiting:
            point = waiting.pop()
            if point not in needed:
                needed.add(point)
                if point >= len(self.names):
                    waiting.extend(self.axis_points[point - len(self.names)].corners)
        return sorted(needed)

    @property
    def _count(self) -> int:
        return len(self.names) + len(self.axis_points)

    @cached_property
    def _attainable(self) -> Attainable:
        extra = tuple((point.body, point.place) for point in self.axis_points)
        return Attainable(robot=self.robot, names=self.names, extra=extra)

    @cached_property
    def _samples(self) -> Array:
        """The points in some configurations (N, P, 3) that lie anywhere within one turn."""
        attainable = self._attainable
        joints = tuple(attainable.ranges)
        rng = np.random.default_rng(0)
        values = np.stack([rng.uniform(-1.5, 1.5, 8) for _ in joints], axis=-1)
        return attainable.kinematics.positions(attainable.configurations(joints, values))

    def _by_joints(
        self, size: int, counts: Iterable[int], number_of_points: int
    ) -> dict[tuple[int, ...], NDArray[np.intp]]:
        """Return all groups of so many points by the joints between them, where their number is asked for."""
        moved, left = self._attainable.carried.sides
        groups = np.array(list(combinations(range(number_of_points), size)), dtype=np.intp).reshape(-1, size)
        between = np.asarray(moved[:, groups].any(axis=2) & left[:, groups].any(axis=2))
        found: dict[tuple[int, ...], list[int]] = {}
        number = between.sum(axis=0)
        for k in np.flatnonzero(np.isin(number, list(counts))):
            found.setdefault(tuple(np.flatnonzero(between[:, k]).tolist()), []).append(int(k))
        return {joints: groups[rows] for joints, rows in found.items()}

    def _implied(self, a: int, b: int) -> tuple[float, float]:
        """Return what the triangles over rigid segments leave of a distance."""
        rigid = self._rigid
        sides = np.stack([rigid[a], rigid[b]])
        sides = sides[:, np.isfinite(sides).all(axis=0)]
        if not sides.size:
            return 0.0, float(self._attainable.extent(np.array([[a, b]])))
        return float(np.abs(sides[0] - sides[1]).max()), float(sides.sum(axis=0).min())

    @cached_property
    def _rigid(self) -> Array:
        """The distances inside rigid bodies (P, P); infinite between others."""
        carried = self._attainable.carried
        apart = np.linalg.norm(carried.place[:, :, None] - carried.place[:, None], axis=-1)
        return np.asarray(np.where(np.isfinite(apart), apart, np.inf).min(axis=0))

    def _flat(self, quads: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Return which quadruples (T,) have three points that are always on one line."""
        flat = np.zeros(len(quads), dtype=np.bool_)
        bound = FLAT_PART * self._attainable.extent(quads) ** 2
        for three in combinations(range(4), 3):
            a, b, c = (self._samples[:, quads[:, k]] for k in three)
            area = np.linalg.norm(cross(b - a, c - a), axis=-1).max(axis=0)
            flat |= area < bound
        return flat

    def _interval(
        self,
        joints: tuple[int, ...],
        points: Sequence[int],
        lower: float,
        upper: float,
        length: float,
        share: float,
    ) -> Interval:
        names = tuple(str(self.robot.model.names[joint]) for joint in joints)
        return Interval(
            joints=names, points=tuple(points), lower=lower, upper=upper, length=length, share=share
        )

    def _body(self, points: Sequence[int]) -> str:
        """Name the rigid body that carries some points: by its joint, or the base by its first point."""
        carried = self._attainable.carried
        bodies = np.flatnonzero(carried.on[:, list(points)].all(axis=1))
        fixed = not len(bodies) or bodies[0] in (0, *carried.space.free)
        return self.names[points[0]] if fixed else str(self.robot.model.names[int(bodies[0])])


@dataclass(frozen=True, kw_only=True, eq=False)
class WithinIntervals(Check):
    """Distances and signed volumes against their attainable intervals.

    A point that is off by the tolerance changes a distance by as much, a volume by no more than the area of the
    opposite face; all points may be.
    """

    name: str
    places: tuple[Place, ...]
    points: tuple[int, ...]
    axis_points: tuple[AxisPoint, ...]
    intervals: tuple[Interval, ...]
    columns: tuple[tuple[int, ...], ...]
    tolerance: Array
    unit: str = "m"

    def judge(self, points: Array) -> Findings:
        """Compare with the intervals; see `posekit.tree.Check`."""
        for axis_point in self.axis_points:
            points = np.concatenate([points, place_axis_point(points, axis_point)[:, None]], axis=1)
        value = np.empty((len(points), len(self.intervals)))
        pairs, quads = self._split
        if len(pairs[0]):
            ends = points[:, pairs[1]]
            value[:, pairs[0]] = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=-1)
        if len(quads[0]):
            squared = np.array([self.intervals[k].length ** 2 for k in quads[0]])
            value[:, quads[0]] = six_volumes(points, quads[1]) / squared
        return Findings(
            value=value,
            lower=np.array([interval.lower for interval in self.intervals]),
            upper=np.array([interval.upper for interval in self.intervals]),
            tolerance=self.tolerance,
        )

    @cached_property
    def _split(self) -> tuple[tuple[NDArray[np.intp], NDArray[np.intp]], ...]:
        """The places of distances and of volumes, each with the columns of their points."""
        return tuple(
            (
                np.array(
                    [k for k, columns in enumerate(self.columns) if len(columns) == size], dtype=np.intp
                ),
                np.array(
                    [columns for columns in self.columns if len(columns) == size], dtype=np.intp
                ).reshape(-1, size),
            )
            for size in (2, 4)
        )
