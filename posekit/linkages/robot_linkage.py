"""The linkage of a robot: its joints' origins as points, its rigid links as segments (Taylor 2000, section 2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.geometry import Array, cross
from posekit.linkages import Linkage
from posekit.robots.configuration_space import ConfigurationSpace
from posekit.robots.kinematics import find_frame, frame_index
from posekit.robots.robot import Robot
from posekit.safe_io import nearest, shown

ON_AXIS = 1e-9
"""Metres from a joint's axis up to which a point lies on it, and stays where it is when the joint turns."""

MIN_POINT_DISTANCE_METRES = 5e-3
"""Metres by which the end of a limb, or the base, must lie away from the joints to be a point of its own."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Carried:
    """Which bodies of a robot carry which points.

    A body is what moves with one joint of Pinocchio's, by the joint's index; links that are fixed to each other are
    one. A point on the axis of a turning joint is carried by the bodies on both sides of it: it keeps its place on
    either. So points of one body keep their distances in every configuration, and only they do.

    Parameters
    ----------
    model : pinocchio.Model
        The robot.
    names : tuple of str
        Frames of the model.
    extra : tuple of (int, array (3,))
        Further points, after those of the frames: a body and the place on it, metres.

    Raises
    ------
    InputError
        Where a frame is not in the model, or a joint is of a kind that is not known.
    """

    model: pin.Model
    names: tuple[str, ...]
    extra: tuple[tuple[int, Array], ...] = ()

    def __post_init__(self) -> None:
        _ = self.place

    @cached_property
    def space(self) -> ConfigurationSpace:
        """The joints by kind."""
        return ConfigurationSpace(self.model)

    @cached_property
    def place(self) -> Array:
        """Where each body carries each point (njoints, P, 3), metres, the body's frame; NaN where it does not."""
        frames = frame_index(self.model)
        count = len(self.names)
        place = np.full((self.model.njoints, count + len(self.extra), 3), np.nan)
        for column, name in enumerate(self.names):
            frame = self.model.frames[find_frame(frames, name, f"model {self.model.name!r}")]
            self.spread(place[:, column], frame.parentJoint, frame.placement.translation)
        for column, (body, at) in enumerate(self.extra, start=count):
            self.spread(place[:, column], body, at)
        place.flags.writeable = False
        return place

    def spread(self, place: Array, body: int, at: Array) -> None:
        """Enter a point of one body into `place` (njoints, 3), there and on all bodies that carry it too."""
        place[body] = at
        waiting = [body]
        while waiting:
            here = waiting.pop()
            for joint, axis in self.axes.items():
                parent, placement = self.model.parents[joint], self.model.jointPlacements[joint]
                if here == parent and np.isnan(place[joint, 0]):
                    moved = placement.actInv(place[here])
                    there = joint
                elif here == joint and np.isnan(place[parent, 0]):
                    moved, there = place[here], parent
                else:
                    continue
                if np.linalg.norm(cross(axis, moved)) <= ON_AXIS:
                    place[there] = placement.act(moved) if there == parent else moved
                    waiting.append(there)

    @cached_property
    def on(self) -> NDArray[np.bool_]:
        """Which body carries which point (njoints, P)."""
        return np.isfinite(self.place[..., 0])

    @cached_property
    def beyond(self) -> NDArray[np.bool_]:
        """Which bodies move with which joint (njoints, njoints): its own, and those further out."""
        beyond = np.eye(self.model.njoints, dtype=np.bool_)
        for body in range(1, self.model.njoints):
            beyond[:, body] |= beyond[:, self.model.parents[body]]
        return beyond

    @cached_property
    def sides(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which points a joint moves, and which it leaves (njoints, P) each; one on its axis is in neither."""
        inside: NDArray[np.bool_] = np.any(self.on[None] & self.beyond[..., None], axis=1)
        outside: NDArray[np.bool_] = np.any(self.on[None] & ~self.beyond[..., None], axis=1)
        return np.asarray(~outside), np.asarray(~inside)

    def joints_between(self, points: Sequence[int]) -> tuple[int, ...]:
        """Return the joints on which the shape of some points depends: those that move some and leave others."""
        moved, left = self.sides
        chosen = list(points)
        between = moved[:, chosen].any(axis=1) & left[:, chosen].any(axis=1)
        return tuple(int(joint) for joint in np.flatnonzero(between))

    @cached_property
    def axes(self) -> dict[int, Array]:
        """The axes of turning joints, in the joint's own frame."""
        axes = {}
        for joint in (*self.space.hinges, *self.space.turns):
            data = self.model.joints[joint].createData()
            q = np.zeros(self.model.nqs[joint])
            q[0] = float(self.model.nqs[joint] == 2)
            self.model.joints[joint].calc(data, q)
            axes[joint] = np.asarray(data.S).reshape(6)[3:].copy()
        return axes


def linkage_of(robot: Robot, *, points: Sequence[str] | None = None) -> Linkage:
    """Make the linkage of a robot.

    The origins of its turning joints are the points, those that coincide in every configuration merged into one and
    named after the first; then the base and the ends of its limbs, where they lie away from all joints. Points of one
    rigid body are joined each with each, so that a body of three or more is a rigid triangle, which closes loops.
    What lies beyond a sliding joint has no rigid segment to the rest, and is left out.

    Parameters
    ----------
    robot : Robot
        The robot, with or without a free base.
    points : sequence of str, optional
        Links or joints to take instead, as `Robot.frame_names` has them.

    Returns
    -------
    Linkage
        In metres; ``urdf`` names the robot.

    Raises
    ------
    InputError
        Where a frame is not known, two of those given coincide, or no rigid segments join all that are given.

    Examples
    --------
    >>> from posekit.robots import load_robot
    >>> arm = linkage_of(load_robot("ur5", geometry=False))
    >>> arm.points[:3]
    ('base_link', 'shoulder_pan_joint', 'shoulder_lift_joint')
    """
    unknown = [name for name in points or () if name not in robot.frame_names]
    if unknown:
        raise InputError(
            f"robot {robot.name}: there is no link or joint {shown(unknown[0])}; "
            f"{nearest(unknown[0], robot.frame_names)}"
        )
    names = _points_of(robot) if points is None else tuple(points)
    if len(names) < 2:
        raise InputError(
            f"robot {robot.name}: {len(names)} points; expected two or more joints that turn, or frames given by name"
        )
    carried = Carried(model=robot.model, names=names)
    segments: dict[tuple[str, str], float] = {}
    for a, b in combinations(range(len(names)), 2):
        bodies = np.flatnonzero(carried.on[:, a] & carried.on[:, b])
        if bodies.size:
            length = float(np.linalg.norm(carried.place[bodies[0], a] - carried.place[bodies[0], b]))
            segments[names[a], names[b]] = length
    return Linkage.from_names(
        name=robot.name,
        points=names,
        segments=segments,
        unit=1.0,
        urdf=robot.name,
        source=robot.source,
    )


def _points_of(robot: Robot) -> tuple[str, ...]:
    """Choose the points: base, turning joints in Pinocchio's order, ends."""
    model = robot.model
    carried = Carried(model=model, names=())
    base = carried.space.free[0] if robot.free_flyer else 0
    turning = {*carried.space.hinges, *carried.space.turns}
    within = {base}
    for joint in range(1, model.njoints):
        if joint in turning and model.parents[joint] in within:
            within.add(joint)
    inner = {model.parents[joint] for joint in within if joint != base}
    frames = frame_index(model)
    names: list[str] = []
    places: list[Array] = []

    def add(name: str, body: int, at: Array, *, apart: float) -> None:
        place = np.full((model.njoints, 3), np.nan)
        carried.spread(place, body, at)
        gaps = [np.linalg.norm(place - other, axis=1) for other in places]
        if all(np.nanmin(gap) > apart for gap in gaps if np.isfinite(gap).any()):
            names.append(name)
            places.append(place)

    def add_link(link: str, bodies: set[int]) -> None:
        frame = model.frames[frames[link]]
        if frame.parentJoint in bodies:
            add(link, frame.parentJoint, frame.placement.translation, apart=MIN_POINT_DISTANCE_METRES)

    for joint in sorted(within - {base}):
        add(model.names[joint], joint, np.zeros(3), apart=ON_AXIS)
    turning_points = len(names)
    for link in _base_links(robot):
        add_link(link, {base})
    base_points = names[turning_points:]
    for link in _last_links(robot):
        add_link(link, within - inner)
    return (*base_points, *names[:turning_points], *names[turning_points + len(base_points) :])


def _base_links(robot: Robot) -> list[str]:
    """Return the link of the base that carries the first moving joint."""
    moving = set(robot.joint_names)
    carriers = (
        parent.get("link", "")
        for joint in robot.tree.findall("joint")
        if joint.get("name") in moving and (parent := joint.find("parent")) is not None
    )
    on_base = int(robot.free_flyer)
    return [link for link in carriers if robot.model.frames[robot.frame_id(link)].parentJoint == on_base][:1]


def _last_links(robot: Robot) -> list[str]:
    """Return the links from which no joint leads further."""
    parents = {parent.get("link") for parent in robot.tree.findall("joint/parent")}
    links = (link.get("name", "") for link in robot.tree.findall("link"))
    return [link for link in links if link not in parents]
