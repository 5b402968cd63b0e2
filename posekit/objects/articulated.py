"""The object that a picture shows: a linkage, and the robot that it belongs to where it has a URDF."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from posekit.errors import InputError
from posekit.linkages import Linkage, linkage_names, load_linkage
from posekit.linkages.robot_linkage import Carried, linkage_of
from posekit.objects.object_tolerance import ObjectTolerance
from posekit.robots import Robot, load_robot, robot_names
from posekit.safe_io import nearest, refusal, shown
from posekit.validators.robot_limits import RobotLimits

SAME_LENGTH = 1e-3
"""Of the longest: how far a linkage's rounded lengths may be from those of its robot, which are taken then."""

URDF_SUFFIXES = (".urdf", ".xml")


@dataclass(frozen=True, kw_only=True, eq=False)
class ArticulatedObject:
    """A linkage, with the robot whose limits judge its postures.

    Parameters
    ----------
    linkage : Linkage
        Its points, its segments and their lengths.
    robot : Robot, optional
        Free-flying; the linkage's points are links or joints of it.

    Raises
    ------
    InputError
        Where a robot is given and the linkage's lengths are relative, a point is no frame of the robot, or a segment
        is not rigid in it or has another length.
    """

    linkage: Linkage
    robot: Robot | None = None

    def __post_init__(self) -> None:
        if self.robot is not None:
            object.__setattr__(self, "linkage", _with_lengths_of(self.robot, self.linkage))

    @cached_property
    def factor(self) -> float:
        """Working units in one unit of the linkage: metres, or longest segments where the lengths are relative."""
        return self.linkage.unit or 1.0 / float(self.linkage.lengths.max())

    @property
    def back(self) -> float:
        """Working units in one unit of the result: 1 where that is the metre, else as `factor`."""
        return self.factor if self.linkage.unit is None else 1.0

    @cached_property
    def working(self) -> Linkage:
        """The linkage with its lengths in working units, so that all tolerances mean the same."""
        height = self.linkage.height
        return replace(
            self.linkage,
            lengths=self.linkage.lengths * self.factor,
            unit=1.0,
            height=None if height is None else height * self.factor,
        )

    @cached_property
    def limits(self) -> RobotLimits | None:
        """What the limits of the robot say about the points."""
        return None if self.robot is None else RobotLimits(robot=self.robot, names=self.linkage.points)


def load_object(name: str | Path) -> ArticulatedObject:
    """Load an object by name or from a file.

    Parameters
    ----------
    name : str or path
        A built-in linkage (`posekit.linkages.linkage_names`), the TOML file of one, a robot
        (`posekit.robots.robot_names`: ``panda``, ``ur5``, ``allegro``, …), or the path of a URDF.

    Raises
    ------
    InputError
        Where there is nothing of this name, or what there is describes no object.

    Examples
    --------
    >>> load_object("allegro").linkage.points[:2]
    ('joint_0.0', 'joint_1.0')
    """
    text = str(name)
    if text in linkage_names() or text.lower().endswith(".toml"):
        linkage = load_linkage(name)
        if linkage.urdf is None:
            return ArticulatedObject(linkage=linkage)
        return ArticulatedObject(linkage=linkage, robot=load_robot(linkage.urdf, geometry=False))
    if text.lower().endswith(URDF_SUFFIXES) or text in robot_names():
        robot = load_robot(name, geometry=False)
        return ArticulatedObject(linkage=linkage_of(robot), robot=robot)
    known = (*linkage_names(), *robot_names())
    near = nearest(text, known)
    remedy = (
        near
        if near.startswith("did")
        else f"some names are {', '.join(linkage_names())}, panda, ur5, allegro"
    )
    raise refusal(
        "--linkage", "", shown(text), "a linkage or a robot by name, a .toml or a .urdf file", remedy
    )


def tolerance_of(
    thing: ArticulatedObject, *, rigid: float | None = None, tangent: float | None = None
) -> ObjectTolerance | None:
    """Make the tolerance of what the command line gives.

    Parameters
    ----------
    thing : ArticulatedObject
        The object, whose unit the tolerance gets.
    rigid, tangent : float, optional
        Metres; as for measured points where one is not given. Points may be off by half of `tangent`.

    Returns
    -------
    ObjectTolerance or None
        In the linkage's unit; None where neither is given.

    Raises
    ------
    InputError
        Where the linkage's lengths are relative: metres mean nothing then.
    """
    if rigid is None and tangent is None:
        return None
    unit = thing.linkage.unit
    if unit is None:
        raise InputError(
            f"--rigid-tolerance, --tangent-tolerance: the lengths of linkage {thing.linkage.name} are relative; "
            "leave the options out, or give unit in the linkage"
        )
    default = ObjectTolerance.measured(float(thing.linkage.lengths.max()))
    least = default.tangent if tangent is None else tangent / unit
    return ObjectTolerance(
        rigid=default.rigid if rigid is None else rigid / unit, tangent=least, point=least / 2
    )


def _with_lengths_of(robot: Robot, linkage: Linkage) -> Linkage:
    """Give a linkage its robot's lengths, to the last digit; refuse one that is not the robot's."""
    where = f"linkage {linkage.name}"
    if linkage.unit is None:
        raise InputError(
            f"{where}: its lengths are relative, and those of its robot {robot.name} metres; give unit in it (1 for "
            "metres), or leave urdf out"
        )
    if linkage.midpoints:
        raise InputError(
            f"{where}: midpoints are no frames of its robot {robot.name}; leave urdf or them out"
        )
    for point in linkage.points:
        if point not in robot.frame_names:
            raise InputError(
                f"{where}: {shown(point)} is no link or joint of its robot {robot.name}; "
                f"{nearest(point, robot.frame_names)}"
            )
    carried = Carried(model=robot.model, names=linkage.points)
    allowed = SAME_LENGTH * float(linkage.lengths.max()) * linkage.unit
    lengths = linkage.lengths.copy()
    for number, (name, (a, b), length) in enumerate(
        zip(linkage.segment_names, linkage.segments, linkage.lengths.tolist(), strict=True)
    ):
        bodies = np.flatnonzero(carried.on[:, a] & carried.on[:, b])
        if not bodies.size:
            between = ", ".join(robot.model.names[joint] for joint in carried.joints_between((a, b)))
            raise InputError(
                f"{where}: {name} is no rigid segment of its robot {robot.name}: {between} is between; leave it out"
            )
        true = float(np.linalg.norm(carried.place[bodies[0], a] - carried.place[bodies[0], b]))
        if abs(true - length * linkage.unit) > allowed:
            raise InputError(
                f"{where}: {name} is {length * linkage.unit:.6g} m long, and {true:.6g} m in its robot {robot.name}; "
                "correct one of the two"
            )
        lengths[number] = true / linkage.unit
    return replace(linkage, lengths=lengths)
