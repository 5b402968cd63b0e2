"""Checks of joints' speeds, accelerations and jerks against bounds measured on people; joint velocities of robots."""

from __future__ import annotations

from math import comb
from typing import Final

import numpy as np

from posekit.geometry import Array, norm
from posekit.skeleton import JOINTS, N_TRUNK_JOINTS
from posekit.validators.body import Body
from posekit.validators.check import Judgement, NotAskedError, check
from posekit.validators.motion.frames import explained
from posekit.validators.motion.timeline import spaced, timeline_of

#: Minimum time step of finite differences, seconds; smaller steps amplify noise.
SHORTEST_SECONDS: Final = 1.0 / 60.0

#: Tolerance of finite differences, in standard deviations of their noise.
NOISE_DEVIATIONS: Final = 5.0

#: Velocity limit of a URDF from which on it counts as unlimited, radians or metres per second.
NO_LIMIT: Final = 1e6


@check("speed", unit="m/s", reads=("joints", "time"), over_time=True)
def speed(body: Body, *, trunk: float = 14.0, limbs: float = 30.0) -> Judgement:
    """Joints move faster than people can.

    Parameters
    ----------
    trunk : float
        Largest allowed speed of neck, shoulders, pelvis and hips, metres per second.
    limbs : float
        Largest allowed speed of the other joints, metres per second.
    """
    return _derivative(body, 1, trunk, limbs)


@check("acceleration", unit="m/s²", reads=("joints", "time"), over_time=True)
def acceleration(body: Body, *, trunk: float = 400.0, limbs: float = 1200.0) -> Judgement:
    """Accelerations of joints are larger than people's.

    The parameters are bounds as in `speed`, metres per second squared.
    """
    return _derivative(body, 2, trunk, limbs)


@check("jerk", unit="m/s³", reads=("joints", "time"), over_time=True)
def jerk(body: Body, *, trunk: float = 48_000.0, limbs: float = 144_000.0) -> Judgement:
    """Jerks of joints are larger than people's.

    The parameters are bounds as in `speed`, metres per second cubed.
    """
    return _derivative(body, 3, trunk, limbs)


def _derivative(body: Body, order: int, trunk: float, limbs: float) -> Judgement:
    """Judge a time derivative of positions by finite differences over 1/60 s, or over one frame if it is longer."""
    found = explained(body)
    stride = max(round(SHORTEST_SECONDS / body.dt), 1)
    weights = [(-1.0) ** (order - k) * comb(order, k) for k in range(order + 1)]
    seconds = (stride * body.dt) ** order
    values = norm(spaced(found.joints, weights, stride)) / seconds
    if order == 1:
        values = np.where(np.isnan(values), _over_gaps(found.joints) / body.dt, values)
    spread = float(np.sqrt(3.0 * comb(2 * order, order)) * body.noise / seconds)
    upper = np.where(np.arange(len(JOINTS)) < N_TRUNK_JOINTS, trunk, limbs)
    return Judgement(
        JOINTS, found.timeline.of_frames(values), upper=upper, tolerance=NOISE_DEVIATIONS * spread
    )


def _over_gaps(joints: Array) -> Array:
    """Return the mean speeds (S, 14) of joints over the gap before each slot, metres per slot; NaN without a gap."""
    slots = np.arange(len(joints))[:, None]
    known = np.isfinite(joints[..., 0])
    last = np.maximum.accumulate(np.where(known, slots, -1), axis=0)
    before = np.pad(last, ((1, 0), (0, 0)), constant_values=-1)[:-1]
    way = norm(joints - np.take_along_axis(joints, np.maximum(before, 0)[..., None], axis=0))
    return np.where((before >= 0) & (before < slots - 1), way / np.maximum(slots - before, 1), np.nan)


@check("joint-velocity", unit="1", reads=("q", "robot", "time"), over_time=True)
def joint_velocity(body: Body, *, share: float = 1.0, most: float = 0.0) -> Judgement:
    """Robot joints move faster than their limits.

    Parameters
    ----------
    share : float
        Allowed velocity, as a share of the URDF's velocity limit.
    most : float
        Largest velocity of revolute joints, radians per second, in place of the URDF's limits; 0 for the URDF's limits.
    """
    robot = body.robot
    if robot is None or body.q is None:
        raise NotAskedError("there are no configurations of a robot (--urdf)")
    line, sizes = timeline_of(body), robot.model.nvs
    names = [
        name if size == 1 else f"{name}.{k}"
        for name, size in zip(robot.model.names, sizes, strict=True)
        for k in range(size)
    ]
    limits = np.array(robot.model.velocityLimit, dtype=np.float64)
    if most:
        joints = zip(robot.model.joints, sizes, strict=True)
        revolute = [size == 1 and "P" not in joint.shortname() for joint, size in joints for _ in range(size)]
        limits = np.where(revolute, most, np.inf)
    # The root has no limit, and a limit of 0 or a huge number in a URDF means unlimited.
    limited = np.flatnonzero(np.isfinite(limits) & (limits > 0) & (limits < NO_LIMIT))
    if not len(limited):
        raise NotAskedError("the URDF has no velocity limits")
    times: Array = body.dt * np.arange(line.count, dtype=np.float64)
    velocity = robot.velocities(line.spread(body.q), times)[:, limited]
    first = np.full((1, len(limited)), np.nan)
    value = line.of_frames(np.abs(np.concatenate([first, velocity])) / limits[limited])
    return Judgement([names[k] for k in limited], value, upper=share)
