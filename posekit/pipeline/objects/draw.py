"""Random configurations of a robot within its limits."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from posekit.cameras import Array
from posekit.robot import Robot
from posekit.robot.configuration_space import ConfigurationSpace


def draw_configurations(robot: Robot, count: int, rng: np.random.Generator) -> Array:
    """Draw configurations (N, nq): joints evenly within their limits, and one turn; a free base any way round.

    Parameters
    ----------
    robot : Robot
    count : int
    rng : numpy.random.Generator
    """
    space = ConfigurationSpace(robot.model)
    q = np.tile(pin.neutral(robot.model), (count, 1))
    for at in space.bounded_q:
        lower, upper = float(space.lower[at]), float(space.upper[at])
        if upper - lower > 2 * math.pi:
            lower, upper = max(lower, -math.pi), min(upper, math.pi)
        q[:, at] = rng.uniform(lower, upper, count)
    for at in space.turn_q:
        angle = rng.uniform(-np.pi, np.pi, count)
        q[:, at], q[:, at + 1] = np.cos(angle), np.sin(angle)
    for at in space.free_q:
        turned = rng.standard_normal((count, 4))
        q[:, at + 3 : at + 7] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    return q
