"""Checks of the configurations of a robot: joint limits, mimic joints, self-collision, and reach of given positions."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np

from posekit.geometry import Array, cross, median_lean, unit
from posekit.settings import EXACT, MEASURED
from posekit.skeleton import FEET_POINTS, JOINT, JOINTS, SIDES
from posekit.validators.body import MADE_UP_METRES, Body
from posekit.validators.check import Judgement, NotAskedError, check
from posekit.validators.ranges import load_ranges

if TYPE_CHECKING:
    from posekit.robots import Robot

#: Tolerance of mimic joints, degrees, for angles that a file rounds to few digits.
MIMIC_DEGREES: Final = 0.5

#: Tolerance for rounding, metres.
CONTACT_METRES: Final = 1e-9

#: Largest measured distance between bodies, metres; it is also the margin with a share of 1.
NEAR_METRES: Final = 0.02


#: Largest distance of a foot's joint from the ankle, as a share of the leg; and range of heights in one sole, metres.
FOOT_SHARE, SOLE_METRES = 0.1, 0.02


#: Least decrease of the median lean, degrees, by which another order of the root's quaternion is a doubt.
LESS_LEAN_DEGREES: Final = 30.0


def order_doubts(body: Body) -> list[str]:
    """Return a warning if a humanoid is upright only when its quaternions are read in the order w, x, y, z.

    A single posture causes no warning, because a robot may also lie on the ground.
    """
    robot, up = body.robot, np.eye(3)[2] if body.up is None else body.up
    known = np.empty((0, 4)) if body.q is None else body.q[np.isfinite(body.q).all(axis=1), 3:7]
    if robot is None or len(known) < 2 or not robot.free_flyer or not robot.joint_map:
        return []
    neck, pelvis = robot.points(robot.neutral[None])[0, [JOINT["neck"], JOINT["pelvis"]]]
    lean, other = (median_lean(q, up, unit(neck - pelvis)) for q in (known, known[:, [1, 2, 3, 0]]))
    said = (
        f"The robot leans by {lean:.0f} degrees, and by {other:.0f} if its quaternions are w, x, y, z: check"
    )
    return [f"{said} their order; posekit reads x, y, z, w."] * (lean - other > LESS_LEAN_DEGREES)


@check("joint-range", unit="deg", reads=("q", "robot"))
def robot_range(body: Body) -> Judgement:
    """Joints are outside the limits of the URDF, or of the table of ranges in the settings."""
    return _range(body, "rad", float(np.degrees(1.0)))


@check("joint-travel", unit="m", reads=("q", "robot"))
def robot_travel(body: Body) -> Judgement:
    """Prismatic joints are outside the limits of the URDF."""
    return _range(body, "m", 1.0)


def _range(body: Body, unit_of_q: str, factor: float) -> Judgement:
    robot, q = _of(body)
    lower, upper = np.array(robot.lower), np.array(robot.upper)
    names, table = list(robot.configuration_names), load_ranges(body.settings.ranges)
    # Tables of other kinds have limits of people's angles.
    limits = table["limits"] if table is not None and table["kind"] == "joints" else {}
    for at, name in enumerate(names):
        if name in limits:
            lower[at], upper[at] = np.array(limits[name]) / factor
    bounded = np.isfinite(lower) | np.isfinite(upper)
    which = [k for k, own in enumerate(robot.units) if own == unit_of_q and bounded[k]]
    if not which:
        raise NotAskedError("the URDF has no such limits")
    given = body.settings.angle_tolerance
    tolerance = EXACT.rigid if unit_of_q == "m" else EXACT.angle if given is None else given
    bounds = factor * lower[which], factor * upper[which]
    return Judgement([names[k] for k in which], factor * q[:, which], *bounds, tolerance)


def _of(body: Body) -> tuple[Robot, Array]:
    """Return the robot and its configurations for a check that reads both."""
    return cast("tuple[Robot, Array]", (body.robot, body.q))


@check("mimic", unit="deg", reads=("q", "robot"))
def mimic_joints(body: Body) -> Judgement:
    """Joints do not follow the joints that they mimic.

    The value is the position of a mimic joint minus the position that the mimicked joint prescribes.
    """
    robot, q = _of(body)
    if not robot.mimics:
        raise NotAskedError("no joint of the URDF mimics another one")
    value = np.degrees(robot.mimic_errors(q))
    return Judgement([one.joint for one in robot.mimics], value, 0.0, 0.0, MIMIC_DEGREES, scale=MIMIC_DEGREES)


@check("collision", unit="m", reads=("q", "robot"))
def robot_collision(body: Body) -> Judgement:
    """Two bodies of the robot penetrate each other.

    The value is the distance between two bodies. The place ``bodies`` is the pair with the smallest distance. Distances
    above `NEAR_METRES` are reported as infinite. Distances between meshes that do not touch are also infinite:
    measuring them would double the time of the check.
    """
    robot, q = _of(body)
    if not robot.collision_pairs:
        raise NotAskedError("the robot has no bodies that can touch")
    made_up = robot.bodies == "capsules" and not body.settings.strict
    margin = body.settings.contact_margin - (MADE_UP_METRES if made_up else 0.0)
    known = np.flatnonzero(np.isfinite(q).all(axis=1))
    meshes = any("BV" in type(one.geometry).__name__ for one in robot.geometry.geometryObjects)
    found = robot.collisions(q[known], margin=max(margin, 0.0 if meshes else NEAR_METRES))
    pairs, column = np.unique(found.pair[found.distance < margin], return_inverse=True)
    value = np.full((len(q), len(pairs) + 1), np.nan)
    value[known] = np.inf
    np.minimum.at(value[:, -1], known[found.frame], found.distance)
    touching = found.distance < margin
    value[known[found.frame[touching]], column] = found.distance[touching]
    links = dict(zip(robot.body_names, robot.body_links, strict=True))
    places = ["-".join(links[name] for name in robot.collision_pairs[pair]) for pair in pairs.tolist()]
    # Each pair that touches has its own place.
    value[value[:, -1] < margin, -1] = np.inf
    return Judgement([*places, "bodies"], value, margin, tolerance=CONTACT_METRES, scale=NEAR_METRES)


@check("reach", unit="m", reads=("q", "robot"))
def reach(body: Body) -> Judgement:
    """Joints cannot reach their given positions within the robot's limits.

    The value is the distance between a joint in the fitted configuration and its given position.
    """
    if body.residual is None:
        raise NotAskedError("configurations are given, not positions")
    given = body.settings.rigid_tolerance
    upper = MEASURED.rigid if given is None else given
    return Judgement(JOINTS, body.residual, upper=upper, tolerance=body.noise)


#: Checks of configurations, in the order of reports.
CONFIGURATION_CHECKS: Final = (reach, robot_range, robot_travel, mimic_joints, robot_collision)


@lru_cache(maxsize=4)
def _soles(robot: Robot) -> tuple[list[int], Array] | None:
    """Return parent joints of toes and heels, and positions (4, 3) in the frames of these joints; None without feet.

    Toes and heels are the front and back corners of the bounding boxes of the foot bodies.
    """
    import pinocchio as pin

    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, np.array(robot.neutral))
    at = robot.points(np.array(robot.neutral)[None])[0]
    hips, ankles = ([at[JOINT[f"{side}_{name}"]] for side in SIDES] for name in ("hip", "ankle"))
    down = unit(ankles[0] + ankles[1] - hips[0] - hips[1])
    forward = unit(cross(down, hips[1] - hips[0]))
    ends: list[tuple[int, Array]] = []
    for ankle in ankles:
        near = FOOT_SHARE * float(np.linalg.norm(hips[0] - ankles[0]))
        corners = [
            (body.parentJoint, (data.oMi[body.parentJoint] * body.placement).act(corner))
            for body in robot.geometry.geometryObjects
            if np.linalg.norm(data.oMi[body.parentJoint].translation - ankle) < near
            for corner in _box(body.geometry)
        ]
        if not corners:
            return None
        deepest = max(float(place @ down) for _, place in corners) - SOLE_METRES
        sole = sorted(
            (one for one in corners if one[1] @ down > deepest), key=lambda one: float(one[1] @ forward)
        )
        ends += [sole[-1], sole[0]]
    order = [ends[k] for k in (0, 2, 1, 3)]
    return [joint for joint, _ in order], np.array([data.oMi[joint].actInv(place) for joint, place in order])


def _box(shape: Any) -> Array:
    """Return the corners (8, 3) of the bounding box of a body, in the frame of the body."""
    shape.computeLocalAABB()
    ends = np.array([np.ravel(shape.aabb_local.min_), np.ravel(shape.aabb_local.max_)])
    return np.stack(np.meshgrid(*ends.T), axis=-1).reshape(-1, 3)


def sole_points(robot: Robot, q: Array) -> Array:
    """Return the positions of toes and heels (N, 4, 3), metres, by forward kinematics; NaN if a robot has no feet."""
    points = np.full((len(q), len(FEET_POINTS), 3), np.nan)
    soles = _soles(robot)
    if soles is not None:
        from posekit.robots.kinematics import Kinematics, Site

        sites = [Site(joint, place) for joint, place in zip(*soles, strict=True)]
        known = np.asarray(np.isfinite(q).all(axis=1))
        points[known] = Kinematics(robot.model, sites).positions(q[known])
    return points
