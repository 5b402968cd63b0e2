"""Random configurations of a robot within its limits, and pictures of them."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from posekit.errors import InputError
from posekit.formats.own import ObjectView, ScaledOrthographicModel
from posekit.geometry import Array
from posekit.objects.articulated import ArticulatedObject
from posekit.robots import Kinematics, Robot, body_points
from posekit.robots.configuration_space import ConfigurationSpace

PIXELS_PER_METRE = 500.0
"""Pixels a metre in the pictures."""


def draw_configurations(robot: Robot, count: int, rng: np.random.Generator) -> Array:
    """Draw configurations (N, nq): joints evenly within their limits, and one turn; a free base any way round.

    Parameters
    ----------
    robot : Robot
        The robot, whose limits are kept.
    count : int
        How many configurations are drawn: N.
    rng : numpy.random.Generator
        Seeded by the caller.
    """
    space = ConfigurationSpace(robot.model)
    q = np.tile(pin.neutral(robot.model), (count, 1))
    for at in space.bounded_q:
        lower, upper = float(space.lower[at]), float(space.upper[at])
        if upper - lower > 2 * math.pi:  # the turn that is nearest to zero
            lower = min(max(lower, -math.pi), upper - 2 * math.pi)
            upper = lower + 2 * math.pi
        q[:, at] = rng.uniform(lower, upper, count)
    for at in space.turn_q:
        angle = rng.uniform(-np.pi, np.pi, count)
        q[:, at], q[:, at + 1] = np.cos(angle), np.sin(angle)
    for at in space.free_q:
        turned = rng.standard_normal((count, 4))
        q[:, at + 3 : at + 7] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    return q


def draw_view(
    thing: ArticulatedObject,
    count: int,
    rng: np.random.Generator,
    *,
    noise: float = 0.0,
    scale_known: bool = True,
) -> ObjectView:
    """Draw configurations within a robot's limits, each seen from anywhere by a scaled orthographic camera.

    Parameters
    ----------
    thing : ArticulatedObject
        With a robot.
    count : int
        How many frames are drawn.
    rng : numpy.random.Generator
        Seeded by the caller.
    noise : float
        Standard deviation of the image points, pixels.
    scale_known : bool
        Whether the view says the scale.

    Raises
    ------
    InputError
        Where the object has no robot.
    """
    if thing.robot is None:
        raise InputError(
            f"linkage {thing.linkage.name} has no robot to draw configurations of; give one with urdf"
        )
    q = draw_configurations(thing.robot, count, rng)
    truth = Kinematics(model=thing.robot.model, points=body_points(thing.linkage.points)).positions(q)
    image = truth[..., :2] * PIXELS_PER_METRE
    return ObjectView(
        points=thing.linkage.points,
        camera=ScaledOrthographicModel(scale=PIXELS_PER_METRE if scale_known else None),
        time=np.arange(count, dtype=np.float64),
        image=image + noise * rng.normal(size=image.shape) if noise else image,
        truth=truth,
    )
